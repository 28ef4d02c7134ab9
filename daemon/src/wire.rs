//! Between the wire's fixed-size samples and the core's types.

use admittance_core::controller::Controller;
use admittance_core::feasibility::{Side, Verdict};
use admittance_core::mode::{Mode, StopReason};
use admittance_core::outcome::{Motion, Outcome, Source};
use admittance_core::qp::QpSolver;
use admittance_core::sample::{Sample, SampleFault};
use ipc_types::{CommandSample, StateSample};
use nalgebra::SVector;

/// The core's view of a state sample: the first N joints and D axes, with f̂ and the saturated component of what was given.
pub(crate) fn sample<const N: usize, const D: usize>(
    state: &StateSample,
    wrench: &SVector<f64, D>,
    wrench_saturated: Option<usize>,
) -> Sample<N, D> {
    let joints = |values: &[f64]| SVector::<f64, N>::from_fn(|joint, _| values[joint]);
    let axes = |values: &[f64]| SVector::<f64, D>::from_fn(|axis, _| values[axis]);
    Sample {
        sequence: state.sequence,
        stamp: state.stamp_ns,
        boot_id: state.boot_id,
        joint_count: state.joint_count,
        wrench_valid: state.wrench_valid == 1,
        wrench_saturated,
        drives_enabled: state.drives_enabled == 1,
        joint_position: joints(&state.joint_position),
        joint_velocity: joints(&state.joint_velocity),
        joint_position_reference: joints(&state.joint_position_reference),
        twist_reference: axes(&state.twist_reference),
        wrench: *wrench,
    }
}

/// Writes what the core decided into a command; sequence, stamps of publishing and the shell's counters are not touched.
pub(crate) fn write_outcome<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>>(
    command: &mut CommandSample,
    outcome: &Outcome<N, D>,
    controller: &Controller<N, D, S, B>,
) {
    command.joint_count = N as u32;
    command.motion = motion(outcome.motion).code();
    command.mode = mode(outcome.mode).code();
    command.source = source(outcome.source).code();
    command.stop_reason = outcome.stop_reason.map_or(ipc_types::StopReason::None, stop_reason).code();
    command.active_axes = outcome.active_axes;
    write_verdict(command, &outcome.verdict);
    command.velocity_offset = padded(outcome.velocity_offset.as_slice());
    command.joint_velocity_offset = padded(outcome.joint_velocity_offset.as_slice());
    command.twist_command = padded(outcome.twist_command.as_slice());
    let steps = controller.plan().steps();
    command.plan_length = steps.len() as u32;
    command.plan_end_ns.fill(0);
    command.planned_offset.fill([0.0; ipc_types::TASK_AXES]);
    for (index, (offset, end)) in steps.enumerate() {
        command.plan_end_ns[index] = end;
        command.planned_offset[index] = padded(offset.as_slice());
    }
    command.fallback_count = controller.counters().fallback;
    command.missed_count = controller.history().missed;
    command.rejected_count = controller.counters().rejected;
}

fn write_verdict(command: &mut CommandSample, verdict: &Verdict) {
    let (code, axis, side, time, margin) = match *verdict {
        Verdict::None => (ipc_types::Verdict::None, 0, ipc_types::Side::None, 0.0, 0.0),
        Verdict::Feasible { margin, axis, time } => {
            (ipc_types::Verdict::Feasible, axis, ipc_types::Side::Upper, time, margin)
        }
        Verdict::Infeasible { axis, side, time, shortfall } => {
            let side = match side {
                Side::Upper => ipc_types::Side::Upper,
                Side::Lower => ipc_types::Side::Lower,
            };
            (ipc_types::Verdict::Infeasible, axis, side, time, -shortfall)
        }
    };
    command.verdict = code.code();
    command.verdict_axis = axis as u32;
    command.verdict_side = side.code();
    command.verdict_time_s = time;
    command.verdict_margin = margin;
}

/// `values` followed by zeros.
pub(crate) fn padded<const LENGTH: usize>(values: &[f64]) -> [f64; LENGTH] {
    let mut array = [0.0; LENGTH];
    array.iter_mut().zip(values).for_each(|(slot, value)| *slot = *value);
    array
}

fn motion(motion: Motion) -> ipc_types::Motion {
    match motion {
        Motion::Offset => ipc_types::Motion::Offset,
        Motion::Hold => ipc_types::Motion::Hold,
    }
}

/// Why a sample did not reach the law, on the wire.
pub(crate) fn fault(fault: Option<&SampleFault>) -> ipc_types::Fault {
    match fault {
        None => ipc_types::Fault::None,
        Some(SampleFault::JointCount { .. }) => ipc_types::Fault::JointCount,
        Some(SampleFault::NotFinite { .. }) => ipc_types::Fault::NotFinite,
        Some(SampleFault::Implausible { .. }) => ipc_types::Fault::Implausible,
        Some(SampleFault::WrenchInvalid) => ipc_types::Fault::WrenchInvalid,
        Some(SampleFault::WrenchSaturated { .. }) => ipc_types::Fault::WrenchSaturated,
        Some(SampleFault::Stale { .. }) => ipc_types::Fault::Stale,
        Some(SampleFault::FromFuture { .. }) => ipc_types::Fault::FromFuture,
        Some(SampleFault::OutOfOrder { .. }) => ipc_types::Fault::OutOfOrder,
        Some(SampleFault::Jump { .. }) => ipc_types::Fault::Jump,
        Some(SampleFault::Silence) => ipc_types::Fault::Silence,
    }
}

/// The mode on the wire.
fn mode(mode: Mode) -> ipc_types::Mode {
    match mode {
        Mode::Idle => ipc_types::Mode::Idle,
        Mode::Free => ipc_types::Mode::Free,
        Mode::Contact => ipc_types::Mode::Contact,
        Mode::Stopping => ipc_types::Mode::Stopping,
        Mode::Stopped => ipc_types::Mode::Stopped,
    }
}

fn source(source: Source) -> ipc_types::Source {
    match source {
        Source::None => ipc_types::Source::None,
        Source::Mpc => ipc_types::Source::Mpc,
        Source::Damping => ipc_types::Source::Damping,
        Source::Plan => ipc_types::Source::Plan,
        Source::Retreat => ipc_types::Source::Retreat,
        Source::Ramp => ipc_types::Source::Ramp,
        Source::MinimumForce => ipc_types::Source::MinimumForce,
    }
}

/// The stop reason on the wire.
pub(crate) fn stop_reason(reason: StopReason) -> ipc_types::StopReason {
    match reason {
        StopReason::Infeasible => ipc_types::StopReason::Infeasible,
        StopReason::StartedInContact => ipc_types::StopReason::StartedInContact,
        StopReason::SampleStale => ipc_types::StopReason::SampleStale,
        StopReason::SampleInvalid => ipc_types::StopReason::SampleInvalid,
        StopReason::JointCount => ipc_types::StopReason::JointCount,
        StopReason::Singular => ipc_types::StopReason::Singular,
        StopReason::RateMismatch => ipc_types::StopReason::RateMismatch,
        StopReason::FallbackExhausted => ipc_types::StopReason::FallbackExhausted,
        StopReason::SolverFailed => ipc_types::StopReason::SolverFailed,
        StopReason::DrivesDisabled => ipc_types::StopReason::DrivesDisabled,
        StopReason::Shutdown => ipc_types::StopReason::Shutdown,
        StopReason::Disabled => ipc_types::StopReason::Disabled,
        StopReason::ContactLost => ipc_types::StopReason::ContactLost,
        StopReason::MeasuredForce => ipc_types::StopReason::MeasuredForce,
        StopReason::ModelDisagrees => ipc_types::StopReason::ModelDisagrees,
    }
}
