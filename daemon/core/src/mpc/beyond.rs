//! What a force may be above that of the model, and what is left free below the limit for it: links that
//! swing in an impact, and an f̂ that is off.

use super::every_surface::nearest_limit;
use super::impact::{Impact, impact};
use super::verdict::{DEVIATIONS, above};
use super::{Demand, Settings, Situation, Verdict};
use crate::belief::{Peak, Swing};
use crate::output::Plan;
use admittance_vocabulary::Side;

/// A limit that is lowered for f̂ stays this part above the force that is to be kept.
const ABOVE_KEPT: f64 = 1.1;

/// Along the normal, N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Beyond {
    /// Of a link that swings.
    likely: Option<Impact>,
    /// The same on the hardest surface that may be there.
    hardest: Option<Impact>,
    /// Whether the force settles already: then these two decide only whether a verdict may be feasible.
    settles: bool,
    /// What an impact presses with already.
    pressed: Peak,
    /// Standard deviation of f̂ along the normal, N.
    deviation: f64,
    /// The limit that comes first, its axis, and the part of the normal that this is.
    limit: f64,
    axis: usize,
    part: f64,
    /// By how much it may be exceeded before that counts.
    tolerance: f64,
}

impl Beyond {
    pub(super) fn of<const N: usize, const D: usize>(
        settings: &Settings<N, D>,
        situation: &Situation<'_, N, D>,
        demand: &Demand<D>,
    ) -> Self {
        let (covariance, normal) = (&situation.sample.wrench_covariance, &situation.belief.surface().normal);
        // Nothing damps a swing: what settles is planned without it. But that the motors move out says nothing of
        // the link, which goes on by its gears: its first swing counts in the verdict until it may have turned.
        let swings = situation.belief.swings().filter(|swings| !demand.settles || swings.is_first_swing);
        let (axis, limit) = nearest_limit(settings, situation, &demand.signs).unwrap_or((0, f64::INFINITY));
        let of = |swing: Swing| impact(settings, situation, swing);
        let bounded = swings.filter(|_| limit.is_finite());
        let pressed = swings.filter(|_| !demand.settles).map_or(0.0, |swings| swings.likely.force());
        Self {
            likely: bounded.and_then(|swings| of(swings.likely)),
            hardest: bounded.and_then(|swings| of(swings.hardest)),
            settles: demand.settles,
            pressed: Peak { force: pressed, time: 0.0 },
            deviation: libm::sqrt(normal.dot(&(covariance * normal)).max(0.0)),
            limit,
            axis,
            part: normal[axis].abs(),
            tolerance: limit * settings.options.limit_tolerance,
        }
    }

    /// The verdict on an impact that is above the limit already, or is going to be however fast the arm leaves.
    pub(super) fn hopeless(&self) -> Option<Verdict> {
        self.broken_by(&self.pressed).or_else(|| self.broken_by(&self.impact()?.least))
    }

    /// Whether an impact is under way.
    pub(super) fn is_impact(&self) -> bool {
        self.impact().is_some()
    }

    /// What plans have to know of.
    fn impact(&self) -> Option<&Impact> {
        self.likely.as_ref().filter(|_| !self.settles)
    }

    fn broken_by(&self, peak: &Peak) -> Option<Verdict> {
        let (axis, time, shortfall) = (self.axis, peak.time, (peak.force - self.limit) * self.part);
        (peak.force > self.limit + self.tolerance).then_some(Verdict::Infeasible {
            axis,
            side: Side::Upper,
            time,
            shortfall,
        })
    }

    /// What plans leave free below the limit, N, one tried after the other: with `late` for an arm that
    /// follows late. For what f̂ may be off by no force is given up that is to be kept: the verdict says what
    /// that leaves. The last of an impact leaves as fast as it can.
    pub(super) fn left_free<const N: usize, const D: usize>(
        &self,
        late: f64,
        settings: &Settings<N, D>,
        situation: &Situation<'_, N, D>,
        demand: &Demand<D>,
    ) -> impl Iterator<Item = f64> + use<N, D> {
        let unsure = if self.deviation > 0.0 {
            let normal = &situation.belief.surface().normal;
            let wanted = (0..D).filter(|&axis| demand.signs[axis] != 0.0 && situation.belief.asks_for_force(axis));
            let least = |axis: usize| settings.options.minimum_force[axis] / normal[axis].abs();
            let kept = wanted.map(least).fold(settings.options.normal_force_reference, f64::max);
            (DEVIATIONS * self.deviation).min((self.limit - ABOVE_KEPT * kept).max(0.0))
        } else {
            0.0
        };
        let first = late + unsure + self.impact().map_or(0.0, |impact| impact.beyond);
        let fastest = self.impact().map(|_| self.limit);
        [Some(first).filter(|free| *free > 0.0), fastest].into_iter().flatten()
    }

    /// The verdict on a plan that knows of it.
    pub(super) fn judged<const N: usize, const D: usize>(
        &self,
        verdict: Verdict,
        settings: &Settings<N, D>,
        situation: &Situation<'_, N, D>,
        plan: &Plan<D>,
    ) -> Verdict {
        let (mut verdict, mut likely) = (verdict, self.pressed.force);
        if let Some(swinging) = &self.likely {
            let peak = swinging.peak_under(settings, situation, plan);
            if let Some(broken) = self.broken_by(&peak).filter(|_| !self.settles) {
                return broken;
            }
            likely = peak.force;
            verdict = self.with_most(verdict, likely, &peak);
        }
        if let Some(hardest) = &self.hardest {
            verdict = self.with_most(verdict, likely, &hardest.peak_under(settings, situation, plan));
        }
        // What damping leaves undone is the most that it can be.
        let undone = situation.missed_by_damping(plan) / DEVIATIONS;
        let hidden = hidden_of(&verdict, settings, situation) / DEVIATIONS;
        let deviation = self.deviation + situation.belief.deviation() + undone + hidden;
        verdict.unsure(deviation, &situation.belief.surface().normal)
    }

    /// A verdict where the force is likely so large, N, and at most this peak.
    fn with_most(&self, verdict: Verdict, likely: f64, most: &Peak) -> Verdict {
        let (axis, time, left) = (self.axis, most.time, (self.limit - most.force) * self.part);
        match verdict {
            Verdict::Feasible { margin, .. } if left < margin => {
                if self.broken_by(most).is_none() {
                    return Verdict::Feasible { margin: left.max(0.0), axis, time };
                }
                let deviation = (most.force - likely).max(f64::MIN_POSITIVE) / DEVIATIONS;
                Verdict::AtRisk { share: above((self.limit - likely) / deviation), excess: -left, axis, time }
            }
            _ => verdict,
        }
    }
}

/// By what the predicted peak may be larger, N along the normal, if the lag of f̂ is as much longer than T_est as it
/// may be. By (6) what f̂ does not show is in proportion to its lag: the force now is then larger by this share of it,
/// and so, in proportion, is what comes of a stiffness that was learned from f̂.
fn hidden_of<const N: usize, const D: usize>(
    verdict: &Verdict,
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
) -> f64 {
    let (share, surface) = (settings.options.wrench_lag_tolerance, situation.belief.surface());
    match *verdict {
        Verdict::Feasible { margin, axis, .. } if share > 0.0 => {
            let peak = (settings.options.force_limit[axis] - margin) / surface.normal[axis].abs();
            let now = -situation.spring_force(axis, 1.0) / surface.normal[axis];
            let shown = surface.pressing_force(&situation.sample.wrench);
            if now > 0.0 { share * peak.max(0.0) * ((now - shown) / now).clamp(0.0, 1.0) } else { 0.0 }
        }
        _ => 0.0,
    }
}
