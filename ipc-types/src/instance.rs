//! The name of one daemon with its robot.

use std::fmt;
use std::str::FromStr;

/// Longest instance name, in bytes.
pub const MAX_INSTANCE_LENGTH: usize = 32;

/// The name of one daemon with its robot: `[a-z0-9][a-z0-9_-]{0,31}`. It is part of every service
/// name.
#[derive(Debug, Clone, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Instance(String);

/// A text that is no instance name; control characters are escaped.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("instance name {name:?}: accepted: {}", self.accepted())]
pub struct InstanceError {
    /// The text.
    pub name: String,
}

impl InstanceError {
    /// What is accepted.
    pub fn accepted(&self) -> String {
        format!("1 to {MAX_INSTANCE_LENGTH} characters of a-z, 0-9, _ and -, the first one of a-z and 0-9")
    }
}

impl Instance {
    /// Checks the name.
    ///
    /// # Errors
    /// [`InstanceError`] says which rule the name breaks.
    pub fn new(name: &str) -> Result<Self, InstanceError> {
        let first = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit();
        let fits = name.len() <= MAX_INSTANCE_LENGTH && name.starts_with(first);
        if !(fits && name.chars().all(|c| first(c) || c == '_' || c == '-')) {
            return Err(InstanceError { name: name.to_owned() });
        }
        Ok(Self(name.to_owned()))
    }

    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Instance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

impl FromStr for Instance {
    type Err = InstanceError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::new(name)
    }
}

impl TryFrom<String> for Instance {
    type Error = InstanceError;

    fn try_from(name: String) -> Result<Self, Self::Error> {
        Self::new(&name)
    }
}

impl From<Instance> for String {
    fn from(instance: Instance) -> Self {
        instance.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_are_accepted() {
        for name in ["r1", "0", "robot-7_left", &"a".repeat(32)] {
            assert_eq!(Instance::new(name).map(|i| i.to_string()), Ok(name.to_owned()));
        }
    }

    #[test]
    fn other_texts_are_refused() {
        let long = "a".repeat(33);
        for name in ["", &long, "-a", "a/b", "R1", "a b", "a.b", "é", "a\u{1b}"] {
            let error = Instance::new(name).unwrap_err().to_string();
            assert!(error.starts_with(&format!("instance name {name:?}: accepted: 1 to 32 ")), "{error}");
        }
    }

    #[test]
    fn serde_uses_the_same_rules() {
        assert_eq!(serde_json::from_str::<Instance>("\"r1\"").unwrap().as_str(), "r1");
        let error = serde_json::from_str::<Instance>("\"R1\"").unwrap_err().to_string();
        assert!(error.contains("instance name \"R1\": accepted: "), "{error}");
    }
}
