//! Independent pieces of work on all processors. Progress is on stderr: a bar on a terminal, else a line now
//! and then.

use std::io::{self, IsTerminal};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Until the first line of progress where stderr is no terminal, and between two of them.
const FIRST_LINE: Duration = Duration::from_secs(1);
const LINE: Duration = Duration::from_secs(5);
/// Between two pictures of the bar.
const TICK: Duration = Duration::from_millis(200);
/// What is left of a duration before it is rounded.
const HALF_A_SECOND: Duration = Duration::from_millis(500);

/// Threads that this process can run at a time.
pub fn processors() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// `work` for 0 to `count` − 1, begun and returned in this order; `what` are the pieces that the
/// progress counts.
///
/// # Errors
/// The first error that any piece returns; the others are then given up.
pub fn map<T: Send>(
    count: u64,
    threads: usize,
    what: &str,
    work: impl Fn(u64) -> Result<T, String> + Sync,
) -> Result<Vec<T>, String> {
    let progress = Progress::begin(count, &format!("{count} {what}"));
    map_within(&progress, count, threads, |index| {
        let found = work(index)?;
        progress.add(1);
        Ok(found)
    })
}

/// The same as a part of a longer work, whose progress `work` counts by itself.
///
/// # Errors
/// As [`map`].
pub fn map_within<T: Send>(
    progress: &Progress,
    count: u64,
    threads: usize,
    work: impl Fn(u64) -> Result<T, String> + Sync,
) -> Result<Vec<T>, String> {
    if threads <= 1 || count <= 1 {
        return (0..count).map(work).collect();
    }
    let (next, (sender, receiver)) = (AtomicU64::new(0), mpsc::channel());
    let mut found = thread::scope(|scope| {
        for _ in 0..count.min(threads as u64) {
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
                Ok(piece) => found.push(piece?),
                Err(RecvTimeoutError::Timeout) => progress.say(),
                Err(RecvTimeoutError::Disconnected) => return Ok::<Vec<(u64, T)>, String>(found),
            }
        }
    })?;
    found.sort_by_key(|(index, _)| *index);
    Ok(found.into_iter().map(|(_, found)| found).collect())
}

/// How far a work is, in pieces that take about as long as their weights say.
#[derive(Debug)]
pub struct Progress {
    /// Hidden when stderr is no terminal.
    bar: ProgressBar,
    what: String,
    /// Sum of the weights of all pieces, and of those that are done.
    total: u64,
    done: AtomicU64,
    begun: Instant,
    /// When the next line is due.
    due: Mutex<Instant>,
}

impl Progress {
    /// Of pieces with this sum of weights; `what` they are all together.
    pub fn begin(total: u64, what: &str) -> Self {
        let progress = Self::new(ProgressBar::new(total), total, what);
        progress.bar.set_style(
            ProgressStyle::with_template("{bar:40} {percent} % of {msg}, {elapsed} gone, {eta} left")
                .unwrap_or_else(|_| ProgressStyle::default_bar()),
        );
        progress.bar.set_message(progress.what.clone());
        progress.bar.enable_steady_tick(TICK);
        progress
    }

    /// Of a work that says nothing.
    pub fn silent() -> Self {
        Self::new(ProgressBar::hidden(), 0, "")
    }

    fn new(bar: ProgressBar, total: u64, what: &str) -> Self {
        let now = Instant::now();
        let due = Mutex::new(now + FIRST_LINE);
        Self { bar, what: what.to_owned(), total, done: AtomicU64::new(0), begun: now, due }
    }

    /// Pieces with this sum of weights are done.
    pub fn add(&self, weight: u64) {
        self.done.fetch_add(weight, Ordering::Relaxed);
        self.bar.inc(weight);
        self.say();
    }

    /// A part whose weight is only estimated.
    pub fn part(&self, estimate: u64) -> Part<'_> {
        Part { progress: self, left: AtomicU64::new(estimate) }
    }

    /// A line for who has no terminal.
    fn say(&self) {
        let done = self.done.load(Ordering::Relaxed);
        if done >= self.total || io::stderr().is_terminal() {
            return;
        }
        let mut due = self.due.lock().unwrap_or_else(PoisonError::into_inner);
        if Instant::now() < *due {
            return;
        }
        *due = Instant::now() + LINE;
        let gone = self.begun.elapsed();
        let left = left(gone, done, self.total);
        let left = left.map_or(String::new(), |left| format!(", about {} s left", (left + HALF_A_SECOND).as_secs()));
        eprintln!("{} % of {} after {:.0} s{left}", 100 * done / self.total, self.what, gone.as_secs_f64());
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// A part of a work: at its end it counts as done, whatever it took.
#[derive(Debug)]
pub struct Part<'a> {
    progress: &'a Progress,
    left: AtomicU64,
}

impl Part<'_> {
    /// So much of it is done.
    pub fn add(&self, weight: u64) {
        let less = |left: u64| Some(left.saturating_sub(weight));
        let before = self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, less).unwrap_or(0);
        self.progress.add(before.min(weight));
    }
}

impl Drop for Part<'_> {
    fn drop(&mut self) {
        self.progress.add(self.left.swap(0, Ordering::Relaxed));
    }
}

/// How long the rest takes when it goes on like this; `None` before the first piece.
fn left(gone: Duration, done: u64, total: u64) -> Option<Duration> {
    (done > 0).then(|| gone.mul_f64(total.saturating_sub(done) as f64 / done as f64))
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
    fn a_part_counts_as_it_was_estimated() {
        let progress = Progress::begin(100, "numbers");
        let done = || progress.done.load(Ordering::Relaxed);
        let part = progress.part(30);
        part.add(20);
        assert_eq!(done(), 20);
        part.add(40);
        assert_eq!(done(), 30, "it took longer than estimated");
        drop(part);
        drop(progress.part(50));
        assert_eq!(done(), 80, "it took less");
    }

    #[test]
    fn an_error_ends_the_work() {
        let why = map(1000, 2, "numbers", |index| if index == 7 { Err("seven".to_owned()) } else { Ok(()) });
        assert_eq!(why, Err("seven".to_owned()));
    }
}
