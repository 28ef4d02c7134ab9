//! The links and joints of a URDF as a tree, and the way from one link to another in it.

use std::collections::HashMap;

use urdf_rs::Joint;

use super::document::Described;
use super::xml::{Refused, Shown};

/// Most links that a message names.
const MOST_NAMED: usize = 40;

/// Every link but the roots hangs on one joint.
#[derive(Debug)]
pub(super) struct Tree<'a> {
    described: &'a Described,
    /// The joint whose child a link is.
    above: HashMap<&'a str, &'a Joint>,
    /// The joints whose parent a link is, in the order of the text.
    below: HashMap<&'a str, Vec<&'a Joint>>,
}

impl<'a> Tree<'a> {
    /// Refused are joints of unknown links, and loops.
    pub(super) fn of(described: &'a Described) -> Result<Self, Refused> {
        let (mut above, mut below) = (HashMap::new(), HashMap::<_, Vec<_>>::new());
        let tree = |above, below| Self { described, above, below };
        for joint in &described.robot.joints {
            let line = described.joints.get(&joint.name).and_then(|said| said.line);
            for (which, link) in [("parent", &joint.parent.link), ("child", &joint.child.link)] {
                if !described.links.contains_key(link) {
                    let why = format!(
                        "joint {}: its {which} {} is no link of the file; name one that is",
                        Shown(&joint.name),
                        Shown(link)
                    );
                    return Err(Refused::new(line, why));
                }
            }
            if let Some(other) = above.insert(joint.child.link.as_str(), joint) {
                let why = format!(
                    "link {} is a loop: it is the child of joint {} and of joint {}; cut it at one of them",
                    Shown(&joint.child.link),
                    Shown(&other.name),
                    Shown(&joint.name)
                );
                return Err(Refused::new(line, why));
            }
            below.entry(joint.parent.link.as_str()).or_default().push(joint);
        }
        let tree = tree(above, below);
        tree.has_no_circle()?;
        Ok(tree)
    }

    /// From the roots every link is reached, but those that hang on each other.
    fn has_no_circle(&self) -> Result<(), Refused> {
        let links = || self.described.robot.links.iter().map(|link| link.name.as_str());
        let mut reached: Vec<&str> = links().filter(|link| !self.above.contains_key(link)).collect();
        let mut next = 0;
        while let Some(link) = reached.get(next) {
            reached.extend(self.joints_below(link).iter().map(|joint| joint.child.link.as_str()));
            next += 1;
        }
        let reached: std::collections::HashSet<&str> = reached.into_iter().collect();
        match links().find(|link| !reached.contains(link)) {
            Some(link) => {
                let why = format!("link {} is in a loop of joints; cut it at one of them", Shown(link));
                Err(Refused::new(self.described.links.get(link).and_then(|said| said.line), why))
            }
            None => Ok(()),
        }
    }

    /// The joints that a link is the parent of.
    pub(super) fn joints_below(&self, link: &str) -> &[&'a Joint] {
        self.below.get(link).map_or(&[], Vec::as_slice)
    }

    /// The joints from a link down to another.
    pub(super) fn way(&self, base: &str, tip: &str) -> Result<Vec<&'a Joint>, Refused> {
        for (option, link) in [("--base", base), ("--tip", tip)] {
            if !self.described.links.contains_key(link) {
                let known = self.described.links.keys().take(MOST_NAMED).map(|link| Shown(link).to_string());
                let why = format!(
                    "{option} {}: no link of this name; links: {}",
                    Shown(link),
                    known.collect::<Vec<_>>().join(", ")
                );
                return Err(Refused::new(None, why));
            }
        }
        let (mut way, mut link) = (Vec::new(), tip);
        while link != base {
            let Some(joint) = self.above.get(link) else {
                let why = format!(
                    "--tip {} is not below --base {}: above it is {} at last; name a link above the tip",
                    Shown(tip),
                    Shown(base),
                    Shown(link)
                );
                return Err(Refused::new(self.described.links.get(tip).and_then(|said| said.line), why));
            };
            way.push(*joint);
            link = &joint.parent.link;
        }
        way.reverse();
        Ok(way)
    }
}
