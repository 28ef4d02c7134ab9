//! Modes, verdicts and reasons of a recording: when they changed.

use std::ops::Range;

use ipc_types::{Mode, RecordKind, RecordSample, StopReason, Verdict};

use super::page::table_row;
use super::timeline::{Band, spans, svg};
use crate::diagnostics::mode_text;

/// Rows of the table that are shown.
const ROWS: usize = 100;

/// What a cycle said.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Said {
    time_s: f64,
    /// Codes of mode, verdict and reason.
    mode: u32,
    verdict: u32,
    stop_reason: u32,
}

impl Said {
    fn is_one_of(&self, modes: [Mode; 2]) -> bool {
        modes.iter().any(|mode| mode.code() == self.mode)
    }

    fn reason(&self) -> String {
        let (reason, mode) = (StopReason::name_of(self.stop_reason), Mode::name_of(self.mode));
        format!("{reason} at {:.3} s ({mode})", self.time_s)
    }
}

/// Cycles that said something else than the one before.
#[derive(Debug, Clone, Default)]
pub(crate) struct Changes(Vec<Said>);

impl Changes {
    /// Takes in a record, of a sample or of a silence.
    pub(crate) fn add(&mut self, record: &RecordSample, time_s: f64) {
        let is_cycle = [RecordKind::Sample, RecordKind::Silence].map(RecordKind::code).contains(&record.kind);
        let command = &record.command;
        if !is_cycle || command.state_sequence == 0 {
            return;
        }
        let (mode, verdict, stop_reason) = (command.mode, command.verdict, command.stop_reason);
        let said = Said { time_s, mode, verdict, stop_reason };
        if self.0.last().is_none_or(|last| Said { time_s, ..*last } != said) {
            self.0.push(said);
        }
    }

    /// The first stop, and when: "Infeasible at 0.120 s (Stopping)". Where there was none, what has
    /// ended control: a motion controller that ends is no stop.
    pub(super) fn first_stop(&self) -> String {
        if let Some(stop) = self.stop() {
            return stop;
        }
        let mut controlled = self.0.iter().skip_while(|said| !said.is_one_of([Mode::Free, Mode::Contact]));
        let ended = controlled.find(|said| said.stop_reason != StopReason::NONE);
        ended.map_or("none".to_owned(), |ended| format!("none; control has ended: {}", ended.reason()))
    }

    /// The first stop, and when, if there was one.
    pub(crate) fn stop(&self) -> Option<String> {
        self.0.iter().find(|said| said.is_one_of([Mode::Stopping, Mode::Stopped])).map(Said::reason)
    }

    /// Modes and verdicts up to `end_s`, the first band with this heading.
    pub(super) fn bands(&self, heading: Option<String>, end_s: f64) -> [Band; 2] {
        let modes =
            self.0.iter().map(|said| (said.time_s, mode_text(said.mode, said.stop_reason), mode_color(said.mode)));
        let verdicts = self.0.iter().map(|said| {
            let (name, color) = verdict_look(said.verdict);
            (said.time_s, name.to_owned(), color)
        });
        [
            Band { heading, title: "mode", spans: spans(modes, end_s) },
            Band { heading: None, title: "verdict", spans: spans(verdicts, end_s) },
        ]
    }

    /// Modes and verdicts over time (s), as a picture of this width in px.
    pub(super) fn timeline(&self, time: &Range<f64>, width_px: u32) -> String {
        svg(&self.bands(None, time.end), time, "Mode and verdict over time", width_px)
    }

    /// A table of them in HTML.
    pub(super) fn table(&self) -> String {
        let head = table_row(&["time in s", "mode", "reason", "verdict"].map(str::to_owned), "th");
        let row = |said: &Said| {
            let names =
                [Mode::name_of(said.mode), StopReason::name_of(said.stop_reason), Verdict::name_of(said.verdict)];
            let [mode, reason, verdict] = names.map(str::to_owned);
            table_row(&[format!("{:.3}", said.time_s), mode, reason, verdict], "td")
        };
        let rows: String = self.0.iter().take(ROWS).map(row).collect();
        let more = self.0.len().saturating_sub(ROWS);
        let more = if more > 0 { format!("<p>and {more} more</p>\n") } else { String::new() };
        format!(
            "<details><summary>Changes of mode and verdict</summary>\n<table>\n{head}{rows}</table>\n{more}</details>\n"
        )
    }

    /// When the last one was, in s.
    pub(crate) fn end_s(&self) -> Option<f64> {
        self.0.last().map(|said| said.time_s)
    }
}

fn mode_color(mode: u32) -> &'static str {
    match Mode::from_code(mode) {
        Some(Mode::Idle) | None => "#8A8578",
        Some(Mode::Free) => "#1B7F4B",
        Some(Mode::Contact) => "#0B5CAD",
        Some(Mode::Stopping) => "#C44E12",
        Some(Mode::Stopped) => "#B00020",
    }
}

fn verdict_look(verdict: u32) -> (&'static str, &'static str) {
    match Verdict::from_code(verdict) {
        Some(Verdict::Feasible) => ("feasible", "#2E6F95"),
        Some(Verdict::Infeasible) => ("infeasible", "#8E1B3A"),
        Some(Verdict::AtRisk) => ("at risk", "#B7791F"),
        Some(Verdict::None) | None => ("no verdict", "#77736A"),
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::CommandSample;

    use super::*;

    fn record(kind: RecordKind, mode: Mode, stop_reason: u32) -> RecordSample {
        let command = CommandSample { state_sequence: 1, mode: mode.code(), stop_reason, ..CommandSample::zeroed() };
        RecordSample { kind: kind.code(), command, ..RecordSample::zeroed() }
    }

    #[test]
    fn a_stop_by_silence_is_one() {
        let mut changes = Changes::default();
        assert_eq!(changes.first_stop(), "none");
        changes.add(&record(RecordKind::Sample, Mode::Contact, StopReason::NONE), 0.1);
        changes.add(&record(RecordKind::Sample, Mode::Contact, StopReason::NONE), 0.2);
        changes.add(&record(RecordKind::Silence, Mode::Stopping, StopReason::SampleStale.code()), 0.3);
        changes.add(&record(RecordKind::Silence, Mode::Stopped, StopReason::SampleStale.code()), 0.4);
        assert_eq!(changes.first_stop(), "SampleStale at 0.300 s (Stopping)");
        assert_eq!((changes.0.len(), changes.end_s()), (3, Some(0.4)));
        let svg = changes.timeline(&(0.0..0.5), 860);
        for text in
            ["<title>Contact, 0.100 s to 0.300 s</title>", "Stopped (SampleStale), 0.400 s to 0.500 s", "no verdict"]
        {
            assert!(svg.contains(text), "{text} is missing in {svg}");
        }
    }

    #[test]
    fn what_is_no_stop_is_not_called_one_and_hides_none() {
        let mut changes = Changes::default();
        changes.add(&record(RecordKind::Silence, Mode::Idle, StopReason::SampleStale.code()), 0.0);
        changes.add(&record(RecordKind::Sample, Mode::Free, StopReason::NONE), 0.1);
        assert_eq!(changes.first_stop(), "none");
        changes.add(&record(RecordKind::Silence, Mode::Idle, StopReason::SampleStale.code()), 3.9);
        assert_eq!(changes.first_stop(), "none; control has ended: SampleStale at 3.900 s (Idle)");
        changes.add(&record(RecordKind::Sample, Mode::Free, StopReason::NONE), 4.0);
        changes.add(&record(RecordKind::Sample, Mode::Stopping, StopReason::Infeasible.code()), 5.0);
        assert_eq!(changes.first_stop(), "Infeasible at 5.000 s (Stopping)");
    }

    #[test]
    fn orders_and_what_came_before_the_first_sample_say_nothing() {
        let mut changes = Changes::default();
        changes.add(&record(RecordKind::Reset, Mode::Stopped, StopReason::Disabled.code()), 0.1);
        let mut before = record(RecordKind::Silence, Mode::Idle, StopReason::SampleStale.code());
        before.command.state_sequence = 0;
        changes.add(&before, 0.2);
        assert_eq!((changes.first_stop(), changes.end_s()), ("none".to_owned(), None));
    }
}
