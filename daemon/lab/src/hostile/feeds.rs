//! The watchdog of the unit, played: who listens when the daemon feeds it.

use std::ffi::OsString;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// WatchdogSec of the shipped unit.
const WATCHDOG: Duration = Duration::from_secs(3);
/// How long the listener waits for a message: what it takes longer itself is the machine's doing.
const TURN: Duration = Duration::from_millis(50);

/// What has come.
#[derive(Debug, Default)]
struct Heard {
    /// The last feed of a daemon that is being watched, and how long the machine has kept the
    /// listener from its processor since.
    last: Option<(Instant, Duration)>,
    late: Vec<String>,
}

impl Heard {
    /// A turn of the listener took this much longer than it asked for.
    fn stalled(&mut self, stall: Duration) {
        if let Some((_, stalls)) = &mut self.last {
            *stalls += stall;
        }
    }

    fn feed(&mut self, now: Instant) {
        self.look(now);
        self.last = Some((now, Duration::ZERO));
    }

    /// Notes a feed that is overdue, once.
    fn look(&mut self, now: Instant) {
        let Some((last, stalls)) = self.last else { return };
        let gap = now.duration_since(last).saturating_sub(stalls);
        if gap > WATCHDOG {
            self.late.push(format!("the watchdog was not fed for {:.1} s", gap.as_secs_f64()));
            self.last = None;
        }
    }

    fn hear(&mut self, message: &str, now: Instant) {
        for line in message.lines() {
            match line {
                "READY=1" | "WATCHDOG=1" => self.feed(now),
                "STOPPING=1" => self.last = None,
                _ => {}
            }
        }
    }
}

/// The listener.
pub(crate) struct Feeds {
    path: PathBuf,
    heard: Arc<Mutex<Heard>>,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Feeds {
    /// Listens at this path.
    pub(crate) fn listen(path: &Path) -> Result<Self, String> {
        let failed = |error: std::io::Error| format!("{}: {error}", path.display());
        let socket = UnixDatagram::bind(path).map_err(failed)?;
        socket.set_read_timeout(Some(TURN)).map_err(failed)?;
        let (heard, ended) = (Arc::new(Mutex::new(Heard::default())), Arc::new(AtomicBool::new(false)));
        let shared = (Arc::clone(&heard), Arc::clone(&ended));
        let thread = std::thread::spawn(move || listen(&socket, &shared.0, &shared.1));
        Ok(Self { path: path.to_owned(), heard, ended, thread: Some(thread) })
    }

    /// What a daemon has to be told of it.
    pub(crate) fn environment(&self) -> [(&'static str, OsString); 2] {
        let microseconds = WATCHDOG.as_micros().to_string();
        [("NOTIFY_SOCKET", self.path.clone().into_os_string()), ("WATCHDOG_USEC", microseconds.into())]
    }

    /// The daemon is going to be killed, or stopped.
    pub(crate) fn forget(&self) {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).last = None;
    }

    /// Stops listening: what was late.
    pub(crate) fn end(&mut self) -> Vec<String> {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // It panics at nothing; should it, there is nothing to add.
            let _ = thread.join();
        }
        std::mem::take(&mut self.heard.lock().unwrap_or_else(PoisonError::into_inner).late)
    }
}

impl Drop for Feeds {
    fn drop(&mut self) {
        self.end();
    }
}

fn listen(socket: &UnixDatagram, heard: &Mutex<Heard>, ended: &AtomicBool) {
    let mut message = [0; 4096];
    let mut turn = Instant::now();
    while !ended.load(Ordering::Relaxed) {
        let length = socket.recv(&mut message).ok();
        let now = Instant::now();
        let mut heard = heard.lock().unwrap_or_else(PoisonError::into_inner);
        heard.stalled(now.duration_since(turn).saturating_sub(2 * TURN));
        turn = now;
        match length {
            Some(length) => heard.hear(&String::from_utf8_lossy(&message[..length]), now),
            None => heard.look(now),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_feed_that_is_overdue_is_noted_and_a_busy_machine_is_none() {
        let begun = Instant::now();
        let at = |seconds: f64| begun + Duration::from_secs_f64(seconds);
        let mut heard = Heard::default();
        heard.look(at(9.0));
        heard.hear("READY=1\n", at(10.0));
        heard.hear("WATCHDOG=1", at(12.9));
        heard.look(at(15.8));
        assert_eq!(heard.late, [""; 0]);
        heard.stalled(Duration::from_secs(1));
        heard.look(at(16.8));
        assert_eq!(heard.late, [""; 0]);
        heard.look(at(17.0));
        heard.look(at(18.0));
        assert_eq!(heard.late, ["the watchdog was not fed for 3.1 s"]);
        heard.hear("RELOADING=1\nREADY=1", at(20.0));
        heard.hear("STOPPING=1", at(21.0));
        heard.look(at(30.0));
        assert_eq!(heard.late.len(), 1);
    }
}
