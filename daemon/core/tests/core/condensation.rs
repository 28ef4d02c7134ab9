//! The condensed QP against the cost of simulated trajectories.

use crate::common::problems::{
    DISCRETIZATIONS, Loops, Numbers, Problem, SLACK_UNIT, SLACKS, Shape, cases, largest, left_in, order, shapes,
    workspace,
};
use admittance_core::mpc::condensation::{MpcRows, condense};
use admittance_core::mpc::model::{CARRIED, Discretization};
use admittance_core::output::MAX_STEPS;

/// What [`condense`] wrote, in the order of time: column a + m·k is input a of step k, and the last
/// one the slack.
struct Condensed {
    /// n×n.
    hessian: Vec<Vec<f64>>,
    gradient: Vec<f64>,
}

fn condensed<const N: usize, const D: usize, const M: usize>(problem: &Problem<N, D>) -> Condensed {
    match problem.horizon.carried() {
        1 => condensed_of::<N, D, M, 1>(problem),
        _ => condensed_of::<N, D, M, CARRIED>(problem),
    }
}

fn condensed_of<const N: usize, const D: usize, const M: usize, const C: usize>(problem: &Problem<N, D>) -> Condensed {
    let rows = MpcRows::<N, D, M, C>::new(&problem.model, &problem.horizon, &problem.prediction).expect("M inputs");
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

/// Half of (18a) under the inputs `z`, in the order of time, by simulation; with the price of the
/// slack.
fn cost<const N: usize, const D: usize>(problem: &Problem<N, D>, z: &[f64]) -> f64 {
    let p = &problem.prediction;
    let (on_position, on_velocity, on_wrench) = problem.weights();
    let mut cost = 0.0;
    for k in 0..problem.horizon.steps().len() {
        let u = problem.input(z, k) - p.set_point.input - p.set_point.fading_input * left_in(problem, k);
        cost += problem.horizon.share(k) * u.dot(&u.component_mul(&p.input_weight));
    }
    for (k, x) in problem.trajectory(z)[1..].iter().enumerate() {
        let share = problem.horizon.share(k);
        let velocity = p.set_point.joint_velocity + p.set_point.fading_velocity * left_in(problem, k);
        let (dq, dv) = (x.joint_position - p.set_point.joint_position, x.joint_velocity - velocity);
        cost += share * (dq.dot(&(on_position * dq)) + dv.dot(&(on_velocity * dv)));
        for &axis in p.wrench_axes.as_slice() {
            cost += share * on_wrench[axis] * (x.wrench[axis] - p.set_point.wrench[axis]).powi(2);
        }
    }
    let slack = p.slack.map_or(0.0, |slack| {
        let t = SLACK_UNIT * z.last().expect("the slack is a variable");
        slack.price * t + 0.5 * slack.curvature * t * t
    });
    0.5 * cost + slack
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
        for slack in SLACKS {
            problem.prediction.slack = slack;
            assert_is_that_of_the_cost(&problem, &format!("case {index}, slack {slack:?}"));
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
    let longest = [(MAX_STEPS, 6, false), (MAX_STEPS, 3, false), (16, 3, true)];
    for ((steps, inputs, by_task), discretization) in longest.into_iter().zip(DISCRETIZATIONS.into_iter().cycle()) {
        let (steps, estimate, slack) = (vec![0.004; steps], [0.020, 0.030], SLACKS[1]);
        let loops = if discretization == Discretization::Zoh { Loops::Mixed } else { Loops::Plain };
        let shape = Shape { discretization, steps, inputs, by_task, estimate, slack, partial: false, loops };
        assert_is_that_of_the_cost(&shape.problem::<6, 6>(&mut numbers), &format!("{shape:?}"));
    }
}
