//! What an impact presses with, by the way that the motors go from here on: as fast as they can, or under a
//! plan.

use nalgebra::SVector;

use super::constraints::ForceBounds;
use super::fastest_outward::outward;
use super::full_outward::{INSTANTS, LAGS, deepest_of};
use super::model::State;
use super::{Discretization, Settings, Situation};
use crate::belief::{Peak, Swing};
use crate::output::Plan;
use crate::quantities::Span;

/// Of a duration in pieces.
const ROUNDING: f64 = 1e-6;
/// How much more than one mass that is told presses an arm of several, as a factor: found over speeds and surfaces,
/// where one mass is up to a tenth too little, and for as much again by what is told of masses and gears.
const ONE_MASS: f64 = 1.2;

/// An impact that has begun, along the normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Impact {
    swing: Swing,
    /// What it presses with where the motors leave as fast as they can once a command acts.
    pub least: Peak,
    /// By how much that is above what the model presses with on the same way of the motors, N.
    pub beyond: f64,
}

/// The impact that is under way with a swing. `None` where its peak is over.
pub(super) fn impact<const N: usize, const D: usize>(
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
    swing: Swing,
) -> Option<Impact> {
    if !swing.has_a_peak() {
        return None;
    }
    let fastest = outward(settings, situation);
    let duration = settings.loops.slowest() / INSTANTS;
    let references = (0..INSTANTS as usize * LAGS).map(|_| (fastest, duration));
    let least = peak(swing, settings, situation, references);
    let (deepest, _) = deepest_of(settings, situation);
    Some(Impact { swing, least, beyond: (least.force - deepest.max(0.0)).max(0.0) })
}

impl Impact {
    /// What it presses with under a plan.
    pub(super) fn peak_under<const N: usize, const D: usize>(
        &self,
        settings: &Settings<N, D>,
        situation: &Situation<'_, N, D>,
        plan: &Plan<D>,
    ) -> Peak {
        let mut begun = Span::default();
        let steps = plan.steps().map(|(offset, end)| {
            let duration = end.seconds() - core::mem::replace(&mut begun, end).seconds();
            (situation.joint_velocity(&(situation.sample.twist_reference + offset)), duration)
        });
        peak(self.swing, settings, situation, steps)
    }
}

/// The largest force under references in rad/s, each for so many seconds, once a command acts.
fn peak<const N: usize, const D: usize>(
    mut swing: Swing,
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
    references: impl Iterator<Item = (SVector<f64, N>, f64)>,
) -> Peak {
    let (model, surface) = (&situation.model, situation.belief.surface());
    let inward = -surface.normal;
    let stiffness = surface.normal_stiffness();
    let depth = |state: &State<N, D>| inward.dot(&model.linear_wrench(&state.joint_position)) / stiffness;
    let start = situation.joints_at_action(settings, &ForceBounds::none());
    // An arm may follow later than told: so long its motors go on.
    let late = settings.options.lag_tolerance;
    let speed = -situation.outward_speed(&situation.joints.velocity);
    swing.follow(speed.max(0.0) * late, late);
    let now = inward.dot(&model.linear_wrench(&situation.sample.joint_position)) / stiffness;
    let mut state = start.state;
    let mut reached = depth(&state);
    swing.follow(reached - now, start.delay);
    let longest = settings.loops.slowest() / INSTANTS;
    'way: for (reference, duration) in references {
        let pieces = libm::ceil(duration / longest - ROUNDING).clamp(1.0, INSTANTS);
        let step = Discretization::Zoh.step(duration / pieces, &settings.loops, &SVector::<f64, 0>::zeros());
        for _ in 0..pieces as usize {
            state = state.moved(&step, &reference);
            let by = depth(&state) - reached;
            reached += by;
            swing.follow(by, step.duration);
            if swing.is_over(by) {
                break 'way;
            }
        }
    }
    let Peak { force, time } = swing.peak();
    Peak { force: force * ONE_MASS, time }
}
