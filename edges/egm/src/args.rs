//! The command line.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Parser;

/// What the program is told.
#[derive(Debug, PartialEq, Parser)]
#[command(
    name = "admittance-egm",
    version,
    args_override_self = true,
    about = "Between admittanced and an ABB robot: Externally Guided Motion over UDP.",
    after_help = "Each message of the robot becomes a state sample; the daemon's answer goes back as joint speeds. Without an answer the last\nplan \
    is played to its end, then zeros are sent, never a last value. Signals: TERM, INT send zeros, then end.\nLog level: \
    ADMITTANCE_LOG=debug. Exit codes: 0 ended as asked, or --check found nothing wrong; 64 usage, 66 no such file, 69 not\navailable, \
    70 internal error, 77 no permission, 78 configuration.\n\nExample: admittance-egm --config /etc/admittanced/cell-3.egm.toml \
    --daemon-config /etc/admittanced/cell-3.toml"
)]
pub struct Args {
    /// The edge's own configuration (TOML), such as deploy/egm/six-joint.egm.toml.
    #[arg(long, value_name = "FILE")]
    pub(crate) config: PathBuf,
    /// The daemon's configuration: the arm, the cycle, and where both meet.
    #[arg(long, value_name = "FILE")]
    pub(crate) daemon_config: PathBuf,
    /// Name of the daemon to meet; overrides ipc.instance.
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Directory of the services' files; overrides ipc.root_path.
    #[arg(long, value_name = "DIR")]
    pub(crate) root_path: Option<PathBuf>,
    /// Start of shared-memory names; overrides ipc.prefix.
    #[arg(long, value_name = "TEXT")]
    pub(crate) prefix: Option<String>,
    /// Look at both files, say what is wrong, and end.
    #[arg(long)]
    pub(crate) check: bool,
}

/// Reads the arguments after the program's name.
pub(crate) fn parse(arguments: impl Iterator<Item = OsString>) -> Result<Args, clap::Error> {
    Args::try_parse_from(std::iter::once(OsString::from("admittance-egm")).chain(arguments))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_read_or_named() {
        let parsed = |arguments: &[&str]| parse(arguments.iter().map(OsString::from));
        let args = parsed(&["--config", "a.toml", "--daemon-config", "b.toml", "--check"]).expect("a run");
        assert_eq!((args.config, args.check), (PathBuf::from("a.toml"), true));
        assert!(parsed(&["--config", "a"]).unwrap_err().to_string().contains("--daemon-config <FILE>"));
        let help = parsed(&["--help"]).unwrap_err();
        assert!(!help.use_stderr() && help.to_string().contains("Example"));
    }
}
