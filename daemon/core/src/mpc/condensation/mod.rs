//! From model, cost and constraints to one QP in the inputs: the dynamics (18c) are substituted, so
//! that the variables are the inputs alone. J is constant over the horizon and joints and wrench
//! filters are diagonal; so
//!
//! - responses to an input are scalars per joint (`Responses`, computed once) times columns of
//!   J⁻¹,
//! - H follows from them (`hessian`), with one addition per entry and output where the steps are
//!   even, and from what a state costs later where they are not (`cost_to_go`),
//! - g is one sweep backward along the free trajectory (`trajectory`),
//! - rows are never written down: A z is a simulation, a row of A a sweep backward (`rows`).
//!
//! Variables stand in reversed time order, [u_{H−1}; …; u_0]: a row that bounds an early instant
//! then has its coefficients at the end, and so has its image under the Cholesky factor.
#![allow(clippy::needless_range_loop, reason = "formulas index several arrays at once")]

mod cost_to_go;
mod hessian;
mod panels;
mod responses;
mod row_bounds;
mod rows;
mod simd;
mod trajectory;

use nalgebra::{SMatrix, SVector};

pub use rows::MpcRows;

use crate::mpc::constraints::{Constraints, Softened};
use crate::mpc::cost::{SetPoint, Weights};
use crate::mpc::horizon::Horizon;
use crate::mpc::model::State;
use crate::mpc::qp::{ALIGNMENT, Answer, Qp, RowState, Rows, before_cache_line, padded};

/// Largest number of constraint rows: speed, acceleration, jerk and position of 8 joints, offset and rate of 6
/// inputs and the speed along the normal in 32 steps, the upper and the softened lower bound of 6 forces at 96 points,
/// and the slack make 2593.
pub const MAX_ROWS: usize = 2624;

/// Axes that have an input in this cycle, in ascending order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InputAxes<const D: usize> {
    axes: [usize; D],
    len: usize,
}

impl<const D: usize> InputAxes<D> {
    /// No axis.
    pub fn none() -> Self {
        Self { axes: [0; D], len: 0 }
    }

    /// The axes for which `has_input` is true.
    pub fn from_mask(has_input: &[bool; D]) -> Self {
        let mut inputs = Self::none();
        for axis in (0..D).filter(|&axis| has_input[axis]) {
            inputs.axes[inputs.len] = axis;
            inputs.len += 1;
        }
        inputs
    }

    /// The axes.
    pub fn as_slice(&self) -> &[usize] {
        &self.axes[..self.len]
    }
}

/// What one cycle's problem is made of, beside its model and horizon.
#[derive(Debug, Clone, Copy)]
pub struct Prediction<'a, const N: usize, const D: usize> {
    /// x_0, measured.
    pub initial: State<N, D>,
    /// The joint velocity reference in each step without the inputs, J⁻¹ (ṗ0 + offset of released
    /// axes), rad/s, less the drift; as many as steps.
    pub known_reference: &'a [SVector<f64, N>],
    /// Joint velocity in rad/s by which the TCP falls behind what J predicts: J is constant over the
    /// horizon, and turns. Cost and force bounds take it into account; no joint moves by it.
    pub drift: SVector<f64, N>,
    /// Axes with an input.
    pub inputs: InputAxes<D>,
    /// u_{−1}: what the rate of the first input is counted from.
    pub previous_input: SVector<f64, D>,
    /// Axes with a wrench state in the cost.
    pub wrench_axes: InputAxes<D>,
    /// What is bounded.
    pub constraints: Constraints<'a, N, D>,
    /// x⁰.
    pub set_point: SetPoint<N, D>,
    /// Q.
    pub weights: &'a Weights<N, D>,
    /// J at the measured pose, D×N.
    pub jacobian: SMatrix<f64, D, N>,
    /// R: diagonal, per task axis, 1/(m/s)² and 1/(rad/s)².
    pub input_weight: SVector<f64, D>,
    /// The slack that softens force bounds, if any.
    pub slack: Option<Slack>,
}

/// One slack t ≥ 0, common to all the force bounds that it softens, and its cost p t + ½ ρ t².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slack {
    /// Which bounds.
    pub softened: Softened,
    /// p in 1/N: while the multipliers of the softened rows sum to less, t is zero and they are
    /// met.
    pub price: f64,
    /// ρ in 1/N², above zero.
    pub curvature: f64,
}

impl<const N: usize, const D: usize> Prediction<'_, N, D> {
    /// Which bounds are softened.
    pub(super) fn softened(&self) -> Option<Softened> {
        self.slack.map(|slack| slack.softened)
    }
}

/// Newtons in one unit of the slack variable, which brings it near the scale of the inputs.
pub(crate) const SLACK_UNIT: f64 = 100.0;

/// Sizes of the storage that one controller needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Capacity {
    /// Variables: axes times steps, and a slack.
    pub variables: usize,
    tables: usize,
    margin: usize,
    scratch: usize,
}

impl Capacity {
    /// For N joints that carry so many numbers, D axes and H steps with every axis as input.
    pub fn new<const N: usize, const D: usize>(steps: usize, carried: usize) -> Self {
        let variables = D * steps + 1;
        let panels = hessian::panels_len::<N, D>(steps);
        let checks = 3 * padded(variables) + MAX_ROWS;
        let trajectory = trajectory::trajectory_len::<N, D>(steps, carried);
        Self {
            variables,
            tables: hessian::table_len::<N, D>(steps, carried),
            margin: hessian::margin_len(D, padded(variables)),
            scratch: panels.max(checks).max(trajectory),
        }
    }

    /// Number of f64 that [`Workspace::new`] wants.
    pub fn storage_len(&self) -> usize {
        let stride = padded(self.variables);
        self.tables + self.margin + stride * stride + 2 * stride + 4 * MAX_ROWS + self.scratch + ALIGNMENT
    }
}

/// Storage of the QP, its answer, and what does not change between cycles; given by the caller,
/// allocated once.
#[derive(Debug)]
pub struct Workspace<B> {
    capacity: Capacity,
    storage: B,
    /// Where its first cache line starts.
    offset: usize,
    working: [RowState; MAX_ROWS],
}

/// A workspace cut to the size of one cycle's problem.
#[derive(Debug)]
pub struct Pieces<'a> {
    variables: usize,
    stride: usize,
    /// Numbers before H that belong to it while it is written.
    margin: usize,
    hessian: &'a mut [f64],
    gradient: &'a mut [f64],
    lower: &'a mut [f64],
    upper: &'a mut [f64],
    weight: &'a mut [f64],
    /// The free trajectory, then the panels of [`hessian`], then room for checks.
    scratch: &'a mut [f64],
    tables: &'a mut [f64],
    /// Where the solver writes.
    pub answer: Answer<'a>,
}

impl<B: AsMut<[f64]>> Workspace<B> {
    /// A workspace in `storage` for this horizon and the joint-space part of these weights; `None`
    /// when it is shorter than [`Capacity::storage_len`].
    pub fn new<const N: usize, const D: usize>(
        horizon: &Horizon<N, D>,
        weights: &Weights<N, D>,
        mut storage: B,
    ) -> Option<Self> {
        let capacity = Capacity::new::<N, D>(horizon.steps().len(), horizon.carried());
        if storage.as_mut().len() < capacity.storage_len() {
            return None;
        }
        let offset = before_cache_line(storage.as_mut());
        hessian::fill(&mut storage.as_mut()[offset..offset + capacity.tables], horizon, weights);
        Some(Self { capacity, storage, offset, working: [RowState::Inactive; MAX_ROWS] })
    }

    /// The pieces for a problem of the size of `rows`; `None` when that is larger than the
    /// capacity.
    pub fn pieces<const N: usize, const D: usize, const M: usize, const C: usize>(
        &mut self,
        rows: &MpcRows<'_, N, D, M, C>,
    ) -> Option<Pieces<'_>> {
        let (variables, count) = (rows.variables(), rows.layout.rows());
        if variables > self.capacity.variables || count > MAX_ROWS {
            return None;
        }
        let (stride, row_stride) = (padded(variables), padded(count));
        let (tables, rest) = self.storage.as_mut()[self.offset..].split_at_mut(self.capacity.tables);
        let margin = hessian::margin_len(M, stride);
        let (hessian, rest) = rest.split_at_mut(margin + stride * stride);
        let (gradient, rest) = rest.split_at_mut(stride);
        let (z, rest) = rest.split_at_mut(stride);
        let (lower, rest) = rest.split_at_mut(row_stride);
        let (upper, rest) = rest.split_at_mut(row_stride);
        let (weight, rest) = rest.split_at_mut(row_stride);
        let (multipliers, scratch) = rest.split_at_mut(row_stride);
        let answer = Answer { z, multipliers, working: &mut self.working[..count] };
        Some(Pieces { variables, stride, margin, hessian, gradient, lower, upper, weight, scratch, tables, answer })
    }
}

impl Pieces<'_> {
    /// The problem that [`condense`] has written, the place for its answer, and scratch for its
    /// checks.
    pub fn split<'b>(&'b mut self, rows: &'b dyn Rows) -> (Qp<'b>, Answer<'b>, &'b mut [f64]) {
        let qp = Qp {
            variables: self.variables,
            stride: self.stride,
            rows,
            row_count: self.answer.working.len(),
            hessian: &self.hessian[self.margin..],
            gradient: self.gradient,
            lower: self.lower,
            upper: self.upper,
            weight: self.weight,
        };
        let Answer { z, multipliers, working } = &mut self.answer;
        (qp, Answer { z, multipliers, working }, self.scratch)
    }
}

/// Writes the condensed problem (18) into `pieces`, which are those for `rows`.
///
/// The cost is half of (18a) without its constant. About n² (N + m) / 2 multiplications over even
/// steps and joint weights, n² 3 m / 2 with task weights; over uneven steps n H N (2 + m) / 2 + n²
/// N / 2.
pub fn condense<const N: usize, const D: usize, const M: usize, const C: usize>(
    rows: &MpcRows<'_, N, D, M, C>,
    pieces: &mut Pieces<'_>,
) {
    let steps = rows.horizon.steps().len();
    let mut free = trajectory::FreeTrajectory::within(pieces.scratch, steps);
    trajectory::write_gradient(rows, pieces.gradient, &mut free);
    rows.write_bounds(&free, pieces.lower, pieces.upper, pieces.weight);
    hessian::write(pieces.tables, rows, pieces.hessian, pieces.stride, pieces.scratch);
}
