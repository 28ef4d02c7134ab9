//! Types that a key can have, and the description of a key.

use std::path::{Path, PathBuf};

use super::docs::{KeyDoc, flatten};
use super::error::ConfigError;
use super::range::{Limits, NoRange, Number, Scalar};

/// One name of a [`config_enum!`](crate::config_enum).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// As the configuration writes it, in `snake_case`.
    pub name: &'static str,
    /// Its doc comment, line by line.
    pub meaning: &'static [&'static str],
}

/// The TOML type of a key.
#[derive(Clone, Debug)]
pub enum Kind {
    /// A number with a fraction; whole numbers are accepted too.
    Float,
    /// A whole number.
    Integer,
    /// `true` or `false`.
    Boolean,
    /// A string.
    Text,
    /// A string out of a list of names.
    Choice(&'static [Choice]),
    /// An array; of sections: `[[path]]`.
    List {
        /// What its elements are.
        of: Box<Kind>,
        /// Its fixed length, if it has one.
        length: Option<usize>,
    },
    /// A table, with the function that describes its keys.
    Section(fn() -> Vec<Key>),
}

impl Kind {
    /// The type in words, for one value.
    pub fn name(&self) -> String {
        match self {
            Self::Float => "number".to_owned(),
            Self::Integer => "integer".to_owned(),
            Self::Boolean => "true or false".to_owned(),
            Self::Text => "string".to_owned(),
            Self::Choice(_) => "name".to_owned(),
            Self::Section(_) => "table".to_owned(),
            Self::List { of, length: None } => format!("array of {}", of.plural()),
            Self::List { of, length: Some(n) } => format!("array of {n} {}", of.plural()),
        }
    }

    fn plural(&self) -> String {
        match self {
            Self::Boolean => "true or false".to_owned(),
            Self::List { .. } => self.name().replacen("array", "arrays", 1),
            _ => self.name() + "s",
        }
    }

    /// What a value must be, its type apart; empty when nothing but the type is asked.
    fn restriction(&self, limits: &Limits) -> String {
        match self {
            Self::Float | Self::Integer => match limits.shown_unit() {
                Some(unit) if limits.range == super::Bounds::ANY => format!("{}, in {unit}", limits.range),
                Some(unit) => format!("{} {unit}", limits.range),
                None => limits.range.to_string(),
            },
            Self::Choice(choices) => {
                let names: Vec<_> = choices.iter().map(|choice| format!("\"{}\"", choice.name)).collect();
                names.join(" or ")
            }
            Self::Text => limits.length.map(|length| format!("{length} characters")).unwrap_or_default(),
            Self::List { of, .. } => {
                let of_length = limits.length.map(|length| format!("of length {length}"));
                let of_elements = Some(of.restriction(&Limits { length: None, ..*limits })).filter(|s| !s.is_empty());
                let of_elements = match of.as_ref() {
                    Self::List { .. } => of_elements,
                    _ => of_elements.map(|restriction| format!("each {restriction}")),
                };
                [of_length, of_elements].into_iter().flatten().collect::<Vec<_>>().join(", ")
            }
            Self::Boolean | Self::Section(_) => String::new(),
        }
    }

    /// What is accepted for the key at `path`, type included: for messages about a missing or wrongly typed value.
    pub fn accepted(&self, path: &str, limits: &Limits) -> String {
        let name = match self {
            Self::Section(_) => format!("table [{path}]"),
            Self::List { of, length } if matches!(**of, Self::Section(_)) => match length {
                Some(n) => format!("{n} tables [[{path}]]"),
                None => format!("tables [[{path}]]"),
            },
            _ => self.name(),
        };
        match self.restriction(limits) {
            restriction if restriction.is_empty() => name,
            restriction => format!("{name}, {restriction}"),
        }
    }

    /// What is accepted of a value that has the right type already.
    pub fn accepted_value(&self, path: &str, limits: &Limits) -> String {
        match self {
            Self::Float | Self::Integer | Self::Choice(_) => self.restriction(limits),
            _ => self.accepted(path, limits),
        }
    }
}

/// One key of a section, as declared.
#[derive(Clone, Debug)]
pub struct Key {
    /// Name in its section.
    pub name: &'static str,
    /// TOML type.
    pub kind: Kind,
    /// Unit, range and length.
    pub limits: Limits,
    /// Its default as TOML; `None` when it has none.
    pub default: Option<String>,
    /// Whether the key must be there.
    pub required: bool,
    /// Its doc comment.
    pub meaning: String,
}

/// A type that a key can have.
pub trait Value: Sized {
    /// The number type that its range is written in; [`NoRange`] when it is no number.
    type Scalar: Scalar;

    /// TOML type.
    fn kind() -> Kind;

    /// The value of an absent key that declares no default; `None` makes the key required.
    fn when_missing() -> Option<Self> {
        None
    }

    /// Appends an error for each part of the value that the limits do not accept.
    fn check_value(&self, path: &str, limits: &Limits, errors: &mut Vec<ConfigError>);

    /// The value as TOML writes it, for tables of defaults.
    fn to_toml(&self) -> String;
}

/// A table of the configuration; declared with [`config_section!`](crate::config_section).
pub trait Section: Value + serde::de::DeserializeOwned {
    /// The keys of this table, in the order of their declaration.
    fn schema() -> Vec<Key>;

    /// Checks every key's value, and with no error among them the rules between keys; appends *all* errors.
    ///
    /// `path` is the dotted path of this section, empty for the root.
    fn check(&self, path: &str, errors: &mut Vec<ConfigError>);

    /// Rules between keys; called by [`Section::check`] when every key is acceptable by itself.
    fn cross_check(&self, path: &str, errors: &mut Vec<ConfigError>);

    /// All keys of this section and of the sections in it; `path` as in [`Section::check`].
    fn keys(path: &str) -> Vec<KeyDoc> {
        flatten(path, &Self::schema())
    }
}

/// Path of a key in the section at `path`.
pub fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}

fn check_number(x: Number, kind: &Kind, path: &str, limits: &Limits, errors: &mut Vec<ConfigError>) {
    if !limits.range.accept(x) {
        errors.push(ConfigError::new(path, x, kind.accepted_value(path, limits)));
    }
}

fn check_text(text: &str, path: &str, limits: &Limits, errors: &mut Vec<ConfigError>) {
    if !limits.accept_length(text.chars().count()) {
        errors.push(ConfigError::new(path, text_to_toml(text), Kind::Text.accepted_value(path, limits)));
    }
}

fn check_elements<T: Value>(elements: &[T], path: &str, limits: &Limits, errors: &mut Vec<ConfigError>) {
    for (i, element) in elements.iter().enumerate() {
        element.check_value(&format!("{path}[{i}]"), &Limits { length: None, ..*limits }, errors);
    }
}

fn text_to_toml(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

fn elements_to_toml<T: Value>(elements: &[T]) -> String {
    format!("[{}]", elements.iter().map(Value::to_toml).collect::<Vec<_>>().join(", "))
}

macro_rules! number_value {
    ($kind:ident: $($number:ty),+) => { $(
        impl Value for $number {
            type Scalar = Self;

            fn kind() -> Kind {
                Kind::$kind
            }

            fn check_value(&self, path: &str, limits: &Limits, errors: &mut Vec<ConfigError>) {
                check_number(self.number(), &Kind::$kind, path, limits, errors);
            }

            fn to_toml(&self) -> String {
                toml_number(self.number())
            }
        }
    )+ };
}
number_value!(Float: f64);
number_value!(Integer: i32, i64, u8, u16, u32, u64, usize);

/// A float keeps its point, as TOML has two kinds of numbers.
fn toml_number(x: Number) -> String {
    match x {
        Number::Integer(i) => i.to_string(),
        Number::Float(x) => toml::Value::Float(x).to_string(),
    }
}

impl Value for bool {
    type Scalar = NoRange;

    fn kind() -> Kind {
        Kind::Boolean
    }

    fn check_value(&self, _: &str, _: &Limits, _: &mut Vec<ConfigError>) {}

    fn to_toml(&self) -> String {
        self.to_string()
    }
}

impl Value for String {
    type Scalar = NoRange;

    fn kind() -> Kind {
        Kind::Text
    }

    fn check_value(&self, path: &str, limits: &Limits, errors: &mut Vec<ConfigError>) {
        check_text(self, path, limits, errors);
    }

    fn to_toml(&self) -> String {
        text_to_toml(self)
    }
}

impl Value for PathBuf {
    type Scalar = NoRange;

    fn kind() -> Kind {
        Kind::Text
    }

    fn check_value(&self, path: &str, limits: &Limits, errors: &mut Vec<ConfigError>) {
        check_text(&Path::to_string_lossy(self), path, limits, errors);
    }

    fn to_toml(&self) -> String {
        text_to_toml(&Path::to_string_lossy(self))
    }
}

impl<T: Value> Value for Option<T> {
    type Scalar = T::Scalar;

    fn kind() -> Kind {
        T::kind()
    }

    fn when_missing() -> Option<Self> {
        Some(None)
    }

    fn check_value(&self, path: &str, limits: &Limits, errors: &mut Vec<ConfigError>) {
        if let Some(value) = self {
            value.check_value(path, limits, errors);
        }
    }

    fn to_toml(&self) -> String {
        self.as_ref().map_or_else(|| "none".to_owned(), Value::to_toml)
    }
}

impl<T: Value> Value for Vec<T> {
    type Scalar = T::Scalar;

    fn kind() -> Kind {
        Kind::List { of: Box::new(T::kind()), length: None }
    }

    fn check_value(&self, path: &str, limits: &Limits, errors: &mut Vec<ConfigError>) {
        if !limits.accept_length(self.len()) {
            let value = format!("{} elements", self.len());
            errors.push(ConfigError::new(path, value, Self::kind().accepted_value(path, limits)));
        }
        check_elements(self, path, limits, errors);
    }

    fn to_toml(&self) -> String {
        elements_to_toml(self)
    }
}

impl<T: Value, const N: usize> Value for [T; N] {
    type Scalar = T::Scalar;

    fn kind() -> Kind {
        Kind::List { of: Box::new(T::kind()), length: Some(N) }
    }

    fn check_value(&self, path: &str, limits: &Limits, errors: &mut Vec<ConfigError>) {
        check_elements(self, path, limits, errors);
    }

    fn to_toml(&self) -> String {
        elements_to_toml(self)
    }
}
