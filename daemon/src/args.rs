//! The command line.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Parser;

/// What the program is told.
#[derive(Debug, PartialEq, Parser)]
#[command(
    name = "admittanced",
    version,
    args_override_self = true,
    about = "Real-time admittance control beside a velocity-controlled robot's motion controller.",
    after_help = "Signals: TERM, INT stop (in contact at a low force, then hold); HUP reads the configuration again.\nLog level: \
    ADMITTANCE_LOG=debug. Exit codes: 0 ended as asked, 64 usage, 66 no such file, 69 not available or held by\nanother daemon, 70 \
    internal error, 77 no permission, 78 configuration.\n\nExample: admittanced --config /etc/admittanced/cell-3.toml --instance cell-3"
)]
pub struct Args {
    /// Configuration (TOML); check one with: admittancectl validate FILE.
    #[arg(long, value_name = "FILE")]
    pub(crate) config: PathBuf,
    /// Name of this daemon, a-z 0-9 _ -; overrides ipc.instance.
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Directory of the services' files; overrides ipc.root_path.
    #[arg(long, value_name = "DIR")]
    pub(crate) root_path: Option<PathBuf>,
    /// Start of shared-memory names; overrides ipc.prefix.
    #[arg(long, value_name = "TEXT")]
    pub(crate) prefix: Option<String>,
}

/// Reads the arguments after the program's name.
pub(crate) fn parse(arguments: impl Iterator<Item = OsString>) -> Result<Args, clap::Error> {
    Args::try_parse_from(std::iter::once(OsString::from("admittanced")).chain(arguments))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(arguments: &[&str]) -> Result<Args, clap::Error> {
        parse(arguments.iter().map(OsString::from))
    }

    #[test]
    fn arguments_are_read_or_named() {
        let args = parsed(&["--config", "a.toml", "--instance=r2"]).expect("a run");
        assert_eq!((args.config, args.instance.as_deref()), (PathBuf::from("a.toml"), Some("r2")));
        assert!(parsed(&[]).unwrap_err().to_string().contains("--config <FILE>"));
        assert!(parsed(&["--confg", "a"]).unwrap_err().to_string().contains("--confg"));
        let help = parsed(&["--help"]).unwrap_err();
        assert!(!help.use_stderr() && help.to_string().contains("Example"));
    }
}
