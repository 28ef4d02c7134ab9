//! Independent pieces of work on all processors, with a progress bar on a terminal.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread;

use indicatif::{ProgressBar, ProgressStyle};

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
    let (next, (sender, receiver)) = (AtomicU64::new(0), mpsc::channel());
    // Hidden when stderr is no terminal.
    let bar = ProgressBar::new(count).with_style(
        ProgressStyle::with_template(&format!("{{bar:40}} {{pos}}/{{len}} {what}, {{eta}} left"))
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
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
        receiver.into_iter().inspect(|_| bar.inc(1)).collect::<Result<Vec<(u64, T)>, String>>()
    })?;
    bar.finish_and_clear();
    found.sort_by_key(|(index, _)| *index);
    Ok(found.into_iter().map(|(_, found)| found).collect())
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
    fn an_error_ends_the_work() {
        let why = map(1000, 2, "numbers", |index| if index == 7 { Err("seven".to_owned()) } else { Ok(()) });
        assert_eq!(why, Err("seven".to_owned()));
    }
}
