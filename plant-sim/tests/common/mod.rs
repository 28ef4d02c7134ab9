//! What the plant's tests share: the shipped scenarios, and commands.

#![allow(dead_code, reason = "each test file uses a part of it")]

use admittance_host::config::parse;
use ipc_types::{CommandSample, Motion, StateSample, TruthSample, VirtualPlant};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

/// The paper's experiment.
pub(crate) const PAPER: &str = include_str!("../../scenarios/paper.toml");
/// The planar arm in free space.
pub(crate) const PLANAR_FREE: &str = include_str!("../../scenarios/planar-free.toml");
/// Six joints and a floor.
pub(crate) const SIX_JOINT: &str = include_str!("../../scenarios/six-joint.toml");

/// The same arm with masses.
pub(crate) const SIX_JOINT_MASSES: &str = include_str!("../../scenarios/six-joint-masses.toml");

/// A shipped scenario.
pub(crate) fn scenario(text: &str) -> Scenario {
    parse(text, "scenario").expect("the shipped scenario is valid")
}

/// The paper's experiment without command delay, with the contact at this share of a sample.
pub(crate) fn paper(contact_phase: f64) -> Scenario {
    let mut scenario = scenario(PAPER);
    scenario.timing.command_delay_s = 0.0;
    scenario.start.contact_phase = contact_phase;
    scenario
}

/// A valid answer to `state` with this velocity offset and no plan beyond it, valid for a second.
pub(crate) fn command(state: &StateSample, offset: &[f64]) -> CommandSample {
    let mut velocity_offset = [0.0; 6];
    velocity_offset[..offset.len()].copy_from_slice(offset);
    CommandSample {
        sequence: state.sequence,
        stamp_ns: state.stamp_ns,
        boot_id: 7,
        state_sequence: state.sequence,
        state_stamp_ns: state.stamp_ns,
        valid_until_ns: state.stamp_ns + 1_000_000_000,
        joint_count: state.joint_count,
        motion: Motion::Offset.code(),
        velocity_offset,
        ..CommandSample::zeroed()
    }
}

/// Runs a scenario to its end; `law` gives the offset from each sample. Returns the truth of every
/// sample.
pub(crate) fn run(scenario: &Scenario, mut law: impl FnMut(&StateSample) -> Vec<f64>) -> Vec<TruthSample> {
    let mut run = VirtualRun::new(scenario).expect("the scenario can be set up");
    let mut truths = Vec::new();
    while !run.is_finished() {
        let answer = run.sample().map(|state| command(state, &law(state)));
        truths.push(run.advance(answer.as_ref()).expect("the command is acceptable"));
    }
    truths
}
