//! H = Σ_k S_kᵀ Q S_k + R, S_k the response of x_k to the inputs; its upper triangle.
//!
//! Every weighted output o (a wrench estimate; with task weights a TCP velocity or position) adds w_o s_o s_oᵀ per step; the
//! joint-space cost of (23a) adds V_ia V_ib times a scalar of the two steps, V = J⁻¹. Over even steps
//! P(r, s) = P(r − 1, s − 1) + what the longest response adds, in reversed time: one product per entry and output. Over uneven
//! ones the outputs are added step by step.
//!
//! Responses stand in panels: columns are inputs, in groups of [`LANES`], and of each group one output after the other. What
//! stands left of the diagonal or beyond the variables is never used; there, panels and H hold anything.

use wide::f64x4;

use super::SLACK_UNIT;
use super::responses::Responses;
use super::rows::MpcRows;
use super::short::{Matrix, Short, array};
use crate::cost::Weights;
use crate::qp::{CACHE_LINE, LANES, padded};

/// Some columns of one row.
type Group = [f64; LANES];

/// Most groups of columns.
const MAX_GROUPS: usize = crate::qp::MAX_VARIABLES.div_ceil(LANES);

/// Numbers in all panels together: wrench estimates, then joints, or TCP velocities and positions.
pub(super) const fn panels_len<const N: usize, const D: usize>(steps: usize) -> usize {
    let rows = D + if N > 2 * D { N } else { 2 * D };
    // Columns are padded to whole groups of steps, and there is the slack.
    rows * (D * padded(steps) + LANES)
}

/// A panel of K outputs at the start of `storage`, and what is left of that.
fn panel<const K: usize>(storage: &mut [f64], groups: usize) -> (&mut [[Group; K]], &mut [f64]) {
    let (panel, rest) = storage.split_at_mut(groups * K * LANES);
    (&mut panel.as_chunks_mut().0.as_chunks_mut().0[..groups], rest)
}

/// The outputs' entries in a column.
#[inline(always)]
fn entries<const K: usize>(panel: &[[Group; K]], column: usize) -> [f64; K] {
    let group = &panel[column / LANES];
    core::array::from_fn(|output| group[output][column % LANES])
}

#[inline(always)]
fn put<const K: usize>(panel: &mut [[Group; K]], column: usize, entries: &[f64; K]) {
    let group = &mut panel[column / LANES];
    for output in 0..K {
        group[output][column % LANES] = entries[output];
    }
}

#[inline(always)]
fn product<const K: usize>(a: &[f64; K], b: &[f64; K]) -> [f64; K] {
    core::array::from_fn(|k| a[k] * b[k])
}

/// What is added to a row of H, from its first group on: factors times the rows of a panel.
struct Terms<'a, const K: usize> {
    factors: [f64; K],
    panel: &'a [[Group; K]],
}

const NOTHING: Terms<'static, 0> = Terms { factors: [], panel: &[[]; MAX_GROUPS] };

impl<'a, const K: usize> Terms<'a, K> {
    #[inline(always)]
    fn new(panel: &'a [[Group; K]], index: usize, factors: [f64; K]) -> Self {
        Self { factors, panel: &panel[index / LANES..] }
    }

    /// Σ_o w_o s_o s_oᵀ, of row `index`.
    #[inline(always)]
    fn squared(panel: &'a [[Group; K]], index: usize, weight: &[f64; K]) -> Self {
        Self::new(panel, index, product(weight, &entries(panel, index)))
    }
}

/// row ← start, or itself, plus the terms.
#[inline(always)]
fn add<const A: usize, const B: usize>(
    row: &mut [Group],
    start: Option<&[Group]>,
    left: &Terms<'_, A>,
    right: &Terms<'_, B>,
) {
    let (by_left, by_right) = (left.factors.map(f64x4::splat), right.factors.map(f64x4::splat));
    let sum = |start: Group, left: &[Group; A], right: &[Group; B]| {
        // Two sums side by side hide the latency of the addition.
        let (mut total, mut other) = (f64x4::new(start), f64x4::ZERO);
        for t in 0..A {
            total = by_left[t].mul_add(f64x4::new(left[t]), total);
        }
        for t in 0..B {
            let right = f64x4::new(right[t]);
            other = if t > 0 { by_right[t].mul_add(right, other) } else { by_right[t] * right };
        }
        if B > 0 { (total + other).to_array() } else { total.to_array() }
    };
    let terms = left.panel.iter().zip(right.panel);
    match start {
        Some(start) => {
            for ((value, start), (left, right)) in row.iter_mut().zip(start).zip(terms) {
                *value = sum(*start, left, right);
            }
        }
        None => {
            for (value, (left, right)) in row.iter_mut().zip(terms) {
                *value = sum(*value, left, right);
            }
        }
    }
}

/// Numbers that stand before H, in whole cache lines: over even steps, where every row starts as the one M above it, one
/// column earlier for each, the rows −M to −1 that the first ones start as.
pub(super) const fn margin_len(inputs: usize, stride: usize) -> usize {
    (inputs * (stride + 1)).next_multiple_of(CACHE_LINE)
}

/// H while it is written, behind its margin.
struct Triangle<'a, const M: usize> {
    values: &'a mut [f64],
    stride: usize,
    margin: usize,
    /// Groups of columns.
    groups: usize,
}

impl<'a, const M: usize> Triangle<'a, M> {
    /// Before the first term: over even steps R in the margin, from where it moves down the diagonal; over uneven ones R in H,
    /// times the shares of the steps.
    #[inline(always)]
    fn new<const N: usize, const D: usize>(
        rows: &MpcRows<'_, N, D, M>,
        values: &'a mut [f64],
        stride: usize,
        is_even: bool,
    ) -> Self {
        let (prediction, steps) = (rows.prediction, rows.horizon.steps().len());
        let (n, margin) = (M * steps, margin_len(M, stride));
        let weight: [f64; M] = core::array::from_fn(|a| prediction.input_weight[prediction.inputs.as_slice()[a]]);
        if is_even {
            let first = margin - M * (stride + 1);
            values[..margin].fill(0.0);
            for a in 0..M {
                values[first + a * (stride + 1)] = weight[a];
            }
        } else {
            values[margin..margin + n * stride].fill(0.0);
            for index in 0..n {
                let share = rows.horizon.share(steps - 1 - index / M);
                values[margin + index * (stride + 1)] = weight[index % M] * share;
            }
        }
        Self { values, stride, margin, groups: n.div_ceil(LANES) }
    }

    /// Row `index` from the group of its diagonal on; and where it starts from over even steps, the row M above it, M columns
    /// further left.
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

/// For each of K outputs, what it makes of the joints' responses, by input axis.
struct Spread<const N: usize, const K: usize, const M: usize>([Matrix<M, N>; K]);

impl<const N: usize, const K: usize, const M: usize> Spread<N, K, M> {
    /// For outputs with the given gradients over the joints.
    #[inline(always)]
    fn new<const D: usize>(rows: &MpcRows<'_, N, D, M>, gradients: [[f64; N]; K]) -> Self {
        Self(gradients.map(|gradient| Matrix::of_rows(rows.inputs.columns.map(|column| product(&gradient, &column)))))
    }

    /// The outputs, by output and input axis, where the joints have responded like this to each output.
    #[inline(always)]
    fn of<'r>(&self, responses: impl Fn(usize) -> &'r [f64; N]) -> [[f64; M]; K] {
        core::array::from_fn(|output| self.0[output].times(Short::new(responses(output))).array())
    }

    /// Writes the outputs of columns of steps from `first` on, with what `responses` gives for one of them.
    #[inline(always)]
    fn write<'r>(
        &self,
        panel: &mut [[Group; K]],
        columns: core::ops::Range<usize>,
        responses: impl Fn(usize, usize) -> &'r [f64; N],
    ) {
        for reversed in columns {
            let outputs = self.of(|output| responses(reversed, output));
            for a in 0..M {
                put(panel, reversed * M + a, &core::array::from_fn(|output| outputs[output][a]));
            }
        }
    }
}

/// Wrench estimates.
struct WrenchOutputs<'a, const N: usize, const M: usize> {
    axes: &'a [usize],
    /// Of unused outputs zero, as their responses are.
    weight: [f64; M],
    /// The weight in the step that has been written.
    weight_here: [f64; M],
    spread: Spread<N, M, M>,
    estimates: &'a mut [[Group; M]],
}

impl<'a, const N: usize, const M: usize> WrenchOutputs<'a, N, M> {
    #[inline(always)]
    fn new<const D: usize>(rows: &MpcRows<'a, N, D, M>, estimates: &'a mut [[Group; M]]) -> Self {
        let prediction = rows.prediction;
        let (Weights::Joint { wrench, .. } | Weights::Task { wrench, .. }) = prediction.weights;
        let axes = prediction.wrench_axes.as_slice();
        let gradients = &rows.model.wrench_gradient.data.0;
        let gradients = core::array::from_fn(|output| axes.get(output).map_or([0.0; N], |&axis| gradients[axis]));
        let weight = core::array::from_fn(|output| axes.get(output).map_or(0.0, |&axis| wrench[axis]));
        Self { axes, weight, weight_here: weight, spread: Spread::new(rows, gradients), estimates }
    }

    /// At the end of step `step`, which inputs from the column of steps `first` on reach and which counts by `share`.
    #[inline(always)]
    fn write<const D: usize>(&mut self, responses: &Responses<'_, N, D>, step: usize, first: usize, share: f64) {
        self.weight_here = self.weight.map(|weight| weight * share);
        let by_column = responses.wrench(step);
        // An output that is not used has a gradient of zero, whatever the response.
        let axes: [usize; M] = core::array::from_fn(|output| self.axes.get(output).copied().unwrap_or(0));
        self.spread.write(self.estimates, first..by_column.len(), |column, output| &by_column[column][axes[output]]);
    }

    #[inline(always)]
    fn terms(&self, index: usize) -> Terms<'_, M> {
        Terms::squared(self.estimates, index, &self.weight_here)
    }
}

/// TCP velocities and positions, with task weights.
struct TcpOutputs<'a, const N: usize, const D: usize, const M: usize> {
    spread: Spread<N, D, M>,
    /// Weights in the step that has been written.
    velocity_weight: [f64; D],
    position_weight: [f64; D],
    has_position: bool,
    velocities: &'a mut [[Group; D]],
    positions: &'a mut [[Group; D]],
}

impl<const N: usize, const D: usize, const M: usize> TcpOutputs<'_, N, D, M> {
    /// At the end of step `step`, which inputs from the column of steps `first` on reach.
    #[inline(always)]
    fn write(&mut self, responses: &Responses<'_, N, D>, step: usize, first: usize) {
        let (velocity, position) = (responses.velocity(step), responses.position(step));
        self.spread.write(self.velocities, first..velocity.len(), |column, _| &velocity[column]);
        if self.has_position {
            self.spread.write(self.positions, first..position.len(), |column, _| &position[column]);
        }
    }

    /// Adds these outputs and the wrench estimates to a row.
    #[inline(always)]
    fn add_to(&self, row: &mut [Group], start: Option<&[Group]>, wrench: &WrenchOutputs<'_, N, M>, index: usize) {
        add(row, start, &wrench.terms(index), &Terms::squared(self.velocities, index, &self.velocity_weight));
        if self.has_position {
            add(row, None, &Terms::squared(self.positions, index, &self.position_weight), &NOTHING);
        }
    }
}

/// V over the columns of four steps: M groups of columns, the joints of a group together.
#[inline(always)]
fn over_columns<const N: usize, const D: usize, const M: usize>(rows: &MpcRows<'_, N, D, M>) -> [[Group; N]; M] {
    core::array::from_fn(|group| {
        core::array::from_fn(|joint| {
            core::array::from_fn(|lane| rows.inputs.columns[(group * LANES + lane) % M][joint])
        })
    })
}

/// A panel row for each joint: its joint-space cost of column `r` of steps with every later one, times V.
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

/// Writes the upper triangle.
pub(super) fn write<const N: usize, const D: usize, const M: usize>(
    responses: &Responses<'_, N, D>,
    rows: &MpcRows<'_, N, D, M>,
    hessian: &mut [f64],
    stride: usize,
    scratch: &mut [f64],
) {
    if rows.horizon.is_even() {
        write_over::<N, D, M, true>(responses, rows, hessian, stride, scratch);
    } else {
        write_over::<N, D, M, false>(responses, rows, hessian, stride, scratch);
    }
}

/// Writes it over even or uneven steps.
// Apart from its neighbours: in one function they would share too few registers.
#[inline(never)]
fn write_over<const N: usize, const D: usize, const M: usize, const EVEN: bool>(
    responses: &Responses<'_, N, D>,
    rows: &MpcRows<'_, N, D, M>,
    hessian: &mut [f64],
    stride: usize,
    scratch: &mut [f64],
) {
    let (prediction, steps) = (rows.prediction, rows.horizon.steps());
    let (last, n) = (steps.len() - 1, M * steps.len());
    let groups = n.div_ceil(LANES);
    let (estimates, rest) = panel(scratch, groups);
    let mut wrench = WrenchOutputs::new(rows, estimates);
    if EVEN {
        wrench.write(responses, last, 0, 1.0);
    }
    let mut triangle = Triangle::new(rows, hessian, stride, EVEN);
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
                    if EVEN {
                        add(row, Some(start), &wrench.terms(index), &cost);
                    } else {
                        add(row, None, &NOTHING, &cost);
                    }
                }
            }
            for k in (0..=last).filter(|_| !EVEN) {
                wrench.write(responses, k, last - k, rows.horizon.share(k));
                for index in (last - k) * M..n {
                    add(triangle.row(index).0, None, &wrench.terms(index), &NOTHING);
                }
            }
        }
        Weights::Task { position, velocity, .. } => {
            let (velocities, rest) = panel(rest, groups);
            let (positions, _) = panel(rest, groups);
            let mut tcp = TcpOutputs {
                spread: Spread::new(rows, Matrix::of_columns(prediction.jacobian.data.0).rows),
                velocity_weight: *array(velocity),
                position_weight: *array(position),
                has_position: position.iter().any(|weight| *weight != 0.0),
                velocities,
                positions,
            };
            if EVEN {
                tcp.write(responses, last, 0);
            }
            for index in (0..n).filter(|_| EVEN) {
                let (row, start) = triangle.row(index);
                tcp.add_to(row, Some(start), &wrench, index);
            }
            for k in (0..=last).filter(|_| !EVEN) {
                let share = rows.horizon.share(k);
                wrench.write(responses, k, last - k, share);
                tcp.velocity_weight = array(velocity).map(|weight| weight * share);
                tcp.position_weight = array(position).map(|weight| weight * share);
                tcp.write(responses, k, last - k);
                for index in (last - k) * M..n {
                    tcp.add_to(triangle.row(index).0, None, &wrench, index);
                }
            }
        }
    }
    if let Some(slack) = &prediction.slack {
        let hessian = &mut triangle.values[triangle.margin..];
        hessian.chunks_exact_mut(stride).take(n).for_each(|row| row[n] = 0.0);
        hessian[n * stride + n] = slack.curvature * SLACK_UNIT * SLACK_UNIT;
    }
}
