//! The scenario file: the arm with its masses for plant-sim, as far as a URDF says it.

use super::Origin;
use super::arm::Arm;
use super::marked::{list, to_fill_in};
use super::{masses, robot_section};

/// Largest joint position at the start that a scenario takes, in rad or m.
const LARGEST_START: f64 = 7.0;

/// The text of the file: the arm in free space.
pub(super) fn text(arm: &Arm, origin: &Origin) -> String {
    let middle = |joint: &super::arm::ArmJoint| {
        let [lower, upper] = joint.position.unwrap_or_default();
        ((lower + upper) / 2.0).clamp(-LARGEST_START, LARGEST_START)
    };
    let start: Vec<f64> = arm.joints.iter().map(middle).collect();
    let mut twist = vec![0.0; arm.task_axes];
    if let Some(axis) = (0..arm.task_axes).find(|axis| arm.controls(*axis)) {
        twist[axis] = 0.05;
    }
    let sections = [
        vec![
            format!("# Imported: admittancectl import {} --scenario", origin.words()),
            "# What the URDF does not say is marked with FILL IN, and refused until it is filled in. Surface, sensor and faults"
                .to_owned(),
            "# are in plant-sim/scenarios; every key is described by `admittancectl validate --scenario --keys`.".to_owned(),
            to_fill_in("name", "\"\"", "what it shows", "\"an imported arm\""),
        ],
        vec!["[ipc]   # as the daemon's configuration has it".to_owned()],
        robot_section::lines(arm, origin),
        masses::of_plant(arm),
        vec![
            "[timing]".to_owned(),
            to_fill_in("sampling_time_s", "nan", "s, the motion controller's cycle", "0.004"),
            to_fill_in("command_delay_s", "nan", "s from a sample's stamp until its command acts", "0.0005"),
        ],
        vec![
            "[start]".to_owned(),
            to_fill_in("joint_position_rad", "[]", "rad, m of prismatic joints: where the arm starts, nowhere singular", &list(&start)),
        ],
        vec![
            "[wrench]".to_owned(),
            to_fill_in("time_constant_s", "[]", "s, of the wrench estimate", &list(&vec![0.02; arm.task_axes])),
        ],
        vec![
            "[[motion]]".to_owned(),
            to_fill_in("duration_s", "nan", "s, of this motion", "1.0"),
            to_fill_in("twist", "[]", "m/s and rad/s on each task axis", &list(&twist)),
        ],
    ];
    let mut text = sections.map(|lines| lines.join("\n")).join("\n\n");
    text.push('\n');
    text
}
