//! The robot controller: what it says of itself, what it was told, and when it no longer believes it.

use admittance_core::quantities::Span;
use admittance_host::robot_description::KindName;
use egm_messages::{
    EgmClock, EgmFeedBack, EgmHeader, EgmJoints, EgmMciState, EgmMeasuredForce, EgmMotorState, EgmPlanned,
    EgmRapidCtrlExecState, EgmRobot, EgmSensor, JointUnit, MciStateType, Message, MessageType, MotorStateType,
    RapidCtrlExecStateType,
};
use ipc_types::{MAX_JOINTS, StateSample};

use crate::egm_section::EgmSection;
use crate::scenario::Scenario;

/// What the robot's clock shows at the first message, ns: nobody may take it for this host's.
const CLOCK_STARTS_NS: u64 = 86_400_000_000_000;

/// What the joints follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Told {
    /// Speeds in rad/s or m/s.
    Speeds([f64; MAX_JOINTS]),
    /// Nothing yet, or nothing for too long.
    Nothing,
}

impl Told {
    pub(super) fn speeds(self) -> [f64; MAX_JOINTS] {
        match self {
            Self::Speeds(speeds) => speeds,
            Self::Nothing => [0.0; MAX_JOINTS],
        }
    }
}

#[derive(Debug)]
pub(super) struct RobotController {
    units: Vec<JointUnit>,
    first_ns: u64,
    drift_ppm: f64,
    comm_timeout_ns: u64,
    told: Told,
    heard_ns: Option<u64>,
    has_stopped: bool,
    missed: u64,
    not_understood: u64,
}

impl RobotController {
    /// The controller of a scenario's robot, whose first message is sent at `first_ns`.
    pub(super) fn new(scenario: &Scenario, egm: &EgmSection, first_ns: u64) -> Self {
        let unit = |kind| match kind {
            KindName::Revolute => JointUnit::Degree,
            KindName::Prismatic => JointUnit::Millimetre,
        };
        Self {
            units: scenario.robot.joint.iter().map(|joint| unit(joint.kind)).collect(),
            first_ns,
            drift_ppm: egm.clock_drift_ppm,
            comm_timeout_ns: Span::from_seconds(egm.comm_timeout_s).nanoseconds(),
            told: Told::Nothing,
            heard_ns: None,
            has_stopped: false,
            missed: 0,
            not_understood: 0,
        }
    }

    /// Takes a datagram that was there by `now_ns`. Whether it was a message with a speed for each joint.
    pub(super) fn hear(&mut self, datagram: &[u8], now_ns: u64) -> bool {
        let Some(speeds) = EgmSensor::decode(datagram).ok().and_then(|message| self.speeds(&message)) else {
            self.not_understood += 1;
            return false;
        };
        self.heard_ns = Some(now_ns);
        if !self.has_stopped {
            self.told = Told::Speeds(speeds);
        }
        true
    }

    fn speeds(&self, message: &EgmSensor) -> Option<[f64; MAX_JOINTS]> {
        let joints = &message.speed_ref.as_ref()?.joints.as_ref()?.joints;
        if joints.len() != self.units.len() || joints.iter().any(|speed| !speed.is_finite()) {
            return None;
        }
        let mut speeds = [0.0; MAX_JOINTS];
        for ((speed, told), unit) in speeds.iter_mut().zip(joints).zip(&self.units) {
            *speed = unit.to_si(*told);
        }
        Some(speeds)
    }

    /// A cycle passed without a message.
    pub(super) fn miss(&mut self) {
        self.missed += 1;
    }

    /// Whether nothing was heard for CommTimeout; true once. EGM has ended then, and nothing starts it again.
    pub(super) fn stops_by_itself(&mut self, now_ns: u64) -> bool {
        let is_silent = self.heard_ns.is_some_and(|heard_ns| now_ns.saturating_sub(heard_ns) >= self.comm_timeout_ns);
        if self.has_stopped || !is_silent {
            return false;
        }
        (self.has_stopped, self.told) = (true, Told::Nothing);
        true
    }

    /// What the joints follow from here on: the last that was told, however old, until CommTimeout.
    pub(super) fn told(&self) -> Told {
        self.told
    }

    /// Whether a message was ever heard.
    pub(super) fn has_heard(&self) -> bool {
        self.heard_ns.is_some()
    }

    /// Cycles without a message, after the first one.
    pub(super) fn missed(&self) -> u64 {
        self.missed
    }

    /// Datagrams that were no message with a speed for each joint.
    pub(super) fn not_understood(&self) -> u64 {
        self.not_understood
    }

    /// The message about a sample, encoded.
    pub(super) fn message(&self, sample: &StateSample) -> Vec<u8> {
        let since_ns = sample.stamp_ns.wrapping_sub(self.first_ns).cast_signed() as f64;
        let clock_ns = CLOCK_STARTS_NS.saturating_add_signed((since_ns * (1.0 + self.drift_ppm * 1e-6)) as i64);
        let time = EgmClock { sec: clock_ns / 1_000_000_000, usec: clock_ns % 1_000_000_000 / 1000 };
        // A fault may claim a joint too many.
        let count = (sample.joint_count as usize).min(MAX_JOINTS);
        let joints = |values: &[f64; MAX_JOINTS]| {
            let unit = |joint: usize| self.units.get(joint).copied().unwrap_or(JointUnit::Degree);
            Some(EgmJoints { joints: (0..count).map(|joint| unit(joint).from_si(values[joint])).collect() })
        };
        let moves = sample.drives_enabled == 1;
        let state = |is_so: bool, yes: i32, no: i32| if is_so { yes } else { no };
        let message = EgmRobot {
            header: Some(EgmHeader {
                seqno: Some(sample.sequence as u32),
                tm: Some((clock_ns / 1_000_000) as u32),
                mtype: Some(MessageType::Data as i32),
            }),
            feed_back: Some(EgmFeedBack {
                joints: joints(&sample.joint_position),
                time: Some(time),
                ..EgmFeedBack::default()
            }),
            planned: Some(EgmPlanned {
                joints: joints(&sample.joint_position_reference),
                time: Some(time),
                ..EgmPlanned::default()
            }),
            motor_state: Some(EgmMotorState {
                state: state(moves, MotorStateType::On as i32, MotorStateType::Off as i32),
            }),
            mci_state: Some(EgmMciState {
                state: state(!self.has_stopped, MciStateType::Running as i32, MciStateType::Stopped as i32),
            }),
            mci_convergence_met: Some(false),
            rapid_exec_state: Some(EgmRapidCtrlExecState { state: RapidCtrlExecStateType::Running as i32 }),
            measured_force: Some(EgmMeasuredForce {
                fc_active: Some(sample.wrench_valid == 1),
                force: sample.wrench.to_vec(),
            }),
            utilization_rate: Some(0.0),
            torque_ref: (sample.torque_valid == 1).then(|| EgmJoints { joints: sample.joint_torque[..count].to_vec() }),
        };
        message.encode_to_vec()
    }
}
