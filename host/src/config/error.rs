//! What is wrong with a configuration, in words that help to correct it.

use std::fmt;
use std::path::PathBuf;

use admittance_core::quantities::AXIS_NAMES;

use super::plain::{escaped, with_short_numbers};
use crate::exit::ExitCode;

/// Longest value that a message quotes, in characters.
const LONGEST_VALUE: usize = 60;
/// Most errors that are kept of one text.
pub(super) const MOST_ERRORS: usize = 100;

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
    /// The task axis that an element of a list is for.
    pub axis: Option<&'static str>,
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
        // The value stays as it was given: rounded, it could look as if it were accepted.
        let (value, accepted) = (shortened(&value.to_string()), with_short_numbers(&accepted.into()));
        Self { key: key.into(), value, accepted, problem, line: None, axis: None }
    }

    /// The same error, with its line.
    pub(super) fn at(mut self, line: Option<usize>) -> Self {
        self.line = line;
        self
    }

    /// Names the axis, if this is about an element of one of these lists.
    pub(super) fn name_axis(&mut self, lists: &[String]) {
        let element = self.key.strip_suffix(']').and_then(|key| key.rsplit_once('['));
        let Some((_, index)) = element.filter(|(list, _)| lists.iter().any(|known| known == list)) else { return };
        self.axis = index.parse::<usize>().ok().and_then(|index| AXIS_NAMES.get(index).copied());
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { key, value, accepted, problem, axis, .. } = self;
        let key = shortened(key) + &axis.map(|axis| format!(" ({axis})")).unwrap_or_default();
        if matches!(problem, Problem::Missing) {
            return write!(f, "{key}: missing; accepted: {accepted}");
        }
        match (key.is_empty(), value.is_empty()) {
            (true, _) => write!(f, "{value}: ")?,
            (false, true) => write!(f, "{key}: ")?,
            (false, false) => write!(f, "{key} = {value}: ")?,
        }
        match problem {
            Problem::Syntax(message) => write!(f, "{}; accepted: {accepted}", escaped(message)),
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
    /// The errors, 100 at most; never empty.
    pub errors: Vec<ConfigError>,
    /// How many more there are.
    pub more: usize,
}

impl fmt::Display for ConfigErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, error) in self.errors.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            let source_name = escaped(&self.source_name);
            match error.line {
                Some(line) => write!(f, "{source_name}:{line}: {error}")?,
                None => write!(f, "{source_name}: {error}")?,
            }
        }
        if self.more > 0 {
            write!(f, "\n{}: {} more errors", escaped(&self.source_name), self.more)?;
        }
        Ok(())
    }
}

impl std::error::Error for ConfigErrors {}

/// Why a configuration file could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error("{}: cannot be read: {source}", escaped(&path.to_string_lossy()))]
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
    // What is far beyond the longest is not looked at.
    let line = value.chars().take(4 * LONGEST_VALUE).collect::<String>();
    let line = escaped(&line.split_whitespace().collect::<Vec<_>>().join(" "));
    let (length, is_whole) = (line.chars().count(), value.chars().nth(4 * LONGEST_VALUE).is_none());
    if length <= LONGEST_VALUE && is_whole {
        return line;
    }
    let mut short: String = line.chars().take(LONGEST_VALUE).collect();
    short.push('…');
    short
}
