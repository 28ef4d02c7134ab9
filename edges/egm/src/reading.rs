//! What a robot's message says, in SI units and complete: or why it cannot be used.

use egm_messages::{EgmJoints, EgmRobot, JointUnit, MciStateType, MessageType, MotorStateType, RapidCtrlExecStateType};
use ipc_types::{MAX_JOINTS, TASK_AXES};

/// One message of the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Its number.
    pub sequence: u32,
    /// When it was measured, on the robot's clock.
    pub time: RobotTime,
    /// q, rad or m.
    pub position: [f64; MAX_JOINTS],
    /// q0, where the robot's own program leads, rad or m; q where other programs lead, and `planned` is not looked at.
    pub reference: [f64; MAX_JOINTS],
    /// As the robot gives it, N and N m; `None` when it gives none that may be used.
    pub wrench: Option<[f64; TASK_AXES]>,
    /// `torqueRef` as the robot gives it; `None` when it gives none that may be used.
    pub torque: Option<[f64; MAX_JOINTS]>,
    /// Whether the robot follows the speeds that it is sent.
    pub follows: bool,
    /// Axes beyond the arm's joints.
    pub external_axes: usize,
}

/// Who leads the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Leads {
    /// The robot's own program: a message has to say where.
    PlannedPath,
    /// Other programs, by a twist.
    OtherPrograms,
}

/// An instant of the robot's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RobotTime {
    /// `feedBack.time`, in ns; it has a resolution of 1 µs.
    FeedBack(u64),
    /// `header.tm`, ms; it wraps.
    Header(u32),
}

/// Why a message is not used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BadMessage {
    /// It is no message of a robot.
    #[error("not an EgmRobot message: {0}")]
    Undecodable(#[from] egm_messages::DecodeError),
    /// What is needed is not there.
    #[error("{field} is missing in an EgmRobot message")]
    Missing {
        /// What.
        field: &'static str,
    },
    /// It is meant for somebody else.
    #[error("header.mtype = {found}: accepted: 2 (MSGTYPE_DATA)")]
    Type {
        /// The type.
        found: i32,
    },
    /// It is of another robot.
    #[error("{field} has {found} values: accepted: {accepted}, one for each [[robot.joint]]")]
    JointCount {
        /// Of which list.
        field: &'static str,
        /// How many there are.
        found: usize,
        /// How many the arm has.
        accepted: usize,
    },
    /// A value is no number.
    #[error("{field}[{index}] = {value}: accepted: finite numbers")]
    NotFinite {
        /// Of which list.
        field: &'static str,
        /// Which, from 0.
        index: usize,
        /// The value.
        value: f64,
    },
    /// It is further away than any joint gets.
    #[error("{field}[{index}] = {value}: accepted: a magnitude of at most {MOST_POSITION}")]
    OutOfReach {
        /// Of which list.
        field: &'static str,
        /// Which, from 0.
        index: usize,
        /// The value.
        value: f64,
    },
}

/// Largest position of a joint, degrees or mm: what turns or slides further is no arm.
const MOST_POSITION: f64 = 1e5;

impl Reading {
    /// Takes a message of an arm whose joints have these units, and that is led so.
    ///
    /// # Errors
    /// [`BadMessage`], for the first thing that is wrong.
    pub fn of(message: &EgmRobot, units: &[JointUnit], leads: Leads) -> Result<Self, BadMessage> {
        let header = message.header.as_ref().ok_or(BadMessage::Missing { field: "header" })?;
        let sequence = header.seqno.ok_or(BadMessage::Missing { field: "header.seqno" })?;
        let found = header.mtype.unwrap_or(MessageType::Undefined as i32);
        if found != MessageType::Data as i32 {
            return Err(BadMessage::Type { found });
        }
        let feedback = message.feed_back.as_ref().ok_or(BadMessage::Missing { field: "feedBack" })?;
        let time = match feedback.time {
            Some(clock) => RobotTime::FeedBack(nanoseconds(clock.sec, clock.usec)),
            None => RobotTime::Header(header.tm.ok_or(BadMessage::Missing { field: "feedBack.time or header.tm" })?),
        };
        let position = joints("feedBack.joints", feedback.joints.as_ref(), units)?;
        let reference = match leads {
            Leads::PlannedPath => {
                let planned = message.planned.as_ref().ok_or(BadMessage::Missing { field: "planned" })?;
                joints("planned.joints", planned.joints.as_ref(), units)?
            }
            Leads::OtherPrograms => position,
        };
        Ok(Self {
            sequence,
            time,
            position,
            reference,
            wrench: wrench(message),
            torque: torque(message, units.len()),
            follows: follows(message),
            external_axes: feedback.external_joints.as_ref().map_or(0, |axes| axes.joints.len()),
        })
    }
}

fn nanoseconds(seconds: u64, microseconds: u64) -> u64 {
    seconds.saturating_mul(1_000_000_000).saturating_add(microseconds.saturating_mul(1000))
}

fn joints(field: &'static str, list: Option<&EgmJoints>, units: &[JointUnit]) -> Result<[f64; MAX_JOINTS], BadMessage> {
    let values = &list.ok_or(BadMessage::Missing { field })?.joints;
    if values.len() != units.len() {
        return Err(BadMessage::JointCount { field, found: values.len(), accepted: units.len() });
    }
    let mut joints = [0.0; MAX_JOINTS];
    for (index, ((joint, value), unit)) in joints.iter_mut().zip(values).zip(units).enumerate() {
        let value = *value;
        if !value.is_finite() {
            return Err(BadMessage::NotFinite { field, index, value });
        }
        if value.abs() > MOST_POSITION {
            return Err(BadMessage::OutOfReach { field, index, value });
        }
        *joint = unit.to_si(value);
    }
    Ok(joints)
}

/// A wrench that cannot be used is none, never zero: the daemon then knows that it is blind.
fn wrench(message: &EgmRobot) -> Option<[f64; TASK_AXES]> {
    let measured = message.measured_force.as_ref()?;
    // Robots that do not say whether force control is active give what they measure.
    let wrench = <[f64; TASK_AXES]>::try_from(&measured.force[..]).ok()?;
    (measured.fc_active.unwrap_or(true) && wrench.iter().all(|value| value.is_finite())).then_some(wrench)
}

/// One that cannot be used is none, as for the wrench.
fn torque(message: &EgmRobot, joints: usize) -> Option<[f64; MAX_JOINTS]> {
    let given = &message.torque_ref.as_ref()?.joints;
    let is_sound = given.len() == joints && given.iter().all(|value| value.is_finite());
    is_sound.then(|| std::array::from_fn(|joint| given.get(joint).copied().unwrap_or(0.0)))
}

/// Only where all three say so: what is not said is not so.
fn follows(message: &EgmRobot) -> bool {
    message.motor_state.is_some_and(|motors| motors.state == MotorStateType::On as i32)
        && message.mci_state.is_some_and(|guidance| guidance.state == MciStateType::Running as i32)
        && message.rapid_exec_state.is_some_and(|program| program.state == RapidCtrlExecStateType::Running as i32)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use egm_messages::{
        EgmClock, EgmFeedBack, EgmHeader, EgmMciState, EgmMeasuredForce, EgmMotorState, EgmPlanned,
        EgmRapidCtrlExecState,
    };

    pub(crate) const UNITS: [JointUnit; 6] = [JointUnit::Degree; 6];

    /// A message as robots send it: number, µs on its clock, where all joints are, and where they are led, in degrees.
    pub(crate) fn message(sequence: u32, microseconds: u64, degrees: f64, led: f64) -> EgmRobot {
        let clock = EgmClock { sec: microseconds / 1_000_000, usec: microseconds % 1_000_000 };
        let joints = |degrees| Some(EgmJoints { joints: vec![degrees; 6] });
        EgmRobot {
            header: Some(EgmHeader {
                seqno: Some(sequence),
                tm: Some((microseconds / 1000) as u32),
                mtype: Some(MessageType::Data as i32),
            }),
            feed_back: Some(EgmFeedBack { joints: joints(degrees), time: Some(clock), ..EgmFeedBack::default() }),
            planned: Some(EgmPlanned { joints: joints(led), ..EgmPlanned::default() }),
            motor_state: Some(EgmMotorState { state: MotorStateType::On as i32 }),
            mci_state: Some(EgmMciState { state: MciStateType::Running as i32 }),
            rapid_exec_state: Some(EgmRapidCtrlExecState { state: RapidCtrlExecStateType::Running as i32 }),
            measured_force: Some(EgmMeasuredForce { fc_active: Some(true), force: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0] }),
            torque_ref: Some(EgmJoints { joints: vec![-3.0, 40.0, 20.0, 5.0, 0.5, 0.0] }),
            ..EgmRobot::default()
        }
    }

    #[test]
    fn a_message_is_read_in_si_units() {
        let reading =
            Reading::of(&message(7, 1_004_000, 90.0, 45.0), &UNITS, Leads::PlannedPath).expect("as robots send it");
        assert_eq!((reading.sequence, reading.time), (7, RobotTime::FeedBack(1_004_000_000)));
        assert!((reading.position[5] - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert!((reading.reference[0] - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
        assert_eq!(reading.wrench, Some([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        assert_eq!(reading.torque, Some([-3.0, 40.0, 20.0, 5.0, 0.5, 0.0, 0.0, 0.0]));
        assert!(reading.follows);
        assert_eq!(reading.position[6], 0.0);
    }

    #[test]
    fn without_the_clock_of_the_feedback_the_headers_counts() {
        let mut sent = message(7, 1_004_000, 0.0, 0.0);
        sent.feed_back.as_mut().expect("there").time = None;
        assert_eq!(
            Reading::of(&sent, &UNITS, Leads::PlannedPath).map(|reading| reading.time),
            Ok(RobotTime::Header(1004))
        );
    }

    #[test]
    fn what_is_wrong_with_a_message_is_named() {
        type Spoil = fn(&mut EgmRobot);
        let cases: [(Spoil, &str); 8] = [
            (|sent| sent.header = None, "header is missing"),
            (|sent| sent.header.as_mut().unwrap().mtype = Some(3), "header.mtype = 3"),
            (|sent| sent.planned = None, "planned is missing"),
            (|sent| sent.planned.as_mut().unwrap().joints = None, "planned.joints is missing"),
            (|sent| feedback(sent).push(0.0), "feedBack.joints has 7 values: accepted: 6"),
            (|sent| feedback(sent).clear(), "feedBack.joints has 0 values"),
            (|sent| feedback(sent)[3] = f64::NAN, "feedBack.joints[3] = NaN"),
            (|sent| feedback(sent)[2] = 1e300, "feedBack.joints[2] = 1000"),
        ];
        fn feedback(sent: &mut EgmRobot) -> &mut Vec<f64> {
            &mut sent.feed_back.as_mut().unwrap().joints.as_mut().unwrap().joints
        }
        for (spoil, expected) in cases {
            let mut sent = message(1, 4000, 0.0, 0.0);
            spoil(&mut sent);
            let error = Reading::of(&sent, &UNITS, Leads::PlannedPath).expect_err(expected).to_string();
            assert!(error.contains(expected), "{error}, not {expected}");
        }
    }

    #[test]
    fn where_other_programs_lead_the_planned_path_is_not_looked_at() {
        let spoils: [fn(&mut EgmRobot); 3] = [
            |sent| sent.planned = None,
            |sent| sent.planned.as_mut().unwrap().joints = None,
            |sent| sent.planned.as_mut().unwrap().joints.as_mut().unwrap().joints[2] = f64::NAN,
        ];
        for spoil in spoils {
            let mut sent = message(7, 4000, 90.0, 45.0);
            spoil(&mut sent);
            let reading = Reading::of(&sent, &UNITS, Leads::OtherPrograms).expect("the rest is sound");
            assert_eq!(reading.reference, reading.position);
            assert!(Reading::of(&sent, &UNITS, Leads::PlannedPath).is_err());
        }
    }

    #[test]
    fn a_wrench_a_torque_or_a_drive_that_is_not_there_is_never_taken_for_one() {
        let read = |spoil: fn(&mut EgmRobot)| {
            let mut sent = message(1, 4000, 0.0, 0.0);
            spoil(&mut sent);
            Reading::of(&sent, &UNITS, Leads::PlannedPath).expect("the rest is sound")
        };
        assert_eq!(read(|sent| sent.measured_force = None).wrench, None);
        assert_eq!(read(|sent| sent.measured_force.as_mut().unwrap().fc_active = Some(false)).wrench, None);
        assert_eq!(read(|sent| sent.measured_force.as_mut().unwrap().force[2] = f64::NAN).wrench, None);
        assert_eq!(read(|sent| sent.measured_force.as_mut().unwrap().force.truncate(3)).wrench, None);
        assert_eq!(read(|sent| sent.torque_ref = None).torque, None);
        assert_eq!(read(|sent| sent.torque_ref.as_mut().unwrap().joints[1] = f64::INFINITY).torque, None);
        assert_eq!(read(|sent| sent.torque_ref.as_mut().unwrap().joints.push(0.0)).torque, None);
        assert!(!read(|sent| sent.motor_state = None).follows);
        assert!(!read(|sent| sent.mci_state.as_mut().unwrap().state = 2).follows);
        assert!(!read(|sent| sent.rapid_exec_state.as_mut().unwrap().state = 1).follows);
    }
}
