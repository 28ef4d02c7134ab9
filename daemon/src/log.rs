//! What is logged about cycles: each change of mode, each kind of fault or brief contact at most once a second
//! with its count.

mod brief_contacts;
mod samples;

use admittance_core::intake::{Arrival, SampleFault};
use admittance_core::quantities::AXIS_NAMES;
use admittance_host::clock::monotonic_ns;
use admittance_host::config::{fixed, percent};
use admittance_runner::config::Config;
use admittance_runner::cycle::CycleReport;
use ipc_types::{Mode, Motion, Side, StopReason, Verdict};

use crate::channel::CycleRecord;
use brief_contacts::BriefContacts;
use samples::Samples;

/// Least time in ns between two log lines about faults.
const FAULT_INTERVAL_NS: u64 = 1_000_000_000;

#[derive(Debug, Default)]
pub(crate) struct CycleLog {
    last: Option<(u32, u32)>,
    faults: u64,
    fault: String,
    samples: Samples,
    brief_contacts: BriefContacts,
    logged_at: u64,
    limited: u64,
    dropped: u64,
}

impl CycleLog {
    /// Takes note of a cycle.
    pub(crate) fn cycle(&mut self, record: &CycleRecord, config: &Config) {
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
        self.samples.cycle(record);
        self.brief_contacts.cycle(record, config);
        self.limited += u64::from(record.report.limited);
    }

    /// Logs what has accumulated, if it is time.
    pub(crate) fn flush(&mut self, dropped: u64, config: &Config) {
        if monotonic_ns().saturating_sub(self.logged_at) >= FAULT_INTERVAL_NS {
            self.flush_now(dropped, config);
        }
    }

    /// Logs what has accumulated.
    pub(crate) fn flush_now(&mut self, dropped: u64, config: &Config) {
        if self.faults > 0 {
            tracing::warn!(count = self.faults, "sample not used: {}", self.fault);
        }
        if self.limited > 0 {
            tracing::warn!(count = self.limited, "the offset was cut to limits.velocity_offset after the law");
        }
        if dropped > self.dropped {
            tracing::warn!(count = dropped - self.dropped, "cycle records dropped: the service thread was too slow");
        }
        let is_said = [self.samples.flush(), self.brief_contacts.flush(config)].contains(&true);
        if is_said || self.faults > 0 || self.limited > 0 || dropped > self.dropped {
            self.logged_at = monotonic_ns();
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
                ", the {side} limit on {axis} is missed by at least {} N in {:.1} ms",
                fixed(-command.verdict_margin, 1),
                command.verdict_time_s * 1e3
            )
        }
        Some(StopReason::Infeasible) if command.verdict == Verdict::AtRisk.code() => {
            let axis = AXIS_NAMES.get(command.verdict_axis as usize).unwrap_or(&"?");
            format!(
                ", {} of what may be there can't be kept below the limit on {axis}, more than contact.risk: the worst exceeds it \
                 by {} N in {:.1} ms",
                percent(command.verdict_share),
                fixed(-command.verdict_margin, 1),
                command.verdict_time_s * 1e3
            )
        }
        Some(StopReason::SurfaceOutsideRange) => {
            ", it is harder than environment.stiffness_range_n_m allows: measure it, and give a wider range".to_owned()
        }
        Some(StopReason::Singular) => record.report.singular.map_or_else(String::new, |singular| {
            format!(
                ", the Jacobian is not invertible at the measured pose or, in contact, where the arm would come to rest: \
                 reciprocal condition {:.2e}, below control.minimum_reciprocal_condition; move the arm away from the singularity",
                singular.reciprocal_condition
            )
        }),
        Some(StopReason::RateMismatch) => record.report.wrong_rate.map_or_else(String::new, |rate| {
            let spacing = rate.spacing * 1e3;
            if rate.is_even {
                format!(", samples come every {spacing:.4} ms: set control.sampling_time_s to the controller's cycle")
            } else {
                format!(
                    ", samples come unevenly, every {spacing:.4} ms in the median: stamp_ns must be when the state was \
                     measured, once in control.sampling_time_s"
                )
            }
        }),
        Some(StopReason::SamplesMissed) => match record.report.arrival {
            Some(Arrival { missed_lately, missed, age, .. }) if missed > 0 => format!(
                ", {missed} state samples before this one were missed, {missed_lately} of the last {}: what the law acted \
                 on was {:.1} ms old",
                Arrival::LATELY,
                age.seconds() * 1e3
            ),
            _ => format!(", {} state samples were missed since the start", command.missed_count),
        },
        Some(StopReason::SampleStale | StopReason::SampleInvalid | StopReason::JointCount) => {
            record.report.fault.map_or_else(String::new, |fault| format!(", {fault}"))
        }
        // Not in control, for want of a sample that could be used.
        None if command.mode == Mode::Idle.code() => {
            record.report.fault.map_or_else(String::new, |fault| format!(", {fault}"))
        }
        _ => String::new(),
    }
}

/// What is wrong with how samples come or with what they say, while the law goes on or the arm is
/// stopped for something else.
fn complaint(record: &CycleRecord) -> String {
    let CycleReport { arrival, fault, .. } = record.report;
    let stop_reason = StopReason::from_code(record.sample.command.stop_reason);
    match (arrival, fault) {
        (Some(Arrival { missed_lately, .. }), _)
            if missed_lately > 0 && stop_reason != Some(StopReason::SamplesMissed) =>
        {
            format!(", {missed_lately} of the last {} state samples missed", Arrival::LATELY)
        }
        (_, Some(fault @ SampleFault::Jump { .. })) if record.sample.command.mode == Mode::Stopped.code() => {
            let is_told = stop_reason == Some(StopReason::SampleInvalid);
            let what = if is_told { String::new() } else { format!(", {fault}") };
            what + "; a reset accepts where it is now"
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
        text += &format!(", feasible with {} N to spare", fixed(command.verdict_margin, 1));
    }
    let [least, most] = record.sample.believed_stiffness_band_n_m;
    if least < most && command.mode == Mode::Contact.code() {
        let stiffness = record.sample.believed_stiffness_n_m;
        text += &format!(", on a surface of {stiffness:.0} N/m ({least:.0} to {most:.0})");
        let tilt = record.sample.believed_tilt_rad().to_degrees();
        if tilt >= 0.05 {
            text += &format!(", tilted by {tilt:.1} degrees");
        }
    }
    if command.verdict == Verdict::AtRisk.code() && command.mode == Mode::Contact.code() {
        let (share, worst) = (percent(command.verdict_share), fixed(-command.verdict_margin, 1));
        text +=
            &format!(", at risk: {share} of what may be there can't be kept below the limit, up to {worst} N above");
    }
    text + &explanation(record) + &complaint(record)
}
