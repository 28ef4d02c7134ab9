//! From runs to figures.

use std::collections::BTreeMap;

use admittancectl::plausible::{Cause, Cell};
use comfy_table::Table;
use serde::Serialize;

use super::super::statistics::Distribution;
use super::{Faults, Run, SPEEDS, Told};

/// Bad runs that the text shows, at most, and mistaken ones.
const MOST_EXAMPLES: usize = 10;

/// The figures of some runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Counts {
    runs: usize,
    /// Some force above its limit by more than 0.5 N.
    over_limit: usize,
    /// Of these, those that full outward speed would have kept.
    avoidable: usize,
    /// Largest force of those over its limit; 0 where there are none.
    worst_avoidable_ratio: f64,
    /// Of these, those in which the controller did not stop.
    never_stopped: usize,
    /// Worlds in which full outward speed does not keep the limit, whatever the controller did.
    unattainable: usize,
    /// Largest force over its limit.
    worst_ratio: f64,
    /// Of the runs above the limit: the peak over that of full outward speed, or over the limit
    /// where that one keeps it.
    excess_over_attainable: Option<Excess>,
    /// Contact lost later than 50 ms after the first touch, before any stop.
    with_losses: usize,
    /// Stopped although full outward speed keeps the limit.
    false_stops: usize,
    /// Something else taken for a contact, or for a surface that pulls, before the tool touched.
    mistaken: usize,
    /// Above the limit without a stop, a verdict that it can't or may not be kept, or a sample that was counted.
    silent: usize,
}

impl Counts {
    fn of<'a>(runs: impl Iterator<Item = &'a Run> + Clone) -> Self {
        let over = runs.clone().filter(|run| run.contact.is_over);
        let worst =
            |runs: &mut dyn Iterator<Item = &'a Run>| runs.map(|run| run.contact.peak_ratio).fold(0.0, f64::max);
        let count = |is: fn(&Run) -> bool| runs.clone().filter(|run| is(run)).count();
        Self {
            runs: runs.clone().count(),
            over_limit: count(|run| run.contact.is_over),
            avoidable: count(Run::is_avoidably_over),
            worst_avoidable_ratio: worst(&mut over.clone().filter(|run| run.is_avoidably_over())),
            never_stopped: count(|run| run.contact.is_over && run.contact.stop_reason.is_none()),
            unattainable: count(|run| run.outward.is_over),
            worst_ratio: worst(&mut runs.clone()),
            excess_over_attainable: Distribution::of(over.map(Run::excess).collect())
                .map(|of| Excess { p99: of.p99, max: of.max }),
            with_losses: count(|run| run.contact.late_losses > 0),
            false_stops: count(Run::is_false_stop),
            mistaken: count(|run| run.contact.is_mistaken),
            silent: count(|run| run.contact.is_silent()),
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Speed {
    /// Part of the speed that `limits` names.
    speed: f64,
    #[serde(flatten)]
    counts: Counts,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct OfCell {
    cell: &'static str,
    /// What `limits` names, m/s.
    speed_m_s: f64,
    by_speed: Vec<Speed>,
}

/// Of the runs in which something is bad.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
struct Tried {
    /// It is with this cause alone.
    alone: usize,
    /// It is not without it.
    cured: usize,
}

impl Tried {
    /// Counts a run that is bad (or it does not count), and whether it is with the cause alone, and without it.
    fn count(&mut self, [is_bad, alone, without]: [bool; 3]) {
        self.alone += usize::from(is_bad && alone);
        self.cured += usize::from(is_bad && !without);
    }
}

/// Of the bad runs, and apart of those that are avoidably above the limit, lose contact late, or stop falsely.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
struct OfCause {
    #[serde(flatten)]
    all: Tried,
    over: Tried,
    lost: Tried,
    stopped: Tried,
}

impl OfCause {
    fn count(&mut self, is: Faults, alone: Faults, without: Faults) {
        let both = |of: fn(Faults) -> bool| [of(is), of(alone), of(without)];
        self.all.count(both(Faults::any));
        self.over.count(both(|of| of.over));
        self.lost.count(both(|of| of.lost));
        self.stopped.count(both(|of| of.stopped));
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Excess {
    p99: f64,
    max: f64,
}

/// The whole study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Figures {
    seed: u64,
    #[serde(flatten)]
    all: Counts,
    by_speed: Vec<Speed>,
    by_cell: Vec<OfCell>,
    /// Runs that are over the limit though attainable, lose contact late, or stop falsely.
    bad: usize,
    by_cause: BTreeMap<Cause, OfCause>,
    /// Each of them.
    pub(super) bad_runs: Vec<Bad>,
    /// The commands that show those again in which something else was taken for a contact.
    pub(super) mistaken_runs: Vec<String>,
    /// The commands that show silent ones again.
    silent_runs: Vec<String>,
}

/// A bad run, and what it did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Bad {
    /// What shows it again.
    pub(super) command: String,
    cell: &'static str,
    /// Part of the speed that `limits` names.
    speed: f64,
    #[serde(flatten)]
    faults: Faults,
}

/// What shows a run again.
fn command(seed: u64, told: &Told, index: u64) -> String {
    format!("admittance-lab study robustness --seed {seed}{told} --index {index}")
}

fn by_speed<'a>(runs: impl Iterator<Item = &'a Run> + Clone) -> Vec<Speed> {
    let of = |speed| Speed { speed, counts: Counts::of(runs.clone().filter(move |run| run.speed == speed)) };
    SPEEDS.map(of).to_vec()
}

impl Figures {
    /// `told`: what was asked for, on which the runs depend.
    pub(super) fn of(seed: u64, told: &Told, cells: &[(&'static str, Cell)], runs: &[Run]) -> Self {
        let mut by_cause: BTreeMap<Cause, OfCause> = Cause::ALL.map(|cause| (cause, OfCause::default())).into();
        for run in runs {
            for &(cause, alone, without) in &run.causes {
                by_cause.entry(cause).or_default().count(run.faults(), alone, without);
            }
        }
        let bad = runs.iter().filter(|run| run.is_bad()).map(|run| Bad {
            command: command(seed, told, run.index),
            cell: run.cell,
            speed: run.speed,
            faults: run.faults(),
        });
        let bad_runs: Vec<Bad> = bad.collect();
        let commands = |is: fn(&Run) -> bool| {
            runs.iter().filter(|run| is(run)).map(|run| command(seed, told, run.index)).collect()
        };
        Self {
            seed,
            all: Counts::of(runs.iter()),
            by_speed: by_speed(runs.iter()),
            by_cell: cells
                .iter()
                .map(|(name, cell)| OfCell {
                    cell: name,
                    speed_m_s: cell.highest_speed_m_s,
                    by_speed: by_speed(runs.iter().filter(|run| run.cell == *name)),
                })
                .collect(),
            bad: bad_runs.len(),
            by_cause,
            bad_runs,
            mistaken_runs: commands(|run| run.contact.is_mistaken),
            silent_runs: commands(|run| run.contact.is_silent()),
        }
    }

    /// As text.
    pub(super) fn table(&self) -> String {
        let mut table = Table::new();
        table.set_header([
            "cell",
            "m/s",
            "runs",
            "over limit",
            "of which avoidable",
            "of which never stopped",
            "full outward over",
            "worst ratio",
            "with losses",
            "false stops",
            "mistaken",
            "silent",
        ]);
        let mut row = |name: &str, speed: String, of: &Counts| {
            let counts = [of.with_losses, of.false_stops, of.mistaken, of.silent].map(|count| count.to_string());
            let head = [name.to_owned(), speed, of.runs.to_string(), of.over_limit.to_string()];
            let over = [of.avoidable, of.never_stopped, of.unattainable].map(|count| count.to_string());
            table.add_row(head.into_iter().chain(over).chain([format!("{:.3}", of.worst_ratio)]).chain(counts));
        };
        for cell in &self.by_cell {
            for of in &cell.by_speed {
                row(cell.cell, format!("{:.3}", of.speed * cell.speed_m_s), &of.counts);
            }
        }
        for of in &self.by_speed {
            row("all", format!("x {}", of.speed), &of.counts);
        }
        let causes = self.by_cause.iter().map(|(cause, of)| {
            let [all, over, lost, stopped] =
                [of.all, of.over, of.lost, of.stopped].map(|tried| format!("{}, {}", tried.alone, tried.cured));
            format!("\n  {cause:?}: {all} (above the limit {over}; lost {lost}; stopped {stopped})")
        });
        let causes: String = causes.collect();
        let lines = |commands: &mut dyn Iterator<Item = &String>| {
            commands.map(|command| format!("\n  {command}")).collect::<String>()
        };
        let examples = lines(&mut self.bad_runs.iter().map(|run| &run.command).take(MOST_EXAMPLES));
        let said = |name: &str, lines: String| if lines.is_empty() { lines } else { format!("\n{name}:{lines}") };
        let mistaken = said("Mistaken, for example", lines(&mut self.mistaken_runs.iter().take(MOST_EXAMPLES)));
        let silent = said("Silent", lines(&mut self.silent_runs.iter()));
        format!(
            "{table}\n{} of {} runs are bad (seed {}){}{examples}{mistaken}{silent}\nBad with one cause alone, good without it:{causes}",
            self.bad,
            self.all.runs,
            self.seed,
            if examples.is_empty() { "" } else { ", for example" }
        )
    }
}
