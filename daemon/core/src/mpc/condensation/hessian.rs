//! H = Σ_k S_kᵀ Q S_k + R, S_k the response of x_k to the inputs; its upper triangle.
//!
//! Every weighted output o (a wrench estimate; with task weights a TCP velocity or position) adds
//! w_o s_o s_oᵀ per step; the joint-space cost of (23a) adds V_ia V_ib times a scalar of the two
//! steps, V = J⁻¹. Over even steps P(r, s) = P(r − 1, s − 1) + what the longest response adds, in
//! reversed time: one product per entry and output. Over uneven ones see
//! [`cost_to_go`](super::cost_to_go).
//!
//! Responses stand in [`panels`](super::panels). Values left of the diagonal or beyond the
//! variables are never used and may be anything.

use super::SLACK_UNIT;
use super::cost_to_go::{self, CostToGo};
use super::panels::{Group, NOTHING, Terms, add, panel, product, put};
use super::responses::{self, Responses};
use super::rows::MpcRows;
use super::simd::{SimdMatrix, SimdVector, array};
use crate::mpc::cost::Weights;
use crate::mpc::horizon::Horizon;
use crate::mpc::model::CARRIED;
use crate::mpc::qp::{CACHE_LINE, LANES, padded};

/// Length of the tables, for joints that carry so many numbers.
pub(super) const fn table_len<const N: usize, const D: usize>(steps: usize, carried: usize) -> usize {
    let (even, uneven) = (responses::table_len::<N, D>(steps), cost_to_go::table_len::<N, D>(steps, carried));
    if even > uneven { even } else { uneven }
}

/// Writes the tables, which depend on horizon and weights only.
pub(super) fn fill<const N: usize, const D: usize>(
    tables: &mut [f64],
    horizon: &Horizon<N, D>,
    weights: &Weights<N, D>,
) {
    tables.fill(0.0);
    if horizon.is_even() {
        responses::fill(tables, horizon, weights);
    } else {
        let steps = horizon.steps().len();
        if horizon.carried() == 1 {
            CostToGo::<N, D, 1>::within(tables, steps).fill(horizon);
        } else {
            CostToGo::<N, D, CARRIED>::within(tables, steps).fill(horizon);
        }
    }
}

/// Numbers in all panels together: wrench estimates, then joints, or TCP velocities and positions.
pub(super) const fn panels_len<const N: usize, const D: usize>(steps: usize) -> usize {
    let rows = D + if N > 2 * D { N } else { 2 * D };
    // Columns are padded to whole groups of steps, and there is the slack.
    rows * (D * padded(steps) + LANES)
}

/// Numbers before H, in whole cache lines: over even steps, where every row starts as the one M
/// above it, one column earlier for each, the rows −M to −1 that the first ones start as.
pub(super) const fn margin_len(inputs: usize, stride: usize) -> usize {
    (inputs * (stride + 1)).next_multiple_of(CACHE_LINE)
}

/// H while it is being written, after its margin.
struct Triangle<'a, const M: usize> {
    values: &'a mut [f64],
    stride: usize,
    margin: usize,
    /// Groups of columns.
    groups: usize,
}

impl<'a, const M: usize> Triangle<'a, M> {
    /// Before the first term: R in the margin, from where it moves down the diagonal.
    #[inline(always)]
    fn new<const N: usize, const D: usize, const C: usize>(
        rows: &MpcRows<'_, N, D, M, C>,
        values: &'a mut [f64],
        stride: usize,
    ) -> Self {
        let (prediction, steps) = (rows.prediction, rows.horizon.steps().len());
        let (n, margin) = (M * steps, margin_len(M, stride));
        let first = margin - M * (stride + 1);
        values[..margin].fill(0.0);
        for (a, &axis) in prediction.inputs.as_slice().iter().enumerate() {
            values[first + a * (stride + 1)] = prediction.input_weight[axis];
        }
        Self { values, stride, margin, groups: n.div_ceil(LANES) }
    }

    /// Row `index` from the group of its diagonal on; and where it starts from, the row M above it,
    /// M columns further left.
    #[inline(always)]
    fn row(&mut self, index: usize) -> (&mut [Group], &[Group]) {
        let first = index / LANES;
        let at = self.margin + index * self.stride + first * LANES;
        let (above, here) = self.values.split_at_mut(at);
        let start = &above[at - M * (self.stride + 1)..];
        let count = self.groups - first;
        (&mut here.as_chunks_mut().0[..count], &start.as_chunks().0[..count])
    }
}

/// For each of K outputs, its response per joint response and input axis.
struct Spread<const N: usize, const K: usize, const M: usize>([SimdMatrix<M, N>; K]);

impl<const N: usize, const K: usize, const M: usize> Spread<N, K, M> {
    /// For outputs with the given gradients over the joints.
    #[inline(always)]
    fn new<const D: usize, const C: usize>(rows: &MpcRows<'_, N, D, M, C>, gradients: [[f64; N]; K]) -> Self {
        Self(
            gradients
                .map(|gradient| SimdMatrix::of_rows(rows.inputs.columns.map(|column| product(&gradient, &column)))),
        )
    }

    /// The outputs, by output and input axis, where the joints have responded like this to each
    /// output.
    #[inline(always)]
    fn of<'r>(&self, responses: impl Fn(usize) -> &'r [f64; N]) -> [[f64; M]; K] {
        core::array::from_fn(|output| self.0[output].times(SimdVector::new(responses(output))).array())
    }

    /// Writes the outputs of all columns of steps, with what `response` makes of theirs for each
    /// output.
    #[inline(always)]
    fn write<'r, T>(
        &self,
        panel: &mut [[Group; K]],
        columns: &'r [T],
        response: impl Fn(&'r T, usize) -> &'r [f64; N],
    ) {
        for (reversed, column) in columns.iter().enumerate() {
            let outputs = self.of(|output| response(column, output));
            for a in 0..M {
                put(panel, reversed * M + a, &core::array::from_fn(|output| outputs[output][a]));
            }
        }
    }
}

/// Wrench estimates at the end of the horizon.
struct WrenchOutputs<'a, const M: usize> {
    /// Of unused outputs zero, as their responses are.
    weight: [f64; M],
    estimates: &'a [[Group; M]],
}

impl<'a, const M: usize> WrenchOutputs<'a, M> {
    #[inline(always)]
    fn new<const N: usize, const D: usize, const C: usize>(
        rows: &MpcRows<'_, N, D, M, C>,
        responses: &Responses<'_, N, D>,
        estimates: &'a mut [[Group; M]],
    ) -> Self {
        let prediction = rows.prediction;
        let (Weights::Joint { wrench, .. } | Weights::Task { wrench, .. }) = prediction.weights;
        let axes = prediction.wrench_axes.as_slice();
        let gradients = &rows.model.wrench_gradient.data.0;
        let gradients = core::array::from_fn(|output| axes.get(output).map_or([0.0; N], |&axis| gradients[axis]));
        let weight = core::array::from_fn(|output| axes.get(output).map_or(0.0, |&axis| wrench[axis]));
        // An output that is not used has a gradient of zero, whatever the response.
        let axis_of: [usize; M] = core::array::from_fn(|output| axes.get(output).copied().unwrap_or(0));
        Spread::new(rows, gradients)
            .write(estimates, responses.estimates(), |response, output| &response[axis_of[output]]);
        Self { weight, estimates }
    }

    #[inline(always)]
    fn terms(&self, index: usize) -> Terms<'_, M> {
        Terms::squared(self.estimates, index, &self.weight)
    }
}

/// V over the columns of four steps: M groups of columns, the joints of a group together.
#[inline(always)]
fn over_columns<const N: usize, const D: usize, const M: usize, const C: usize>(
    rows: &MpcRows<'_, N, D, M, C>,
) -> [[Group; N]; M] {
    core::array::from_fn(|group| {
        core::array::from_fn(|joint| {
            core::array::from_fn(|lane| rows.inputs.columns[(group * LANES + lane) % M][joint])
        })
    })
}

/// A panel row for each joint: its joint-space cost of column `r` of steps with every later one,
/// times V.
#[inline(always)]
fn write_joints<const N: usize, const M: usize>(
    inputs: &[[Group; N]; M],
    costs: &[[Group; N]],
    r: usize,
    panel: &mut [[Group; N]],
) {
    let first = r / LANES;
    let panel = panel.as_chunks_mut::<M>().0;
    for (costs, panel) in costs[first..].iter().zip(&mut panel[first..]) {
        for joint in 0..N {
            for group in 0..M {
                panel[group][joint] =
                    core::array::from_fn(|lane| costs[joint][(group * LANES + lane) / M] * inputs[group][joint][lane]);
            }
        }
    }
}

/// Writes the upper triangle. `tables` are those that [`fill`] has written, `hessian` begins with
/// its margin.
pub(super) fn write<const N: usize, const D: usize, const M: usize, const C: usize>(
    tables: &mut [f64],
    rows: &MpcRows<'_, N, D, M, C>,
    hessian: &mut [f64],
    stride: usize,
    scratch: &mut [f64],
) {
    let (steps, margin) = (rows.horizon.steps().len(), margin_len(M, stride));
    if rows.horizon.is_even() {
        write_even(&Responses::of(tables, steps), rows, hessian, stride, scratch);
    } else {
        cost_to_go::write(&CostToGo::<N, D, C>::within(tables, steps), rows, &mut hessian[margin..], stride);
    }
    if let Some(slack) = &rows.prediction.slack {
        let (n, hessian) = (M * steps, &mut hessian[margin..]);
        hessian.chunks_exact_mut(stride).take(n).for_each(|row| row[n] = 0.0);
        hessian[n * stride + n] = slack.curvature * SLACK_UNIT * SLACK_UNIT;
    }
}

/// Writes it over even steps.
// Kept out of its callers: inlined together they would run out of registers.
#[inline(never)]
fn write_even<const N: usize, const D: usize, const M: usize, const C: usize>(
    responses: &Responses<'_, N, D>,
    rows: &MpcRows<'_, N, D, M, C>,
    hessian: &mut [f64],
    stride: usize,
    scratch: &mut [f64],
) {
    let (prediction, steps) = (rows.prediction, rows.horizon.steps());
    let n = M * steps.len();
    let groups = n.div_ceil(LANES);
    let (estimates, rest) = panel(scratch, groups);
    let wrench = WrenchOutputs::new(rows, responses, estimates);
    let mut triangle = Triangle::new(rows, hessian, stride);
    match prediction.weights {
        Weights::Joint { .. } => {
            let (joints, _) = panel(rest, steps.len().div_ceil(LANES) * M);
            let inputs = over_columns(rows);
            for (r, costs) in responses.costs().enumerate() {
                if M > 1 {
                    write_joints(&inputs, costs, r, joints);
                }
                for a in 0..M {
                    let (index, column) = (r * M + a, &rows.inputs.columns[a]);
                    // With one input a step the products V V are factors of the costs themselves.
                    let cost = if M > 1 {
                        Terms::new(&joints[..groups], index, *column)
                    } else {
                        Terms::new(&costs[..groups], index, product(column, column))
                    };
                    let (row, start) = triangle.row(index);
                    add(row, Some(start), &wrench.terms(index), &cost);
                }
            }
        }
        Weights::Task { position, velocity, .. } => {
            let spread = Spread::new(rows, SimdMatrix::of_columns(prediction.jacobian.data.0).rows);
            let (velocities, rest) = panel(rest, groups);
            spread.write(velocities, responses.velocities(), |response, _| response);
            let has_position = position.iter().any(|weight| *weight != 0.0);
            let (positions, _) = panel(rest, groups);
            if has_position {
                spread.write(positions, responses.positions(), |response, _| response);
            }
            for index in 0..n {
                let (row, start) = triangle.row(index);
                let moving = Terms::squared(velocities, index, array(velocity));
                add(row, Some(start), &wrench.terms(index), &moving);
                if has_position {
                    add(row, None, &Terms::squared(positions, index, array(position)), &NOTHING);
                }
            }
        }
    }
}
