//! The `[ipc]` section: where the two processes meet, the same in the daemon's configuration and in
//! a plant's scenario.

use std::path::PathBuf;

use ipc_types::{Instance, IpcSettings, USERS_ROOT_PATH, users_root_path};

use crate::config::ConfigError;
use crate::config_section;

config_section! {
    /// Where the processes meet. Both sides need the same three values and the same user.
    pub struct IpcSection {
        /// Directory of the services' discovery files: absolute, nobody else's, and below one that
        /// others cannot write. Or "user", for rehearsals by hand: one of whoever runs the programs,
        /// /run/user/ID/admittanced, or /run/admittanced-root of root.
        root_path: PathBuf = PathBuf::from("/run/admittanced"), length 1..=80;
        /// Start of every shared-memory file's name: letters, digits, _ and -.
        prefix: String = "admittanced_".to_owned(), length 1..=16;
        /// Name of the daemon: a-z, 0-9, _ and -.
        instance: String = "robot".to_owned(), length 1..=32;
    }
    cross_check usable_names;
}

fn usable_names(ipc: &IpcSection, path: &str, errors: &mut Vec<ConfigError>) {
    let mut wants = |key: &str, value: &str, accepted: String| {
        errors.push(ConfigError::new(format!("{path}.{key}"), format!("{value:?}"), accepted));
    };
    let instance = match Instance::new(&ipc.instance) {
        Ok(instance) => instance,
        Err(error) => return wants("instance", &ipc.instance, error.accepted()),
    };
    // Where "user" is depends on who runs the program: looked at when it is used.
    let is_users = ipc.root_path.as_os_str() == USERS_ROOT_PATH;
    let root_path = if is_users { PathBuf::from("/run/admittanced") } else { ipc.root_path.clone() };
    let settings = IpcSettings { root_path, prefix: ipc.prefix.clone(), instance };
    if let Err(error) = settings.validate() {
        wants(error.key, &error.value, error.accepted);
    }
}

impl IpcSection {
    fn resolved_root_path(&self) -> PathBuf {
        if self.root_path.as_os_str() == USERS_ROOT_PATH { users_root_path() } else { self.root_path.clone() }
    }

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
            root_path: root_path.unwrap_or_else(|| self.resolved_root_path()),
            prefix: prefix.unwrap_or_else(|| self.prefix.clone()),
            instance,
        };
        settings.validate().map_err(|error| error.to_string())?;
        Ok(settings)
    }
}
