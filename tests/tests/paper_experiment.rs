//! The paper's experiment (section IV) in virtual time: the daemon's cycle against the plant, sample by sample.

use admittance_host::config::parse;
use admittanced::config::Config;
use admittanced::cycle::{self, Cycle};
use ipc_types::{CommandSample, TruthSample, Verdict};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;
use plant_sim::summary::Summary;

const SCENARIO: &str = include_str!("../../plant-sim/scenarios/paper.toml");
const MPC_PAPER: &str = include_str!("../../deploy/demo/mpc-paper.toml");
const MPC_TASK_SPACE: &str = include_str!("../../deploy/demo/mpc-task-space.toml");
const DAMPING_LOW: &str = include_str!("../../deploy/demo/damping-low.toml");
const DAMPING_HIGH: &str = include_str!("../../deploy/demo/damping-high.toml");

/// The paper's scenario without command delay (DESIGN: virtual time is 0), with the contact at this share of a sample.
fn scenario(contact_phase: f64) -> Scenario {
    let mut scenario: Scenario = parse(SCENARIO, "paper.toml").expect("the shipped scenario is valid");
    scenario.timing.command_delay_s = 0.0;
    scenario.start.contact_phase = contact_phase;
    scenario
}

struct Run {
    summary: Summary,
    infeasible: u64,
    truths: Vec<TruthSample>,
}

fn run(config: &str, scenario: &Scenario) -> Run {
    let config: Config = parse(config, "controller.toml").expect("the shipped config is valid");
    let mut cycle = cycle::build(&config).expect("the config describes a controller");
    let mut plant = VirtualRun::new(scenario).expect("the scenario can be set up");
    let mut summary = Summary::of_scenario(scenario);
    let mut command = CommandSample::zeroed();
    let (mut infeasible, mut truths) = (0, Vec::new());
    while !plant.is_finished() {
        let state = *plant.sample().expect("no fault drops samples");
        cycle.answer(&state, state.stamp_ns, &mut || false, &mut command);
        command.sequence += 1;
        infeasible += u64::from(command.verdict == Verdict::Infeasible.code());
        let truth = plant.advance(Some(&command)).expect("the plant takes every command");
        summary.add(&truth);
        truths.push(truth);
    }
    Run { summary, infeasible, truths }
}

#[test]
fn probe() {
    for (name, config) in [("low", DAMPING_LOW), ("high", DAMPING_HIGH), ("paper", MPC_PAPER), ("task", MPC_TASK_SPACE)]
    {
        let start = std::time::Instant::now();
        let mut peaks = Vec::new();
        for phase in 0..8 {
            let run = run(config, &scenario(f64::from(phase) / 8.0));
            let s = &run.summary;
            peaks.push((
                s.peak_force_y_n.round(),
                s.contact_losses,
                s.settled_force_y_n().round(),
                (s.tangential_speed_m_s() * 1e4).round() / 1e4,
                run.infeasible,
            ));
        }
        println!("{name}: {peaks:?} in {:?}", start.elapsed() / 8);
    }
}
