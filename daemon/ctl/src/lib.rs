//! The commands to commission, watch and rehearse admittanced; and the parts that admittance-lab
//! uses as well.

/// As the standard library's, but for a reader that has gone: see `admittance_host::output`.
macro_rules! println {
    ($($text:tt)*) => { admittance_host::say!($($text)*) };
}
/// As the standard library's, but for a reader that has gone.
macro_rules! eprintln {
    ($($text:tt)*) => { admittance_host::remark!($($text)*) };
}

pub mod consequences;
pub mod demo;
mod diagnostics;
mod doctor;
pub mod identify;
mod import;
mod installed_files;
mod lead;
mod limits;
pub mod offline;
pub mod parallel;
pub mod plausible;
mod record;
pub mod recording;
mod relay;
mod replay;
pub mod report;
pub mod request;
pub mod roles;
mod schema;
pub mod session;
mod simulate;
pub mod target;
mod top;
mod turn;
pub mod validate;
pub mod virtual_recording;

use std::process::ExitCode;

use admittance_host::{cpu, output};
use clap::{Parser, Subcommand};

/// How a command ends.
pub type Exit = admittance_host::exit::ExitCode;
/// The outcome of a command, or an exit code and a sentence that says why it failed.
pub type Outcome<T> = Result<T, (Exit, String)>;

#[derive(Debug, Parser)]
#[command(
    name = "admittancectl",
    version,
    about = "Rehearse, check, watch and direct admittanced.",
    arg_required_else_help = true
)]
#[command(after_help = "Examples:\n  admittancectl demo\n  admittancectl validate /etc/admittanced/cell-3.toml\n  \
    admittancectl status --instance cell-3\n\nExit codes: 0 done, 1 claim not met or request refused, 64 usage, \
    65 malformed data, 66 no such file, 69 no daemon answers, 73 a file cannot be created, 74 writing failed, \
    75 machine too busy, 77 no permission, 78 configuration.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run the paper's experiment with the real daemon and the real plant, and compare five
    /// controllers.
    Demo(demo::Args),
    /// Check configuration files; nothing is started.
    Validate(validate::Args),
    /// Print the robot file of an arm from its URDF, with what is still to be filled in.
    Import(import::Args),
    /// Say what a running daemon is doing.
    Status(request::StatusArgs),
    /// Watch a running daemon in the terminal.
    Top(top::Args),
    /// Record what a daemon would do to the plant of a scenario, in virtual time; nothing is started.
    Simulate(simulate::Args),
    /// Record what a running daemon is given and what it answers.
    Record(record::Args),
    /// Hand records and diagnostics of a running daemon on to a place from which other machines may read them.
    Relay(relay::Args),
    /// Run the law over a recording again and compare every answer, bit by bit.
    Replay(replay::Args),
    /// Draw force, velocity offset and path of a recording.
    Report(report::Args),
    /// Find what arm, sensor and surface are from recordings, as keys of the configuration.
    Identify(identify::Args),
    /// Release a stopped daemon, once nothing pushes into the surface any more.
    Reset(request::ResetArgs),
    /// Let control begin, once no axis is in contact.
    Enable(request::EnableArgs),
    /// End control: in free motion at once, in contact by a stop at a low force.
    Disable(request::DisableArgs),
    /// Take the present wrench, the tool's weight apart, as the sensor's bias.
    Tare(request::TareArgs),
    /// Lead the arm with a velocity for a time, or until it touches.
    Move(lead::Args),
    /// Change the force limit of some axes while the daemon runs.
    SetForceLimit(request::SetForceLimitArgs),
    /// Change stiffness, normal or contact point of the surface while the daemon runs.
    SetEnvironment(request::SetEnvironmentArgs),
    /// Change the law while the daemon runs.
    SetLaw(request::SetLawArgs),
    /// Let the daemon read its configuration again, as SIGHUP does.
    Reload(request::ReloadArgs),
    /// Check whether this machine can keep a deadline, and say what to change; nothing is changed.
    Doctor(doctor::Args),
    /// Print the shared-memory contract, for clients in other languages.
    Schema(schema::Args),
    /// Find the highest approach speeds that stay safe, over stiffness and cycle time.
    Limits(limits::Args),
    /// Write manual pages and shell completions, for deploy/install.sh.
    #[command(hide = true)]
    InstalledFiles(installed_files::Args),
    #[command(flatten)]
    Role(roles::Role),
}

/// Runs the program with the arguments of its process.
pub fn main() -> ExitCode {
    if let Some(feature) = cpu::missing_cpu_feature() {
        eprintln!(
            "admittancectl: this processor lacks {feature}, which this build needs (x86-64-v3): build for this machine"
        );
        return Exit::Unavailable.into();
    }
    match Cli::try_parse() {
        Ok(cli) => exit("admittancectl", || run(cli.command)),
        Err(error) => usage(&error),
    }
}

/// Prints what is wrong with the arguments, or the help that they ask for.
pub fn usage(error: &clap::Error) -> ExitCode {
    // If the terminal is gone nothing can be printed.
    let _ = error.print();
    if error.use_stderr() { Exit::Usage.into() } else { Exit::Ok.into() }
}

/// Runs a tool to its exit code; says why where something failed.
pub fn exit(program: &str, tool: impl FnOnce() -> Outcome<Exit>) -> ExitCode {
    let code = output::until_unread(program, || {
        tool().unwrap_or_else(|(code, why)| {
            output::fatal(program, &why);
            code
        })
    });
    code.into()
}

fn run(command: Command) -> Outcome<Exit> {
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Import(args) => import::run(&args),
        Command::Status(args) => request::status(&args),
        Command::Top(args) => top::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Record(args) => record::run(&args),
        Command::Relay(args) => relay::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Identify(args) => identify::run(&args),
        Command::Reset(args) => request::reset(&args),
        Command::Enable(args) => request::enable(&args),
        Command::Disable(args) => request::disable(&args),
        Command::Tare(args) => request::tare(&args),
        Command::Move(args) => lead::run(&args),
        Command::SetForceLimit(args) => request::set_force_limit(&args),
        Command::SetEnvironment(args) => request::set_environment(&args),
        Command::SetLaw(args) => request::set_law(&args),
        Command::Reload(args) => request::reload(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Schema(args) => schema::run(&args),
        Command::Limits(args) => limits::run(&args),
        Command::InstalledFiles(args) => installed_files::run(&args),
        Command::Role(role) => roles::run(role),
    }
}
