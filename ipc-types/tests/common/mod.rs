//! A place of a test's own.

#![allow(dead_code, unreachable_pub, reason = "each test takes what it needs")]

use std::ops::Deref;
use std::os::unix::fs::DirBuilderExt;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use ipc_types::{Instance, IpcSettings, quiet_iceoryx2, remove_all};

/// Settings that nobody else uses, in a directory of their own; everything is removed in the end.
pub struct Private(pub IpcSettings, PathBuf);

impl Private {
    pub fn new() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        quiet_iceoryx2();
        let prefix = format!("t{}_{}_", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
        Self::below(prefix, "ipc")
    }

    pub fn below(prefix: String, root: &str) -> Self {
        // Not the temporary directory of the environment, which may be too deep for sockets.
        let directory = PathBuf::from(format!("/tmp/{prefix}"));
        std::fs::DirBuilder::new().mode(0o700).create(&directory).unwrap();
        let root_path = directory.join(root);
        Self(IpcSettings { root_path, prefix, instance: Instance::new("r1").unwrap() }, directory)
    }
}

impl Deref for Private {
    type Target = IpcSettings;

    fn deref(&self) -> &IpcSettings {
        &self.0
    }
}

impl Drop for Private {
    fn drop(&mut self) {
        let removed = remove_all(&self.0);
        let _ = std::fs::remove_dir(&self.1);
        if !std::thread::panicking() {
            removed.unwrap();
        }
    }
}
