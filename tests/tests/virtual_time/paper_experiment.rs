//! The paper's experiment (section IV) in virtual time: the daemon's cycle against the plant,
//! sample by sample, at 64 instants of contact within the sample. Expected figures: docs/design.md,
//! "The paper's figures", from prototypes that share no code with this.

use admittance_host::config::parse;
use admittance_judge::clarabel_solver::{ClarabelSettings, ClarabelSolver};
use admittance_runner::config::Config;
use admittance_runner::cycle::{self, Cycle};
use admittance_runner::virtual_time::{Step, VirtualTime};
use end_to_end::closed_loop::MPC_DEFAULT;
use ipc_types::{Motion, StopReason, Verdict};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;
use plant_sim::summary::Summary;

const SCENARIO: &str = include_str!("../../../plant-sim/scenarios/paper.toml");
const MPC_PAPER: &str = include_str!("../../../deploy/demo/mpc-paper.toml");
const MPC_DETECTED: &str = include_str!("../../../deploy/demo/mpc-detected.toml");
const DAMPING_LOW: &str = include_str!("../../../deploy/demo/damping-low.toml");
const DAMPING_HIGH: &str = include_str!("../../../deploy/demo/damping-high.toml");

const INSTANTS: u32 = 64;

/// The paper's scenario without command delay, with the contact at this share of a sample.
fn scenario(contact_phase: f64) -> Scenario {
    let mut scenario: Scenario = parse(SCENARIO, "paper.toml").expect("the shipped scenario is valid");
    scenario.timing.command_delay_s = 0.0;
    scenario.start.contact_phase = contact_phase;
    scenario
}

struct Run {
    summary: Summary,
    /// True force at every sample, N.
    forces: Vec<[f64; 2]>,
    infeasible: u64,
}

fn controller(text: &str, scenario: &Scenario) -> Config {
    let mut config: Config = parse(text, "controller.toml").expect("the shipped config is valid");
    config.control.command_delay_s = scenario.timing.command_delay_s;
    config
}

/// All steps of the scenario.
fn steps(cycle: Box<dyn Cycle>, scenario: &Scenario) -> Vec<Step> {
    let plant = VirtualRun::new(scenario).expect("the scenario can be set up");
    VirtualTime::new(cycle, plant).run().expect("the plant publishes every sample and takes every command")
}

fn run(cycle: Box<dyn Cycle>, scenario: &Scenario) -> Run {
    let mut summary = Summary::of_scenario(scenario);
    let (mut infeasible, mut forces) = (0, Vec::new());
    for Step { command, truth, .. } in steps(cycle, scenario) {
        infeasible += u64::from(command.verdict == Verdict::Infeasible.code());
        forces.push([truth.wrench[0], truth.wrench[1]]);
        summary.add(&truth);
    }
    Run { summary, forces, infeasible }
}

/// Runs all instants of contact, prints what they show, and hands each to the claims.
fn at_all_instants(name: &str, config: &str, claims: impl Fn(&Run)) {
    let started = std::time::Instant::now();
    let mut peaks = (f64::INFINITY, 0.0_f64);
    let mut last = None;
    for instant in 0..INSTANTS {
        let scenario = scenario(f64::from(instant) / f64::from(INSTANTS));
        let cycle = cycle::build(&controller(config, &scenario)).expect("the config describes a controller");
        let run = run(cycle, &scenario);
        claims(&run);
        let peak = run.summary.peak_force_y_n;
        peaks = (peaks.0.min(peak), peaks.1.max(peak));
        last = Some(run.summary);
    }
    let summary = last.expect("there are instants");
    let simulated = f64::from(INSTANTS) * 2.5;
    println!(
        "{name}: peak |f_y| {:.1} to {:.1} N, losses {}, settled {:.1} N, tangential {:.4} m/s; {:.0} times real time",
        peaks.0,
        peaks.1,
        summary.contact_losses,
        summary.settled_force_y_n(),
        summary.tangential_speed_m_s(),
        simulated / started.elapsed().as_secs_f64()
    );
}

fn assert_near(what: &str, value: f64, expected: f64, share: f64) {
    assert!((value / expected - 1.0).abs() <= share, "{what} = {value}, expected {expected} within {share}");
}

#[test]
fn the_paper_profile_keeps_the_limit_and_the_contact() {
    at_all_instants("mpc-paper", MPC_PAPER, |run| {
        assert!(run.summary.peak_force_y_n <= 190.0, "peak {} N", run.summary.peak_force_y_n);
        assert_eq!((run.summary.contact_losses, run.infeasible), (0, 0));
        assert_near("settled force", run.summary.settled_force_y_n(), 122.0, 0.03);
        assert!(run.summary.tangential_speed_m_s() < 0.0, "joint-space weights drag the TCP uphill");
    });
}

#[test]
fn the_default_profile_slides_at_the_commanded_tangential_speed_and_settles_at_the_minimum_force() {
    at_all_instants("mpc-default", MPC_DEFAULT, |run| {
        assert!(run.summary.peak_force_y_n <= 200.5, "peak {} N", run.summary.peak_force_y_n);
        assert_eq!((run.summary.contact_losses, run.infeasible), (0, 0));
        let commanded = 0.25 * 25f64.to_radians().sin();
        assert_near("tangential speed", run.summary.tangential_speed_m_s(), commanded, 0.01);
        // 6 N in x are 6 N / tan 25° in y.
        assert_near("settled force", run.summary.settled_force_y_n(), 6.0 / 25f64.to_radians().tan(), 0.03);
    });
}

#[test]
fn a_detected_contact_point_is_as_good() {
    at_all_instants("mpc-detected", MPC_DETECTED, |run| {
        assert!(run.summary.peak_force_y_n <= 200.5, "peak {} N", run.summary.peak_force_y_n);
        assert_eq!((run.summary.contact_losses, run.infeasible), (0, 0));
        assert_near("settled force", run.summary.settled_force_y_n(), 6.0 / 25f64.to_radians().tan(), 0.03);
    });
}

#[test]
fn low_damping_bounces() {
    at_all_instants("damping-low", DAMPING_LOW, |run| {
        assert_near("peak", run.summary.peak_force_y_n, 219.0, 0.03);
        assert!(run.summary.contact_losses > 0);
    });
}

#[test]
fn high_damping_exceeds_the_limit() {
    at_all_instants("damping-high", DAMPING_HIGH, |run| {
        assert_near("peak", run.summary.peak_force_y_n, 625.0, 0.03);
        assert_near("settled force", run.summary.settled_force_y_n(), 349.0, 0.03);
        assert_eq!(run.summary.contact_losses, 0);
    });
}

#[test]
fn limits_that_contradict_each_other_are_a_latched_stop_and_the_arm_is_held() {
    // The paper bounds no input, so one axis alone is never infeasible. On this plane f_x = f_y tan
    // 25°: at least 100 N in x is at least 214 N in y.
    let mut config: Config = parse(MPC_PAPER, "controller.toml").expect("valid");
    config.contact.minimum_force[0] = 100.0;
    let expected_shortfall = (100.0 / 25f64.to_radians().tan() - 200.0).min(100.0 - 200.0 * 25f64.to_radians().tan());
    let cycle = cycle::build(&config).expect("a controller");
    let mut infeasible = None;
    for Step { state, command, .. } in steps(cycle, &scenario(0.5)) {
        if command.verdict == Verdict::Infeasible.code() {
            infeasible.get_or_insert(command);
        }
        if let Some(first) = &infeasible {
            assert_eq!(command.motion, Motion::Hold.code(), "latched at sample {}", state.sequence);
            assert_eq!(command.stop_reason, StopReason::Infeasible.code());
            let shortfall = -first.verdict_margin;
            assert!(
                shortfall > 0.1 && shortfall <= expected_shortfall,
                "{shortfall} N of at most {expected_shortfall} N"
            );
            assert!(first.verdict_time_s > 0.0);
        }
    }
    assert!(infeasible.is_some(), "both axes were never in contact");
}

#[test]
fn forces_do_not_depend_on_the_solver() {
    // Clarabel as exact as it gets; what is left is its own tolerance, carried on by the loop.
    let settings = ClarabelSettings { tolerance: 1e-12, max_iterations: 200 };
    let tolerance = 1e-3;
    for (name, text, inputs) in [("paper", MPC_PAPER, 1), ("default", MPC_DEFAULT, 1), ("default", MPC_DEFAULT, 4)] {
        for phase in [0.1, 0.6] {
            let scenario = scenario(phase);
            let mut config = controller(text, &scenario);
            config.mpc.inputs_per_cycle = Some(inputs);
            let own = run(cycle::build(&config).expect("a controller"), &scenario);
            config.mpc.solver_tolerance = settings.tolerance;
            let judge =
                cycle::build_watched(&config, &|_| Box::new(ClarabelSolver::new(settings))).expect("a controller");
            let reference = run(judge, &scenario);
            assert_eq!(own.forces.len(), reference.forces.len());
            let differences = own.forces.iter().flatten().zip(reference.forces.iter().flatten());
            let most = differences.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
            let what = format!("{name}, {inputs} inputs, contact at {phase} of a sample");
            println!("{what}: forces within {most:.1e} N");
            assert!(most <= tolerance, "{what}: {most} N");
            let impact = own.forces.iter().zip(&reference.forces).take_while(|(own, _)| own[1] > -50.0).count() + 20;
            let pairs = own.forces[..impact].iter().flatten().zip(reference.forces[..impact].iter().flatten());
            assert!(pairs.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs())) <= tolerance, "{what}: at the impact");
            assert!(own.forces.iter().flatten().any(|force| force.abs() > 50.0), "no contact");
        }
    }
}
