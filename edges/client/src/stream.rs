//! The last thing before the drives: what they are given keeps their limits, whatever the command in force, the
//! twist reference or the loss of both would make of it.
//!
//! The daemon plans within the same limits (`limits.joint_acceleration_rad_s2` of its configuration), so in the
//! ordinary case nothing is changed here. What is: a twist reference that jumps, before the daemon has seen it; a
//! `Hold`, or no command any more, which are ramps to standstill; a plan played further than to the next command.

use admittance_drive_limits::{DriveLimits, Reference};
use ipc_types::MAX_JOINTS;

use crate::LimitError;

/// What the drives take, and how often.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drives {
    /// Of each joint, base to tip: rad/s and m/s, and those per s and s². Infinite where there is none, and of
    /// joints that are not there.
    pub limits: DriveLimits<MAX_JOINTS>,
    /// Time from one reference to the next in ns: as long as the steps in which commands change, or shorter.
    pub interval_ns: u64,
}

/// References on their way to the drives.
#[derive(Debug, Clone)]
pub struct Stream {
    drives: Drives,
    reference: Reference<MAX_JOINTS>,
}

impl Drives {
    /// Checks the limits of an arm of this many joints.
    ///
    /// # Errors
    /// [`LimitError`] for the first that is not above 0. Zero isn't accepted: it may be one that was forgotten.
    pub fn validate(&self, joint_count: usize) -> Result<(), LimitError> {
        let DriveLimits { speed, acceleration, jerk } = &self.limits;
        for (field, limits) in [("speed", speed), ("acceleration", acceleration), ("jerk", jerk)] {
            let joints = limits[..joint_count.min(MAX_JOINTS)].iter().enumerate();
            if let Some((index, &value)) = joints.into_iter().find(|(_, value)| value.is_nan() || **value <= 0.0) {
                return Err(LimitError { field, index, value });
            }
        }
        if self.interval_ns == 0 {
            return Err(LimitError { field: "interval_ns", index: 0, value: 0.0 });
        }
        Ok(())
    }
}

impl Stream {
    /// The drives stand still.
    pub fn new(drives: Drives) -> Self {
        Self { drives, reference: Reference::steady([0.0; MAX_JOINTS]) }
    }

    /// The reference that is given to the drives where `wanted` is, rad/s and m/s. Once per interval, and never less:
    /// it counts the calls. Without a command, or under `Hold`, `wanted` is zero. Where the daemon's stops may exceed the
    /// jerk (`limits.stop_exceeds_jerk`), the jerk here is infinite: else such a stop is not what the daemon predicts.
    pub fn next(&mut self, wanted: &[f64; MAX_JOINTS]) -> [f64; MAX_JOINTS] {
        let since = self.drives.interval_ns as f64 * 1e-9;
        // What is no number, as near a singular pose, is a standstill: else nothing after it would be one.
        let wanted = wanted.map(|value| if value.is_finite() { value } else { 0.0 });
        self.reference = self.drives.limits.follow(&self.reference, since, &wanted);
        self.reference.velocity
    }

    /// The brakes have closed: the next reference starts from standstill.
    pub fn stand(&mut self) {
        self.reference = Reference::steady([0.0; MAX_JOINTS]);
    }

    /// Time from one reference to the next in ns.
    pub fn interval_ns(&self) -> u64 {
        self.drives.interval_ns
    }
}
