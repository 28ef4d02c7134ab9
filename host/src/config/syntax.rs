//! Text that is not TOML: what is wrong, and in which line a person has to look.

use super::error::{ConfigError, MOST_ERRORS, Problem};
use super::value::join;

const ACCEPTED: &str = "TOML 1.1, each key once: key = value, under its [section]";

/// The errors of the TOML parser, and how many more there are. A list that does not end swallows
/// all that follows it: that is one error, where the list begins.
pub(super) fn syntax_errors_in(text: &str, lines: &Lines, errors: &[toml::de::Error]) -> (Vec<ConfigError>, usize) {
    let line_of = |error: &toml::de::Error| error.span().map(|span| lines.line_at(span.start));
    // The parser has to be of the same opinion.
    let swallowed = |noticed: usize| errors.iter().any(|error| line_of(error).is_some_and(|line| line >= noticed));
    let open = open_list(text).filter(|(_, noticed)| swallowed(*noticed)).map(|(begun, _)| begun);
    let is_before = |error: &&toml::de::Error| open.is_none_or(|open| line_of(error).is_none_or(|line| line < open));
    let before: Vec<_> = errors.iter().filter(is_before).collect();
    let mut found: Vec<_> = before.iter().take(MOST_ERRORS).map(|error| syntax_error(text, lines, error)).collect();
    found.extend(open.map(|line| at_line(text, line, "a list without its closing bracket".to_owned())));
    (found, before.len().saturating_sub(MOST_ERRORS))
}

/// Line of the first list that is still open where the next key or section begins, and the line of
/// that, from 1.
fn open_list(text: &str) -> Option<(usize, usize)> {
    let (mut depth, mut begun) = (0_usize, 0);
    for (number, line) in (1_usize..).zip(text.lines()) {
        let line = line.trim();
        if depth > 0 && (is_key(line) || section(line).is_some()) {
            return Some((begun, number));
        }
        let value = if depth > 0 { line } else { line.split_once('=').map_or("", |(_, value)| value) };
        for c in outside_of_texts(value) {
            match c {
                '[' => {
                    begun = if depth == 0 { number } else { begun };
                    depth += 1;
                }
                ']' => depth = depth.saturating_sub(1),
                _ => {}
            }
        }
    }
    (depth > 0).then(|| (begun, text.lines().count()))
}

/// Whether a line begins with a key, not with a value of a list.
fn is_key(line: &str) -> bool {
    let is_of_key = |c: char| c.is_alphanumeric() || "_-. ".contains(c);
    let name = line.split_once('=').map_or("", |(name, _)| name);
    name.starts_with(char::is_alphabetic) && name.chars().all(is_of_key)
}

/// The section that a line begins, whether its brackets are closed or not.
fn section(line: &str) -> Option<&str> {
    let name = line.split('#').next().unwrap_or_default().trim().strip_prefix('[')?.trim_matches(['[', ']']).trim();
    let is_name = |c: char| c.is_alphanumeric() || "_-.".contains(c);
    (name.starts_with(char::is_alphabetic) && name.chars().all(is_name)).then_some(name)
}

/// The characters of a line that are neither in quotes nor in its comment.
fn outside_of_texts(line: &str) -> impl Iterator<Item = char> {
    let mut quote = None;
    let is_outside = move |c: &char| {
        let was_quoted = quote.is_some();
        match quote {
            Some(open) if open == *c => quote = None,
            None if *c == '"' || *c == '\'' => quote = Some(*c),
            _ => {}
        }
        !was_quoted && quote.is_none()
    };
    line.chars().filter(is_outside).take_while(|c| *c != '#')
}

/// Where the lines of a text end: looked up once for all its errors.
pub(super) struct Lines(Vec<usize>);

impl Lines {
    pub(super) fn of(text: &str) -> Self {
        Self(text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(offset, _)| offset).collect())
    }

    /// Line of a byte offset, from 1.
    pub(super) fn line_at(&self, offset: usize) -> usize {
        1 + self.0.partition_point(|end| *end < offset)
    }
}

/// An error of the TOML parser, with the key of the line that it points to.
pub(super) fn syntax_error(text: &str, lines: &Lines, error: &toml::de::Error) -> ConfigError {
    let message = error.message().trim().replace('\n', ", ");
    match error.span() {
        Some(span) => at_line(text, lines.line_at(span.start), message),
        None => ConfigError::with_problem(Problem::Syntax(message), "", "", ACCEPTED),
    }
}

fn at_line(text: &str, line: usize, message: String) -> ConfigError {
    let source = text.lines().nth(line - 1).unwrap_or_default().trim();
    let key = key_near(text, line);
    let value = match source.split_once('=') {
        Some((_, value)) if !key.is_empty() => value.trim(),
        _ => source,
    };
    ConfigError::with_problem(Problem::Syntax(message), key, value, ACCEPTED).at(Some(line))
}

/// Dotted key on a line of text that could not be parsed: the header above it and what stands
/// before `=`.
fn key_near(text: &str, line: usize) -> String {
    let lines: Vec<_> = text.lines().take(line).map(str::trim).collect();
    let Some((name, _)) = lines.last().and_then(|last| last.split_once('=')) else { return String::new() };
    let section = lines.iter().rev().find_map(|line| section(line));
    join(section.unwrap_or_default(), name.trim())
}
