//! `admittance-lab bench jitter`: how well this machine keeps a cycle, and what the daemon adds to
//! that. Nothing is judged by the clock: every figure stands beside its reference from the same
//! run.

mod arms;
mod cyclictest;
pub(super) mod figures;
mod load;
pub(crate) mod observed;
mod reference;
mod round_trip;
mod runs;

use admittance_host::realtime::{
    RealtimeSection, StepOutcome, StepReport, apply_to_thread, limit_wake_up_latency, lock_memory,
};

use admittancectl::Exit;
use arms::Arm;
use figures::{Durations, Figures};
use load::Load;
use runs::Runs;

/// Where the plant runs.
pub(super) const PLANT_CPU: u32 = 0;
/// The processor of the daemon, and in its turn of the reference.
pub(super) const DAEMON_CPU: u32 = 1;
/// SCHED_FIFO priority of the daemon, and of the reference.
pub(super) const PRIORITY: u32 = 85;
/// Turns that the reference and the daemon take.
const BLOCKS: u32 = 4;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Needs two processors, and SCHED_FIFO for figures that mean anything. Takes a little over twice the seconds \
    given.\n\nreference: lateness of a loop that sleeps until each instant and does nothing. cycle: from the instant of a sample to \
    its answer being visible to the plant. missed: instants after which either took longer than half a cycle.\n\n\
    Processors are kept awake meanwhile, as cyclictest does and realtime.cpu_dma_latency_us = 0 would.\n\nExit codes: 0 whatever the figures are, 1 no answers, 75 machine too busy to hold contact, 77 measured \
    without SCHED_FIFO for want of permission.\n\nExamples:\n  admittance-lab bench jitter --rate-hz 1000 --seconds 10\n  \
    admittance-lab bench jitter --rate-hz 4000 --seconds 60 --load --json\n  \
    admittance-lab bench jitter --arm six --directions 6 --seconds 60"
)]
pub(crate) struct Args {
    /// Cycles per second, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(100..=5000))]
    rate_hz: u32,
    /// How long the reference and the daemon each run, s.
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=86400))]
    seconds: u32,
    /// The arm that presses.
    #[arg(long, value_enum, default_value_t = Arm::Planar)]
    arm: Arm,
    /// How many of x y z rx ry rz give way; as in the arm's file when absent.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..=6))]
    directions: Option<u32>,
    /// Beside programs that keep processors and disk busy.
    #[arg(long)]
    load: bool,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

/// What is measured, and against which deadline.
#[derive(Debug, Clone, Copy)]
struct Plan {
    rate_hz: u32,
    /// T_s in ns.
    period: u64,
    /// After the instant of a sample its answer acts; ns.
    budget: u64,
    /// Length of a turn in s.
    turn_s: f64,
    arm: Arm,
    /// How many directions give way; as in the arm's file when `None`.
    directions: Option<u32>,
}

impl Plan {
    fn of(args: &Args) -> Self {
        let period = 1_000_000_000 / u64::from(args.rate_hz);
        Self {
            rate_hz: args.rate_hz,
            period,
            budget: period / 2,
            turn_s: f64::from(args.seconds) / f64::from(BLOCKS),
            arm: args.arm,
            directions: args.directions,
        }
    }
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    ipc_types::quiet_iceoryx2();
    if admittancectl::parallel::processors() < 2 {
        return Err((Exit::Unavailable, "bench jitter needs two processors: one is the plant's".to_owned()));
    }
    let most = args.arm.most_directions();
    if let Some(directions) = args.directions.filter(|directions| *directions as usize > most) {
        return Err((Exit::Usage, format!("--directions {directions}: this arm has {most}; accepted: 1 to {most}")));
    }
    let plan = Plan::of(args);
    let has_fifo = prepare();
    let load = args.load.then(Load::start).transpose()?;
    let runs = Runs::new(plan);
    let (mut reference, mut cycle) = (Durations::new(), Durations::new());
    for turn in 1..=BLOCKS {
        eprintln!("turn {turn} of {BLOCKS}: {:.1} s of reference, {:.1} s of contact", plan.turn_s, plan.turn_s);
        reference::run(plan, &mut reference);
        runs.contact(&mut cycle)?;
    }
    eprintln!("parts of a cycle, free motion, round trips");
    let parts = runs.observed()?;
    let free_motion_cpu_percent = runs.free_motion_cpu_percent()?;
    let ping_pong = round_trip::ping_pong()?;
    let ping_pong_of_samples = round_trip::ping_pong_of_samples()?;
    let spinning = round_trip::iceoryx2()?;
    let cyclictest = cyclictest::run(plan);
    drop(load);
    let figures = Figures {
        rate_hz: plan.rate_hz,
        budget_us: plan.budget as f64 * 1e-3,
        load: args.load,
        has_fifo,
        reference,
        cycle,
        parts,
        free_motion_cpu_percent,
        ping_pong,
        ping_pong_of_samples,
        spinning,
        cyclictest,
    };
    if args.json {
        println!("{:#}", figures.json());
    } else {
        println!("{}", figures.table());
    }
    if figures.cycle.count() == 0 {
        return Err((Exit::ClaimNotMet, "the daemon answered nothing".to_owned()));
    }
    Ok(if has_fifo { Exit::Ok } else { Exit::NoPermission })
}

/// How a thread of this process that measures runs on this processor.
fn section(cpu: u32) -> RealtimeSection {
    RealtimeSection {
        lock_memory: true,
        priority: PRIORITY,
        cpu: Some(cpu),
        cpu_dma_latency_us: None,
        require_realtime: false,
    }
}

/// Keeps the processors awake until this process ends, as cyclictest does for what it measures, and locks its memory; says
/// what is refused. Whether this process may be real-time.
pub(super) fn prepare() -> bool {
    let refused = |report: StepReport| match report.outcome {
        StepOutcome::Refused(why) => Some(format!("{}: {why}", report.step)),
        StepOutcome::Done | StepOutcome::NotRequested => None,
    };
    if let Some(why) = refused(limit_wake_up_latency(Some(0))) {
        eprintln!("admittance-lab: figures contain what idle processors take to wake up: {why}");
    }
    let mut reports = vec![lock_memory(&section(DAEMON_CPU))];
    reports.extend(std::thread::spawn(|| apply_to_thread(&section(DAEMON_CPU))).join().unwrap_or_default());
    let refusals: Vec<String> = reports.into_iter().filter_map(refused).collect();
    for why in &refusals {
        eprintln!("admittance-lab: figures are those of a normal process: {why}");
    }
    refusals.is_empty()
}

/// `work` on a real-time thread on this processor; where that is refused, on a normal one.
pub(super) fn on_processor<T: Send>(cpu: u32, work: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| {
        let thread = scope.spawn(move || {
            apply_to_thread(&section(cpu));
            work()
        });
        match thread.join() {
            Ok(done) => done,
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}
