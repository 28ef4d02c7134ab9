//! The `[robot]` section: one description of the arm for the daemon's configuration and the plant's
//! scenarios.

use admittance_core::robot::{Chain, Joint, Pose, SUPPORTED_ARMS, rotation_from_rpy};
use admittance_core::with_arm;

use crate::config::ConfigError;

crate::config_section! {
    /// One revolute joint, in the manner of URDF.
    pub struct JointDescription {
        /// Origin of the joint frame in the parent's frame.
        origin_m: [f64; 3], unit "m", range -10.0..=10.0;
        /// Orientation of the joint frame in the parent's frame: fixed-axis roll, pitch, yaw.
        origin_rpy_rad: [f64; 3] = [0.0, 0.0, 0.0], unit "rad", range -7.0..=7.0;
        /// Axis in the joint frame about which a positive angle turns right-handed; any length
        /// above zero.
        axis: [f64; 3] = [0.0, 0.0, 1.0], unit "1", range -1.0..=1.0;
    }
}

crate::config_section! {
    /// Where the TCP is in the last link's frame.
    pub struct ToolDescription {
        /// Position of the TCP.
        origin_m: [f64; 3] = [0.0, 0.0, 0.0], unit "m", range -10.0..=10.0;
        /// Orientation of the TCP: fixed-axis roll, pitch, yaw.
        origin_rpy_rad: [f64; 3] = [0.0, 0.0, 0.0], unit "rad", range -7.0..=7.0;
    }
}

crate::config_section! {
    /// The arm: a serial chain of revolute joints with velocity-controlled drives.
    pub struct RobotDescription {
        /// What logs call it.
        name: String, length 1..=64;
        /// Number of task axes that the arm controls, out of x y z rx ry rz: 2 for a planar arm, 6
        /// for a spatial one.
        task_axes: u32, unit "axes", range 2..=6;
        /// Time constant T_V of each joint's speed loop (4), base first.
        velocity_time_constant_s: Vec<f64>, unit "s", range 0.0005..=0.5, length 2..=8;
        /// One table for each joint, base first.
        joint: Vec<JointDescription>, length 2..=8;
        /// Where the TCP is in the last link's frame.
        tool: ToolDescription;
    }
    cross_check check_arm;
}

fn check_arm(robot: &RobotDescription, path: &str, errors: &mut Vec<ConfigError>) {
    let (joints, constants) = (robot.joint.len(), robot.velocity_time_constant_s.len());
    if joints != constants {
        let accepted = format!("{joints} values, one for each [[{path}.joint]]");
        errors.push(ConfigError::new(
            format!("{path}.velocity_time_constant_s"),
            format!("{constants} values"),
            accepted,
        ));
    }
    let axes = robot.task_axes;
    if !with_arm!((joints, axes), <_N, _D> => true, else false) {
        let found = format!("{axes} with {joints} joints");
        errors.push(ConfigError::new(format!("{path}.task_axes"), found, SUPPORTED_ARMS));
    }
    for (index, joint) in robot.joint.iter().enumerate() {
        if joint.axis.iter().map(|a| a * a).sum::<f64>() < 1e-6 {
            let key = format!("{path}.joint[{index}].axis");
            errors.push(ConfigError::new(key, format!("{:?}", joint.axis), "a vector that is not zero"));
        }
    }
}

impl RobotDescription {
    /// The chain; `None` when the description has another number of joints than N.
    pub fn chain<const N: usize>(&self) -> Option<Chain<N>> {
        let joints: Vec<Joint> = self
            .joint
            .iter()
            .map(|joint| Joint {
                origin: joint.origin_m.into(),
                rotation: rotation_from_rpy(joint.origin_rpy_rad),
                axis: joint.axis.into(),
            })
            .collect();
        let tool = Pose { position: self.tool.origin_m.into(), rotation: rotation_from_rpy(self.tool.origin_rpy_rad) };
        Chain::new(joints.try_into().ok()?, tool).ok()
    }
}
