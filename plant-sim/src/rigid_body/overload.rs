//! Drives that cannot hold their arm where it starts.

use super::RigidBody;

/// A drive that is asked for more than it has.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "rigid_body.joint[{joint}].torque_limit_n_m = {limit}: holding the arm where it starts takes {needed:.1} N m there: it sinks"
)]
pub struct Overload {
    /// Index of the joint, from 0.
    pub joint: usize,
    /// What it takes either way, N m.
    pub needed: f64,
    /// N m.
    pub limit: f64,
}

impl<const N: usize> RigidBody<N> {
    /// Of an arm that has just been brought to rest.
    pub fn overloads(&self) -> impl Iterator<Item = Overload> {
        let limits = &self.drive.parameters().torque_limit;
        let held = self.torque.iter().zip(limits).enumerate();
        held.map(|(joint, (torque, limit))| Overload { joint, needed: torque.abs(), limit: *limit })
            .filter(|drive| drive.needed > drive.limit)
    }
}
