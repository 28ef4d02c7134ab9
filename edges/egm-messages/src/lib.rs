//! The messages of ABB's Externally Guided Motion (package `abb.egm` of the egm.proto that ABB publishes with RobotWare),
//! and the units in which they speak. Edge and emulated controller share them; the tests hold both to a Python package that
//! was written elsewhere.
//!
//! Written by hand for `prost`, so that no build needs protoc. The crate `abbegm` (0.7.5) was looked at: it has an older
//! egm.proto, without `fcActive`, `torqueRef` and the time stamps, and an older `prost`.
//!
//! ```
//! use egm_messages::{EgmJoints, EgmSensor, EgmSpeedRef, Message};
//!
//! let speeds = EgmSpeedRef { joints: Some(EgmJoints { joints: vec![1.5; 6] }), ..EgmSpeedRef::default() };
//! let sent = EgmSensor { speed_ref: Some(speeds), ..EgmSensor::default() }.encode_to_vec();
//! let received = EgmSensor::decode(&sent[..]).expect("what was encoded");
//! assert_eq!(received.speed_ref.and_then(|speeds| speeds.joints).map(|joints| joints.joints), Some(vec![1.5; 6]));
//! ```

mod messages;
mod units;

pub use messages::{
    EgmCartesian, EgmCartesianSpeed, EgmClock, EgmEuler, EgmFeedBack, EgmHeader, EgmJoints, EgmMciState,
    EgmMeasuredForce, EgmMotorState, EgmPlanned, EgmPose, EgmQuaternion, EgmRapidCtrlExecState, EgmRobot, EgmSensor,
    EgmSpeedRef, EgmTimestamp, MciStateType, MessageType, MotorStateType, RapidCtrlExecStateType,
};
pub use prost::{DecodeError, Message};
pub use units::JointUnit;

/// The UDP port to which robots send unless they are told otherwise.
pub const DEFAULT_PORT: u16 = 6510;
/// The largest datagram that is looked at, in bytes; a robot's messages have some hundred.
pub const LARGEST_DATAGRAM: usize = 4096;
