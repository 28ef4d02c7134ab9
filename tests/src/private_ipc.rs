//! A place in shared memory that no other test and no other program shares.

use ipc_types::{Instance, IpcSettings, remove_all, shared_memory_files};
use std::path::{Path, PathBuf};

/// A private root path and prefix, both removed on drop with everything that programs left behind
/// there, also programs that were killed.
#[derive(Debug)]
pub struct PrivateIpc {
    settings: IpcSettings,
    directory: tempfile::TempDir,
}

impl PrivateIpc {
    /// A new place with a daemon of this instance name in it.
    ///
    /// # Panics
    /// When /tmp cannot be written or the name is not an instance name.
    pub fn new(instance: &str) -> Self {
        // Always /tmp, whatever TMPDIR says: the path of a socket below the root is limited to 107
        // bytes.
        let directory = tempfile::Builder::new().prefix("adm-").tempdir_in("/tmp").expect("/tmp can be written");
        let unique = directory.path().to_string_lossy().rsplit('-').next().unwrap_or_default().to_owned();
        let instance = Instance::new(instance).expect("the test gives an instance name");
        let settings =
            IpcSettings { root_path: directory.path().join("ipc"), prefix: format!("adm{unique}_"), instance };
        settings.validate().expect("the directory is short and the prefix is made of letters and digits");
        Self { settings, directory }
    }

    /// What programs of this place have under `[ipc]`.
    pub fn settings(&self) -> &IpcSettings {
        &self.settings
    }

    /// The same as a section of a configuration file.
    pub fn toml(&self) -> String {
        let IpcSettings { root_path, prefix, instance } = &self.settings;
        format!("[ipc]\nroot_path = \"{}\"\nprefix = \"{prefix}\"\ninstance = \"{instance}\"\n", root_path.display())
    }

    /// A directory for the test's own files, such as configurations; removed as well.
    pub fn directory(&self) -> &Path {
        self.directory.path()
    }

    /// Files that programs of this place have in /dev/shm now.
    ///
    /// # Panics
    /// When /dev/shm cannot be read.
    pub fn shared_memory_files(&self) -> Vec<PathBuf> {
        shared_memory_files(&self.settings.prefix).expect("/dev/shm can be read")
    }
}

impl Drop for PrivateIpc {
    fn drop(&mut self) {
        if let Err(error) = remove_all(&self.settings) {
            // A second panic would hide the first: a failing test only reports leftover files.
            assert!(std::thread::panicking(), "{error}");
            eprintln!("{error}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_places_share_nothing_and_leave_nothing() {
        let (one, other) = (PrivateIpc::new("robot"), PrivateIpc::new("robot"));
        assert_ne!(one.settings().root_path, other.settings().root_path);
        assert_ne!(one.settings().prefix, other.settings().prefix);

        let node = one.settings().node("test").expect("a node can be made in a private place");
        std::fs::write(one.directory().join("config.toml"), one.toml()).expect("the directory can be written");
        assert!(one.settings().root_path.exists());
        // A program that was killed leaves its files: what a node that is never dropped leaves is
        // the same.
        std::mem::forget(node);
        let left_behind = Path::new("/dev/shm").join(format!("{}0123456789", one.settings().prefix));
        std::fs::write(&left_behind, "x").expect("/dev/shm can be written");
        assert!(one.shared_memory_files().contains(&left_behind));
        assert!(other.shared_memory_files().is_empty());

        let (directory, prefix) = (one.directory().to_path_buf(), one.settings().prefix.clone());
        drop(one);
        assert!(!directory.exists());
        assert!(!left_behind.exists());
        assert!(shared_memory_files(&prefix).expect("/dev/shm can be read").is_empty());
        assert!(other.directory().exists());
    }
}
