//! Poses of any supported arm: the TCP of a joint position, the joint position for a TCP, and how
//! fast the joints turn there.

use admittance_core::robot::{Chain, Pose};
use admittance_core::with_arm;
use admittance_host::robot_description::RobotDescription;
use nalgebra::{Matrix3, SVector};

use crate::motion::MINIMUM_RECIPROCAL_CONDITION;
use crate::setup::inverse_kinematics;

/// A joint position with what follows from it.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmPose {
    /// Joint position in rad or m.
    pub joint_position_rad: Vec<f64>,
    /// Position of the TCP in m, base frame.
    pub tcp_position_m: [f64; 3],
    /// The TCP's axes in the base frame, as columns.
    pub tcp_axes: Matrix3<f64>,
    /// Reciprocal condition number of the task Jacobian (Frobenius norm); 0 where the arm is
    /// singular.
    pub reciprocal_condition: f64,
    /// J⁻¹, row by row: joint velocity in rad/s or m/s per unit of each task axis; empty where the arm is
    /// singular.
    inverse_jacobian: Vec<Vec<f64>>,
    /// J, column by column: twist of the TCP per joint velocity.
    jacobian: Vec<Vec<f64>>,
}

impl ArmPose {
    /// Joint velocity in rad/s or m/s for a twist of the TCP, one value per task axis; `None` where the
    /// arm is singular.
    pub fn joint_velocity_rad_s(&self, twist: &[f64]) -> Option<Vec<f64>> {
        let rows = self.inverse_jacobian.iter();
        let velocity = rows.map(|row| row.iter().zip(twist).map(|(inverse, speed)| inverse * speed).sum());
        (!self.inverse_jacobian.is_empty()).then(|| velocity.collect())
    }

    /// J, column by column: twist of the TCP in m/s and rad/s per unit of each joint's velocity.
    pub fn jacobian(&self) -> &[Vec<f64>] {
        &self.jacobian
    }

    /// The twist with the largest speed along `direction` (base frame) that keeps the speed limits
    /// of the joints in rad/s: each joint at its limit, the way that helps. `None` where the arm is
    /// singular.
    pub fn fastest_twist(&self, direction: &[f64; 3], limits_rad_s: &[f64]) -> Option<Vec<f64>> {
        let mut twist = vec![0.0; self.jacobian.first()?.len()];
        for (column, limit) in self.jacobian.iter().zip(limits_rad_s) {
            let lever: f64 = column.iter().zip(direction).map(|(moved, along)| moved * along).sum();
            twist.iter_mut().zip(column).for_each(|(twist, moved)| *twist += moved * limit.copysign(lever));
        }
        (!self.inverse_jacobian.is_empty()).then_some(twist)
    }
}

/// The pose of a joint position; `None` when the arm is not one that the plant knows, or has
/// another number of joints.
pub fn at(robot: &RobotDescription, joint_position_rad: &[f64]) -> Option<ArmPose> {
    find(robot, joint_position_rad, None)
}

/// The pose with the TCP at `point_m`, near a guess and in the guess's orientation (which a planar
/// arm cannot choose); `None` when Newton's method does not arrive there.
pub fn near(robot: &RobotDescription, guess_rad: &[f64], point_m: [f64; 3]) -> Option<ArmPose> {
    find(robot, guess_rad, Some(point_m))
}

fn find(robot: &RobotDescription, guess_rad: &[f64], point_m: Option<[f64; 3]>) -> Option<ArmPose> {
    with_arm!(
        (robot.joint.len(), robot.task_axes),
        <N, D> => find_arm::<N, D>(robot, guess_rad, point_m),
        else None
    )
}

fn find_arm<const N: usize, const D: usize>(
    robot: &RobotDescription,
    guess_rad: &[f64],
    point_m: Option<[f64; 3]>,
) -> Option<ArmPose> {
    let chain: Chain<N> = robot.chain()?;
    let guess: [f64; N] = guess_rad.try_into().ok()?;
    let mut position = SVector::from(guess);
    if let Some(point) = point_m {
        let target = Pose { position: point.into(), rotation: chain.kinematics(&position).pose.rotation };
        position = inverse_kinematics::<N, D>(&chain, &position, &target)?;
    }
    let kinematics = chain.kinematics(&position);
    let jacobian = kinematics.task_jacobian::<D>();
    let inverse = kinematics.inverse::<D>(MINIMUM_RECIPROCAL_CONDITION);
    let (reciprocal_condition, inverse_jacobian) = match inverse {
        Ok(inverse) => {
            let rows = inverse.matrix.row_iter().map(|row| row.iter().copied().collect());
            (inverse.reciprocal_condition, rows.collect())
        }
        Err(singular) => (singular.reciprocal_condition, Vec::new()),
    };
    Some(ArmPose {
        joint_position_rad: position.as_slice().to_vec(),
        tcp_position_m: kinematics.pose.position.into(),
        tcp_axes: kinematics.pose.rotation,
        reciprocal_condition,
        inverse_jacobian,
        jacobian: jacobian.column_iter().map(|column| column.iter().copied().collect()).collect(),
    })
}

#[cfg(test)]
mod tests {
    use admittance_host::config::parse;

    use super::*;
    use crate::scenario::Scenario;

    fn robot(text: &str) -> RobotDescription {
        parse::<Scenario>(text, "scenario.toml").unwrap().robot
    }

    #[test]
    fn a_pose_near_a_guess_has_the_tcp_at_the_point() {
        let robot = robot(include_str!("../scenarios/paper.toml"));
        let pose = near(&robot, &[1.3, -1.4], [1.32, 0.68, 0.0]).unwrap();
        assert!((pose.tcp_position_m[0] - 1.32).abs() < 1e-9 && (pose.tcp_position_m[1] - 0.68).abs() < 1e-9);
        assert!(pose.joint_position_rad[1] < 0.0 && pose.reciprocal_condition > 0.1);
        assert_eq!(near(&robot, &[1.3, -1.4], [3.0, 0.0, 0.0]), None, "out of reach");
        assert_eq!(near(&robot, &[1.3], [1.32, 0.68, 0.0]), None, "a joint is missing");
    }

    #[test]
    fn joint_velocities_move_the_tcp_as_asked() {
        let robot = robot(include_str!("../scenarios/six-joint.toml"));
        let q = [0.3, 1.2, -1.8, 2.2, 1.57, 0.3];
        let (here, h) = (at(&robot, &q).unwrap(), 1e-6);
        let velocity = here.joint_velocity_rad_s(&[0.0, 0.0, -0.5, 0.0, 0.0, 0.0]).unwrap();
        let there: Vec<f64> = q.iter().zip(&velocity).map(|(q, speed)| q + h * speed).collect();
        let there = at(&robot, &there).unwrap();
        for (axis, speed) in [0.0, 0.0, -0.5].into_iter().enumerate() {
            assert!(((there.tcp_position_m[axis] - here.tcp_position_m[axis]) / h - speed).abs() < 1e-4);
        }
    }

    #[test]
    fn a_stretched_arm_has_no_joint_velocity() {
        let pose = at(&robot(include_str!("../scenarios/paper.toml")), &[0.3, 0.0]).unwrap();
        assert!(pose.reciprocal_condition < 1e-4 && pose.joint_velocity_rad_s(&[0.0, 1.0]).is_none());
    }
}
