//! H = Σ_k S_kᵀ Q S_k + R, S_k the response of x_k to the inputs; its upper triangle.
//!
//! Every weighted output o (a wrench estimate; with task weights a TCP velocity or position) adds w_o s_o s_oᵀ per step; the
//! joint-space cost of (23a) adds V_ia V_ib times a scalar of the two steps, V = J⁻¹. Over even steps
//! P(r, s) = P(r − 1, s − 1) + what the longest response adds, in reversed time: one product per entry and output. Over uneven
//! ones the outputs are added step by step.

use wide::f64x4;

use super::responses::Responses;
use super::rows::MpcRows;
use super::{SLACK_CURVATURE, SLACK_UNIT};
use crate::cost::Weights;
use crate::model::Step;
use crate::qp::LANES;

/// Wrench estimates with TCP velocities and positions; or wrench estimates and joints.
const MAX_OUTPUTS: usize = 18;
const _: () = assert!(MAX_OUTPUTS >= 3 * 6 && MAX_OUTPUTS >= 6 + 8);

/// Rows of the panel: outputs or joints, and f_lin behind [`MAX_OUTPUTS`].
pub(super) const fn panel_rows<const D: usize>() -> usize {
    MAX_OUTPUTS + D
}

/// The panel: responses of outputs to all inputs, one output a row, and what turns them into H.
struct Panel<'a> {
    values: &'a mut [f64],
    stride: usize,
    /// Weights of the rows that are outputs.
    weights: [f64; MAX_OUTPUTS],
    /// Rows that are outputs.
    outputs: usize,
}

impl Panel<'_> {
    fn row(&mut self, index: usize) -> &mut [f64] {
        &mut self.values[index * self.stride..(index + 1) * self.stride]
    }

    /// The outputs' entries in a column, times their weights.
    fn weighted(&self, column: usize) -> [f64; MAX_OUTPUTS] {
        let mut factors = [0.0; MAX_OUTPUTS];
        for output in 0..self.outputs.min(MAX_OUTPUTS) {
            factors[output] = self.weights[output] * self.values[output * self.stride + column];
        }
        factors
    }
}

/// Writes the upper triangle; what is left of the diagonal or beyond the variables in a row is not defined.
// Apart from its neighbours: in one function they would share too few registers.
#[inline(never)]
pub(super) fn write<const N: usize, const D: usize, const M: usize>(
    responses: &Responses<'_, N>,
    rows: &MpcRows<'_, N, D, M>,
    hessian: &mut [f64],
    stride: usize,
    panel: &mut [f64],
) {
    let (horizon, prediction) = (rows.horizon, rows.prediction);
    let (h, n) = (horizon.steps().len(), M * horizon.steps().len());
    let mut panel = Panel { values: panel, stride, weights: [0.0; MAX_OUTPUTS], outputs: 0 };
    let by_joint = matches!(prediction.weights, Weights::Joint { .. });
    if horizon.is_even() {
        write_outputs(responses, rows, h - 1, &mut panel);
        filter_by_lag(rows, &horizon.steps()[h - 1], &mut panel, n);
    }
    // What stands beyond the inputs is added too; it must be finite, and is taken out again.
    for row in panel.values.chunks_exact_mut(stride).take(panel.outputs + N) {
        row[n..].fill(0.0);
    }
    for r in 0..h {
        let (first, start) = (r * M, r * M / LANES * LANES);
        if by_joint && M > 1 {
            write_joints(responses, rows, r, &mut panel);
        }
        for a in 0..M {
            let index = first + a;
            let (above, here) = hessian.split_at_mut(index * stride);
            let row = &mut here[start..stride];
            let before = (horizon.is_even() && start >= M).then(|| (index - M) * stride + start - M);
            if before.is_none() {
                row.fill(0.0);
                if horizon.is_even() && r > 0 {
                    // The second step of few inputs: what is shifted begins within a group.
                    let before = (index - M) * stride + first - M;
                    row[first - start..].copy_from_slice(&above[before..before + stride - first]);
                }
            }
            let shifted = before.map(|before| &above[before..before + stride - start]);
            let mut factors = panel.weighted(index);
            let outputs = if horizon.is_even() { panel.outputs } else { 0 };
            let skipped = panel.outputs - outputs;
            if by_joint && M == 1 {
                // With one input a step the products V V are factors of the tables' own rows.
                let (cost, cost_stride) = responses.cost(r);
                add(row, shifted, &rows.columns[a].map(|v| v * v), &cost[start..], cost_stride);
                add_outputs(row, None, &factors[..outputs], &panel.values[start..], stride);
            } else {
                let mut terms = outputs;
                if by_joint {
                    factors[outputs..outputs + N].copy_from_slice(&rows.columns[a]);
                    terms += N;
                }
                add_outputs(row, shifted, &factors[..terms], &panel.values[skipped * stride + start..], stride);
            }
            if prediction.slack_price.is_some() {
                here[n..stride].fill(0.0);
            }
            if r == 0 || !horizon.is_even() {
                here[index] += prediction.input_weight[prediction.inputs.as_slice()[a]];
            }
        }
    }
    if !horizon.is_even() {
        add_step_by_step(responses, rows, hessian, &mut panel, n);
    }
    if let Some(price) = prediction.slack_price {
        hessian[n * stride + n] = price * SLACK_UNIT * SLACK_CURVATURE;
    }
}

/// As [`add`], for any number of outputs.
fn add_outputs(row: &mut [f64], shifted: Option<&[f64]>, factors: &[f64], panel: &[f64], stride: usize) {
    let (mut shifted, mut panel, mut factors) = (shifted, panel, factors);
    // More than six terms at a time run out of registers.
    while let Some((six, others)) = factors.split_first_chunk::<6>() {
        add(row, shifted.take(), six, panel, stride);
        (panel, factors) = (&panel[6 * stride..], others);
    }
    match *factors {
        [a] => add(row, shifted, &[a], panel, stride),
        [a, b] => add(row, shifted, &[a, b], panel, stride),
        [a, b, c] => add(row, shifted, &[a, b, c], panel, stride),
        [a, b, c, d] => add(row, shifted, &[a, b, c, d], panel, stride),
        [a, b, c, d, e] => add(row, shifted, &[a, b, c, d, e], panel, stride),
        _ if shifted.is_some() => add(row, shifted, &[], panel, stride),
        _ => {}
    }
}

/// row ← what is shifted into it, or itself, plus Σ factors_i · panel row i; in whole groups.
#[inline(always)]
fn add<const T: usize>(row: &mut [f64], shifted: Option<&[f64]>, factors: &[f64; T], panel: &[f64], stride: usize) {
    let row = row.as_chunks_mut::<LANES>().0;
    let terms: [&[[f64; LANES]]; T] =
        core::array::from_fn(|t| &panel[t * stride..].as_chunks::<LANES>().0[..row.len()]);
    let factors = factors.map(f64x4::splat);
    let sum = |start: [f64; LANES], group: usize| {
        let mut total = f64x4::new(start);
        for t in 0..T {
            total = factors[t].mul_add(f64x4::new(terms[t][group]), total);
        }
        total.to_array()
    };
    match shifted {
        Some(shifted) => {
            let shifted = &shifted.as_chunks::<LANES>().0[..row.len()];
            for (group, value) in row.iter_mut().enumerate() {
                *value = sum(shifted[group], group);
            }
        }
        None => {
            for (group, value) in row.iter_mut().enumerate() {
                *value = sum(*value, group);
            }
        }
    }
}

/// The outputs at the end of step `step`, into the first rows of the panel, and f_lin behind [`MAX_OUTPUTS`]. Wrench
/// estimates are left as they are: they follow f_lin, see [`filter_by_lag`] and [`add_step_by_step`].
fn write_outputs<const N: usize, const D: usize, const M: usize>(
    responses: &Responses<'_, N>,
    rows: &MpcRows<'_, N, D, M>,
    step: usize,
    panel: &mut Panel<'_>,
) {
    let prediction = rows.prediction;
    let (Weights::Joint { wrench, .. } | Weights::Task { wrench, .. }) = prediction.weights;
    let by_position = |joint| responses.position(step, joint);
    let by_velocity = |joint| responses.velocity(step, joint);
    let mut outputs = 0;
    for &axis in prediction.wrench_axes.as_slice() {
        panel.weights[outputs] = wrench[axis];
        let gradient = &rows.model.wrench_gradient.data.0[axis];
        spread(rows, step, by_position, gradient, panel.row(MAX_OUTPUTS + outputs));
        outputs += 1;
    }
    if let Weights::Task { position, velocity, .. } = prediction.weights {
        for axis in 0..D {
            let gradient = core::array::from_fn(|joint| prediction.jacobian[(axis, joint)]);
            if velocity[axis] != 0.0 {
                panel.weights[outputs] = velocity[axis];
                spread(rows, step, by_velocity, &gradient, panel.row(outputs));
                outputs += 1;
            }
            if position[axis] != 0.0 {
                panel.weights[outputs] = position[axis];
                spread(rows, step, by_position, &gradient, panel.row(outputs));
                outputs += 1;
            }
        }
    }
    panel.outputs = outputs;
}

/// The response of one output with the given gradient over the joints to every input up to step `step`.
#[inline(always)]
fn spread<'t, const N: usize, const D: usize, const M: usize>(
    rows: &MpcRows<'_, N, D, M>,
    step: usize,
    table: impl Fn(usize) -> &'t [f64],
    gradient: &[f64; N],
    row: &mut [f64],
) {
    let h = rows.horizon.steps().len();
    let first = h - 1 - step;
    let factors: [[f64; M]; N] =
        core::array::from_fn(|joint| rows.by_joint[joint].map(|column| gradient[joint] * column));
    let tables: [&[f64]; N] = core::array::from_fn(|joint| &table(joint)[first..h]);
    for (reversed, values) in row[first * M..h * M].as_chunks_mut::<M>().0.iter_mut().enumerate() {
        let mut sums = [0.0; M];
        for joint in 0..N {
            let response = tables[joint][reversed];
            for a in 0..M {
                sums[a] += factors[joint][a] * response;
            }
        }
        *values = sums;
    }
}

/// Over even steps the response at one lag follows from that at the lag before: one column of inputs earlier.
fn filter_by_lag<const N: usize, const D: usize, const M: usize>(
    rows: &MpcRows<'_, N, D, M>,
    step: &Step<N, D>,
    panel: &mut Panel<'_>,
    n: usize,
) {
    let stride = panel.stride;
    let (estimates, linear) = panel.values.split_at_mut(MAX_OUTPUTS * stride);
    for (index, &axis) in rows.prediction.wrench_axes.as_slice().iter().enumerate() {
        let (e, g, h) = (step.wrench_decay[axis], step.wrench_by_start[axis], step.wrench_by_end[axis]);
        let (mut before, mut linear_before) = ([0.0; M], [0.0; M]);
        let columns = estimates[index * stride..index * stride + n].as_chunks_mut::<M>().0.iter_mut();
        for (estimate, linear) in columns.zip(linear[index * stride..].as_chunks::<M>().0) {
            for a in 0..M {
                estimate[a] = e * before[a] + g * linear_before[a] + h * linear[a];
            }
            (before, linear_before) = (*estimate, *linear);
        }
    }
}

/// Behind the outputs, a panel row for each joint: its joint-space cost with every later column, times J⁻¹.
fn write_joints<const N: usize, const D: usize, const M: usize>(
    responses: &Responses<'_, N>,
    rows: &MpcRows<'_, N, D, M>,
    r: usize,
    panel: &mut Panel<'_>,
) {
    let (costs, cost_stride) = responses.cost(r);
    let (outputs, h) = (panel.outputs, rows.horizon.steps().len());
    for (joint, cost) in costs.chunks_exact(cost_stride).enumerate() {
        let column = &rows.by_joint[joint];
        let row = panel.row(outputs + joint)[r * M..].as_chunks_mut::<M>().0;
        for (values, cost) in row.iter_mut().zip(&cost[r..h]) {
            for b in 0..M {
                values[b] = cost * column[b];
            }
        }
    }
}

/// Adds the outputs of every step to H: at the end of step k the inputs of steps 0..=k act.
fn add_step_by_step<const N: usize, const D: usize, const M: usize>(
    responses: &Responses<'_, N>,
    rows: &MpcRows<'_, N, D, M>,
    hessian: &mut [f64],
    panel: &mut Panel<'_>,
    n: usize,
) {
    let (stride, h) = (panel.stride, rows.horizon.steps().len());
    panel.values[..panel_rows::<D>() * stride].fill(0.0);
    let axes = rows.prediction.wrench_axes.as_slice();
    for (k, step) in rows.horizon.steps().iter().enumerate() {
        filter(axes, panel, n, |axis| (step.wrench_decay[axis], step.wrench_by_start[axis]));
        write_outputs(responses, rows, k, panel);
        filter(axes, panel, n, |axis| (1.0, step.wrench_by_end[axis]));
        for index in (h - 1 - k) * M..n {
            let start = index / M * M / LANES * LANES;
            let row = &mut hessian[index * stride + start..(index + 1) * stride];
            add_outputs(row, None, &panel.weighted(index)[..panel.outputs], &panel.values[start..], stride);
        }
    }
}

/// f̂ ← factor f̂ + gain f_lin for every wrench estimate; (factor, gain) by axis.
fn filter(axes: &[usize], panel: &mut Panel<'_>, n: usize, factors: impl Fn(usize) -> (f64, f64)) {
    let stride = panel.stride;
    let (estimates, linear) = panel.values.split_at_mut(MAX_OUTPUTS * stride);
    for (index, &axis) in axes.iter().enumerate() {
        let (factor, gain) = factors(axis);
        let estimate = &mut estimates[index * stride..index * stride + n];
        for (value, linear) in estimate.iter_mut().zip(&linear[index * stride..]) {
            *value = factor * *value + gain * linear;
        }
    }
}
