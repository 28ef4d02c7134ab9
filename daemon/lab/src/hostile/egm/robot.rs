//! The robot whose edge is attacked: it stands, or turns its last joint, and says so each cycle.

use std::io::ErrorKind;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use egm_messages::{
    EgmClock, EgmFeedBack, EgmHeader, EgmJoints, EgmMciState, EgmMeasuredForce, EgmMotorState, EgmPlanned,
    EgmRapidCtrlExecState, EgmRobot, EgmSensor, MciStateType, Message, MessageType, MotorStateType,
    RapidCtrlExecStateType,
};

use crate::hostile::arena::Findings;

/// Cycle of the robot.
pub(super) const CYCLE: Duration = Duration::from_millis(4);
/// Where its joints are, degrees.
const POSE: [f64; 6] = [17.0, 68.0, -103.0, 126.0, 90.0, 17.0];
/// The joint that turns, and how fast, degrees/s.
const TURNING: usize = 5;
pub(super) const SPEED: f64 = 2.0;

/// One robot, and the address that it sends from.
pub(super) struct Robot {
    pub(super) socket: UdpSocket,
    /// Its joints' limits as the edge is told them, degrees/s.
    limits: Vec<f64>,
    pub(super) cycle: u32,
    next: Instant,
    turned: f64,
    pub(super) answers: u64,
}

/// What it was answered in one cycle, degrees/s; the fastest joint of each answer.
pub(super) type Speeds = Vec<f64>;

impl Robot {
    pub(super) fn new(edge: SocketAddr, limits: &[f64]) -> Result<Self, String> {
        let failed = |error: std::io::Error| format!("a robot's socket: {error}");
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).map_err(failed)?;
        socket.connect(edge).map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        Ok(Self { socket, limits: limits.to_vec(), cycle: 0, next: Instant::now(), turned: 0.0, answers: 0 })
    }

    /// Its message of this cycle.
    pub(super) fn message(&self) -> EgmRobot {
        let mut joints = POSE.to_vec();
        joints[TURNING] += self.turned;
        let joints = || Some(EgmJoints { joints: joints.clone() });
        let microseconds = u64::from(self.cycle) * CYCLE.as_micros() as u64;
        let time = Some(EgmClock { sec: microseconds / 1_000_000, usec: microseconds % 1_000_000 });
        EgmRobot {
            header: Some(EgmHeader {
                seqno: Some(self.cycle),
                tm: Some((microseconds / 1000) as u32),
                mtype: Some(MessageType::Data as i32),
            }),
            feed_back: Some(EgmFeedBack { joints: joints(), time, ..EgmFeedBack::default() }),
            planned: Some(EgmPlanned { joints: joints(), ..EgmPlanned::default() }),
            motor_state: Some(EgmMotorState { state: MotorStateType::On as i32 }),
            mci_state: Some(EgmMciState { state: MciStateType::Running as i32 }),
            rapid_exec_state: Some(EgmRapidCtrlExecState { state: RapidCtrlExecStateType::Running as i32 }),
            measured_force: Some(EgmMeasuredForce { fc_active: Some(true), force: vec![0.0; 6] }),
            torque_ref: Some(EgmJoints { joints: vec![0.0; 6] }),
            ..EgmRobot::default()
        }
    }

    /// One cycle: its message, what `attack` sends meanwhile, and what it is answered until the next.
    pub(super) fn turn(&mut self, turns: bool, findings: &mut Findings, attack: impl FnOnce(&Self)) -> Speeds {
        self.cycle += 1;
        self.turned += if turns { SPEED * CYCLE.as_secs_f64() } else { 0.0 };
        // An edge that has ended hears nothing, which is found elsewhere.
        let _ = self.socket.send(&self.message().encode_to_vec());
        attack(self);
        // A machine that was busy is not caught up with.
        self.next = (self.next + CYCLE).max(Instant::now());
        std::thread::sleep(self.next.saturating_duration_since(Instant::now()));
        self.hear(findings)
    }

    fn hear(&mut self, findings: &mut Findings) -> Speeds {
        let (mut speeds, mut buffer) = (Vec::new(), [0; 8192]);
        loop {
            match self.socket.recv(&mut buffer) {
                Ok(length) => {
                    self.answers += 1;
                    speeds.extend(findings.take(self.speed(&buffer[..length])));
                }
                // What a port that nobody listens at answers.
                Err(error) if error.kind() == ErrorKind::ConnectionRefused => {}
                Err(_) => return speeds,
            }
        }
    }

    /// The fastest joint of an answer, and what is wrong with it.
    fn speed(&self, answer: &[u8]) -> Result<f64, String> {
        let message = EgmSensor::decode(answer).map_err(|error| format!("an answer that is no message: {error}"))?;
        let joints = message.speed_ref.and_then(|speeds| speeds.joints).map(|list| list.joints).unwrap_or_default();
        let are_sound = joints.len() == self.limits.len() && joints.iter().all(|speed| speed.is_finite());
        if !are_sound || joints.iter().zip(&self.limits).any(|(speed, limit)| speed.abs() > limit * (1.0 + 1e-9)) {
            return Err(format!("an answer of {joints:?} degrees/s: accepted: within {:?}", self.limits));
        }
        Ok(joints.iter().fold(0.0, |most, speed| speed.abs().max(most)))
    }
}
