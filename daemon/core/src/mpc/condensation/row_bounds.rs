//! The bounds and weights of the constraint rows, relative to what happens without inputs.

use core::ops::Range;

use super::rows::MpcRows;
use super::simd::{SimdVector, array};
use super::trajectory::FreeTrajectory;
use crate::mpc::constraints::{RowKind, Softened};
use crate::mpc::qp::fill_last_group;
use crate::robot::Interval;

/// A bound below this (N, m/s, rad) is zero but for rounding.
const ROUNDING: f64 = 1e-9;

/// 1 over the largest finite bound; 1 if there is none but zero.
fn weight(lower: f64, upper: f64) -> f64 {
    let large = |bound: f64| if bound.is_finite() { bound.abs() } else { 0.0 };
    let scale = large(lower).max(large(upper));
    if scale > ROUNDING { 1.0 / scale } else { 1.0 }
}

/// Bounds and weights of all rows, while they are written.
struct Bounds<'a> {
    lower: &'a mut [f64],
    upper: &'a mut [f64],
    weight: &'a mut [f64],
}

impl Bounds<'_> {
    /// Writes the rows of a section, `count` for each instant: the interval at that instant,
    /// relative to the value without inputs.
    #[inline(always)]
    fn put<const K: usize>(
        &mut self,
        rows: Range<usize>,
        count: usize,
        instants: impl Iterator<Item = (SimdVector<K>, Weighted<K>)>,
    ) {
        let (lower, upper) = (&mut self.lower[rows.clone()], &mut self.upper[rows.clone()]);
        let weight = &mut self.weight[rows];
        let count = count.max(1);
        let places =
            lower.chunks_exact_mut(count).zip(upper.chunks_exact_mut(count)).zip(weight.chunks_exact_mut(count));
        for (((to_lower, to_upper), to_weight), (here, interval)) in places.zip(instants) {
            store(to_lower, &interval.lower.minus(here).array());
            store(to_upper, &interval.upper.minus(here).array());
            store(to_weight, &interval.weight.array());
        }
    }
}

/// Copies the first values of `from` to `to`: as one block if they fill it.
#[inline(always)]
pub(super) fn store<const K: usize>(to: &mut [f64], from: &[f64; K]) {
    if let Ok(place) = <&mut [f64; K]>::try_from(&mut *to) {
        *place = *from;
    } else {
        // One by one: a call that copies so few takes longer.
        for (index, value) in from.iter().enumerate() {
            if let Some(place) = to.get_mut(index) {
                *place = *value;
            }
        }
    }
}

/// The bounds of one section's components, in their order.
#[derive(Clone, Copy)]
struct Weighted<const K: usize> {
    lower: SimdVector<K>,
    upper: SimdVector<K>,
    weight: SimdVector<K>,
}

impl<const K: usize> Weighted<K> {
    fn new(lower: &[f64; K], upper: &[f64; K]) -> Self {
        let weight = core::array::from_fn(|k| weight(lower[k], upper[k]));
        Self { lower: SimdVector::new(lower), upper: SimdVector::new(upper), weight: SimdVector::new(&weight) }
    }

    fn of<const D: usize>(interval: &Interval<D>, axes: &[usize]) -> Self {
        let pick = |values: &[f64; D]| core::array::from_fn(|k| axes.get(k).map_or(0.0, |&axis| values[axis]));
        Self::new(&pick(array(&interval.lower)), &pick(array(&interval.upper)))
    }

    /// All bounds times `factor`, and the weights over it: they stay 1 over a bound.
    fn scaled(self, factor: f64) -> Self {
        let by = SimdVector::splat(factor);
        let weight = SimdVector::new(&self.weight.array().map(|weight| weight / factor));
        Self { lower: self.lower.times(by), upper: self.upper.times(by), weight }
    }
}

impl<const N: usize, const D: usize, const M: usize, const C: usize> MpcRows<'_, N, D, M, C> {
    /// The bounds of every row, relative to what happens without inputs, and the rows' weights;
    /// unbounded beyond the rows.
    // Kept out of its callers: inlined together they would run out of registers.
    #[inline(never)]
    pub(super) fn write_bounds(
        &self,
        free: &FreeTrajectory<'_, N, M, C>,
        lower: &mut [f64],
        upper: &mut [f64],
        weight: &mut [f64],
    ) {
        let (p, c) = (self.prediction, &self.prediction.constraints);
        // The padding beyond the rows is in the last group; the rows in that group are written
        // afterwards.
        fill_last_group(lower, f64::NEG_INFINITY);
        fill_last_group(upper, f64::INFINITY);
        fill_last_group(weight, 1.0);
        let mut bounds = Bounds { lower, upper, weight };
        let steps = self.horizon.steps();
        if let Some(interval) = &c.joint_speed {
            // The joints have what the prediction has not.
            let (drift, mut interval) =
                (SimdVector::of(&p.drift), Weighted::new(array(&interval.lower), array(&interval.upper)));
            (interval.lower, interval.upper) = (interval.lower.minus(drift), interval.upper.minus(drift));
            bounds.put(
                self.rows(RowKind::JointSpeed),
                N,
                p.known_reference.iter().map(|here| (SimdVector::of(here), interval)),
            );
        }
        if let Some(drives) = c.drives {
            // Each bound counts from what changes without the inputs.
            let either_way = |limit: &nalgebra::SVector<f64, N>| Weighted::new(array(&-limit), array(limit));
            let changes = (0..steps.len()).map(|step| {
                let most = drives.acceleration * self.horizon.since_change(step);
                (SimdVector::of(&drives.change(step)), either_way(&most))
            });
            bounds.put(self.rows(RowKind::JointAcceleration), N, changes);
            let jerks = (0..steps.len()).map(|step| {
                let (since, ratio) = (self.horizon.since_change(step), self.horizon.since_ratio(step));
                let before = match step.checked_sub(1) {
                    Some(before) => drives.change(before) * ratio,
                    None => nalgebra::SVector::from(drives.before.acceleration) * since,
                };
                let most = drives.jerk * (since * since);
                (SimdVector::of(&(drives.change(step) - before)), either_way(&most))
            });
            bounds.put(self.rows(RowKind::JointJerk), N, jerks);
        }
        let inputs = p.inputs.as_slice();
        if let Some(interval) = &c.offset {
            let interval = Weighted::<M>::of(interval, inputs);
            bounds.put(self.rows(RowKind::Offset), M, steps.iter().map(|_| (SimdVector::ZERO, interval)));
        }
        if let Some(interval) = &c.rate {
            let interval = Weighted::<M>::of(interval, inputs);
            let before = SimdVector::new(&core::array::from_fn(|index| -p.previous_input[inputs[index]]));
            // The first change comes a first step's length after the last input.
            let first = (before, interval.scaled(steps[0].duration));
            let later = steps.iter().map(|before| (SimdVector::ZERO, interval.scaled(before.duration)));
            bounds.put(self.rows(RowKind::Rate), M, core::iter::once(first).chain(later));
        }
        if let Some(speed) = &c.normal_speed {
            // Near zero as a rule: relative to it every rounding would be a violation.
            let weight = SimdVector::splat(1.0);
            let upper = SimdVector::splat(f64::INFINITY);
            let bound =
                |least: &f64| (SimdVector::ZERO, Weighted::<1> { lower: SimdVector::splat(*least), upper, weight });
            bounds.put(self.rows(RowKind::NormalSpeed), 1, speed.least.iter().map(bound));
        }
        if let Some(interval) = &c.rest_position {
            let interval = Weighted::new(array(&interval.lower), array(&interval.upper));
            let until_rest = self.horizon.until_rest();
            // The free trajectory drifts, the joints don't.
            let (drift, mut drifted) = (SimdVector::of(&p.drift), SimdVector::ZERO);
            let ends = steps.iter().enumerate().map(|(before, step)| {
                drifted = drifted.plus(drift.times(SimdVector::splat(step.duration)));
                (free.joints_at(before + 1).rest_position(until_rest).plus(drifted), interval)
            });
            bounds.put(self.rows(RowKind::RestPosition), N, ends);
        }
        let (mut minimum, mut maximum, mut offset) = ([0.0; M], [0.0; M], [0.0; M]);
        for (index, bound) in c.force.as_slice().iter().enumerate() {
            (minimum[index], maximum[index]) = (bound.minimum, bound.maximum);
            offset[index] = bound.sign * self.model.wrench_offset[bound.axis];
        }
        let is_soft = p.softened() == Some(Softened::Minimum);
        let softly = is_soft.then(|| Weighted::new(&minimum, &[f64::INFINITY; M]));
        if p.slack.is_some() {
            minimum = [f64::NEG_INFINITY; M];
        }
        let (interval, offset) = (Weighted::new(&minimum, &maximum), SimdVector::new(&offset));
        let forces = self.horizon.force_points().iter().map(|point| {
            let (a, b) = (&point.position_by, &point.position_by_reference);
            let reference = SimdVector::of(&p.known_reference[point.step]);
            let force = self.gradients.times(free.joints_at(point.step).position_after(a, b, reference));
            force.plus(offset)
        });
        bounds.put(self.rows(RowKind::Force), self.bounded, forces.clone().map(|force| (force, interval)));
        if let Some(softly) = softly {
            bounds.put(self.rows(RowKind::MinimumForce), self.bounded, forces.map(|force| (force, softly)));
        }
        if p.slack.is_some() {
            bounds.put(
                self.rows(RowKind::Slack),
                1,
                core::iter::once((SimdVector::ZERO, Weighted::new(&[0.0], &[f64::INFINITY]))),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::weight;

    /// A lower bound of 8e-12 N that a force had reached: with a weight of 1e11 no digit is left of its row.
    #[test]
    fn what_is_zero_but_for_rounding_has_no_weight_of_its_own() {
        assert_eq!([weight(8e-12, f64::INFINITY), weight(0.0, f64::INFINITY), weight(0.5, 2.0)], [1.0, 1.0, 0.5]);
    }
}
