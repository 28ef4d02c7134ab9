//! Where the arm is led before any contact: ṗ0 and q0 of a state sample. It comes from the path of the robot's own program.

use ipc_types::{MAX_JOINTS, TASK_AXES};

use crate::arm::AnyArm;
use crate::session::Measured;

/// What leads the arm in one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lead {
    /// ṗ0, m/s and rad/s, base frame.
    pub twist: [f64; TASK_AXES],
    /// q0, rad or m.
    pub position: [f64; MAX_JOINTS],
}

impl Lead {
    /// The robot's own program leads: `planned.joints`, and how fast they move.
    pub fn of_planned_path(arm: &dyn AnyArm, measured: &Measured) -> Self {
        let position = measured.reading.reference;
        Self { twist: arm.twist(&position, &measured.reference_velocity), position }
    }
}
