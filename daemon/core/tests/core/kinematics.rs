//! Kinematics against golden/kinematics.json, which an independent script computes with 80 digits.

use admittance_core::robot::{
    Chain, Joint, JointKind, Pose, Posture, Resolution, TaskAxes, right_inverse, rotation_from_rpy,
};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector6};
use serde::Deserialize;
use std::f64::consts::PI;

use crate::common::golden_chain::GoldenChain;

/// Largest difference that rounding explains: metres, radians or entries of a rotation, for arms of
/// a metre or two.
const ROUNDING: f64 = 1e-12;

#[derive(Deserialize)]
struct Golden {
    arms: Vec<Arm>,
    differences: Vec<Difference>,
}

#[derive(Deserialize)]
struct Arm {
    name: String,
    task_axes: usize,
    #[serde(flatten)]
    chain: GoldenChain,
    poses: Vec<PoseData>,
    singular: Vec<SingularData>,
}

#[derive(Deserialize)]
struct PoseData {
    q: Vec<f64>,
    position: [f64; 3],
    rotation: [[f64; 3]; 3],
    jacobian: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
struct SingularData {
    why: String,
    q: Vec<f64>,
}

#[derive(Deserialize)]
struct Difference {
    angle: f64,
    reference: [[f64; 3]; 3],
    turned: [[f64; 3]; 3],
    rotation_vector: [f64; 3],
}

fn golden() -> Golden {
    serde_json::from_str(include_str!("../golden/kinematics.json")).expect("the golden file is what its script wrote")
}

fn matrix(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| rows[row][column])
}

fn arm(golden: &Golden, joints: usize) -> &Arm {
    golden.arms.iter().find(|arm| arm.chain.joints.len() == joints).expect("one arm for each number of joints")
}

fn check_poses<const N: usize>() {
    let golden = golden();
    let arm = arm(&golden, N);
    let chain = arm.chain.chain::<N>();
    assert!(arm.poses.len() >= 6);
    for pose in &arm.poses {
        let kinematics = chain.kinematics(&SVector::from_column_slice(&pose.q));
        let position = (kinematics.pose.position - Vector3::from(pose.position)).amax();
        let rotation = (kinematics.pose.rotation - matrix(&pose.rotation)).amax();
        let expected = SMatrix::<f64, 6, N>::from_fn(|row, joint| pose.jacobian[row][joint]);
        let jacobian = (kinematics.jacobian - expected).amax();
        for (what, error) in [("position", position), ("rotation", rotation), ("Jacobian", jacobian)] {
            assert!(error <= ROUNDING, "{}: {what} off by {error:e} at q = {:?}", arm.name, pose.q);
        }
    }
}

fn check_inverse<const N: usize, const D: usize>() {
    let golden = golden();
    let arm = arm(&golden, N);
    assert_eq!(arm.task_axes, D);
    let chain = arm.chain.chain::<N>();
    for pose in &arm.poses {
        let jacobian = chain.kinematics(&SVector::from_column_slice(&pose.q)).task_jacobian::<D>();
        let inverse = right_inverse(&jacobian, TaskAxes::ALL, 1e-4)
            .unwrap_or_else(|singular| panic!("{}: {singular:?} at q = {:?}", arm.name, pose.q));
        let error = (jacobian * inverse.matrix - SMatrix::<f64, D, D>::identity()).amax();
        assert!(error <= 1e-10, "{}: J J⁻¹ is off from I by {error:e} at q = {:?}", arm.name, pose.q);
        assert!(inverse.reciprocal_condition <= 1.0 / D as f64 + ROUNDING);
        // Least norm: J⁻¹J projects onto the rows of J, so it is symmetric.
        let projector = inverse.matrix * jacobian;
        let asymmetry = (projector - projector.transpose()).amax();
        assert!(asymmetry <= 1e-10, "{}: J⁻¹J is not symmetric by {asymmetry:e} at q = {:?}", arm.name, pose.q);
    }
}

/// At a singular pose, and at a distance from it where the reciprocal condition number is below the
/// bound by far.
fn check_singular<const N: usize, const D: usize>() {
    let golden = golden();
    let arm = arm(&golden, N);
    let chain = arm.chain.chain::<N>();
    assert!(!arm.singular.is_empty());
    for case in &arm.singular {
        for offset in [0.0, 1e-12, -1e-9, 1e-6] {
            let q = SVector::from_fn(|joint, _| case.q[joint] + offset);
            let jacobian = chain.kinematics(&q).task_jacobian::<D>();
            match right_inverse(&jacobian, TaskAxes::ALL, 1e-4) {
                Err(singular) => assert!(
                    (0.0..1e-4).contains(&singular.reciprocal_condition),
                    "{}, {}: {singular:?} with joints {offset:e} rad off",
                    arm.name,
                    case.why
                ),
                Ok(inverse) => panic!(
                    "{}, {}: inverted with reciprocal condition number {:e}, joints {offset:e} rad off",
                    arm.name, case.why, inverse.reciprocal_condition
                ),
            }
        }
    }
}

#[test]
fn poses_and_jacobians_of_two_joints_are_golden() {
    check_poses::<2>();
}

#[test]
fn poses_and_jacobians_of_six_joints_are_golden() {
    check_poses::<6>();
}

#[test]
fn poses_and_jacobians_of_seven_joints_are_golden() {
    check_poses::<7>();
}

#[test]
fn poses_and_jacobians_with_prismatic_joints_are_golden() {
    check_poses::<4>();
    check_poses::<5>();
    check_poses::<8>();
}

#[test]
fn right_inverse_inverts_and_has_least_norm() {
    check_inverse::<2, 2>();
    check_inverse::<6, 6>();
    check_inverse::<7, 6>();
    check_inverse::<4, 3>();
    check_inverse::<5, 3>();
    check_inverse::<8, 6>();
}

/// Of a SCARA, whose J has no rx and no ry: on x y z rz its inverse is that of those four rows, and
/// zero beside them.
#[test]
fn the_inverse_on_some_axes_is_that_of_their_rows() {
    let joint = |x: f64, kind| Joint {
        origin: Vector3::new(x, 0.0, 0.0),
        rotation: Matrix3::identity(),
        axis: Vector3::z(),
        kind,
    };
    let (turns, slides) = (JointKind::Revolute, JointKind::Prismatic);
    let tool = Pose { position: Vector3::new(0.05, 0.0, -0.1), rotation: Matrix3::identity() };
    let joints = [joint(0.0, turns), joint(0.325, turns), joint(0.275, slides), joint(0.0, turns)];
    let chain = Chain::new(joints, tool).expect("a chain");
    let axes = TaskAxes::of([0, 1, 2, 5]).expect("axes");
    let q = SVector::<f64, 4>::new(0.4, -1.1, 0.05, 0.7);
    assert!(chain.kinematics(&q).inverse::<6>(0.0).is_err(), "no joint turns it about x");
    let kinematics = chain.with_axes(axes).kinematics(&q);
    let inverse = kinematics.inverse::<6>(1e-3).expect("bent");
    let rows = SMatrix::<f64, 4, 4>::from_fn(|row, joint| kinematics.jacobian[([0, 1, 2, 5][row], joint)]);
    let expected = rows.try_inverse().expect("bent");
    for (column, axis) in [0, 1, 2, 5].into_iter().enumerate() {
        assert!((inverse.matrix.column(axis) - expected.column(column)).amax() < ROUNDING);
    }
    assert_eq!((inverse.matrix.column(3).amax(), inverse.matrix.column(4).amax()), (0.0, 0.0));
    let of_rows = 1.0 / (rows.norm() * expected.norm());
    assert!((inverse.reciprocal_condition - of_rows).abs() < ROUNDING);
    // Six joints with a task on three axes are redundant: least norm.
    let golden = golden();
    let arm = arm(&golden, 6).chain.chain::<6>().with_axes(TaskAxes::of([0, 2, 4]).expect("axes"));
    let posture = Posture::<6, 6>::new(&arm, &SVector::from([0.4, -1.2, 0.9, 0.8, 1.1, -0.6]));
    let projector = posture.inverse(1e-4).expect("not singular").matrix * posture.jacobian();
    assert!((projector - projector.transpose()).amax() < 1e-10 && (projector.trace() - 3.0).abs() < 1e-9);
}

#[test]
fn singular_poses_are_reported() {
    check_singular::<2, 2>();
    check_singular::<6, 6>();
    check_singular::<7, 6>();
}

/// Of two links of 1 m and 1 m, |det J| is |sin q2|.
#[test]
fn the_condition_falls_evenly_toward_a_stretched_arm_and_below_zero_beyond_it() {
    let golden = golden();
    let chain = arm(&golden, 2).chain.chain::<2>();
    let q = SVector::<f64, 2>::new(0.4, 0.05);
    let posture = Posture::<2, 2>::new(&chain, &q);
    let after = |way: f64| posture.reciprocal_condition_after(&chain, &q, &SVector::<f64, 2>::new(0.0, way));
    let at = |elbow: f64| {
        let there = Posture::<2, 2>::new(&chain, &SVector::<f64, 2>::new(0.4, elbow));
        there.inverse(0.0).expect("not singular").reciprocal_condition
    };
    assert!((after(0.0) - at(0.05)).abs() < ROUNDING);
    for way in [-0.03, -0.01, 0.02] {
        assert!((after(way) / at(0.05 + way) - 1.0).abs() < 0.01, "{way}: {} {}", after(way), at(0.05 + way));
    }
    // The mirrored posture is as far from singular, but on the other side.
    assert!((after(-0.1) / at(-0.05) + 1.0).abs() < 0.01, "{}", after(-0.1));
}

#[test]
fn a_jacobian_that_is_not_finite_is_singular() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut jacobian = SMatrix::<f64, 2, 2>::identity();
        jacobian[(0, 1)] = bad;
        assert!(right_inverse(&jacobian, TaskAxes::ALL, 0.0).is_err(), "{bad} in the Jacobian passed");
    }
}

#[test]
fn pose_difference_is_golden_from_the_smallest_turn_to_beyond_half_a_turn() {
    let golden = golden();
    for case in &golden.differences {
        let turned = Pose { position: Vector3::new(0.4, -1.5, 0.25), rotation: matrix(&case.turned) };
        let reference = Pose { position: Vector3::new(0.5, -1.0, 1.25), rotation: matrix(&case.reference) };
        let difference = turned.difference::<6>(&reference);
        assert_eq!(difference.fixed_rows::<3>(0), turned.position - reference.position);
        let error = (difference.fixed_rows::<3>(3) - Vector3::from(case.rotation_vector)).amax();
        assert!(error <= 1e-14, "a turn of {:e} rad is off by {error:e}: {difference:?}", case.angle);
        assert_eq!(turned.difference::<2>(&reference), difference.fixed_rows::<2>(0));
    }
}

/// With rotations whose entries carry no rounding of 1, a small turn keeps its digits: no acos, no
/// 1 − cos.
#[test]
fn small_turns_keep_their_relative_accuracy() {
    let golden = golden();
    let identity = Matrix3::identity();
    let small = golden.differences.iter().filter(|case| matrix(&case.reference) == identity && case.angle < 1e-2);
    let mut seen = 0;
    for case in small {
        let turned = Pose { position: Vector3::zeros(), rotation: matrix(&case.turned) };
        let difference = turned.difference::<6>(&Pose { position: Vector3::zeros(), rotation: identity });
        let error = (difference.fixed_rows::<3>(3) - Vector3::from(case.rotation_vector)).norm();
        assert!(error <= 1e-12 * case.angle, "a turn of {:e} rad is off by {error:e}", case.angle);
        seen += 1;
    }
    assert!(seen >= 12, "{seen} small turns");
}

#[test]
fn opposite_turns_of_nearly_half_a_turn_differ_in_sign_only() {
    let golden = golden();
    let sizes = golden.differences.iter().map(|case| Vector3::from(case.rotation_vector).norm());
    assert!(sizes.clone().all(|size| size <= PI), "the shorter way round is never more than half a turn");
    assert!(sizes.filter(|size| PI - size < 1e-8).count() >= 12);
    for case in golden.differences.iter().filter(|case| (case.angle - PI).abs() < 0.1) {
        let turned = Pose { position: Vector3::zeros(), rotation: matrix(&case.turned) };
        let reference = Pose { position: Vector3::zeros(), rotation: matrix(&case.reference) };
        let sum = turned.difference::<6>(&reference) + reference.difference::<6>(&turned);
        // Seen from either side the axis is the same: both rotations are about it.
        assert!(sum.amax() <= 1e-14, "there and back is {:e} off at {} rad", sum.amax(), case.angle);
    }
}

#[test]
fn what_is_no_chain_is_refused() {
    let kind = JointKind::Revolute;
    let joint = Joint { origin: Vector3::zeros(), rotation: Matrix3::identity(), axis: Vector3::z(), kind };
    let tool = Pose { position: Vector3::x(), rotation: Matrix3::identity() };
    assert!(Chain::new([joint; 2], tool).is_ok());
    let bad_axes = [Vector3::zeros(), Vector3::new(f64::NAN, 0.0, 1.0), Vector3::new(f64::INFINITY, 0.0, 0.0)];
    for axis in bad_axes {
        let error = Chain::new([joint, Joint { axis, ..joint }], tool).expect_err("an axis without a direction");
        assert!(error.to_string().starts_with("joint 1: the axis"), "{error}");
    }
    let bad_frames = [
        Joint { origin: Vector3::new(0.0, f64::NAN, 0.0), ..joint },
        Joint { rotation: Matrix3::zeros(), ..joint },
        Joint { rotation: -Matrix3::identity(), ..joint },
        Joint { rotation: Matrix3::identity() * 1.1, ..joint },
    ];
    for bad in bad_frames {
        let error = Chain::new([bad, joint], tool).expect_err("a frame that is none");
        assert!(error.to_string().starts_with("joint 0: origin and rotation"), "{error}");
    }
    let error = Chain::new([joint], Pose { rotation: Matrix3::from_element(f64::NAN), ..tool }).expect_err("no tool");
    assert!(error.to_string().starts_with("tool:"), "{error}");
}

/// J̇ q̇ against the difference of J q̇ on both sides of an arm whose joints turn about all axes, or
/// slide along some.
#[test]
fn the_acceleration_at_constant_joint_velocity_is_the_derivative_of_the_twist() {
    check_acceleration([JointKind::Revolute; 7]);
    let mut kinds = [JointKind::Revolute; 7];
    for index in [1, 4] {
        kinds[index] = JointKind::Prismatic;
        check_acceleration(kinds);
    }
}

/// q̈ of a redundant arm that keeps its twist, with W and on fewer axes too, against the difference of J⁻¹ ẋ on both sides; of its two parts
/// the one within the null space moves nothing of the task, and an arm of as many joints as axes has none.
#[test]
fn joints_that_keep_a_twist_accelerate_as_the_inverse_turns() {
    const STEP: f64 = 1e-5;
    let weight = Some(SVector::<f64, 7>::from_fn(|joint, _| 1.0 + joint as f64));
    let mut kinds = [JointKind::Revolute; 7];
    kinds[0] = JointKind::Prismatic;
    let four = TaskAxes::of([0, 1, 2, 5]).expect("axes");
    for (weight, axes) in [(None, TaskAxes::ALL), (weight, TaskAxes::ALL), (weight, four)] {
        let resolution = Resolution { weight, damping: None };
        let chain = chain_of(kinds).with_axes(axes).with_resolution(resolution);
        let q = SVector::<f64, 7>::from_fn(|joint, _| 0.3 + 0.2 * joint as f64);
        let twist = axes.kept(&Vector6::new(0.1, -0.2, 0.15, 0.3, -0.1, 0.2));
        let velocity =
            |q: &SVector<f64, 7>| Posture::<7, 6>::new(&chain, q).inverse(0.0).expect("regular").matrix * twist;
        let speed = velocity(&q);
        let expected = (velocity(&(q + speed * STEP)) - velocity(&(q - speed * STEP))) / (2.0 * STEP);
        let posture = Posture::<7, 6>::new(&chain, &q);
        let within = posture.null_acceleration_at_constant_twist(&speed);
        let turning = posture.acceleration_at_constant_joint_velocity(&speed);
        let acceleration = within - posture.inverse(0.0).expect("regular").matrix * turning;
        assert!((acceleration - expected).amax() < 1e-8, "{acceleration}, by differences {expected}");
        assert!(within.norm() > 0.01, "nothing is tested: {within}");
        assert!((posture.jacobian() * within).amax() < 1e-12, "it moves the task: {}", posture.jacobian() * within);
    }
    let golden = golden();
    let six = arm(&golden, 6);
    let posture = Posture::<6, 6>::new(&six.chain.chain(), &SVector::from_column_slice(&six.poses[0].q));
    let velocity = SVector::<f64, 6>::repeat(0.5);
    assert_eq!(posture.null_acceleration_at_constant_twist(&velocity), velocity * 0.0);
}

fn check_acceleration(kinds: [JointKind; 7]) {
    const STEP: f64 = 1e-5;
    let chain = chain_of(kinds);
    let q = SVector::<f64, 7>::from_fn(|joint, _| 0.3 + 0.2 * joint as f64);
    let speed = SVector::<f64, 7>::from_fn(|joint, _| 1.5 - 0.6 * joint as f64);
    let twist = |time: f64| Posture::<7, 6>::new(&chain, &(q + speed * time)).jacobian() * speed;
    let expected = (twist(STEP) - twist(-STEP)) / (2.0 * STEP);
    let acceleration = Posture::<7, 6>::new(&chain, &q).acceleration_at_constant_joint_velocity(&speed);
    assert!(expected.amin() > 0.1, "every axis is tested: {expected}");
    assert!((acceleration - expected).amax() < 1e-8, "{acceleration}, by differences {expected}");
}

/// Seven joints about all axes, or along them.
fn chain_of(kinds: [JointKind; 7]) -> Chain<7> {
    let joint = |index: usize| Joint {
        origin: Vector3::new(0.1, 0.3 / (1.0 + index as f64), 0.2),
        rotation: rotation_from_rpy([0.4 * index as f64, -0.7, 0.3]),
        axis: [Vector3::z(), Vector3::y(), Vector3::new(1.0, 1.0, 0.0)][index % 3],
        kind: kinds[index],
    };
    let tool = Pose { position: Vector3::new(0.1, 0.0, 0.2), rotation: Matrix3::identity() };
    Chain::new(std::array::from_fn(joint), tool).expect("a chain")
}
