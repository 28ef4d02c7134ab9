//! From contacts with unknown surfaces to figures.

use ipc_types::StopReason;
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
    withdrawn_then_over: Vec<u64>,
    over_at_risk: Vec<u64>,
    lost: Vec<u64>,
    unsettled: Vec<u64>,
}

/// The figures of a study. Contacts that were over the limit at the first active sample, brief ones
/// and failed ones are apart: in none of the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Figures {
    /// The arms, where they are others than the planar one.
    #[serde(skip_serializing_if = "Option::is_none")]
    arms: Option<Vec<&'static str>>,
    surface: Told,
    noise_n: f64,
    sampling_time_s: Option<f64>,
    inputs: Option<u8>,
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
    /// Of contacts that were at risk and not stopped: the largest share that could not be kept, and the newtons of the worst.
    at_risk_share: Option<ToP95>,
    at_risk_excess_n: Option<ToP95>,
    /// Of the attainable those that were not stopped.
    accepted_attainable: u32,
    accepted_of_attainable: f64,
    /// Not attainable, and not stopped.
    accepted_unattainable: u32,
    /// Over the limit in a cycle whose verdict was safe, stopped later or not.
    safe_then_over: u32,
    /// Safe by the first verdict, and over the limit after later ones had taken that back.
    withdrawn_then_over: u32,
    /// Stopped as a surface outside its range.
    outside_range: u32,
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

/// What percentiles are taken of, a value a contact.
#[derive(Default)]
struct Values {
    known_after_s: Vec<f64>,
    settled_error_n: Vec<f64>,
    believed_error_n: Vec<f64>,
    risk_share: Vec<f64>,
    risk_excess_n: Vec<f64>,
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
            arms: world.arms.as_ref().map(|arms| arms.0.iter().map(|arm| arm.name()).collect()),
            surface: world.told,
            noise_n: world.noise_n,
            sampling_time_s: world.sampling_time_s,
            inputs: world.inputs,
            not_as_told: world.not_as_told,
            runs: cases.len() as u64,
            seed: world.seed,
            apart: 0,
            attainable: 0,
            safe: 0,
            at_risk: 0,
            infeasible: 0,
            at_risk_share: None,
            at_risk_excess_n: None,
            accepted_attainable: 0,
            accepted_of_attainable: f64::NAN,
            accepted_unattainable: 0,
            safe_then_over: 0,
            withdrawn_then_over: 0,
            outside_range: 0,
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
        let mut values = Values::default();
        for case in cases {
            match &case.seen {
                Ok(seen) => figures.count(case, seen, &mut values),
                Err(_) => figures.apart += 1,
            }
        }
        figures.accepted_of_attainable = f64::from(figures.accepted_attainable) / f64::from(figures.attainable);
        let known = &mut values.known_after_s;
        figures.known = known.len() as u32;
        figures.known_after_ms = percentile(known, 0.5)
            .zip(percentile(known, 0.9))
            .map(|(p50, p90)| ToP90 { p50: p50 * 1e3, p90: p90 * 1e3 });
        let to_p95 = |values: &mut [f64]| {
            percentile(values, 0.5).zip(percentile(values, 0.95)).map(|(p50, p95)| ToP95 { p50, p95 })
        };
        figures.settled_error_n = to_p95(&mut values.settled_error_n);
        figures.believed_error_n = to_p95(&mut values.believed_error_n);
        figures.at_risk_share = to_p95(&mut values.risk_share);
        figures.at_risk_excess_n = to_p95(&mut values.risk_excess_n);
        figures
    }

    fn count(&mut self, case: &Case, seen: &Seen, values: &mut Values) {
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
            (true, false) => {
                self.at_risk += 1;
                values.risk_share.push(seen.risk_share);
                values.risk_excess_n.push(seen.risk_excess_n);
            }
            (false, false) => self.infeasible += 1,
        }
        self.outside_range += u32::from(seen.stop_reason == StopReason::SurfaceOutsideRange.code());
        let is_safe_then_over = exceeds(seen.peak_while_safe_n, limit);
        if is_safe_then_over {
            self.safe_then_over += 1;
            example(&mut self.examples.safe_then_over, case);
        } else if exceeds(seen.peak_after_safe_n, limit) {
            self.withdrawn_then_over += 1;
            example(&mut self.examples.withdrawn_then_over, case);
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
        if !is_safe_then_over && is_over {
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
        values.known_after_s.extend(seen.known_after_s);
        let error = case.settled_error_n(seen);
        values.settled_error_n.push(error);
        values.believed_error_n.push(seen.believed_error_n);
        if error > 3.0 {
            example(&mut self.examples.unsettled, case);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::closed_loop::FirstActive;
    use super::super::super::draw::Draw;
    use super::*;

    const SEED: u64 = 1;

    /// A run that was accepted, safe all the time, and in these parts of its limit.
    fn safe(draw: &Draw, peak: f64) -> Seen {
        let peak_n = peak * draw.normal_force_limit_n();
        let first_active =
            Some(FirstActive { joint_position: vec![0.0; 2], joint_velocity: vec![0.0; 2], normal_force_n: 1.0 });
        Seen {
            first_active,
            samples_in_contact: 100,
            safe_cycles: 100,
            peak_n,
            peak_while_safe_n: peak_n,
            peak_after_safe_n: peak_n,
            ..Seen::default()
        }
    }

    /// What became of a contact.
    type Run<'a> = &'a dyn Fn(&Draw) -> Seen;

    /// The figures of contacts of which each may attain this part of its limit, out of contact and in it.
    fn of(cases: &[(f64, Run<'_>)]) -> Figures {
        let not_as_told = super::super::tests::AS_TOLD;
        let (told, sampling_time_s) = (Told::Range10, None);
        let world = World {
            arms: None,
            told,
            noise_n: 0.0,
            risk: None,
            sampling_time_s,
            inputs: None,
            not_as_told,
            seed: SEED,
        };
        let case = |index: usize| {
            let draw = Draw::up_to(5e5, SEED, index as u64).unwrap();
            let (attainable, seen) = &cases[index];
            let attainable_n = Some(attainable * draw.normal_force_limit_n());
            let seen = Ok(seen(&draw));
            Case { told: draw.clone(), draw, seen, attainable_n, attainable_in_contact_n: attainable_n }
        };
        Figures::of(&world, &(0..cases.len()).map(case).collect::<Vec<_>>())
    }

    #[test]
    fn every_contact_is_counted_once() {
        let stopped = StopReason::Infeasible.code();
        let at_risk = |draw: &Draw, peak: f64| Seen { at_risk_cycles: 3, peak_while_safe_n: 0.0, ..safe(draw, peak) };
        let figures = of(&[
            (0.8, &|draw| safe(draw, 0.9)),
            (0.8, &|draw| Seen { contact_losses: 1, ..safe(draw, 0.9) }),
            (1.2, &|draw| Seen { contact_losses: 1, ..safe(draw, 0.9) }),
            (0.8, &|draw| Seen { peak_after_safe_n: 0.0, risk_share: 0.1, risk_excess_n: 7.0, ..at_risk(draw, 0.9) }),
            (0.8, &|draw| Seen { peak_after_safe_n: 0.0, ..at_risk(draw, 1.2) }),
            (0.8, &|draw| Seen { stop_reason: stopped, infeasible_cycles: 1, ..at_risk(draw, 0.9) }),
            (1.2, &|draw| Seen { stop_reason: StopReason::SurfaceOutsideRange.code(), ..at_risk(draw, 1.5) }),
            (0.8, &|draw| Seen { samples_in_contact: 2, ..safe(draw, 1.5) }),
            (0.8, &|_| Seen::default()),
        ]);
        assert_eq!((figures.runs, figures.apart), (9, 2));
        assert_eq!((figures.safe, figures.at_risk, figures.infeasible), (3, 2, 2));
        assert_eq!((figures.attainable, figures.accepted_attainable, figures.accepted_unattainable), (5, 4, 1));
        assert_eq!((figures.losses, figures.avoidable_losses), (1, 1), "an unattainable contact has no losses");
        let (share, excess_n) = (figures.at_risk_share.unwrap(), figures.at_risk_excess_n.unwrap());
        assert_eq!((share.p50, share.p95, excess_n.p50, excess_n.p95), (0.0, 0.1, 0.0, 7.0));
        assert_eq!((figures.over_at_risk, figures.examples.over_at_risk.as_slice()), (1, [4].as_slice()));
        assert!((figures.over_at_risk_max - 1.2).abs() < 1e-9 && (figures.stop_peak_max - 1.25).abs() < 1e-9);
        assert_eq!((figures.outside_range, figures.examples.refused.as_slice()), (1, [5].as_slice()));
        assert_eq!((figures.safe_then_over, figures.withdrawn_then_over), (0, 1), "the seventh was safe at first");
    }

    /// What counts is the verdict of the cycle, not whether a stop came after it.
    #[test]
    fn over_the_limit_in_a_cycle_that_was_safe_is_counted_stopped_or_not() {
        let stopped = StopReason::MeasuredForce.code();
        let figures = of(&[
            (0.8, &|draw| safe(draw, 1.1)),
            (0.8, &|draw| Seen { stop_reason: stopped, ..safe(draw, 1.1) }),
            (0.8, &|draw| Seen { at_risk_cycles: 1, ..safe(draw, 1.1) }),
            (0.8, &|draw| Seen { stop_reason: stopped, peak_while_safe_n: 0.0, ..safe(draw, 1.1) }),
        ]);
        assert_eq!((figures.safe_then_over, figures.withdrawn_then_over), (3, 1));
        assert_eq!(figures.examples.safe_then_over, [0, 1, 2]);
        assert_eq!(figures.over_at_risk, 0, "not twice");
    }
}
