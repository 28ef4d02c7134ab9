//! Dynamics against golden/dynamics.json, which Pinocchio computes, and against what must hold of
//! any arm.

use admittance_core::robot::{ArmDynamics, Chain, DynamicsError, LinkInertia};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector6};
use proptest::prelude::*;
use serde::Deserialize;

use crate::common::golden_arm::GoldenArm;

/// Relative to the largest entry of an answer.
const AGREEMENT: f64 = 1e-9;

#[derive(Deserialize)]
struct Golden {
    arms: Vec<Arm>,
}

#[derive(Deserialize)]
struct Arm {
    name: String,
    #[serde(flatten)]
    arm: GoldenArm,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    given: Given,
    answers: Answers,
}

#[derive(Deserialize)]
struct Given {
    q: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    drive: Vec<f64>,
    wrench: [f64; 6],
}

#[derive(Deserialize)]
struct Answers {
    torque: Vec<f64>,
    mass_matrix: Vec<Vec<f64>>,
    bias: Vec<f64>,
    gravity: Vec<f64>,
    momentum: Vec<f64>,
    carried: Vec<f64>,
    link_weights: Vec<Vec<f64>>,
    forward: Vec<f64>,
    kinetic_energy: [f64; 1],
    potential_energy: [f64; 1],
}

fn golden<const N: usize>() -> (Arm, ArmDynamics<N>) {
    let golden: Golden = serde_json::from_str(include_str!("../golden/dynamics.json"))
        .expect("the golden file is what its script wrote");
    let arm = golden.arms.into_iter().find(|arm| arm.arm.joints() == N).expect("one arm for each number of joints");
    let dynamics = arm.arm.dynamics();
    (arm, dynamics)
}

fn vector<const N: usize>(values: &[f64]) -> SVector<f64, N> {
    SVector::from_column_slice(values)
}

fn check_golden<const N: usize>() {
    let (arm, dynamics) = golden::<N>();
    assert!(arm.cases.len() >= 6);
    for Case { given, answers } in &arm.cases {
        let close = |what: &str, found: &[f64], expected: &[f64]| {
            assert_eq!(found.len(), expected.len());
            let scale = expected.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
            for (found, expected) in found.iter().zip(expected) {
                let error = (found - expected).abs();
                assert!(error <= AGREEMENT * scale, "{}: {what} off by {error:e} at q = {:?}", arm.name, given.q);
            }
        };
        let here = dynamics.at(&vector(&given.q));
        let (velocity, wrench) = (vector(&given.velocity), Vector6::from(given.wrench));
        let torque = here.torque(&velocity, &vector(&given.acceleration), &wrench);
        close("torque", torque.as_slice(), &answers.torque);
        let mass: Vec<f64> = answers.mass_matrix.concat();
        // By columns or by rows: it is symmetric.
        close("M", here.mass_matrix().as_slice(), &mass);
        close("C q̇ + G", here.bias(&velocity, &Vector6::zeros()).as_slice(), &answers.bias);
        close("G", here.gravity_torque().as_slice(), &answers.gravity);
        let motion = here.momentum(&velocity);
        close("p", motion.momentum.as_slice(), &answers.momentum);
        close("Cᵀ q̇", motion.carried.as_slice(), &answers.carried);
        // Its columns are the file's rows.
        close("weights", here.link_weights().as_slice(), &answers.link_weights.concat());
        let forward = here.acceleration(&velocity, &vector(&given.drive), &wrench).expect("finite");
        close("acceleration", forward.as_slice(), &answers.forward);
        close("kinetic energy", &[here.kinetic_energy(&velocity)], &answers.kinetic_energy);
        close("potential energy", &[here.potential_energy()], &answers.potential_energy);
    }
}

#[test]
fn dynamics_of_all_arms_are_those_of_pinocchio() {
    check_golden::<2>();
    check_golden::<4>();
    check_golden::<5>();
    check_golden::<6>();
    check_golden::<7>();
    check_golden::<8>();
}

/// A motion of N joints: position, velocity, acceleration or torque, each from −1 to 1, and a wrench.
type Draw<const N: usize> = ([[f64; N]; 3], [f64; 6]);

fn draws<const N: usize>() -> impl Strategy<Value = Draw<N>> {
    let joints = || proptest::array::uniform::<_, N>(-1.0..1.0_f64);
    ([joints(), joints(), joints()], proptest::array::uniform6(-1.0..1.0_f64))
}

fn check_identities<const N: usize>(
    arm: &ArmDynamics<N>,
    chain: &Chain<N>,
    draw: &Draw<N>,
) -> Result<(), TestCaseError> {
    let [q, velocity, acceleration] = draw.0.map(SVector::from);
    let (q, velocity, acceleration) = (q * 3.0, velocity * 4.0, acceleration * 50.0);
    let wrench = Vector6::from(draw.1) * 300.0;
    let here = arm.at(&q);
    let torque = here.torque(&velocity, &acceleration, &wrench);
    // Forward ∘ inverse is the identity.
    let back = here.acceleration(&velocity, &torque, &wrench).expect("finite");
    prop_assert!((back - acceleration).amax() <= 1e-9 * acceleration.amax().max(1.0), "{back} {acceleration}");
    // M is symmetric, positive definite, and what the torques change by.
    let mass = here.mass_matrix();
    prop_assert_eq!(mass, mass.transpose());
    prop_assert!(mass.cholesky().is_some(), "{}", mass);
    let inertial = torque - here.bias(&velocity, &wrench);
    prop_assert!((mass * acceleration - inertial).amax() <= 1e-10 * inertial.amax().max(1.0));
    // τ_ext = Jᵀ f̂, with the Jacobian of the kinematics.
    let external = here.bias(&velocity, &wrench) - here.bias(&velocity, &Vector6::zeros());
    let expected = chain.kinematics(&q).jacobian.transpose() * wrench;
    prop_assert!((external - expected).amax() <= 1e-10 * expected.amax().max(1.0), "{external} {expected}");
    let energy = 0.5 * velocity.dot(&(mass * velocity));
    prop_assert!((here.kinetic_energy(&velocity) - energy).abs() <= 1e-12 * energy.max(1.0));
    Ok(())
}

#[test]
fn forward_inverts_inverse_and_the_mass_matrix_is_one() {
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let (arm, dynamics) = golden::<6>();
    runner
        .run(&draws::<6>(), |draw| check_identities(&dynamics, &arm.arm.chain(), &draw))
        .unwrap_or_else(|failure| panic!("six joints: {failure}"));
    let (arm, dynamics) = golden::<7>();
    runner
        .run(&draws::<7>(), |draw| check_identities(&dynamics, &arm.arm.chain(), &draw))
        .unwrap_or_else(|failure| panic!("seven joints: {failure}"));
    let (arm, dynamics) = golden::<4>();
    runner
        .run(&draws::<4>(), |draw| check_identities(&dynamics, &arm.arm.chain(), &draw))
        .unwrap_or_else(|failure| panic!("four joints, one of them prismatic: {failure}"));
}

/// Falls for 1 s without friction and drives, by steps of the classic Runge-Kutta method.
fn check_energy<const N: usize>() {
    const STEPS: usize = 8000;
    let (arm, dynamics) = golden::<N>();
    let h = 1.0 / STEPS as f64;
    let rate = |q: &SVector<f64, N>, velocity: &SVector<f64, N>| {
        dynamics.at(q).acceleration(velocity, &SVector::zeros(), &Vector6::zeros()).expect("finite")
    };
    let energy = |q: &SVector<f64, N>, velocity: &SVector<f64, N>| {
        let here = dynamics.at(q);
        (here.kinetic_energy(velocity), here.potential_energy())
    };
    let mut q: SVector<f64, N> = SVector::from_fn(|joint, _| 0.4 + 0.5 * joint as f64);
    let mut v: SVector<f64, N> = SVector::from_fn(|joint, _| 0.4 - 0.25 * joint as f64);
    let (kinetic, potential) = energy(&q, &v);
    let (before, mut most_kinetic) = (kinetic + potential, kinetic);
    for _ in 0..STEPS {
        let a1 = rate(&q, &v);
        let (v2, q2) = (v + a1 * (h / 2.0), q + v * (h / 2.0));
        let a2 = rate(&q2, &v2);
        let (v3, q3) = (v + a2 * (h / 2.0), q + v2 * (h / 2.0));
        let a3 = rate(&q3, &v3);
        let (v4, q4) = (v + a3 * h, q + v3 * h);
        let a4 = rate(&q4, &v4);
        q += (v + (v2 + v3) * 2.0 + v4) * (h / 6.0);
        v += (a1 + (a2 + a3) * 2.0 + a4) * (h / 6.0);
        let (kinetic, potential) = energy(&q, &v);
        most_kinetic = most_kinetic.max(kinetic);
        let drift = (kinetic + potential - before) / most_kinetic;
        assert!(drift.abs() <= 1e-6, "{}: energy drifts by {drift:e} of the kinetic", arm.name);
    }
    assert!(most_kinetic > 10.0 * kinetic, "{}: it falls: {most_kinetic} J after {kinetic} J", arm.name);
}

#[test]
fn energy_is_kept_without_friction_and_drives() {
    check_energy::<2>();
    check_energy::<6>();
    check_energy::<7>();
    check_energy::<4>();
}

#[test]
fn what_no_body_has_is_refused() {
    let (arm, _) = golden::<2>();
    let chain = arm.arm.chain::<2>();
    let good = LinkInertia {
        mass: 2.0,
        center_of_gravity: Vector3::new(0.1, 0.0, 0.0),
        inertia: Matrix3::from_diagonal(&Vector3::new(0.01, 0.02, 0.03)),
    };
    let with = |link: LinkInertia, rotor: f64, gravity: f64| {
        let reflected = SVector::from([0.0, rotor]);
        ArmDynamics::new(chain, [good, link], reflected, Vector3::new(0.0, gravity, 0.0)).map(|_| ())
    };
    // A plate: one moment is the sum of the others.
    assert_eq!(with(good, 0.0, -9.81), Ok(()));
    let skew = Matrix3::new(0.01, 0.004, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.025);
    let bad = [
        LinkInertia { mass: 0.0, ..good },
        LinkInertia { mass: f64::NAN, ..good },
        LinkInertia { center_of_gravity: Vector3::new(0.0, f64::INFINITY, 0.0), ..good },
        LinkInertia { inertia: Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.03)), ..good },
        LinkInertia { inertia: Matrix3::from_diagonal(&Vector3::new(0.0, 0.02, 0.02)), ..good },
        LinkInertia { inertia: skew, ..good },
        LinkInertia { inertia: SMatrix::from_element(f64::NAN), ..good },
    ];
    for link in bad {
        let error = with(link, 0.0, -9.81).expect_err("a body that is none");
        assert_eq!(error, DynamicsError::Link { link: 1 }, "{link:?}");
        assert!(error.to_string().starts_with("link 1: mass and inertia"), "{error}");
    }
    assert_eq!(with(good, -0.1, -9.81), Err(DynamicsError::ReflectedInertia { joint: 1 }));
    assert_eq!(with(good, f64::NAN, -9.81), Err(DynamicsError::ReflectedInertia { joint: 1 }));
    assert_eq!(with(good, 0.0, f64::NAN), Err(DynamicsError::Gravity));
}

#[test]
fn values_that_are_not_finite_have_no_acceleration() {
    let (_, dynamics) = golden::<6>();
    let zero = SVector::zeros();
    for bad in [f64::NAN, f64::INFINITY] {
        let spoiled = SVector::from_element(bad);
        assert_eq!(dynamics.at(&spoiled).acceleration(&zero, &zero, &Vector6::zeros()), None);
        assert_eq!(dynamics.at(&zero).acceleration(&zero, &spoiled, &Vector6::zeros()), None);
    }
}
