//! From contacts with unknown surfaces to figures.

use serde::Serialize;

use super::super::statistics::exceeds;
use super::run::Seen;
use super::{Case, NotAsTold, Told, World};

/// Fewer samples in contact than this say little.
const FEWEST_SAMPLES: u32 = 3;
const MOST_EXAMPLES: usize = 10;

/// Median and 90th percentile, by nearest rank.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct ToP90 {
    p50: f64,
    p90: f64,
}

/// Median and 95th percentile.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct ToP95 {
    p50: f64,
    p95: f64,
}

/// Cases to look at.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
struct Examples {
    refused: Vec<u64>,
    safe_then_over: Vec<u64>,
    over_at_risk: Vec<u64>,
    lost: Vec<u64>,
    unsettled: Vec<u64>,
}

/// The figures of a study. Contacts that were over the limit at the first active sample, brief ones
/// and failed ones are apart: in none of the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Figures {
    surface: Told,
    noise_n: f64,
    #[serde(flatten)]
    not_as_told: NotAsTold,
    runs: u64,
    seed: u64,
    apart: u32,
    /// Contacts in which some input keeps the limit, for who knows the surface.
    attainable: u32,
    /// Contacts whose every verdict was safe; that were at risk and not stopped; stopped.
    safe: u32,
    at_risk: u32,
    infeasible: u32,
    /// Of the attainable those that were not stopped.
    accepted_attainable: u32,
    accepted_of_attainable: f64,
    /// Not attainable, and not stopped.
    accepted_unattainable: u32,
    /// Safe by every verdict, and then over the limit.
    safe_then_over: u32,
    /// At risk, attainable, accepted, and over the limit; and the largest peak over it.
    over_at_risk: u32,
    over_at_risk_max: f64,
    /// Stopped although attainable, or not: largest peak over the limit, and over the attainable
    /// peak where that is larger.
    stop_peak_max: f64,
    /// Accepted and attainable contacts that were lost though some input keeps them; and all.
    avoidable_losses: u32,
    losses: u32,
    known: u32,
    known_after_ms: Option<ToP90>,
    /// |true force at the end − asked| of accepted attainable contacts.
    settled_error_n: Option<ToP95>,
    /// |force by what is believed of the surface − true force| at the end.
    believed_error_n: Option<ToP95>,
    examples: Examples,
}

fn percentile(values: &mut [f64], share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(((share * values.len() as f64).ceil() as usize).max(1) - 1).copied()
}

fn example(list: &mut Vec<u64>, case: &Case) {
    if list.len() < MOST_EXAMPLES {
        list.push(case.draw.index);
    }
}

impl Figures {
    pub(super) fn of(world: &World, cases: &[Case]) -> Self {
        let mut figures = Self {
            surface: world.told,
            noise_n: world.noise_n,
            not_as_told: world.not_as_told,
            runs: cases.len() as u64,
            seed: world.seed,
            apart: 0,
            attainable: 0,
            safe: 0,
            at_risk: 0,
            infeasible: 0,
            accepted_attainable: 0,
            accepted_of_attainable: f64::NAN,
            accepted_unattainable: 0,
            safe_then_over: 0,
            over_at_risk: 0,
            over_at_risk_max: 0.0,
            stop_peak_max: 0.0,
            avoidable_losses: 0,
            losses: 0,
            known: 0,
            known_after_ms: None,
            settled_error_n: None,
            believed_error_n: None,
            examples: Examples::default(),
        };
        let (mut known, mut errors, mut believed) = (Vec::new(), Vec::new(), Vec::new());
        for case in cases {
            match &case.seen {
                Ok(seen) => figures.count(case, seen, [&mut known, &mut errors, &mut believed]),
                Err(_) => figures.apart += 1,
            }
        }
        figures.accepted_of_attainable = f64::from(figures.accepted_attainable) / f64::from(figures.attainable);
        figures.known = known.len() as u32;
        figures.known_after_ms = percentile(&mut known, 0.5)
            .zip(percentile(&mut known, 0.9))
            .map(|(p50, p90)| ToP90 { p50: p50 * 1e3, p90: p90 * 1e3 });
        let to_p95 = |values: &mut [f64]| {
            percentile(values, 0.5).zip(percentile(values, 0.95)).map(|(p50, p95)| ToP95 { p50, p95 })
        };
        (figures.settled_error_n, figures.believed_error_n) = (to_p95(&mut errors), to_p95(&mut believed));
        figures
    }

    fn count(&mut self, case: &Case, seen: &Seen, [known, errors, believed]: [&mut Vec<f64>; 3]) {
        let limit = case.draw.normal_force_limit_n();
        let (Some(first), Some(attainable_n)) = (&seen.first_active, case.attainable_n) else {
            self.apart += 1;
            return;
        };
        if first.normal_force_n > limit || seen.samples_in_contact < FEWEST_SAMPLES {
            self.apart += 1;
            return;
        }
        let (is_attainable, is_over) = (attainable_n <= limit, exceeds(seen.peak_n, limit));
        self.attainable += u32::from(is_attainable);
        match (seen.accepted(), seen.was_safe()) {
            (_, true) => self.safe += 1,
            (true, false) => self.at_risk += 1,
            (false, false) => self.infeasible += 1,
        }
        if seen.was_safe() && is_over {
            self.safe_then_over += 1;
            example(&mut self.examples.safe_then_over, case);
        }
        if !seen.accepted() {
            self.stop_peak_max = self.stop_peak_max.max(seen.peak_n / limit.max(attainable_n));
            if is_attainable {
                example(&mut self.examples.refused, case);
            }
            return;
        }
        if !is_attainable {
            self.accepted_unattainable += 1;
            return;
        }
        self.accepted_attainable += 1;
        if !seen.was_safe() && is_over {
            self.over_at_risk += 1;
            self.over_at_risk_max = self.over_at_risk_max.max(seen.peak_n / limit);
            example(&mut self.examples.over_at_risk, case);
        }
        if seen.contact_losses > 0 {
            self.losses += 1;
            if case.attainable_in_contact_n.is_some_and(|peak| peak <= limit) {
                self.avoidable_losses += 1;
                example(&mut self.examples.lost, case);
            }
        }
        known.extend(seen.known_after_s);
        let error = case.settled_error_n(seen);
        errors.push(error);
        believed.push(seen.believed_error_n);
        if error > 3.0 {
            example(&mut self.examples.unsettled, case);
        }
    }
}
