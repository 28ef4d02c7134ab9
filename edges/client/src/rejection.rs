//! Checks that a command must pass before a motion controller may use it.

use ipc_types::{CommandSample, MAX_PLAN, Motion};

use crate::limits::Limits;

/// Why a command is not accepted; without another answer in time it is missed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Rejection {
    /// A number is not finite.
    #[error("field {field} of command {sequence} is not finite")]
    NotFinite {
        /// Name of the field.
        field: &'static str,
        /// Sequence of the command.
        sequence: u64,
    },
    /// The command is for another robot.
    #[error("command {sequence} is for {got} joints; this robot has {expected}")]
    JointCount {
        /// Joint count of the command.
        got: u32,
        /// Joint count of the robot.
        expected: u32,
        /// Sequence of the command.
        sequence: u64,
    },
    /// A code that is not part of the contract.
    #[error("command {sequence} has the unknown motion code {motion}; accepted: 0 (Offset) and 1 (Hold)")]
    Motion {
        /// Code of the command.
        motion: u32,
        /// Sequence of the command.
        sequence: u64,
    },
    /// The plan is longer than a command can hold, or its end times do not increase.
    #[error("the plan of command {sequence} has {length} steps; accepted: 0 to 32 steps with increasing end times")]
    Plan {
        /// Plan length of the command.
        length: u32,
        /// Sequence of the command.
        sequence: u64,
    },
    /// It asks for more than this motion controller allows.
    #[error("{field}[{index}] of command {sequence} is {value}; this motion controller accepts {limit} at most")]
    BeyondLimit {
        /// Name of the field.
        field: &'static str,
        /// Axis or joint, from 0.
        index: usize,
        /// What it asks for, m/s or rad/s.
        value: f64,
        /// The controller's own limit of the magnitude.
        limit: f64,
        /// Sequence of the command.
        sequence: u64,
    },
    /// It answers an older sample than a command received before.
    #[error("command {sequence} answers sample {answered}; sample {newest} was answered before")]
    Older {
        /// Sample that the command answers.
        answered: u64,
        /// Newest sample answered so far.
        newest: u64,
        /// Sequence of the command.
        sequence: u64,
    },
    /// It answers a sample that this motion controller has not published, or with another stamp.
    #[error(
        "command {sequence} answers sample {answered} stamped {stamp_ns} ns, which this motion controller has not published"
    )]
    UnknownSample {
        /// Sample that the command answers.
        answered: u64,
        /// Stamp of that sample according to the command.
        stamp_ns: u64,
        /// Sequence of the command.
        sequence: u64,
    },
}

/// Checks a command for a robot of this many joints. What a hold would move by does not matter.
///
/// # Errors
/// The first [`Rejection`] found.
pub(crate) fn check(command: &CommandSample, joint_count: u32, limits: &Limits) -> Result<Motion, Rejection> {
    let sequence = command.sequence;
    if command.joint_count != joint_count {
        return Err(Rejection::JointCount { got: command.joint_count, expected: joint_count, sequence });
    }
    let Some(motion) = Motion::from_code(command.motion) else {
        return Err(Rejection::Motion { motion: command.motion, sequence });
    };
    let length = command.plan_length as usize;
    let ends = &command.plan_end_ns[..length.min(MAX_PLAN)];
    if length > MAX_PLAN || ends.first() == Some(&0) || ends.windows(2).any(|pair| pair[0] >= pair[1]) {
        return Err(Rejection::Plan { length: command.plan_length, sequence });
    }
    let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
    let fields: [(&'static str, bool); 5] = [
        ("velocity_offset", finite(&command.velocity_offset)),
        ("joint_velocity_offset", finite(&command.joint_velocity_offset)),
        ("twist_command", finite(&command.twist_command)),
        ("joint_per_twist", command.joint_per_twist.iter().all(|row| finite(row))),
        ("planned_offset", command.planned_offset[..length].iter().all(|offset| finite(offset))),
    ];
    if let Some((field, _)) = fields.into_iter().find(|(_, finite)| !finite) {
        return Err(Rejection::NotFinite { field, sequence });
    }
    if motion == Motion::Offset {
        limits.check(command)?;
    }
    Ok(motion)
}
