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

/// Why a text is no instance name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum InstanceError {
    /// Nothing was given.
    #[error("the instance name is empty: accepted are 1 to {MAX_INSTANCE_LENGTH} characters of a-z, 0-9, _ and -")]
    Empty,
    /// Longer than [`MAX_INSTANCE_LENGTH`].
    #[error("instance name \"{name}\" is {length} bytes long: at most {MAX_INSTANCE_LENGTH} are accepted")]
    TooLong {
        /// The name.
        name: String,
        /// Its bytes.
        length: usize,
    },
    /// The first character is neither a small letter nor a digit.
    #[error("instance name \"{name}\" starts with '{character}': the first character must be one of a-z and 0-9")]
    FirstCharacter {
        /// The name.
        name: String,
        /// What it starts with.
        character: char,
    },
    /// A character that is not accepted in any position.
    #[error("instance name \"{name}\" contains '{character}': accepted are a-z, 0-9, _ and -")]
    Character {
        /// The name.
        name: String,
        /// The first character at fault.
        character: char,
    },
}

impl Instance {
    /// Checks the name.
    ///
    /// # Errors
    /// [`InstanceError`] says which rule the name breaks.
    pub fn new(name: &str) -> Result<Self, InstanceError> {
        let accepted = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit();
        let owned = || name.to_owned();
        let Some(first) = name.chars().next() else { return Err(InstanceError::Empty) };
        if let Some(character) = name.chars().find(|&c| !accepted(c) && c != '_' && c != '-') {
            return Err(InstanceError::Character { name: owned(), character });
        }
        if !accepted(first) {
            return Err(InstanceError::FirstCharacter { name: owned(), character: first });
        }
        if name.len() > MAX_INSTANCE_LENGTH {
            return Err(InstanceError::TooLong { name: owned(), length: name.len() });
        }
        Ok(Self(owned()))
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
    fn each_rule_has_its_error() {
        let long = "a".repeat(33);
        assert_eq!(Instance::new(""), Err(InstanceError::Empty));
        assert_eq!(Instance::new(&long), Err(InstanceError::TooLong { name: long.clone(), length: 33 }));
        assert_eq!(Instance::new("-a"), Err(InstanceError::FirstCharacter { name: "-a".into(), character: '-' }));
        for (name, character) in [("a/b", '/'), ("R1", 'R'), ("a b", ' '), ("a.b", '.'), ("é", 'é')] {
            assert_eq!(Instance::new(name), Err(InstanceError::Character { name: name.into(), character }));
        }
    }

    #[test]
    fn serde_uses_the_same_rules() {
        assert_eq!(serde_json::from_str::<Instance>("\"r1\"").unwrap().as_str(), "r1");
        let error = serde_json::from_str::<Instance>("\"R1\"").unwrap_err().to_string();
        assert!(error.contains("instance name \"R1\" contains 'R'"), "{error}");
    }
}
