//! `admittancectl import`: a robot file from a URDF.
//!
//! The text is bounded and checked ([`xml`], [`checked`]), read by urdf-rs ([`document`]), and cut
//! down to the arm between two links ([`tree`], [`arm`], [`body`]). What is printed is validated
//! before, with examples in place of what a person has to fill in.

mod arm;
mod body;
mod checked;
mod document;
mod frame;
mod marked;
mod masses;
mod robot_file;
mod robot_section;
mod scenario_file;
mod source;
#[cfg(test)]
mod tests;
mod tree;
mod xml;

pub(crate) use source::warning;

use std::path::PathBuf;

use admittance_host::config::{self, ConfigErrors, escaped};
use admittance_runner::config::Config;
use plant_sim::scenario::Scenario;

use crate::{Exit, Outcome};
use arm::{Arm, ArmJoint};
use document::Described;
use marked::MARK;
use xml::{Refused, Shown};

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  admittancectl import ur5.urdf --base base_link --tip tool0 >cell-3.toml\n  \
    admittancectl import ur5.urdf --base base_link --tip tool0 --scenario >cell-3.scenario.toml\n\n\
    What the URDF does not say is marked with FILL IN. Meshes and extensions are not looked at. Links that hang on the arm by \
    other joints, such as fingers, count with their masses, as if those joints were at zero.\n\n\
    Exit codes: 0 done, 64 usage, 65 no URDF of an arm that the daemon can control, 66 no such file or none that can be read, 74 writing failed.")]
pub(crate) struct Args {
    /// The URDF; of a xacro what `xacro FILE` prints.
    urdf: PathBuf,
    /// The link whose frame is the base frame.
    #[arg(long, value_name = "LINK")]
    base: String,
    /// The link whose frame is the TCP, at the arm's end.
    #[arg(long, value_name = "LINK")]
    tip: String,
    /// Print a scenario of plant-sim with masses and torques, in place of a configuration, which has the masses in a comment.
    #[arg(long)]
    scenario: bool,
}

/// Where a description is from.
#[derive(Debug, Clone)]
struct Origin {
    /// Absolute: nobody knows where the printed file will be.
    urdf: PathBuf,
    sha256: String,
    base: String,
    tip: String,
}

impl Origin {
    /// The command line's words after the command's name, as a shell takes them.
    fn words(&self) -> String {
        let urdf = self.urdf.to_string_lossy();
        let [urdf, base, tip] = [&*urdf, &*self.base, &*self.tip].map(quoted);
        format!("{urdf} --base {base} --tip {tip}")
    }
}

/// A word for a shell, and without what a terminal acts on.
fn quoted(word: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"_-./+:@%=,".contains(&byte);
    if !word.is_empty() && word.bytes().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", escaped(word).replace('\'', r"'\''"))
}

pub(crate) fn run(args: &Args) -> Outcome<Exit> {
    let file = escaped(&args.urdf.to_string_lossy());
    let unreadable = |error: std::io::Error| (Exit::NoInput, format!("{file}: cannot be read: {error}"));
    let (bytes, sha256) = source::read(&args.urdf).map_err(unreadable)?;
    let urdf = std::path::absolute(&args.urdf).map_err(unreadable)?;
    // What is written into the file has to be the path, and TOML is UTF-8.
    if urdf.to_str().is_none() {
        let why = format!(
            "{file}: its absolute path is not UTF-8, so that [robot.source] could not name it; accepted: a path in UTF-8"
        );
        return Err((Exit::Usage, why));
    }
    let origin = Origin { urdf, sha256, base: args.base.clone(), tip: args.tip.clone() };
    let text = printed(&bytes, &origin, args.scenario).map_err(|refused| (Exit::DataError, refused.of(&file)))?;
    println!("{}", text.trim_end());
    Ok(Exit::Ok)
}

/// The text of the file that the bytes of a URDF become.
fn printed(bytes: &[u8], origin: &Origin, scenario: bool) -> Result<String, Refused> {
    let text = std::str::from_utf8(bytes)
        .map_err(|_| Refused::new(None, "it is not UTF-8 text; accepted: a URDF in UTF-8".to_owned()))?;
    let described = Described::parse(text)?;
    has_no_mark(&described, origin)?;
    let arm = Arm::between(&described, &origin.base, &origin.tip)?;
    let not_accepted = |errors: ConfigErrors| not_accepted(&arm, &errors);
    if scenario {
        let text = scenario_file::text(&arm, origin);
        config::parse::<Scenario>(&marked::with_examples(&text), "").map_err(not_accepted)?;
        return Ok(text);
    }
    let text = robot_file::text(&arm, origin);
    config::parse::<Config>(&marked::with_examples(&text), "").map_err(not_accepted)?;
    Ok(text)
}

/// A name with the mark in it would look like a line that is to be filled in.
fn has_no_mark(described: &Described, origin: &Origin) -> Result<(), Refused> {
    let robot = &described.robot;
    let path = origin.urdf.to_string_lossy();
    let names = [("the file's path", &*path, None), ("robot", robot.name.as_str(), None)].into_iter();
    let links = robot.links.iter().map(|link| ("link", link.name.as_str(), described.links.get(&link.name)));
    let joints = robot.joints.iter().map(|joint| ("joint", joint.name.as_str(), described.joints.get(&joint.name)));
    match names.chain(links).chain(joints).find(|(_, name, _)| name.contains(MARK.trim_end())) {
        Some((kind, name, said)) => {
            let mark = MARK.trim_end();
            let why = format!(
                "{kind} {}: it has \"{mark}\" in it, which marks what a person has to fill in; accepted: a name without that",
                Shown(name)
            );
            Err(Refused::new(said.and_then(|said| said.line), why))
        }
        None => Ok(()),
    }
}

/// What the URDF says is out of a key's range: the first error, with the joint that it is about.
fn not_accepted(arm: &Arm, errors: &ConfigErrors) -> Refused {
    let Some(error) = errors.errors.first() else { return Refused::new(None, errors.to_string()) };
    let is_of_joints =
        ["robot.joint[", "rigid_body.joint[", "limits.joint_"].iter().any(|start| error.key.starts_with(start));
    let index = error.key.split_once('[').and_then(|(_, rest)| rest.split_once(']')?.0.parse::<usize>().ok());
    let joint: Option<&ArmJoint> = index.filter(|_| is_of_joints).and_then(|index| arm.joints.get(index));
    let named = joint.map(|joint| format!("joint {}: ", Shown(&joint.name))).unwrap_or_default();
    Refused::new(None, format!("{named}what it says is not accepted: {error}"))
}
