//! What systemd is told: READY, RELOADING, STOPPING, and WATCHDOG only while the real-time thread
//! moves.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

#[derive(Debug)]
pub(crate) struct Notify {
    /// Half of WatchdogSec; `None` without a watchdog.
    interval: Option<Duration>,
    last: Instant,
    turns: u64,
}

impl Notify {
    pub(crate) fn new() -> Self {
        Self { interval: sd_notify::watchdog_enabled().map(|limit| limit / 2), last: Instant::now(), turns: 0 }
    }

    /// The ports exist; whether a controller runs yet does not matter.
    pub(crate) fn ready(&self) {
        tell(&[NotifyState::Ready]);
    }

    pub(crate) fn reloading(&self) {
        match NotifyState::monotonic_usec_now() {
            Ok(now) => tell(&[NotifyState::Reloading, now]),
            Err(_) => tell(&[NotifyState::Reloading]),
        }
    }

    pub(crate) fn stopping(&self) {
        tell(&[NotifyState::Stopping]);
    }

    /// Feeds the watchdog if the real-time loop has turned since the last time.
    pub(crate) fn watchdog(&mut self, turns: u64) {
        let Some(interval) = self.interval else { return };
        if turns != self.turns && self.last.elapsed() >= interval.min(Duration::from_millis(100)) {
            tell(&[NotifyState::Watchdog]);
            (self.turns, self.last) = (turns, Instant::now());
        }
    }
}

/// Without systemd there is nobody to notify, and that is no failure.
fn tell(state: &[NotifyState]) {
    if let Err(error) = sd_notify::notify(state) {
        tracing::debug!("systemd could not be notified: {error}");
    }
}
