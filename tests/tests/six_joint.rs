//! A six-joint arm under the default profile at 1 kHz: presses on a level floor while it slides,
//! with one, three and six admittance axes; in virtual time, and once with both real processes.

use admittance_runner::config::ContactPointName;
use end_to_end::closed_loop::{Experiment, Instant, Run};
use end_to_end::session::{daemon_command, run_plant, with_keys, write};
use end_to_end::{Child, PATIENCE, PrivateIpc, undisturbed};
use plant_sim::scenario::Scenario;
use plant_sim::summary::Summary;

const CONFIG: &str = include_str!("../../deploy/robots/six-joint.toml");
const SCENARIO: &str = include_str!("../../plant-sim/scenarios/six-joint.toml");
/// f_max on z in N, and what the linear model may miss of it.
const MOST: f64 = 150.0 + 0.5;

/// As shipped, with this command delay and these admittance axes.
fn experiment(axes: [bool; 6], delay: f64) -> Experiment {
    let mut experiment = Experiment::new(CONFIG, SCENARIO, 0.001).with_delay(delay);
    experiment.config.contact.admittance_axes = axes.to_vec();
    experiment
}

/// Angle in rad by which the TCP is turned from how it stood at the start of the motion: largest
/// and last.
fn orientation_error(run: &Run) -> (f64, f64) {
    let rotation = |vector: &[f64; 3]| nalgebra::Rotation3::new(nalgebra::Vector3::from(*vector));
    let start = rotation(&run.instants[0].truth.tcp_rotation);
    let errors = run.instants.iter().map(|at| (rotation(&at.truth.tcp_rotation) * start.inverse()).angle());
    errors.fold((0.0, 0.0), |(most, _), error| (error.max(most), error))
}

#[test]
fn presses_and_slides_with_one_three_and_six_axes() {
    for delay in [0.0, 0.0005] {
        for count in [1, 3, 6] {
            let axes = match count {
                1 => [false, false, true, false, false, false],
                _ => std::array::from_fn(|axis| axis < count),
            };
            let (mut peak, mut orientation, mut iterations) = (0.0_f64, (0.0_f64, 0.0_f64), 0);
            let mut settled = 0.0;
            experiment(axes, delay).at_instants(8, |share, run| {
                let at = format!("{count} axes, delay {delay} s, contact at {share} of a sample");
                assert!(run.touched(), "{at}");
                assert!(run.peak(2) <= MOST, "{at}: peak {} N", run.peak(2));
                assert_eq!((run.infeasible(), run.losses(), run.stop_reason(), run.limited()), (0, 0, None, 0), "{at}");
                assert!(run.steps() <= 16, "{at}: {} steps", run.steps());
                settled = run.settled_normal();
                assert!((settled - 6.0).abs() < 0.5, "{at}: settled at {settled} N");
                let slides = run.tangential_share();
                assert!((slides - 1.0).abs() < 0.01, "{at}: slides at {slides} of the commanded speed");
                let (most, last) = orientation_error(run);
                orientation = (orientation.0.max(most), orientation.1.max(last));
                peak = peak.max(run.peak(2));
                iterations = iterations.max(run.iterations());
            });
            println!(
                "{count} axes, delay {delay} s: peak {peak:.1} N, settled {settled:.2} N, orientation off by at most {:.2e} rad, \
                 {:.2e} rad at the end, at most {iterations} iterations",
                orientation.0, orientation.1
            );
            assert!(orientation.0 <= 0.01, "{count} axes: the TCP turns by {} rad", orientation.0);
        }
    }
}

#[test]
fn finds_a_floor_that_nobody_told() {
    for (axes, share) in [([true; 6], 0.0), ([false, false, true, false, false, false], 0.4)] {
        let mut experiment = experiment(axes, 0.0).at_instant(share);
        experiment.config.environment.contact = ContactPointName::Detected;
        experiment.config.environment.contact_point_m = None;
        let run = experiment.run();
        assert!(run.touched());
        assert_eq!((run.stop_reason(), run.infeasible(), run.losses()), (None, 0, 0), "{axes:?}");
        assert!(run.peak(2) <= MOST, "peak {} N", run.peak(2));
        assert!((run.settled_normal() - 6.0).abs() < 0.5, "settled at {} N", run.settled_normal());
    }
}

#[test]
fn both_processes_press_and_slide_in_real_time() {
    undisturbed(|| {
        // Tests are not built for release: a whole cycle for the answer, and what a busy machine
        // needs.
        let config = with_keys(
            CONFIG,
            &[
                ("control.command_delay_s", "0.001"),
                ("control.answer_budget_s", "0.0009"),
                ("control.max_sample_age_s", "0.1"),
                ("control.max_consecutive_fallbacks", "20"),
            ],
        );
        let scenario = with_keys(SCENARIO, &[("timing.command_delay_s", "0.001")]);
        let parsed: Scenario = admittance_host::config::parse(&scenario, "scenario.toml").expect("valid");
        let ipc = PrivateIpc::new("six-joint");
        let mut daemon = Child::spawn(&mut daemon_command(&ipc, &write(&ipc, "daemon.toml", &config)));
        let mut summary = Summary::of_scenario(&parsed);
        run_plant(&ipc, &write(&ipc, "scenario.toml", &scenario), |truth| summary.add(truth));
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
        let (peak, losses) = (summary.peak_normal_force_n, summary.contact_losses);
        println!("real time: peak {peak:.1} N, {losses} losses");
        assert!(summary.first_contact_s.is_some());
        assert!(peak <= MOST, "peak {peak} N: {}", daemon.report());
        assert_eq!(losses, 0);
    });
}

/// Turned and moved in the air: forces and torques of a tool of 3 kg on a sensor at the flange.
#[test]
fn a_tool_that_is_swung_in_the_air_is_not_felt_on_any_axis() {
    let mut experiment = experiment([true; 6], 0.0)
        .with_motion(&[(0.08, &[0.2, -0.1, 0.1, 0.3, -0.4, 0.5]), (0.08, &[-0.1, 0.2, 0.1, -0.6, 0.2, 0.1])]);
    experiment.scenario.surface = None;
    experiment.scenario.start.contact_time_s = None;
    let experiment = experiment.with_tool(3.0, [0.01, 0.0, -0.15], [0.3, -0.2, 0.7], [0.05, 0.03, -0.07]);
    for (axes, least) in [(0..3, 10.0), (3..6, 0.5)] {
        let run = experiment.run();
        let most = |value: &dyn Fn(&Instant, usize) -> f64| {
            let all = run.instants.iter().flat_map(|at| axes.clone().map(move |axis| value(at, axis).abs()));
            all.fold(0.0, f64::max)
        };
        let added = most(&|at, axis| 3.0 * at.tool_acceleration[axis]);
        let left = most(&|at, axis| at.report.wrench[axis]);
        println!("axes {axes:?}: {left} of {added} N or N m are left");
        assert!(added > least && left < 0.01 * added, "axes {axes:?}: {left} of {added}");
    }
}
