//! From runs to figures.

use std::collections::BTreeMap;

use serde::Serialize;

use super::closed_loop::Seen;
use super::controller::Variant;
use super::draw::{ArmName, Draw};
use super::speed_figure::Speeds;

/// A limit counts as exceeded by more than this: newtons, plus a share of the limit.
const EXCEEDED_N: f64 = 0.5;
const EXCEEDED_SHARE: f64 = 0.005;
/// Fewer samples in contact than this say little about a verdict.
const FEWEST_SAMPLES: u32 = 3;
/// Edges in N/m of the stiffness decades.
const DECADES_N_M: [(f64, f64); 2] = [(1e4, 1e5), (1e5, 1e6)];

/// Everything known about a case: the draw, what is attainable, and a run for each variant.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    /// Which arm it is, with `--arms`.
    pub(crate) arm: Option<ArmName>,
    /// The case.
    pub(crate) draw: Draw,
    /// Lowest attainable peak of the nonlinear arm in N; `None` without an active sample, `Err`
    /// when it was not found.
    pub(crate) attainable_peak_n: Option<Result<f64, String>>,
    /// The same of the nominal run from a state shortly before its verdict was withdrawn, where it was.
    pub(crate) later_peak_n: Option<Result<f64, String>>,
    /// Optimum of the last linearisation in N.
    pub(crate) optimum_n: f64,
    /// The lowest peak in N, by the linear problem, of inputs that never lose contact; asked only
    /// where contact was lost.
    pub(crate) peak_in_contact_n: Option<f64>,
    /// In the order of [`Variant::ALL`]; with `--arms` the nominal one alone.
    pub(crate) runs: Vec<Result<Seen, String>>,
}

/// Why a run is reported apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Apart {
    Failed,
    NoContact,
    AlreadyOver,
    Brief,
}

impl Case {
    fn limit_n(&self) -> f64 {
        self.draw.normal_force_limit_n()
    }

    fn peak_n(&self) -> Option<f64> {
        self.attainable_peak_n.as_ref().and_then(|peak| peak.as_ref().ok()).copied()
    }

    /// `None` when there is nothing to attain, or the judge did not find out.
    pub(crate) fn is_attainable(&self) -> Option<bool> {
        self.peak_n().map(|peak| peak <= self.limit_n())
    }

    /// Whether the limit can be kept from the first active sample on, and later no longer, in the nominal run: the
    /// command asks for what no controller can do there. Where the judge does not know it is not said.
    pub(crate) fn is_outpaced(&self) -> bool {
        let later = self.later_peak_n.as_ref().and_then(|peak| peak.as_ref().ok());
        self.is_attainable() == Some(true) && later.is_some_and(|peak| *peak > self.limit_n())
    }

    /// Whether the optimum of the linear problem keeps the limit and its inputs, on the nonlinear
    /// arm, do not.
    fn is_unconfirmed(&self) -> bool {
        self.is_attainable() == Some(false) && self.optimum_n <= self.limit_n()
    }

    /// The run of a variant, or why it is reported apart.
    fn run(&self, variant: usize) -> Result<&Seen, Apart> {
        let seen = self.runs[variant].as_ref().map_err(|_| Apart::Failed)?;
        match (&seen.first_active, self.is_attainable()) {
            (None, _) => Err(Apart::NoContact),
            (Some(first), _) if first.normal_force_n > self.limit_n() => Err(Apart::AlreadyOver),
            _ if seen.samples_in_contact < FEWEST_SAMPLES => Err(Apart::Brief),
            (Some(_), None) => Err(Apart::Failed),
            (Some(_), Some(_)) => Ok(seen),
        }
    }
}

/// Whether a force is above a limit, both in N, by more than the tolerance.
pub(crate) fn exceeds(force_n: f64, limit_n: f64) -> bool {
    force_n > limit_n + EXCEEDED_N + EXCEEDED_SHARE * limit_n
}

/// A distribution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Distribution {
    /// Median.
    pub(crate) median: f64,
    /// 99th percentile, by nearest rank.
    pub(crate) p99: f64,
    /// Largest value.
    pub(crate) max: f64,
}

impl Distribution {
    pub(crate) fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let rank = |share: f64| values.get(((share * values.len() as f64).ceil() as usize).max(1) - 1).copied();
        Some(Self { median: rank(0.5)?, p99: rank(0.99)?, max: rank(1.0)? })
    }
}

/// The figures of one variant. Those reported apart are in none of the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Column {
    /// Runs that count: all but those reported apart.
    pub(crate) counted: u32,
    /// Counted runs in which some input keeps the limit for 100 ms.
    pub(crate) attainable: u32,
    /// Counted runs without an infeasible verdict.
    pub(crate) feasible: u32,
    /// Runs whose limit was exceeded in cycles whose verdict was feasible.
    pub(crate) unsound: u32,
    /// Largest share of the limit by which it was exceeded there.
    pub(crate) unsound_excess_max: f64,
    /// Infeasible though attainable, as a share of attainable runs; null without attainable runs.
    pub(crate) timid: Option<f64>,
    /// The same as a number of runs.
    pub(crate) timid_runs: u32,
    /// Feasible first, infeasible later.
    pub(crate) withdrawn: u32,
    /// Of these: from shortly before the infeasible verdict on no input does what is commanded within the limits.
    pub(crate) outpaced: u32,
    /// Contact losses in feasible runs.
    pub(crate) contact_losses: u32,
    /// Feasible runs that lost contact.
    pub(crate) runs_with_contact_losses: u32,
    /// Of those runs: no input keeps both the contact and the limit.
    pub(crate) unavoidable_losses: u32,
    /// Feasible runs whose limit was exceeded in cycles that had no verdict.
    pub(crate) over_limit_without_verdict: u32,
    /// Runs that were stopped, whatever the reason.
    pub(crate) stops: u32,
    /// Those among them without an infeasible verdict: stopped for another reason.
    pub(crate) other_stops: u32,
    /// Stops: true peak over the lowest attainable peak; null without stops.
    pub(crate) stop_peak_ratio: Option<Distribution>,
    /// Stops: resting force in N.
    pub(crate) resting_force_n: Option<Distribution>,
    /// Stops whose resting force is over the limit.
    pub(crate) resting_over_limit: u32,
    /// Apart: over the limit at the first active sample already.
    pub(crate) already_over_limit: u32,
    /// Apart: fewer than three samples in contact.
    pub(crate) brief: u32,
    /// Apart: no sample was active.
    pub(crate) no_contact: u32,
    /// Apart: no run, or no answer of the judge.
    pub(crate) failed: u32,
    /// Indices of cases to look at, the first of each kind.
    pub(crate) examples: Examples,
}

/// Cases to look at.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Examples {
    pub(crate) unsound: Vec<u64>,
    pub(crate) timid: Vec<u64>,
    pub(crate) withdrawn: Vec<u64>,
    pub(crate) outpaced: Vec<u64>,
    /// Feasible runs that lost contact.
    pub(crate) lost: Vec<u64>,
    /// Stops with more than [`HIGH_PEAK`] times the lowest attainable peak.
    pub(crate) high: Vec<u64>,
    /// Stops that rest above the limit.
    pub(crate) resting: Vec<u64>,
    pub(crate) failed: Vec<u64>,
}

const MOST_EXAMPLES: usize = 10;
/// Peak of a stop over the lowest attainable one, above which it is worth a look.
const HIGH_PEAK: f64 = 1.02;

fn example(list: &mut Vec<u64>, case: &Case) {
    if list.len() < MOST_EXAMPLES {
        list.push(case.draw.index);
    }
}

/// A decade of stiffness.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Decade {
    /// Edges in N/m.
    pub(crate) from_n_m: f64,
    pub(crate) to_n_m: f64,
    /// Counted runs of the nominal variant.
    pub(crate) attainable: u32,
    pub(crate) unattainable: u32,
}

/// The whole study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Figures {
    /// Cases drawn.
    pub(crate) runs: u64,
    /// Seed of the draws.
    pub(crate) seed: u64,
    /// The nominal variant.
    #[serde(flatten)]
    pub(crate) nominal: Column,
    /// Counted cases whose linear optimum keeps the limit while its inputs on the nonlinear arm do
    /// not: unattainable here.
    pub(crate) unconfirmed: u32,
    /// By stiffness.
    pub(crate) stiffness_decades: Vec<Decade>,
    /// The same cases with a controller that believes something else; no targets yet.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) variants: BTreeMap<&'static str, Column>,
    /// Those of each arm, with `--arms`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) by_arm: BTreeMap<&'static str, Column>,
    /// The figure's numbers, when it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) approach_speeds: Option<Vec<Speeds>>,
}

/// The figures of these cases, which are in the order of their indices.
pub(crate) fn figures(seed: u64, cases: &[Case]) -> Figures {
    let counted = || cases.iter().filter(|case| case.run(0).is_ok());
    let decades = DECADES_N_M.map(|(from_n_m, to_n_m)| {
        let count = |attainable: bool| {
            counted()
                .filter(|case| (from_n_m..to_n_m).contains(&case.draw.stiffness_n_m))
                .filter(|case| case.is_attainable() == Some(attainable))
                .count() as u32
        };
        Decade { from_n_m, to_n_m, attainable: count(true), unattainable: count(false) }
    });
    let variants = cases.iter().map(|case| case.runs.len()).max().unwrap_or(0);
    let others = Variant::ALL.iter().enumerate().take(variants).skip(1);
    let all = || cases.iter();
    let of_arm = |arm: ArmName| {
        let mut cases = all().filter(move |case| case.arm == Some(arm)).peekable();
        cases.peek().is_some().then(|| (arm.name(), column(cases, 0)))
    };
    Figures {
        runs: cases.len() as u64,
        seed,
        nominal: column(all(), 0),
        unconfirmed: counted().filter(|case| case.is_unconfirmed()).count() as u32,
        stiffness_decades: decades.to_vec(),
        variants: others.map(|(index, variant)| (variant.name(), column(all(), index))).collect(),
        by_arm: ArmName::ALL.into_iter().filter_map(of_arm).collect(),
        approach_speeds: None,
    }
}

fn column<'a>(cases: impl Iterator<Item = &'a Case>, variant: usize) -> Column {
    let mut column = Column {
        counted: 0,
        attainable: 0,
        feasible: 0,
        unsound: 0,
        unsound_excess_max: 0.0,
        timid: None,
        timid_runs: 0,
        withdrawn: 0,
        outpaced: 0,
        contact_losses: 0,
        runs_with_contact_losses: 0,
        unavoidable_losses: 0,
        over_limit_without_verdict: 0,
        stops: 0,
        other_stops: 0,
        stop_peak_ratio: None,
        resting_force_n: None,
        resting_over_limit: 0,
        already_over_limit: 0,
        brief: 0,
        no_contact: 0,
        failed: 0,
        examples: Examples::default(),
    };
    let (mut ratios, mut resting) = (Vec::new(), Vec::new());
    for case in cases {
        let seen = match case.run(variant) {
            Ok(seen) => seen,
            Err(apart) => {
                match apart {
                    Apart::Failed => {
                        column.failed += 1;
                        example(&mut column.examples.failed, case);
                    }
                    Apart::NoContact => column.no_contact += 1,
                    Apart::AlreadyOver => column.already_over_limit += 1,
                    Apart::Brief => column.brief += 1,
                }
                continue;
            }
        };
        let (limit, attainable) = (case.limit_n(), case.is_attainable() == Some(true));
        column.counted += 1;
        column.attainable += u32::from(attainable);
        if exceeds(seen.peak_while_feasible_n, limit) {
            column.unsound += 1;
            column.unsound_excess_max = column.unsound_excess_max.max(seen.peak_while_feasible_n / limit - 1.0);
            example(&mut column.examples.unsound, case);
        }
        if seen.is_feasible() {
            column.feasible += 1;
            column.over_limit_without_verdict += u32::from(exceeds(seen.peak_without_verdict_n, limit));
            column.contact_losses += seen.contact_losses;
            if seen.contact_losses > 0 {
                column.runs_with_contact_losses += 1;
                let is_unavoidable = case.peak_in_contact_n.is_some_and(|peak| peak > limit);
                column.unavoidable_losses += u32::from(is_unavoidable);
                example(&mut column.examples.lost, case);
            }
        } else {
            if variant == 0 && case.is_outpaced() {
                column.outpaced += 1;
                example(&mut column.examples.outpaced, case);
            }
            if attainable {
                column.timid_runs += 1;
                example(&mut column.examples.timid, case);
            }
            if seen.first_verdict_feasible == Some(true) {
                column.withdrawn += 1;
                example(&mut column.examples.withdrawn, case);
            }
        }
        if seen.stopped() {
            column.stops += 1;
            column.other_stops += u32::from(seen.is_feasible());
            if exceeds(seen.resting_force_n, limit) {
                column.resting_over_limit += 1;
                example(&mut column.examples.resting, case);
            }
            resting.push(seen.resting_force_n);
            let ratio = case.peak_n().map(|peak| seen.peak_n / peak);
            if ratio.is_some_and(|ratio| ratio > HIGH_PEAK) {
                example(&mut column.examples.high, case);
            }
            ratios.extend(ratio);
        }
    }
    column.timid = (column.attainable > 0).then(|| f64::from(column.timid_runs) / f64::from(column.attainable));
    column.stop_peak_ratio = Distribution::of(ratios);
    column.resting_force_n = Distribution::of(resting);
    column
}

#[cfg(test)]
mod tests;
