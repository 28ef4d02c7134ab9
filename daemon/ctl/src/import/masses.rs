//! What the arm's joints move, and with which torque: the `[rigid_body]` section of a scenario, and
//! `[dynamics]` of a configuration.

use std::ops::RangeInclusive;

use admittance_core::robot::LinkInertia;

use super::arm::{Arm, ArmJoint};
use super::marked::{list, number, shown, to_fill_in};
use super::xml::Shown;

/// What both sections take: torques in N m or N, friction in N m s/rad or N m, N s/m or N, masses in kg,
/// centres of gravity in m, tensors in kg m².
const TORQUES: RangeInclusive<f64> = 0.1..=1e5;
const FRICTION: RangeInclusive<f64> = 0.0..=1e4;
const MASSES: RangeInclusive<f64> = 0.001..=5000.0;
const CENTERS: RangeInclusive<f64> = -10.0..=10.0;
const TENSORS: RangeInclusive<f64> = -1e4..=1e4;
/// Most links that a comment names.
const MOST_NAMED: usize = 12;
/// Friction that an example has, in N m s/rad or N m.
const SOME_FRICTION: f64 = 1.0;

/// The lines of `[rigid_body]`: friction that the URDF does not say is none.
pub(super) fn of_plant(arm: &Arm) -> Vec<String> {
    of_each(arm, "rigid_body.joint", |joint| {
        let mut lines = Vec::new();
        for (key, value) in friction_of(joint) {
            lines.extend(value.filter(|friction| *friction > 0.0).map(|friction| friction_line(key, friction)));
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
        lines
    })
}

/// The lines of `[dynamics]`, which guesses no friction.
pub(super) fn of_observer(arm: &Arm) -> Vec<String> {
    of_each(arm, "dynamics.joint", |joint| {
        let line = |(key, value): (&str, Option<f64>)| match value {
            Some(friction) => friction_line(key, friction),
            None => to_fill_in(key, "nan", "the URDF says none", &number(SOME_FRICTION)),
        };
        friction_of(joint).map(line).into()
    })
}

/// Of each joint its body, and more.
fn of_each(arm: &Arm, table: &str, more: impl Fn(&ArmJoint) -> Vec<String>) -> Vec<String> {
    let mut lines = Vec::new();
    for (index, joint) in arm.joints.iter().enumerate() {
        lines.extend([format!("# joint {index}: {}", moved(joint)), format!("[[{table}]]")]);
        lines.extend(inertia(joint.body.inertia.as_ref()));
        lines.extend(more(joint));
        lines.push(String::new());
    }
    lines
}

fn friction_of(joint: &ArmJoint) -> [(&'static str, Option<f64>); 2] {
    let said = |value: usize| joint.friction.map(|friction| friction[value]);
    [("viscous_friction_n_m_s_rad", said(0)), ("coulomb_friction_n_m", said(1))]
}

fn friction_line(key: &str, friction: f64) -> String {
    if FRICTION.contains(&friction) {
        return format!("{key} = {}", number(friction));
    }
    not_accepted(key, "nan", &shown(friction), &FRICTION, &number(*FRICTION.end()))
}

/// A value of the URDF that no section takes.
fn not_accepted(key: &str, until_then: &str, said: &str, accepted: &RangeInclusive<f64>, example: &str) -> String {
    let [least, most] = [*accepted.start(), *accepted.end()].map(shown);
    to_fill_in(key, until_then, &format!("the URDF says {said}, accepted: {least} to {most}"), example)
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
    let usual = number((0.01 * link.mass).clamp(1e-5, *TENSORS.end()));
    let usual = format!("[{usual}, {usual}, {usual}, 0.0, 0.0, 0.0]");
    let entries_line = if !link.is_physical() {
        let why = format!("kg m^2: no body has what the URDF gives, {}", list(&entries));
        to_fill_in("inertia_kg_m2", "[]", &why, &usual)
    } else if entries.iter().all(|entry| TENSORS.contains(entry)) {
        format!("inertia_kg_m2 = {}   # xx yy zz xy xz yz", list(&entries))
    } else {
        not_accepted("inertia_kg_m2", "[]", &list(&entries), &TENSORS, &usual)
    };
    let mass_line = if MASSES.contains(&link.mass) {
        format!("mass_kg = {}", number(link.mass))
    } else {
        let nearest = number(link.mass.clamp(*MASSES.start(), *MASSES.end()));
        not_accepted("mass_kg", "nan", &shown(link.mass), &MASSES, &nearest)
    };
    let center = link.center_of_gravity;
    let center_line = if center.iter().all(|part| CENTERS.contains(part)) {
        format!("center_of_gravity_m = {}", list(center.as_slice()))
    } else {
        not_accepted("center_of_gravity_m", "[]", &list(center.as_slice()), &CENTERS, "[0.0, 0.0, 0.0]")
    };
    vec![mass_line, center_line, entries_line]
}
