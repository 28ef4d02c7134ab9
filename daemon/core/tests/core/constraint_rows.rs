//! The constraint rows against the simulated trajectory that they bound.

use crate::common::problems::{
    Loops, Numbers, Point, Problem, SLACK_UNIT, SLACKS, Shape, largest, order, shapes, workspace,
};
use admittance_core::mpc::condensation::{MpcRows, condense};
use admittance_core::mpc::constraints::{Row, RowKind, Softened};
use admittance_core::mpc::model::{CARRIED, Discretization, Model, State};
use admittance_core::mpc::qp::{LANES, Rows, padded};
use admittance_core::output::MAX_STEPS;
use admittance_core::robot::VelocityLoops;
use nalgebra::{SMatrix, SVector};

/// A quantity that a row bounds, in the row's unit.
struct Bounded {
    row: Row,
    value: f64,
    lower: f64,
    upper: f64,
}

/// Everything that is bounded under the inputs `z`, in the order of time, by simulation; in the
/// order of the rows.
fn bounded<const N: usize, const D: usize>(shape: &Shape, problem: &Problem<N, D>, z: &[f64]) -> Vec<Bounded> {
    let (p, steps) = (&problem.prediction, &shape.steps);
    let (c, h) = (&p.constraints, steps.len());
    let (speed, position) = (c.joint_speed.expect("all kinds"), c.rest_position.expect("all kinds"));
    let (offset, rate) = (c.offset.expect("all kinds"), c.rate.expect("all kinds"));
    let (loops, estimate) = shape.lags();
    let (states, joints) = (problem.trajectory(z), problem.drifting(z, &SVector::zeros()));
    let mut all = Vec::new();
    let mut push = |kind, component, instant, value, lower, upper| {
        all.push(Bounded { row: Row { kind, component, instant }, value, lower, upper });
    };
    for k in 0..h {
        let value = problem.reference(z, k);
        (0..N).for_each(|i| push(RowKind::JointSpeed, i, k, value[i], speed.lower[i], speed.upper[i]));
    }
    let drives = c.drives.expect("all kinds");
    // Each change is counted over the length of the step before; the first over its own.
    let since = |k: usize| steps[k.saturating_sub(1)];
    let streamed = |k: usize| drives.without_inputs[k] + problem.model.jacobian_inverse * problem.input(z, k);
    let acceleration = |k: usize| {
        let before = if k == 0 { drives.before.velocity.into() } else { streamed(k - 1) };
        (streamed(k) - before) / since(k)
    };
    for k in 0..h {
        let (value, most) = (acceleration(k) * since(k), drives.acceleration * since(k));
        (0..N).for_each(|i| push(RowKind::JointAcceleration, i, k, value[i], -most[i], most[i]));
    }
    for k in 0..h {
        if (0..N).all(|i| drives.jerk[i] * since(k) >= 2.0 * drives.acceleration[i]) {
            break;
        }
        let before = if k == 0 { drives.before.acceleration.into() } else { acceleration(k - 1) };
        let (value, most) = ((acceleration(k) - before) * since(k), drives.jerk * (since(k) * since(k)));
        (0..N).for_each(|i| push(RowKind::JointJerk, i, k, value[i], -most[i], most[i]));
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
    let along = c.normal_speed.expect("all kinds");
    for k in 0..h {
        let value = along.normal.dot(&problem.input(z, k));
        push(RowKind::NormalSpeed, 0, k, value, along.least[k], f64::INFINITY);
    }
    for k in 0..h {
        let value = rest_position(&joints[k + 1], &loops);
        (0..N).for_each(|i| push(RowKind::RestPosition, i, k, value[i], position.lower[i], position.upper[i]));
    }
    let slack = p.slack.map(|_| *z.last().expect("the slack is a variable"));
    let softens = |softened| p.slack.is_some_and(|slack| slack.softened == softened);
    let force_at = |k: usize, part: f64| {
        let to_here = shape.discretization.step(part * steps[k], &loops, &estimate);
        let there = problem.model.advance(&to_here, &states[k], &(problem.reference(z, k) - p.drift));
        problem.model.linear_wrench(&there.joint_position)
    };
    for (instant, &Point { step: k, part, .. }) in shape.force_points().iter().enumerate() {
        let force = force_at(k, part);
        for bound in c.force.as_slice() {
            // Softened lower bounds have rows of their own.
            let lower = if slack.is_some() { f64::NEG_INFINITY } else { bound.minimum };
            let off = if softens(Softened::Maximum) { SLACK_UNIT * slack.unwrap_or(0.0) } else { 0.0 };
            let value = bound.sign * force[bound.axis] - off;
            push(RowKind::Force, bound.axis, instant, value, lower, bound.maximum);
        }
    }
    for (instant, &Point { step: k, part, .. }) in shape.force_points().iter().enumerate() {
        if !softens(Softened::Minimum) {
            break;
        }
        let force = force_at(k, part);
        for bound in c.force.as_slice() {
            let value = bound.sign * force[bound.axis] + SLACK_UNIT * slack.unwrap_or(0.0);
            push(RowKind::MinimumForce, bound.axis, instant, value, bound.minimum, f64::INFINITY);
        }
    }
    if let Some(slack) = slack {
        push(RowKind::Slack, 0, 0, slack, 0.0, f64::INFINITY);
    }
    all
}

/// Rounding of a row's value. The force is a difference of terms of 1e4 N/rad times radians.
fn rounding(row: &Row) -> f64 {
    if matches!(row.kind, RowKind::Force | RowKind::MinimumForce) { 1e-9 } else { 1e-13 }
}

/// Where the joints are long after their reference has become zero, by the model.
fn rest_position<const N: usize, const D: usize>(state: &State<N, D>, loops: &VelocityLoops<N>) -> SVector<f64, N> {
    let free = Model::<N, D> {
        jacobian_inverse: SMatrix::zeros(),
        wrench_gradient: SMatrix::zeros(),
        wrench_offset: SVector::zeros(),
    };
    let long = Discretization::Zoh.step(10.0, loops, &SVector::repeat(0.02));
    free.advance(&long, state, &SVector::zeros()).joint_position
}

/// The rows of an arbitrary problem, of every kind at once, against [`bounded`].
fn check_rows<const N: usize, const D: usize, const M: usize>(shape: &Shape, numbers: &mut Numbers) {
    match shape.loops {
        Loops::Plain => check_rows_of::<N, D, M, 1>(shape, numbers),
        Loops::Mixed => check_rows_of::<N, D, M, CARRIED>(shape, numbers),
    }
}

fn check_rows_of<const N: usize, const D: usize, const M: usize, const C: usize>(shape: &Shape, numbers: &mut Numbers) {
    let problem = shape.problem::<N, D>(numbers);
    let what = format!("{N} joints, {shape:?}");
    let rows = MpcRows::<N, D, M, C>::new(&problem.model, &problem.horizon, &problem.prediction).expect("M inputs");
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
        assert_eq!(rows.layout.row(number), Some(*row), "{what}");

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
        let is_relative = large > 0.0 && row.kind != RowKind::NormalSpeed;
        let weight = if is_relative { 1.0 / large } else { 1.0 };
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
        let (axis, time) = rows.force_row(number).expect("a force row");
        let Row { component, instant, .. } = all[number].row;
        let expected = points[instant].time;
        assert!(axis == component && (time - expected).abs() <= 1e-15, "axis {axis} at {time} s: {what}");
    }
    assert_eq!((rows.layout.row(count), rows.force_row(count)), (None, None), "{what}");
    let slack = if shape.slack.is_some() { SLACK_UNIT * z[n - 1] } else { 0.0 };
    let softens_maximum = shape.slack.is_some_and(|slack| slack.softened == Softened::Maximum);
    let off_maximum = if softens_maximum { slack } else { 0.0 };
    assert_eq!(rows.off_maximum(&z).to_bits(), off_maximum.to_bits(), "{what}");
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
        discretization: Discretization::Euler,
        steps: vec![0.004; MAX_STEPS],
        inputs: 6,
        by_task: false,
        estimate: [0.020, 0.030],
        slack: SLACKS[1],
        partial: false,
        loops: Loops::Plain,
    };
    check_rows::<6, 6, 6>(&longest, &mut numbers);
}
