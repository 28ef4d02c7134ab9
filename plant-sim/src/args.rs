//! The command line.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Parser;

/// What the program is told.
#[derive(Debug, PartialEq, Parser)]
#[command(
    name = "plant-sim",
    version,
    args_override_self = true,
    about = "An emulated motion controller and robot for admittanced: joint speed loops, contact, wrench estimate, in real time.",
    after_help = "Motion starts once admittanced answers. At its end, and at SIGINT or SIGTERM, a tool on the surface is first moved \
    out of\nit, 5 mm; a second signal ends that too. Exit codes: 0 the scenario ended, or a signal did; 64 usage, 66 no such \
    file,\n69 no daemon answers, or the services are held by another plant; 77 no permission, 78 scenario.\n\nExample: plant-sim \
    --scenario plant-sim/scenarios/paper.toml --instance cell-3"
)]
pub struct Args {
    /// Scenario (TOML), such as plant-sim/scenarios/paper.toml.
    #[arg(long, value_name = "FILE")]
    pub(crate) scenario: PathBuf,
    /// Name of the daemon to meet; overrides ipc.instance.
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Directory of the services' files; overrides ipc.root_path.
    #[arg(long, value_name = "DIR")]
    pub(crate) root_path: Option<PathBuf>,
    /// Start of shared-memory names; overrides ipc.prefix.
    #[arg(long, value_name = "TEXT")]
    pub(crate) prefix: Option<String>,
    /// Be a robot that is guided by EGM: send its messages to the edge at this address, such as 127.0.0.1:6510, in place of
    /// samples to the daemon.
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub(crate) egm: Option<std::net::SocketAddr>,
    /// Seconds to wait for the first command.
    #[arg(long = "controller-timeout", value_name = "S", default_value = "10", value_parser = timeout)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) controller_timeout_s: f64,
    /// Log warnings and errors only.
    #[arg(long)]
    pub(crate) quiet: bool,
}

fn timeout(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (0.0..=3600.0).contains(seconds));
    seconds.ok_or_else(|| "accepted: 0 to 3600 s".to_owned())
}

/// Reads the arguments after the program's name.
pub(crate) fn parse(arguments: impl Iterator<Item = OsString>) -> Result<Args, clap::Error> {
    Args::try_parse_from(std::iter::once(OsString::from("plant-sim")).chain(arguments))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_read_or_named() {
        let parsed = |arguments: &[&str]| parse(arguments.iter().map(OsString::from));
        let args = parsed(&["--scenario", "a.toml", "--controller-timeout", "2.5", "--quiet"]).expect("a run");
        assert_eq!((args.scenario, args.controller_timeout_s, args.quiet), (PathBuf::from("a.toml"), 2.5, true));
        let error = parsed(&["--scenario", "a", "--controller-timeout", "-1"]).unwrap_err().to_string();
        assert!(error.contains("0 to 3600"), "{error}");
        assert!(parsed(&[]).unwrap_err().to_string().contains("--scenario <FILE>"));
    }
}
