//! What is logged about cycles: each change of mode, each kind of fault at most once a second with
//! its count.

use admittance_core::intake::SampleFault;
use admittance_core::quantities::AXIS_NAMES;
use admittance_host::clock::monotonic_ns;
use ipc_types::{Mode, Motion, Side, StopReason, Verdict};

use crate::channel::CycleRecord;

/// Least time in ns between two log lines about faults.
const FAULT_INTERVAL_NS: u64 = 1_000_000_000;

#[derive(Debug, Default)]
pub(crate) struct CycleLog {
    last: Option<(u32, u32)>,
    faults: u64,
    fault: String,
    logged_at: u64,
    limited: u64,
    dropped: u64,
}

impl CycleLog {
    /// Takes note of a cycle.
    pub(crate) fn cycle(&mut self, record: &CycleRecord) {
        let command = &record.sample.command;
        let state = (command.mode, command.stop_reason);
        if self.last != Some(state) {
            self.last = Some(state);
            transition(record);
        }
        // A missing controller is not a fault of a sample; the mode shows it.
        let at_rest = command.mode == Mode::Idle.code() || command.mode == Mode::Stopped.code();
        if let Some(fault) = &record.report.fault
            && !(at_rest && *fault == SampleFault::Silence)
        {
            self.faults += 1;
            self.fault = fault.to_string();
        }
        self.limited += u64::from(record.report.limited);
    }

    /// Logs what has accumulated, if it is time.
    pub(crate) fn flush(&mut self, dropped: u64) {
        let now = monotonic_ns();
        if now.saturating_sub(self.logged_at) < FAULT_INTERVAL_NS {
            return;
        }
        if self.faults > 0 {
            tracing::warn!(count = self.faults, "sample not used: {}", self.fault);
        }
        if self.limited > 0 {
            tracing::warn!(count = self.limited, "the offset was cut to limits.velocity_offset after the law");
        }
        if dropped > self.dropped {
            tracing::warn!(count = dropped - self.dropped, "cycle records dropped: the service thread was too slow");
        }
        if self.faults > 0 || self.limited > 0 || dropped > self.dropped {
            self.logged_at = now;
        }
        (self.faults, self.limited, self.dropped) = (0, 0, dropped);
    }
}

fn transition(record: &CycleRecord) {
    let command = &record.sample.command;
    let (mode, stop_reason) = (Mode::name_of(command.mode), StopReason::name_of(command.stop_reason));
    let why = explanation(record);
    match Mode::from_code(command.mode) {
        Some(Mode::Stopping | Mode::Stopped) => tracing::warn!(mode, stop_reason, "{mode}: {stop_reason}{why}"),
        _ if command.stop_reason != StopReason::NONE => {
            tracing::warn!(mode, stop_reason, "{mode}: {stop_reason}{why}");
        }
        _ => tracing::info!(mode, stop_reason, "{mode}"),
    }
}

/// What a person needs to know besides the reason's name.
fn explanation(record: &CycleRecord) -> String {
    let command = &record.sample.command;
    match StopReason::from_code(command.stop_reason) {
        Some(StopReason::Infeasible) if command.verdict == Verdict::Infeasible.code() => {
            let axis = AXIS_NAMES.get(command.verdict_axis as usize).unwrap_or(&"?");
            let side = if command.verdict_side == Side::Upper.code() { "upper" } else { "lower" };
            format!(
                ", the {side} limit on {axis} is missed by at least {:.1} N in {:.1} ms",
                -command.verdict_margin,
                command.verdict_time_s * 1e3
            )
        }
        Some(StopReason::Singular) => record.report.singular.map_or_else(String::new, |singular| {
            format!(
                ", the Jacobian is not invertible at the measured pose: reciprocal condition {:.2e}, below \
                 control.minimum_reciprocal_condition; move the arm away from the singularity",
                singular.reciprocal_condition
            )
        }),
        Some(StopReason::RateMismatch) => record.report.wrong_rate.map_or_else(String::new, |mean| {
            format!(
                ", samples come every {:.4} ms on average: set control.sampling_time_s to the controller's cycle",
                mean * 1e3
            )
        }),
        Some(StopReason::SampleStale | StopReason::SampleInvalid | StopReason::JointCount) => {
            record.report.fault.map_or_else(String::new, |fault| format!(", {fault}"))
        }
        _ => String::new(),
    }
}

/// "Stopped (Infeasible)".
pub(crate) fn state_of(last: Option<&CycleRecord>) -> String {
    let Some(last) = last else { return "Idle (no cycle yet)".to_owned() };
    let command = &last.sample.command;
    if command.stop_reason == StopReason::NONE {
        Mode::name_of(command.mode).to_owned()
    } else {
        format!("{} ({})", Mode::name_of(command.mode), StopReason::name_of(command.stop_reason))
    }
}

/// One sentence about the daemon's state.
pub(crate) fn status_sentence(last: Option<&CycleRecord>) -> String {
    let Some(record) = last else { return "no state sample yet: waiting for the motion controller".to_owned() };
    let command = &record.sample.command;
    let mut text = state_of(last);
    if command.motion == Motion::Hold.code() {
        text += ", holding";
    }
    if command.verdict == Verdict::Feasible.code() {
        text += &format!(", feasible with {:.1} N to spare", command.verdict_margin);
    }
    text + &explanation(record)
}
