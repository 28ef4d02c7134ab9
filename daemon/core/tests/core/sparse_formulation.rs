//! The condensed QP against the sparse formulation of the same problem (18), with the states as
//! variables.

use crate::common;
use crate::common::problems::{Problem, cases, left_in, workspace};
use admittance_core::mpc::condensation::{MpcRows, condense};
use admittance_core::mpc::model::{Model, State};
use admittance_core::mpc::qp::{QpOutcome, QpSolver, RowState, kkt_residual};
use admittance_judge::clarabel_solver::{ClarabelSettings, ClarabelSolver};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::{SVector, Vector2};

/// The inputs that solve the sparse problem: variables [x_1; …; x_H; u_0; …], the dynamics as
/// equalities. Positions are relative to x_0, to keep the constant of f_lin (tens of kilonewtons)
/// out of the solver's tolerance.
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
    let absolute = |x: [f64; STATE]| {
        let position = p.initial.joint_position + Vector2::new(x[0], x[1]);
        State::<2, 2>::moving(position, Vector2::new(x[2], x[3]), Vector2::new(x[4], x[5]))
    };
    let flat = |x: &State<2, 2>| -> [f64; STATE] {
        let (q, v, f) = (x.joint_position, x.joint_velocity, x.wrench);
        [q.x, q.y, v.x, v.y, f.x, f.y]
    };
    let unit = |i: usize| -> [f64; STATE] { std::array::from_fn(|row| if row == i { 1.0 } else { 0.0 }) };

    let mut rows: Vec<(Vec<f64>, f64)> = Vec::new();
    for (k, step) in problem.horizon.steps().iter().enumerate() {
        // x_{k+1} = advance(x_k, known + u_k), its parts found by evaluating the model at unit
        // vectors.
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
    for k in problem.horizon.first_reached() + 1..=h {
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
        let (share, left) = (problem.horizon.share(k), left_in(problem, k));
        let velocity = p.set_point.joint_velocity + p.set_point.fading_velocity * left;
        let set_point = relative(&State::moving(p.set_point.joint_position, velocity, p.set_point.wrench));
        for (row, weights) in q.iter().map(|weights| weights.map(|weight| weight * share)).enumerate() {
            hessian[k * STATE + row][k * STATE..(k + 1) * STATE].copy_from_slice(&weights);
            gradient[k * STATE + row] = -weights.iter().zip(set_point).map(|(weight, x)| weight * x).sum::<f64>();
        }
        for (index, &axis) in axes.iter().enumerate() {
            let at = inputs_at + k * m + index;
            hessian[at][at] = p.input_weight[axis] * share;
            gradient[at] = -hessian[at][at] * (p.set_point.input[axis] + p.set_point.fading_input[axis] * left);
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

/// Both solvers on the condensed problem; the inputs in the order of time and the multipliers of
/// the first.
fn condensed_solutions<const M: usize>(problem: &Problem<2, 2>, what: &str) -> ([Vec<f64>; 2], Vec<f64>) {
    let rows = MpcRows::<2, 2, M, 1>::new(&problem.model, &problem.horizon, &problem.prediction).expect("M inputs");
    let mut workspace = workspace(&problem.horizon, problem.prediction.weights);
    let mut pieces = workspace.pieces(&rows).expect("within capacity");
    condense(&rows, &mut pieces);
    pieces.answer.working.fill(RowState::Inactive);
    let (qp, mut answer, scratch) = pieces.split(&rows);
    let settings = ClarabelSettings { tolerance: 1e-10, max_iterations: 100 };
    let mut clarabel = ClarabelSolver::new(settings);
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
    // Rows with a multiplier, by number of inputs and side: the cases must reach every kind of
    // bound.
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
