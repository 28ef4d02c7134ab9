//! Reading the configuration file again: on SIGHUP and on request. The file then takes effect:
//! changes by requests are dropped, and the answer says what changed back.

use admittance_host::config;

use super::{Begun, Refusal, Step};
use crate::channel::Replacement;
use crate::service_thread::ServiceThread;
use admittance_runner::config::{Config, Control};
use admittance_runner::settings::Settings;

impl ServiceThread {
    /// Hands a new controller over, if only what may change at run time has changed.
    pub(super) fn reload(&mut self) -> Begun {
        let new: Config = config::load(&self.config_path).map_err(|error| error.to_string())?;
        if new == self.config {
            self.file = new;
            return Ok(Step::Done("nothing has changed".to_owned()));
        }
        // A request may change the law too.
        let control = Control { law: self.config.control.law, ..new.control.clone() };
        let fixed = [
            ("ipc", new.ipc == self.config.ipc),
            ("robot", new.robot == self.config.robot),
            ("control", control == self.config.control),
            ("realtime", new.realtime == self.config.realtime),
            // The joints would jump from one way of moving to the other.
            ("redundancy", new.redundancy == self.config.redundancy),
        ];
        let changed: Vec<&str> = fixed.iter().filter(|(_, same)| !same).map(|(section, _)| *section).collect();
        if !changed.is_empty() {
            return Err(Refusal::Refused(format!(
                "[{}] cannot change at run time: restart for that; control.law, wrench, contact, environment, mpc, damping, limits, \
                 stopping and requests can",
                changed.join("], [")
            )));
        }
        let changes = Settings::of(&self.config).changes(&Settings::of(&new));
        Self::hand_over(new.clone(), Replacement::Reload, move |service| {
            new.warnings().iter().for_each(|warning| tracing::warn!("{warning}"));
            service.file = new;
            let what = if changes.is_empty() { String::new() } else { format!(": {}", changes.join(", ")) };
            format!("the new configuration is in force{what}")
        })
    }
}
