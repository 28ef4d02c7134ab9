//! A URDF's text, checked, and then read by urdf-rs.

use roxmltree::{Attribute, Node};

use super::checked::{SaidOf, elements, links_and_joints};
use super::xml::{self, Refused};
use crate::report::chart::escape;

/// What of a URDF describes an arm, by the elements that each one may have.
const KEPT: [(&str, &[&str]); 4] = [
    ("robot", &["link", "joint"]),
    ("link", &["inertial"]),
    ("inertial", &["origin", "mass", "inertia"]),
    ("joint", &["origin", "parent", "child", "axis", "limit", "mimic", "dynamics"]),
];

/// Attributes that are read of these elements: what others urdf-rs knows could be no numbers.
const ATTRIBUTES: [(&str, &[&str]); 2] = [("limit", &["lower", "upper", "effort", "velocity"]), ("mimic", &["joint"])];

/// The robot, with what only its text shows.
#[derive(Debug)]
pub(super) struct Described {
    pub(super) robot: urdf_rs::Robot,
    pub(super) links: SaidOf,
    pub(super) joints: SaidOf,
}

impl Described {
    /// From a text of [`xml::LARGEST_URDF`] at most.
    pub(super) fn parse(text: &str) -> Result<Self, Refused> {
        let document = xml::parsed(text)?;
        let (links, joints) = links_and_joints(&document)?;
        let mut plain = String::with_capacity(text.len());
        write(document.root_element(), &mut plain);
        // What is checked by now it reads; should it not, its own message is better than none.
        let robot = urdf_rs::read_from_string(&plain)
            .map_err(|error| Refused::new(None, format!("urdf-rs does not read it: {error}; accepted: a URDF")))?;
        Ok(Self { robot, links, joints })
    }
}

/// Whether an element is one that describes an arm.
pub(super) fn is_kept(node: Node<'_, '_>) -> bool {
    let of = |parent: Node<'_, '_>| KEPT.iter().find(|(element, _)| *element == parent.tag_name().name());
    let is_of = |parent: Node<'_, '_>| {
        of(parent).is_some_and(|(_, kept)| kept.contains(&node.tag_name().name())) && is_kept(parent)
    };
    match node.parent_element() {
        Some(parent) => is_of(parent),
        None => node.is_element(),
    }
}

/// Only what describes an arm: meshes, sensors and extensions, which may hold anything, are nothing
/// that an import could fail on.
fn write(node: Node<'_, '_>, plain: &mut String) {
    let name = node.tag_name().name();
    plain.extend(["<", name]);
    let read = ATTRIBUTES.iter().find(|(element, _)| *element == name).map(|(_, read)| *read);
    let is_read = |attribute: &Attribute<'_, '_>| {
        attribute.namespace().is_none() && read.is_none_or(|read| read.contains(&attribute.name()))
    };
    for attribute in node.attributes().filter(is_read) {
        plain.extend([" ", attribute.name(), "=\""]);
        plain.extend([&*escape(attribute.value()), "\""]);
    }
    if name == "limit" && !node.has_attribute("velocity") {
        // urdf-rs refuses a limit without one, by a message that names no joint; `Said` knows that it is absent.
        plain.push_str(" velocity=\"0\"");
    }
    plain.push('>');
    let kept = KEPT.iter().find(|(element, _)| *element == name).map_or(&[][..], |(_, kept)| kept);
    elements(node).filter(|child| kept.contains(&child.tag_name().name())).for_each(|child| write(child, plain));
    plain.extend(["</", name, ">"]);
}
