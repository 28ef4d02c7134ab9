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
mod rigid_body_section;
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
use xml::{Refused, Shown};

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  admittancectl import ur5.urdf --base base_link --tip tool0 >cell-3.toml\n  \
    admittancectl import ur5.urdf --base base_link --tip tool0 --scenario >cell-3.scenario.toml\n\n\
    What the URDF does not say is marked with FILL IN. Meshes and extensions are not looked at. Links that hang on the arm by \
    other joints, such as fingers, count with their masses, as if those joints were at zero.\n\n\
    Exit codes: 0 done, 64 usage, 65 no URDF of an arm that the daemon can control, 66 no such file or none that can be read.")]
pub(crate) struct Args {
    /// The URDF; of a xacro what `xacro FILE` prints.
    urdf: PathBuf,
    /// The link whose frame is the base frame.
    #[arg(long, value_name = "LINK")]
    base: String,
    /// The link whose frame is the TCP, at the arm's end.
    #[arg(long, value_name = "LINK")]
    tip: String,
    /// Print a scenario of plant-sim with masses and torques, in place of a configuration.
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
    /// The command line's words after the command's name.
    fn words(&self) -> String {
        let [base, tip] = [&self.base, &self.tip].map(|link| escaped(link));
        format!("{} --base {base} --tip {tip}", escaped(&self.urdf.to_string_lossy()))
    }
}

pub(crate) fn run(args: &Args) -> Outcome<Exit> {
    let file = escaped(&args.urdf.to_string_lossy());
    let unreadable = |error: std::io::Error| (Exit::NoInput, format!("{file}: cannot be read: {error}"));
    let (bytes, sha256) = source::read(&args.urdf).map_err(unreadable)?;
    let urdf = std::path::absolute(&args.urdf).map_err(unreadable)?;
    let origin = Origin { urdf, sha256, base: args.base.clone(), tip: args.tip.clone() };
    let text = printed(&bytes, &origin, args.scenario).map_err(|refused| (Exit::DataError, refused.of(&file)))?;
    println!("{}", text.trim_end());
    Ok(Exit::Ok)
}

/// The text of the file that the bytes of a URDF become.
fn printed(bytes: &[u8], origin: &Origin, scenario: bool) -> Result<String, Refused> {
    let text = std::str::from_utf8(bytes)
        .map_err(|_| Refused::new(None, "it is not UTF-8 text; accepted: a URDF in UTF-8".to_owned()))?;
    let arm = Arm::between(&Described::parse(text)?, &origin.base, &origin.tip)?;
    let printed = if scenario { scenario_file::text(&arm, origin) } else { robot_file::text(&arm, origin) };
    let filled = marked::with_examples(&printed);
    let checked = if scenario {
        config::parse::<Scenario>(&filled, "").map(|_| ())
    } else {
        config::parse::<Config>(&filled, "").map(|_| ())
    };
    checked.map_err(|errors| not_accepted(&arm, &errors))?;
    Ok(printed)
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
