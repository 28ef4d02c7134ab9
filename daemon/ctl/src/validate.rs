//! `admittancectl validate`: a configuration file against every key's type and range.

use std::path::{Path, PathBuf};

use admittance_host::config::{self, LoadError, Section, keys_markdown};
use admittance_runner::config::Config;
use plant_sim::scenario::Scenario;

use crate::Exit;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  admittancectl validate /etc/admittanced/cell-3.toml\n  \
    admittancectl validate -v deploy/robots/six-joint.toml\n  \
    admittancectl validate --scenario plant-sim/scenarios/paper.toml\n  admittancectl validate --keys")]
pub(crate) struct Args {
    /// Files to check.
    #[arg(required_unless_present = "keys")]
    files: Vec<PathBuf>,
    /// The files are scenarios of plant-sim.
    #[arg(long)]
    scenario: bool,
    /// Print what the controller would believe of the arm, too.
    #[arg(short, long, conflicts_with_all = ["scenario", "keys"])]
    verbose: bool,
    /// Print every key with type, unit, range, default and meaning instead.
    #[arg(long)]
    keys: bool,
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    if args.keys {
        let keys = if args.scenario { Scenario::keys("") } else { Config::keys("") };
        println!("{}", keys_markdown(&keys));
        return Ok(Exit::Ok);
    }
    let mut worst = Exit::Ok;
    for file in &args.files {
        let outcome: Result<Result<(), String>, LoadError> = if args.scenario {
            config::load::<Scenario>(file).map(|_| Ok(()))
        } else {
            config::load::<Config>(file).map(|config| {
                check(&config)?;
                config.warnings().iter().for_each(|warning| eprintln!("{}: warning: {warning}", file.display()));
                if args.verbose {
                    belief(&config).iter().for_each(|line| println!("{}: {line}", file.display()));
                }
                Ok(())
            })
        };
        match outcome {
            Ok(Ok(())) => println!("{}: valid", file.display()),
            Ok(Err(why)) => {
                eprintln!("{}: {why}", file.display());
                worst = Exit::Config;
            }
            Err(error) => {
                eprintln!("{error}");
                worst = code(&error);
            }
        }
    }
    Ok(worst)
}

/// What the controller believes of the arm, line by line.
fn belief(config: &Config) -> Vec<String> {
    let (robot, control) = (&config.robot, &config.control);
    let mut lines = Vec::new();
    let described = robot.velocity_loop.as_ref();
    let value = |list: Option<&Vec<f64>>, joint: usize| list.map_or(0.0, |list| list[joint]);
    for (joint, lag_s) in robot.velocity_time_constant_s.iter().enumerate() {
        let damping = value(described.and_then(|it| it.damping.as_ref()), joint);
        let dead_time_s = value(described.and_then(|it| it.dead_time_s.as_ref()), joint);
        let order = match damping {
            0.0 => format!("of first order, time constant {lag_s} s"),
            _ => format!("of second order, {:.1} rad/s at -3 dB, damping {damping}", 1.0 / lag_s),
        };
        lines.push(format!("joint {joint}: speed loop {order}, dead time {dead_time_s} s"));
    }
    lines.push(match described.map_or(0.0, |it| it.report_lag_s) {
        0.0 => "joint velocities: as reported".to_owned(),
        lag_s => format!("joint velocities: reported with a lag of {lag_s} s, estimated"),
    });
    lines.push(format!(
        "wrench: time constants {:?} s, dead time {} s",
        config.contact.wrench_time_constant_s, config.contact.wrench_dead_time_s
    ));
    lines.push(format!(
        "a command acts {} s after its sample{}",
        control.command_delay_s,
        if config.mpc.model_delay { "" } else { ", which the model leaves out" }
    ));
    lines
}

/// The configuration of a file, checked as far as `validate` does.
///
/// # Errors
/// The code that `validate` ends with, and what it says.
pub fn load(file: &Path) -> Result<Config, (Exit, String)> {
    let config: Config = config::load(file).map_err(|error| (code(&error), error.to_string()))?;
    check(&config).map_err(|why| (Exit::Config, format!("{}: {why}", file.display())))?;
    Ok(config)
}

fn code(error: &LoadError) -> Exit {
    match error {
        LoadError::Read { .. } => Exit::NoInput,
        LoadError::Config(_) => Exit::Config,
    }
}

/// What the daemon would check beyond the keys, when it starts.
fn check(config: &Config) -> Result<(), String> {
    config.ipc.settings(None, None, None)?;
    admittance_runner::cycle::build(config).map(|_| ())
}
