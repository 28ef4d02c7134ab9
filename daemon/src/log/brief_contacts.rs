//! What is logged about contacts that are over at once: at a touch of nothing an arm leaps back, and
//! whoever stands there wants to know why.

use admittance_core::quantities::Span;
use ipc_types::{Mode, RecordSample};

use crate::channel::CycleRecord;

/// A contact that is shorter is brief: the arm has not pressed on anything.
const BRIEF_NS: u64 = 100_000_000;

/// A contact that goes on.
#[derive(Debug, Clone, Copy)]
struct Contact {
    began_ns: u64,
    /// Largest |f̂| since in N.
    most: f64,
    /// What a tool of 1 kg added to f̂ as it began, in N.
    inertia: f64,
}

/// What has accumulated since the last line.
#[derive(Debug, Default)]
pub(super) struct BriefContacts {
    contact: Option<Contact>,
    count: u64,
    /// The last one of them, with its duration.
    last: Option<(Contact, Span)>,
}

impl BriefContacts {
    /// Takes note of a cycle.
    pub(super) fn cycle(&mut self, record: &CycleRecord) {
        let RecordSample { state, command, wrench, tool_acceleration, .. } = &record.sample;
        if command.mode == Mode::Contact.code() {
            let (force, inertia) = (of_force(wrench), of_force(tool_acceleration));
            let contact = self.contact.get_or_insert(Contact { began_ns: state.stamp_ns, most: force, inertia });
            contact.most = contact.most.max(force);
            return;
        }
        let Some(contact) = self.contact.take() else { return };
        let lasted = state.stamp_ns.saturating_sub(contact.began_ns);
        // One that ended in a stop has its reason told.
        if command.mode == Mode::Free.code() && lasted < BRIEF_NS {
            self.count += 1;
            self.last = Some((contact, Span::from_nanoseconds(lasted)));
        }
    }

    /// Logs what has accumulated. Returns whether there was anything.
    pub(super) fn flush(&mut self) -> bool {
        let Some((Contact { most, inertia, .. }, lasted)) = self.last.take() else { return false };
        let count = std::mem::take(&mut self.count);
        // Without a tool that is told of there is nothing to say of its inertia.
        let by_tool =
            if inertia > 0.0 { format!(", when each kg of the tool made {inertia:.1} N") } else { String::new() };
        tracing::warn!(
            count,
            "a contact was over after {:.1} ms, with {most:.1} N at most{by_tool}: where the tool touched nothing, the wrench was off \
             by that; check wrench.tool_mass_kg, contact.wrench_time_constant_s and the lag of the joint velocities, or raise \
             contact.activation_threshold",
            lasted.seconds() * 1e3
        );
        true
    }
}

/// The length of the first three.
fn of_force(wrench: &[f64]) -> f64 {
    wrench.iter().take(3).map(|component| component * component).sum::<f64>().sqrt()
}
