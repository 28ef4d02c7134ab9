//! The model (17) against golden/model.json, which an independent script derives by hand with 60
//! digits.

use crate::common;
use admittance_core::mpc::model::{Discretization, Model, State, Step};
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
    let step: Step<2, 2> =
        Discretization::Euler.step(T_S, &parameters.velocity_time_constant, &parameters.wrench_time_constant);

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
    let x = State { joint_position: q, joint_velocity: Vector2::new(0.3, -0.2), wrench: Vector2::new(-40.0, -90.0) };
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
    let step: Step<2, 2> = Discretization::Euler.step(T_S, &parameters.velocity_time_constant, &estimate);
    let mut x =
        State { joint_position: q, joint_velocity: Vector2::new(0.3, -0.2), wrench: Vector2::new(-40.0, -90.0) };
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
fn exponential(a: &SMatrix<f64, 8, 8>) -> SMatrix<f64, 8, 8> {
    let scaled = a / 64.0;
    let mut sum = SMatrix::identity();
    let mut term = SMatrix::<f64, 8, 8>::identity();
    for k in 1..40 {
        term = term * scaled / f64::from(k);
        sum += term;
    }
    (0..6).fold(sum, |power, _| power * power)
}

/// One step of the continuous model [q; q̇; f̂] under a constant r, by the exponential of its
/// matrix.
fn by_exponential(
    model: &Model<2, 2>,
    joint_lag: &Vector2<f64>,
    lag: &Vector2<f64>,
    duration: f64,
    x: &State<2, 2>,
    r: &Vector2<f64>,
) -> State<2, 2> {
    // The state is followed by r, which is constant; without the constant part of f_lin the model
    // is linear.
    let mut matrix = SMatrix::<f64, 8, 8>::zeros();
    for joint in 0..2 {
        matrix[(joint, 2 + joint)] = 1.0;
        matrix[(2 + joint, 2 + joint)] = -1.0 / joint_lag[joint];
        matrix[(2 + joint, 6 + joint)] = 1.0 / joint_lag[joint];
    }
    for axis in 0..2 {
        matrix[(4 + axis, 4 + axis)] = -1.0 / lag[axis];
        for joint in 0..2 {
            matrix[(4 + axis, joint)] = model.wrench_gradient[(joint, axis)] / lag[axis];
        }
    }
    let start = SVector::<f64, 8>::from_iterator(
        x.joint_position.iter().chain(&x.joint_velocity).chain(&x.wrench).chain(r).copied(),
    );
    let end = exponential(&(matrix * duration)) * start;
    State {
        joint_position: Vector2::new(end[0], end[1]),
        joint_velocity: Vector2::new(end[2], end[3]),
        wrench: Vector2::new(end[4], end[5]),
    }
}

#[test]
fn the_exact_step_is_the_matrix_exponential() {
    let parameters = common::parameters();
    let q = Vector2::from(golden().joint_position);
    let model = Model { wrench_offset: SVector::zeros(), ..common::model(&parameters, &q) };
    let joint_lag = parameters.velocity_time_constant;
    let x = State {
        joint_position: Vector2::new(2e-3, -1e-3),
        joint_velocity: Vector2::new(0.3, -0.2),
        wrench: Vector2::new(-40.0, 90.0),
    };
    let r = Vector2::new(-1.1, 0.7);
    // T_est at, around and far from both T_V.
    let around = [1.0, 1.0 + 1e-13, 1.0 - 1e-10, 1.0 + 1e-9, 1.0 - 1e-6, 1.0 + 1e-3, 0.7, 2.0, 0.05];
    for duration in [0.00025, 0.001, 0.004, 0.02] {
        for factor in around {
            let lag = joint_lag * factor;
            let step: Step<2, 2> = Discretization::Zoh.step(duration, &joint_lag, &lag);
            let (found, expected) =
                (model.advance(&step, &x, &r), by_exponential(&model, &joint_lag, &lag, duration, &x, &r));
            let what = format!("{duration} s, T_est = {factor} T_V");
            assert_row(&what, found.joint_position.as_slice(), expected.joint_position.as_slice());
            assert_row(&what, found.joint_velocity.as_slice(), expected.joint_velocity.as_slice());
            assert_row(&what, found.wrench.as_slice(), expected.wrench.as_slice());
        }
        // Without a filter the estimate is f_lin; and so it is, nearly, with one that is fast as
        // nothing.
        for lag in [0.0, 1e-15] {
            let step: Step<2, 2> = Discretization::Zoh.step(duration, &joint_lag, &Vector2::repeat(lag));
            let found = model.advance(&step, &x, &r);
            let ideal = model.linear_wrench(&found.joint_position);
            let bound = 1e-12 * ideal.norm() + lag * model.wrench_gradient.norm() * 3.0;
            assert!((found.wrench - ideal).norm() <= bound, "T_est = {lag} s: {}, not {ideal}", found.wrench);
        }
    }
}
