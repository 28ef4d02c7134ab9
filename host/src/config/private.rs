//! What the macros' expansions need; not for direct use.

pub use {serde, toml};

use super::value::Value;

/// The value of an absent key: its declared default, or else its type's.
pub fn absent<T: Value>(default: Option<T>) -> Option<T> {
    default.or_else(T::when_missing)
}

/// Joins the lines of a doc comment.
pub fn meaning(lines: &[&str]) -> String {
    lines.iter().map(|line| line.trim()).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Whether an enum's name in the configuration is written in `snake_case`.
pub const fn is_snake_case(name: &str) -> bool {
    let bytes = name.as_bytes();
    let mut i = 0;
    while i < bytes.len() {
        let accepted = bytes[i].is_ascii_lowercase() || (i > 0 && (bytes[i].is_ascii_digit() || bytes[i] == b'_'));
        if !accepted {
            return false;
        }
        i += 1;
    }
    !bytes.is_empty()
}
