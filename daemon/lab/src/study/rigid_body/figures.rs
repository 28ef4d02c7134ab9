//! From runs to figures.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::Serialize;

use super::draw::Cause;
use super::{Failed, Run};
use crate::study::statistics::{Distribution, exceeds};

const MOST_EXAMPLES: usize = 10;

/// Of an unsound run, by how much of its limit it was over it.
#[derive(Debug, Clone, Serialize)]
struct Excess {
    runs: u32,
    #[serde(flatten)]
    distribution: Option<Distribution>,
}

impl Excess {
    fn of(excesses: Vec<f64>) -> Self {
        Self { runs: excesses.len() as u32, distribution: Distribution::of(excesses) }
    }
}

/// Indices of runs to look at.
#[derive(Debug, Clone, Default, Serialize)]
struct Examples {
    unsound: Vec<u64>,
    timid: Vec<u64>,
    failed: Vec<u64>,
}

/// The figures of one kind of arm, or of all.
#[derive(Debug, Clone, Serialize)]
struct Column {
    /// Runs with a verdict that were not over the limit before it.
    counted: u32,
    attainable: u32,
    /// Without an infeasible verdict.
    feasible: u32,
    /// Whose limit was exceeded in cycles whose verdict was feasible.
    unsound: u32,
    unsound_share: f64,
    /// By how much of the limit: of all unsound runs, and of those that are sound without a cause.
    excess_over_limit: Excess,
    excess_over_limit_by_cause: BTreeMap<Cause, Excess>,
    /// Infeasible though attainable, as a share of attainable runs.
    timid: f64,
    timid_runs: u32,
    /// Of them: timid, too, where surface, lags and delay are told as they are.
    timid_by_physics: u32,
    /// And those that are not: what identify did not know.
    timid_by_ignorance: u32,
    /// Said to be at risk and never infeasible; and those of them that kept the limit: where nobody can know.
    at_risk: u32,
    at_risk_kept: u32,
    stops: u32,
    /// Without an infeasible verdict: stopped for another reason.
    other_stops: u32,
    resting_over_limit: u32,
    runs_with_contact_losses: u32,
    /// Apart: over the limit before there was a verdict.
    already_over_limit: u32,
    /// Apart: no verdict.
    no_contact: u32,
}

/// All of them.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Figures {
    world: &'static str,
    seed: u64,
    runs: u64,
    /// Apart: an arm that cannot be set up or identified, or a run that cannot be simulated; why, how often.
    failed: BTreeMap<String, u32>,
    all: Column,
    by_arm: BTreeMap<&'static str, Column>,
    examples: Examples,
}

fn share(part: u32, whole: u32) -> f64 {
    if whole == 0 { 0.0 } else { f64::from(part) / f64::from(whole) }
}

impl Column {
    fn of<'r>(runs: impl Iterator<Item = &'r Run> + Clone) -> Self {
        let count = |counts: &dyn Fn(&Run) -> bool| runs.clone().filter(|run| counts(run)).count() as u32;
        let counts = |run: &Run| run.seen.first_force_n.is_some() && !run.is_already_over();
        let counted = |is: &dyn Fn(&Run) -> bool| count(&|run| counts(run) && is(run));
        let unsound = runs.clone().filter(|run| counts(run) && run.is_unsound());
        let excess = |run: &Run| run.seen.peak_while_feasible_n / run.limit_n - 1.0;
        let by_cause = |cause: Cause| {
            let of = unsound.clone().filter(|run| run.causes.contains(&cause));
            Excess::of(of.map(excess).collect())
        };
        let (all, attainable) = (counted(&|_| true), counted(&|run| run.is_attainable));
        let (unsound_runs, timid_runs) = (unsound.clone().count() as u32, counted(&Run::is_timid));
        let by_physics = counted(&|run| run.is_timid() && run.is_timid_by_physics);
        Self {
            counted: all,
            attainable,
            feasible: counted(&|run| run.seen.infeasible_cycles == 0),
            unsound: unsound_runs,
            unsound_share: share(unsound_runs, all),
            excess_over_limit: Excess::of(unsound.clone().map(excess).collect()),
            excess_over_limit_by_cause: Cause::ALL.into_iter().map(|cause| (cause, by_cause(cause))).collect(),
            timid: share(timid_runs, attainable),
            timid_runs,
            timid_by_physics: by_physics,
            timid_by_ignorance: timid_runs - by_physics,
            at_risk: counted(&Run::is_at_risk),
            at_risk_kept: counted(&|run| run.is_at_risk() && !exceeds(run.seen.peak_n, run.limit_n)),
            stops: counted(&|run| run.seen.stopped()),
            other_stops: counted(&|run| run.seen.stopped() && run.seen.infeasible_cycles == 0),
            resting_over_limit: counted(&|run| run.seen.stopped() && exceeds(run.seen.resting_n, run.limit_n)),
            runs_with_contact_losses: counted(&|run| run.seen.infeasible_cycles == 0 && run.seen.losses > 0),
            already_over_limit: count(&Run::is_already_over),
            no_contact: count(&|run| run.seen.first_force_n.is_none()),
        }
    }
}

impl Figures {
    pub(super) fn of(seed: u64, all: &[Result<Run, Failed>]) -> Self {
        let runs = || all.iter().flatten();
        let mut failed = BTreeMap::new();
        for why in all.iter().filter_map(|run| run.as_ref().err()) {
            *failed.entry(why.why.clone()).or_insert(0) += 1;
        }
        let examples = |is: &dyn Fn(&Run) -> bool| {
            runs().filter(|run| is(run)).map(|run| run.index).take(MOST_EXAMPLES).collect::<Vec<_>>()
        };
        let kinds: Vec<&'static str> = runs().map(|run| run.kind).collect();
        let column = |kind: &'static str| (kind, Column::of(runs().filter(move |run| run.kind == kind)));
        Self {
            world: "rigid-body",
            seed,
            runs: all.len() as u64,
            failed,
            all: Column::of(runs()),
            by_arm: kinds.into_iter().collect::<std::collections::BTreeSet<_>>().into_iter().map(column).collect(),
            examples: Examples {
                unsound: examples(&|run| run.is_unsound() && !run.is_already_over()),
                timid: examples(&|run| run.is_timid()),
                failed: all.iter().filter_map(|run| run.as_ref().err()).map(|failed| failed.index).take(10).collect(),
            },
        }
    }

    /// For a terminal.
    pub(crate) fn table(&self) -> String {
        let mut text = format!("{} contacts of seed {}, arms with masses, as identified\n", self.runs, self.seed);
        let all = std::iter::once(("all", &self.all)).chain(self.by_arm.iter().map(|(kind, column)| (*kind, column)));
        for (name, column) in all {
            let most = column.excess_over_limit.distribution.map_or(0.0, |excess| excess.max);
            let _ = writeln!(
                text,
                "{name}: {} counted, {} attainable, {} unsound ({:.2} %, by {:.1} % of the limit at most), {} timid ({:.1} % of \
                 attainable; {} by physics, {} by ignorance), {} at risk ({} of them kept the limit), {} at rest over the limit, {} other stops",
                column.counted,
                column.attainable,
                column.unsound,
                100.0 * column.unsound_share,
                100.0 * most,
                column.timid_runs,
                100.0 * column.timid,
                column.timid_by_physics,
                column.timid_by_ignorance,
                column.at_risk,
                column.at_risk_kept,
                column.resting_over_limit,
                column.other_stops,
            );
        }
        for (why, count) in &self.failed {
            let _ = writeln!(text, "not run, {count} times: {why}");
        }
        text
    }
}
