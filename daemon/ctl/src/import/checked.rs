//! What urdf-rs would not notice, or not name, in a URDF: names that occur twice, numbers that are
//! none, what is missing where it then takes a default.

use std::collections::BTreeMap;

use roxmltree::{Document, Node};

use super::xml::{Refused, Shown, line_of};

/// Most links: as many joints connect them.
const MOST_LINKS: usize = 2_000;
/// Attributes that are numbers, of which element, and how many each has.
const NUMBERS: [(&str, &[&str], usize); 8] = [
    ("origin", &["xyz", "rpy"], 3),
    ("origin", &["quat_xyzw"], 4),
    ("axis", &["xyz"], 3),
    ("limit", &["lower", "upper", "effort", "velocity"], 1),
    ("mass", &["value"], 1),
    ("inertia", &["ixx", "ixy", "ixz", "iyy", "iyz", "izz"], 1),
    ("dynamics", &["damping", "friction"], 1),
    ("safety_controller", &["soft_lower_limit", "soft_upper_limit"], 1),
];
/// Types of joints that URDF knows.
const TYPES: [&str; 7] = ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical"];

/// What the text says of a link or joint, where urdf-rs has the same value for what it does not say.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Said {
    /// Line of the element, from 1.
    pub(super) line: Option<u32>,
    /// A link's `<inertial>`.
    pub(super) inertial: bool,
    /// The lower end of a joint's `<limit>`.
    pub(super) lower: bool,
    /// The upper one.
    pub(super) upper: bool,
    /// Its velocity.
    pub(super) velocity: bool,
    /// Its effort.
    pub(super) effort: bool,
    /// Ends of its `<safety_controller>`, which urdf-rs is not given: rad or m.
    pub(super) soft: [Option<f64>; 2],
}

/// What is said of the elements of one kind, by their names.
pub(super) type SaidOf = BTreeMap<String, Said>;

/// The links and joints of a URDF, each of which is complete by itself.
pub(super) fn links_and_joints(document: &Document<'_>) -> Result<(SaidOf, SaidOf), Refused> {
    let robot = document.root_element();
    if robot.tag_name().name() != "robot" {
        let why = format!("it begins with <{}>; accepted: a URDF, which begins with <robot>", robot.tag_name().name());
        return Err(Refused::new(line_of(robot), why));
    }
    let (mut links, mut joints) = (SaidOf::new(), SaidOf::new());
    let (mut counted, mut line) = (0, 1);
    for node in elements(robot) {
        // Counted on from the element before: from the beginning would take long for thousands.
        let begin = node.range().start;
        line += document.input_text()[counted..begin].matches('\n').count() as u32;
        counted = begin;
        let at_line = |said| Said { line: Some(line), ..said };
        match node.tag_name().name() {
            "link" => insert(&mut links, "link", node, at_line(link(node)?))?,
            "joint" => insert(&mut joints, "joint", node, at_line(joint(node)?))?,
            _ => {}
        }
    }
    if links.len() > MOST_LINKS {
        let why = format!("it has {} links; accepted: at most {MOST_LINKS}", links.len());
        return Err(Refused::new(None, why));
    }
    if links.is_empty() {
        return Err(Refused::new(None, "it has no <link>; accepted: the URDF of an arm"));
    }
    Ok((links, joints))
}

pub(super) fn elements<'a, 'input>(node: Node<'a, 'input>) -> impl Iterator<Item = Node<'a, 'input>> {
    node.children().filter(Node::is_element)
}

fn insert(all: &mut SaidOf, kind: &str, node: Node<'_, '_>, said: Said) -> Result<(), Refused> {
    let name = node.attribute("name").unwrap_or_default();
    match all.insert(name.to_owned(), said) {
        Some(Said { line: Some(first), .. }) => {
            let why = format!("{kind} {}: the name is that of line {first} too; give each {kind} its own", Shown(name));
            Err(Refused::new(said.line, why))
        }
        _ => Ok(()),
    }
}

/// An element with the words that messages call it by.
struct Named<'a, 'input> {
    node: Node<'a, 'input>,
    called: String,
}

impl<'a, 'input> Named<'a, 'input> {
    fn new(node: Node<'a, 'input>) -> Result<Self, Refused> {
        let kind = node.tag_name().name();
        match node.attribute("name").filter(|name| !name.is_empty()) {
            Some(name) => Ok(Self { node, called: format!("{kind} {}", Shown(name)) }),
            None => Err(Refused::new(line_of(node), format!("a <{kind}> without a name; give it one"))),
        }
    }

    fn refused(&self, node: Node<'_, '_>, why: &str) -> Refused {
        Refused::new(line_of(node), format!("{}: {why}", self.called))
    }

    /// The child of this name, which may be absent.
    fn child(&self, of: Node<'a, 'input>, name: &str) -> Result<Option<Node<'a, 'input>>, Refused> {
        let mut found = elements(of).filter(|child| child.tag_name().name() == name);
        let first = found.next();
        match found.next() {
            Some(second) => Err(self.refused(second, &format!("a second <{name}>; leave one"))),
            None => Ok(first),
        }
    }

    /// The value of an attribute that has to be there, of a child that has to be there.
    fn needed(&self, of: Node<'a, 'input>, child: &str, attribute: &str) -> Result<&'a str, Refused> {
        let found = self.child(of, child)?;
        found.and_then(|child| child.attribute(attribute)).filter(|value| !value.is_empty()).ok_or_else(|| {
            let parent = of.tag_name().name();
            self.refused(found.unwrap_or(of), &format!("its <{parent}> lacks <{child} {attribute}=\"…\">; say it"))
        })
    }

    /// Every number in it is one.
    fn numbers(&self) -> Result<(), Refused> {
        for node in self.node.descendants() {
            let of_this = NUMBERS.iter().filter(|(element, ..)| *element == node.tag_name().name());
            for (name, count) in of_this.flat_map(|(_, names, count)| names.iter().map(move |name| (name, *count))) {
                if let Some(value) = node.attribute(*name).filter(|value| !are_numbers(value, count)) {
                    let accepted =
                        if count == 1 { "a finite number".to_owned() } else { format!("{count} finite numbers") };
                    let element = node.tag_name().name();
                    let why = format!("{name} = {} of its <{element}>; accepted: {accepted}", Shown(value));
                    return Err(self.refused(node, &why));
                }
            }
        }
        Ok(())
    }
}

fn are_numbers(text: &str, count: usize) -> bool {
    let words: Vec<&str> = text.split_ascii_whitespace().take(count + 1).collect();
    words.len() == count && words.iter().all(|word| word.parse::<f64>().is_ok_and(f64::is_finite))
}

fn link(node: Node<'_, '_>) -> Result<Said, Refused> {
    let link = Named::new(node)?;
    link.numbers()?;
    let inertial = link.child(node, "inertial")?;
    if let Some(inertial) = inertial {
        link.child(inertial, "origin")?;
        link.needed(inertial, "mass", "value")?;
        for moment in ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"] {
            link.needed(inertial, "inertia", moment)?;
        }
    }
    Ok(Said { inertial: inertial.is_some(), ..Said::default() })
}

fn joint(node: Node<'_, '_>) -> Result<Said, Refused> {
    let joint = Named::new(node)?;
    joint.numbers()?;
    if !node.attribute("type").is_some_and(|found| TYPES.contains(&found)) {
        let found = Shown(node.attribute("type").unwrap_or_default());
        return Err(joint.refused(node, &format!("type = {found}; accepted: {}", TYPES.join(", "))));
    }
    joint.needed(node, "parent", "link")?;
    joint.needed(node, "child", "link")?;
    for once in ["origin", "dynamics"] {
        joint.child(node, once)?;
    }
    if let Some(axis) = joint.child(node, "axis")?.filter(|axis| axis.attribute("xyz").is_none()) {
        return Err(joint.refused(axis, "its <axis> lacks xyz; say it"));
    }
    if joint.child(node, "mimic")?.is_some() {
        joint.needed(node, "mimic", "joint")?;
    }
    let limit = joint.child(node, "limit")?;
    let has = |name: &str| limit.is_some_and(|limit| limit.attribute(name).is_some());
    let safety = joint.child(node, "safety_controller")?;
    let soft = ["soft_lower_limit", "soft_upper_limit"].map(|name| safety?.attribute(name)?.trim().parse().ok());
    let [lower, upper, velocity, effort] = ["lower", "upper", "velocity", "effort"].map(has);
    Ok(Said { lower, upper, velocity, effort, soft, ..Said::default() })
}
