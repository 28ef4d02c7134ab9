//! How deep the tool still gets when it is told to leave as fast as it can, and as its drives allow.

use nalgebra::SVector;

use super::constraints::{AxisBound, ForceBounds};
use super::fastest_outward::{WaysOut, ways_out};
use super::model::State;
use super::{Discretization, Settings, Situation};

/// Instants looked at in the lag of the slowest joint, and how many lags.
pub(super) const INSTANTS: f64 = 16.0;
pub(super) const LAGS: usize = 5;
/// The same where the drives have to ramp up to it first: longer than any arm takes that is not told to creep.
const RAMPED_LAGS: usize = 40;

/// Part of f_max by which the row of a depth that can't be helped leaves room.
const ROOM: f64 = 1e-3;

/// The deepest point that can't be helped, in N of the likeliest surface, and when it is, s from the
/// sample.
pub(super) fn deepest_of<const N: usize, const D: usize>(
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
) -> (f64, f64) {
    let surface = situation.belief.surface();
    // What comes until the inputs act, as a force above a bound of zero.
    let largest = surface.normal.iamax();
    let mut above_zero = ForceBounds::none();
    let sign = -surface.normal[largest].signum();
    above_zero.push(AxisBound { axis: largest, sign, minimum: f64::NEG_INFINITY, maximum: 0.0 });
    let start = situation.joints_at_action(settings, &above_zero);
    let until = start.verdict.shortfall() / surface.normal[largest].abs();
    let WaysOut { along, fastest } = ways_out(settings, situation);
    let deepest = |way: &SVector<f64, N>| deepest_force(settings, situation, &start.state, way);
    let (mut after, mut time) = deepest(&fastest);
    // (Where the tool is deepest now no way is better.)
    if time > 0.0 && along != fastest {
        let other = deepest(&along);
        if other.0 < after {
            (after, time) = other;
        }
    }
    if until > after { (until, start.delay) } else { (after, start.delay + time) }
}

/// The bound in N that a deepest point that can't be helped leaves.
pub(super) fn helped(deepest: f64, limit: f64, tolerance: f64) -> f64 {
    deepest + (ROOM + tolerance) * deepest.max(limit)
}

/// The largest force along the normal from the state `start` on in N where the joints are told the velocities
/// `way_out` (rad/s or m/s), by the spring as it is believed to be, and when it is in s.
fn deepest_force<const N: usize, const D: usize>(
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
    start: &State<N, D>,
    way_out: &SVector<f64, N>,
) -> (f64, f64) {
    let (model, inward) = (&situation.model, -situation.belief.surface().normal);
    let force = |state: &State<N, D>| inward.dot(&model.linear_wrench(&state.joint_position));
    // Gradient of that force: its rate is the part of q̇ along it.
    let gradient = model.wrench_gradient * inward;
    let of_twist = situation.of_twist(way_out);
    let mut driven = situation.driven(false);
    let duration = settings.loops.slowest() / INSTANTS;
    let step = Discretization::Zoh.step(duration, &settings.loops, &SVector::<f64, 0>::zeros());
    let (mut state, mut time) = (*start, 0.0);
    let mut pressing = force(&state);
    let (mut deepest, mut when) = (pressing, 0.0);
    let mut rate = gradient.dot(&state.joint_velocity);
    let instants = INSTANTS as usize * if driven.is_some() { RAMPED_LAGS } else { LAGS };
    for _ in 0..instants {
        let reference =
            driven.as_mut().map_or(*way_out, |driven| way_out - of_twist + driven.advance(duration, &of_twist));
        let before = (pressing, rate);
        state = state.moved(&step, &reference);
        pressing = force(&state);
        rate = gradient.dot(&state.joint_velocity);
        time += duration;
        // Between two instants the force is a parabola.
        let (peak, at) = if before.1 > 0.0 && rate < 0.0 {
            let part = before.1 / (before.1 - rate);
            (before.0 + 0.5 * before.1 * part * duration, time + (part - 1.0) * duration)
        } else {
            (pressing, time)
        };
        if peak > deepest {
            (deepest, when) = (peak, at);
        }
        if rate < 0.0 && before.1 <= 0.0 {
            break;
        }
    }
    (deepest, when)
}
