//! `admittance-lab hostile`: what attacks daemon and tools from outside. Every case is drawn from
//! seed and number alone, so that what is found can be seen again.

pub(crate) mod arena;
mod cell;
pub(crate) mod configurations;
mod controller;
mod egm;
pub(crate) mod everything;
mod feeds;
pub(crate) mod mutate;
mod recordings;
pub(crate) mod requests;
mod restarts;
mod samples;
mod spoil;
mod watch;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use rand::SeedableRng as _;
use rand::rngs::SysRng;
use rand_chacha::ChaCha8Rng;

use admittancectl::{Exit, Outcome};
use arena::Findings;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Broken is what must not happen however it is attacked: a panic, an end that nobody asked for, a watchdog that is not \
    fed for 3 s, an answer that is not finite or beyond a limit, a sample used that nobody may use, an arm that is not held when it \
    has to be, no control again once all is well, a request without an answer, an error that does not say what would be accepted, a \
    damaged recording read as if nothing were, a robot that is moved by what is no message of its own, memory or descriptors that \
    grow, files left in shared memory.\n\n\
    A case is drawn from seed and number; how the machine runs its processes is not, so a case may have to be run several \
    times. Exit codes: 0 nothing was FOUND, 1 something was.\n\n\
    Examples:\n  admittance-lab hostile\n  admittance-lab hostile samples --samples 100000 --seed 7\n  \
    admittance-lab hostile everything --minutes 60\n  admittance-lab hostile samples --seed 7 --index 12"
)]
pub(crate) struct Args {
    /// What to do; all of it where nothing is named.
    #[arg(value_enum)]
    kinds: Vec<Kind>,
    /// Garbage samples; as many good ones and more come between them.
    #[arg(long, default_value_t = 10_000)]
    samples: u64,
    /// Mutated configurations.
    #[arg(long, default_value_t = 5_000)]
    configurations: u64,
    /// Mutated requests.
    #[arg(long, default_value_t = 10_000)]
    requests: u64,
    /// Damaged recordings.
    #[arg(long, default_value_t = 1_000)]
    recordings: u64,
    /// Kills of daemon and controller.
    #[arg(long, default_value_t = 50)]
    restarts: u64,
    /// How long everything at once, min.
    #[arg(long, default_value_t = 1.0)]
    minutes: f64,
    /// Datagrams to admittance-egm, of which a thousand are sent a second.
    #[arg(long, default_value_t = egm::PER_CASE)]
    datagrams: u64,
    /// This seed alone; where none is given seed 1, and then a fresh one.
    #[arg(long)]
    seed: Option<u64>,
    /// This case alone; of one kind, with --seed.
    #[arg(long, requires = "seed")]
    index: Option<u64>,
    /// The recordings to damage copies of.
    #[arg(long, value_name = "DIR", default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/recordings"))]
    recordings_of: PathBuf,
    /// The daemon to attack in place of this program's own: another version, or one that is broken on purpose.
    #[arg(long, value_name = "PROGRAM")]
    daemon: Option<PathBuf>,
    /// The same for admittance-egm.
    #[arg(long, value_name = "PROGRAM")]
    edge: Option<PathBuf>,
}

/// A kind of attack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// Samples with random bits, strange numbers, jumping sequences and stamps.
    Samples,
    /// Configurations with anything in them, to validate, start and reload.
    Configurations,
    /// Requests with anything in them.
    Requests,
    /// Recordings with damages.
    Recordings,
    /// SIGKILL of daemon and controller at any instant, and another start.
    Restarts,
    /// All of it against one daemon.
    Everything,
    /// Random bytes and mutated messages to admittance-egm, a thousand a second, from its robot's address and from others.
    Egm,
}

impl Kind {
    fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }
}

/// What is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Count {
    Samples,
    Spoilt,
    Episodes,
    Records,
    Refused,
    Configurations,
    Valid,
    Starts,
    Reloads,
    Requests,
    Done,
    Recordings,
    Kills,
    Rounds,
    Datagrams,
    Believable,
    Answers,
}

type Counts = BTreeMap<Count, u64>;

/// Runs a case: what it counted, and what it found.
type Case<'a> = Box<dyn Fn(&mut ChaCha8Rng, Option<&Path>, &mut Findings) -> Outcome<Counts> + 'a>;

/// How much of a kind.
#[derive(Debug, Clone, Copy)]
enum Extent {
    Cases(u64),
    Time(Duration),
}

pub(crate) fn run(args: &Args) -> Outcome<Exit> {
    let kinds = if args.kinds.is_empty() { Kind::value_variants() } else { &args.kinds[..] };
    if args.index.is_some() && kinds.len() != 1 {
        return Err((Exit::Usage, "--index: accepted with one kind".to_owned()));
    }
    ipc_types::quiet_iceoryx2();
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&interrupted))
            .map_err(|error| (Exit::Unavailable, format!("signal handlers: {error}")))?;
    }
    let seeds = match args.seed {
        Some(seed) => vec![seed],
        None => vec![
            1,
            u64::from(ChaCha8Rng::try_from_rng(&mut SysRng).map_or(2, |mut random| rand::Rng::next_u32(&mut random))),
        ],
    };
    let mut found = false;
    for seed in seeds {
        for kind in kinds {
            found |= attack(args, *kind, seed, &|| interrupted.load(Ordering::Relaxed))?;
        }
    }
    Ok(if found { Exit::ClaimNotMet } else { Exit::Ok })
}

/// All cases of a kind. Whether something was found.
fn attack(args: &Args, kind: Kind, seed: u64, interrupted: &dyn Fn() -> bool) -> Outcome<bool> {
    let (extent, case): (Extent, Case<'_>) = match kind {
        Kind::Samples => (Extent::Cases(args.samples.div_ceil(samples::PER_CASE)), Box::new(samples::case)),
        Kind::Configurations => {
            (Extent::Cases(args.configurations.div_ceil(configurations::PER_CASE)), Box::new(configurations::case))
        }
        Kind::Requests => (Extent::Cases(args.requests.div_ceil(requests::PER_CASE)), Box::new(requests::case)),
        Kind::Recordings => return recordings::attack(&args.recordings_of, args.recordings, seed, args.index),
        Kind::Restarts => (Extent::Cases(args.restarts.div_ceil(restarts::PER_CASE)), Box::new(restarts::case)),
        Kind::Everything => {
            (Extent::Time(Duration::from_secs_f64(args.minutes.clamp(0.0, 1e6) * 60.0)), Box::new(everything::case))
        }
        Kind::Egm => {
            let (datagrams, edge) = (args.datagrams.min(egm::PER_CASE), args.edge.as_deref());
            let case: Case<'_> =
                Box::new(move |random, daemon, findings| egm::case(random, datagrams, (daemon, edge), findings));
            (Extent::Cases(args.datagrams.div_ceil(egm::PER_CASE)), case)
        }
    };
    // A case of fewer datagrams is the beginning of a longer one: what is found at its end is found by it alone.
    let length = if kind == Kind::Egm { format!(" --datagrams {}", args.datagrams) } else { String::new() };
    let (begun, mut totals, mut cases, mut found) = (Instant::now(), Counts::new(), 0, 0);
    let mut index = args.index.unwrap_or(0);
    loop {
        let is_over = match extent {
            _ if args.index.is_some() => cases == 1,
            Extent::Cases(count) => index == count,
            Extent::Time(length) => begun.elapsed() >= length,
        };
        if is_over || interrupted() {
            break;
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(index);
        let mut findings = Findings::default();
        match case(&mut random, args.daemon.as_deref(), &mut findings) {
            Ok(counts) => counts.into_iter().for_each(|(count, number)| *totals.entry(count).or_default() += number),
            // Of what a case needs itself, something failed: it says nothing about what it attacks.
            Err((code @ (Exit::Usage | Exit::NoInput | Exit::NoPermission), why)) => return Err((code, why)),
            Err((_, why)) => findings.note(why),
        }
        found += u64::from(!findings.0.is_empty());
        if !findings.0.is_empty() {
            println!("FOUND: admittance-lab hostile {} --seed {seed} --index {index}{length}", kind.name());
            findings.0.iter().for_each(|what| println!("  {}", what.replace('\n', "\n    ")));
        }
        (cases, index) = (cases + 1, index + 1);
    }
    let told: Vec<String> =
        totals.iter().map(|(count, number)| format!("{number} {}", format!("{count:?}").to_lowercase())).collect();
    println!(
        "{} of seed {seed}: {cases} cases in {:.0} s: {}; found in {found}",
        kind.name(),
        begun.elapsed().as_secs_f64(),
        told.join(", ")
    );
    Ok(found > 0)
}
