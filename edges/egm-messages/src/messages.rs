//! The messages, field by field as egm.proto (proto2) has them. What of it neither side here reads or writes (path
//! correction, test signals, collisions, RAPID data) is left out: protobuf passes over fields that a reader does not know.

#![allow(clippy::derive_partial_eq_without_eq, reason = "prost derives for floats and integers alike")]

use prost::Message;

/// What a message is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, prost::Enumeration)]
#[repr(i32)]
pub enum MessageType {
    /// Not said.
    Undefined = 0,
    /// A command; for future use, says ABB.
    Command = 1,
    /// From the robot.
    Data = 2,
    /// From a sensor, for position or speed guidance.
    Correction = 3,
    /// From a sensor, for path correction.
    PathCorrection = 4,
}

/// Whether the drives have power.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, prost::Enumeration)]
#[repr(i32)]
pub enum MotorStateType {
    /// Not said.
    Undefined = 0,
    /// They have.
    On = 1,
    /// They have none.
    Off = 2,
}

/// Whether EGM moves the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, prost::Enumeration)]
#[repr(i32)]
pub enum MciStateType {
    /// Not said.
    Undefined = 0,
    /// It has failed.
    Error = 1,
    /// It does not.
    Stopped = 2,
    /// It does.
    Running = 3,
}

/// Whether the robot's program runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, prost::Enumeration)]
#[repr(i32)]
pub enum RapidCtrlExecStateType {
    /// Not said.
    Undefined = 0,
    /// It does not.
    Stopped = 1,
    /// It does.
    Running = 2,
}

/// At the head of each message.
#[derive(Clone, Copy, PartialEq, Message)]
pub struct EgmHeader {
    /// Number of the message.
    #[prost(uint32, optional, tag = "1")]
    pub seqno: Option<u32>,
    /// The sender's time stamp, ms.
    #[prost(uint32, optional, tag = "2")]
    pub tm: Option<u32>,
    /// What it is for.
    #[prost(enumeration = "MessageType", optional, tag = "3")]
    pub mtype: Option<i32>,
}

/// A position, mm.
#[derive(Clone, Copy, PartialEq, Message)]
pub struct EgmCartesian {
    /// Along x.
    #[prost(double, required, tag = "1")]
    pub x: f64,
    /// Along y.
    #[prost(double, required, tag = "2")]
    pub y: f64,
    /// Along z.
    #[prost(double, required, tag = "3")]
    pub z: f64,
}

/// An orientation.
#[derive(Clone, Copy, PartialEq, Message)]
pub struct EgmQuaternion {
    /// The real part.
    #[prost(double, required, tag = "1")]
    pub u0: f64,
    /// Of x.
    #[prost(double, required, tag = "2")]
    pub u1: f64,
    /// Of y.
    #[prost(double, required, tag = "3")]
    pub u2: f64,
    /// Of z.
    #[prost(double, required, tag = "4")]
    pub u3: f64,
}

/// An orientation, degrees.
#[derive(Clone, Copy, PartialEq, Message)]
pub struct EgmEuler {
    /// About x.
    #[prost(double, required, tag = "1")]
    pub x: f64,
    /// About y.
    #[prost(double, required, tag = "2")]
    pub y: f64,
    /// About z.
    #[prost(double, required, tag = "3")]
    pub z: f64,
}

/// The robot's clock.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Message)]
pub struct EgmClock {
    /// Whole seconds.
    #[prost(uint64, required, tag = "1")]
    pub sec: u64,
    /// What is beyond them, µs.
    #[prost(uint64, required, tag = "2")]
    pub usec: u64,
}

/// A clock that is kept by IEEE 1588.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Message)]
pub struct EgmTimestamp {
    /// Whole seconds.
    #[prost(uint64, optional, tag = "1")]
    pub sec: Option<u64>,
    /// What is beyond them, ns.
    #[prost(uint64, optional, tag = "2")]
    pub nsec: Option<u64>,
}

/// A pose.
#[derive(Clone, Copy, PartialEq, Message)]
pub struct EgmPose {
    /// Where.
    #[prost(message, optional, tag = "1")]
    pub pos: Option<EgmCartesian>,
    /// How it is turned.
    #[prost(message, optional, tag = "2")]
    pub orient: Option<EgmQuaternion>,
    /// The same as angles.
    #[prost(message, optional, tag = "3")]
    pub euler: Option<EgmEuler>,
}

/// A TCP velocity: mm/s, then degrees/s.
#[derive(Clone, PartialEq, Message)]
pub struct EgmCartesianSpeed {
    /// x y z rx ry rz.
    #[prost(double, repeated, packed = "false", tag = "1")]
    pub value: Vec<f64>,
}

/// A value for each joint, in its unit: see [`crate::JointUnit`].
#[derive(Clone, PartialEq, Message)]
pub struct EgmJoints {
    /// Base first.
    #[prost(double, repeated, packed = "false", tag = "1")]
    pub joints: Vec<f64>,
}

/// Where the robot's own program leads.
#[derive(Clone, PartialEq, Message)]
pub struct EgmPlanned {
    /// Joint positions.
    #[prost(message, optional, tag = "1")]
    pub joints: Option<EgmJoints>,
    /// Pose of the tool.
    #[prost(message, optional, tag = "2")]
    pub cartesian: Option<EgmPose>,
    /// Positions of external axes.
    #[prost(message, optional, tag = "3")]
    pub external_joints: Option<EgmJoints>,
    /// When.
    #[prost(message, optional, tag = "4")]
    pub time: Option<EgmClock>,
    /// The same.
    #[prost(message, optional, tag = "5")]
    pub time_stamp: Option<EgmTimestamp>,
}

/// Speeds for the robot to follow.
#[derive(Clone, PartialEq, Message)]
pub struct EgmSpeedRef {
    /// Joint speeds.
    #[prost(message, optional, tag = "1")]
    pub joints: Option<EgmJoints>,
    /// TCP velocity.
    #[prost(message, optional, tag = "2")]
    pub cartesians: Option<EgmCartesianSpeed>,
    /// Speeds of external axes.
    #[prost(message, optional, tag = "3")]
    pub external_joints: Option<EgmJoints>,
}

/// Where the robot is.
#[derive(Clone, PartialEq, Message)]
pub struct EgmFeedBack {
    /// Joint positions.
    #[prost(message, optional, tag = "1")]
    pub joints: Option<EgmJoints>,
    /// Pose of the tool.
    #[prost(message, optional, tag = "2")]
    pub cartesian: Option<EgmPose>,
    /// Positions of external axes.
    #[prost(message, optional, tag = "3")]
    pub external_joints: Option<EgmJoints>,
    /// When that was measured.
    #[prost(message, optional, tag = "4")]
    pub time: Option<EgmClock>,
    /// The same.
    #[prost(message, optional, tag = "5")]
    pub time_stamp: Option<EgmTimestamp>,
}

/// State of the drives.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Message)]
pub struct EgmMotorState {
    /// The state.
    #[prost(enumeration = "MotorStateType", required, tag = "1")]
    pub state: i32,
}

/// State of EGM.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Message)]
pub struct EgmMciState {
    /// The state.
    #[prost(enumeration = "MciStateType", required, tag = "1")]
    pub state: i32,
}

/// State of the robot's program.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Message)]
pub struct EgmRapidCtrlExecState {
    /// The state.
    #[prost(enumeration = "RapidCtrlExecStateType", required, tag = "1")]
    pub state: i32,
}

/// What the robot's force sensor measures.
#[derive(Clone, PartialEq, Message)]
pub struct EgmMeasuredForce {
    /// Whether force control is active; without it the values mean nothing.
    #[prost(bool, optional, tag = "1")]
    pub fc_active: Option<bool>,
    /// Forces x y z in N, torques in N m.
    #[prost(double, repeated, packed = "false", tag = "2")]
    pub force: Vec<f64>,
}

/// From the robot, one a cycle.
#[derive(Clone, PartialEq, Message)]
pub struct EgmRobot {
    /// Number and time.
    #[prost(message, optional, tag = "1")]
    pub header: Option<EgmHeader>,
    /// Where it is.
    #[prost(message, optional, tag = "2")]
    pub feed_back: Option<EgmFeedBack>,
    /// Where its program leads.
    #[prost(message, optional, tag = "3")]
    pub planned: Option<EgmPlanned>,
    /// State of the drives.
    #[prost(message, optional, tag = "4")]
    pub motor_state: Option<EgmMotorState>,
    /// State of EGM.
    #[prost(message, optional, tag = "5")]
    pub mci_state: Option<EgmMciState>,
    /// Whether it is where it was guided to.
    #[prost(bool, optional, tag = "6")]
    pub mci_convergence_met: Option<bool>,
    /// State of its program.
    #[prost(message, optional, tag = "8")]
    pub rapid_exec_state: Option<EgmRapidCtrlExecState>,
    /// What its sensor measures.
    #[prost(message, optional, tag = "9")]
    pub measured_force: Option<EgmMeasuredForce>,
    /// How much of what it can do guidance asks for, %.
    #[prost(double, optional, tag = "10")]
    pub utilization_rate: Option<f64>,
    /// Torques of the motors as their drives are told them, N m, one for each joint. On which side of the gear they are is said by
    /// no published text.
    #[prost(message, optional, tag = "14")]
    pub torque_ref: Option<EgmJoints>,
}

/// To the robot.
#[derive(Clone, PartialEq, Message)]
pub struct EgmSensor {
    /// Number and time.
    #[prost(message, optional, tag = "1")]
    pub header: Option<EgmHeader>,
    /// Where to go.
    #[prost(message, optional, tag = "2")]
    pub planned: Option<EgmPlanned>,
    /// At which speed.
    #[prost(message, optional, tag = "3")]
    pub speed_ref: Option<EgmSpeedRef>,
}
