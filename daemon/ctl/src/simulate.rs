//! `admittancectl simulate`: daemon and plant-sim in one process and in virtual time, recorded.

use std::io::BufWriter;
use std::path::PathBuf;

use admittance_host::config;
use admittance_runner::config::Config;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

use crate::diagnostics::mode_text;
use crate::recording::create;
use crate::validate::shown;
use crate::virtual_recording::{self, Ended};
use crate::{Exit, Outcome, validate};

#[derive(Debug, clap::Args)]
#[command(
    after_help = "The daemon's law against the plant of plant-sim, sample by sample, as fast as this machine computes; no shared memory, \
    no daemon, no clock. Every sample is answered at its own instant: what lateness, silence and a busy machine do is seen with the \
    programs alone, and so is [[fault]]. The same files give the same numbers. `replay`, `report` and `identify` read \
    the recording.\n\nExit codes: 0 recorded, 64 usage, 65 the run breaks off (FILE has it until then), 66 no such file, 73 FILE cannot be created, \
    74 writing failed, 78 configuration or scenario.\n\nExample:\n  \
    admittancectl simulate deploy/demo/mpc-default.toml plant-sim/scenarios/paper.toml --out contact.mcap"
)]
pub(crate) struct Args {
    /// The daemon's configuration.
    config: PathBuf,
    /// Scenario of plant-sim.
    scenario: PathBuf,
    /// The recording, as `admittancectl record` writes it; it must not exist yet.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Replace FILE if it exists.
    #[arg(long)]
    overwrite: bool,
}

pub(crate) fn run(args: &Args) -> Outcome<Exit> {
    let config = validate::load(&args.config)?;
    let scenario = validate::scenario(&args.scenario)?;
    fits(&config, &scenario).map_err(|why| (Exit::Config, format!("{}: {why}", shown(&args.scenario))))?;
    let text = config::read_text(&args.config)
        .map_err(|error| (Exit::NoInput, format!("{}: {error}", shown(&args.config))))?;
    let file = create(&args.out, args.overwrite)?;
    let recorded = virtual_recording::record(&config, &text, &scenario, BufWriter::new(file));
    let Ended { summary, command } = recorded.map_err(|(code, why)| {
        let file = if code == Exit::DataError { &args.scenario } else { &args.out };
        (code, format!("{}: {why}", shown(file)))
    })?;
    let touch = summary.first_contact_s.map_or_else(
        || "no contact".to_owned(),
        |at| {
            format!(
                "contact from {at:.3} s on, peak normal force {:.1} N, contact losses {}",
                summary.peak_normal_force_n, summary.contact_losses
            )
        },
    );
    let end = mode_text(command.mode, command.stop_reason);
    println!("{}: {} cycles of motion; {touch}; at the end {end}", shown(&args.out), summary.cycles);
    Ok(Exit::Ok)
}

/// Whether virtual time has what the scenario asks for, and the daemon and it speak of the same arm.
fn fits(config: &Config, scenario: &Scenario) -> Result<(), String> {
    let (told, real) = (config.robot.joint.len(), scenario.robot.joint.len());
    if told != real {
        return Err(format!("robot.joint: {real} joints: accepted: {told}, as the configuration has"));
    }
    if let Some(fault) = scenario.fault.first() {
        return Err(format!(
            "fault[0].kind = {:?}: accepted: no [[fault]], which virtual time does not have: run admittanced and plant-sim",
            fault.kind.name()
        ));
    }
    if scenario.twist.is_some() {
        return Err(
            "twist: accepted: none, since nobody leads in virtual time: run admittanced and plant-sim".to_owned()
        );
    }
    for overload in VirtualRun::new(scenario).map_err(|error| error.to_string())?.overloads() {
        eprintln!("warning: {overload}");
    }
    Ok(())
}
