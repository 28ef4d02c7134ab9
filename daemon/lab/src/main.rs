//! What developers of admittanced measure with: studies of the verdict, benchmarks of solver and
//! cycle, soaks, and attacks from outside. Operators need none of it: what they install is `admittancectl`.

/// As the standard library's, but for a reader that has gone: see `admittance_host::output`.
macro_rules! println {
    ($($text:tt)*) => { admittance_host::say!($($text)*) };
}
/// As the standard library's, but for a reader that has gone.
macro_rules! eprintln {
    ($($text:tt)*) => { admittance_host::remark!($($text)*) };
}

mod answers;
mod bench;
mod flood;
mod hostile;
mod keys;
mod soak;
mod study;

use std::process::ExitCode;

use admittance_host::cpu;
use admittancectl::roles::{self, Role};
use clap::{Parser, Subcommand};

use admittancectl::{Exit, Outcome};

#[derive(Debug, Parser)]
#[command(
    name = "admittance-lab",
    version,
    about = "Measure admittanced: its verdict, its solver, its cycle, and what it survives.",
    arg_required_else_help = true
)]
#[command(after_help = "Examples:\n  admittance-lab study verdict --runs 200 --seed 1\n  admittance-lab bench solver \
    daemon/lab/judge/problems/d2_h5.bin\n  admittance-lab soak --minutes 2\n  admittance-lab hostile\n\nExit codes: 0 done, 1 claim not met, \
    64 usage, 65 malformed data, 66 no such file, 69 not available, 75 machine too busy, 77 no permission.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Time the solver, or the whole cycle, on this machine.
    Bench(bench::Args),
    /// Compare the controller's verdicts with what is attainable, over random contacts.
    Study(study::Args),
    /// Let things go wrong at random, for long, and watch what must never happen.
    Soak(soak::Args),
    /// Attack daemon and tools from outside: garbage, damage, kills, and all of it at once.
    Hostile(hostile::Args),
    /// Ask a running daemon more than it can answer, and measure how long another client waits.
    Flood(flood::Args),
    /// The daemon's real-time thread in this process, observed: what bench jitter starts.
    #[command(hide = true)]
    RoleObservedDaemon(bench::ObservedArgs),
    /// The EGM edge itself, in this process.
    #[command(hide = true, disable_help_flag = true)]
    RoleEgm {
        /// The edge's arguments.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<std::ffi::OsString>,
    },
    /// What soak starts to look on from outside.
    #[command(hide = true)]
    RoleSoakObserver(soak::observer::Args),
    #[command(flatten)]
    Role(Role),
}

fn main() -> ExitCode {
    if let Some(feature) = cpu::missing_cpu_feature() {
        eprintln!(
            "admittance-lab: this processor lacks {feature}, which this build needs (x86-64-v3): build for this machine"
        );
        return Exit::Unavailable.into();
    }
    match Cli::try_parse() {
        Ok(cli) => admittancectl::exit("admittance-lab", || run(cli.command)),
        Err(error) => admittancectl::usage(&error),
    }
}

fn run(command: Command) -> Outcome<Exit> {
    match command {
        Command::Bench(args) => bench::run(&args),
        Command::Study(args) => study::run(&args),
        Command::Soak(args) => soak::run(&args),
        Command::Hostile(args) => hostile::run(&args),
        Command::Flood(args) => flood::run(&args),
        Command::RoleSoakObserver(args) => soak::observer::run(&args),
        Command::RoleObservedDaemon(args) => bench::observed::run(&args),
        Command::RoleEgm { arguments } => Ok(admittance_egm::main_with_args(arguments.into_iter())),
        Command::Role(role) => roles::run(role),
    }
}
