//! The table of keys.

use std::fmt::Write;

use super::range::Limits;
use super::value::{Key, Kind, join};

/// Everything known about a key, for documentation and tests.
#[derive(Clone, Debug)]
pub struct KeyDoc {
    /// Dotted path; `[]` stands for each table of an array: `robot.joint[].length_m`.
    pub path: String,
    /// TOML type.
    pub kind: Kind,
    /// Unit; `None` if the key is not a number, `"1"` for a number without dimension.
    pub unit: Option<&'static str>,
    /// Unit, range and length as declared.
    pub limits: Limits,
    /// What is accepted, in words.
    pub range: String,
    /// Default as TOML; `None` when the key is required.
    pub default: Option<String>,
    /// What the key means.
    pub meaning: String,
}

impl KeyDoc {
    /// Whether the key must be there (in the section that it belongs to, when that is optional).
    pub fn is_required(&self) -> bool {
        self.default.is_none()
    }

    /// Whether it is a section, or an array of sections.
    pub(super) fn holds_section(&self) -> bool {
        matches!(innermost(&self.kind), Kind::Section(_))
    }
}

/// A section's keys and those of the sections in it, depth first; each section has an entry too.
pub(super) fn flatten(path: &str, keys: &[Key]) -> Vec<KeyDoc> {
    let mut docs = Vec::new();
    for key in keys.iter().filter(|key| key.removed.is_none()) {
        let path = join(path, key.name);
        docs.push(KeyDoc {
            kind: key.kind.clone(),
            unit: key.limits.unit,
            limits: key.limits,
            range: key.kind.accepted_value(&path, &key.limits),
            default: key.default.clone(),
            meaning: key.meaning.clone(),
            path: path.clone(),
        });
        let (mut below, mut kind) = (path, &key.kind);
        while let Kind::List { of, .. } = kind {
            below.push_str("[]");
            kind = of;
        }
        if let Kind::Section(keys) = kind {
            docs.extend(flatten(&below, &keys()));
        }
    }
    docs
}

/// The keys as a Markdown table: key, type, unit, what is accepted, default, meaning.
pub fn keys_markdown(keys: &[KeyDoc]) -> String {
    let mut text = String::from("| key | type | unit | accepted | default | meaning |\n|---|---|---|---|---|---|\n");
    for key in keys {
        let cell = |s: &str| s.replace('|', "\\|");
        let is_section = key.holds_section();
        let default = match &key.default {
            None => "required".to_owned(),
            Some(default) if default == "none" => "none".to_owned(),
            Some(_) if is_section => "that of each key".to_owned(),
            Some(default) => format!("`{}`", cell(default)),
        };
        let mut meaning = cell(&key.meaning);
        if let Kind::Choice(choices) = innermost(&key.kind) {
            for choice in *choices {
                let of_choice = super::private::meaning(choice.meaning);
                let _ = write!(meaning, "<br>`\"{}\"`: {}", choice.name, cell(&of_choice));
            }
        }
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "| `{}` | {} | {} | {} | {default} | {meaning} |",
            key.path,
            key.kind.name(),
            key.unit.unwrap_or_default(),
            cell(&key.range),
        );
    }
    text
}

fn innermost(kind: &Kind) -> &Kind {
    match kind {
        Kind::List { of, .. } => innermost(of),
        other => other,
    }
}
