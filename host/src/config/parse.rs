//! From TOML text to a checked configuration, or to the list of everything that is wrong with it.

use std::collections::BTreeMap;
use std::path::Path;

use toml::de::{DeTable, DeValue};
use toml::{Spanned, de::DeArray};

use super::docs::KeyDoc;
use super::error::{ConfigError, ConfigErrors, LoadError, MOST_ERRORS, Problem};
use super::file::read_text;
use super::range::{Limits, Number};
use super::suggest::nearest;
use super::syntax::{Lines, syntax_error, syntax_errors_in};
use super::value::{File, Key, Kind, join};

/// Reads and parses a configuration file.
///
/// # Errors
/// The file cannot be read, or [`parse`] does not accept it; [`LoadError::exit_code`] tells them
/// apart.
pub fn load<T: File>(path: &Path) -> Result<T, LoadError> {
    let text = read_text(path).map_err(|source| LoadError::Read { path: path.to_owned(), source })?;
    Ok(parse(&text, &path.display().to_string())?)
}

/// Parses and checks a configuration; `source_name` is what errors call the text, usually the
/// file's path.
///
/// # Errors
/// *All* unknown keys, missing keys, wrong types and values out of range, in the order of their
/// lines; with none of these, all errors of the cross-checks. Text that is not TOML gives its
/// syntax errors only, up to the first list that does not end.
pub fn parse<T: File>(text: &str, source_name: &str) -> Result<T, ConfigErrors> {
    let all = T::keys("");
    let lists: Vec<String> = all.iter().filter(|key| key.limits.per_axis).map(|key| key.path.clone()).collect();
    let failed = |mut errors: Vec<ConfigError>, unseen: usize| {
        errors.sort_by_key(|error| error.line.unwrap_or(usize::MAX));
        let more = unseen + errors.len().saturating_sub(MOST_ERRORS);
        errors.truncate(MOST_ERRORS);
        errors.iter_mut().for_each(|error| error.name_axis(&lists));
        ConfigErrors { source_name: source_name.to_owned(), errors, more }
    };

    let lines = Lines::of(text);
    let (table, syntax_errors) = DeTable::parse_recoverable(text);
    if !syntax_errors.is_empty() {
        let (errors, unseen) = syntax_errors_in(text, &lines, &syntax_errors);
        return Err(failed(errors, unseen));
    }

    let mut walk = Walk { text, starts: lines, all, errors: Vec::new(), lines: BTreeMap::new() };
    walk.table("", &T::schema(), table.get_ref(), None);
    if !walk.errors.is_empty() {
        return Err(failed(walk.errors, 0));
    }

    // The walk accepts nothing that serde refuses; should it, serde's own message is better than
    // none.
    let config = T::deserialized(text).map_err(|error| failed(vec![syntax_error(text, &walk.starts, &error)], 0))?;
    let mut errors = Vec::new();
    config.check("", &mut errors);
    if errors.is_empty() {
        return Ok(config);
    }
    for error in &mut errors {
        error.line = walk.line_of(&error.key);
    }
    Err(failed(errors, 0))
}

/// What is wrong with a key's own default; a section's default consists of its keys'.
pub(super) fn default_errors(doc: &KeyDoc) -> Vec<ConfigError> {
    let Some(default) = doc.default.as_deref().filter(|default| *default != "none") else { return Vec::new() };
    if doc.holds_section() {
        return Vec::new();
    }
    let text = format!("default = {default}");
    let key = Key {
        name: "default",
        kind: doc.kind.clone(),
        limits: doc.limits,
        default: None,
        required: true,
        meaning: String::new(),
        removed: None,
    };
    let (table, syntax_errors) = DeTable::parse_recoverable(&text);
    let mut walk =
        Walk { text: &text, starts: Lines::of(&text), all: Vec::new(), errors: Vec::new(), lines: BTreeMap::new() };
    walk.table("", &[key], table.get_ref(), None);
    let lines = Lines::of(&text);
    walk.errors.extend(syntax_errors.iter().map(|error| syntax_error(&text, &lines, error)));
    walk.errors
}

/// Compares a parsed table with the declared keys.
struct Walk<'a> {
    text: &'a str,
    starts: Lines,
    /// Every key of the whole configuration, to recognise one that is in the wrong section.
    all: Vec<KeyDoc>,
    errors: Vec<ConfigError>,
    /// Where each key is, for errors of later checks.
    lines: BTreeMap<String, usize>,
}

impl Walk<'_> {
    fn table(&mut self, path: &str, keys: &[Key], table: &DeTable<'_>, line: Option<usize>) {
        for (name, value) in table.iter() {
            let key_path = join(path, &shown_name(name.get_ref()));
            let key_line = self.starts.line_at(name.span().start);
            self.lines.insert(key_path.clone(), key_line);
            match keys.iter().find(|key| key.name == name.get_ref().as_ref()) {
                Some(Key { removed: Some(why), .. }) => {
                    let error = ConfigError::with_problem(Problem::Removed(why), key_path, self.source_of(value), "");
                    self.errors.push(error.at(Some(key_line)));
                }
                Some(key) => self.value(&key_path, &key.kind, &key.limits, value, key_line),
                None => {
                    let keys: Vec<&Key> = keys.iter().filter(|key| key.removed.is_none()).collect();
                    let problem = Problem::Unknown(self.meant(path, name.get_ref(), &keys));
                    let names: Vec<_> = keys.iter().map(|key| key.name).collect();
                    let value = self.source_of(value);
                    let error = ConfigError::with_problem(problem, key_path, value, names.join(", "));
                    self.errors.push(error.at(Some(key_line)));
                }
            }
        }
        for key in keys.iter().filter(|key| key.required) {
            if !table.iter().any(|(name, _)| name.get_ref() == key.name) {
                self.missing(&join(path, key.name), key, line);
            }
        }
    }

    /// A missing section is reported key by key, so that the reader sees at once what to write.
    fn missing(&mut self, path: &str, key: &Key, line: Option<usize>) {
        if let Kind::Section(keys) = key.kind {
            self.table(path, &keys(), &DeTable::new(), line);
            return;
        }
        let accepted = key.kind.accepted(path, &key.limits);
        self.errors.push(ConfigError::with_problem(Problem::Missing, path, "", accepted).at(line));
    }

    fn value(&mut self, path: &str, kind: &Kind, limits: &Limits, value: &Spanned<DeValue<'_>>, line: usize) {
        let accepted = match (kind, value.get_ref()) {
            (Kind::Float | Kind::Integer, DeValue::Integer(i)) => {
                i128::from_str_radix(i.as_str(), i.radix()).is_ok_and(|i| limits.range.accept(Number::Integer(i)))
            }
            (Kind::Float, DeValue::Float(x)) => x.as_str().parse().is_ok_and(|x| limits.range.accept(Number::Float(x))),
            (Kind::Boolean, DeValue::Boolean(_)) => true,
            (Kind::Text, DeValue::String(text)) => limits.accept_text(text),
            (Kind::Choice(choices), DeValue::String(text)) => choices.iter().any(|choice| choice.name == text.as_ref()),
            (Kind::Section(keys), DeValue::Table(table)) => {
                return self.table(path, &keys(), table, Some(line));
            }
            (Kind::List { of, length }, DeValue::Array(array)) => {
                self.elements(path, of, limits, array);
                length.is_none_or(|length| length == array.len()) && limits.accept_length(array.len())
            }
            (kind, found) => {
                let accepted = kind.accepted(path, limits);
                let problem = Problem::WrongType(type_name(found));
                let error = ConfigError::with_problem(problem, path, self.source_of(value), accepted);
                return self.errors.push(error.at(Some(line)));
            }
        };
        if !accepted {
            let found = self.source_of(value);
            self.errors.push(ConfigError::new(path, found, kind.accepted_value(path, limits)).at(Some(line)));
        }
    }

    fn elements(&mut self, path: &str, of: &Kind, limits: &Limits, array: &DeArray<'_>) {
        for (i, element) in array.iter().enumerate() {
            let path = format!("{path}[{i}]");
            let line = self.starts.line_at(element.span().start);
            self.lines.insert(path.clone(), line);
            self.value(&path, of, &Limits { length: None, ..*limits }, element, line);
        }
    }

    /// The key that was probably meant: one of this section with nearly this name, else one of this
    /// name elsewhere.
    fn meant(&self, path: &str, name: &str, keys: &[&Key]) -> Option<String> {
        if let Some(near) = nearest(name, keys.iter().map(|key| key.name)) {
            return Some(join(path, near));
        }
        let elsewhere = |doc: &&KeyDoc| doc.path.rsplit('.').next() == Some(name);
        self.all.iter().find(elsewhere).map(|doc| doc.path.clone())
    }

    /// The value as written in the text; for a table or an array of tables only its kind.
    fn source_of(&self, value: &Spanned<DeValue<'_>>) -> String {
        match value.get_ref() {
            DeValue::Table(_) => "{table}".to_owned(),
            DeValue::Array(array) if array.iter().any(|element| matches!(element.get_ref(), DeValue::Table(_))) => {
                format!("{} tables", array.len())
            }
            _ => self.text.get(value.span()).unwrap_or_default().to_owned(),
        }
    }

    /// Line of a key, or of the nearest thing around it.
    fn line_of(&self, key: &str) -> Option<usize> {
        let mut path = key;
        loop {
            if let Some(line) = self.lines.get(path) {
                return Some(*line);
            }
            path = &path[..path.rfind(['.', '['])?];
        }
    }
}

/// A key as TOML writes it: quoted unless it is a bare key.
fn shown_name(name: &str) -> String {
    let is_bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if is_bare { name.to_owned() } else { toml::Value::String(name.to_owned()).to_string() }
}

fn type_name(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a string",
        DeValue::Integer(_) => "an integer",
        DeValue::Float(_) => "a float",
        DeValue::Boolean(_) => "a boolean",
        DeValue::Datetime(_) => "a date or time",
        DeValue::Array(_) => "an array",
        DeValue::Table(_) => "a table",
    }
}
