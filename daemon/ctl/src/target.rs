//! Which daemon a command is about.

use std::path::PathBuf;

use admittance_host::config::{self, LoadError};
use admittance_host::time_limit::TimeLimit;
use admittance_runner::config::Config;
use ipc_types::{Instance, IpcSettings, Node};

use crate::Exit;

/// Arguments that say which daemon.
#[derive(Debug, clap::Args)]
pub struct Target {
    /// The daemon's configuration; /etc/admittanced/INSTANCE.toml when absent. None is read where instance, root path and
    /// prefix are all given, but by `record`, which keeps it with the recording.
    #[arg(long)]
    config: Option<PathBuf>,
    /// Name of the daemon; overrides ipc.instance.
    #[arg(long)]
    instance: Option<String>,
    /// Overrides ipc.root_path.
    #[arg(long)]
    root_path: Option<PathBuf>,
    /// Overrides ipc.prefix.
    #[arg(long)]
    prefix: Option<String>,
}

impl Target {
    /// The daemon's configuration file.
    ///
    /// # Errors
    /// That the arguments name none.
    pub fn config_path(&self) -> Result<PathBuf, (Exit, String)> {
        match (&self.config, &self.instance) {
            (Some(path), _) => Ok(path.clone()),
            (None, Some(instance)) => Ok(PathBuf::from(format!("/etc/admittanced/{instance}.toml"))),
            (None, None) => Err((Exit::Usage, "which daemon? Give --instance NAME or --config FILE".to_owned())),
        }
    }

    /// The daemon's configuration.
    ///
    /// # Errors
    /// That there is none, or none that is usable.
    pub fn configuration(&self) -> Result<Config, (Exit, String)> {
        config::load(&self.config_path()?).map_err(|error| match error {
            LoadError::Read { .. } => (Exit::NoInput, error.to_string()),
            LoadError::Config(_) => (Exit::Config, error.to_string()),
        })
    }

    /// Where the daemon is. Who says all of it needs no configuration: on another machine there is none.
    fn settings(&self) -> Result<IpcSettings, (Exit, String)> {
        if let (None, Some(instance), Some(root_path), Some(prefix)) =
            (&self.config, &self.instance, &self.root_path, &self.prefix)
        {
            let instance = Instance::new(instance).map_err(|error| (Exit::Config, error.to_string()))?;
            let settings = IpcSettings { root_path: root_path.clone(), prefix: prefix.clone(), instance };
            settings.validate().map_err(|error| (Exit::Config, error.to_string()))?;
            return Ok(settings);
        }
        let config = self.configuration()?;
        config
            .ipc
            .settings(self.instance.as_deref(), self.root_path.clone(), self.prefix.clone())
            .map_err(|why| (Exit::Config, why))
    }

    /// A node where the daemon is, the place, and a limit for the time that opening its services
    /// may take: drop it when they are open.
    ///
    /// # Errors
    /// Why there is none: no configuration, or not a usable one; no shared memory.
    pub fn connect(&self) -> Result<(Node, IpcSettings, TimeLimit), (Exit, String)> {
        ipc_types::quiet_iceoryx2();
        let settings = self.settings()?;
        let opening = TimeLimit::of_opening("admittancectl", &settings.prefix);
        let node = settings
            .visiting_node("admittancectl")
            .map_err(|error| (Exit::of_refusal(error.is_permission()), error.to_string()))?;
        Ok((node, settings, opening))
    }
}
