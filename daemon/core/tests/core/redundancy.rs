//! The resolution of redundancy against golden/redundancy.json, which an independent script solves exactly, and what
//! keeps joints within their bounds.

use admittance_core::intake::{Sample, SampleFault};
use admittance_core::redundancy::{Aim, Redundancy};
use admittance_core::robot::{Interval, InverseDamping, NullSpace, Resolution, TaskAxes, resolved_inverse};
use admittance_core::vocabulary::{ModeName as Mode, StopReason};
use nalgebra::{SMatrix, SVector, Vector2};
use serde::Deserialize;

use crate::common::scripted::assert_stopping;
use crate::common::{active_set, controller, parameters, pushing, step};

/// Largest difference, relative to the length of the vector, that rounding explains at the condition of the cases.
const ROUNDING: f64 = 1e-9;

#[derive(Deserialize)]
struct Golden {
    arms: Vec<Arm>,
}

#[derive(Deserialize)]
struct Arm {
    joints: usize,
    task_axes: usize,
    axes: Vec<usize>,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    jacobian: Vec<Vec<f64>>,
    weights: Vec<f64>,
    twist: Vec<f64>,
    velocity: Vec<f64>,
    damping_factor: f64,
    damping_below: f64,
    reciprocal_condition: f64,
    weighted: Vec<f64>,
    damped: Vec<f64>,
    null: Vec<f64>,
}

fn arms() -> Vec<Arm> {
    let golden: Golden =
        serde_json::from_str(include_str!("../golden/redundancy.json")).expect("what its script wrote");
    golden.arms
}

/// The Jacobian with zero rows on axes that are none of the task, and the task's.
fn jacobian_of<const N: usize, const D: usize>(arm: &Arm, case: &Case) -> (SMatrix<f64, D, N>, TaskAxes) {
    let mut jacobian = SMatrix::zeros();
    for (axis, row) in arm.axes.iter().zip(&case.jacobian) {
        for joint in 0..N {
            jacobian[(*axis, joint)] = row[joint];
        }
    }
    let axes = if arm.axes.len() == 6 { TaskAxes::ALL } else { TaskAxes::of(arm.axes.iter().copied()).expect("some") };
    (jacobian, axes)
}

fn check<const N: usize, const D: usize>(arm: &Arm) {
    for case in &arm.cases {
        let (jacobian, axes) = jacobian_of::<N, D>(arm, case);
        let joints = |values: &[f64]| SVector::<f64, N>::from_column_slice(values);
        let mut twist = SVector::<f64, D>::zeros();
        arm.axes.iter().zip(&case.twist).for_each(|(axis, value)| twist[*axis] = *value);
        let same = |what: &str, found: SVector<f64, N>, golden: &[f64]| {
            let golden = joints(golden);
            let off = (found - golden).norm() / golden.norm();
            assert!(off < ROUNDING, "{what} of {N} joints on {:?}: off by {off:e}", arm.axes);
        };
        let weighted = Resolution { weight: Some(joints(&case.weights)), damping: None };
        let inverse = resolved_inverse(&jacobian, axes, &weighted, 1e-6).expect("regular");
        same("weighted", inverse.joint_velocity(&twist), &case.weighted);
        assert!((inverse.reciprocal_condition / case.reciprocal_condition - 1.0).abs() < ROUNDING);
        assert!(!inverse.is_damped);
        let damping = InverseDamping { factor: case.damping_factor, below: case.damping_below };
        let damped = Resolution { damping: Some(damping), ..weighted };
        let inverse = resolved_inverse(&jacobian, axes, &damped, 1e-6).expect("regular");
        same("damped", inverse.joint_velocity(&twist), &case.damped);
        assert!(inverse.is_damped && inverse.reciprocal_condition < case.damping_below);
        // Damped or not, the null space is that of J itself.
        for resolution in [&weighted, &damped] {
            let null_space = NullSpace::of(&jacobian, axes, resolution).expect("regular");
            let beside = null_space.project(&joints(&case.velocity));
            if N > arm.axes.len() {
                same("null", beside, &case.null);
            }
            assert!((jacobian * beside).norm() < 1e-9, "the task moves by {:e}", (jacobian * beside).norm());
        }
        // Far from where damping begins, nothing of it is left, to the bit.
        let far = Resolution { damping: Some(InverseDamping { below: 1e-9, ..damping }), ..weighted };
        assert_eq!(resolved_inverse(&jacobian, axes, &far, 1e-6), resolved_inverse(&jacobian, axes, &weighted, 1e-6));
    }
}

#[test]
fn weighted_and_damped_inverses_and_null_spaces_are_golden() {
    let arms = arms();
    assert_eq!(arms.len(), 6);
    for arm in &arms {
        match (arm.joints, arm.task_axes) {
            (7, 6) => check::<7, 6>(arm),
            (8, 6) => check::<8, 6>(arm),
            (6, 6) => check::<6, 6>(arm),
            (4, 6) => check::<4, 6>(arm),
            (2, 2) => check::<2, 2>(arm),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn equal_weights_are_the_least_norm() {
    let arms = arms();
    let (jacobian, axes) = jacobian_of::<7, 6>(&arms[0], &arms[0].cases[0]);
    let equal = Resolution { weight: Some(SVector::repeat(3.0)), damping: None };
    let least = resolved_inverse(&jacobian, axes, &Resolution::LEAST_NORM, 1e-6).expect("regular");
    let weighted = resolved_inverse(&jacobian, axes, &equal, 1e-6).expect("regular");
    assert!((least.matrix - weighted.matrix).norm() < 1e-12 * least.matrix.norm());
}

#[test]
fn joints_are_brought_within_their_bounds_where_the_null_space_allows() {
    let mut brought = 0;
    for arm in arms().iter().filter(|arm| arm.joints == 7) {
        for case in &arm.cases {
            let (jacobian, axes) = jacobian_of::<7, 6>(arm, case);
            let resolution = Resolution { weight: Some(SVector::from_column_slice(&case.weights)), damping: None };
            let null_space = NullSpace::of(&jacobian, axes, &resolution).expect("regular");
            let going = SVector::<f64, 7>::from_column_slice(&case.velocity);
            for joint in 0..7 {
                let mut bounds =
                    Interval { lower: SVector::repeat(f64::NEG_INFINITY), upper: SVector::repeat(f64::INFINITY) };
                bounds.upper[joint] = going[joint] - 0.1;
                let change = null_space.brought_within(&going, &bounds);
                assert!((jacobian * change).norm() < 1e-9);
                let own = SVector::from_fn(|other, _| if other == joint { 1.0 } else { 0.0 });
                if null_space.project(&own)[joint] > 1e-3 {
                    assert!((going + change)[joint] <= bounds.upper[joint] + 1e-9, "joint {joint}");
                    brought += 1;
                } else {
                    // It belongs to the task: the others are not thrown about for it.
                    assert_eq!(change, SVector::<f64, 7>::zeros(), "joint {joint}");
                }
                // Within already: nothing is changed.
                bounds.upper[joint] = going[joint] + 0.1;
                assert_eq!(null_space.brought_within(&going, &bounds), SVector::<f64, 7>::zeros());
            }
        }
    }
    assert!(brought > 40, "{brought} of 56 joints");
    // Of an arm whose joints all have their part in the task there is nothing to change.
    let jacobian = SMatrix::<f64, 2, 2>::new(1.0, 0.2, -0.3, 1.0);
    let null_space = NullSpace::of(&jacobian, TaskAxes::ALL, &Resolution::LEAST_NORM).expect("regular");
    let bounds = Interval { lower: SVector::repeat(-0.1), upper: SVector::repeat(0.1) };
    assert_eq!(null_space.brought_within(&SVector::repeat(1.0), &bounds), SVector::<f64, 2>::zeros());
}

/// A sample of joints that follow what the law resolves, commanded to turn with q̇0.
fn following(force: f64, sequence: u64) -> Sample<2, 2> {
    Sample { joint_velocity_reference: Some(Vector2::new(0.03, -0.02)), ..pushing(force, 0.05, sequence) }
}

#[test]
fn joints_that_follow_are_told_all_of_their_motion_and_those_that_cease_to_are_stopped() {
    let nothing_beside = Redundancy { aim: Aim::Nothing, limit_margin: None, speed_share: 0.25, acceleration: 2.0 };
    let parameters = admittance_core::Parameters { redundancy: Some(nothing_beside), ..parameters() };
    let mut controller = controller(parameters, active_set());
    // In free motion and in contact alike.
    for (sequence, force, mode) in [(1, 0.0, Mode::Free), (2, 100.0, Mode::Contact), (3, 100.0, Mode::Contact)] {
        let sample = following(force, sequence);
        let outcome = step(&mut controller, &sample);
        assert_eq!((outcome.mode, outcome.fault), (mode, None), "sample {sequence}");
        let jacobian = parameters.chain.kinematics(&sample.joint_position).task_jacobian::<2>();
        let told = Vector2::new(0.03, -0.02) + outcome.movement.joint_velocity_offset;
        let wanted = sample.twist_reference + outcome.movement.velocity_offset;
        assert!((jacobian * told - wanted).norm() < 1e-12, "{told}");
        let per_twist = outcome.movement.joint_per_twist.expect("for such joints");
        assert!((jacobian * per_twist - SMatrix::identity()).norm() < 1e-12);
    }
    let mut outcome = None;
    for sequence in 4..=7 {
        let sample = Sample { joint_velocity_reference: None, ..following(100.0, sequence) };
        let found = step(&mut controller, &sample);
        assert_eq!(found.fault, Some(SampleFault::NotFollowing));
        outcome = Some(found);
    }
    assert_stopping(&outcome.expect("four of them"), StopReason::SampleInvalid);
}
