//! What systemd is told: READY, STOPPING, and WATCHDOG each time the loop has turned for a while.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// At most so often, so that it costs nothing in the cycle.
const MOST_OFTEN: Duration = Duration::from_millis(100);

#[derive(Debug)]
pub(crate) struct Notify {
    has_watchdog: bool,
    last: Instant,
}

impl Notify {
    /// The ports exist, whether or not a robot sends yet.
    pub(crate) fn ready() -> Self {
        tell(NotifyState::Ready);
        Self { has_watchdog: sd_notify::watchdog_enabled().is_some(), last: Instant::now() }
    }

    pub(crate) fn turned(&mut self) {
        if self.has_watchdog && self.last.elapsed() >= MOST_OFTEN {
            tell(NotifyState::Watchdog);
            self.last = Instant::now();
        }
    }

    pub(crate) fn stopping() {
        tell(NotifyState::Stopping);
    }
}

/// Without systemd there is nobody to notify, and that is no failure.
fn tell(state: NotifyState<'_>) {
    if let Err(error) = sd_notify::notify(&[state]) {
        tracing::debug!("systemd could not be notified: {error}");
    }
}
