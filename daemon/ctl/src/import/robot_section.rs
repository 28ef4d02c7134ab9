//! The `[robot]` section, which a configuration and a scenario have in common.

use admittance_core::robot::JointKind;
use admittance_host::config::Value;
use admittance_host::robot_description::KindName;

use super::Origin;
use super::arm::{Arm, ArmJoint};
use super::marked::{list, shown, to_fill_in};
use super::xml::Shown;

/// Longest name of a robot, in characters.
const LONGEST_NAME: usize = 64;

/// The lines of the section.
pub(super) fn lines(arm: &Arm, origin: &Origin) -> Vec<String> {
    let name: String = arm.name.chars().filter(|character| !character.is_control()).take(LONGEST_NAME).collect();
    let name = if name.is_empty() { "arm".to_owned() } else { name };
    let constants = list(&vec![0.01; arm.joints.len()]);
    let mut lines = vec![
        "[robot]".to_owned(),
        format!("name = {}", name.to_toml()),
        format!("task_axes = {}", arm.task_axes),
        to_fill_in("velocity_time_constant_s", "[]", "s, of each joint's speed loop: from a step response", &constants),
        String::new(),
        "[robot.source]   # `admittancectl validate` says when this file has changed".to_owned(),
        format!("urdf = {}", origin.urdf.to_toml()),
        format!("sha256 = {}", origin.sha256.to_toml()),
        format!("base = {}", origin.base.to_toml()),
        format!("tip = {}", origin.tip.to_toml()),
    ];
    if let Some(controlled) = arm.controlled_names() {
        let line = format!("controlled_axes = {}   # that these joints can move the tip on", controlled.to_toml());
        lines.insert(3, line);
    }
    for (index, joint) in arm.joints.iter().enumerate() {
        lines.extend([String::new(), format!("# joint {index}: {}", described(joint)), "[[robot.joint]]".to_owned()]);
        lines.push(format!("origin_m = {}", list(joint.frame.pose.position.as_slice())));
        lines.push(format!("origin_rpy_rad = {}", list(&joint.frame.rpy)));
        lines.push(format!("axis = {}", list(&joint.axis)));
        if joint.kind == JointKind::Prismatic {
            lines.push(format!("kind = {}", KindName::Prismatic.to_toml()));
        }
    }
    lines.extend([String::new(), format!("[robot.tool]   # {} in the last joint's frame", Shown(&origin.tip))]);
    lines.push(format!("origin_m = {}", list(arm.tool.pose.position.as_slice())));
    lines.push(format!("origin_rpy_rad = {}", list(&arm.tool.rpy)));
    lines
}

fn described(joint: &ArmJoint) -> String {
    let kind = match joint.position {
        _ if joint.kind == JointKind::Prismatic && joint.is_soft => "prismatic within soft limits",
        _ if joint.kind == JointKind::Prismatic => "prismatic",
        Some(_) if joint.is_soft => "revolute within soft limits",
        Some(_) => "revolute",
        None => "continuous",
    };
    let [speed, effort] = match joint.kind {
        JointKind::Revolute => ["rad/s", "N m"],
        JointKind::Prismatic => ["m/s", "N"],
    };
    let said = |value: Option<f64>, unit: &str| {
        value.map_or("not said".to_owned(), |value| format!("{} {unit}", shown(value)))
    };
    format!("{}, {kind}, speed {}, effort {}", Shown(&joint.name), said(joint.speed, speed), said(joint.effort, effort))
}
