//! Wrong variants of a valid configuration, one thing wrong in each, for tests that drive every key
//! of a shipped file.
//!
//! ```no_run
//! # admittance_host::config_section! { struct Config { /// Priority.
//! # priority: u32 = 0, unit "1", range 0..=99; } }
//! # admittance_host::config_file!(Config);
//! let text = std::fs::read_to_string("deploy/cell.toml").unwrap();
//! let count = admittance_host::config::mutation::check_every_key::<Config>(&text).unwrap();
//! assert!(count > 100);
//! ```

use std::ops::Bound;

use toml::{Table, Value as Toml};

use super::docs::KeyDoc;
use super::error::{ConfigErrors, Problem};
use super::parse::{default_errors, parse};
use super::range::{Limits, Number};
use super::value::{File, Kind};

/// What is wrong with a mutation's text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MutationKind {
    /// A required key is missing.
    Missing,
    /// A key with a default is left out: nothing is wrong, unless a rule between keys needs it.
    Omitted,
    /// The key's name is misspelt.
    Unknown,
    /// The value has another type.
    WrongType,
    /// The number is just below the range.
    TooLow,
    /// The number is just above the range.
    TooHigh,
    /// The number is `nan`.
    NotANumber,
    /// The number is `inf`.
    Infinite,
    /// The name is not in the list.
    NotAChoice,
    /// The array or string is shorter than accepted.
    TooShort,
    /// The array or string is longer than accepted.
    TooLong,
}

/// A configuration text with one thing wrong in it.
#[derive(Clone, Debug)]
pub struct Mutation {
    /// The key that errors must name; elements count from 0.
    pub key: String,
    /// What is wrong.
    pub kind: MutationKind,
    /// The wrong value as TOML; empty when the key is missing.
    pub value: String,
    /// The whole text.
    pub text: String,
}

impl Mutation {
    /// Whether the outcome of parsing [`Mutation::text`] is right: an error that names the key, the
    /// value and what is accepted. For [`MutationKind::Omitted`] no error, or those of rules
    /// between keys only.
    ///
    /// # Errors
    /// A sentence that says what is not as it should be.
    pub fn verify<T>(&self, outcome: &Result<T, ConfigErrors>) -> Result<(), String> {
        let Self { key, kind, value, .. } = self;
        let errors = match (outcome, kind) {
            (Ok(_), MutationKind::Omitted) => return Ok(()),
            (Ok(_), _) => return Err(format!("{key}: {kind:?} ({value}) was accepted")),
            (Err(errors), MutationKind::Omitted) => {
                let by_rule = errors.errors.iter().all(|error| error.problem == Problem::NotAccepted);
                return if by_rule { Ok(()) } else { Err(format!("{key}: has a default, but without it:\n{errors}")) };
            }
            (Err(errors), _) => errors,
        };
        let Some(error) = errors.errors.iter().find(|error| error.key == *key) else {
            return Err(format!("{key}: {kind:?} ({value}): no error names the key:\n{errors}"));
        };
        let problem_fits = match kind {
            MutationKind::Missing => error.problem == Problem::Missing,
            MutationKind::Unknown => matches!(&error.problem, Problem::Unknown(Some(_))),
            MutationKind::WrongType => matches!(error.problem, Problem::WrongType(_)),
            _ => error.problem == Problem::NotAccepted,
        };
        let message = error.to_string();
        let names_value = match kind {
            MutationKind::Missing | MutationKind::Unknown => true,
            _ => !error.value.is_empty() && value.starts_with(error.value.trim_end_matches('…')),
        };
        let names_accepted = !error.accepted.is_empty() && message.contains(&error.accepted);
        if problem_fits && names_value && names_accepted && message.contains(key.as_str()) {
            Ok(())
        } else {
            Err(format!("{key}: {kind:?} ({value}): the message does not say so: {message}"))
        }
    }
}

/// Parses every [mutation](mutations) of a valid text and [verifies](Mutation::verify) the outcome;
/// also checks that the text itself is valid, that each number has a unit and each key a meaning,
/// and that each default is in its own range. Returns how many mutations there were.
///
/// # Errors
/// One sentence for each thing that is not as it should be.
pub fn check_every_key<T: File>(valid_text: &str) -> Result<usize, Vec<String>> {
    let keys = T::keys("");
    if let Err(errors) = parse::<T>(valid_text, "valid text") {
        return Err(vec![format!("the text is not valid to begin with:\n{errors}")]);
    }
    let mut failures = Vec::new();
    for key in &keys {
        let mut kind = &key.kind;
        while let Kind::List { of, .. } = kind {
            kind = of;
        }
        if matches!(kind, Kind::Float | Kind::Integer) && key.unit.is_none() {
            failures.push(format!("{}: a number without a unit (\"1\" if it has no dimension)", key.path));
        }
        if key.meaning.is_empty() {
            failures.push(format!("{}: no meaning", key.path));
        }
        let of_default = default_errors(key);
        failures.extend(of_default.iter().map(|error| format!("{}: default: {error}", key.path)));
    }
    let mutations = mutations(&keys, valid_text);
    for mutation in &mutations {
        failures.extend(mutation.verify(&parse::<T>(&mutation.text, "mutation")).err());
    }
    if failures.is_empty() { Ok(mutations.len()) } else { Err(failures) }
}

/// For each key every way to get it wrong. `keys` are those of the root section (`Section::keys`
/// of `""`).
///
/// A key in an array of tables is changed in the first of them. Optional sections that the text
/// lacks are added for their keys' mutations; other errors then come along with the intended one.
///
/// # Panics
/// When `valid_text` is not TOML, or a key's path leads through something that is no table.
pub fn mutations(keys: &[KeyDoc], valid_text: &str) -> Vec<Mutation> {
    let valid: Table = valid_text.parse().expect("the text must be valid TOML");
    keys.iter().flat_map(|key| mutations_of(key, &valid)).collect()
}

fn mutations_of(key: &KeyDoc, valid: &Table) -> Vec<Mutation> {
    let is_there = look_up(&key.path, valid).is_some();
    let mut all = Vec::new();
    let mut add = |kind, suffix: &str, value: String, change: &dyn Fn(&mut Table, &str)| {
        let mut root = valid.clone();
        let (table, path, name) = enter(&mut root, &key.path);
        change(table, name);
        let text = toml::to_string(&root).expect("a table is always TOML");
        all.push(Mutation { key: format!("{path}{name}{suffix}"), kind, value, text });
    };

    let remove = |table: &mut Table, name: &str| {
        table.remove(name);
    };
    let is_section = matches!(key.kind, Kind::Section(_));
    // A missing section is reported through the required keys in it.
    if key.is_required() && !is_section {
        add(MutationKind::Missing, "", String::new(), &remove);
    } else if is_there && !key.is_required() {
        add(MutationKind::Omitted, "", String::new(), &remove);
    }
    let misspelt = |table: &mut Table, name: &str| {
        let value = table.remove(name).unwrap_or(Toml::Boolean(true));
        table.insert(format!("{name}x"), value);
    };
    add(MutationKind::Unknown, "x", String::new(), &misspelt);

    let present = look_up(&key.path, valid);
    for (kind, suffix, value, wrong) in wrong_values(&key.kind, &key.limits, present) {
        let set = |table: &mut Table, name: &str| {
            table.insert(name.to_owned(), value.clone());
        };
        add(kind, &suffix, wrong, &set);
    }
    all
}

/// Kind of error, element that is wrong, the key's whole value, and the wrong part of it as errors
/// show it.
type WrongValue = (MutationKind, String, Toml, String);

fn wrong_values(kind: &Kind, limits: &Limits, present: Option<&Toml>) -> Vec<WrongValue> {
    let mut all = Vec::new();
    let mut add = |kind, value: Toml| {
        let shown = value.to_string();
        all.push((kind, String::new(), value, shown));
    };
    match kind {
        Kind::Float | Kind::Integer => {
            add(MutationKind::WrongType, Toml::String("text".to_owned()));
            if let Some(low) = below(limits.range.low) {
                add(MutationKind::TooLow, low);
            }
            if let Some(high) = above(limits.range.high) {
                add(MutationKind::TooHigh, high);
            }
            if matches!(kind, Kind::Float) {
                add(MutationKind::NotANumber, Toml::Float(f64::NAN));
                add(MutationKind::Infinite, Toml::Float(f64::INFINITY));
            } else {
                add(MutationKind::WrongType, Toml::Float(1.5));
            }
        }
        Kind::Boolean => add(MutationKind::WrongType, Toml::String("yes".to_owned())),
        Kind::Section(_) => add(MutationKind::WrongType, Toml::Integer(1)),
        Kind::Choice(_) => {
            add(MutationKind::WrongType, Toml::Boolean(true));
            add(MutationKind::NotAChoice, Toml::String("none_of_these".to_owned()));
        }
        Kind::Text => {
            add(MutationKind::WrongType, Toml::Boolean(true));
            let (short, long) = wrong_lengths(None, limits);
            if let Some(n) = short {
                add(MutationKind::TooShort, Toml::String("x".repeat(n)));
            }
            if let Some(n) = long {
                add(MutationKind::TooLong, Toml::String("x".repeat(n)));
            }
        }
        Kind::List { of, length } => {
            add(MutationKind::WrongType, Toml::Boolean(true));
            list_mutations(of, *length, limits, present, &mut all);
        }
    }
    all
}

fn list_mutations(of: &Kind, fixed: Option<usize>, limits: &Limits, present: Option<&Toml>, all: &mut Vec<WrongValue>) {
    let elements = present.and_then(Toml::as_array).cloned().unwrap_or_default();
    if let Some(element) = elements.first() {
        let (short, long) = wrong_lengths(fixed, limits);
        for (kind, n) in [(MutationKind::TooShort, short), (MutationKind::TooLong, long)] {
            if let Some(n) = n {
                let list: Vec<_> = elements.iter().chain(std::iter::repeat(element)).take(n).cloned().collect();
                let is_tables = list.iter().any(Toml::is_table);
                let list = Toml::Array(list);
                // Errors give the number of tables, not their text.
                let shown = if is_tables { format!("{n} tables") } else { list.to_string() };
                all.push((kind, String::new(), list, shown));
            }
        }
    }
    // Keys of sections in a list have mutations of their own.
    if matches!(of, Kind::Section(_)) {
        return;
    }
    let least = fixed.unwrap_or_else(|| limits.length.map_or(1, |length| length.least()).max(1));
    for (kind, suffix, element, wrong) in wrong_values(of, &Limits { length: None, ..*limits }, elements.first()) {
        let mut list = elements.clone();
        match list.first_mut() {
            Some(first) => *first = element,
            None => list = vec![element; least],
        }
        all.push((kind, format!("[0]{suffix}"), Toml::Array(list), wrong));
    }
}

/// A length that is too short and one that is too long, where such exist.
fn wrong_lengths(fixed: Option<usize>, limits: &Limits) -> (Option<usize>, Option<usize>) {
    if let Some(fixed) = fixed {
        return (fixed.checked_sub(1), Some(fixed + 1));
    }
    let Some(bounds) = limits.length else { return (None, None) };
    let high = match bounds.high {
        Bound::Included(Number::Integer(i)) => usize::try_from(i + 1).ok(),
        Bound::Excluded(Number::Integer(i)) => usize::try_from(i).ok(),
        _ => None,
    };
    (bounds.least().checked_sub(1), high)
}

fn below(low: Bound<Number>) -> Option<Toml> {
    match low {
        Bound::Included(Number::Float(x)) => Some(Toml::Float(x.next_down())),
        Bound::Included(Number::Integer(i)) => i64::try_from(i - 1).ok().map(Toml::Integer),
        Bound::Excluded(x) => number(x),
        Bound::Unbounded => None,
    }
}

fn above(high: Bound<Number>) -> Option<Toml> {
    match high {
        Bound::Included(Number::Float(x)) => Some(Toml::Float(x.next_up())),
        Bound::Included(Number::Integer(i)) => i64::try_from(i + 1).ok().map(Toml::Integer),
        Bound::Excluded(x) => number(x),
        Bound::Unbounded => None,
    }
}

fn number(x: Number) -> Option<Toml> {
    match x {
        Number::Float(x) => Some(Toml::Float(x)),
        Number::Integer(i) => i64::try_from(i).ok().map(Toml::Integer),
    }
}

/// The key's value, if the text has it (the first element's, in arrays of tables).
fn look_up<'a>(path: &str, root: &'a Table) -> Option<&'a Toml> {
    let (sections, name) = path.rsplit_once('.').unwrap_or(("", path));
    let mut table = root;
    for section in sections.split('.').filter(|section| !section.is_empty()) {
        let mut value = table.get(section.trim_end_matches("[]"))?;
        for _ in 0..section.matches("[]").count() {
            value = value.as_array()?.first()?;
        }
        table = value.as_table()?;
    }
    table.get(name)
}

/// The table that holds the key (added where the text lacks it), its path with a final dot, and the
/// key's name.
fn enter<'t, 'p>(root: &'t mut Table, path: &'p str) -> (&'t mut Table, String, &'p str) {
    let (sections, name) = path.rsplit_once('.').unwrap_or(("", path));
    let mut table = root;
    for section in sections.split('.').filter(|section| !section.is_empty()) {
        let lists = section.matches("[]").count();
        let empty = || if lists > 0 { Toml::Array(Vec::new()) } else { Toml::Table(Table::new()) };
        let mut value = table.entry(section.trim_end_matches("[]")).or_insert_with(empty);
        for depth in (0..lists).rev() {
            let list = value.as_array_mut().expect("the key's path leads through an array");
            if list.is_empty() {
                list.push(if depth > 0 { Toml::Array(Vec::new()) } else { Toml::Table(Table::new()) });
            }
            value = &mut list[0];
        }
        table = value.as_table_mut().expect("the key's path leads through a table");
    }
    let path = if sections.is_empty() { String::new() } else { format!("{}.", sections.replace("[]", "[0]")) };
    (table, path, name)
}
