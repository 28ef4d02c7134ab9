//! The condensed QP against two other ways to the same problem (18): the cost of simulated trajectories, and the sparse
//! formulation with the states as variables.

mod common;

use admittance_core::condensation::{Capacity, InputAxes, Prediction, Workspace, condense};
use admittance_core::constraints::{AxisBound, ForceBounds};
use admittance_core::cost::{SetPoint, Weights};
use admittance_core::model::{Model, State};
use admittance_core::qp::{QpOutcome, QpSolver, kkt_residual};
use admittanced::clarabel_solver::{ClarabelSettings, ClarabelSolver};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::{SVector, Vector2};

const UNIFORM: [f64; 5] = [0.004; 5];
const UNEVEN: [f64; 4] = [0.002, 0.004, 0.003, 0.006];

/// A problem (18): in contact with `force` N, approaching at `speed`, the joints moving accordingly times `moving`.
struct Case {
    axes: [bool; 2],
    weights: Weights<2, 2>,
    steps: &'static [f64],
    force: f64,
    speed: f64,
    moving: f64,
}

struct Problem {
    model: Model<2, 2>,
    prediction: Prediction<'static, 2, 2>,
}

impl Case {
    fn problem(&self) -> Problem {
        let parameters = common::parameters();
        let sample = common::pushing(self.force, self.speed, 1);
        let q = sample.joint_position;
        let model = common::model(&parameters, &q);
        let velocity = |twist: &Vector2<f64>| model.input_direction(0) * twist.x + model.input_direction(1) * twist.y;
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
        let fading = |step: usize| {
            let offset = if self.axes[0] { 0.0 } else { 0.05 / (1.0 + step as f64) };
            sample.twist_reference + Vector2::new(offset, 0.0)
        };
        let known: Vec<_> = (0..self.steps.len()).map(fading).collect();
        let prediction = Prediction {
            initial,
            steps: self.steps,
            known_twist: known.leak(),
            inputs: InputAxes::from_mask(&self.axes),
            wrench_axes: InputAxes::from_mask(&self.axes),
            bounds,
            set_point: SetPoint {
                joint_position: q + Vector2::new(0.002, -0.003),
                joint_velocity: velocity(&sample.twist_reference),
                wrench: Vector2::new(1.0, -2.0),
            },
            weights: self.weights.at(&parameters.chain.kinematics(&q).task_jacobian()),
            input_weight: Vector2::new(10.0, 15.0),
        };
        Problem { model, prediction }
    }
}

/// What [`condense`] wrote, as matrices.
struct Condensed {
    /// n×n, row-major.
    hessian: Vec<f64>,
    gradient: Vec<f64>,
}

fn storage(steps: usize) -> (Capacity, Vec<f64>) {
    let capacity = Capacity::new::<2, 2>(steps);
    // What an earlier cycle left must not show.
    (capacity, vec![f64::NAN; capacity.storage_len()])
}

fn condensed(problem: &Problem) -> Condensed {
    let (capacity, storage) = storage(problem.prediction.steps.len());
    let mut workspace = Workspace::new(capacity, storage).expect("long enough");
    let (n, rows) = problem.prediction.size();
    let mut pieces = workspace.pieces(n, rows).expect("within capacity");
    condense(&problem.model, &problem.prediction, &mut pieces);
    let (qp, _) = pieces.split();
    Condensed { hessian: qp.hessian.to_vec(), gradient: qp.gradient.to_vec() }
}

/// Half of (18a) under the inputs `z`, by simulation.
fn cost(problem: &Problem, z: &[f64]) -> f64 {
    let (p, axes) = (&problem.prediction, problem.prediction.inputs.as_slice());
    let (mut x, mut cost) = (p.initial, 0.0);
    for (step, &duration) in p.steps.iter().enumerate() {
        let mut twist = p.known_twist[step];
        for (index, &axis) in axes.iter().enumerate() {
            let u = z[step * axes.len() + index];
            twist[axis] += u;
            cost += u * p.input_weight[axis] * u;
        }
        x = problem.model.advance(duration, &x, &twist);
        let (dq, dv) = (x.joint_position - p.set_point.joint_position, x.joint_velocity - p.set_point.joint_velocity);
        cost += dq.dot(&(p.weights.joint_position * dq)) + dv.dot(&(p.weights.joint_velocity * dv));
        for &axis in p.wrench_axes.as_slice() {
            cost += p.weights.wrench[axis] * (x.wrench[axis] - p.set_point.wrench[axis]).powi(2);
        }
    }
    0.5 * cost
}

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for axes in [[true, true], [false, true]] {
        for weights in [common::joint_weights(), common::task_weights()] {
            for steps in [&UNIFORM[..], &UNEVEN[..]] {
                // At ease; pressing near f_max and still going in; hardly touching and leaving.
                for (force, speed, moving) in [(60.0, 0.05, 0.0), (205.0, 0.04, 0.3), (12.0, -0.03, 0.3)] {
                    cases.push(Case { axes, weights, steps, force, speed, moving });
                }
            }
        }
    }
    cases
}

#[test]
fn gradient_and_hessian_are_those_of_the_simulated_cost() {
    // Central differences of a quadratic are exact for any step; a large one keeps rounding small.
    const STEP: f64 = 0.5;
    for (index, case) in cases().iter().enumerate() {
        let problem = case.problem();
        let Condensed { hessian, gradient } = condensed(&problem);
        let n = gradient.len();
        // a e_i + b e_j in units of STEP.
        let at = |i: usize, a: f64, j: usize, b: f64| {
            let mut z = vec![0.0; n];
            z[i] += a * STEP;
            z[j] += b * STEP;
            cost(&problem, &z)
        };
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let scale = largest(&hessian);
        for i in 0..n {
            let slope = (at(i, 1.0, i, 0.0) - at(i, -1.0, i, 0.0)) / (2.0 * STEP);
            let bound = 1e-9 * (largest(&gradient) + scale);
            assert!((gradient[i] - slope).abs() <= bound, "case {index}, g[{i}] = {}, not {slope}", gradient[i]);
            for j in 0..n {
                let with = |a: f64, b: f64| at(i, a, j, b);
                let sum = with(1.0, 1.0) - with(1.0, -1.0) - with(-1.0, 1.0) + with(-1.0, -1.0);
                let (curvature, found) = (sum / (4.0 * STEP * STEP), hessian[i * n + j]);
                assert!(
                    (found - curvature).abs() <= 1e-9 * scale,
                    "case {index}, H[{i},{j}] = {found}, not {curvature}"
                );
            }
        }
    }
}

/// The inputs that solve the sparse problem: variables [x_1; …; x_H; u_0; …], the dynamics as equalities. Positions are
/// relative to x_0, to keep the constant of f_lin (tens of kilonewtons) out of the solver's tolerance.
fn sparse_solution(problem: &Problem) -> Vec<f64> {
    const STATE: usize = 6;
    let (model, p) = (&problem.model, &problem.prediction);
    let (axes, bounds) = (p.inputs.as_slice(), p.bounds.as_slice());
    let (h, m) = (p.steps.len(), axes.len());
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
    let unit = |i: usize| -> [f64; STATE] { std::array::from_fn(|row| if row == i { 1.0 } else { 0.0 }) };

    let mut rows: Vec<(Vec<f64>, f64)> = Vec::new();
    for (k, &duration) in p.steps.iter().enumerate() {
        // x_{k+1} = advance(x_k, known + u_k), its parts found by evaluating the model at unit vectors.
        let constant = relative(&model.advance(duration, &absolute([0.0; STATE]), &p.known_twist[k]));
        let responses: [[f64; STATE]; STATE] = std::array::from_fn(|i| {
            let mut unit_state = absolute(unit(i));
            unit_state.joint_position -= p.initial.joint_position;
            let response = model.advance_linear(duration, &unit_state, &zero);
            let (q, v, f) = (response.joint_position, response.joint_velocity, response.wrench);
            [q.x, q.y, v.x, v.y, f.x, f.y]
        });
        let driven: Vec<[f64; STATE]> = axes
            .iter()
            .map(|&axis| {
                let x = model.advance_linear(duration, &State::zeros(), &model.input_direction(axis));
                let (q, v, f) = (x.joint_position, x.joint_velocity, x.wrench);
                [q.x, q.y, v.x, v.y, f.x, f.y]
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
            let gradient = model.wrench_gradient(bound.axis) * bound.sign;
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
    for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        q[row][column] = p.weights.joint_position[(row, column)];
        q[2 + row][2 + column] = p.weights.joint_velocity[(row, column)];
    }
    for &axis in p.wrench_axes.as_slice() {
        q[4 + axis][4 + axis] = p.weights.wrench[axis];
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

#[test]
fn the_condensed_inputs_are_those_of_the_sparse_formulation() {
    // Rows with a multiplier, by number of inputs and side: the cases must reach every kind of bound.
    let mut pushed = [[0; 2]; 2];
    for (index, case) in cases().iter().enumerate() {
        let problem = case.problem();
        let p = &problem.prediction;
        let (capacity, storage) = storage(p.steps.len());
        let mut workspace = Workspace::new(capacity, storage).expect("long enough");
        let (n, rows) = p.size();
        let mut pieces = workspace.pieces(n, rows).expect("within capacity");
        condense(&problem.model, p, &mut pieces);
        let (qp, mut answer) = pieces.split();
        let settings = ClarabelSettings { tolerance: 1e-10, max_iterations: 100 };
        let mut solver = ClarabelSolver::new(2, p.steps.len(), settings);
        let outcome = solver.solve(&qp, &mut answer, &mut || false);
        assert!(matches!(outcome, QpOutcome::Solved { .. }), "case {index}: {outcome:?}");
        let residual = kkt_residual(&qp, answer.z, answer.multipliers);
        assert!(residual.is_within(1e-6, 1e-4), "case {index}: {residual:?}");
        for y in answer.multipliers.iter().filter(|y| y.abs() > 1e-4) {
            pushed[p.inputs.as_slice().len() - 1][usize::from(*y > 0.0)] += 1;
        }
        for (z, expected) in answer.z.iter().zip(sparse_solution(&problem)) {
            assert!((z - expected).abs() <= 1e-6, "case {index}: {:?}\nnot {expected}", answer.z);
        }
    }
    assert!(pushed.iter().flatten().all(|&rows| rows > 0), "[inputs - 1][lower, upper] rows at a bound: {pushed:?}");
}
