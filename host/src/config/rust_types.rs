//! The Rust types that a key can have: numbers, `bool`, strings, paths, and options, lists and
//! arrays of them.

use std::path::{Path, PathBuf};

use super::error::ConfigError;
use super::range::{Limits, NoRange, Number, Scalar};
use super::value::{Kind, Value};

fn check_number(x: Number, kind: &Kind, path: &str, limits: &Limits, errors: &mut Vec<ConfigError>) {
    if !limits.range.accept(x) {
        errors.push(ConfigError::new(path, x, kind.accepted_value(path, limits)));
    }
}

fn check_text(text: &str, path: &str, limits: &Limits, errors: &mut Vec<ConfigError>) {
    if !limits.accept_text(text) {
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
