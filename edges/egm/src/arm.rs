//! The arm's kinematics between joints, which the robot speaks of, and the TCP, which the daemon speaks of.

use admittance_client::Rotation;
use admittance_core::robot::Chain;
use admittance_core::with_arm;
use admittance_host::robot_description::RobotDescription;
use ipc_types::{MAX_JOINTS, TASK_AXES};
use nalgebra::SVector;

/// An arm of any number of joints.
pub trait AnyArm {
    /// The TCP's velocity in m/s and rad/s, base frame, at joint positions and speeds in rad or m.
    fn twist(&self, position: &[f64; MAX_JOINTS], velocity: &[f64; MAX_JOINTS]) -> [f64; TASK_AXES];

    /// Axes of the tool's frame in the base frame, as columns, at joint positions in rad or m.
    fn tool(&self, position: &[f64; MAX_JOINTS]) -> Rotation;

    /// Joint speeds in rad/s or m/s that move the TCP so; `None` near a pose where there are none.
    fn joint_velocity(&self, position: &[f64; MAX_JOINTS], twist: &[f64; TASK_AXES]) -> Option<[f64; MAX_JOINTS]>;
}

struct Arm<const N: usize, const D: usize> {
    chain: Chain<N>,
    minimum_reciprocal_condition: f64,
}

impl<const N: usize, const D: usize> AnyArm for Arm<N, D> {
    fn twist(&self, position: &[f64; MAX_JOINTS], velocity: &[f64; MAX_JOINTS]) -> [f64; TASK_AXES] {
        let (position, velocity) = (of_joints::<N>(position), of_joints::<N>(velocity));
        padded((self.chain.kinematics(&position).task_jacobian::<D>() * velocity).as_slice())
    }

    fn tool(&self, position: &[f64; MAX_JOINTS]) -> Rotation {
        let rotation = self.chain.kinematics(&of_joints::<N>(position)).pose.rotation;
        std::array::from_fn(|column| std::array::from_fn(|row| rotation[(row, column)]))
    }

    fn joint_velocity(&self, position: &[f64; MAX_JOINTS], twist: &[f64; TASK_AXES]) -> Option<[f64; MAX_JOINTS]> {
        let inverse =
            self.chain.kinematics(&of_joints::<N>(position)).inverse::<D>(self.minimum_reciprocal_condition).ok()?;
        let velocity = inverse.joint_velocity(&SVector::<f64, D>::from_column_slice(&twist[..D]));
        velocity.iter().all(|speed| speed.is_finite()).then(|| padded(velocity.as_slice()))
    }
}

fn of_joints<const N: usize>(values: &[f64; MAX_JOINTS]) -> SVector<f64, N> {
    SVector::from_column_slice(&values[..N])
}

fn padded<const LENGTH: usize>(values: &[f64]) -> [f64; LENGTH] {
    std::array::from_fn(|index| values.get(index).copied().unwrap_or(0.0))
}

/// The arm of a description; `None` when it has a number of joints that no arm here has, which no valid file says.
pub fn any_arm(robot: &RobotDescription, minimum_reciprocal_condition: f64) -> Option<Box<dyn AnyArm>> {
    with_arm!((robot.joint.len(), robot.task_axes), <N, D> => {
        Some(Box::new(Arm::<N, D> { chain: robot.chain::<N>()?, minimum_reciprocal_condition }))
    }, else { None })
}
