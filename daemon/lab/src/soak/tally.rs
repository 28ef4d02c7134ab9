//! What a soak has shown.

use std::collections::BTreeMap;

use admittance_core::quantities::Span;
use comfy_table::{CellAlignment, Table, presets};
use serde_json::{Value, json};

use super::injection::{Fault, Touch};
use super::observer::Finding;
use crate::answers::Invariant;

/// Largest part of the soak in which a fault may explain a force above the limit.
const MOST_IN_WINDOWS: f64 = 0.3;

/// When a fault may explain what is seen, ns of CLOCK_MONOTONIC.
pub(crate) type Window = (u64, u64);

/// How often a fault was injected, and survived: control was there again at the end of the touch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Count {
    injected: u64,
    in_contact: u64,
    survived: u64,
}

/// Everything counted.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    by_fault: BTreeMap<&'static str, Count>,
    windows: Vec<Window>,
    disturbed: Vec<Window>,
    broken: Vec<(String, String)>,
    lost: Vec<String>,
    excused: u64,
    touches: u64,
    commands: u64,
    truths: u64,
    recordings: u64,
    records: u64,
    seconds: f64,
}

impl Tally {
    pub(crate) fn touch(&mut self) {
        self.touches += 1;
    }

    /// A fault was injected; what is seen within `window` may be its doing.
    pub(crate) fn injected(&mut self, fault: Fault, in_contact: bool, window: Window) {
        let count = self.by_fault.entry(fault.name()).or_default();
        count.injected += 1;
        count.in_contact += u64::from(in_contact);
        self.windows.push(window);
    }

    /// After it there was control again.
    pub(crate) fn survived(&mut self, fault: Fault) {
        self.by_fault.entry(fault.name()).or_default().survived += 1;
    }

    /// Afterwards there was no control, for this reason.
    pub(crate) fn lost(&mut self, touch: &Touch, how: &str) {
        let place = if touch.in_contact { "in contact" } else { "in free motion" };
        self.lost.push(format!("{} {place}, {:.1} ms: {how}", touch.fault.name(), touch.duration_s * 1e3));
    }

    /// A recording with so many records was whole.
    pub(crate) fn recorded(&mut self, records: u64) {
        self.recordings += 1;
        self.records += records;
    }

    /// Records a failure that the observer cannot see.
    pub(crate) fn broken(&mut self, what: &str, how: String) {
        self.broken.push((what.to_owned(), how));
    }

    /// What the observer has noted over `seconds`; `grace` ns after a disturbance of the machine it
    /// may explain as much as a fault.
    pub(crate) fn observed(&mut self, findings: &[Finding], grace: u64, seconds: f64) {
        self.seconds = seconds;
        for finding in findings {
            match finding {
                Finding::Disturbed { stamp_ns } => {
                    self.disturbed.push((stamp_ns.saturating_sub(grace), stamp_ns + grace))
                }
                Finding::Done { commands, truths } => (self.commands, self.truths) = (*commands, *truths),
                Finding::Ready | Finding::Broken { .. } => {}
            }
        }
        for finding in findings {
            let Finding::Broken { invariant, stamp_ns, what } = finding else { continue };
            // A fault may only change the force.
            let is_in = |window: &Window| (window.0..=window.1).contains(stamp_ns);
            let mut windows = self.windows.iter().chain(&self.disturbed);
            if *invariant == Invariant::ForceBelowLimit && windows.any(is_in) {
                self.excused += 1;
            } else {
                let name = serde_json::to_value(invariant).ok().and_then(|name| Some(name.as_str()?.to_owned()));
                self.broken.push((name.unwrap_or_default(), what.clone()));
            }
        }
        let share = self.share(&self.windows);
        if share > MOST_IN_WINDOWS {
            let how = format!("{:.1} % of the time, at most {:.0} %", share * 100.0, MOST_IN_WINDOWS * 100.0);
            self.broken("windows_of_faults", how);
        }
    }

    /// Part of the soak within these windows.
    fn share(&self, windows: &[Window]) -> f64 {
        let mut sorted = windows.to_vec();
        sorted.sort_unstable();
        let (mut covered, mut until) = (0, 0);
        for (begin, end) in sorted {
            covered += end.saturating_sub(begin.max(until));
            until = until.max(end);
        }
        Span::from_nanoseconds(covered).seconds() / self.seconds.max(f64::MIN_POSITIVE)
    }

    fn sum(&self, of: impl Fn(&Count) -> u64) -> u64 {
        self.by_fault.values().map(of).sum()
    }

    /// Part of the soak in which the machine kept plant or daemon from their work.
    pub(crate) fn disturbed(&self) -> f64 {
        self.share(&self.disturbed)
    }

    /// Whether an invariant was broken.
    pub(crate) fn is_broken(&self) -> bool {
        !self.broken.is_empty()
    }

    /// Whether nothing was broken and every fault survived.
    pub(crate) fn is_clean(&self) -> bool {
        !self.is_broken() && self.sum(|count| count.survived) == self.sum(|count| count.injected)
    }

    pub(crate) fn json(&self) -> Value {
        let (injected, survived) = (self.sum(|count| count.injected), self.sum(|count| count.survived));
        let by_fault: BTreeMap<&str, Value> = self
            .by_fault
            .iter()
            .map(|(name, count)| {
                let lost = count.injected - count.survived;
                let value = json!({
                    "injected": count.injected,
                    "in_contact": count.in_contact,
                    "survived": count.survived,
                    "lost": lost,
                });
                (*name, value)
            })
            .collect();
        json!({
            "injected": injected,
            "in_contact": self.sum(|count| count.in_contact),
            "survived": survived,
            "lost": injected - survived,
            "invariants_broken": self.broken.len(),
            "by_fault": by_fault,
            "broken": self.broken.iter().map(|(what, how)| json!({ "invariant": what, "how": how })).collect::<Vec<_>>(),
            "losses": self.lost,
            "kinds": self.by_fault.len(),
            "kinds_there_are": Fault::all().len(),
            "touches": self.touches,
            "seconds": self.seconds,
            "commands": self.commands,
            "truths": self.truths,
            "recordings": self.recordings,
            "records": self.records,
            "in_windows": self.share(&self.windows),
            "disturbed_by_the_machine": self.share(&self.disturbed),
            "forces_explained_by_windows": self.excused,
        })
    }

    pub(crate) fn table(&self) -> String {
        let mut table = Table::new();
        table.load_style(presets::ASCII_MARKDOWN);
        table.set_header(["fault", "injected", "in contact", "survived", "lost"]);
        let mut row = |name: &str, count: &Count| {
            let numbers = [count.injected, count.in_contact, count.survived, count.injected - count.survived];
            table.add_row([&[name.to_owned()], &numbers.map(|number| number.to_string())[..]].concat());
        };
        self.by_fault.iter().for_each(|(name, count)| row(name, count));
        let all = Count {
            injected: self.sum(|count| count.injected),
            in_contact: self.sum(|count| count.in_contact),
            survived: self.sum(|count| count.survived),
        };
        row("all", &all);
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        let lost: String = self.lost.iter().map(|how| format!("\nlost: {how}")).collect();
        let broken: String = self.broken.iter().map(|(what, how)| format!("\n  {what}: {how}")).collect();
        format!(
            "{table}\n{} of {} kinds of fault; {} touches in {:.0} s, {} commands and {} truth samples seen, {} records in {} recordings\n\
             windows of faults: {:.1} % of the time (at most {:.0} %); the machine disturbed {:.1} %; forces above the limit within \
             them: {}{lost}\ninvariants broken: {}{broken}",
            self.by_fault.len(),
            Fault::all().len(),
            self.touches,
            self.seconds,
            self.commands,
            self.truths,
            self.records,
            self.recordings,
            self.share(&self.windows) * 100.0,
            MOST_IN_WINDOWS * 100.0,
            self.share(&self.disturbed) * 100.0,
            self.excused,
            self.broken.len(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn above(stamp_ns: u64) -> Finding {
        Finding::Broken { invariant: Invariant::ForceBelowLimit, stamp_ns, what: "210.0 N".to_owned() }
    }

    #[test]
    fn only_forces_within_windows_are_excused() {
        let mut tally = Tally::default();
        tally.injected(Fault::DaemonStopped, true, (1_000, 2_000));
        tally.survived(Fault::DaemonStopped);
        tally.observed(&[above(1_500), Finding::Disturbed { stamp_ns: 5_000 }, above(5_100)], 200, 1.0);
        assert!(tally.is_clean(), "{}", tally.table());
        let unreported =
            Finding::Broken { invariant: Invariant::StopIsReported, stamp_ns: 1_500, what: "no reason".to_owned() };
        tally.observed(&[above(2_500), unreported], 200, 1.0);
        let json = tally.json();
        assert_eq!((&json["invariants_broken"], &json["injected"]), (&2.into(), &1.into()));
        assert_eq!(json["by_fault"]["daemon_stopped"]["survived"], 1);
        assert!(!tally.is_clean());
    }

    #[test]
    fn windows_may_not_cover_the_soak() {
        let mut tally = Tally::default();
        // Twice the same 0.4 s.
        tally.injected(Fault::PlantStopped, false, (0, 400_000_000));
        tally.injected(Fault::PlantStopped, false, (0, 400_000_000));
        tally.observed(&[], 0, 1.0);
        assert!((tally.json()["in_windows"].as_f64().expect("a number") - 0.4).abs() < 1e-9);
        assert_eq!(tally.broken.len(), 1);
    }

    #[test]
    fn a_fault_without_control_afterwards_is_lost() {
        let mut tally = Tally::default();
        tally.injected(Fault::Scripted(plant_sim::faults::FaultKind::Drop), true, (0, 1));
        tally.observed(&[], 0, 1.0);
        assert_eq!(tally.json()["lost"], 1);
        assert!(!tally.is_clean());
    }
}
