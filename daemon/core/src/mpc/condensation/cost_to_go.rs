//! H over uneven steps, from what a state costs later: its upper triangle, a row for each input.
//!
//! The reference r of step i has moved the joints at its end by x, which from there on costs Σ_k
//! x_kᵀ Q x_k, x_k = Φ(k, i) x. So the row of H that belongs to r is λᵀ y, with the costate λ = Σ_k
//! Φ(k, i)ᵀ Q x_k, and y what earlier references have moved at the same instant. Joints and wrench
//! filters are diagonal: with their responses in tables, summed over the later steps, λ takes one
//! N×N matrix for q and one for each number c that joints carry beside it (q̇; see
//! [`Step`](crate::mpc::model::Step)), and the row a few products for each earlier step, however
//! many steps are still to come.

use wide::f64x4;

use super::responses::Response;
use super::rows::MpcRows;
use super::simd::{SimdVector, array};
use crate::mpc::cost::Weights;
use crate::mpc::horizon::Horizon;
use crate::mpc::qp::{LANES, padded};

/// Some columns of one row.
type Group = [f64; LANES];

/// Tables that depend on the horizon only. The first dimension of each is the step i; n is the
/// joint that had a reference of 1 rad/s during it, m any joint, and the sums are over the ends of
/// steps from i on, each times its share.
#[derive(Debug)]
pub(super) struct CostToGo<'a, const N: usize, const D: usize, const C: usize> {
    /// Σ of q_n, by n: a joint that stands off by 1 rad at the end of i goes on standing there.
    position: &'a mut [[f64; N]],
    /// Σ of q_n times q_m after c_m = 1 at the end of i: by c, n, m.
    position_by_carried: &'a mut [[[[f64; N]; N]; C]],
    /// Σ of q̇_n times q̇_m after c_m = 1: by c, n, m.
    velocity_by_carried: &'a mut [[[[f64; N]; N]; C]],
    /// With q filtered as the wrench estimate of an axis, Σ of q_n times the estimate after it was
    /// off by 1: by axis, n.
    wrench: &'a mut [[[f64; N]; D]],
    /// Σ of filtered q_n times the filtered q of a joint that stands off by 1 rad: by axis, n.
    wrench_by_position: &'a mut [[[f64; N]; D]],
    /// Σ of filtered q_n times filtered q_m after c_m = 1: by c, axis, n, m.
    wrench_by_carried: &'a mut [[[[[f64; N]; N]; D]; C]],
    /// At the end of i, q after a reference of 1 rad/s during the step of each column: groups of
    /// columns, of each group one joint after the other. Columns are steps in reversed order.
    positions: &'a mut [[Group; N]],
    /// The same of c, by c.
    carried: &'a mut [[[Group; N]; C]],
    /// The same of filtered q, by axis.
    estimates: &'a mut [[[Group; N]; D]],
}

/// Numbers in all tables, of joints that carry so many.
pub(super) const fn table_len<const N: usize, const D: usize>(steps: usize, carried: usize) -> usize {
    let sums = N + 2 * carried * N * N + 2 * D * N + carried * D * N * N;
    (sums + (1 + carried + D) * N * padded(steps)) * steps
}

impl<'a, const N: usize, const D: usize, const C: usize> CostToGo<'a, N, D, C> {
    /// The tables within `storage`, which is at least [`table_len`] long.
    pub(super) fn within(storage: &'a mut [f64], steps: usize) -> Self {
        let (square, width) = (N * N, N * padded(steps));
        let (position, rest) = storage.split_at_mut(N * steps);
        let (position_by_carried, rest) = rest.split_at_mut(C * square * steps);
        let (velocity_by_carried, rest) = rest.split_at_mut(C * square * steps);
        let (wrench, rest) = rest.split_at_mut(D * N * steps);
        let (wrench_by_position, rest) = rest.split_at_mut(D * N * steps);
        let (wrench_by_carried, rest) = rest.split_at_mut(C * D * square * steps);
        let (positions, rest) = rest.split_at_mut(width * steps);
        let (carried, rest) = rest.split_at_mut(C * width * steps);
        let estimates = &mut rest[..D * width * steps];
        Self {
            position: position.as_chunks_mut().0,
            position_by_carried: position_by_carried.as_chunks_mut().0.as_chunks_mut().0.as_chunks_mut().0,
            velocity_by_carried: velocity_by_carried.as_chunks_mut().0.as_chunks_mut().0.as_chunks_mut().0,
            wrench: wrench.as_chunks_mut().0.as_chunks_mut().0,
            wrench_by_position: wrench_by_position.as_chunks_mut().0.as_chunks_mut().0,
            wrench_by_carried: wrench_by_carried
                .as_chunks_mut()
                .0
                .as_chunks_mut()
                .0
                .as_chunks_mut()
                .0
                .as_chunks_mut()
                .0,
            positions: positions.as_chunks_mut().0.as_chunks_mut().0,
            carried: carried.as_chunks_mut().0.as_chunks_mut().0.as_chunks_mut().0,
            estimates: estimates.as_chunks_mut().0.as_chunks_mut().0.as_chunks_mut().0,
        }
    }

    /// Writes the tables, which hold zeros; O(N² D H²) work.
    pub(super) fn fill(&mut self, horizon: &Horizon<N, D>) {
        let h = horizon.steps().len();
        let groups = h.div_ceil(LANES);
        for (n, i) in (0..N).flat_map(|n| (0..h).map(move |i| (n, i))) {
            let column = h - 1 - i;
            let one = |c: usize| core::array::from_fn(|carried| if carried == c { 1.0 } else { 0.0 });
            let mut moved: [[Response<D>; N]; C] =
                core::array::from_fn(|c| [Response { carried: one(c), ..Response::NONE }; N]);
            let mut standing = Response { position: 1.0, ..Response::NONE };
            let mut off = Response { filtered: [1.0; D], ..Response::NONE };
            for (k, own) in Response::to_reference(horizon, n, i) {
                let (group, lane) = (k * groups + column / LANES, column % LANES);
                self.positions[group][n][lane] = own.position;
                for (carried, value) in self.carried[group].iter_mut().zip(own.carried) {
                    carried[n][lane] = value;
                }
                for (estimates, filtered) in self.estimates[group].iter_mut().zip(own.filtered) {
                    estimates[n][lane] = filtered;
                }
                if k > i {
                    let step = &horizon.steps()[k];
                    for moved in &mut moved {
                        moved.iter_mut().enumerate().for_each(|(m, moved)| moved.advance(step, m, 0.0));
                    }
                    standing.advance(step, n, 0.0);
                    off.advance(step, n, 0.0);
                }
                let share = horizon.share(k);
                self.position[i][n] += share * own.position;
                for (c, m) in (0..C).flat_map(|c| (0..N).map(move |m| (c, m))) {
                    let moved = &moved[c][m];
                    self.position_by_carried[i][c][n][m] += share * own.position * moved.position;
                    self.velocity_by_carried[i][c][n][m] += share * own.carried[0] * moved.carried[0];
                    for axis in 0..D {
                        self.wrench_by_carried[i][c][axis][n][m] += share * own.filtered[axis] * moved.filtered[axis];
                    }
                }
                for axis in 0..D {
                    self.wrench[i][axis][n] += share * own.filtered[axis] * off.filtered[axis];
                    self.wrench_by_position[i][axis][n] += share * own.filtered[axis] * standing.filtered[axis];
                }
            }
        }
    }
}

/// Jᵀ W J, from the columns of J.
fn square<const N: usize, const D: usize>(jacobian: &[[f64; D]; N], weight: &[f64; D]) -> [[f64; N]; N] {
    core::array::from_fn(|n| {
        core::array::from_fn(|m| (0..D).map(|axis| jacobian[n][axis] * weight[axis] * jacobian[m][axis]).sum())
    })
}

/// Joints up to which two groups of columns are computed side by side: with more, the registers hold only one.
const ABREAST_UP_TO: usize = 6;

/// Σ_n x_n matrix_n.
#[inline(always)]
fn combined<const N: usize>(x: &[f64; N], matrix: &[SimdVector<N>; N]) -> SimdVector<N> {
    (0..N).fold(SimdVector::ZERO, |sum, n| SimdVector::splat(x[n]).times_plus(matrix[n], sum))
}

/// λ of a reference: by each joint's q, by each number that a joint carries, and by each joint's q filtered as the
/// estimate of an axis is.
struct Costate<const N: usize, const M: usize, const C: usize> {
    position: [f64; N],
    carried: [[f64; N]; C],
    estimates: [[f64; N]; M],
}

impl<const N: usize, const M: usize, const C: usize> Costate<N, M, C> {
    /// λᵀ y for G groups of columns from `group` on, by input.
    #[inline(always)]
    fn columns<const D: usize, const G: usize>(
        &self,
        tables: &CostToGo<'_, N, D, C>,
        group: usize,
        axes: &[usize],
        inputs: &[[f64; N]; M],
    ) -> [[f64x4; M]; G] {
        let (positions, moving) = (&tables.positions[group..group + G], &tables.carried[group..group + G]);
        let mut sums: [[f64x4; G]; N] = core::array::from_fn(|n| {
            let by_carried: [f64x4; C] = core::array::from_fn(|c| f64x4::splat(self.carried[c][n]));
            let by_position = f64x4::splat(self.position[n]);
            core::array::from_fn(|g| {
                let mut sum = f64x4::new(moving[g][0][n]) * by_carried[0];
                for c in 1..C {
                    sum = f64x4::new(moving[g][c][n]).mul_add(by_carried[c], sum);
                }
                f64x4::new(positions[g][n]).mul_add(by_position, sum)
            })
        });
        let estimates = &tables.estimates[group..group + G];
        for (by_estimate, &axis) in self.estimates.iter().zip(axes) {
            for n in 0..N {
                let by_estimate = f64x4::splat(by_estimate[n]);
                for g in 0..G {
                    sums[n][g] = f64x4::new(estimates[g][axis][n]).mul_add(by_estimate, sums[n][g]);
                }
            }
        }
        let mut columns = [[f64x4::ZERO; M]; G];
        for b in 0..M {
            for n in 0..N {
                let v = f64x4::splat(inputs[b][n]);
                for g in 0..G {
                    columns[g][b] = sums[n][g].mul_add(v, columns[g][b]);
                }
            }
        }
        columns
    }
}

/// Writes numbers that are given by input, for four steps each, so that the inputs of a step are adjacent.
#[inline(always)]
fn interleave<const M: usize>(by_input: &[f64x4; M], steps: &mut [[f64; M]]) {
    for first in (0..M).step_by(LANES) {
        let count = (M - first).min(LANES);
        // Beyond the last input anything will do.
        let inputs = core::array::from_fn(|a| by_input[first + a.min(count - 1)]);
        let by_step = f64x4::transpose(inputs).map(f64x4::to_array);
        for (step, values) in steps.iter_mut().zip(&by_step) {
            step[first..first + count].copy_from_slice(&values[..count]);
        }
    }
}

/// Writes a group of columns into its place.
#[inline(always)]
fn write_group<const M: usize>(columns: &[f64x4; M], place: &mut [[f64; LANES]]) {
    let steps = place.as_flattened_mut().as_chunks_mut().0;
    // Of a known number they stay in registers; at the end of a row there may be fewer.
    match steps.first_chunk_mut::<LANES>() {
        Some(steps) => interleave(columns, steps),
        None => interleave(columns, steps),
    }
}

/// Writes the rows of H into `hessian`, rows `stride` apart; values left of the diagonal, or beyond
/// the inputs, may be anything.
// Kept out of its callers: inlined together they would run out of registers.
#[inline(never)]
pub(super) fn write<const N: usize, const D: usize, const M: usize, const C: usize>(
    tables: &CostToGo<'_, N, D, C>,
    rows: &MpcRows<'_, N, D, M, C>,
    hessian: &mut [f64],
    stride: usize,
) {
    let (prediction, h) = (rows.prediction, rows.horizon.steps().len());
    let groups = h.div_ceil(LANES);
    let diagonal =
        |weight: &[f64; N]| core::array::from_fn(|n| core::array::from_fn(|m| if n == m { weight[n] } else { 0.0 }));
    let jacobian = &prediction.jacobian.data.0;
    let (on_position, on_velocity, on_wrench) = match prediction.weights {
        Weights::Joint { position, velocity, wrench } => (diagonal(array(position)), diagonal(array(velocity)), wrench),
        Weights::Task { position, velocity, wrench } => {
            (square(jacobian, array(position)), square(jacobian, array(velocity)), wrench)
        }
    };
    let has_position = on_position.iter().flatten().any(|weight| *weight != 0.0);
    let axes = prediction.wrench_axes.as_slice();
    let gradients = rows.model.wrench_gradient.data.0;
    for i in 0..h {
        // λ of q and of each c, for a reference of 1 rad/s of each joint.
        let mut position = [SimdVector::<N>::ZERO; N];
        let mut carried: [[SimdVector<N>; N]; C] = core::array::from_fn(|c| {
            core::array::from_fn(|n| {
                SimdVector::new(&on_velocity[n]).times(SimdVector::new(&tables.velocity_by_carried[i][c][n]))
            })
        });
        if has_position {
            for n in 0..N {
                let weight = SimdVector::new(&on_position[n]);
                position[n] = weight.times(SimdVector::splat(tables.position[i][n]));
                for c in 0..C {
                    let by_carried = SimdVector::new(&tables.position_by_carried[i][c][n]);
                    carried[c][n] = weight.times_plus(by_carried, carried[c][n]);
                }
            }
        }
        for &axis in axes {
            let gradient = SimdVector::new(&gradients[axis]);
            let weighted = gradient.times(SimdVector::splat(on_wrench[axis])).array();
            for n in 0..N {
                let by_position = SimdVector::splat(weighted[n] * tables.wrench_by_position[i][axis][n]);
                position[n] = gradient.times_plus(by_position, position[n]);
                for c in 0..C {
                    let by_carried = SimdVector::new(&tables.wrench_by_carried[i][c][axis][n]);
                    let by_carried = by_carried.times(SimdVector::splat(weighted[n]));
                    carried[c][n] = gradient.times_plus(by_carried, carried[c][n]);
                }
            }
        }
        let reversed = h - 1 - i;
        let (first, from) = (reversed / LANES, i * groups);
        for a in 0..M {
            let input = &rows.inputs.columns[a];
            let mut costate = Costate {
                position: combined(input, &position).array(),
                carried: core::array::from_fn(|c| combined(input, &carried[c]).array()),
                estimates: [[0.0; N]; M],
            };
            // λ of f̂, as what it makes of the filtered q of each joint.
            for (estimate, &axis) in costate.estimates.iter_mut().zip(axes) {
                let gradient = SimdVector::new(&gradients[axis]);
                let moved = gradient.times(SimdVector::new(&tables.wrench[i][axis])).dot(SimdVector::new(input));
                *estimate = gradient.times(SimdVector::splat(on_wrench[axis] * moved)).array();
            }
            let index = reversed * M + a;
            let row = &mut hessian[index * stride..(index + 1) * stride];
            let mut places = row.as_chunks_mut::<LANES>().0[first * M..].chunks_mut(M).take(groups - first);
            let mut group = from + first;
            while let Some(place) = places.next() {
                // As many side by side as the registers hold: a number of λ is read once for all of them.
                if const { N <= ABREAST_UP_TO }
                    && let Some(next) = places.next()
                {
                    let [columns, beside] = costate.columns::<D, 2>(tables, group, axes, &rows.inputs.columns);
                    write_group(&columns, place);
                    write_group(&beside, next);
                    group += 2;
                } else {
                    let [columns] = costate.columns::<D, 1>(tables, group, axes, &rows.inputs.columns);
                    write_group(&columns, place);
                    group += 1;
                }
            }
            row[index] += prediction.input_weight[prediction.inputs.as_slice()[a]] * rows.horizon.share(i);
        }
    }
}
