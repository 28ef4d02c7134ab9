//! What is logged about contacts that are over at once: at a touch of nothing an arm leaps back, and
//! whoever stands there wants to know why.

use admittance_core::quantities::{AXIS_NAMES, Span};
use admittance_runner::config::{Config, WrenchSourceName};
use ipc_types::{Mode, RecordSample, StopReason};

use crate::channel::CycleRecord;

/// A contact that is shorter is brief, and so is one of so many samples, or of so many T_est, in which f̂ forgets a touch: the arm has
/// not pressed on anything.
const BRIEF_S: f64 = 0.1;
const BRIEF_SAMPLES: f64 = 10.0;
const BRIEF_LAGS: f64 = 3.0;

/// A contact, on the first axis that was in it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Contact {
    began_ns: u64,
    axis: usize,
    /// f̂ as it began, and what a tool of 1 kg made of that.
    force: f64,
    inertia: f64,
    /// Largest |f̂| since.
    most: f64,
}

/// What has accumulated since the last line.
#[derive(Debug, Default)]
pub(super) struct BriefContacts {
    contact: Option<Contact>,
    count: u64,
    /// The one of them with the largest force, and its duration.
    worst: Option<(Contact, Span)>,
}

impl BriefContacts {
    /// Takes note of a cycle.
    pub(super) fn cycle(&mut self, record: &CycleRecord, config: &Config) {
        let RecordSample { now_ns, command, wrench, tool_acceleration, .. } = &record.sample;
        if command.mode == Mode::Contact.code() {
            let axis = command.active_axes.trailing_zeros() as usize;
            // What cannot be used shows no force.
            if let (Some(force), Some(inertia)) = (wrench.get(axis), tool_acceleration.get(axis)) {
                let new = Contact { began_ns: *now_ns, axis, force: *force, inertia: *inertia, most: 0.0 };
                self.contact.get_or_insert(new);
            }
            if let Some(contact) = &mut self.contact {
                contact.most = contact.most.max(wrench[contact.axis].abs());
            }
            return;
        }
        let Some(contact) = self.contact.take() else { return };
        // One that ended in another stop has its reason told.
        let is_lost = command.mode == Mode::Free.code() || command.stop_reason == StopReason::ContactLost.code();
        let lasted = Span::from_nanoseconds(now_ns.saturating_sub(contact.began_ns));
        if is_lost && lasted.seconds() < brief_s(config) {
            self.count = self.count.saturating_add(1);
            if self.worst.is_none_or(|(worst, _)| worst.most < contact.most) {
                self.worst = Some((contact, lasted));
            }
        }
    }

    /// Logs what has accumulated. Returns whether there was anything.
    pub(super) fn flush(&mut self, config: &Config) -> bool {
        let Some((contact, lasted)) = self.worst.take() else { return false };
        let count = std::mem::take(&mut self.count);
        tracing::warn!(count, "{}", sentence(&contact, lasted, config));
        true
    }
}

/// Below which duration in s a contact is brief.
fn brief_s(config: &Config) -> f64 {
    let lag = config.contact.wrench_time_constant_s.iter().copied().fold(0.0, f64::max);
    BRIEF_S.max(BRIEF_SAMPLES * config.control.sampling_time_s).max(BRIEF_LAGS * lag)
}

fn sentence(contact: &Contact, lasted: Span, config: &Config) -> String {
    let Contact { axis, force, inertia, most, .. } = contact;
    let (name, unit) = (AXIS_NAMES.get(*axis).unwrap_or(&"?"), if *axis < 3 { "N" } else { "N m" });
    let suspects = if config.wrench.source == WrenchSourceName::MotorTorque {
        "check [dynamics]".to_owned()
    } else if config.wrench.tool_mass_kg > 0.0 {
        format!(
            "each kg of the tool made {inertia:.1} {unit} of it just then: check wrench.tool_mass_kg and tool_center_of_gravity_m, \
             robot.velocity_loop.report_lag_s and contact.wrench_time_constant_s"
        )
    } else {
        "check wrench.bias, and wrench.tool_mass_kg where a tool hangs behind the sensor".to_owned()
    };
    format!(
        "a contact was over after {:.1} ms: on {name} f\u{302} showed {force:.1} {unit} as it began, and {most:.1} {unit} at most. Where \
         the tool touched something, it bounced; where it touched nothing, f\u{302} was wrong by what it showed: {suspects}",
        lasted.seconds() * 1e3
    )
}
