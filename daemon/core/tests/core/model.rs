//! The model (17) against golden/model.json, which an independent script derives by hand with 60
//! digits.

use crate::common;
use admittance_core::mpc::model::{Discretization, Model, State, Step};
use admittance_core::robot::VelocityLoops;
use nalgebra::{SMatrix, SVector, Vector2};
use serde::Deserialize;

/// Relative difference that rounding explains.
const ROUNDING: f64 = 1e-12;
const T_S: f64 = 0.004;

#[derive(Deserialize)]
struct Golden {
    joint_position: [f64; 2],
    inverse_jacobian: [[f64; 2]; 2],
    models: Vec<GoldenModel>,
}

#[derive(Deserialize)]
struct GoldenModel {
    active_axes: Vec<String>,
    #[serde(rename = "A")]
    a: Vec<Vec<f64>>,
    #[serde(rename = "B")]
    b: Vec<Vec<f64>>,
    #[serde(rename = "E")]
    e: Vec<Vec<f64>>,
    gamma: Vec<f64>,
    force_offset: Vec<f64>,
    force_by_joint: Vec<Vec<f64>>,
    force_here: Vec<f64>,
}

fn golden() -> Golden {
    serde_json::from_str(include_str!("../golden/model.json")).expect("the golden file is what its script wrote")
}

/// Every entry within rounding of the largest one in its row, which is what the sum that makes it
/// is rounded to.
fn assert_row(what: &str, found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(0.0_f64, |scale, value| scale.max(value.abs()));
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() <= ROUNDING * scale, "{what}: {found:?}, expected {expected:?}");
    }
}

/// [q; q̇; f̂ of `axes`].
fn flat(x: &State<2, 2>, axes: &[usize]) -> Vec<f64> {
    let joints = x.joint_position.iter().chain(x.joint_velocity.iter()).copied();
    joints.chain(axes.iter().map(|&axis| x.wrench[axis])).collect()
}

fn unit(index: usize, axes: &[usize]) -> State<2, 2> {
    let mut x = State::zeros();
    match index {
        0 | 1 => x.joint_position[index] = 1.0,
        2 | 3 => x.joint_velocity[index - 2] = 1.0,
        _ => x.wrench[axes[index - 4]] = 1.0,
    }
    x
}

fn transposed(columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
    (0..columns[0].len()).map(|row| columns.iter().map(|column| column[row]).collect()).collect()
}

fn check(golden: &Golden, expected: &GoldenModel) {
    let q = Vector2::from(golden.joint_position);
    let model: Model<2, 2> = common::model(&common::parameters(), &q);
    let name = |axis: &String| ["x", "y"].iter().position(|name| name == axis).expect("x or y");
    let axes: Vec<usize> = expected.active_axes.iter().map(name).collect();
    let rest = SVector::<f64, 2>::zeros();
    let parameters = common::parameters();
    let step: Step<2, 2> = Discretization::Euler.step(T_S, &parameters.loops, &parameters.wrench_time_constant);

    // A model without its constant part is linear: A and B come from it exactly, γ from the whole
    // one at the origin.
    let linear = Model { wrench_offset: SVector::zeros(), ..model };
    let columns: Vec<_> =
        (0..4 + axes.len()).map(|i| flat(&linear.advance(&step, &unit(i, &axes), &rest), &axes)).collect();
    for (row, (found, expected)) in transposed(&columns).iter().zip(&expected.a).enumerate() {
        assert_row(&format!("A, row {row}"), found, expected);
    }
    let gamma = model.advance(&step, &State::zeros(), &rest);
    for (found, expected) in flat(&gamma, &axes).iter().zip(&expected.gamma) {
        assert_row("γ", &[*found], &[*expected]);
    }
    let response = |axis: usize| {
        let v = model.jacobian_inverse.column(axis).into_owned();
        assert_row("J⁻¹", v.as_slice(), &[0, 1].map(|joint| golden.inverse_jacobian[joint][axis]));
        flat(&linear.advance(&step, &State::zeros(), &v), &axes)
    };
    let inputs: Vec<_> = axes.iter().map(|&axis| response(axis)).collect();
    let references: Vec<_> = (0..2).map(response).collect();
    for (row, found) in transposed(&inputs).iter().enumerate() {
        assert_row(&format!("B, row {row}"), found, &expected.b[row]);
    }
    for (row, found) in transposed(&references).iter().enumerate() {
        assert_row(&format!("E, row {row}"), found, &expected.e[row]);
    }

    // The whole step: A x + E ṗ0 + γ.
    let x = State::moving(q, Vector2::new(0.3, -0.2), Vector2::new(-40.0, -90.0));
    let twist = [0.1, -0.25];
    let x_flat = flat(&x, &axes);
    let reference = model.jacobian_inverse * Vector2::from(twist);
    let next = flat(&model.advance(&step, &x, &reference), &axes);
    for (row, found) in next.iter().enumerate() {
        let terms: Vec<f64> = expected.a[row].iter().zip(&x_flat).map(|(a, x)| a * x).collect();
        let driven: f64 = expected.e[row].iter().zip(twist).map(|(e, twist)| e * twist).sum();
        let sum = terms.iter().sum::<f64>() + driven + expected.gamma[row];
        let scale = terms.iter().fold(expected.gamma[row].abs(), |scale, term| scale.max(term.abs()));
        assert!((found - sum).abs() <= 10.0 * ROUNDING * scale, "A x + E ṗ0 + γ, row {row}: {found} ≠ {sum}");
    }

    for (index, &axis) in axes.iter().enumerate() {
        assert_row("K_e J", model.wrench_gradient.column(axis).as_slice(), &expected.force_by_joint[index]);
        let offset = model.linear_wrench(&rest)[axis];
        assert_row("constant part of f_lin", &[offset], &[expected.force_offset[index]]);
        // A difference of terms a thousand times larger, and K_e times a position known to 1e-16 m:
        // 1e-10 N at best.
        let here = model.linear_wrench(&q)[axis];
        let bound = ROUNDING * offset.abs() * 10.0;
        assert!(
            (here - expected.force_here[index]).abs() <= bound,
            "f_lin(q) = {here}, not {}",
            expected.force_here[index]
        );
    }
}

#[test]
fn every_matrix_of_the_model_is_the_golden_one() {
    let golden = golden();
    let inputs: Vec<usize> = golden.models.iter().map(|model| model.active_axes.len()).collect();
    assert_eq!(inputs, [2, 1], "one model for each number of active axes");
    for model in &golden.models {
        check(&golden, model);
    }
}

#[test]
fn an_ideal_measurement_is_the_linear_wrench_at_every_instant() {
    let parameters = common::parameters();
    let q = Vector2::from(golden().joint_position);
    let model = common::model(&parameters, &q);
    // One axis without a filter, one with.
    let estimate = Vector2::new(0.0, 0.020);
    let step: Step<2, 2> = Discretization::Euler.step(T_S, &parameters.loops, &estimate);
    let mut x = State::moving(q, Vector2::new(0.3, -0.2), Vector2::new(-40.0, -90.0));
    for _ in 0..3 {
        let next = model.advance(&step, &x, &Vector2::new(0.1, 0.2));
        let ideal = model.linear_wrench(&next.joint_position).x;
        assert!(
            (next.wrench.x - ideal).abs() <= ROUNDING * model.wrench_offset.x.abs(),
            "{}, not {ideal}",
            next.wrench.x
        );
        let filtered = x.wrench.y + T_S / 0.020 * (model.linear_wrench(&x.joint_position).y - x.wrench.y);
        assert!((next.wrench.y - filtered).abs() <= 1e-9, "{}, not {filtered}", next.wrench.y);
        x = next;
    }
}

/// exp(A) by its series for A/2⁶, squared six times.
fn exponential<const K: usize>(a: &SMatrix<f64, K, K>) -> SMatrix<f64, K, K> {
    let scaled = a / 64.0;
    let mut sum = SMatrix::identity();
    let mut term = SMatrix::<f64, K, K>::identity();
    for k in 1..40 {
        term = term * scaled / f64::from(k);
        sum += term;
    }
    (0..6).fold(sum, |power, _| power * power)
}

/// The continuous model [q; q̇; q̈; f̂] over a time under a constant r, by the exponential of its
/// matrix.
fn by_exponential(
    model: &Model<2, 2>,
    loops: &VelocityLoops<2>,
    lag: &Vector2<f64>,
    duration: f64,
    x: &State<2, 2>,
    r: &Vector2<f64>,
) -> State<2, 2> {
    // The state is followed by r, which is constant; without the constant part of f_lin the model
    // is linear.
    let mut matrix = SMatrix::<f64, 10, 10>::zeros();
    for joint in 0..2 {
        let (q, v, a, r) = (joint, 2 + joint, 4 + joint, 8 + joint);
        matrix[(q, v)] = 1.0;
        if let Some(omega) = loops.frequency(joint) {
            matrix[(v, a)] = 1.0;
            matrix[(a, v)] = -omega * omega;
            matrix[(a, a)] = -2.0 * loops.damping[joint] * omega;
            matrix[(a, r)] = omega * omega;
        } else {
            matrix[(v, v)] = -1.0 / loops.time_constant[joint];
            matrix[(v, r)] = 1.0 / loops.time_constant[joint];
        }
    }
    for axis in 0..2 {
        matrix[(6 + axis, 6 + axis)] = -1.0 / lag[axis];
        for joint in 0..2 {
            matrix[(6 + axis, joint)] = model.wrench_gradient[(joint, axis)] / lag[axis];
        }
    }
    let [position, velocity, acceleration] = [x.joint_position, x.joint_velocity, x.joint_acceleration];
    let start = position.iter().chain(&velocity).chain(&acceleration).chain(&x.wrench).chain(r).copied();
    let end = exponential(&(matrix * duration)) * SVector::<f64, 10>::from_iterator(start);
    State {
        joint_position: Vector2::new(end[0], end[1]),
        joint_velocity: Vector2::new(end[2], end[3]),
        joint_acceleration: Vector2::new(end[4], end[5]),
        earlier_reference: *r,
        wrench: Vector2::new(end[6], end[7]),
    }
}

/// The same where the second joint's reference waits for its dead time: one stretch after the
/// other.
fn with_dead_time(
    model: &Model<2, 2>,
    loops: &VelocityLoops<2>,
    lag: &Vector2<f64>,
    duration: f64,
    x: &State<2, 2>,
    r: &Vector2<f64>,
) -> State<2, 2> {
    let waits = loops.dead_time[1] - loops.dead_time[0];
    let before = Vector2::new(r[0], x.earlier_reference[1]);
    let then = by_exponential(model, loops, lag, waits, x, &before);
    by_exponential(model, loops, lag, duration - waits, &then, r)
}

/// Without the constant part of f_lin.
fn linear_model() -> Model<2, 2> {
    let q = Vector2::from(golden().joint_position);
    Model { wrench_offset: SVector::zeros(), ..common::model(&common::parameters(), &q) }
}

fn moving() -> State<2, 2> {
    State::moving(Vector2::new(2e-3, -1e-3), Vector2::new(0.3, -0.2), Vector2::new(-40.0, 90.0))
}

#[test]
fn the_exact_step_is_the_matrix_exponential() {
    let model = linear_model();
    let loops = common::parameters().loops;
    let (x, r) = (moving(), Vector2::new(-1.1, 0.7));
    // T_est at, around and far from both T_V.
    let around = [1.0, 1.0 + 1e-13, 1.0 - 1e-10, 1.0 + 1e-9, 1.0 - 1e-6, 1.0 + 1e-3, 0.7, 2.0, 0.05];
    for duration in [0.00025, 0.001, 0.004, 0.02] {
        for factor in around {
            let lag = loops.time_constant * factor;
            let step: Step<2, 2> = Discretization::Zoh.step(duration, &loops, &lag);
            let (found, expected) =
                (model.advance(&step, &x, &r), by_exponential(&model, &loops, &lag, duration, &x, &r));
            let what = format!("{duration} s, T_est = {factor} T_V");
            assert_row(&what, found.joint_position.as_slice(), expected.joint_position.as_slice());
            assert_row(&what, found.joint_velocity.as_slice(), expected.joint_velocity.as_slice());
            assert_row(&what, found.wrench.as_slice(), expected.wrench.as_slice());
        }
        // Without a filter the estimate is f_lin; and so it is, nearly, with one that is fast as
        // nothing.
        for lag in [0.0, 1e-15] {
            let step: Step<2, 2> = Discretization::Zoh.step(duration, &loops, &Vector2::repeat(lag));
            let found = model.advance(&step, &x, &r);
            let ideal = model.linear_wrench(&found.joint_position);
            let bound = 1e-12 * ideal.norm() + lag * model.wrench_gradient.norm() * 3.0;
            assert!((found.wrench - ideal).norm() <= bound, "T_est = {lag} s: {}, not {ideal}", found.wrench);
        }
    }
}

#[test]
fn the_exact_step_of_loops_of_second_order_is_the_matrix_exponential() {
    let model = linear_model();
    let x =
        State { joint_acceleration: Vector2::new(-12.0, 7.0), earlier_reference: Vector2::new(0.4, -0.9), ..moving() };
    let r = Vector2::new(-1.1, 0.7);
    // Around critical damping the two poles meet, and above it one of them may be that of the
    // filter.
    let dampings = [0.1, 0.5, 0.7, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.0 + 1e-3, 1.25, 3.0];
    for (duration, damping) in [0.00025, 0.001, 0.004, 0.02].into_iter().flat_map(|t| dampings.map(|zeta| (t, zeta))) {
        let mut loops = common::parameters().loops;
        loops.damping = Vector2::new(damping, 0.7);
        let (omega, dead_time) = (loops.frequency(0).expect("of second order"), 0.0002);
        let root = omega * (damping * damping - 1.0).max(0.0).sqrt();
        let poles = [damping * omega - root, damping * omega + root, damping * omega];
        let around = [1.0, 1.0 + 1e-12, 1.0 - 1e-8, 1.0 + 1e-4, 0.9];
        for lag in poles.into_iter().flat_map(|pole| around.map(|factor| factor / pole)).chain([0.0, 0.0005, 0.02]) {
            let lag = Vector2::new(lag, 0.02);
            for dead_times in [Vector2::zeros(), Vector2::new(0.003, 0.003 + dead_time)] {
                loops.dead_time = dead_times;
                let step: Step<2, 2> = Discretization::Zoh.step(duration, &loops, &lag);
                let found = model.advance(&step, &x, &r);
                // Without a filter any will do: its estimate is not compared.
                let some_lag = lag.map(|lag| if lag > 0.0 { lag } else { 0.01 });
                let mut expected = with_dead_time(&model, &loops, &some_lag, duration, &x, &r);
                if lag.x == 0.0 {
                    expected.wrench.x = model.linear_wrench(&expected.joint_position).x;
                }
                let what = format!("{duration} s, damping {damping}, T_est = {lag}, dead times {dead_times}");
                assert_row(&what, found.joint_position.as_slice(), expected.joint_position.as_slice());
                assert_row(&what, found.joint_velocity.as_slice(), expected.joint_velocity.as_slice());
                assert_row(&what, found.joint_acceleration.as_slice(), expected.joint_acceleration.as_slice());
                assert_row(&what, found.wrench.as_slice(), expected.wrench.as_slice());
                assert_eq!(found.earlier_reference, r);
            }
        }
    }
}
