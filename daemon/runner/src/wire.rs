//! State samples to the law, and its answers to commands.

use admittance_core::CycleOutput;
use admittance_core::intake::Sample;
use admittance_core::mpc::Verdict;
use admittance_core::quantities::{GivenWrench, Instant};
use admittance_core::vocabulary::{Side, StopReason};
use ipc_types::{CommandSample, StateSample};
use nalgebra::SVector;

use crate::task_frame::TaskFrame;

/// The law's view of a state sample: the first N joints, the D directions of the task, and the whole
/// wrench as it is given.
pub(crate) fn sample<const N: usize, const D: usize>(state: &StateSample, frame: &TaskFrame) -> Sample<N, D> {
    let joints = |values: &[f64]| SVector::<f64, N>::from_fn(|joint, _| values[joint]);
    Sample {
        sequence: state.sequence,
        stamp: Instant::from_nanoseconds(state.stamp_ns),
        boot_id: state.boot_id,
        joint_count: state.joint_count,
        wrench_valid: state.wrench_valid == 1,
        drives_enabled: state.drives_enabled == 1,
        joint_position: joints(&state.joint_position),
        joint_velocity: joints(&state.joint_velocity),
        joint_position_reference: joints(&state.joint_position_reference),
        joint_velocity_reference: (state.follows_joint_velocity == 1).then(|| joints(&state.joint_velocity_reference)),
        twist_reference: frame.twist(SVector::from_fn(|axis, _| state.twist_reference[axis])),
        wrench: GivenWrench(state.wrench.into()),
        torque_valid: state.torque_valid == 1,
        joint_torque: joints(&state.joint_torque),
    }
}

/// Writes an answer in the task frame into a command. `since_sample` is the time in ns from the sample that the
/// command names to the start of the plan. Sequence, stamps and the real-time thread's counters are
/// not touched.
pub(crate) fn write_answer<const N: usize, const D: usize>(
    command: &mut CommandSample,
    answer: &CycleOutput<'_, N, D>,
    frame: &TaskFrame,
    since_sample: u64,
) {
    let outcome = &answer.outcome;
    command.joint_count = N as u32;
    command.motion = outcome.movement.motion.code();
    command.mode = outcome.mode.code();
    command.source = outcome.movement.source.code();
    command.stop_reason = StopReason::code_of(outcome.stop_reason);
    command.active_axes = outcome.active_axes;
    write_verdict(command, &outcome.verdict);
    command.velocity_offset = padded(frame.twist_in_base(outcome.movement.velocity_offset).as_slice());
    command.joint_velocity_offset = padded(outcome.movement.joint_velocity_offset.as_slice());
    command.joint_per_twist = [[0.0; ipc_types::TASK_AXES]; ipc_types::MAX_JOINTS];
    if let Some(matrix) = &outcome.movement.joint_per_twist {
        for (row, joint) in command.joint_per_twist.iter_mut().zip(matrix.row_iter()) {
            // What it is multiplied with turns, and so does it.
            *row = padded(frame.twist_in_base(joint.transpose()).as_slice());
        }
    }
    command.twist_command = padded(frame.twist_in_base(outcome.movement.twist_command).as_slice());
    let steps = answer.plan.steps();
    command.plan_length = steps.len() as u32;
    command.plan_end_ns.fill(0);
    command.planned_offset.fill([0.0; ipc_types::TASK_AXES]);
    for (index, (offset, end)) in steps.enumerate() {
        command.plan_end_ns[index] = end.nanoseconds().saturating_add(since_sample);
        command.planned_offset[index] = padded(frame.twist_in_base(*offset).as_slice());
    }
    command.fallback_count = outcome.counters.fallback;
    command.missed_count = outcome.counters.missed;
    command.rejected_count = outcome.counters.rejected;
}

fn write_verdict(command: &mut CommandSample, verdict: &Verdict) {
    command.verdict = verdict.name().code();
    let (axis, side, time, margin, share) = match *verdict {
        Verdict::None => (0, None, 0.0, 0.0, 0.0),
        Verdict::Feasible { margin, axis, time } => (axis, Some(Side::Upper), time, margin, 0.0),
        Verdict::AtRisk { axis, time, excess, share } => (axis, Some(Side::Upper), time, -excess, share),
        Verdict::Infeasible { axis, side, time, shortfall } => (axis, Some(side), time, -shortfall, 0.0),
    };
    command.verdict_axis = axis as u32;
    command.verdict_side = Side::code_of(side);
    command.verdict_time_s = time;
    command.verdict_margin = margin;
    command.verdict_share = share;
}

/// `values` followed by zeros.
pub(crate) fn padded<const LENGTH: usize>(values: &[f64]) -> [f64; LENGTH] {
    let mut array = [0.0; LENGTH];
    array.iter_mut().zip(values).for_each(|(slot, value)| *slot = *value);
    array
}
