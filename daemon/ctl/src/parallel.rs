//! Independent pieces of work on all processors. Progress is on stderr: a bar on a terminal, else a line now
//! and then.

use std::io::{self, IsTerminal};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Between two lines of progress where stderr is no terminal.
const LINE: Duration = Duration::from_secs(5);
/// Between two pictures of the bar.
const TICK: Duration = Duration::from_millis(200);

/// Threads that this process can run at a time.
pub fn processors() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// `work` for 0 to `count` − 1, begun and returned in this order; `what` are the pieces that the
/// progress bar counts.
///
/// # Errors
/// The first error that any piece returns; the others are then given up.
pub fn map<T: Send>(
    count: u64,
    threads: usize,
    what: &str,
    work: impl Fn(u64) -> Result<T, String> + Sync,
) -> Result<Vec<T>, String> {
    map_weighted(count, threads, what, |_| 1, work)
}

/// The same with pieces that take as long as their `weight` says, for the estimate of what is left.
///
/// # Errors
/// As [`map`].
pub fn map_weighted<T: Send>(
    count: u64,
    threads: usize,
    what: &str,
    weight: impl Fn(u64) -> u64,
    work: impl Fn(u64) -> Result<T, String> + Sync,
) -> Result<Vec<T>, String> {
    let (next, (sender, receiver)) = (AtomicU64::new(0), mpsc::channel());
    let mut progress = Progress::new(count, (0..count).map(&weight).sum(), what);
    let mut found = thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            let (next, sender, work) = (&next, sender.clone(), &work);
            scope.spawn(move || {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    // After an error the receiver is gone.
                    if index >= count || sender.send(work(index).map(|found| (index, found))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        let mut found = Vec::new();
        loop {
            match receiver.recv_timeout(LINE) {
                Ok(piece) => {
                    let (index, piece) = piece?;
                    progress.add(weight(index));
                    found.push((index, piece));
                }
                Err(RecvTimeoutError::Timeout) => progress.say(),
                Err(RecvTimeoutError::Disconnected) => return Ok::<Vec<(u64, T)>, String>(found),
            }
        }
    })?;
    progress.bar.finish_and_clear();
    found.sort_by_key(|(index, _)| *index);
    Ok(found.into_iter().map(|(_, found)| found).collect())
}

/// How far the work is.
struct Progress<'a> {
    /// Hidden when stderr is no terminal.
    bar: ProgressBar,
    what: &'a str,
    count: u64,
    done: u64,
    /// Sum of the weights of all pieces, and of those that are done.
    total: u64,
    weight: u64,
    begun: Instant,
    said: Instant,
}

impl<'a> Progress<'a> {
    fn new(count: u64, total: u64, what: &'a str) -> Self {
        let bar = ProgressBar::new(total).with_style(
            ProgressStyle::with_template("{bar:40} {msg}, {elapsed} gone, {eta} left")
                .unwrap_or_else(|_| ProgressStyle::default_bar()),
        );
        let now = Instant::now();
        let progress = Self { bar, what, count, done: 0, total, weight: 0, begun: now, said: now };
        progress.bar.set_message(format!("0/{count} {what}"));
        progress.bar.enable_steady_tick(TICK);
        progress
    }

    fn add(&mut self, weight: u64) {
        self.done += 1;
        self.weight += weight;
        self.bar.set_position(self.weight);
        self.bar.set_message(format!("{}/{} {}", self.done, self.count, self.what));
        self.say();
    }

    /// A line for who has no terminal.
    fn say(&mut self) {
        if io::stderr().is_terminal() || self.said.elapsed() < LINE || self.done == self.count {
            return;
        }
        self.said = Instant::now();
        let gone = self.begun.elapsed();
        let left = left(gone, self.weight, self.total);
        let left = left.map_or(String::new(), |left| format!(", about {:.0} s left", left.as_secs_f64()));
        eprintln!("{}/{} {} after {:.0} s{left}", self.done, self.count, self.what, gone.as_secs_f64());
    }
}

/// How long the rest takes when it goes on like this; `None` before the first piece.
fn left(gone: Duration, done: u64, total: u64) -> Option<Duration> {
    (done > 0).then(|| gone.mul_f64((total - done) as f64 / done as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_whatever_the_number_of_threads() {
        let squares = |threads| map(50, threads, "numbers", |index| Ok(index * index)).unwrap();
        assert_eq!(squares(3), (0..50).map(|index| index * index).collect::<Vec<u64>>());
        assert_eq!(squares(0), squares(3));
    }

    #[test]
    fn the_rest_is_estimated_by_weight() {
        assert_eq!(left(Duration::from_secs(6), 3, 12), Some(Duration::from_secs(18)));
        assert_eq!(left(Duration::from_secs(6), 0, 12), None);
    }

    #[test]
    fn an_error_ends_the_work() {
        let why = map(1000, 2, "numbers", |index| if index == 7 { Err("seven".to_owned()) } else { Ok(()) });
        assert_eq!(why, Err("seven".to_owned()));
    }
}
