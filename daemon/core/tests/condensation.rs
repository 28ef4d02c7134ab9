//! The condensed QP against two other ways to the same problem (18): the cost of simulated trajectories, and the sparse
//! formulation with the states as variables. Its rows against simulation.

mod common;

use admittance_core::condensation::{Capacity, InputAxes, MpcRows, Prediction, Workspace, condense};
use admittance_core::constraints::{AxisBound, Constraints, ForceBounds, Interval, Row, RowKind};
use admittance_core::cost::{SetPoint, Weights};
use admittance_core::horizon::Horizon;
use admittance_core::model::{Discretization, Model, State};
use admittance_core::plan::MAX_STEPS;
use admittance_core::qp::{LANES, QpOutcome, QpSolver, RowState, Rows, kkt_residual, padded};
use admittanced::clarabel_solver::{ClarabelSettings, ClarabelSolver};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::{SMatrix, SVector, Vector2};

const UNIFORM: [f64; 5] = [0.004; 5];
const UNEVEN: [f64; 4] = [0.002, 0.004, 0.003, 0.006];

/// N in one unit of the slack variable.
const SLACK_UNIT: f64 = 100.0;
/// By how much one unit of slack raises the slack's price, relative to it.
const SLACK_CURVATURE: f64 = 0.01;

/// A problem (18) on the paper's arm: in contact with `force` N, approaching at `speed`, the joints moving accordingly
/// times `moving`.
struct Case {
    axes: [bool; 2],
    weights: Weights<2, 2>,
    steps: &'static [f64],
    /// T_est in s.
    estimate: f64,
    force: f64,
    speed: f64,
    moving: f64,
}

struct Problem<const N: usize, const D: usize> {
    model: Model<N, D>,
    horizon: Horizon<N, D>,
    prediction: Prediction<'static, N, D>,
}

impl Case {
    fn problem(&self) -> Problem<2, 2> {
        let parameters = common::parameters();
        let sample = common::pushing(self.force, self.speed, 1);
        let q = sample.joint_position;
        let model = common::model(&parameters, &q);
        let velocity = |twist: &Vector2<f64>| model.jacobian_inverse * twist;
        let initial = State {
            joint_position: q,
            joint_velocity: velocity(&sample.twist_reference) * self.moving,
            // The estimate lags behind.
            wrench: sample.wrench * 0.8,
        };
        let mut bounds = ForceBounds::none();
        for axis in (0..2).filter(|&axis| self.axes[axis]) {
            bounds.push(AxisBound { axis, sign: -1.0, minimum: 0.1, maximum: 200.0 });
        }
        // ṗ0, and on an axis without input an offset that fades: another twist in every step.
        let known_twist = |step: usize| {
            let offset = if self.axes[0] { 0.0 } else { 0.05 / (1.0 + step as f64) };
            sample.twist_reference + Vector2::new(offset, 0.0)
        };
        let known_reference: Vec<_> = (0..self.steps.len()).map(|step| velocity(&known_twist(step))).collect();
        let prediction = Prediction {
            initial,
            known_reference: known_reference.leak(),
            inputs: InputAxes::from_mask(&self.axes),
            previous_input: Vector2::zeros(),
            wrench_axes: InputAxes::from_mask(&self.axes),
            constraints: Constraints::of_force(bounds),
            set_point: SetPoint {
                joint_position: q + Vector2::new(0.002, -0.003),
                joint_velocity: velocity(&sample.twist_reference),
                wrench: Vector2::new(1.0, -2.0),
            },
            weights: Box::leak(Box::new(self.weights)),
            jacobian: parameters.chain.kinematics(&q).task_jacobian(),
            input_weight: Vector2::new(10.0, 15.0),
            slack_price: None,
        };
        let horizon = Horizon::new(
            Discretization::Euler,
            self.steps,
            |_| &[],
            &parameters.velocity_time_constant,
            &Vector2::repeat(self.estimate),
        );
        Problem { model, horizon, prediction }
    }
}

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for axes in [[true, true], [false, true]] {
        for weights in [common::joint_weights(), common::task_weights()] {
            for steps in [&UNIFORM[..], &UNEVEN[..]] {
                for estimate in [0.020, 0.0] {
                    // At ease; pressing near f_max and still going in; hardly touching and leaving.
                    for (force, speed, moving) in [(60.0, 0.05, 0.0), (205.0, 0.04, 0.3), (12.0, -0.03, 0.3)] {
                        cases.push(Case { axes, weights, steps, estimate, force, speed, moving });
                    }
                }
            }
        }
    }
    cases
}

/// Numbers between −1 and 1 that look random and are the same in every run (Knuth's generator for 64 bits).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector<const K: usize>(&mut self, size: f64) -> SVector<f64, K> {
        SVector::from_fn(|_, _| size * self.next())
    }

    fn matrix<const R: usize, const C: usize>(&mut self, size: f64) -> SMatrix<f64, R, C> {
        SMatrix::from_fn(|_, _| size * self.next())
    }

    /// Between a half and one and a half of `size`.
    fn positive<const K: usize>(&mut self, size: f64) -> SVector<f64, K> {
        SVector::from_fn(|_, _| size * (1.0 + 0.5 * self.next()))
    }

    /// With zero inside; the first lower and the last upper bound are missing.
    fn interval<const K: usize>(&mut self, size: f64) -> Interval<K> {
        let mut interval = Interval { lower: -self.positive(size), upper: self.positive(size) };
        interval.lower[0] = f64::NEG_INFINITY;
        interval.upper[K - 1] = if K > 1 { f64::INFINITY } else { size };
        interval
    }
}

/// What an arbitrary problem is made of; the numbers in it come from [`Numbers`].
#[derive(Debug, Clone)]
struct Shape {
    steps: Vec<f64>,
    /// How many axes have an input: the last ones, so that an axis and its position among the inputs differ.
    inputs: usize,
    by_task: bool,
    /// T_est of even and of odd axes in s.
    estimate: [f64; 2],
    slack_price: Option<f64>,
    /// Without the wrench state and the bounded force of one axis, without some task weights.
    partial: bool,
}

/// Parts of the first three steps at which the force is bounded too, if an input reaches them.
const INSIDE: [f64; 2] = [0.25, 0.6];

/// An instant at which the force is bounded.
struct Point {
    step: usize,
    /// Part of the step, up to 1.
    part: f64,
    /// In s from the sample.
    time: f64,
}

impl Shape {
    fn inside(&self, step: usize) -> &'static [f64] {
        if step < 3 { &INSIDE } else { &[] }
    }

    /// Euler: no input reaches the first step.
    fn force_points(&self) -> Vec<Point> {
        let mut points = Vec::new();
        for k in 1..self.steps.len() {
            let start: f64 = self.steps[..k].iter().sum();
            for &part in self.inside(k).iter().chain(&[1.0]) {
                points.push(Point { step: k, part, time: start + part * self.steps[k] });
            }
        }
        points
    }

    fn time_constants<const N: usize, const D: usize>(&self) -> (SVector<f64, N>, SVector<f64, D>) {
        let estimate = |axis: usize| self.estimate[axis % 2] * (1.0 + 0.1 * axis as f64);
        (SVector::from_fn(|i, _| 0.010 + 0.002 * i as f64), SVector::from_fn(|axis, _| estimate(axis)))
    }

    fn problem<const N: usize, const D: usize>(&self, numbers: &mut Numbers) -> Problem<N, D> {
        let initial = State {
            joint_position: numbers.vector(1.0),
            joint_velocity: numbers.vector(0.3),
            wrench: numbers.vector(50.0),
        };
        let wrench_gradient = numbers.matrix(1e4);
        let model = Model::<N, D> {
            jacobian_inverse: numbers.matrix(1.0),
            wrench_gradient,
            wrench_offset: numbers.vector::<D>(100.0) - wrench_gradient.tr_mul(&initial.joint_position),
        };
        let first = D - self.inputs;
        let mut force = ForceBounds::none();
        // From the last to the first: the order of the bounds need not be that of the axes.
        for axis in (first + usize::from(self.partial)..D).rev() {
            let sign = if axis % 2 == 0 { 1.0 } else { -1.0 };
            let minimum = if axis == first { f64::NEG_INFINITY } else { 1.0 + axis as f64 };
            force.push(AxisBound { axis, sign, minimum, maximum: 100.0 + axis as f64 });
        }
        let wrench = numbers.positive(1e-3);
        let weights = if self.by_task {
            let (mut position, mut velocity) = (numbers.positive::<D>(500.0), numbers.positive::<D>(1000.0));
            if self.partial {
                (position[0], position[D - 1], velocity[D / 2]) = (0.0, 0.0, 0.0);
            }
            Weights::Task { position, velocity, wrench }
        } else {
            Weights::Joint { position: numbers.positive(1e3), velocity: numbers.positive(1e3), wrench }
        };
        let known_reference: Vec<SVector<f64, N>> = self.steps.iter().map(|_| numbers.vector(1.0)).collect();
        let prediction = Prediction {
            initial,
            known_reference: known_reference.leak(),
            inputs: InputAxes::from_mask(&std::array::from_fn(|axis| axis >= first)),
            previous_input: numbers.vector(0.5),
            wrench_axes: InputAxes::from_mask(&std::array::from_fn(|axis| {
                axis >= first && !(self.partial && axis == D - 1)
            })),
            constraints: Constraints {
                force,
                joint_speed: Some(numbers.interval(3.0)),
                joint_position: Some(numbers.interval(2.0)),
                offset: Some(numbers.interval(0.5)),
                rate: Some(numbers.interval(20.0)),
            },
            set_point: SetPoint {
                joint_position: initial.joint_position + numbers.vector::<N>(0.01),
                joint_velocity: numbers.vector(0.3),
                wrench: numbers.vector(5.0),
            },
            weights: Box::leak(Box::new(weights)),
            jacobian: numbers.matrix(1.0),
            input_weight: numbers.positive(10.0),
            slack_price: self.slack_price,
        };
        let (velocity, estimate) = self.time_constants();
        let horizon = Horizon::new(Discretization::Euler, &self.steps, |step| self.inside(step), &velocity, &estimate);
        Problem { model, horizon, prediction }
    }
}

/// Every number of inputs up to six, over steps that fill groups of [`LANES`] and do not.
fn shapes() -> Vec<Shape> {
    let mut shapes = Vec::new();
    let estimates = [[0.020, 0.030], [0.020, 0.0], [0.0, 0.0]];
    for inputs in 1..=6 {
        for steps in [1, 2, 3, 5, 8] {
            let even = vec![0.004; steps];
            let uneven: Vec<_> = (0..steps).map(|step| UNEVEN[step % UNEVEN.len()]).collect();
            for steps in [even, uneven] {
                for (by_task, partial) in [(false, false), (false, true), (true, false), (true, true)] {
                    let estimate = estimates[shapes.len() % estimates.len()];
                    let slack_price = (by_task != partial).then_some(30.0);
                    shapes.push(Shape { steps: steps.clone(), inputs, by_task, estimate, slack_price, partial });
                }
            }
        }
    }
    shapes
}

impl<const N: usize, const D: usize> Problem<N, D> {
    /// Q: blocks on q and q̇, diagonal on f̂.
    fn weights(&self) -> (SMatrix<f64, N, N>, SMatrix<f64, N, N>, SVector<f64, D>) {
        let jacobian = self.prediction.jacobian;
        let task = |w: &SVector<f64, D>| jacobian.transpose() * SMatrix::<f64, D, D>::from_diagonal(w) * jacobian;
        match self.prediction.weights {
            Weights::Joint { position, velocity, wrench } => {
                (SMatrix::from_diagonal(position), SMatrix::from_diagonal(velocity), *wrench)
            }
            Weights::Task { position, velocity, wrench } => (task(position), task(velocity), *wrench),
        }
    }

    /// The joint velocity reference in step `step` under the inputs `z`, in the order of time.
    fn reference(&self, z: &[f64], step: usize) -> SVector<f64, N> {
        self.prediction.known_reference[step] + self.model.jacobian_inverse * self.input(z, step)
    }

    /// u_k by task axis.
    fn input(&self, z: &[f64], step: usize) -> SVector<f64, D> {
        let (axes, mut twist) = (self.prediction.inputs.as_slice(), SVector::zeros());
        for (index, &axis) in axes.iter().enumerate() {
            twist[axis] = z[step * axes.len() + index];
        }
        twist
    }

    /// x_0, …, x_H under the inputs `z`, in the order of time.
    fn trajectory(&self, z: &[f64]) -> Vec<State<N, D>> {
        let mut states = vec![self.prediction.initial];
        for (k, step) in self.horizon.steps().iter().enumerate() {
            states.push(self.model.advance(step, &states[k], &self.reference(z, k)));
        }
        states
    }
}

/// What [`condense`] wrote, in the order of time: column a + m·k is input a of step k, and the last one the slack.
struct Condensed {
    /// n×n.
    hessian: Vec<Vec<f64>>,
    gradient: Vec<f64>,
}

/// Where the variables, in the order of time, stand in the QP.
fn order<const N: usize, const D: usize, const M: usize>(rows: &MpcRows<'_, N, D, M>, steps: usize) -> Vec<usize> {
    let inputs = (0..steps).flat_map(|step| rows.inputs_of(step));
    inputs.chain(steps * M..rows.variables()).collect()
}

fn condensed<const N: usize, const D: usize, const M: usize>(problem: &Problem<N, D>) -> Condensed {
    let rows = MpcRows::<N, D, M>::new(&problem.model, &problem.horizon, &problem.prediction).expect("M inputs");
    let mut workspace = workspace(&problem.horizon, problem.prediction.weights);
    let mut pieces = workspace.pieces(&rows).expect("within capacity");
    condense(&rows, &mut pieces);
    let (qp, _, _) = pieces.split(&rows);
    let order = order(&rows, problem.horizon.steps().len());
    let entry = |i: usize, j: usize| qp.hessian[i.min(j) * qp.stride + i.max(j)];
    assert!(qp.gradient[qp.variables..].iter().all(|g| *g == 0.0), "g beyond the variables: {:?}", qp.gradient);
    Condensed {
        hessian: order.iter().map(|&i| order.iter().map(|&j| entry(i, j)).collect()).collect(),
        gradient: order.iter().map(|&i| qp.gradient[i]).collect(),
    }
}

fn workspace<const N: usize, const D: usize>(horizon: &Horizon<N, D>, weights: &Weights<N, D>) -> Workspace<Vec<f64>> {
    let capacity = Capacity::new::<N, D>(horizon.steps().len());
    // What an earlier cycle left must not show.
    Workspace::new(horizon, weights, vec![f64::NAN; capacity.storage_len()]).expect("long enough")
}

/// Half of (18a) under the inputs `z`, in the order of time, by simulation; with the price of the slack.
fn cost<const N: usize, const D: usize>(problem: &Problem<N, D>, z: &[f64]) -> f64 {
    let p = &problem.prediction;
    let (on_position, on_velocity, on_wrench) = problem.weights();
    let mut cost = 0.0;
    for k in 0..problem.horizon.steps().len() {
        let u = problem.input(z, k);
        cost += u.dot(&u.component_mul(&p.input_weight));
    }
    for x in &problem.trajectory(z)[1..] {
        let (dq, dv) = (x.joint_position - p.set_point.joint_position, x.joint_velocity - p.set_point.joint_velocity);
        cost += dq.dot(&(on_position * dq)) + dv.dot(&(on_velocity * dv));
        for &axis in p.wrench_axes.as_slice() {
            cost += on_wrench[axis] * (x.wrench[axis] - p.set_point.wrench[axis]).powi(2);
        }
    }
    let slack = p.slack_price.map_or(0.0, |price| {
        let units = z.last().expect("the slack is a variable");
        price * SLACK_UNIT * units * (1.0 + 0.5 * SLACK_CURVATURE * units)
    });
    0.5 * cost + slack
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()))
}

fn assert_is_that_of_the_cost<const N: usize, const D: usize>(problem: &Problem<N, D>, what: &str) {
    // Central differences of a quadratic are exact for any step; a large one keeps rounding small.
    const STEP: f64 = 0.5;
    let Condensed { hessian, gradient } = match problem.prediction.inputs.as_slice().len() {
        1 => condensed::<N, D, 1>(problem),
        2 => condensed::<N, D, 2>(problem),
        3 => condensed::<N, D, 3>(problem),
        4 => condensed::<N, D, 4>(problem),
        5 => condensed::<N, D, 5>(problem),
        6 => condensed::<N, D, 6>(problem),
        inputs => panic!("{what}: {inputs} inputs"),
    };
    let n = gradient.len();
    // a e_i + b e_j in units of STEP.
    let at = |i: usize, a: f64, j: usize, b: f64| {
        let mut z = vec![0.0; n];
        z[i] += a * STEP;
        z[j] += b * STEP;
        cost(problem, &z)
    };
    let scale = hessian.iter().fold(0.0_f64, |scale, row| scale.max(largest(row)));
    let bound = 1e-9 * (largest(&gradient) + scale);
    for i in 0..n {
        let slope = (at(i, 1.0, i, 0.0) - at(i, -1.0, i, 0.0)) / (2.0 * STEP);
        assert!((gradient[i] - slope).abs() <= bound, "{what}, g[{i}] = {}, not {slope}", gradient[i]);
        for (j, &found) in hessian[i].iter().enumerate().skip(i) {
            let with = |a: f64, b: f64| at(i, a, j, b);
            let sum = with(1.0, 1.0) - with(1.0, -1.0) - with(-1.0, 1.0) + with(-1.0, -1.0);
            let curvature = sum / (4.0 * STEP * STEP);
            assert!((found - curvature).abs() <= 1e-9 * scale, "{what}, H[{i},{j}] = {found}, not {curvature}");
        }
    }
}

#[test]
fn gradient_and_hessian_are_those_of_the_simulated_cost() {
    for (index, case) in cases().iter().enumerate() {
        let mut problem = case.problem();
        for slack_price in [None, Some(30.0)] {
            problem.prediction.slack_price = slack_price;
            assert_is_that_of_the_cost(&problem, &format!("case {index}, slack {slack_price:?}"));
        }
    }
}

#[test]
fn gradient_and_hessian_are_those_of_the_simulated_cost_for_any_number_of_joints_and_inputs() {
    let mut numbers = Numbers(1);
    for shape in shapes() {
        if shape.inputs <= 2 {
            assert_is_that_of_the_cost(&shape.problem::<2, 2>(&mut numbers), &format!("two joints, {shape:?}"));
        }
        assert_is_that_of_the_cost(&shape.problem::<6, 6>(&mut numbers), &format!("six joints, {shape:?}"));
        assert_is_that_of_the_cost(&shape.problem::<7, 6>(&mut numbers), &format!("seven joints, {shape:?}"));
    }
    // The longest.
    for (steps, inputs, by_task) in [(MAX_STEPS, 6, false), (MAX_STEPS, 3, false), (16, 3, true)] {
        let (steps, estimate) = (vec![0.004; steps], [0.020, 0.030]);
        let shape = Shape { steps, inputs, by_task, estimate, slack_price: Some(30.0), partial: false };
        assert_is_that_of_the_cost(&shape.problem::<6, 6>(&mut numbers), &format!("{shape:?}"));
    }
}

/// The inputs that solve the sparse problem: variables [x_1; …; x_H; u_0; …], the dynamics as equalities. Positions are
/// relative to x_0, to keep the constant of f_lin (tens of kilonewtons) out of the solver's tolerance.
fn sparse_solution(problem: &Problem<2, 2>) -> Vec<f64> {
    const STATE: usize = 6;
    let (model, p) = (&problem.model, &problem.prediction);
    let linear = Model { wrench_offset: Vector2::zeros(), ..*model };
    let (axes, bounds) = (p.inputs.as_slice(), p.constraints.force.as_slice());
    let (h, m) = (problem.horizon.steps().len(), axes.len());
    let (inputs_at, n) = (h * STATE, h * STATE + h * m);
    let zero = SVector::<f64, 2>::zeros();
    let relative = |x: &State<2, 2>| -> [f64; STATE] {
        let q = x.joint_position - p.initial.joint_position;
        [q.x, q.y, x.joint_velocity.x, x.joint_velocity.y, x.wrench.x, x.wrench.y]
    };
    let absolute = |x: [f64; STATE]| State::<2, 2> {
        joint_position: p.initial.joint_position + Vector2::new(x[0], x[1]),
        joint_velocity: Vector2::new(x[2], x[3]),
        wrench: Vector2::new(x[4], x[5]),
    };
    let flat = |x: &State<2, 2>| -> [f64; STATE] {
        let (q, v, f) = (x.joint_position, x.joint_velocity, x.wrench);
        [q.x, q.y, v.x, v.y, f.x, f.y]
    };
    let unit = |i: usize| -> [f64; STATE] { std::array::from_fn(|row| if row == i { 1.0 } else { 0.0 }) };

    let mut rows: Vec<(Vec<f64>, f64)> = Vec::new();
    for (k, step) in problem.horizon.steps().iter().enumerate() {
        // x_{k+1} = advance(x_k, known + u_k), its parts found by evaluating the model at unit vectors.
        let constant = relative(&model.advance(step, &absolute([0.0; STATE]), &p.known_reference[k]));
        let responses: [[f64; STATE]; STATE] = std::array::from_fn(|i| {
            let mut unit_state = absolute(unit(i));
            unit_state.joint_position -= p.initial.joint_position;
            flat(&linear.advance(step, &unit_state, &zero))
        });
        let driven: Vec<[f64; STATE]> = axes
            .iter()
            .map(|&axis| {
                let reference = model.jacobian_inverse.column(axis).into_owned();
                flat(&linear.advance(step, &State::zeros(), &reference))
            })
            .collect();
        let start = relative(&p.initial);
        for row in 0..STATE {
            let (mut coefficients, mut right) = (vec![0.0; n], constant[row]);
            coefficients[k * STATE + row] = 1.0;
            for i in 0..STATE {
                if k == 0 {
                    right += responses[i][row] * start[i];
                } else {
                    coefficients[(k - 1) * STATE + i] -= responses[i][row];
                }
            }
            for (index, response) in driven.iter().enumerate() {
                coefficients[inputs_at + k * m + index] -= response[row];
            }
            rows.push((coefficients, right));
        }
    }
    let equalities = rows.len();
    let now = model.linear_wrench(&p.initial.joint_position);
    for k in 2..=h {
        for bound in bounds {
            let gradient = model.wrench_gradient.column(bound.axis) * bound.sign;
            let force = bound.sign * now[bound.axis];
            for (side, limit) in [(1.0, bound.maximum), (-1.0, bound.minimum)] {
                let mut coefficients = vec![0.0; n];
                for joint in 0..2 {
                    coefficients[(k - 1) * STATE + joint] = side * gradient[joint];
                }
                rows.push((coefficients, side * (limit - force)));
            }
        }
    }

    let (mut hessian, mut gradient) = (vec![vec![0.0; n]; n], vec![0.0; n]);
    let set_point = relative(&State {
        joint_position: p.set_point.joint_position,
        joint_velocity: p.set_point.joint_velocity,
        wrench: p.set_point.wrench,
    });
    let mut q = [[0.0; STATE]; STATE];
    let (on_position, on_velocity, on_wrench) = problem.weights();
    for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        q[row][column] = on_position[(row, column)];
        q[2 + row][2 + column] = on_velocity[(row, column)];
    }
    for &axis in p.wrench_axes.as_slice() {
        q[4 + axis][4 + axis] = on_wrench[axis];
    }
    for k in 0..h {
        for (row, weights) in q.iter().enumerate() {
            hessian[k * STATE + row][k * STATE..(k + 1) * STATE].copy_from_slice(weights);
            gradient[k * STATE + row] = -weights.iter().zip(set_point).map(|(weight, x)| weight * x).sum::<f64>();
        }
        for (index, &axis) in axes.iter().enumerate() {
            let at = inputs_at + k * m + index;
            hessian[at][at] = p.input_weight[axis];
        }
    }

    let dense = |rows: &[Vec<f64>], upper: bool| {
        let (mut starts, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
        for column in 0..n {
            for (row, coefficients) in rows.iter().enumerate().filter(|(row, _)| !upper || *row <= column) {
                if coefficients[column] != 0.0 {
                    indices.push(row);
                    values.push(coefficients[column]);
                }
            }
            starts.push(indices.len());
        }
        CscMatrix::new(rows.len(), n, starts, indices, values)
    };
    let (matrix, right): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
    let cones = [SupportedConeT::ZeroConeT(equalities), SupportedConeT::NonnegativeConeT(right.len() - equalities)];
    let settings = DefaultSettings {
        verbose: false,
        tol_gap_abs: 1e-11,
        tol_gap_rel: 1e-11,
        tol_feas: 1e-11,
        max_iter: 200,
        ..DefaultSettings::default()
    };
    let mut solver =
        DefaultSolver::new(&dense(&hessian, true), &gradient, &dense(&matrix, false), &right, &cones, settings)
            .expect("a convex problem");
    solver.solve();
    assert!(
        matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved),
        "sparse formulation: {:?}",
        solver.solution.status
    );
    solver.solution.x[inputs_at..].to_vec()
}

/// Both solvers on the condensed problem; the inputs in the order of time and the multipliers of the first.
fn condensed_solutions<const M: usize>(problem: &Problem<2, 2>, what: &str) -> ([Vec<f64>; 2], Vec<f64>) {
    let rows = MpcRows::<2, 2, M>::new(&problem.model, &problem.horizon, &problem.prediction).expect("M inputs");
    let mut workspace = workspace(&problem.horizon, problem.prediction.weights);
    let mut pieces = workspace.pieces(&rows).expect("within capacity");
    condense(&rows, &mut pieces);
    pieces.answer.working.fill(RowState::Inactive);
    let (qp, mut answer, scratch) = pieces.split(&rows);
    let settings = ClarabelSettings { tolerance: 1e-10, max_iterations: 100 };
    let mut clarabel = ClarabelSolver::new([(qp.variables, qp.row_count)], settings);
    let mut multipliers = Vec::new();
    let mut solve = |solver: &mut dyn QpSolver, tolerance: f64| {
        let outcome = solver.solve(&qp, &mut answer, &mut || false);
        assert!(matches!(outcome, QpOutcome::Solved { .. }), "{what}: {outcome:?}");
        let residual = kkt_residual(&qp, answer.z, answer.multipliers, scratch);
        assert!(residual.is_within(tolerance), "{what}: {residual:?}");
        multipliers = answer.multipliers[..qp.row_count].to_vec();
        (0..problem.horizon.steps().len()).flat_map(|step| answer.z[rows.inputs_of(step)].to_vec()).collect()
    };
    let by_clarabel = solve(&mut clarabel, 1e-6);
    let by_active_set = solve(&mut common::active_set(), 1e-11);
    ([by_active_set, by_clarabel], multipliers)
}

#[test]
fn the_condensed_inputs_are_those_of_the_sparse_formulation() {
    // Rows with a multiplier, by number of inputs and side: the cases must reach every kind of bound.
    let mut pushed = [[0; 2]; 2];
    for (index, case) in cases().iter().enumerate() {
        let (problem, what) = (case.problem(), format!("case {index}"));
        let inputs = problem.prediction.inputs.as_slice().len();
        let (solutions, multipliers) = match inputs {
            1 => condensed_solutions::<1>(&problem, &what),
            _ => condensed_solutions::<2>(&problem, &what),
        };
        for y in multipliers.iter().filter(|y| y.abs() > 1e-4) {
            pushed[inputs - 1][usize::from(*y > 0.0)] += 1;
        }
        let expected = sparse_solution(&problem);
        for (solver, found) in ["active set", "Clarabel"].iter().zip(&solutions) {
            for (z, expected) in found.iter().zip(&expected) {
                assert!((z - expected).abs() <= 1e-6, "{what}, {solver}: {found:?}\nnot {expected}");
            }
        }
    }
    assert!(pushed.iter().flatten().all(|&rows| rows > 0), "[inputs - 1][lower, upper] rows at a bound: {pushed:?}");
}

/// A quantity that a row bounds, in the row's unit.
struct Bounded {
    row: Row,
    value: f64,
    lower: f64,
    upper: f64,
}

/// Everything that is bounded under the inputs `z`, in the order of time, by simulation; in the order of the rows.
fn bounded<const N: usize, const D: usize>(shape: &Shape, problem: &Problem<N, D>, z: &[f64]) -> Vec<Bounded> {
    let (p, steps) = (&problem.prediction, &shape.steps);
    let (c, h) = (&p.constraints, steps.len());
    let (speed, position) = (c.joint_speed.expect("all kinds"), c.joint_position.expect("all kinds"));
    let (offset, rate) = (c.offset.expect("all kinds"), c.rate.expect("all kinds"));
    let (velocity_constant, estimate) = shape.time_constants();
    let states = problem.trajectory(z);
    let mut all = Vec::new();
    let mut push = |kind, component, instant, value, lower, upper| {
        all.push(Bounded { row: Row { kind, component, instant }, value, lower, upper });
    };
    for k in 0..h {
        let value = problem.reference(z, k);
        (0..N).for_each(|i| push(RowKind::JointSpeed, i, k, value[i], speed.lower[i], speed.upper[i]));
    }
    for k in 0..h {
        for &axis in p.inputs.as_slice() {
            push(RowKind::Offset, axis, k, problem.input(z, k)[axis], offset.lower[axis], offset.upper[axis]);
        }
    }
    for k in 0..h {
        let (before, since) =
            if k == 0 { (p.previous_input, steps[0]) } else { (problem.input(z, k - 1), steps[k - 1]) };
        for &axis in p.inputs.as_slice() {
            let value = problem.input(z, k)[axis] - before[axis];
            push(RowKind::Rate, axis, k, value, rate.lower[axis] * since, rate.upper[axis] * since);
        }
    }
    // Euler: no input moves a joint before the end of the second step.
    for k in 1..h {
        let value = states[k + 1].joint_position;
        (0..N).for_each(|i| push(RowKind::JointPosition, i, k, value[i], position.lower[i], position.upper[i]));
    }
    let slack = p.slack_price.map(|_| *z.last().expect("the slack is a variable"));
    for (instant, &Point { step: k, part, .. }) in shape.force_points().iter().enumerate() {
        let to_here = Discretization::Euler.step(part * steps[k], &velocity_constant, &estimate);
        let there = problem.model.advance(&to_here, &states[k], &problem.reference(z, k));
        let force = problem.model.linear_wrench(&there.joint_position);
        for bound in c.force.as_slice() {
            // What is softened are the upper bounds.
            let lower = if slack.is_some() { f64::NEG_INFINITY } else { bound.minimum };
            let value = bound.sign * force[bound.axis] - SLACK_UNIT * slack.unwrap_or(0.0);
            push(RowKind::Force, bound.axis, instant, value, lower, bound.maximum);
        }
    }
    if let Some(slack) = slack {
        push(RowKind::Slack, 0, 0, slack, 0.0, f64::INFINITY);
    }
    all
}

/// Rounding of a row's value. The force is a difference of terms of 1e4 N/rad times radians.
fn rounding(row: &Row) -> f64 {
    if row.kind == RowKind::Force { 1e-9 } else { 1e-13 }
}

/// The rows of an arbitrary problem, of every kind at once, against [`bounded`].
fn check_rows<const N: usize, const D: usize, const M: usize>(shape: &Shape, numbers: &mut Numbers) {
    let problem = shape.problem::<N, D>(numbers);
    let what = format!("{N} joints, {shape:?}");
    let rows = MpcRows::<N, D, M>::new(&problem.model, &problem.horizon, &problem.prediction).expect("M inputs");
    let mut workspace = workspace(&problem.horizon, problem.prediction.weights);
    let mut pieces = workspace.pieces(&rows).expect("within capacity");
    condense(&rows, &mut pieces);
    let (qp, _, _) = pieces.split(&rows);
    let (n, count, stride) = (qp.variables, qp.row_count, qp.stride);

    let mut z = vec![0.0; stride];
    z[..n].iter_mut().for_each(|z| *z = numbers.next());
    let in_time: Vec<f64> = order(&rows, shape.steps.len()).iter().map(|&at| z[at]).collect();
    let (all, free) = (bounded(shape, &problem, &in_time), bounded(shape, &problem, &vec![0.0; n]));
    assert_eq!((count, rows.layout.rows()), (all.len(), all.len()), "{what}");
    let values_of = |z: &[f64]| {
        let mut values = vec![f64::NAN; padded(count)];
        rows.values(z, &mut values);
        values
    };
    let values = values_of(&z);
    // A by columns.
    let columns: Vec<Vec<f64>> = (0..n)
        .map(|column| {
            let mut unit = vec![0.0; stride];
            unit[column] = 1.0;
            values_of(&unit)
        })
        .collect();
    let (multipliers, before) = (numbers_of(count, numbers), numbers_of(stride, numbers));
    let mut transposed = before.clone();
    for (number, (with_inputs, without)) in all.iter().zip(&free).enumerate() {
        let Bounded { row, value: quantity, lower, upper } = with_inputs;
        let (what, rounding) = (format!("row {number}, {row:?}; {what}"), rounding(row));
        assert_eq!(rows.layout.row(number), *row, "{what}");

        let (value, expected) = (values[number], quantity - without.value);
        assert!((value - expected).abs() <= rounding, "A z = {value}, not {expected}: {what}");

        for (found, bound) in [(qp.lower[number], *lower), (qp.upper[number], *upper)] {
            let (slack, expected) = (found - value, bound - quantity);
            assert!(
                slack == expected || (slack - expected).abs() <= rounding,
                "{slack} to the bound {bound}, not {expected}: {what}"
            );
        }
        let large = [*lower, *upper].into_iter().filter(|bound| bound.is_finite()).map(f64::abs).fold(0.0, f64::max);
        let weight = if large > 0.0 { 1.0 / large } else { 1.0 };
        assert!((qp.weight[number] / weight - 1.0).abs() <= 1e-12, "weight {}: {what}", qp.weight[number]);

        let mut coefficients = vec![f64::NAN; stride];
        let first = rows.coefficients(number, &mut coefficients);
        assert!(first % LANES == 0 && coefficients[..first].iter().all(|a| a.is_nan()), "from {first}: {what}");
        assert!(columns[..first].iter().all(|column| column[number] == 0.0), "zero before {first}: {what}");
        assert!(coefficients[n..].iter().all(|a| *a == 0.0), "zero beyond {n}: {what}");
        coefficients[..first].fill(0.0);
        let size = largest(&coefficients);
        for (column, (found, expected)) in coefficients.iter().zip(&columns).enumerate() {
            let expected = expected[number];
            assert!((found - expected).abs() <= 1e-13 * size, "A[.., {column}] = {found}, not {expected}: {what}");
        }
        let sum: f64 = coefficients.iter().zip(&z).map(|(a, z)| a * z).sum();
        assert!((sum - value).abs() <= 1e-12 * size, "{sum}, not {value}: {what}");
        transposed.iter_mut().zip(&coefficients).for_each(|(sum, a)| *sum += multipliers[number] * a);
    }
    let beyond = |bounds: &[f64], missing: f64| bounds[count..].iter().all(|bound| *bound == missing);
    assert!(beyond(qp.lower, f64::NEG_INFINITY) && beyond(qp.upper, f64::INFINITY), "bounds beyond the rows: {what}");
    assert!([qp.lower, qp.upper, qp.weight].iter().all(|bounds| bounds.len() == padded(count)), "{what}");

    let mut found = before;
    rows.add_transposed(&multipliers, &mut found);
    let size = largest(&transposed);
    for (column, (found, expected)) in found.iter().zip(&transposed).enumerate() {
        assert!((found - expected).abs() <= 1e-12 * size, "(Aᵀ y)[{column}] = {found}, not {expected}: {what}");
    }

    // What else there is by row number.
    let forces: Vec<usize> = (0..count).filter(|&number| all[number].row.kind == RowKind::Force).collect();
    assert!(forces.iter().copied().eq(rows.force_rows()), "{:?}, not {forces:?}: {what}", rows.force_rows());
    let points = shape.force_points();
    for number in forces {
        let (axis, time) = rows.force_row(number);
        let Row { component, instant, .. } = all[number].row;
        let expected = points[instant].time;
        assert!(axis == component && (time - expected).abs() <= 1e-15, "axis {axis} at {time} s: {what}");
    }
    let slack = if shape.slack_price.is_some() { SLACK_UNIT * z[n - 1] } else { 0.0 };
    assert_eq!(rows.slack(&z).to_bits(), slack.to_bits(), "{what}");
}

fn numbers_of(count: usize, numbers: &mut Numbers) -> Vec<f64> {
    (0..count).map(|_| numbers.next()).collect()
}

#[test]
fn rows_are_those_of_the_simulated_trajectory() {
    let mut numbers = Numbers(2);
    for shape in shapes() {
        match shape.inputs {
            1 => {
                check_rows::<2, 2, 1>(&shape, &mut numbers);
                check_rows::<6, 6, 1>(&shape, &mut numbers);
            }
            2 => check_rows::<2, 2, 2>(&shape, &mut numbers),
            3 => check_rows::<6, 6, 3>(&shape, &mut numbers),
            6 => {
                check_rows::<6, 6, 6>(&shape, &mut numbers);
                check_rows::<7, 6, 6>(&shape, &mut numbers);
            }
            _ => {}
        }
    }
    let longest = Shape {
        steps: vec![0.004; MAX_STEPS],
        inputs: 6,
        by_task: false,
        estimate: [0.020, 0.030],
        slack_price: Some(30.0),
        partial: false,
    };
    check_rows::<6, 6, 6>(&longest, &mut numbers);
}
