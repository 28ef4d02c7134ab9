//! How fast the solver is, compared with Clarabel in the same run: condensation and solve of every
//! problem of a file, over and over, against data update and solve in the form and with the setting
//! that suit Clarabel best. Sequences of both take turns, so that other load on the machine affects
//! both.

use std::time::Instant;

use admittance_core::mpc::qp::QpOutcome;
use serde::Serialize;

use crate::clarabel_forms::{Form, Instance};
use crate::sequence::{Runner, Sequence, Start};

/// Solves of each kind, at the least.
const SOLVES: usize = 10_000;
/// Sequences that Clarabel solves in each form.
const CLARABEL_SEQUENCES: usize = 5;
/// Part of the best median beyond which a form or setting is given up.
const HOPELESS: f64 = 1.5;

/// Percentiles of durations, µs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Percentiles {
    /// Median.
    pub p50: f64,
    /// 99 of 100 are shorter.
    pub p99: f64,
    /// 999 of 1000 are shorter.
    pub p999: f64,
}

impl Percentiles {
    fn of(mut durations: Vec<f64>) -> Self {
        durations.sort_by(f64::total_cmp);
        if durations.is_empty() {
            return Self { p50: f64::NAN, p99: f64::NAN, p999: f64::NAN };
        }
        let at = |part: f64| {
            let index = (part * durations.len() as f64) as usize;
            (durations[index.min(durations.len() - 1)] * 1e3).round() / 1e3
        };
        Self { p50: at(0.5), p99: at(0.99), p999: at(0.999) }
    }
}

/// What was measured on one file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// The file.
    pub file: String,
    /// Problems in it.
    pub problems: usize,
    /// Largest deviation from the exact inputs, m/s or rad/s.
    pub max_deviation: f64,
    /// Condensation and solve, warm-started from the problem before; reset at the start of the
    /// sequence.
    pub warm_us: Percentiles,
    /// Condensation and solve from a cold start.
    pub cold_us: Percentiles,
    /// Data update and solve by Clarabel, in the form and with the setting that is fastest at the
    /// median of those that solve most problems.
    pub clarabel_us: Percentiles,
    /// That form and setting.
    pub clarabel_form: Option<Setting>,
    /// Median of Clarabel over the warm median.
    pub ratio: f64,
    /// Most iterations of a warm solve.
    pub iterations_max: u32,
}

fn microseconds(start: Instant) -> f64 {
    start.elapsed().as_nanos() as f64 * 1e-3
}

/// A form of the problem for Clarabel, with or without equilibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Setting {
    /// [`Form::sparse`], equilibrated.
    SparseEquilibrated,
    /// [`Form::sparse`].
    Sparse,
    /// [`Form::condensed`], equilibrated.
    CondensedEquilibrated,
    /// [`Form::condensed`].
    Condensed,
}

impl Setting {
    /// All there are.
    const ALL: [Self; 4] = [Self::SparseEquilibrated, Self::Sparse, Self::CondensedEquilibrated, Self::Condensed];
}

/// Clarabel on all problems of a sequence.
#[derive(Debug)]
struct Opponent {
    setting: Setting,
    forms: Vec<Form>,
    prepared: Vec<(Vec<f64>, Vec<f64>)>,
    instance: Instance,
    durations: Vec<f64>,
    failures: usize,
}

impl Opponent {
    /// Set up for a sequence; `None` when it is empty.
    fn new<const N: usize, const M: usize>(sequence: &Sequence<N, M>, setting: Setting) -> Option<Self> {
        let all = 0..sequence.problems.len();
        let forms: Vec<Form> = match setting {
            Setting::SparseEquilibrated | Setting::Sparse => all.map(|index| Form::sparse(sequence, index)).collect(),
            Setting::CondensedEquilibrated | Setting::Condensed => {
                let mut runner = Runner::new(sequence);
                all.map(|index| Form::condensed(&mut runner, sequence, index)).collect()
            }
        };
        let equilibrate = matches!(setting, Setting::SparseEquilibrated | Setting::CondensedEquilibrated);
        let instance = Instance::new(forms.first()?, equilibrate);
        let prepared = forms.iter().map(|form| instance.prepare(form)).collect();
        Some(Self { setting, forms, prepared, instance, durations: Vec::new(), failures: 0 })
    }

    /// Updates the data and solves, one problem after the other; how many it solves.
    fn solve_all(&mut self) -> usize {
        let before = self.failures;
        for (form, values) in self.forms.iter().zip(&self.prepared) {
            let begin = Instant::now();
            let is_solved = self.instance.solve(form, values);
            self.durations.push(microseconds(begin));
            self.failures += usize::from(!is_solved);
        }
        self.forms.len() - (self.failures - before)
    }

    /// Failures and median, µs.
    fn merit(&self) -> (usize, f64) {
        (self.failures, Percentiles::of(self.durations.clone()).p50)
    }
}

/// Fewer failures first, then the shorter median.
fn better(a: &(usize, f64), b: &(usize, f64)) -> std::cmp::Ordering {
    a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
}

/// Times a sequence.
pub fn bench<const N: usize, const M: usize>(name: &str, sequence: &Sequence<N, M>) -> Figures {
    let mut runner = Runner::new(sequence);
    let problems = sequence.problems.len();
    let mut max_deviation = 0.0_f64;
    let mut candidates: Vec<Opponent> =
        Setting::ALL.iter().filter_map(|setting| Opponent::new(sequence, *setting)).collect();
    let (mut warm, mut cold, mut iterations_max) = (Vec::new(), Vec::new(), 0);
    let repetitions = SOLVES.div_ceil(problems);
    for repetition in 0..repetitions {
        for (start, durations) in [(Start::Warm, &mut warm), (Start::Cold, &mut cold)] {
            runner.reset();
            for index in 0..problems {
                let begin = Instant::now();
                let outcome = runner.solve(sequence, index, start, |outcome, _, _, _, _| outcome);
                durations.push(microseconds(begin));
                if start == Start::Warm {
                    iterations_max = iterations_max.max(outcome.iterations());
                }
            }
        }
        if repetition % (repetitions / CLARABEL_SEQUENCES).max(1) == 0 {
            for candidate in &mut candidates {
                candidate.solve_all();
            }
            // A form that fails more often or takes far longer than the best is not tried again.
            if let Some((failures, median)) = candidates.iter().map(Opponent::merit).min_by(better) {
                candidates.retain(|candidate| {
                    let merit = candidate.merit();
                    merit.0 == failures && merit.1 <= HOPELESS * median
                });
            }
        }
    }
    runner.reset();
    for index in 0..problems {
        let (outcome, deviation, _) = runner.deviation(sequence, index, Start::Warm);
        let solved = matches!(outcome, QpOutcome::Solved { .. });
        max_deviation = max_deviation.max(if solved { deviation } else { f64::INFINITY });
    }
    let warm_us = Percentiles::of(warm);
    let best = candidates.into_iter().min_by(|a, b| better(&a.merit(), &b.merit()));
    let clarabel_form = best.as_ref().map(|best| best.setting);
    let durations = best.map_or_else(Vec::new, |best| best.durations);
    let clarabel_us = Percentiles::of(durations);
    Figures {
        file: name.to_owned(),
        problems,
        max_deviation,
        warm_us,
        cold_us: Percentiles::of(cold),
        clarabel_us,
        clarabel_form,
        ratio: (clarabel_us.p50 / warm_us.p50 * 10.0).round() / 10.0,
        iterations_max,
    }
}
