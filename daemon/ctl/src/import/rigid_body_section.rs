//! The `[rigid_body]` section of a scenario: what the arm's joints move, and with which torque.

use admittance_core::robot::LinkInertia;

use super::arm::{Arm, ArmJoint};
use super::marked::{list, number, to_fill_in};
use super::xml::Shown;

/// Torques and forces that the section takes, in N m or N.
const TORQUES: std::ops::RangeInclusive<f64> = 0.1..=1e5;
/// Most links that a comment names.
const MOST_NAMED: usize = 12;

/// The lines of the section.
pub(super) fn lines(arm: &Arm) -> Vec<String> {
    let mut lines = Vec::new();
    for (index, joint) in arm.joints.iter().enumerate() {
        lines.extend([format!("# joint {index}: {}", moved(joint)), "[[rigid_body.joint]]".to_owned()]);
        lines.extend(inertia(joint.body.inertia.as_ref()));
        for (key, value) in [("viscous_friction_n_m_s_rad", 0), ("coulomb_friction_n_m", 1)] {
            if let Some(friction) = joint.friction.map(|friction| friction[value]).filter(|friction| *friction > 0.0) {
                lines.push(format!("{key} = {}", number(friction)));
            }
        }
        match joint.effort {
            Some(effort) if TORQUES.contains(&effort) => lines.push(format!("torque_limit_n_m = {}", number(effort))),
            _ => lines.push("# torque_limit_n_m: the URDF says none that is one; without end when absent".to_owned()),
        }
        lines.push(to_fill_in(
            "speed_gain_n_m_s_rad",
            "nan",
            "N m s/rad (N s/m of a prismatic joint), of the drive's speed loop",
            "100.0",
        ));
        lines.push(String::new());
    }
    lines
}

fn names(all: &[String]) -> String {
    let named: Vec<_> = all.iter().take(MOST_NAMED).map(|name| Shown(name).to_string()).collect();
    let more = if all.len() > MOST_NAMED { ", …" } else { "" };
    named.join(", ") + more
}

/// What the joint moves.
fn moved(joint: &ArmJoint) -> String {
    let body = &joint.body;
    let held = match body.held_joints.as_slice() {
        [] => String::new(),
        held => format!("; as if at zero: {}", names(held)),
    };
    format!("{} moves {}{held}", Shown(&joint.name), names(&body.links))
}

fn inertia(found: Option<&LinkInertia>) -> Vec<String> {
    let none = "the URDF gives this link no mass";
    let Some(link) = found else {
        return vec![
            to_fill_in("mass_kg", "nan", &format!("kg: {none}"), "1.0"),
            to_fill_in("center_of_gravity_m", "[]", &format!("m: {none}"), "[0.0, 0.0, 0.0]"),
            to_fill_in("inertia_kg_m2", "[]", &format!("kg m^2: {none}"), "[0.01, 0.01, 0.01, 0.0, 0.0, 0.0]"),
        ];
    };
    let tensor = &link.inertia;
    let entries = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|entry| tensor[entry]);
    let entries_key = match link.is_physical() {
        true => format!("inertia_kg_m2 = {}   # xx yy zz xy xz yz", list(&entries)),
        false => {
            let why = format!("kg m^2: no body has what the URDF gives, {}", list(&entries));
            let moment = number(0.01 * link.mass);
            to_fill_in("inertia_kg_m2", "[]", &why, &format!("[{moment}, {moment}, {moment}, 0.0, 0.0, 0.0]"))
        }
    };
    vec![
        format!("mass_kg = {}", number(link.mass)),
        format!("center_of_gravity_m = {}", list(link.center_of_gravity.as_slice())),
        entries_key,
    ]
}
