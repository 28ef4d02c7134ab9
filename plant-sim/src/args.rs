//! The command line.

use std::ffi::OsString;
use std::path::PathBuf;

pub(crate) const HELP: &str = "\
An emulated motion controller and robot for admittanced: joint speed loops, contact, wrench estimate, in real time.

Usage: plant-sim --scenario FILE [--instance NAME]

Options:
  --scenario FILE         scenario (TOML), such as plant-sim/scenarios/paper.toml
  --instance NAME         name of the daemon to meet; overrides ipc.instance
  --root-path DIR         directory of the services' files; overrides ipc.root_path
  --prefix TEXT           start of shared-memory names; overrides ipc.prefix
  --controller-timeout S  seconds to wait for the first command (default 10)
  --quiet                 log warnings and errors only
  --help, --version

Motion starts once admittanced answers. Exit codes: 0 the scenario ended, or a signal did; 64 usage, 66 no such file,
69 no daemon answers, or the services are held by another plant; 78 scenario.

Example: plant-sim --scenario plant-sim/scenarios/paper.toml --instance cell-3
";

#[derive(Debug, PartialEq)]
pub(crate) struct Args {
    pub(crate) scenario: PathBuf,
    pub(crate) instance: Option<String>,
    pub(crate) root_path: Option<PathBuf>,
    pub(crate) prefix: Option<String>,
    pub(crate) controller_timeout_s: f64,
    pub(crate) quiet: bool,
}

#[derive(Debug, PartialEq)]
pub(crate) enum Invocation {
    Run(Args),
    /// Print this and end.
    Print(String),
}

/// Reads the arguments after the program's name.
pub(crate) fn parse(arguments: impl Iterator<Item = OsString>) -> Result<Invocation, String> {
    use lexopt::prelude::{Long, Short, ValueExt};
    let mut parser = lexopt::Parser::from_args(arguments);
    let text = |error: lexopt::Error| error.to_string();
    let (mut scenario, mut instance, mut root_path, mut prefix) = (None, None, None, None);
    let (mut controller_timeout_s, mut quiet) = (10.0, false);
    while let Some(argument) = parser.next().map_err(text)? {
        match argument {
            Long("scenario") => scenario = Some(PathBuf::from(parser.value().map_err(text)?)),
            Long("instance") => instance = Some(parser.value().map_err(text)?.string().map_err(text)?),
            Long("root-path") => root_path = Some(PathBuf::from(parser.value().map_err(text)?)),
            Long("prefix") => prefix = Some(parser.value().map_err(text)?.string().map_err(text)?),
            Long("controller-timeout") => {
                controller_timeout_s = parser.value().map_err(text)?.parse::<f64>().map_err(text)?;
                if !(0.0..=3600.0).contains(&controller_timeout_s) {
                    return Err(format!("--controller-timeout {controller_timeout_s}: accepted: 0 to 3600 s"));
                }
            }
            Long("quiet") => quiet = true,
            Long("help") | Short('h') => return Ok(Invocation::Print(HELP.to_owned())),
            Long("version") | Short('V') => {
                return Ok(Invocation::Print(format!("plant-sim {}\n", env!("CARGO_PKG_VERSION"))));
            }
            other => return Err(other.unexpected().to_string()),
        }
    }
    let scenario = scenario.ok_or("--scenario FILE is missing")?;
    Ok(Invocation::Run(Args { scenario, instance, root_path, prefix, controller_timeout_s, quiet }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_read_or_named() {
        let parsed = |arguments: &[&str]| parse(arguments.iter().map(OsString::from));
        let Ok(Invocation::Run(args)) = parsed(&["--scenario", "a.toml", "--controller-timeout", "2.5", "--quiet"])
        else {
            panic!("not a run")
        };
        assert_eq!((args.scenario, args.controller_timeout_s, args.quiet), (PathBuf::from("a.toml"), 2.5, true));
        assert!(parsed(&["--scenario", "a", "--controller-timeout", "-1"]).unwrap_err().contains("0 to 3600"));
        assert!(parsed(&[]).unwrap_err().contains("--scenario FILE"));
    }
}
