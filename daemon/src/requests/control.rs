//! Requests that begin and end control: enable, disable, reset.

use admittance_core::supervisor::Ending;
use ipc_types::Mode;

use super::Answered;
use crate::channel::{Order, OrderError, Outcome};
use crate::log;
use crate::service_thread::ServiceThread;

impl ServiceThread {
    pub(super) fn enable(&mut self, until: u64) -> Answered {
        let Outcome::Enabled(outcome) = self.channel.order(Order::Enable, until)? else {
            return Err(OrderError::Late.into());
        };
        let (mode, changed) = outcome.map_err(|refused| refused.to_string())?;
        self.enabled = true;
        Ok(match mode {
            _ if !changed => format!("enabled already: nothing changed, the mode is {mode}"),
            Mode::Idle => "disabled -> enabled: from Idle to Free with the next valid sample".to_owned(),
            Mode::Free | Mode::Contact => format!("disabled -> enabled: control goes on in {mode}"),
            Mode::Stopping | Mode::Stopped => "disabled -> enabled: Stopped until a reset".to_owned(),
        })
    }

    pub(super) fn disable(&mut self, until: u64) -> Answered {
        let order = Order::Stop(Ending::Disabled);
        let Outcome::Stopping { mode, was_enabled } = self.channel.order(order, until)? else {
            return Err(OrderError::Late.into());
        };
        self.enabled = false;
        let what = match mode {
            _ if !was_enabled => return Ok(format!("disabled already: nothing changed, the mode is {mode}")),
            Mode::Idle => "in Idle",
            Mode::Free => "from Free to Idle, the offset ramping to zero",
            Mode::Contact => "from Contact over a stop at a low force to Stopped, until a reset",
            Mode::Stopping | Mode::Stopped => "Stopped until a reset, which then leads to Idle",
        };
        Ok(format!("enabled -> disabled: {what}"))
    }

    pub(super) fn reset(&mut self, force: bool, until: u64) -> Answered {
        let was = log::state_of(self.last.as_ref());
        let Outcome::Reset(outcome) = self.channel.order(Order::Reset { force }, until)? else {
            return Err(OrderError::Late.into());
        };
        outcome.map_err(|refused| refused.to_string())?;
        let how = if force { " (forced)" } else { "" };
        let now = match (force, self.enabled) {
            (true, _) => "Free",
            (false, true) => "Idle, Free with the next valid sample",
            (false, false) => "Idle, disabled until it is enabled",
        };
        Ok(format!("reset{how}: from {was} to {now}"))
    }
}
