//! Where a daemon and its peers meet: root path, prefix and instance; and the iceoryx2 node made
//! from them.

use std::mem::ManuallyDrop;
use std::ops::Deref;
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::NodeCreationFailure;
use iceoryx2::prelude::{FileName, LogLevel, NodeBuilder, NodeName, SemanticString, SignalHandlingMode, ipc};

use crate::place::{PlaceError, open_root};
use crate::resources::{Lacking, Needed};
use crate::{Instance, leftovers, node_counter};

/// A node on shared memory. Neither it nor its ports can be sent to another thread. Drop it after
/// its ports: the last node of a place takes all that is left there with it.
#[derive(Debug)]
pub struct Node {
    node: ManuallyDrop<iceoryx2::node::Node<ipc::Service>>,
    settings: IpcSettings,
}

impl Deref for Node {
    type Target = iceoryx2::node::Node<ipc::Service>;

    fn deref(&self) -> &Self::Target {
        &self.node
    }
}

impl Node {
    pub(crate) fn settings(&self) -> &IpcSettings {
        &self.settings
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        // iceoryx2 clears up after the dead here, too.
        leftovers::remove_half_made_memory(&self.settings.prefix);
        // SAFETY: it is dropped here only, and not used again.
        unsafe { ManuallyDrop::drop(&mut self.node) };
        if let Ok(config) = self.settings.config() {
            leftovers::clear_if_deserted(&self.settings, &config);
        }
    }
}

/// How long a node waits, for each one that was killed, until another process has cleared up after it:
/// that takes milliseconds, unless it is killed in turn.
const CLEARING: Duration = Duration::from_secs(1);

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

/// A setting that is refused: `key = "value": accepted: …`. Control characters are escaped.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("ipc.{key} = {value:?}: accepted: {accepted}")]
pub struct SettingsError {
    /// Its key in `[ipc]`.
    pub key: &'static str,
    /// Its value.
    pub value: String,
    /// What is accepted instead.
    pub accepted: String,
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
    /// The root directory, or a file in shared memory, is not this user's alone.
    #[error(transparent)]
    Place(#[from] PlaceError),
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
        match self {
            Self::Place(place) => place.is_permission(),
            Self::Permission { .. } => true,
            _ => false,
        }
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
        match open_root(&self.root_path, false) {
            // Whoever may make it does so later.
            Ok(_) | Err(PlaceError::Absent { .. }) => Ok(()),
            Err(other) => Err(other.into()),
        }
    }

    /// Checks the settings: characters, and that every socket that iceoryx2 makes stays under the
    /// system's path limit.
    ///
    /// # Errors
    /// [`SettingsError`] names the setting, its value and what is accepted.
    pub fn validate(&self) -> Result<(), SettingsError> {
        let accepted = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        let prefix = &self.prefix;
        if prefix.is_empty() || prefix.len() > MAX_PREFIX_LENGTH || !prefix.chars().all(accepted) {
            return Err(self.prefix_error());
        }
        // A relative one would depend on each program's working directory.
        if !self.root_path.is_absolute() {
            return Err(self.root_path_error("an absolute path, such as /run/admittanced"));
        }
        // iceoryx2 takes printable ASCII without ".." only.
        let text = self.root_path.to_str().unwrap_or("\0");
        if !text.chars().all(|c| accepted(c) || c == '/' || c == '.') || text.split('/').any(|part| part == "..") {
            return Err(self.root_path_error("letters, digits and the characters / _ - . in it, no component \"..\""));
        }
        // What is directly below the root of the file system is the system's.
        if self.root_path.components().count() < 3 {
            return Err(self.root_path_error("a directory of its own below another one, such as /run/admittanced"));
        }
        let most = MAX_SOCKET_PATH - 1 - prefix.len() - LISTENER_NAME_LENGTH;
        if self.root_path.as_os_str().len() > most {
            return Err(self.root_path_error(format!(
                "at most {most} bytes with the prefix {prefix:?}: iceoryx2 makes sockets in it, and a socket's path is \
                 limited to {MAX_SOCKET_PATH} bytes"
            )));
        }
        Ok(())
    }

    fn root_path_error(&self, accepted: impl Into<String>) -> SettingsError {
        let value = self.root_path.to_string_lossy().into_owned();
        SettingsError { key: "root_path", value, accepted: accepted.into() }
    }

    fn prefix_error(&self) -> SettingsError {
        let accepted = format!("1 to {MAX_PREFIX_LENGTH} characters of A-Z, a-z, 0-9, _ and -");
        SettingsError { key: "prefix", value: self.prefix.clone(), accepted }
    }

    /// The iceoryx2 configuration: its compiled-in values with these settings. No file is looked
    /// up, because iceoryx2's own look-up depends on the working directory.
    ///
    /// # Errors
    /// Those of [`validate`](Self::validate).
    pub fn config(&self) -> Result<Config, SettingsError> {
        self.validate()?;
        let root_path = iceoryx2::prelude::Path::new(self.root_path.as_os_str().as_bytes())
            .map_err(|_| self.root_path_error("a path that iceoryx2 takes"))?;
        let prefix = FileName::new(self.prefix.as_bytes()).map_err(|_| self.prefix_error())?;
        let mut config = Config::default();
        config.global.set_root_path(&root_path);
        config.global.prefix = prefix;
        Ok(config)
    }

    /// Whether everything in shared memory with this prefix is this user's.
    ///
    /// # Errors
    /// [`PlaceError`] names the first file that is not.
    pub fn check_shared_memory(&self) -> Result<(), PlaceError> {
        node_counter::foreign_files(&self.prefix)
    }

    /// Makes a node for this thread; `program` is what tools such as `iox2 node list` show. The
    /// root directory is made when it is not there. iceoryx2 installs no signal handler. Dead nodes
    /// found on the way are cleaned up (thousands of allocations), so make nodes before a thread
    /// goes real-time.
    ///
    /// # Errors
    /// [`NodeError`].
    pub fn node(&self, program: &str) -> Result<Node, NodeError> {
        self.node_in(program, true)
    }

    /// The same where a daemon has been: for tools, whose user must not become the owner of
    /// anything.
    ///
    /// # Errors
    /// [`NodeError`].
    pub fn visiting_node(&self, program: &str) -> Result<Node, NodeError> {
        self.node_in(program, false)
    }

    fn node_in(&self, program: &str, make_root: bool) -> Result<Node, NodeError> {
        self.check(Needed::TOOL)?;
        let config = self.config()?;
        let root_path = || self.root_path.clone();
        let root = open_root(&self.root_path, make_root)?;
        let _alone = leftovers::alone(root);
        let is_deserted = leftovers::clear_deserted(self, &config);
        leftovers::remove_half_made_memory(&self.prefix);
        // A visitor opens what others of ours have made: a stranger's file beside it must not keep an
        // operator from a running daemon.
        if make_root || is_deserted {
            node_counter::foreign_files(&self.prefix)?;
        }
        node_counter::secure(&self.prefix)?;
        let mut builder = NodeBuilder::new().config(&config).signal_handling_mode(SignalHandlingMode::Disabled);
        // The name only labels the node: one that iceoryx2 does not accept is left out.
        if let Ok(name) = NodeName::new(program) {
            builder = builder.name(&name);
        }
        let node = builder.create::<ipc::Service>().map_err(|cause| match cause {
            NodeCreationFailure::InsufficientPermissions => NodeError::Permission { root_path: root_path() },
            cause => NodeError::Iceoryx2 { root_path: root_path(), cause },
        })?;
        // Who is killed leaves a port that counts until it is cleared away. iceoryx2 does that above,
        // but not where another process is at it: then this one would find the port taken.
        node.blocking_cleanup_dead_nodes(CLEARING);
        Ok(Node { node: ManuallyDrop::new(node), settings: self.clone() })
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
        let fits = format!("/r/{}", "r".repeat(accepted - 3));
        assert_eq!(settings(&fits, "ab_").validate(), Ok(()));
        let error = settings(&format!("{fits}r"), "ab_").validate().unwrap_err().to_string();
        assert!(error.contains("at most 58 bytes with the prefix \"ab_\""), "{error}");
    }

    #[test]
    fn each_rule_has_its_error() {
        let refused = |root_path: &str, prefix: &str| settings(root_path, prefix).validate().unwrap_err().to_string();
        for prefix in ["", "a/b", "a b", "12345678901234567"] {
            assert!(refused("/r/a", prefix).starts_with(&format!("ipc.prefix = \"{prefix}\": accepted: 1 to 16 ")));
        }
        let error = refused("run/admittanced", "ab_");
        assert!(error.starts_with("ipc.root_path = \"run/admittanced\": accepted: an absolute path"), "{error}");
        for root in ["/", "//", "/run", "/tmp/"] {
            assert!(refused(root, "ab_").contains("below another one"), "{root}");
        }
        for root in ["/a b/c", "/a/../b", "/a/\u{e9}", "/a/\u{1b}[2J"] {
            let error = refused(root, "ab_");
            assert!(error.contains("no component") && !error.contains('\u{1b}'), "{error}");
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
        assert!(error.starts_with("/dev/null is not a directory"), "{error}");
    }
}
