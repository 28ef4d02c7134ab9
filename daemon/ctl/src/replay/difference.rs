//! Where two answers differ, and by how much.

use std::fmt::{Display, Formatter, Result};

use comfy_table::{CellAlignment, Table, presets};
use serde_json::Value;

/// Fields that differ, each with the recorded and the replayed value.
#[derive(Debug, Default)]
pub(crate) struct Difference(Vec<(String, String, String, String)>);

impl Difference {
    /// Compares a value that is not part of a sample.
    pub(crate) fn of(field: &str, recorded: impl Display, replayed: impl Display) -> Self {
        Self(vec![(field.to_owned(), recorded.to_string(), replayed.to_string(), String::new())])
    }

    /// Compares two samples as JSON, field by field and element by element.
    pub(crate) fn between(recorded: &Value, replayed: &Value) -> Self {
        let mut difference = Self::default();
        difference.compare("", recorded, replayed);
        difference
    }

    fn compare(&mut self, path: &str, recorded: &Value, replayed: &Value) {
        match (recorded, replayed) {
            (Value::Object(one), Value::Object(other)) => {
                for (name, value) in one {
                    let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                    self.compare(&path, value, other.get(name).unwrap_or(&Value::Null));
                }
            }
            (Value::Array(one), Value::Array(other)) => {
                for (index, (value, other)) in one.iter().zip(other).enumerate() {
                    self.compare(&format!("{path}[{index}]"), value, other);
                }
            }
            _ => {
                // As text: as numbers 0 and −0 are the same.
                let (before, after) = (recorded.to_string(), replayed.to_string());
                if before != after {
                    let by = match (recorded.as_f64(), replayed.as_f64()) {
                        (Some(before), Some(after)) => format!("{:e}", after - before),
                        _ => String::new(),
                    };
                    self.0.push((path.to_owned(), before, after, by));
                }
            }
        }
    }
}

impl Display for Difference {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let mut table = Table::new();
        table.load_style(presets::ASCII_MARKDOWN);
        table.set_header(["field", "recorded", "replayed", "replayed - recorded"]);
        for (field, recorded, replayed, by) in &self.0 {
            table.add_row([field, recorded, replayed, by]);
        }
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        write!(f, "{table}")
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn every_field_that_differs_is_named_with_both_values() {
        let recorded = json!({ "a": 1, "b": [0.5, 1.0, -0.0], "c": 2 });
        let replayed = json!({ "a": 1, "b": [0.5, 1.0000000000000002, 0.0], "c": 2 });
        let text = Difference::between(&recorded, &replayed).to_string();
        for part in ["b[1]", "1.0000000000000002", "2.220446049250313e-16", "b[2]", "-0.0"] {
            assert!(text.contains(part), "{part} is missing in {text}");
        }
        assert!(!text.contains("b[0]") && !text.contains("| a "), "{text}");
    }
}
