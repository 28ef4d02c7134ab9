//! Types that a key can have, and the description of a key.

use super::docs::{KeyDoc, flatten};
use super::error::ConfigError;
use super::range::{Limits, LimitsOf, NoRange, Scalar};

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

    /// What a value must be besides its type; empty if only the type matters.
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
            Self::Text => limits.length.map(|length| format!("{length} printable characters")).unwrap_or_default(),
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

    /// What is accepted for the key at `path`, type included: for messages about a missing or
    /// wrongly typed value.
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

    /// What is accepted for a value that already has the right type.
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
    /// For a removed key: why, and what replaces it.
    pub removed: Option<&'static str>,
}

impl Key {
    /// A removed key.
    pub fn removed(name: &'static str, why: &'static str) -> Self {
        Self {
            name,
            kind: Kind::Text,
            limits: LimitsOf::<NoRange>::default().limits(),
            default: None,
            required: false,
            meaning: String::new(),
            removed: Some(why),
        }
    }
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

    /// Checks every key's value, and with no error among them the rules between keys; appends *all*
    /// errors.
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

/// The section that is a whole file; declared with [`config_file!`](crate::config_file).
pub trait File: Section {
    /// What serde makes of a text. A function of the file's own crate, so that those who use it
    /// need not compile it again.
    ///
    /// # Errors
    /// What TOML or serde does not accept.
    fn deserialized(text: &str) -> Result<Self, toml::de::Error>;
}

/// Path of a key in the section at `path`.
pub fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}
