//! How fast the arm may be commanded into the surface.
//!
//! A prediction that trusts its model may press the arm in at any speed, to stop it again in time;
//! with a lag that nobody modelled it is too late. So the commanded speed into the surface is
//! bounded in contact, and in a stop there is none.

use nalgebra::SVector;

use super::constraints::{Constraints, NormalSpeed};
use crate::output::MAX_STEPS;
use crate::robot::Interval;

/// Room in m/s for rounding where the limits leave no other way.
const ROUNDING: f64 = 1e-9;

impl<const N: usize, const D: usize> Constraints<'_, N, D> {
    /// Bounds the speed into the surface with the outward `normal` by `inward` m/s, but no sooner
    /// than the limits of offset and rate allow: the straight way from the twist `before` to
    /// `target` keeps all of them, and so does the bound.
    ///
    /// `known` is the twist in each step without the inputs, `before` and `target` with them.
    pub(super) fn bound_inward_speed(
        &mut self,
        inward: f64,
        normal: &SVector<f64, D>,
        known: &[SVector<f64, D>],
        (before, target): (&SVector<f64, D>, &SVector<f64, D>),
        steps: &[f64],
    ) {
        let mut least = [f64::NEG_INFINITY; MAX_STEPS];
        let change = target - before;
        let mut left = 1.0;
        for (step, (least, known)) in least.iter_mut().zip(known).enumerate() {
            let since = steps[step.saturating_sub(1)];
            left = f64::max(
                0.0,
                left - self.rate.as_ref().map_or(1.0, |rate| since * parts_per_second(rate, normal, &change)),
            );
            let way = normal.dot(&(target - change * left));
            *least = f64::min(-inward, way) - normal.dot(known) - ROUNDING;
        }
        self.normal_speed = Some(NormalSpeed { normal: *normal, least });
    }
}

/// How often a second the slowest axis that feels the surface makes a change of the twist.
fn parts_per_second<const D: usize>(rate: &Interval<D>, normal: &SVector<f64, D>, change: &SVector<f64, D>) -> f64 {
    let part = |axis: usize| {
        let limit = if change[axis] > 0.0 { rate.upper[axis] } else { -rate.lower[axis] };
        if change[axis] == 0.0 || normal[axis] == 0.0 { f64::INFINITY } else { limit / change[axis].abs() }
    };
    (0..D).map(part).fold(f64::INFINITY, f64::min)
}
