//! From model, cost and constraints to one dense QP in the inputs: the dynamics (18c) are substituted, so that the
//! variables are z = [u_0; …; u_{H−1}] and the state of every step is affine in them,
//! x_k = free_k + S_k z, with S_k carried along by the model's own recurrence.

use nalgebra::SVector;

use crate::constraints::{FIRST_STEP, ForceBounds};
use crate::cost::{SetPoint, StateWeights};
use crate::model::{Model, State};
use crate::qp::Qp;

/// Axes that have an input in this cycle, in ascending order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InputAxes<const D: usize> {
    axes: [usize; D],
    len: usize,
}

impl<const D: usize> InputAxes<D> {
    /// The axes for which `has_input` is true.
    pub fn from_mask(has_input: &[bool; D]) -> Self {
        let mut inputs = Self { axes: [0; D], len: 0 };
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

/// Sizes of the storage that one controller needs, for at most `variables` inputs and `rows` constraint rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Capacity {
    /// Variables: axes times steps.
    pub variables: usize,
    /// Constraint rows.
    pub rows: usize,
    /// Numbers in a response x: 2N + D.
    state: usize,
}

impl Capacity {
    /// For N joints, D axes and H steps with every axis as input and bounded.
    pub fn new<const N: usize, const D: usize>(horizon: usize) -> Self {
        Self { variables: D * horizon, rows: D * horizon, state: 2 * N + D }
    }

    /// Number of f64 that [`Workspace::new`] wants.
    pub fn storage_len(&self) -> usize {
        let (n, rows) = (self.variables, self.rows);
        n * n + rows * n + 2 * n + 3 * rows + n * self.state
    }
}

/// Storage of the QP, its answer and the responses S_k; given by the shell, allocated once.
#[derive(Debug)]
pub struct Workspace<B> {
    capacity: Capacity,
    storage: B,
}

/// A workspace cut to the size of one cycle's problem.
#[derive(Debug)]
pub struct Pieces<'a> {
    hessian: &'a mut [f64],
    gradient: &'a mut [f64],
    matrix: &'a mut [f64],
    lower: &'a mut [f64],
    upper: &'a mut [f64],
    response: &'a mut [f64],
    /// Where the solver writes z.
    pub z: &'a mut [f64],
    /// Where the solver writes the multipliers.
    pub multipliers: &'a mut [f64],
}

impl<B: AsMut<[f64]>> Workspace<B> {
    /// A workspace in `storage`; `None` when that is shorter than [`Capacity::storage_len`].
    pub fn new(capacity: Capacity, mut storage: B) -> Option<Self> {
        (storage.as_mut().len() >= capacity.storage_len()).then_some(Self { capacity, storage })
    }

    /// The pieces for a problem of `n` variables and `rows` rows; `None` when it is larger than the capacity.
    pub fn pieces(&mut self, n: usize, rows: usize) -> Option<Pieces<'_>> {
        if n > self.capacity.variables || rows > self.capacity.rows {
            return None;
        }
        let rest = self.storage.as_mut();
        let (hessian, rest) = rest.split_at_mut(n * n);
        let (gradient, rest) = rest.split_at_mut(n);
        let (matrix, rest) = rest.split_at_mut(rows * n);
        let (lower, rest) = rest.split_at_mut(rows);
        let (upper, rest) = rest.split_at_mut(rows);
        let (multipliers, rest) = rest.split_at_mut(rows);
        let (z, rest) = rest.split_at_mut(n);
        let response = &mut rest[..n * self.capacity.state];
        Some(Pieces { hessian, gradient, matrix, lower, upper, response, z, multipliers })
    }
}

impl Pieces<'_> {
    /// The problem that [`condense`] has written.
    pub fn split(&mut self) -> (Qp<'_>, crate::qp::Answer<'_>) {
        let qp = Qp {
            variables: self.gradient.len(),
            rows: self.lower.len(),
            hessian: self.hessian,
            gradient: self.gradient,
            matrix: self.matrix,
            lower: self.lower,
            upper: self.upper,
        };
        (qp, crate::qp::Answer { z: self.z, multipliers: self.multipliers })
    }
}

/// What one cycle's problem is made of, beside its model.
#[derive(Debug)]
pub struct Prediction<'a, const N: usize, const D: usize> {
    /// x_0, measured.
    pub initial: State<N, D>,
    /// Length of each step in s; as many as the horizon.
    pub steps: &'a [f64],
    /// The twist that acts in each step without the inputs: ṗ0 and the offset of released axes, m/s and rad/s.
    pub known_twist: &'a [SVector<f64, D>],
    /// Axes with an input.
    pub inputs: InputAxes<D>,
    /// Axes with a wrench state in the cost.
    pub wrench_axes: InputAxes<D>,
    /// Bounds on f_lin.
    pub bounds: ForceBounds<D>,
    /// x⁰.
    pub set_point: SetPoint<N, D>,
    /// Q.
    pub weights: StateWeights<N, D>,
    /// R: diagonal, per task axis, 1/(m/s)² and 1/(rad/s)².
    pub input_weight: SVector<f64, D>,
}

impl<const N: usize, const D: usize> Prediction<'_, N, D> {
    /// Variables and rows of the problem.
    pub fn size(&self) -> (usize, usize) {
        (self.inputs.len * self.steps.len(), self.bounds.rows(self.steps.len()))
    }
}

/// A response column: [q (N); q̇ (N); f̂ (D)].
fn load<const N: usize, const D: usize>(column: &[f64]) -> State<N, D> {
    State {
        joint_position: SVector::from_fn(|i, _| column[i]),
        joint_velocity: SVector::from_fn(|i, _| column[N + i]),
        wrench: SVector::from_fn(|i, _| column[2 * N + i]),
    }
}

fn store<const N: usize, const D: usize>(column: &mut [f64], x: &State<N, D>) {
    column[..N].copy_from_slice(x.joint_position.as_slice());
    column[N..2 * N].copy_from_slice(x.joint_velocity.as_slice());
    column[2 * N..].copy_from_slice(x.wrench.as_slice());
}

/// Writes the condensed problem (18) into `pieces`, cut to [`Prediction::size`].
///
/// The cost is half of (18a) without its constant: H = Σ S_kᵀ Q S_k + R, g = Σ S_kᵀ Q (free_k − x⁰).
/// O(H n² (N + D)) work, bounded by the capacity.
pub fn condense<const N: usize, const D: usize>(
    model: &Model<N, D>,
    prediction: &Prediction<'_, N, D>,
    pieces: &mut Pieces<'_>,
) {
    let (n, _) = prediction.size();
    let width = 2 * N + D;
    let inputs = prediction.inputs.as_slice();
    pieces.hessian.fill(0.0);
    pieces.gradient.fill(0.0);
    for variable in 0..n {
        pieces.hessian[variable * n + variable] = prediction.input_weight[inputs[variable % inputs.len()]];
    }

    let mut free = prediction.initial;
    let mut reached = 0;
    for (step, &duration) in prediction.steps.iter().enumerate() {
        free = model.advance(duration, &free, &prediction.known_twist[step]);
        // Inputs of earlier steps decay and act on; the input of this step starts from rest.
        let still = SVector::<f64, N>::zeros();
        for column in pieces.response[..reached * width].chunks_exact_mut(width) {
            let next = model.advance_linear(duration, &load(column), &still);
            store(column, &next);
        }
        for &axis in inputs {
            let response = model.advance_linear(duration, &State::zeros(), &model.input_direction(axis));
            store(&mut pieces.response[reached * width..(reached + 1) * width], &response);
            reached += 1;
        }
        add_cost(prediction, &free, pieces, reached, n);
        if step + 1 >= FIRST_STEP {
            add_rows(model, prediction, &free, pieces, step + 1, reached);
        }
    }
    for i in 0..n {
        for j in 0..i {
            pieces.hessian[i * n + j] = pieces.hessian[j * n + i];
        }
    }
}

/// Adds step k's share of the upper triangle of H and of g. The first `reached` variables act on it.
fn add_cost<const N: usize, const D: usize>(
    prediction: &Prediction<'_, N, D>,
    free: &State<N, D>,
    pieces: &mut Pieces<'_>,
    reached: usize,
    n: usize,
) {
    let width = 2 * N + D;
    let weights = &prediction.weights;
    let weigh = |x: &State<N, D>| State::<N, D> {
        joint_position: weights.joint_position * x.joint_position,
        joint_velocity: weights.joint_velocity * x.joint_velocity,
        wrench: {
            let mut weighted = SVector::zeros();
            for &axis in prediction.wrench_axes.as_slice() {
                weighted[axis] = weights.wrench[axis] * x.wrench[axis];
            }
            weighted
        },
    };
    let error = weigh(&State {
        joint_position: free.joint_position - prediction.set_point.joint_position,
        joint_velocity: free.joint_velocity - prediction.set_point.joint_velocity,
        wrench: free.wrench - prediction.set_point.wrench,
    });
    let inner = |a: &State<N, D>, b: &State<N, D>| {
        a.joint_position.dot(&b.joint_position) + a.joint_velocity.dot(&b.joint_velocity) + a.wrench.dot(&b.wrench)
    };
    for i in 0..reached {
        let response_i = load(&pieces.response[i * width..(i + 1) * width]);
        pieces.gradient[i] += inner(&response_i, &error);
        let weighted = weigh(&response_i);
        for j in i..reached {
            let response_j = load(&pieces.response[j * width..(j + 1) * width]);
            pieces.hessian[i * n + j] += inner(&weighted, &response_j);
        }
    }
}

/// Writes the rows of step k: minimum ≤ s f_lin(free_k) + s K_e J S_k z ≤ maximum.
fn add_rows<const N: usize, const D: usize>(
    model: &Model<N, D>,
    prediction: &Prediction<'_, N, D>,
    free: &State<N, D>,
    pieces: &mut Pieces<'_>,
    k: usize,
    reached: usize,
) {
    let width = 2 * N + D;
    let bounds = prediction.bounds.as_slice();
    let n = pieces.gradient.len();
    let force = model.linear_wrench(&free.joint_position);
    for (index, bound) in bounds.iter().enumerate() {
        let row = (k - FIRST_STEP) * bounds.len() + index;
        let gradient = model.wrench_gradient(bound.axis) * bound.sign;
        pieces.lower[row] = bound.minimum - bound.sign * force[bound.axis];
        pieces.upper[row] = bound.maximum - bound.sign * force[bound.axis];
        let coefficients = &mut pieces.matrix[row * n..(row + 1) * n];
        coefficients.fill(0.0);
        for (coefficient, column) in coefficients.iter_mut().zip(pieces.response.chunks_exact(width)).take(reached) {
            *coefficient = column[..N].iter().zip(gradient.iter()).map(|(a, b)| a * b).sum();
        }
    }
}
