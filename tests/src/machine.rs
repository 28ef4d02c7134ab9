//! What the machine does to a run in real time: a witness beside it, and another try for what the
//! machine has spoilt.

use std::cell::{Cell, RefCell};
use std::fmt::{self, Display, Formatter};
use std::io::Write;
use std::panic::{self, AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, Once, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use admittance_host::clock::monotonic_ns;
use admittance_host::realtime::{RealtimeSection, StepOutcome, apply_to_thread, limit_wake_up_latency};

/// Runs that the machine may spoil.
const TRIES: usize = 10;
/// Time between two looks at the clock.
const PERIOD: Duration = Duration::from_micros(500);
/// Above every program of the tests.
const PRIORITY: u32 = 95;
/// A processor that is taken away for this long (ns) makes an answer late: commands act after a
/// millisecond, and the tests' builds need half of it.
const TAKEN_NS: u64 = 500_000;
/// Observers and some plants run at normal priority: a cycle of 4 ms (ns) passes without them.
const DELAYED_NS: u64 = 4_000_000;

thread_local! {
    /// What the run on this thread has noted itself.
    static NOTED: RefCell<Option<String>> = const { RefCell::new(None) };
    /// Where this thread panicked last.
    static PLACE: RefCell<String> = const { RefCell::new(String::new()) };
    /// The run on this thread checks what no machine excuses.
    static CERTAIN: Cell<bool> = const { Cell::new(false) };
    /// Who watches the run on this thread.
    static WATCHED: RefCell<Option<Arc<Latest>>> = const { RefCell::new(None) };
}

/// Notes a disturbance that the run on this thread has seen itself.
pub(crate) fn note(disturbance: String) {
    NOTED.set(Some(disturbance));
}

/// A failure in `check` fails the test, whatever the machine did.
pub fn certain<T>(check: impl FnOnce() -> T) -> T {
    CERTAIN.set(true);
    let value = check();
    CERTAIN.set(false);
    value
}

/// Whether a processor was away for at least `least` in this stretch (ns of CLOCK_MONOTONIC), which is over, of the run on this thread.
/// For runs of many cycles: of those hardly one passes on a shared machine without.
pub fn was_away_within(from_ns: u64, until_ns: u64, least: Duration) -> bool {
    let least = (least + PERIOD).as_nanos() as u64;
    WATCHED.with_borrow(|watched| {
        let Some(latest) = watched else { return false };
        let stretches = latest.away.lock().unwrap_or_else(PoisonError::into_inner);
        !latest.is_refused.load(Ordering::Relaxed)
            && stretches.iter().any(|(from, until)| until - from >= least && *from < until_ns && *until > from_ns)
    })
}

/// What the threads of a [`Witness`] see.
#[derive(Debug, Default)]
struct Latest {
    /// Longest time in ns for which a processor was taken away.
    taken_ns: AtomicU64,
    /// Longest delay in ns of a thread at normal priority.
    delayed_ns: AtomicU64,
    /// When a processor was taken away for longer than [`TAKEN_NS`], ns.
    away: Mutex<Vec<(u64, u64)>>,
    /// A thread did not get its priority or processor: its delays say nothing of a processor.
    is_refused: AtomicBool,
    end: AtomicBool,
}

/// Sees how late threads wake up that do nothing else: one on each processor at a priority above
/// every program of the tests, which is late only when the processor itself was taken away, and one
/// at normal priority.
#[derive(Debug)]
struct Witness {
    latest: Arc<Latest>,
    threads: Vec<JoinHandle<()>>,
}

impl Witness {
    /// Watches from now on.
    fn new() -> Self {
        stay_awake();
        let latest = Arc::<Latest>::default();
        let processors = std::thread::available_parallelism().map_or(1, usize::from) as u32;
        // Nothing is missed before the last of them looks at the clock.
        let (ready, all_ready) = std::sync::mpsc::channel();
        let threads = (0..processors)
            .map(Some)
            .chain([None])
            .map(|cpu| {
                let (latest, ready) = (Arc::clone(&latest), ready.clone());
                std::thread::spawn(move || watch(cpu, ready, &latest))
            })
            .collect();
        drop(ready);
        all_ready.iter().for_each(drop);
        Self { latest, threads }
    }

    /// What the machine did up to now that may spoil a run; `None` when it did nothing of the kind.
    fn disturbance(self) -> Option<Disturbance> {
        self.latest.end.store(true, Ordering::Relaxed);
        for thread in self.threads {
            // Each looks at the clock once more.
            let _ = thread.join();
        }
        let [taken, delayed] = [&self.latest.taken_ns, &self.latest.delayed_ns].map(|ns| ns.load(Ordering::Relaxed));
        let text = if taken > TAKEN_NS {
            format!("the machine took a processor away for {:.1} ms", taken as f64 / 1e6)
        } else if delayed > DELAYED_NS {
            format!("a thread of normal priority woke up {:.1} ms late", delayed as f64 / 1e6)
        } else {
            NOTED.take()?
        };
        let is_hopeless = taken > DELAYED_NS && !self.latest.is_refused.load(Ordering::Relaxed);
        Some(Disturbance { text, is_hopeless })
    }
}

/// What the machine did to a run.
#[derive(Debug, Clone)]
struct Disturbance {
    text: String,
    /// No program can be on time: a processor was away for a whole cycle.
    is_hopeless: bool,
}

impl Display for Disturbance {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Keeps the processors awake until this process ends, where it may: one that a virtual machine has given back while it
/// was idle can take milliseconds to return. Refused, runs are only disturbed more often.
fn stay_awake() {
    static ASKED: Once = Once::new();
    ASKED.call_once(|| drop(limit_wake_up_latency(Some(0))));
}

/// Watches a processor, or how threads at normal priority fare.
fn watch(cpu: Option<u32>, ready: Sender<()>, latest: &Latest) {
    let priority = if cpu.is_some() { PRIORITY } else { 0 };
    let section =
        RealtimeSection { lock_memory: false, priority, cpu, cpu_dma_latency_us: None, require_realtime: false };
    if apply_to_thread(&section).iter().any(|report| matches!(report.outcome, StepOutcome::Refused(_))) {
        latest.is_refused.store(true, Ordering::Relaxed);
    }
    let most_ns = if cpu.is_some() { &latest.taken_ns } else { &latest.delayed_ns };
    let mut before = monotonic_ns();
    drop(ready);
    while !latest.end.load(Ordering::Relaxed) {
        std::thread::sleep(PERIOD);
        let now = monotonic_ns();
        let late_ns = (now - before).saturating_sub(PERIOD.as_nanos() as u64);
        most_ns.fetch_max(late_ns, Ordering::Relaxed);
        if cpu.is_some() && late_ns > TAKEN_NS {
            latest.away.lock().unwrap_or_else(PoisonError::into_inner).push((before, now));
        }
        before = now;
    }
}

/// A run that failed.
#[derive(Debug, Clone)]
struct Failed {
    /// Where it panicked.
    place: String,
    /// How the machine disturbed it.
    disturbance: Option<Disturbance>,
}

/// From now on [`PLACE`] is kept.
fn keep_places() {
    static KEPT: Once = Once::new();
    KEPT.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            PLACE.set(info.location().map(ToString::to_string).unwrap_or_default());
            before(info);
        }));
    });
}

/// What follows from failed runs.
#[derive(Debug, PartialEq, Eq)]
enum Verdict {
    Fail,
    Again,
    Skip,
}

impl Verdict {
    /// Of all runs so far, each of which failed.
    fn of(runs: &[Failed]) -> Self {
        let alike = |run: &Failed| runs.iter().filter(|other| other.place == run.place).count();
        match runs.last().and_then(|run| run.disturbance.as_ref()) {
            Some(_) if runs.len() < TRIES => Self::Again,
            // A machine spoils a run here and a run there. What fails at the same place in most
            // of them does so because it is broken.
            Some(_) if runs.iter().any(|run| alike(run) > TRIES / 2) => Self::Fail,
            Some(_) if runs.iter().flat_map(|run| &run.disturbance).all(|it| it.is_hopeless) => Self::Skip,
            _ => Self::Fail,
        }
    }
}

/// Says something about a passing test as well, of which the harness shows nothing.
pub(crate) fn say(text: &str) {
    let test = std::thread::current().name().unwrap_or("test").to_owned();
    // A closed stderr is no reason to fail.
    let _ = writeln!(std::io::stderr(), "{text} ({test})");
}

/// How long to wait after so many disturbed runs: who keeps the machine busy now has often ended a minute later.
fn pause_after(runs: usize) -> Duration {
    let doubled = runs.saturating_sub(2).min(5) as u32;
    Duration::from_secs(if runs < 2 { 0 } else { 2_u64.pow(doubled) })
}

/// Runs a test in real time; when it fails, and a witness saw that the machine disturbed it, once
/// more, after a pause that grows, as long as no test of this process has come to its last run. A run
/// that fails undisturbed fails the test, and so does the tenth that fails. `None`, and SKIPPED is
/// said, only when the machine took a processor away for a cycle or longer in all ten, and no more
/// than half of them failed at the same place.
///
/// # Panics
/// As the last run does.
pub fn undisturbed<T>(run: impl FnMut() -> T) -> Option<T> {
    // What is broken is to be told today.
    static IS_HURRIED: AtomicBool = AtomicBool::new(false);
    repeated(run, |runs| {
        let was_hurried = IS_HURRIED.fetch_or(runs + 1 == TRIES, Ordering::Relaxed);
        if was_hurried { Duration::ZERO } else { pause_after(runs) }
    })
}

fn repeated<T>(mut run: impl FnMut() -> T, pause_after: impl Fn(usize) -> Duration) -> Option<T> {
    keep_places();
    let mut runs = Vec::new();
    loop {
        NOTED.set(None);
        CERTAIN.set(false);
        let witness = Witness::new();
        WATCHED.set(Some(Arc::clone(&witness.latest)));
        let result = catch_unwind(AssertUnwindSafe(&mut run));
        let disturbance = witness.disturbance();
        let failure = match result {
            Ok(value) => return Some(value),
            Err(failure) if CERTAIN.get() => resume_unwind(failure),
            Err(failure) => failure,
        };
        runs.push(Failed { place: PLACE.take(), disturbance });
        if let Some(disturbance) = runs.last().and_then(|run| run.disturbance.as_ref()) {
            say(&format!("run {} failed, and {disturbance}", runs.len()));
        }
        match Verdict::of(&runs) {
            Verdict::Fail => resume_unwind(failure),
            Verdict::Again => std::thread::sleep(pause_after(runs.len())),
            Verdict::Skip => {
                say(&format!("SKIPPED: machine too busy: a processor was away for a cycle or longer in {TRIES} runs"));
                return None;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::slice;

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
        let mut runs = 0;
        let result = catch_unwind(AssertUnwindSafe(|| {
            undisturbed(|| {
                runs += 1;
                take_processor(Duration::from_millis(20));
                certain(|| assert!(runs > 1, "whatever the machine does"));
            })
        }));
        assert!(result.is_err() && runs == 1, "no machine excuses that");
    }

    #[test]
    fn it_tells_when_a_processor_was_away() {
        if !crate::needs(crate::Need::Root) {
            return;
        }
        undisturbed(|| {
            let begun = monotonic_ns();
            std::thread::sleep(Duration::from_millis(3));
            let taken = monotonic_ns();
            take_processor(Duration::from_millis(20));
            std::thread::sleep(2 * PERIOD);
            let over = monotonic_ns();
            let was_away = |from_ns, until_ns, ms| was_away_within(from_ns, until_ns, Duration::from_millis(ms));
            assert!(was_away(taken, over, 19) && !was_away(taken, over, 1000));
            // Which the machine may have taken away by itself.
            assert!(!was_away(begun, taken - PERIOD.as_nanos() as u64, 2) && !was_away(over, over + 1, 2));
        });
    }

    #[test]
    fn what_fails_at_the_same_place_in_every_run_fails() {
        if !crate::needs(crate::Need::Root) {
            return;
        }
        let mut runs = 0;
        let result = catch_unwind(AssertUnwindSafe(|| {
            let run = || {
                runs += 1;
                take_processor(Duration::from_millis(20));
                assert!(runs == 0, "in run {runs}");
            };
            repeated(run, |_| Duration::ZERO)
        }));
        assert!(result.is_err() && runs == TRIES, "{runs} runs");
    }

    #[test]
    fn ten_runs_are_spread_over_two_minutes() {
        let pauses: Vec<u64> = (1..TRIES).map(|runs| pause_after(runs).as_secs()).collect();
        assert_eq!(pauses, [0, 1, 2, 4, 8, 16, 32, 32, 32]);
    }

    #[test]
    fn what_always_fails_is_skipped_only_where_nothing_could_pass() {
        let failed = |place: &str, disturbance| Failed { place: place.to_owned(), disturbance };
        let disturbed = |place, is_hopeless| failed(place, Some(Disturbance { text: String::new(), is_hopeless }));
        let calm = failed("here", None);
        assert_eq!(Verdict::of(slice::from_ref(&calm)), Verdict::Fail);
        assert_eq!(Verdict::of(&[disturbed("here", true)]), Verdict::Again);
        assert_eq!(Verdict::of(&[disturbed("here", true), calm]), Verdict::Fail);
        let half = |place| vec![disturbed(place, true); TRIES / 2];
        let mut runs = [half("here"), half("there")].concat();
        assert_eq!(Verdict::of(&runs), Verdict::Skip);
        runs[0] = disturbed("there", true);
        assert_eq!(Verdict::of(&runs), Verdict::Fail);
        let mut runs = [half("here"), half("there")].concat();
        runs[0] = disturbed("here", false);
        assert_eq!(Verdict::of(&runs), Verdict::Fail);
    }
}
