//! What the machine does to a run in real time: a witness beside it, and another try for what the
//! machine has spoilt.

use std::fmt::{self, Display, Formatter};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use admittance_host::clock::monotonic_ns;
use admittance_host::realtime::{RealtimeSection, apply_to_thread};

/// Runs that the machine may spoil.
const TRIES: usize = 10;
/// Time between two looks at the clock.
const PERIOD: Duration = Duration::from_micros(500);
/// Above every program of the tests.
const PRIORITY: u32 = 95;
/// A processor that is taken away for this long (ns) makes an answer late: commands act after a
/// millisecond, and the tests' builds need half of it.
const TAKEN_NS: u64 = 500_000;
/// Plants and observers run at normal priority: one cycle (ns) is missed.
const DELAYED_NS: u64 = 4_000_000;

/// Sees how late threads wake up that do nothing else: one on each processor at a priority above
/// every program of the tests, which is late only when the processor itself was taken away, and one
/// at normal priority, as a plant or an observer has it.
#[derive(Debug)]
pub(crate) struct Witness {
    end: Arc<AtomicBool>,
    taken_ns: Arc<AtomicU64>,
    delayed_ns: Arc<AtomicU64>,
    noted: Mutex<Option<String>>,
    threads: Vec<JoinHandle<()>>,
}

impl Witness {
    /// Watches from now on until it is dropped.
    pub(crate) fn new() -> Self {
        let (end, taken_ns, delayed_ns) = (Arc::default(), Arc::default(), Arc::default());
        let processors = std::thread::available_parallelism().map_or(1, usize::from) as u32;
        let on_each = (0..processors).map(|cpu| (PRIORITY, Some(cpu), &taken_ns));
        // Nothing is missed before the last of them looks at the clock.
        let (ready, all_ready) = std::sync::mpsc::channel();
        let threads = on_each
            .chain([(0, None, &delayed_ns)])
            .map(|(priority, cpu, most_ns)| {
                let (end, most_ns, ready) = (Arc::clone(&end), Arc::clone(most_ns), ready.clone());
                std::thread::spawn(move || watch(priority, cpu, ready, &end, &most_ns))
            })
            .collect();
        drop(ready);
        all_ready.iter().for_each(drop);
        Self { end, taken_ns, delayed_ns, noted: Mutex::default(), threads }
    }

    /// Notes a disturbance that the run itself has seen.
    pub(crate) fn note(&self, disturbance: String) {
        *self.noted.lock().unwrap_or_else(PoisonError::into_inner) = Some(disturbance);
    }

    /// What the machine did up to now that may spoil a run; `None` when it did nothing of the kind.
    pub(crate) fn disturbance(&self) -> Option<Disturbance> {
        let [taken, delayed] = [&self.taken_ns, &self.delayed_ns].map(|most| most.load(Ordering::Relaxed));
        let text = if taken > TAKEN_NS {
            format!("the machine took a processor away for {:.1} ms", taken as f64 / 1e6)
        } else if delayed > DELAYED_NS {
            format!("a thread of normal priority woke up {:.1} ms late", delayed as f64 / 1e6)
        } else {
            self.noted.lock().unwrap_or_else(PoisonError::into_inner).clone()?
        };
        Some(Disturbance { text, is_hopeless: taken > DELAYED_NS })
    }
}

/// What the machine did to a run.
#[derive(Debug, Clone)]
pub(crate) struct Disturbance {
    text: String,
    /// No program can be on time: a processor was away for a whole cycle.
    is_hopeless: bool,
}

impl Display for Disturbance {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Default for Witness {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for Witness {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // It only looks at the clock.
            let _ = thread.join();
        }
    }
}

fn watch(priority: u32, cpu: Option<u32>, ready: Sender<()>, end: &AtomicBool, most_ns: &AtomicU64) {
    let section =
        RealtimeSection { lock_memory: false, priority, cpu, cpu_dma_latency_us: None, require_realtime: false };
    // Without the permission all of them are as late as threads of normal priority.
    apply_to_thread(&section);
    let mut before = monotonic_ns();
    drop(ready);
    while !end.load(Ordering::Relaxed) {
        std::thread::sleep(PERIOD);
        let now = monotonic_ns();
        most_ns.fetch_max((now - before).saturating_sub(PERIOD.as_nanos() as u64), Ordering::Relaxed);
        before = now;
    }
}

/// What follows from failed runs.
#[derive(Debug, PartialEq, Eq)]
enum Verdict {
    Fail,
    Again,
    Skip,
}

impl Verdict {
    /// Of all runs so far, each of which failed, and how the machine disturbed it.
    fn of(runs: &[Option<Disturbance>]) -> Self {
        match runs.last() {
            Some(Some(_)) if runs.len() < TRIES => Self::Again,
            Some(Some(_)) if runs.iter().flatten().all(|disturbance| disturbance.is_hopeless) => Self::Skip,
            _ => Self::Fail,
        }
    }
}

/// Runs a test in real time; when it fails, and a [`Witness`] saw that the machine disturbed it,
/// once more. A run that fails undisturbed fails the test, and so does the tenth that fails. `None`,
/// and SKIPPED is said, only when the machine took a processor away for a cycle or longer in all ten.
///
/// # Panics
/// As the last run does.
pub fn undisturbed<T>(mut run: impl FnMut() -> T) -> Option<T> {
    undisturbed_beside(|_| run())
}

/// As [`undisturbed`], of a run that may [`Witness::note`] what it sees itself.
///
/// # Panics
/// As the last run does.
pub(crate) fn undisturbed_beside<T>(mut run: impl FnMut(&Witness) -> T) -> Option<T> {
    let mut runs = Vec::new();
    loop {
        let witness = Witness::new();
        let failure = match catch_unwind(AssertUnwindSafe(|| run(&witness))) {
            Ok(value) => return Some(value),
            Err(failure) => failure,
        };
        runs.push(witness.disturbance());
        if let Some(Some(disturbance)) = runs.last() {
            println!("run {} failed, and {disturbance}", runs.len());
        }
        match Verdict::of(&runs) {
            Verdict::Fail => resume_unwind(failure),
            Verdict::Again => {}
            Verdict::Skip => {
                println!("SKIPPED: machine too busy: it took a processor away for a cycle or longer in {TRIES} runs");
                return None;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes processor 0 away from everything below priority 98.
    fn take_processor(duration: Duration) {
        let section = RealtimeSection {
            lock_memory: false,
            priority: 98,
            cpu: Some(0),
            cpu_dma_latency_us: None,
            require_realtime: true,
        };
        let hog = std::thread::spawn(move || {
            apply_to_thread(&section);
            let end = monotonic_ns() + duration.as_nanos() as u64;
            while monotonic_ns() < end {
                std::hint::spin_loop();
            }
        });
        hog.join().expect("it only looks at the clock");
    }

    #[test]
    fn only_a_run_that_the_machine_disturbed_is_repeated() {
        if !crate::needs(crate::Need::Root) {
            return;
        }
        let mut runs = 0;
        let result = undisturbed(|| {
            runs += 1;
            if runs == 1 {
                take_processor(Duration::from_millis(20));
            }
            assert!(runs > 1, "the first one fails");
            runs
        });
        assert_eq!(result, Some(2));
    }

    #[test]
    fn what_always_fails_is_skipped_only_where_nothing_could_pass() {
        let run = |is_hopeless| Some(Disturbance { text: String::new(), is_hopeless });
        assert_eq!(Verdict::of(&[None]), Verdict::Fail);
        assert_eq!(Verdict::of(&[run(true)]), Verdict::Again);
        assert_eq!(Verdict::of(&[run(true), None]), Verdict::Fail);
        assert_eq!(Verdict::of(&vec![run(true); TRIES]), Verdict::Skip);
        let mut runs = vec![run(true); TRIES];
        runs[3] = run(false);
        assert_eq!(Verdict::of(&runs), Verdict::Fail);
    }
}
