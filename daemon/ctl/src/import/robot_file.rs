//! The robot file: the daemon's configuration of an arm, as far as a URDF says it.

use super::Origin;
use super::arm::{Arm, LEAST_CONDITION};
use super::marked::{list, to_fill_in};
use super::{masses, robot_section};

/// Speeds that a configuration takes, in rad/s or m/s.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=100.0;
/// Largest position that a configuration takes, in rad or m: as good as none.
const NO_LIMIT: f64 = 100.0;

/// Examples per task axis: those of linear ones, of angular ones.
fn per_axis(arm: &Arm, linear: f64, angular: f64) -> String {
    let linear_axes = arm.task_axes.min(3);
    list(&(0..arm.task_axes).map(|axis| if axis < linear_axes { linear } else { angular }).collect::<Vec<_>>())
}

/// The text of the file.
pub(super) fn text(arm: &Arm, origin: &Origin) -> String {
    let sections = [
        head(origin),
        robot_section::lines(arm, origin),
        control(),
        contact(arm),
        environment(arm),
        mpc(arm),
        limits(arm),
        dynamics(arm, origin),
    ];
    let mut text = sections.map(|lines| lines.join("\n")).join("\n\n");
    text.push('\n');
    text
}

fn head(origin: &Origin) -> Vec<String> {
    vec![
        format!("# Imported: admittancectl import {}", origin.words()),
        "# What the URDF does not say is marked with FILL IN, and refused until it is filled in; docs/commissioning.md says".to_owned(),
        "# how. Every key is described by `admittancectl validate --keys`; other sections are in deploy/robots.".to_owned(),
        String::new(),
        "[ipc]   # as the units have it: root_path /run/admittanced, and the instance's name from the unit's".to_owned(),
    ]
}

fn control() -> Vec<String> {
    vec![
        "[control]".to_owned(),
        "law = \"mpc\"".to_owned(),
        to_fill_in("sampling_time_s", "nan", "s, the motion controller's cycle", "0.004"),
        to_fill_in("command_delay_s", "nan", "s from a sample's stamp until its command acts", "0.0005"),
        to_fill_in("answer_budget_s", "nan", "s, later answers count as late; at most the cycle", "0.001"),
        to_fill_in("max_sample_age_s", "nan", "s, three cycles", "0.012"),
        format!(
            "minimum_reciprocal_condition = {LEAST_CONDITION}   # where the arm counts as singular: raise it to stop earlier"
        ),
    ]
}

fn contact(arm: &Arm) -> Vec<String> {
    let axes: Vec<_> = (0..arm.task_axes).map(|axis| (axis < 3 && arm.controls(axis)).to_string()).collect();
    let each = |key: &str, meaning: &str, linear: f64, angular: f64| {
        to_fill_in(key, "[]", meaning, &per_axis(arm, linear, angular))
    };
    vec![
        "[wrench]".to_owned(),
        to_fill_in("given_in", "\"\"", "\"base\" or \"sensor\": the axes of the wrench that is given", "\"base\""),
        to_fill_in("sign", "\"\"", "\"reaction\": a sensor that reports what the robot feels", "\"on_environment\""),
        String::new(),
        "[contact]   # one value for each task axis, x y z rx ry rz: N for forces, N m for torques".to_owned(),
        to_fill_in("admittance_axes", "\"\"", "which axes give way", &format!("[{}]", axes.join(", "))),
        each("activation_threshold", "well above the wrench's noise", 5.0, 1.0),
        each("release_threshold", "below the minimum force", 3.0, 0.5),
        each("force_limit", "what tool and workpiece stand", 100.0, 10.0),
        each("minimum_force", "contact is kept with this much", 6.0, 1.0),
        each("wrench_time_constant_s", "s, of the wrench estimate; 0 for a sensor without lag", 0.02, 0.02),
    ]
}

fn environment(arm: &Arm) -> Vec<String> {
    let normal = match [2, 1].into_iter().find(|axis| arm.controls(*axis)) {
        Some(2) => "[0.0, 0.0, 1.0]",
        Some(_) => "[0.0, 1.0, 0.0]",
        None => "[1.0, 0.0, 0.0]",
    };
    // Within reach: on the way to where the TCP is with every joint at zero.
    let first = arm.joints.first().map(|joint| joint.frame.pose.position).unwrap_or_default();
    let frames = arm.joints.iter().map(|joint| &joint.frame).chain([&arm.tool]);
    let tip = frames.fold(super::frame::Frame::identity(), |so_far, next| so_far.then(next)).pose.position;
    let point: Vec<f64> = first.lerp(&tip, 0.9).iter().map(|part| (part * 1e3).round() / 1e3).collect();
    vec![
        "[environment]".to_owned(),
        to_fill_in("normal_stiffness_n_m", "nan", "N/m, of the surface: rather too high than too low", "1e5"),
        to_fill_in("surface_normal", "[]", "out of the material, base frame", normal),
        to_fill_in("contact_point_m", "[]", "m, base frame: where the TCP first touches", &list(&point)),
    ]
}

fn mpc(arm: &Arm) -> Vec<String> {
    let weights = |key: &str, linear: f64, angular: f64| format!("{key} = {}", per_axis(arm, linear, angular));
    vec![
        "[mpc]   # of the default profile".to_owned(),
        weights("position_weight", 0.0, 0.0),
        weights("velocity_weight", 1000.0, 100.0),
        weights("wrench_weight", 1e-4, 1e-4),
        weights("input_weight", 10.0, 1.0),
    ]
}

fn limits(arm: &Arm) -> Vec<String> {
    let speeds: Vec<f64> = arm.joints.iter().map(|joint| joint.speed.unwrap_or(f64::NAN)).collect();
    let usable = |speed: &f64| SPEEDS.contains(speed);
    let speed = if speeds.iter().all(usable) {
        format!("joint_speed_rad_s = {}   # what the drives can do", list(&speeds))
    } else {
        let told = |nothing: f64| {
            list(&speeds.iter().map(|speed| if usable(speed) { *speed } else { nothing }).collect::<Vec<_>>())
        };
        let meaning = "rad/s, m/s of prismatic joints: what the drives can do; nan where the URDF says no speed, 0, or one that no drive has";
        to_fill_in("joint_speed_rad_s", &told(f64::NAN).replace("NaN", "nan"), meaning, &told(1.0))
    };
    let mut lines = vec![
        "[limits]".to_owned(),
        format!("velocity_offset = {}   # of the default profile", per_axis(arm, 2.0, 6.0)),
        speed,
        "# joint_acceleration_rad_s2, joint_jerk_rad_s3: optional, from the drives' documentation. A URDF has none."
            .to_owned(),
    ];
    let ends = |end: usize| -> Vec<f64> {
        let no_limit = [-NO_LIMIT, NO_LIMIT];
        let of_joint = |joint: &super::arm::ArmJoint| joint.position.unwrap_or(no_limit);
        arm.joints.iter().map(|joint| of_joint(joint)[end].clamp(-NO_LIMIT, NO_LIMIT)).collect()
    };
    if [ends(0), ends(1)].concat().iter().any(|end| end.abs() == NO_LIMIT) {
        lines.push(format!("# {NO_LIMIT} rad is no limit: the joint turns without end."));
    }
    let soft = arm.joints.iter().enumerate().filter(|(_, joint)| joint.is_soft);
    let soft: Vec<String> = soft.map(|(index, _)| index.to_string()).collect();
    if !soft.is_empty() {
        lines.push(format!(
            "# Of joint {}: the soft limits of <safety_controller>, which are narrower.",
            soft.join(", ")
        ));
    }
    lines.push(format!("joint_position_min_rad = {}", list(&ends(0))));
    lines.push(format!("joint_position_max_rad = {}", list(&ends(1))));
    lines
}

/// What most configurations do not need, as a comment.
fn dynamics(arm: &Arm, origin: &Origin) -> Vec<String> {
    let head = [
        "# Masses, for a wrench from motor torques (wrench.source = \"motor_torque\", of joints that turn): without the first \"# \""
            .to_owned(),
        "# of each line from here on. For plant-sim they are in a scenario:".to_owned(),
        format!("# admittancectl import {} --scenario", origin.words()),
        "#".to_owned(),
    ];
    let commented = |line: String| if line.is_empty() { "#".to_owned() } else { format!("# {line}") };
    head.into_iter().chain(masses::of_observer(arm).into_iter().map(commented)).collect()
}
