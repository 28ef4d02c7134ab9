//! A limit for what may hang and cannot be interrupted: opening shared memory that is damaged.

use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use crate::exit::ExitCode;

/// How long opening what processes share may take. It takes milliseconds; the limit is below
/// systemd's for the start, and five of them are within its StartLimitIntervalSec=.
pub const OPENING: Duration = Duration::from_secs(8);

/// Runs until it is dropped; the process ends if that takes too long.
#[derive(Debug)]
#[must_use = "the limit ends when this is dropped"]
pub struct TimeLimit {
    _done: SyncSender<()>,
}

impl TimeLimit {
    /// Ends the process with exit code 69 and a sentence, unless this is dropped within
    /// [`OPENING`]. `prefix` is how the names of its files in /dev/shm begin.
    pub fn of_opening(program: &'static str, prefix: &str) -> Self {
        let prefix = prefix.to_owned();
        Self::new(OPENING, move || {
            eprintln!(
                "{program}: shared memory could not be opened within {} s: a file of the prefix \"{prefix}\" in /dev/shm is \
                 damaged, or a program that was opening it was stopped. End all programs of this instance, then \
                 remove /dev/shm/{prefix}*",
                OPENING.as_secs()
            );
            std::process::exit(i32::from(ExitCode::Unavailable.code()));
        })
    }

    fn new(limit: Duration, at_limit: impl FnOnce() + Send + 'static) -> Self {
        let (done, until_done) = sync_channel(0);
        std::thread::spawn(move || {
            if until_done.recv_timeout(limit) == Err(RecvTimeoutError::Timeout) {
                at_limit();
            }
        });
        Self { _done: done }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn it_strikes_only_when_it_is_kept_too_long() {
        let (strike, struck) = channel();
        let kept = TimeLimit::new(Duration::from_millis(1), move || strike.send(()).unwrap());
        struck.recv().unwrap();
        drop(kept);
        let (strike, struck) = channel::<()>();
        drop(TimeLimit::new(Duration::from_secs(3600), move || strike.send(()).unwrap()));
        assert!(struck.recv().is_err(), "the thread has ended without a word");
    }
}
