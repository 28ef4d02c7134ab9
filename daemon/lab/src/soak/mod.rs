//! `admittance-lab soak`: touches of a surface with something going wrong in each, for as long as
//! one likes. Plant and daemon are real processes, and a third one looks on from outside.

mod files;
mod injection;
pub(crate) mod observer;
mod outside;
mod pace;
mod recording;
mod tally;
mod touch;

use std::ffi::OsStr;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use plant_sim::scenario::Scenario;

use admittancectl::Exit;
use admittancectl::demo::SCENARIO;
use admittancectl::session::Session;
use injection::{Draw, Fault};
use observer::Finding;
use tally::Tally;
use touch::{GRACE, Stage};

/// How long the observer may take to be ready.
const PATIENCE: Duration = Duration::from_secs(10);
/// Part of the time that a busy machine may disturb before the figures say more about the machine
/// than about the daemon.
const BUSY: f64 = 0.25;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "One fault in each touch, half of them in contact; every kind before any comes again. Broken are: a stopped arm that \
    is not held, a true force above the limit after a feasible verdict (outside the windows of faults), a sequence that does not grow, a \
    stop without a reason, a recording that is not whole up to its last chunk, shared memory left behind, memory that grows.\n\nExit codes: 0 nothing broken and nothing lost, 1 otherwise, 75 machine \
    too busy to tell.\n\nExamples:\n  admittance-lab soak --minutes 10\n  admittance-lab soak --minutes 2 --seed 7 --json"
)]
pub(crate) struct Args {
    /// How long, min.
    #[arg(long, value_name = "MIN", default_value_t = 10.0)]
    minutes: f64,
    /// The same seed injects the same faults.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only this kind of fault; may be given more than once.
    #[arg(long, value_name = "FAULT", value_parser = fault)]
    only: Vec<Fault>,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

fn fault(name: &str) -> Result<Fault, String> {
    let all = Fault::all();
    let names = || all.iter().map(|fault| fault.name()).collect::<Vec<_>>().join(", ");
    all.iter().find(|fault| fault.name() == name).copied().ok_or_else(|| format!("accepted: {}", names()))
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    if !(0.05..=100_000.0).contains(&args.minutes) {
        return Err((Exit::Usage, format!("--minutes {}: accepted are 0.05 to 100000", args.minutes)));
    }
    ipc_types::quiet_iceoryx2();
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&interrupted))
            .map_err(|error| (Exit::Unavailable, format!("signal handlers: {error}")))?;
    }
    let scenario: Scenario =
        admittance_host::config::parse(SCENARIO, "paper.toml").map_err(|error| (Exit::Internal, error.to_string()))?;
    let mut session = Session::new(&scenario)?;
    let mut draw = Draw::new(args.seed, if args.only.is_empty() { Fault::all() } else { args.only.clone() });
    let first = draw.touch();
    let config = session.write("daemon.toml", &files::config(first.stiffness_n_m)?)?;
    let findings = session.write("findings.jsonl", "")?;
    session.start(
        "observer",
        "role-soak-observer",
        &[OsStr::new("--config"), config.as_os_str(), OsStr::new("--out"), findings.as_os_str()],
    )?;
    await_observer(&mut session, &findings)?;
    let mut stage = Stage::new(session, config)?;
    let mut tally = Tally::default();
    let (begun, length) = (Instant::now(), Duration::from_secs_f64(args.minutes * 60.0));
    // Hidden when stderr is no terminal.
    let bar = ProgressBar::new(length.as_secs()).with_style(
        ProgressStyle::with_template("{bar:40} {pos}/{len} s, {msg}").unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let mut next = first;
    while begun.elapsed() < length && !interrupted.load(Ordering::Relaxed) {
        bar.set_message(next.fault.name());
        stage.touch(&next, &mut tally)?;
        bar.set_position(begun.elapsed().as_secs().min(length.as_secs()));
        next = draw.touch();
    }
    bar.finish_and_clear();
    let seconds = begun.elapsed().as_secs_f64();
    let (_session, left) = stage.end(&mut tally)?;
    for path in left {
        tally.broken("shared_memory_is_removed", path.display().to_string());
    }
    tally.observed(&read(&findings)?, GRACE, seconds);
    if args.json {
        println!("{:#}", tally.json());
    } else {
        println!("{}", tally.table());
    }
    if interrupted.load(Ordering::Relaxed) {
        eprintln!("admittance-lab: interrupted; the figures are those until then");
    }
    Ok(match tally.is_clean() {
        true => Exit::Ok,
        // A busy machine may cost control. What is broken is not its doing.
        false if !tally.is_broken() && tally.disturbed() > BUSY => Exit::MachineBusy,
        false => Exit::ClaimNotMet,
    })
}

/// The observer has subscribed to everything before anything moves.
fn await_observer(session: &mut Session, findings: &Path) -> Result<(), (Exit, String)> {
    let give_up = Instant::now() + PATIENCE;
    while !read(findings)?.contains(&Finding::Ready) {
        if let Some(status) = session.exit_status("observer") {
            return Err(session.failure("observer", status));
        }
        if Instant::now() > give_up {
            return Err((Exit::Unavailable, "the observer does not get ready".to_owned()));
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}

fn read(path: &Path) -> Result<Vec<Finding>, (Exit, String)> {
    let failed = |why: String| (Exit::Internal, format!("{}: {why}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| failed(error.to_string()))?;
    // The last line may not be complete yet.
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    whole.lines().map(|line| serde_json::from_str(line).map_err(|error| failed(error.to_string()))).collect()
}
