//! The `[robot]` section: one description of the arm for the daemon's configuration and the plant's
//! scenarios.

use std::path::PathBuf;

use admittance_core::quantities::{AXIS_NAMES, is_linear};
use admittance_core::robot::{
    Chain, Joint, JointKind, Pose, SUPPORTED_ARMS, TaskAxes, VelocityLoops, rotation_from_rpy,
};
use admittance_core::with_arm;

use crate::config::ConfigError;

crate::config_enum! {
    /// How a joint moves along its axis.
    pub enum KindName {
        /// It turns: position, speed and limits in rad.
        Revolute = "revolute",
        /// It slides: position, speed and limits in m, also where a key ends in rad.
        Prismatic = "prismatic",
    }
}

impl KindName {
    /// As the law has it.
    pub fn kind(self) -> JointKind {
        match self {
            Self::Revolute => JointKind::Revolute,
            Self::Prismatic => JointKind::Prismatic,
        }
    }
}

crate::config_section! {
    /// One joint, in the manner of URDF.
    pub struct JointDescription {
        /// Origin of the joint frame in the parent's frame.
        origin_m: [f64; 3], unit "m", range -10.0..=10.0;
        /// Orientation of the joint frame in the parent's frame: fixed-axis roll, pitch, yaw.
        origin_rpy_rad: [f64; 3] = [0.0, 0.0, 0.0], unit "rad", range -7.0..=7.0;
        /// Axis in the joint frame about which a positive angle turns right-handed, or along which
        /// a prismatic joint slides; any length above zero.
        axis: [f64; 3] = [0.0, 0.0, 1.0], unit "1", range -1.0..=1.0;
        /// Whether it turns or slides: what it is measured in.
        kind: KindName = KindName::Revolute;
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
    /// What the joints' speed loops are beyond a lag, one value for each joint, base first.
    pub struct VelocityLoopDescription {
        /// Damping of a loop of second order, whose bandwidth at -3 dB is 1 /
        /// velocity_time_constant_s; 0 is a loop of first order, and so are all when absent.
        damping: Option<Vec<f64>>, unit "1", range 0.0..=5.0, length 2..=8;
        /// Time that a reference takes to reach the joint's loop; 0 when absent.
        dead_time_s: Option<Vec<f64>>, unit "s", range 0.0..=0.1, length 2..=8;
        /// Time constant of the lag with which the controller reports the joint velocities.
        report_lag_s: f64 = 0.0, unit "s", range 0.0..=0.1;
    }
}

crate::config_section! {
    /// Where a description is from that `admittancectl import` has printed. `admittancectl validate`
    /// warns when that file has changed since; nothing else looks at it.
    pub struct SourceDescription {
        /// The URDF; a relative path begins at the directory of this file.
        urdf: PathBuf, length 1..=4096;
        /// Its SHA-256 when it was imported: 64 hexadecimal digits.
        sha256: String, length 64..=64;
        /// The link whose frame is the base frame.
        base: String, length 1..=256;
        /// The link whose frame is the TCP.
        tip: String, length 1..=256;
    }
    cross_check check_source;
}

fn check_source(source: &SourceDescription, path: &str, errors: &mut Vec<ConfigError>) {
    if !source.sha256.chars().all(|digit| digit.is_ascii_hexdigit()) {
        let key = format!("{path}.sha256");
        errors.push(ConfigError::new(
            key,
            format!("{:?}", source.sha256),
            "64 hexadecimal digits, as sha256sum prints",
        ));
    }
}

crate::config_section! {
    /// The arm: a serial chain of joints, revolute or prismatic, with velocity-controlled drives.
    pub struct RobotDescription {
        /// What logs call it.
        name: String, length 1..=64;
        /// Number of values in every list over task axes: the first of x y z rx ry rz. 2 for an arm
        /// of two joints in a plane, 6 for any other.
        task_axes: u32, unit "axes", range 2..=6;
        /// Those of them that the arm controls, such as ["x", "y", "rz"] of three joints in a plane;
        /// all when absent. On the others nothing is commanded, no wrench is looked at, and what
        /// lists say of them has no effect.
        controlled_axes: Option<Vec<String>>, length 1..=6;
        /// Time constant T_V of each joint's speed loop (4), base first.
        velocity_time_constant_s: Vec<f64>, unit "s", range 0.0005..=0.5, length 2..=8;
        /// What the speed loops are beyond that lag.
        velocity_loop: Option<VelocityLoopDescription>;
        /// One table for each joint, base first.
        joint: Vec<JointDescription>, length 2..=8;
        /// Where the TCP is in the last link's frame.
        tool: ToolDescription;
        /// The URDF that the description is from; written by hand when absent.
        source: Option<SourceDescription>;
    }
    cross_check check_arm;
}

/// Below this a loop would ring for ever.
const LEAST_DAMPING: f64 = 0.1;

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
    if let Some(VelocityLoopDescription { damping, dead_time_s, .. }) = &robot.velocity_loop {
        for (name, list) in [("damping", damping), ("dead_time_s", dead_time_s)] {
            if let Some(found) = list.as_ref().map(Vec::len).filter(|found| *found != joints) {
                let accepted = format!("{joints} values, one for each [[{path}.joint]]");
                errors.push(ConfigError::new(
                    format!("{path}.velocity_loop.{name}"),
                    format!("{found} values"),
                    accepted,
                ));
            }
        }
        for (joint, damping) in damping.iter().flatten().enumerate() {
            if *damping > 0.0 && *damping < LEAST_DAMPING {
                let accepted = format!("0 for a loop of first order, or at least {LEAST_DAMPING}");
                errors.push(ConfigError::new(format!("{path}.velocity_loop.damping[{joint}]"), damping, accepted));
            }
        }
    }
    let axes = robot.task_axes;
    if !with_arm!((joints, axes), <_N, _D> => true, else false) {
        let found = format!("{axes} with {joints} joints");
        errors.push(ConfigError::new(format!("{path}.task_axes"), found, SUPPORTED_ARMS));
    }
    check_controlled(robot, path, errors);
    for (index, joint) in robot.joint.iter().enumerate() {
        if joint.axis.iter().map(|a| a * a).sum::<f64>() < 1e-6 {
            let key = format!("{path}.joint[{index}].axis");
            errors.push(ConfigError::new(key, format!("{:?}", joint.axis), "a vector that is not zero"));
        }
    }
}

fn check_controlled(robot: &RobotDescription, path: &str, errors: &mut Vec<ConfigError>) {
    let known = &AXIS_NAMES[..(robot.task_axes as usize).min(AXIS_NAMES.len())];
    let controlled = robot.controlled_axes.as_deref().unwrap_or_default();
    for (index, axis) in controlled.iter().enumerate() {
        if !known.contains(&axis.as_str()) || controlled[..index].contains(axis) {
            let key = format!("{path}.controlled_axes[{index}]");
            errors.push(ConfigError::new(key, format!("{axis:?}"), format!("each once, of {}", known.join(" "))));
        }
    }
}

impl RobotDescription {
    /// The axes of the task.
    pub fn controlled(&self) -> TaskAxes {
        let number = |name: &String| AXIS_NAMES.iter().position(|known| known == name);
        let told = self.controlled_axes.as_ref();
        told.and_then(|axes| TaskAxes::of(axes.iter().filter_map(number))).unwrap_or(TaskAxes::ALL)
    }

    /// The linear axes of the task.
    pub fn linear_axes(&self) -> impl Iterator<Item = usize> + use<> {
        let controlled = self.controlled();
        (0..self.task_axes as usize).filter(move |axis| is_linear(*axis) && controlled.has(*axis))
    }

    /// Damping of a joint's loop of second order; 0 of one of first order.
    pub fn damping(&self, joint: usize) -> f64 {
        let told = self.velocity_loop.as_ref().and_then(|told| told.damping.as_ref());
        told.map_or(0.0, |damping| damping[joint])
    }

    /// Dead time of a joint's loop, s.
    pub fn dead_time_s(&self, joint: usize) -> f64 {
        let told = self.velocity_loop.as_ref().and_then(|told| told.dead_time_s.as_ref());
        told.map_or(0.0, |dead_time_s| dead_time_s[joint])
    }

    /// Lag with which the joint velocities are reported, s.
    pub fn report_lag_s(&self) -> f64 {
        self.velocity_loop.as_ref().map_or(0.0, |told| told.report_lag_s)
    }

    /// The speed loops; `None` when the description has another number of joints than N.
    pub fn velocity_loops<const N: usize>(&self) -> Option<VelocityLoops<N>> {
        let joints = |values: &[f64]| <[f64; N]>::try_from(values).ok();
        let mut loops = VelocityLoops::first_order(joints(&self.velocity_time_constant_s)?.into());
        if let Some(VelocityLoopDescription { damping, dead_time_s, report_lag_s }) = &self.velocity_loop {
            if let Some(damping) = damping {
                loops.damping = joints(damping)?.into();
            }
            if let Some(dead_time) = dead_time_s {
                loops.dead_time = joints(dead_time)?.into();
            }
            loops.report_lag = *report_lag_s;
        }
        Some(loops)
    }

    /// The chain; `None` when the description has another number of joints than N.
    pub fn chain<const N: usize>(&self) -> Option<Chain<N>> {
        let joints: Vec<Joint> = self
            .joint
            .iter()
            .map(|joint| Joint {
                origin: joint.origin_m.into(),
                rotation: rotation_from_rpy(joint.origin_rpy_rad),
                axis: joint.axis.into(),
                kind: joint.kind.kind(),
            })
            .collect();
        let tool = Pose { position: self.tool.origin_m.into(), rotation: rotation_from_rpy(self.tool.origin_rpy_rad) };
        Some(Chain::new(joints.try_into().ok()?, tool).ok()?.with_axes(self.controlled()))
    }
}
