//! The same cell seen from another side, with a task frame that is turned with it: what the law does is the same.

use admittance_host::robot_description::RobotDescription;
use end_to_end::closed_loop::{Experiment, Run};
use nalgebra::{Matrix3, Rotation3, Vector3};

pub(super) fn rotation(rpy: [f64; 3]) -> Matrix3<f64> {
    Rotation3::from_euler_angles(rpy[0], rpy[1], rpy[2]).into_inner()
}

pub(super) fn rpy_of(rotation: &Matrix3<f64>) -> [f64; 3] {
    let (roll, pitch, yaw) = Rotation3::from_matrix_unchecked(*rotation).euler_angles();
    [roll, pitch, yaw]
}

/// Its linear and its angular half turned.
pub(super) fn turned(rotation: &Matrix3<f64>, twist: &[f64]) -> [f64; 6] {
    let half = |first: usize| rotation * Vector3::from_fn(|row, _| twist[first + row]);
    let (linear, angular) = (half(0), half(3));
    [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
}

pub(super) fn vector(values: &[f64]) -> Vector3<f64> {
    Vector3::from_fn(|row, _| values[row])
}

/// The base of the arm and all that is around it turned by `by`, nothing else.
pub(super) fn turned_world(mut experiment: Experiment, by: &Matrix3<f64>) -> Experiment {
    let turn_arm = |robot: &mut RobotDescription| {
        let first = &mut robot.joint[0];
        first.origin_m = (by * vector(&first.origin_m)).into();
        first.origin_rpy_rad = rpy_of(&(by * rotation(first.origin_rpy_rad)));
    };
    let Experiment { config, scenario } = &mut experiment;
    turn_arm(&mut config.robot);
    turn_arm(&mut scenario.robot);
    let environment = &mut config.environment;
    environment.surface_normal = (by * vector(&environment.surface_normal)).into();
    environment.contact_point_m = environment.contact_point_m.map(|point| (by * vector(&point)).into());
    environment.contact_rpy_rad = rpy_of(&(by * rotation(environment.contact_rpy_rad)));
    config.wrench.gravity_m_s2 = (by * vector(&config.wrench.gravity_m_s2)).into();
    let surface = scenario.surface.as_mut().expect("a surface");
    surface.normal = (by * vector(&surface.normal)).into();
    surface.point_m = (by * vector(&surface.point_m)).into();
    if let Some(sensor) = &mut scenario.sensor {
        sensor.gravity_m_s2 = (by * vector(&sensor.gravity_m_s2)).into();
    }
    for phase in &mut scenario.motion {
        phase.twist = turned(by, &phase.twist).to_vec();
    }
    experiment
}

/// Largest difference of force in N, and of offsets turned back in m/s and rad/s.
pub(super) fn difference(one: &Run, other: &Run, by: &Matrix3<f64>) -> (f64, f64) {
    assert_eq!(one.instants.len(), other.instants.len());
    let differences = one.instants.iter().zip(&other.instants).map(|(one, other)| {
        let offset = turned(&by.transpose(), &other.command.velocity_offset);
        let offset = offset.iter().zip(one.command.velocity_offset).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        ((one.truth.normal_force_n - other.truth.normal_force_n).abs(), offset)
    });
    differences.fold((0.0, 0.0), |(a, b), (force, offset)| (f64::max(a, force), f64::max(b, offset)))
}
