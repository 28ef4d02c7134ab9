//! What a motion controller lets a command ask for, whatever the daemon thinks: its own limits.

use ipc_types::{CommandSample, MAX_JOINTS, TASK_AXES};

use crate::playback::in_joints;
use crate::rejection::Rejection;

/// The largest magnitudes that are accepted; a command beyond one of them is refused, not cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Of each axis of the velocity offset, planned ones included, m/s and rad/s.
    pub velocity_offset: [f64; TASK_AXES],
    /// Of each joint of the offset's joint-space image, rad/s (m/s of one that slides); to a controller that says `follows_joint_velocity = 1`
    /// of all that its joints add to their commanded velocity, in every step of the plan.
    pub joint_velocity_offset: [f64; MAX_JOINTS],
}

/// A limit that is no limit.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("limit of {field}[{index}] = {value}: accepted: above 0; infinity for none")]
pub struct LimitError {
    /// What it limits.
    pub field: &'static str,
    /// Axis or joint, from 0.
    pub index: usize,
    /// The value.
    pub value: f64,
}

impl Limits {
    /// Every finite number is accepted.
    pub const NONE: Self =
        Self { velocity_offset: [f64::INFINITY; TASK_AXES], joint_velocity_offset: [f64::INFINITY; MAX_JOINTS] };

    /// Checks the limits of an arm of this many joints.
    ///
    /// # Errors
    /// [`LimitError`] for the first that is not above 0. Zero isn't accepted: it may be one that was forgotten.
    pub fn validate(&self, joint_count: usize) -> Result<(), LimitError> {
        let is_wrong = |(index, value): (usize, &f64)| (value.is_nan() || *value <= 0.0).then_some((index, *value));
        let joints = &self.joint_velocity_offset[..joint_count.min(MAX_JOINTS)];
        let fields = [("velocity_offset", &self.velocity_offset[..]), ("joint_velocity_offset", joints)];
        fields.into_iter().try_for_each(|(field, limits)| match limits.iter().enumerate().find_map(is_wrong) {
            Some((index, value)) => Err(LimitError { field, index, value }),
            None => Ok(()),
        })
    }

    /// Checks what a command with finite numbers, and a plan no longer than it can hold, would have the joints follow.
    pub(crate) fn check(&self, command: &CommandSample) -> Result<(), Rejection> {
        let beyond = |field, values: &[f64], limits: &[f64]| {
            let (index, (value, limit)) =
                values.iter().zip(limits).enumerate().find(|(_, (value, limit))| value.abs() > **limit)?;
            Some(Rejection::BeyondLimit { field, index, value: *value, limit: *limit, sequence: command.sequence })
        };
        let planned = &command.planned_offset[..command.plan_length as usize];
        let found = beyond("velocity_offset", &command.velocity_offset, &self.velocity_offset)
            .or_else(|| beyond("joint_velocity_offset", &command.joint_velocity_offset, &self.joint_velocity_offset))
            .or_else(|| planned.iter().find_map(|offset| beyond("planned_offset", offset, &self.velocity_offset)))
            .or_else(|| {
                // To joints that follow what the daemon resolves every step is told as well.
                let is_resolved = command.joint_per_twist.iter().flatten().any(|value| *value != 0.0);
                let joints = &self.joint_velocity_offset;
                planned
                    .iter()
                    .filter(|_| is_resolved)
                    .find_map(|offset| beyond("joint_velocity_offset", &in_joints(command, offset), joints))
            });
        found.map_or(Ok(()), Err)
    }
}
