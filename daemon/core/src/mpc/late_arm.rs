//! What is left free below the limit for an arm that follows later than its model says
//! (`lag_tolerance`): forces in N along the normal.

use super::every_surface::nearest_limit;
use super::full_outward::{deepest_of, helped};
use super::{Settings, Situation};

/// What of `late` N is left free below a bound above zero: the row stays above what can't be helped.
pub(super) fn free_below(bound: f64, late: f64, helped: f64) -> f64 {
    late.min(bound - helped.max(0.0)).max(0.0)
}

/// What an arm that moves in as it does now presses more in N within the time by which it may follow later than
/// told.
pub(super) fn pressed_late<const N: usize, const D: usize>(
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
) -> f64 {
    let surface = situation.belief.surface();
    let outward = situation.outward_speed(&situation.joints.velocity);
    surface.normal_stiffness() * (-outward).max(0.0) * settings.options.lag_tolerance
}

/// What of `late` N along the normal can be left free below the limits of a surface that is told, with
/// every limit larger by the part `tolerance`.
pub(super) fn free_of_told<const N: usize, const D: usize>(
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
    signs: &[f64; D],
    (tolerance, late): (f64, f64),
) -> f64 {
    nearest_limit(settings, situation, signs).map_or(0.0, |(_, limit)| {
        let (deepest, _) = deepest_of(settings, situation);
        free_below(limit * (1.0 + tolerance), late, helped(deepest, limit, 0.0))
    })
}
