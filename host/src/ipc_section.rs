//! The `[ipc]` section: where the two processes meet, the same in the daemon's configuration and in
//! a plant's scenario.

use std::path::PathBuf;

use ipc_types::{Instance, IpcSettings};

use crate::config_section;

config_section! {
    /// Where the processes meet. Both sides need the same three values and the same user.
    pub struct IpcSection {
        /// Directory of the services' discovery files: absolute.
        root_path: PathBuf = PathBuf::from("/run/admittanced"), length 1..=80;
        /// Start of every shared-memory file's name: letters, digits, _ and -.
        prefix: String = "admittanced_".to_owned(), length 1..=16;
        /// Name of the daemon: a-z, 0-9, _ and -.
        instance: String = "robot".to_owned(), length 1..=32;
    }
}

impl IpcSection {
    /// The checked settings; `instance`, `root_path` and `prefix` from a command line override the
    /// section's.
    ///
    /// # Errors
    /// A sentence that names the setting, its value and what is accepted.
    pub fn settings(
        &self,
        instance: Option<&str>,
        root_path: Option<PathBuf>,
        prefix: Option<String>,
    ) -> Result<IpcSettings, String> {
        let instance = Instance::new(instance.unwrap_or(&self.instance)).map_err(|error| error.to_string())?;
        let settings = IpcSettings {
            root_path: root_path.unwrap_or_else(|| self.root_path.clone()),
            prefix: prefix.unwrap_or_else(|| self.prefix.clone()),
            instance,
        };
        settings.validate().map_err(|error| error.to_string())?;
        Ok(settings)
    }
}
