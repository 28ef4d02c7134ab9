//! The command line.

use std::ffi::OsString;
use std::path::PathBuf;

pub(crate) const HELP: &str = "\
Real-time admittance control beside a velocity-controlled robot's motion controller.

Usage: admittanced --config FILE [--instance NAME]

Options:
  --config FILE     configuration (TOML); check one with: admittancectl validate FILE
  --instance NAME   name of this daemon, a-z 0-9 _ -; overrides ipc.instance
  --root-path DIR   directory of the services' files; overrides ipc.root_path
  --prefix TEXT     start of shared-memory names; overrides ipc.prefix
  --help, --version

Signals: TERM, INT stop (in contact at a low force, then hold); HUP reads the configuration again.
Log level: ADMITTANCE_LOG=debug. Exit codes: 0 ended as asked, 64 usage, 66 no such file, 69 not available or held by
another daemon, 70 internal error, 77 no permission, 78 configuration.

Example: admittanced --config /etc/admittanced/cell-3.toml --instance cell-3
";

#[derive(Debug, PartialEq)]
pub(crate) struct Args {
    pub(crate) config: PathBuf,
    pub(crate) instance: Option<String>,
    pub(crate) root_path: Option<PathBuf>,
    pub(crate) prefix: Option<String>,
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
    let (mut config, mut instance, mut root_path, mut prefix) = (None, None, None, None);
    let text = |error: lexopt::Error| error.to_string();
    while let Some(argument) = parser.next().map_err(text)? {
        match argument {
            Long("config") => config = Some(PathBuf::from(parser.value().map_err(text)?)),
            Long("instance") => instance = Some(parser.value().map_err(text)?.string().map_err(text)?),
            Long("root-path") => root_path = Some(PathBuf::from(parser.value().map_err(text)?)),
            Long("prefix") => prefix = Some(parser.value().map_err(text)?.string().map_err(text)?),
            Long("help") | Short('h') => return Ok(Invocation::Print(HELP.to_owned())),
            Long("version") | Short('V') => {
                return Ok(Invocation::Print(format!("admittanced {}\n", env!("CARGO_PKG_VERSION"))));
            }
            other => return Err(other.unexpected().to_string()),
        }
    }
    let config = config.ok_or("--config FILE is missing")?;
    Ok(Invocation::Run(Args { config, instance, root_path, prefix }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(arguments: &[&str]) -> Result<Invocation, String> {
        parse(arguments.iter().map(OsString::from))
    }

    #[test]
    fn arguments_are_read_or_named() {
        let Ok(Invocation::Run(args)) = parsed(&["--config", "a.toml", "--instance=r2"]) else { panic!("not a run") };
        assert_eq!((args.config, args.instance.as_deref()), (PathBuf::from("a.toml"), Some("r2")));
        assert!(parsed(&[]).unwrap_err().contains("--config FILE"));
        assert!(parsed(&["--confg", "a"]).unwrap_err().contains("--confg"));
        assert!(matches!(parsed(&["--help"]), Ok(Invocation::Print(text)) if text.contains("Example")));
    }
}
