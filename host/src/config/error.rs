//! What is wrong with a configuration, in words that help to correct it.

use std::fmt;
use std::path::PathBuf;

use crate::exit::ExitCode;

/// Longest value that a message quotes, in characters.
const LONGEST_VALUE: usize = 60;

/// What kind of error it is.
#[derive(Clone, Debug, PartialEq)]
pub enum Problem {
    /// The text is not TOML; the message of the TOML parser.
    Syntax(String),
    /// No such key; the key that was probably meant.
    Unknown(Option<String>),
    /// A key that older files may have; why it is no longer there.
    Removed(&'static str),
    /// A required key is absent.
    Missing,
    /// The value has another type: which one, as in "a string".
    WrongType(&'static str),
    /// The value has the right type but is not acceptable, by itself or together with other keys.
    NotAccepted,
}

/// One error of a configuration: the key, the value it has, and what would be accepted.
///
/// ```
/// use admittance_host::config::ConfigError;
/// let error = ConfigError::new("control.sampling_time_s", 5, "0.0001 to 0.1 s");
/// assert_eq!(error.to_string(), "control.sampling_time_s = 5: accepted: 0.0001 to 0.1 s");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ConfigError {
    /// Dotted path of the key; elements of arrays count from 0: `robot.joint[1].length_m`.
    pub key: String,
    /// The value as the file has it, or as TOML would write it; empty when the key is missing.
    pub value: String,
    /// What would be accepted instead.
    pub accepted: String,
    /// What kind of error it is.
    pub problem: Problem,
    /// Line in the text, from 1; `None` for a struct that was built in code.
    pub line: Option<usize>,
}

impl ConfigError {
    /// An error about a value that is not acceptable: what cross-checks report.
    pub fn new(key: impl Into<String>, value: impl fmt::Display, accepted: impl Into<String>) -> Self {
        Self::with_problem(Problem::NotAccepted, key, value, accepted)
    }

    /// An error of any kind.
    pub fn with_problem(
        problem: Problem,
        key: impl Into<String>,
        value: impl fmt::Display,
        accepted: impl Into<String>,
    ) -> Self {
        Self { key: key.into(), value: shortened(&value.to_string()), accepted: accepted.into(), problem, line: None }
    }

    /// The same error, with its line.
    pub(super) fn at(mut self, line: Option<usize>) -> Self {
        self.line = line;
        self
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { key, value, accepted, problem, .. } = self;
        if matches!(problem, Problem::Missing) {
            return write!(f, "{key}: missing; accepted: {accepted}");
        }
        match (key.is_empty(), value.is_empty()) {
            (true, _) => write!(f, "{value}: ")?,
            (false, true) => write!(f, "{key}: ")?,
            (false, false) => write!(f, "{key} = {value}: ")?,
        }
        match problem {
            Problem::Syntax(message) => write!(f, "{message}; accepted: {accepted}"),
            Problem::Removed(why) => write!(f, "this key is gone: {why}; accepted: a file without it"),
            Problem::Unknown(Some(meant)) => write!(f, "unknown key, did you mean {meant}? accepted: {accepted}"),
            Problem::Unknown(None) => write!(f, "unknown key; accepted: {accepted}"),
            Problem::WrongType(found) => write!(f, "is {found}; accepted: {accepted}"),
            Problem::Missing | Problem::NotAccepted => write!(f, "accepted: {accepted}"),
        }
    }
}

impl std::error::Error for ConfigError {}

/// All errors of one text, in the order of its lines. Displayed one per line, each with source and
/// line number.
#[derive(Clone, Debug, PartialEq)]
pub struct ConfigErrors {
    /// Where the text comes from, usually a file's path.
    pub source_name: String,
    /// The errors; never empty.
    pub errors: Vec<ConfigError>,
}

impl fmt::Display for ConfigErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, error) in self.errors.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            match error.line {
                Some(line) => write!(f, "{}:{line}: {error}", self.source_name)?,
                None => write!(f, "{}: {error}", self.source_name)?,
            }
        }
        Ok(())
    }
}

impl std::error::Error for ConfigErrors {}

/// Why a configuration file could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file was read, but its content is not acceptable.
    #[error(transparent)]
    Config(#[from] ConfigErrors),
}

impl LoadError {
    /// The exit code of a program that cannot go on without this file.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Read { source, .. } => match source.kind() {
                std::io::ErrorKind::PermissionDenied => ExitCode::NoPermission,
                std::io::ErrorKind::InvalidData => ExitCode::Config,
                _ => ExitCode::NoInput,
            },
            Self::Config(_) => ExitCode::Config,
        }
    }
}

/// The value on one line and of bounded length.
fn shortened(value: &str) -> String {
    let line = value.split_whitespace().collect::<Vec<_>>().join(" ");
    if line.chars().count() <= LONGEST_VALUE {
        return line;
    }
    let mut short: String = line.chars().take(LONGEST_VALUE).collect();
    short.push('…');
    short
}
