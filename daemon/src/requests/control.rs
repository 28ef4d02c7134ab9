//! Requests that begin and end control: enable, disable, reset.

use admittance_core::supervisor::Ending;
use ipc_types::Mode;

use super::Step;
use crate::channel::{Order, OrderError, Outcome};
use crate::log;
use crate::service_thread::ServiceThread;

impl ServiceThread {
    pub(super) fn enable() -> Step {
        Step::order(Order::Enable, |service, outcome| {
            let Outcome::Enabled(outcome) = outcome else { return Err(OrderError::Late.into()) };
            let (mode, changed) = outcome.map_err(|refused| refused.to_string())?;
            service.enabled = true;
            Ok(match mode {
                _ if !changed => format!("enabled already: nothing changed, the mode is {mode}"),
                Mode::Idle => "disabled -> enabled: from Idle to Free with the next valid sample".to_owned(),
                Mode::Free | Mode::Contact => format!("disabled -> enabled: control goes on in {mode}"),
                Mode::Stopping | Mode::Stopped => "disabled -> enabled: Stopped until a reset".to_owned(),
            })
        })
    }

    pub(super) fn disable() -> Step {
        Step::order(Order::Stop(Ending::Disabled), |service, outcome| {
            let Outcome::Stopping { mode, was_enabled } = outcome else { return Err(OrderError::Late.into()) };
            service.enabled = false;
            let what = match mode {
                _ if !was_enabled => return Ok(format!("disabled already: nothing changed, the mode is {mode}")),
                Mode::Idle => "in Idle",
                Mode::Free => "from Free to Idle, the offset ramping to zero",
                Mode::Contact => "from Contact over a stop at a low force to Stopped, until a reset",
                Mode::Stopping | Mode::Stopped => "Stopped until a reset, which then leads to Idle",
            };
            Ok(format!("enabled -> disabled: {what}"))
        })
    }

    pub(super) fn reset(&self, force: bool) -> Step {
        let was = log::state_of(self.last.as_ref());
        Step::order(Order::Reset { force }, move |service, outcome| {
            let Outcome::Reset(outcome) = outcome else { return Err(OrderError::Late.into()) };
            outcome.map_err(|refused| refused.to_string())?;
            let how = if force { " (forced)" } else { "" };
            let now = match (force, service.enabled) {
                (true, _) => "Free",
                (false, true) => "Idle, Free with the next valid sample",
                (false, false) => "Idle, disabled until it is enabled",
            };
            Ok(format!("reset{how}: from {was} to {now}"))
        })
    }
}
