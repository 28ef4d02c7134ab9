//! Where a daemon and its peers meet: root path, prefix and instance; and the iceoryx2 node made
//! from them.

use std::io;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::DirBuilderExt;
use std::path::PathBuf;

use iceoryx2::config::Config;
use iceoryx2::node::NodeCreationFailure;
use iceoryx2::prelude::{FileName, LogLevel, NodeBuilder, NodeName, SemanticString, SignalHandlingMode, ipc};

use crate::Instance;
use crate::resources::{Lacking, Needed, OtherOwner};

/// A node on shared memory. Neither it nor its ports can be sent to another thread.
pub type Node = iceoryx2::node::Node<ipc::Service>;

/// iceoryx2's own root path on Linux: shared with every other program that configures nothing.
pub const DEFAULT_ROOT_PATH: &str = "/tmp/iceoryx2";
/// iceoryx2's own prefix: shared with every other program that configures nothing.
pub const DEFAULT_PREFIX: &str = "iox2_";
/// Longest prefix, in bytes.
pub const MAX_PREFIX_LENGTH: usize = 16;

/// Longest path of a Unix socket in bytes: `sun_path` holds 108 with the closing zero.
const MAX_SOCKET_PATH: usize = 107;
/// The one socket that iceoryx2 makes is a listener's: ROOT/PREFIX, a 128-bit id in decimal (up to
/// 39 digits), ".event".
const LISTENER_NAME_LENGTH: usize = 39 + ".event".len();

/// Where a daemon and its peers meet. All programs that work together need the same three values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct IpcSettings {
    /// Directory of the discovery files and sockets: absolute, on a local file system. Shared
    /// memory itself is in `/dev/shm`.
    pub root_path: PathBuf,
    /// Start of every file name that iceoryx2 makes, also in `/dev/shm`: 1 to 16 of A-Z, a-z, 0-9,
    /// _ and -.
    pub prefix: String,
    /// The daemon's name.
    pub instance: Instance,
}

/// Why settings are refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SettingsError {
    /// A relative root path would depend on each program's working directory.
    #[error("ipc.root_path = \"{}\": accepted is an absolute path, such as /run/admittanced", root_path.display())]
    RelativeRootPath {
        /// The path.
        root_path: PathBuf,
    },
    /// iceoryx2 takes printable ASCII without `..` only.
    #[error(
        "ipc.root_path = \"{}\": accepted are letters, digits and the characters / _ - . in it, no component \"..\"",
        root_path.display()
    )]
    RootPathCharacters {
        /// The path.
        root_path: PathBuf,
    },
    /// A socket below the root path would pass the limit of Unix sockets.
    #[error(
        "ipc.root_path = \"{}\" is {length} bytes long: with the prefix \"{prefix}\" at most {accepted} are \
         accepted, because \
         iceoryx2 makes sockets in it and a socket's path is limited to {MAX_SOCKET_PATH} bytes",
        root_path.display()
    )]
    RootPathTooLong {
        /// The path.
        root_path: PathBuf,
        /// Its bytes.
        length: usize,
        /// Most bytes that are accepted.
        accepted: usize,
        /// The prefix.
        prefix: String,
    },
    /// The prefix is empty, too long, or has a character that is not accepted.
    #[error("ipc.prefix = \"{prefix}\": accepted are 1 to {MAX_PREFIX_LENGTH} characters of A-Z, a-z, 0-9, _ and -")]
    Prefix {
        /// The prefix.
        prefix: String,
    },
}

/// Why a node could not be made.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// The settings themselves are not accepted.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The machine lacks something that every program needs.
    #[error(transparent)]
    Lacking(#[from] Lacking),
    /// The root directory is another user's.
    #[error(transparent)]
    OtherOwner(#[from] OtherOwner),
    /// The root directory is not there and could not be made.
    #[error("the root directory {} (ipc.root_path) cannot be made: {source}", root_path.display())]
    RootDirectory {
        /// The directory.
        root_path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// iceoryx2 may not write below the root path or in `/dev/shm`.
    #[error(
        "no permission to make an iceoryx2 node in {} (ipc.root_path) or /dev/shm: run all programs of an instance \
         as the \
         same user",
        root_path.display()
    )]
    Permission {
        /// The root path.
        root_path: PathBuf,
    },
    /// Any other failure of iceoryx2.
    #[error(
        "iceoryx2 cannot make a node in {} (ipc.root_path): {cause:?}. Is /dev/shm mounted, writable and not full?",
        root_path.display()
    )]
    Iceoryx2 {
        /// The root path.
        root_path: PathBuf,
        /// What iceoryx2 said.
        cause: NodeCreationFailure,
    },
}

impl NodeError {
    /// Whether another user could connect.
    pub fn is_permission(&self) -> bool {
        matches!(self, Self::OtherOwner(_) | Self::Permission { .. })
    }
}

impl IpcSettings {
    /// Looks for what a program needs before it makes or opens anything.
    ///
    /// # Errors
    /// [`NodeError`].
    pub fn check(&self, needed: Needed) -> Result<(), NodeError> {
        self.validate()?;
        needed.check()?;
        OtherOwner::of(&self.root_path).map_or(Ok(()), |other| Err(other.into()))
    }

    /// Checks the settings: characters, and that every socket that iceoryx2 makes stays under the
    /// system's path limit.
    ///
    /// # Errors
    /// [`SettingsError`] names the setting, its value and what is accepted.
    pub fn validate(&self) -> Result<(), SettingsError> {
        let accepted = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        let prefix = self.prefix.clone();
        if prefix.is_empty() || prefix.len() > MAX_PREFIX_LENGTH || !prefix.chars().all(accepted) {
            return Err(SettingsError::Prefix { prefix });
        }
        let root_path = self.root_path.clone();
        if !root_path.is_absolute() {
            return Err(SettingsError::RelativeRootPath { root_path });
        }
        let text = root_path.to_str().unwrap_or("\0");
        if !text.chars().all(|c| accepted(c) || c == '/' || c == '.') || text.split('/').any(|part| part == "..") {
            return Err(SettingsError::RootPathCharacters { root_path });
        }
        let length = root_path.as_os_str().as_bytes().len();
        let accepted = MAX_SOCKET_PATH - 1 - prefix.len() - LISTENER_NAME_LENGTH;
        if length > accepted {
            return Err(SettingsError::RootPathTooLong { root_path, length, accepted, prefix });
        }
        Ok(())
    }

    /// The iceoryx2 configuration: its compiled-in values with these settings. No file is looked
    /// up, because iceoryx2's own look-up depends on the working directory.
    ///
    /// # Errors
    /// Those of [`validate`](Self::validate).
    pub fn config(&self) -> Result<Config, SettingsError> {
        self.validate()?;
        let root_path = iceoryx2::prelude::Path::new(self.root_path.as_os_str().as_bytes())
            .map_err(|_| SettingsError::RootPathCharacters { root_path: self.root_path.clone() })?;
        let prefix =
            FileName::new(self.prefix.as_bytes()).map_err(|_| SettingsError::Prefix { prefix: self.prefix.clone() })?;
        let mut config = Config::default();
        config.global.set_root_path(&root_path);
        config.global.prefix = prefix;
        Ok(config)
    }

    /// Makes a node for this thread; `program` is what tools such as `iox2 node list` show. The
    /// root directory is made when it is not there. iceoryx2 installs no signal handler. Dead nodes
    /// found on the way are cleaned up (thousands of allocations), so make nodes before a thread
    /// goes real-time.
    ///
    /// # Errors
    /// [`NodeError`].
    pub fn node(&self, program: &str) -> Result<Node, NodeError> {
        self.check(Needed::TOOL)?;
        let config = self.config()?;
        let root_path = || self.root_path.clone();
        std::fs::DirBuilder::new()
            .recursive(true)
            .mode(0o750)
            .create(&self.root_path)
            .map_err(|source| NodeError::RootDirectory { root_path: root_path(), source })?;
        let mut builder = NodeBuilder::new().config(&config).signal_handling_mode(SignalHandlingMode::Disabled);
        // The name only labels the node: one that iceoryx2 does not accept is left out.
        if let Ok(name) = NodeName::new(program) {
            builder = builder.name(&name);
        }
        builder.create::<ipc::Service>().map_err(|cause| match cause {
            NodeCreationFailure::InsufficientPermissions => NodeError::Permission { root_path: root_path() },
            cause => NodeError::Iceoryx2 { root_path: root_path(), cause },
        })
    }
}

/// Keeps iceoryx2's own messages off stderr unless they are errors: every failure that matters
/// comes back as a value. Call it once at the start of a program.
pub fn quiet_iceoryx2() {
    iceoryx2::prelude::set_log_level(LogLevel::Error);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(root_path: &str, prefix: &str) -> IpcSettings {
        let instance = Instance::new("r1").expect("accepted");
        IpcSettings { root_path: root_path.into(), prefix: prefix.into(), instance }
    }

    #[test]
    fn a_path_that_is_too_long_names_the_limit() {
        // 107 bytes of socket path, less "/", the prefix, 39 digits and ".event".
        let accepted = 107 - 1 - "ab_".len() - 45;
        let fits = format!("/{}", "r".repeat(accepted - 1));
        assert_eq!(settings(&fits, "ab_").validate(), Ok(()));
        let error = settings(&format!("{fits}r"), "ab_").validate().unwrap_err();
        assert!(
            error.to_string().contains("is 59 bytes long: with the prefix \"ab_\" at most 58 are accepted"),
            "{error}"
        );
    }

    #[test]
    fn each_rule_has_its_error() {
        for prefix in ["", "a/b", "a b", "12345678901234567"] {
            assert_eq!(settings("/r", prefix).validate(), Err(SettingsError::Prefix { prefix: prefix.into() }));
        }
        let relative = settings("run/admittanced", "ab_");
        assert_eq!(relative.validate(), Err(SettingsError::RelativeRootPath { root_path: relative.root_path.clone() }));
        for root in ["/a b", "/a/../b", "/\u{e9}"] {
            let bad = settings(root, "ab_");
            assert_eq!(bad.validate(), Err(SettingsError::RootPathCharacters { root_path: root.into() }));
        }
    }

    #[test]
    fn the_configuration_carries_the_settings() {
        let config = settings("/run/admittanced", "ab_").config().expect("accepted");
        assert_eq!(config.global.root_path().to_string(), "/run/admittanced");
        assert_eq!(config.global.prefix.to_string(), "ab_");
    }

    #[test]
    fn a_root_that_cannot_be_made_is_named() {
        let error = settings("/dev/null/x", "ab_").node("test").unwrap_err().to_string();
        assert!(error.starts_with("the root directory /dev/null/x (ipc.root_path) cannot be made: "), "{error}");
    }
}
