//! The daemon's real-time thread in a process of its own, without the service thread: it notes the
//! parts of every cycle in contact and writes them down when it ends.

use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use admittance_core::mpc::qp::{Answer, Qp, QpOutcome, QpSolver};
use admittance_host::clock::monotonic_ns;
use admittance_runner::cycle;
use admittanced::probe::{ObservedThread, Probe};
use ipc_types::{CommandSample, Mode};
use serde::{Deserialize, Serialize};

use admittancectl::{Exit, validate};

/// Cycles that are noted: a minute at 4 kHz.
const NOTED: usize = 240_000;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[arg(long)]
    config: PathBuf,
    #[arg(long)]
    root_path: PathBuf,
    #[arg(long)]
    prefix: String,
    /// Where the cycles go, as JSON lines.
    #[arg(long)]
    out: PathBuf,
}

/// One cycle in contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CycleParts {
    /// Sequence of the state sample.
    pub(crate) sequence: u64,
    /// When the command was sent, ns of CLOCK_MONOTONIC.
    pub(crate) sent_ns: u64,
    /// From the sample received to the command sent, ns.
    pub(crate) compute_ns: u64,
    /// Condensation and solve, ns.
    pub(crate) solver_ns: u64,
}

/// Notes cycles in memory that is allocated beforehand.
struct Notes {
    cycles: Arc<Mutex<Vec<CycleParts>>>,
    count: Arc<AtomicUsize>,
    solver_ended: Arc<AtomicU64>,
}

/// The law's solver, noting when it ends.
struct Timed {
    solver: cycle::Solver,
    /// ns of CLOCK_MONOTONIC; 0 since that was taken.
    ended: Arc<AtomicU64>,
}

impl QpSolver for Timed {
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome {
        let outcome = self.solver.solve(qp, answer, expired);
        self.ended.store(monotonic_ns(), Ordering::Relaxed);
        outcome
    }
}

impl Probe for Notes {
    fn looking(&mut self) {}

    fn sent(&mut self, command: &CommandSample, asked: u64) {
        let solver_ended = self.solver_ended.swap(0, Ordering::Relaxed);
        if command.mode != Mode::Contact.code() {
            return;
        }
        let parts = CycleParts {
            sequence: command.state_sequence,
            sent_ns: command.stamp_ns,
            compute_ns: command.compute_time_ns,
            solver_ns: solver_ended.saturating_sub(asked),
        };
        // Nobody else takes the lock before the thread has ended.
        if let Ok(mut cycles) = self.cycles.try_lock()
            && let Some(slot) = cycles.get_mut(self.count.load(Ordering::Relaxed))
        {
            *slot = parts;
            self.count.fetch_add(1, Ordering::Relaxed);
        }
    }
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    ipc_types::quiet_iceoryx2();
    let config = validate::load(&args.config)?;
    let settings = config
        .ipc
        .settings(None, Some(args.root_path.clone()), Some(args.prefix.clone()))
        .map_err(|why| (Exit::Config, why))?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(|error| (Exit::Unavailable, format!("signal handlers: {error}")))?;
    }
    let nothing = CycleParts { sequence: 0, sent_ns: 0, compute_ns: 0, solver_ns: 0 };
    let cycles = Arc::new(Mutex::new(vec![nothing; NOTED]));
    let count = Arc::new(AtomicUsize::new(0));
    let solver_ended = Arc::new(AtomicU64::new(0));
    let ended = Arc::clone(&solver_ended);
    let notes = Notes { cycles: Arc::clone(&cycles), count: Arc::clone(&count), solver_ended };
    let cycle = cycle::build_watched(&config, &|solver| Box::new(Timed { solver, ended: Arc::clone(&ended) }))
        .map_err(|why| (Exit::Config, why))?;
    let mut thread = ObservedThread::start(&config, cycle, &settings, notes).map_err(|why| (Exit::Unavailable, why))?;
    while !thread.is_finished() {
        if stop.swap(false, Ordering::Relaxed) {
            thread.stop();
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let code = thread.join();
    let failed = |error: std::io::Error| (Exit::Unavailable, format!("{}: {error}", args.out.display()));
    let mut file = BufWriter::new(std::fs::File::create(&args.out).map_err(failed)?);
    let cycles = cycles.lock().unwrap_or_else(PoisonError::into_inner);
    for parts in &cycles[..count.load(Ordering::Relaxed)] {
        let line = serde_json::to_string(parts).map_err(|error| (Exit::Internal, error.to_string()))?;
        writeln!(file, "{line}").map_err(failed)?;
    }
    file.flush().map_err(failed)?;
    Ok(code)
}
