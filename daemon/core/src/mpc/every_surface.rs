//! The bounds of a contact whose surface is a set: on a plane all rows of the force are one row in
//! depth, and so all surfaces of the set are one row.
//!
//! Forces here are those of the likeliest surface, along the normal: F̂ = k̂ (x − ĉ) stands for the
//! depth x.

use nalgebra::SVector;

use super::constraints::AxisBound;
use super::fastest_outward::outward;
use super::full_outward::{deepest_of, helped};
use super::late_arm::{free_below, pressed_late};
use super::qp::QpSolver;
use super::{Mpc, Settings, Situation, Verdict};
use crate::belief::SurfaceSet;
use admittance_vocabulary::Side;

/// Standard deviations of the set that must be kept below the limit, and of the one in which no
/// surface can be.
const SURE: f64 = 3.0;
const HOPELESS: f64 = 4.0;
/// Standard deviations of the set that presses with enough, this part of f_min: with all of it the likeliest surface
/// would be pressed with more by as much as is not known.
const PRESSING: f64 = 1.0;
const ENOUGH: f64 = 0.9;
/// Standard deviations of f̂ that are noise.
const NOISE: f64 = 2.0;
/// Within so many seconds the tool comes back from there, with this part of its outward speed at
/// most.
const BACK: f64 = 0.01;
const BACK_PART: f64 = 0.8;
/// A lower bound is at most this part of the upper one.
const MOST_MINIMUM: f64 = 0.7;

/// What a set asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SetBounds {
    /// Upper bound along the normal, N of the likeliest surface.
    pub maximum: f64,
    /// What is left free above it for an arm that follows late, in N of the likeliest surface.
    pub free: f64,
    /// By how much the tool is deeper now than where the first surface reaches f_max before it could be
    /// back, N of the likeliest surface.
    excess: f64,
    /// What can't be kept.
    pub risk: Option<Risk>,
}

/// Surfaces that can't be kept below the limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Risk {
    /// The share of the set that they are.
    pub share: f64,
    /// Newtons above the limit of the worst.
    pub excess: f64,
    /// When it is deepest, s from the sample.
    pub time: f64,
    /// The axis whose limit it is.
    pub axis: usize,
    /// Whether to stop.
    pub stops: bool,
    /// Whether no surface can be kept.
    pub is_hopeless: bool,
}

/// The bounds of a set for axes with these signs, from the start of the prediction, with every limit
/// larger by the part `tolerance` and `late` N left free below it; `None` where no axis is bounded.
pub(super) fn of_set<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>>(
    mpc: &Mpc<N, D, S, B>,
    set: &SurfaceSet,
    situation: &Situation<'_, N, D>,
    signs: &[f64; D],
    (tolerance, late): (f64, f64),
) -> Option<SetBounds> {
    let settings = &mpc.settings;
    let (axis, limit) = nearest_limit(settings, situation, signs)?;
    let limit = limit * (1.0 + tolerance);
    let (depth, shown) = scale(situation);
    let (deepest, time) = deepest_of(settings, situation);
    let path = time * speed_along(situation);
    let reached = shown(set.depths_of(limit, SURE, path).0);
    let helped = helped(deepest, limit, tolerance);
    if set.likeliest().is_none() {
        // A force that no surface explains yet is none that may be exceeded.
        return Some(SetBounds { maximum: limit.max(helped), free: 0.0, risk: None, excess: 0.0 });
    }
    if reached >= deepest {
        let free = free_below(reached, late, helped);
        return Some(SetBounds { maximum: reached - free, free, risk: None, excess: 0.0 });
    }
    let deepest_depth = depth(deepest);
    // An arm that may follow later than told may follow as much earlier: only what it could not keep either is a
    // reason to stop. Until then what is asked of it is the same.
    let early = pressed_late(settings, situation);
    let surely =
        if early > 0.0 { depth((deepest - early).max(scaled_now(situation)).min(deepest)) } else { deepest_depth };
    let share = set.share_above(limit, deepest_depth, path);
    let risk = Risk {
        share,
        excess: set.strongest(deepest_depth, SURE, path) - limit,
        time,
        axis,
        stops: set.share_above(limit, surely, path) > set.risk(),
        is_hopeless: set.depths_of(limit, HOPELESS, path).1 < surely,
    };
    // Where it has to be back the slope is another one than where it is deepest.
    let back = || shown(set.depths_of(limit, SURE, BACK * speed_along(situation)).0);
    let excess = scaled_now(situation) - if set.learns_normal() { back() } else { reached };
    Some(SetBounds { maximum: helped, free: 0.0, risk: Some(risk), excess })
}

/// The bounded axis whose limit comes first, and that limit along the normal in N.
pub(super) fn nearest_limit<const N: usize, const D: usize>(
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
    signs: &[f64; D],
) -> Option<(usize, f64)> {
    let surface = situation.belief.surface();
    let along = |axis: usize| settings.options.force_limit[axis] / surface.normal[axis].abs();
    let bounded = (0..D).filter(|&axis| signs[axis] != 0.0 && surface.normal[axis] != 0.0);
    bounded.map(|axis| (axis, along(axis))).min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The force of the likeliest surface now, along the normal, N.
fn scaled_now<const N: usize, const D: usize>(situation: &Situation<'_, N, D>) -> f64 {
    situation.belief.surface().spring_force(situation.sample.posture.pose())
}

/// By how much f̂ is above the force of the likeliest surface and what may be noise, along the normal, N: above all while
/// that force falls.
pub(super) fn shown_beyond<const N: usize, const D: usize>(set: &SurfaceSet, situation: &Situation<'_, N, D>) -> f64 {
    let shown = situation.belief.surface().pressing_force(&situation.sample.wrench);
    (shown - scaled_now(situation).max(0.0) - NOISE * set.noise()).max(0.0)
}

/// How fast the tool moves along the surface, m/s.
fn speed_along<const N: usize, const D: usize>(situation: &Situation<'_, N, D>) -> f64 {
    let (_, beside) =
        situation.belief.surface().parts(&(situation.sample.posture.jacobian() * situation.joints.velocity));
    beside.norm()
}

/// Depth in m of a force of the likeliest surface, and the other way round.
fn scale<const N: usize, const D: usize>(
    situation: &Situation<'_, N, D>,
) -> (impl Fn(f64) -> f64 + use<N, D>, impl Fn(f64) -> f64 + use<N, D>) {
    let surface = situation.belief.surface();
    let (stiffness, begins) = (surface.normal_stiffness(), -surface.height(&surface.contact.position));
    (move |force: f64| begins + force / stiffness, move |depth: f64| stiffness * (depth - begins))
}

impl SetBounds {
    /// The speed in m/s at which the tool has to leave a depth that can't be helped any more.
    pub(super) fn way_back<const N: usize, const D: usize>(
        &self,
        settings: &Settings<N, D>,
        situation: &Situation<'_, N, D>,
    ) -> Option<f64> {
        let surface = situation.belief.surface();
        let wanted = self.excess / (surface.normal_stiffness() * BACK);
        if wanted <= 0.0 {
            return None;
        }
        let most = situation.outward_speed(&outward(settings, situation));
        (most > 0.0).then(|| wanted.min(BACK_PART * most))
    }

    /// The verdict on a contact that has to be stopped.
    pub(super) fn stop(&self) -> Option<Verdict> {
        let Risk { excess: shortfall, time, axis, stops, is_hopeless, .. } = self.risk?;
        if is_hopeless {
            return Some(Verdict::Infeasible { axis, side: Side::Upper, time, shortfall });
        }
        self.at_risk().filter(|_| stops)
    }

    /// The verdict on one that is at risk.
    pub(super) fn at_risk(&self) -> Option<Verdict> {
        let Risk { share, excess, axis, time, .. } = self.risk?;
        Some(Verdict::AtRisk { share, excess, axis, time })
    }

    /// The force along the normal that is kept at most, N of the likeliest surface.
    pub(super) fn most_kept(&self) -> f64 {
        MOST_MINIMUM * self.maximum
    }

    /// The bounds of an axis.
    pub(super) fn bound<const D: usize>(
        &self,
        axis: usize,
        sign: f64,
        minimum: f64,
        normal: &SVector<f64, D>,
    ) -> AxisBound {
        let part = normal[axis].abs();
        AxisBound { axis, sign, minimum: minimum.min(self.most_kept() * part), maximum: self.maximum * part }
    }
}

/// By how much more than now a surface of the set may press at most, N, where the likeliest one would press with `force`
/// (N) after a `path` (m) along it.
pub(super) fn most_more<const N: usize, const D: usize>(
    set: &SurfaceSet,
    situation: &Situation<'_, N, D>,
    force: f64,
    path: f64,
) -> f64 {
    let deeper = (force - scaled_now(situation)) / situation.belief.surface().normal_stiffness();
    set.hardest(SURE) * (deeper + SURE * set.sloping(path)).max(0.0)
}

/// The force of the likeliest surface in N where it presses with `force` (N) at least, and every surface of the set with
/// enough of that.
pub(super) fn pressing_everywhere<const N: usize, const D: usize>(
    set: &SurfaceSet,
    situation: &Situation<'_, N, D>,
    force: f64,
) -> f64 {
    scale(situation).1(set.depths_of(ENOUGH * force, PRESSING, 0.0).1).max(force)
}
