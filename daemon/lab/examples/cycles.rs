//! Steps the law through the samples of a contact at 1 kHz, and nothing else: instructions.py counts
//! its instructions.
//!
//! `cycles ARM known|range ROUNDS`: two, six or seven joints, six of which all six directions give way or whose
//! task frame is the tool's, or the name of another robot's file, and what the controller is told of the stiffness.

use admittance_core::quantities::Instant;
use admittance_host::config::parse;
use admittance_runner::config::{Config, ContactPointName, FrameName};
use admittance_runner::cycle;
use admittance_runner::virtual_time::VirtualTime;
use ipc_types::{CommandSample, StateSample};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

const SAMPLING_TIME_S: f64 = 0.001;
/// Samples before the touch, and from it on.
const FREE: usize = 50;
const IN_CONTACT: usize = 250;

fn cell(joints: &str) -> Option<(&'static str, &'static str)> {
    Some(match joints {
        "two" => (
            include_str!("../../../deploy/demo/mpc-default.toml"),
            include_str!("../../../plant-sim/scenarios/paper.toml"),
        ),
        // All six directions give way; the frame of the tool, which turns.
        "six" | "six-all" | "six-tool" => (
            include_str!("../../../deploy/robots/six-joint.toml"),
            include_str!("../../../plant-sim/scenarios/six-joint.toml"),
        ),
        "seven" => (
            include_str!("../../../deploy/robots/seven-joint.toml"),
            include_str!("../../../plant-sim/scenarios/seven-joint.toml"),
        ),
        "scara" => {
            (include_str!("../../../deploy/robots/scara.toml"), include_str!("../../../plant-sim/scenarios/scara.toml"))
        }
        "planar-three" => (
            include_str!("../../../deploy/robots/planar-three.toml"),
            include_str!("../../../plant-sim/scenarios/planar-three.toml"),
        ),
        "gantry" => (
            include_str!("../../../deploy/robots/gantry.toml"),
            include_str!("../../../plant-sim/scenarios/gantry.toml"),
        ),
        "rail" => {
            (include_str!("../../../deploy/robots/rail.toml"), include_str!("../../../plant-sim/scenarios/rail.toml"))
        }
        "eight-joint" => (
            include_str!("../../../deploy/robots/eight-joint.toml"),
            include_str!("../../../plant-sim/scenarios/eight-joint.toml"),
        ),
        _ => return None,
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [joints, told, rounds] = arguments.as_slice() else { return Err("three arguments: JOINTS TOLD ROUNDS".into()) };
    let (config, scenario) = cell(joints)
        .ok_or("accepted: two, six, six-all, six-tool, seven, scara, planar-three, gantry, rail, eight-joint")?;
    let mut config: Config = parse(config, "controller.toml")?;
    let mut scenario: Scenario = parse(scenario, "scenario.toml")?;
    let control = &mut config.control;
    (control.sampling_time_s, control.max_sample_age_s) = (SAMPLING_TIME_S, 3.0 * SAMPLING_TIME_S);
    (control.answer_budget_s, control.spin_s) = (SAMPLING_TIME_S / 2.0, SAMPLING_TIME_S / 4.0);
    scenario.timing.sampling_time_s = SAMPLING_TIME_S;
    if joints == "six-all" {
        config.contact.admittance_axes.fill(true);
    }
    if joints == "six-tool" {
        config.task.frame = FrameName::Tool;
    }
    if told == "range" {
        let environment = &mut config.environment;
        let stiffness = environment.normal_stiffness_n_m;
        environment.stiffness_range_n_m = Some([stiffness / 3.0, stiffness * 3.0]);
        environment.contact = ContactPointName::Detected;
        environment.wrench_noise_n = 0.5;
    }

    let mut run = VirtualTime::new(cycle::build(&config)?, VirtualRun::new(&scenario)?);
    let (mut samples, mut touched) = (Vec::<StateSample>::new(), None);
    while let Some(step) = run.step()? {
        samples.push(step.state);
        if step.truth.in_contact == 1 {
            touched.get_or_insert(samples.len());
        }
    }
    let touched = touched.ok_or("nothing was touched")?;
    let samples = samples.get(touched - FREE..touched + IN_CONTACT).ok_or("the contact is too short")?;

    let mut command = CommandSample::zeroed();
    for _ in 0..rounds.parse::<u32>()? {
        let mut cycle = cycle::build(&config)?;
        for state in samples {
            cycle.answer(state, Instant::from_nanoseconds(state.stamp_ns), &mut || false, &mut command);
        }
    }
    println!("{} cycles, the last one in mode {}", samples.len(), command.mode);
    Ok(())
}
