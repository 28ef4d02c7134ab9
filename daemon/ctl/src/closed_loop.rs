//! The daemon's cycle against the plant, in virtual time: the same code as in real time, without clock and services.

use std::ops::ControlFlow;

use admittanced::config::Config;
use admittanced::cycle::{self, CycleReport};
use ipc_types::{CommandSample, StateSample, TruthSample};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

/// One cycle that is over.
pub(crate) struct Step<'a> {
    /// The sample that was answered.
    pub(crate) state: &'a StateSample,
    /// What the cycle tells besides its command.
    pub(crate) report: &'a CycleReport,
    /// The answer.
    pub(crate) command: &'a CommandSample,
    /// What was true at the instant of the sample, with the peaks since the sample before.
    pub(crate) truth: &'a TruthSample,
}

/// Runs a controller against a plant to the end of the scenario's motion, or until `see` breaks.
///
/// # Errors
/// What controller or plant do not accept.
pub(crate) fn run(
    config: &Config,
    scenario: &Scenario,
    see: impl FnMut(&Step<'_>) -> ControlFlow<()>,
) -> Result<(), String> {
    let plant = VirtualRun::new(scenario).map_err(|error| error.to_string())?;
    run_plant(config, plant, see)
}

/// [`run`] with a plant that is set up already.
///
/// # Errors
/// As [`run`].
pub(crate) fn run_plant(
    config: &Config,
    mut plant: VirtualRun,
    mut see: impl FnMut(&Step<'_>) -> ControlFlow<()>,
) -> Result<(), String> {
    let mut cycle = cycle::build(config)?;
    let mut command = CommandSample::zeroed();
    while !plant.is_finished() {
        let state = *plant.sample().ok_or("the plant published no sample")?;
        let report = cycle.answer(&state, state.stamp_ns, &mut || false, &mut command);
        command.sequence += 1;
        let truth = plant.advance(Some(&command)).map_err(|rejection| format!("command refused: {rejection:?}"))?;
        if see(&Step { state: &state, report: &report, command: &command, truth: &truth }).is_break() {
            break;
        }
    }
    Ok(())
}
