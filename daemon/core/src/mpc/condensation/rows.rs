//! The constraint rows, never written down: A z is a simulation from rest, a row of A a sweep
//! backward from the instant that it bounds.

use core::ops::Range;

use super::row_bounds::store;
use super::simd::{Joints, SimdMatrix, SimdVector};
use super::{Prediction, SLACK_UNIT};
use crate::mpc::constraints::{Layout, Row, RowKind, Softened};
use crate::mpc::horizon::Horizon;
use crate::mpc::model::Model;
use crate::mpc::qp::{LANES, Rows};

/// The rows of one cycle's problem with M inputs a step, of joints that carry C numbers.
#[derive(Debug)]
pub struct MpcRows<'a, const N: usize, const D: usize, const M: usize, const C: usize> {
    pub(super) model: &'a Model<N, D>,
    pub(super) horizon: &'a Horizon<N, D>,
    pub(super) prediction: &'a Prediction<'a, N, D>,
    /// Which row is which.
    pub layout: Layout,
    /// V: the columns of J⁻¹ that belong to inputs.
    pub(super) inputs: SimdMatrix<N, M>,
    /// s K_e J: a row for each axis with bounded force; zero behind them.
    pub(super) gradients: SimdMatrix<M, N>,
    /// Axes with bounded force.
    pub(super) bounded: usize,
    /// n of the inputs; zero while the speed along it is not bounded.
    normal: SimdVector<M>,
}

impl<'a, const N: usize, const D: usize, const M: usize, const C: usize> MpcRows<'a, N, D, M, C> {
    /// The rows of this prediction; `None` when it does not have M inputs, more axes with bounded
    /// force or wrench state than inputs, or joints that carry another number of numbers than C.
    pub fn new(
        model: &'a Model<N, D>,
        horizon: &'a Horizon<N, D>,
        prediction: &'a Prediction<'a, N, D>,
    ) -> Option<Self> {
        let inputs = prediction.inputs.as_slice();
        let bounds = prediction.constraints.force.as_slice();
        let is_of_size = inputs.len() == M && horizon.carried() == C;
        if !is_of_size || bounds.len() > M || prediction.wrench_axes.as_slice().len() > M {
            return None;
        }
        let columns: [[f64; N]; M] = core::array::from_fn(|a| model.jacobian_inverse.data.0[inputs[a]]);
        let mut gradients = [[0.0; N]; M];
        for (gradient, bound) in gradients.iter_mut().zip(bounds) {
            *gradient = model.wrench_gradient.data.0[bound.axis].map(|value| value * bound.sign);
        }
        Some(Self {
            model,
            horizon,
            prediction,
            layout: Layout::new(&prediction.constraints, horizon, &prediction.inputs, prediction.softened()),
            inputs: SimdMatrix::of_columns(columns),
            gradients: SimdMatrix::of_rows(gradients),
            bounded: bounds.len(),
            normal: SimdVector::new(&core::array::from_fn(|a| {
                prediction.constraints.normal_speed.as_ref().map_or(0.0, |speed| speed.normal[inputs[a]])
            })),
        })
    }

    /// Number of variables.
    pub fn variables(&self) -> usize {
        M * self.horizon.steps().len() + usize::from(self.prediction.slack.is_some())
    }

    /// Position of the inputs of step `step` in z.
    pub fn inputs_of(&self, step: usize) -> Range<usize> {
        let first = (self.horizon.steps().len() - 1 - step) * M;
        first..first + M
    }

    /// The rows of one kind.
    pub(super) fn rows(&self, kind: RowKind) -> Range<usize> {
        self.layout.rows_of(kind)
    }

    /// The rows that bound a force.
    pub fn force_rows(&self) -> Range<usize> {
        self.rows(RowKind::Force)
    }

    /// Axis of a force row, and its time in s from the sample; `None` of another row.
    pub fn force_row(&self, row: usize) -> Option<(usize, f64)> {
        let row = self.layout.row(row).filter(|row| row.kind == RowKind::Force)?;
        Some((row.component, self.horizon.force_points()[row.instant].time))
    }

    /// The slack t in N; 0 of a problem without one.
    fn slack(&self, z: &[f64]) -> f64 {
        if self.prediction.slack.is_some() { SLACK_UNIT * z[self.variables() - 1] } else { 0.0 }
    }

    /// By how much the slack lowers the forces that have an upper bound, N.
    pub fn off_maximum(&self, z: &[f64]) -> f64 {
        if self.prediction.softened() == Some(Softened::Maximum) { self.slack(z) } else { 0.0 }
    }

    /// s K_e J of a bounded axis.
    fn gradient_of(&self, axis: usize) -> SimdVector<N> {
        let bounds = self.prediction.constraints.force.as_slice();
        let index = bounds.iter().position(|bound| bound.axis == axis).unwrap_or(0);
        SimdVector::new(&self.gradients.rows[index])
    }

    /// What a jerk row at step `step` takes of the references in it and in the two before.
    fn jerk_by_step(&self, step: usize) -> [f64; 3] {
        let ratio = self.horizon.since_ratio(step);
        [1.0, -1.0 - ratio, ratio]
    }

    /// The sensitivity to the reference in step `step` of the rows of the drives.
    #[inline(always)]
    fn pulled_by_drives(&self, multipliers: &[f64], step: usize) -> SimdVector<N> {
        let mut pulled = SimdVector::ZERO;
        let mut add = |kind, later: usize, by: f64| {
            if let Some(row) = self.at(kind, step + later) {
                pulled = section(multipliers, row).times_plus(SimdVector::splat(by), pulled);
            }
        };
        add(RowKind::JointAcceleration, 0, 1.0);
        add(RowKind::JointAcceleration, 1, -1.0);
        for later in 0..3 {
            // Beyond the last step there is no row, and no length.
            let at = (step + later).min(self.horizon.steps().len() - 1);
            add(RowKind::JointJerk, later, self.jerk_by_step(at)[later]);
        }
        pulled
    }

    /// nᵀu.
    #[inline(always)]
    fn along_normal(&self, u: &[f64; M]) -> f64 {
        self.normal.dot(SimdVector::new(u))
    }

    /// The gradient over q of the bounded axes' multipliers from row `row` on, and the sum of
    /// these; `None` where all are zero, as most are.
    #[inline(always)]
    fn pushed(&self, multipliers: &[f64], row: usize) -> Option<(SimdVector<N>, f64)> {
        let pushing: [f64; M] = core::array::from_fn(|k| if k < self.bounded { multipliers[row + k] } else { 0.0 });
        let is_pushing = pushing.iter().fold(false, |is_pushing, y| is_pushing | (*y != 0.0));
        is_pushing.then(|| (self.gradients.transposed_times(SimdVector::new(&pushing)), pushing.iter().sum()))
    }

    /// Adds Vᵀ r to the entries of step `step`.
    #[inline(always)]
    fn add_to_inputs(&self, step: usize, reference: SimdVector<N>, to: &mut [f64]) {
        let sum = self.inputs.transposed_times(reference).array();
        if let Some(place) = to[self.inputs_of(step).start..].first_chunk_mut::<M>() {
            (0..M).for_each(|a| place[a] += sum[a]);
        }
    }

    /// Adds to the earlier inputs the effect of a sensitivity of the joints at the start of step
    /// `step`.
    #[inline(always)]
    fn sweep(&self, mut costate: Joints<N, C>, step: usize, to: &mut [f64]) {
        let h = self.horizon.steps().len();
        let places = to[(h - step) * M..h * M].as_chunks_mut::<M>().0;
        // Variables stand in reversed time order: backward in time is forward among them.
        for (step, place) in self.horizon.steps()[..step].iter().rev().zip(places) {
            *place = SimdVector::new(place).plus(self.inputs.transposed_times(costate.back(step))).array();
        }
    }

    /// Row of a kind's first component at an instant.
    #[inline(always)]
    fn at(&self, kind: RowKind, instant: usize) -> Option<usize> {
        self.layout.rows_at(kind, instant)
    }
}

/// The rows of one instant from row `first` on.
#[inline(always)]
fn section<const K: usize>(values: &[f64], first: usize) -> SimdVector<K> {
    values[first..].first_chunk().map_or(SimdVector::ZERO, SimdVector::new)
}

impl<const N: usize, const D: usize, const M: usize, const C: usize> Rows for MpcRows<'_, N, D, M, C> {
    fn values(&self, z: &[f64], out: &mut [f64]) {
        // Sections follow one another in the order of their kinds.
        let (speed, others) = out.split_at_mut(self.rows(RowKind::JointSpeed).len());
        let (acceleration, others) = others.split_at_mut(self.rows(RowKind::JointAcceleration).len());
        let (jerk, others) = others.split_at_mut(self.rows(RowKind::JointJerk).len());
        let (offset, others) = others.split_at_mut(self.rows(RowKind::Offset).len());
        let (rate, others) = others.split_at_mut(self.rows(RowKind::Rate).len());
        let (normal, others) = others.split_at_mut(self.rows(RowKind::NormalSpeed).len());
        let (rest, others) = others.split_at_mut(self.rows(RowKind::RestPosition).len());
        let (force, others) = others.split_at_mut(self.rows(RowKind::Force).len());
        let (minimum, others) = others.split_at_mut(self.rows(RowKind::MinimumForce).len());
        let (steps, slack) = (self.horizon.steps(), self.slack(z));
        let inputs = z[..M * steps.len()].as_chunks::<M>().0;
        for (offset, u) in offset.as_chunks_mut::<M>().0.iter_mut().zip(inputs.iter().rev()) {
            *offset = *u;
        }
        let mut before = [0.0; M];
        for (rate, u) in rate.as_chunks_mut::<M>().0.iter_mut().zip(inputs.iter().rev()) {
            *rate = core::array::from_fn(|index| u[index] - before[index]);
            before = *u;
        }
        for (normal, u) in normal.iter_mut().zip(inputs.iter().rev()) {
            *normal = self.along_normal(u);
        }
        let mut speed = speed.as_chunks_mut::<N>().0.iter_mut();
        let mut acceleration = acceleration.as_chunks_mut::<N>().0.iter_mut();
        let mut jerk = jerk.as_chunks_mut::<N>().0.iter_mut();
        let (mut reference_before, mut change_before) = (SimdVector::ZERO, SimdVector::ZERO);
        let mut rest = rest.as_chunks_mut::<N>().0.iter_mut();
        let mut force = force.chunks_exact_mut(self.bounded.max(1));
        let mut minimum = minimum.chunks_exact_mut(self.bounded.max(1));
        let off_maximum = self.off_maximum(z);
        let (mut points, until_rest) = (self.horizon.force_points(), self.horizon.until_rest());
        let mut joints = Joints::<N, C>::ZERO;
        for ((k, step), u) in steps.iter().enumerate().zip(inputs.iter().rev()) {
            let reference = self.inputs.times(SimdVector::new(u));
            if let Some(speed) = speed.next() {
                *speed = reference.array();
            }
            if let Some(acceleration) = acceleration.next() {
                let change = reference.minus(reference_before);
                *acceleration = change.array();
                if let Some(jerk) = jerk.next() {
                    let ratio = SimdVector::splat(self.horizon.since_ratio(k));
                    *jerk = change.minus(change_before.times(ratio)).array();
                }
                (reference_before, change_before) = (reference, change);
            }
            while let [point, later @ ..] = points
                && point.step == k
                && let Some(force) = force.next()
            {
                let (a, b) = (&point.position_by, &point.position_by_reference);
                let pressing = self.gradients.times(joints.position_after(a, b, reference));
                store(force, &pressing.minus(SimdVector::splat(off_maximum)).array());
                if let Some(minimum) = minimum.next() {
                    store(minimum, &pressing.plus(SimdVector::splat(slack)).array());
                }
                points = later;
            }
            joints.advance(step, reference);
            if let Some(rest) = rest.next() {
                *rest = joints.rest_position(until_rest).array();
            }
        }
        if self.prediction.slack.is_some() {
            others[0] = z[self.variables() - 1];
        }
    }

    fn coefficients(&self, row: usize, out: &mut [f64]) -> usize {
        let Some(Row { kind, component, instant }) = self.layout.row(row) else {
            // A row that is not there is zero everywhere.
            return out.len();
        };
        let input = || self.prediction.inputs.as_slice().iter().position(|&axis| axis == component);
        // An input that does not act at once has no coefficient in its own step.
        let delay = self.horizon.first_reached();
        let first = match kind {
            RowKind::JointSpeed
            | RowKind::JointAcceleration
            | RowKind::JointJerk
            | RowKind::Offset
            | RowKind::Rate
            | RowKind::NormalSpeed
            | RowKind::RestPosition => self.inputs_of(instant).start,
            RowKind::Force | RowKind::MinimumForce => {
                self.inputs_of(self.horizon.force_points()[instant].step - delay).start
            }
            RowKind::Slack => self.variables() - 1,
        };
        let start = first / LANES * LANES;
        out[start..].fill(0.0);
        match kind {
            RowKind::JointSpeed => {
                for (value, coefficient) in out[first..].iter_mut().zip(self.inputs.rows[component]) {
                    *value = coefficient;
                }
            }
            RowKind::JointAcceleration | RowKind::JointJerk => {
                let by_step = if kind == RowKind::JointJerk { self.jerk_by_step(instant) } else { [1.0, -1.0, 0.0] };
                let places = out[first..self.inputs_of(0).end].chunks_exact_mut(M);
                for (place, by) in places.zip(by_step) {
                    place.iter_mut().zip(self.inputs.rows[component]).for_each(|(value, v)| *value = v * by);
                }
            }
            RowKind::Offset | RowKind::Rate => {
                let at = first + input().unwrap_or(0);
                out[at] = 1.0;
                if kind == RowKind::Rate && instant > 0 {
                    out[at + M] = -1.0;
                }
            }
            RowKind::NormalSpeed => {
                out[first..].iter_mut().zip(self.normal.array()).for_each(|(value, normal)| *value = normal);
            }
            RowKind::RestPosition => {
                let mut joint = [0.0; N];
                joint[component] = 1.0;
                self.sweep(Joints::resting(self.horizon.until_rest(), SimdVector::new(&joint)), instant + 1, out);
            }
            RowKind::Force | RowKind::MinimumForce => {
                let gradient = self.gradient_of(component);
                let point = &self.horizon.force_points()[instant];
                let (a, b) = (&point.position_by, &point.position_by_reference);
                let mut costate = Joints::<N, C>::ZERO;
                let at_once = costate.seed(a, b, gradient);
                if delay == 0 {
                    self.add_to_inputs(point.step, at_once, out);
                }
                self.sweep(costate, point.step, out);
                if kind == RowKind::MinimumForce {
                    out[self.variables() - 1] = SLACK_UNIT;
                } else if self.prediction.softened() == Some(Softened::Maximum) {
                    out[self.variables() - 1] = -SLACK_UNIT;
                }
            }
            RowKind::Slack => out[first] = 1.0,
        }
        start
    }

    fn add_transposed(&self, multipliers: &[f64], out: &mut [f64]) {
        let mut costate = Joints::<N, C>::ZERO;
        let (points, until_rest) = (self.horizon.force_points(), self.horizon.until_rest());
        let mut instant = if self.at(RowKind::Force, 0).is_some() { points.len() } else { 0 };
        let (mut slack, is_driven) = (0.0, self.prediction.constraints.drives.is_some());
        let off_maximum = if self.prediction.softened() == Some(Softened::Maximum) { SLACK_UNIT } else { 0.0 };
        for (k, step) in self.horizon.steps().iter().enumerate().rev() {
            if let Some(row) = self.at(RowKind::RestPosition, k) {
                let resting = Joints::<N, C>::resting(until_rest, section(multipliers, row));
                costate.position = costate.position.plus(resting.position);
                for (carried, resting) in costate.carried.iter_mut().zip(resting.carried) {
                    *carried = carried.plus(resting);
                }
            }
            let mut reference = costate.back(step);
            while instant > 0 && points[instant - 1].step == k {
                instant -= 1;
                let upper = self.at(RowKind::Force, instant).and_then(|row| self.pushed(multipliers, row));
                let lower = self.at(RowKind::MinimumForce, instant).and_then(|row| self.pushed(multipliers, row));
                slack +=
                    SLACK_UNIT * lower.map_or(0.0, |(_, sum)| sum) - off_maximum * upper.map_or(0.0, |(_, sum)| sum);
                let position = match (upper, lower) {
                    (None, None) => continue,
                    (Some((position, _)), None) | (None, Some((position, _))) => position,
                    (Some((upper, _)), Some((lower, _))) => upper.plus(lower),
                };
                let point = &points[instant];
                let at_once = costate.seed(&point.position_by, &point.position_by_reference, position);
                reference = reference.plus(at_once);
            }
            if let Some(row) = self.at(RowKind::JointSpeed, k) {
                reference = reference.plus(section(multipliers, row));
            }
            if is_driven {
                reference = reference.plus(self.pulled_by_drives(multipliers, k));
            }
            self.add_to_inputs(k, reference, out);
            let inputs = self.inputs_of(k);
            if let Some(row) = self.at(RowKind::Offset, k) {
                out[inputs.clone()].iter_mut().zip(&multipliers[row..]).for_each(|(value, y)| *value += y);
            }
            if let Some(row) = self.at(RowKind::NormalSpeed, k) {
                let along = self.normal.times(SimdVector::splat(multipliers[row])).array();
                out[inputs.clone()].iter_mut().zip(along).for_each(|(value, y)| *value += y);
            }
            if let Some(row) = self.at(RowKind::Rate, k) {
                for (index, multiplier) in multipliers[row..row + M].iter().enumerate() {
                    out[inputs.start + index] += multiplier;
                    if k > 0 {
                        out[inputs.end + index] -= multiplier;
                    }
                }
            }
        }
        if let Some(row) = self.at(RowKind::Slack, 0) {
            out[self.variables() - 1] += slack + multipliers[row];
        }
    }
}
