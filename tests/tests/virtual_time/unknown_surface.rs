//! A surface of which only a range of stiffness is told, in virtual time: whatever it is, the limit
//! and the contact are kept, and it becomes known.

use admittance_host::robot_description::VelocityLoopDescription;
use admittance_runner::config::ContactPointName;
use end_to_end::closed_loop::{Experiment, MPC_DEFAULT, NORMAL};
use ipc_types::{StopReason, Verdict};
use plant_sim::environment::StiffnessStepSection;

const SIX_JOINT: &str = include_str!("../../../deploy/robots/six-joint.toml");
const SIX_JOINT_SCENARIO: &str = include_str!("../../../plant-sim/scenarios/six-joint.toml");
const RANGE: [f64; 2] = [1e4, 5e5];

/// With a surface of this stiffness, of which this range is told, and noise (N), told as well.
fn unknown(mut experiment: Experiment, range: [f64; 2], stiffness: f64, noise: f64) -> Experiment {
    let environment = &mut experiment.config.environment;
    environment.stiffness_range_n_m = Some(range);
    environment.normal_stiffness_n_m = (range[0] * range[1]).sqrt();
    (environment.contact, environment.contact_point_m) = (ContactPointName::Detected, None);
    environment.wrench_noise_n = noise;
    experiment.scenario.noise.wrench = noise;
    experiment.scenario.surface.as_mut().expect("a surface").stiffness_n_m = stiffness;
    experiment
}

/// Runs a touch: the limit and the contact are kept, and the surface is known at the end.
fn is_kept_and_known(what: &str, experiment: &Experiment, stiffness: f64, limit: f64) {
    let run = experiment.run();
    let peak = run.instants.iter().map(|at| at.truth.peak_normal_force_n).fold(0.0, f64::max);
    let last = run.instants.last().expect("a run");
    let known = last.stiffness / stiffness;
    println!("{what}, {stiffness:.0} N/m: peak {peak:.1} N, k {known:.3}, {} losses", last.truth.contact_losses);
    assert_eq!(last.command.stop_reason, StopReason::NONE, "{what}, {stiffness} N/m");
    assert_eq!((last.truth.contact_losses, last.truth.in_contact), (0, 1), "{what}, {stiffness} N/m");
    assert!(peak <= 1.005 * limit, "{what}, {stiffness} N/m: {peak} N");
    assert!((known - 1.0).abs() < 0.2, "{what}, {stiffness} N/m: {known}");
}

#[test]
fn the_limit_is_kept_whatever_the_surface_is() {
    for (sampling_time, inputs) in [(0.004, 8), (0.001, 2)] {
        for (stiffness, speed) in [(1.5e4, 0.3), (1e5, 0.2), (4e5, 0.06)] {
            for noise in [0.0, 0.5] {
                let mut experiment = unknown(Experiment::paper(sampling_time, speed), RANGE, stiffness, noise);
                experiment.config.mpc.inputs_per_cycle = Some(inputs);
                let what = format!("{} ms, {noise} N of noise", sampling_time * 1e3);
                is_kept_and_known(&what, &experiment, stiffness, 200.0 / NORMAL[1]);
            }
        }
    }
}

#[test]
fn a_contact_point_may_be_told_with_a_tolerance() {
    for error in [-0.9e-3, 0.0, 0.9e-3] {
        for stiffness in [3e4, 2e5] {
            let mut experiment = unknown(Experiment::paper(0.001, 0.1), RANGE, stiffness, 0.5);
            let environment = &mut experiment.config.environment;
            environment.contact = ContactPointName::Configured;
            environment.contact_point_m = Some([1.32 + error * NORMAL[0], 0.68 + error * NORMAL[1], 0.0]);
            environment.contact_tolerance_m = Some(1e-3);
            is_kept_and_known(&format!("told {} mm off", error * 1e3), &experiment, stiffness, 200.0 / NORMAL[1]);
        }
    }
}

/// Told 1 mm, wrong by 4 mm to both sides: where nothing is told to begin a surface is found all the same.
#[test]
fn a_contact_point_outside_its_tolerance_is_found() {
    for error in [-4e-3, 4e-3] {
        for (stiffness, speed) in [(3e4, 0.2), (4e5, 0.05)] {
            let mut experiment = unknown(Experiment::paper(0.001, speed), RANGE, stiffness, 0.5);
            let environment = &mut experiment.config.environment;
            environment.contact = ContactPointName::Configured;
            environment.contact_point_m = Some([1.32 + error * NORMAL[0], 0.68 + error * NORMAL[1], 0.0]);
            environment.contact_tolerance_m = Some(1e-3);
            is_kept_and_known(&format!("{} mm off", error * 1e3), &experiment, stiffness, 200.0 / NORMAL[1]);
        }
    }
}

/// Eight inputs that reach six joints at six instants each are more pieces of the way than it has room for.
#[test]
fn a_way_of_many_pieces_is_followed() {
    let mut experiment = unknown(Experiment::new(SIX_JOINT, SIX_JOINT_SCENARIO, 0.004), RANGE, 1e5, 0.5);
    let dead_time_s = Some((0..6).map(|joint| 9e-5 * f64::from(joint)).collect());
    let loops = VelocityLoopDescription { damping: None, dead_time_s, report_lag_s: 0.0 };
    experiment.config.mpc.inputs_per_cycle = Some(8);
    experiment.config.robot.velocity_loop = Some(loops.clone());
    experiment.scenario.robot.velocity_loop = Some(loops);
    let limit = experiment.config.contact.force_limit[2];
    is_kept_and_known("48 pieces", &experiment, 1e5, limit);
}

#[test]
fn six_joints_as_well() {
    for (stiffness, noise) in [(2e4, 0.5), (1e5, 0.0), (1e5, 0.5), (3e5, 0.5)] {
        let mut experiment = unknown(Experiment::new(SIX_JOINT, SIX_JOINT_SCENARIO, 0.001), RANGE, stiffness, noise);
        experiment.config.mpc.inputs_per_cycle = Some(2);
        let limit = experiment.config.contact.force_limit[2];
        is_kept_and_known("six joints", &experiment, stiffness, limit);
    }
}

#[test]
fn a_surface_that_is_harder_than_told_is_a_stop() {
    let experiment = unknown(Experiment::paper(0.001, 0.1), [1e4, 3e4], 3e5, 0.5);
    let run = experiment.run();
    let last = run.instants.last().expect("a run");
    assert_eq!(last.command.stop_reason, StopReason::SurfaceOutsideRange.code());
    let peak = run.instants.iter().map(|at| at.truth.peak_normal_force_n).fold(0.0, f64::max);
    println!("peak {peak} N");
    assert!(last.truth.normal_force_n < 100.0 / NORMAL[1], "{} N", last.truth.normal_force_n);
}

/// Another material along the path that is harder than any that was told, and one that is within.
#[test]
fn a_surface_that_becomes_harder_than_told_is_a_stop() {
    for (behind, is_outside) in [(1.2e6, true), (2.4e5, false)] {
        let mut experiment = unknown(Experiment::paper(0.001, 0.1), [1e4, 3e5], 6e4, 0.5);
        experiment.scenario.surface.as_mut().expect("a surface").step = Some(StiffnessStepSection {
            direction: [NORMAL[1], -NORMAL[0], 0.0],
            at_m: 0.01,
            width_m: 0.002,
            stiffness_n_m: behind,
        });
        let run = experiment.run();
        let last = run.last();
        let told = format!("{behind} N/m: {}, peak {} N", last.command.stop_reason, run.peak_normal());
        println!("{told}, {} losses, k {}, rests at {} N", run.losses(), last.stiffness, last.truth.normal_force_n);
        let wanted = if is_outside { StopReason::SurfaceOutsideRange.code() } else { StopReason::NONE };
        assert_eq!(last.command.stop_reason, wanted, "{told}");
        assert!(last.truth.normal_force_n < 100.0 / NORMAL[1], "{told}");
    }
}

#[test]
fn a_range_of_length_zero_changes_no_bit() {
    let told = Experiment::new(MPC_DEFAULT, end_to_end::session::PAPER_SCENARIO, 0.004);
    let mut ranged = told.clone();
    let stiffness = ranged.config.environment.normal_stiffness_n_m;
    ranged.config.environment.stiffness_range_n_m = Some([stiffness, stiffness]);
    let commands = |experiment: &Experiment| -> Vec<_> {
        experiment
            .run()
            .instants
            .iter()
            .map(|at| (at.command.verdict_margin.to_bits(), at.command.planned_offset))
            .collect()
    };
    assert_eq!(commands(&told), commands(&ranged));
}

#[test]
fn a_verdict_at_risk_says_by_how_much() {
    let run = unknown(Experiment::paper(0.001, 0.6), RANGE, 1e5, 0.5).run();
    let at_risk: Vec<_> = run.instants.iter().filter(|at| at.command.verdict == Verdict::AtRisk.code()).collect();
    assert!(!at_risk.is_empty() && at_risk.iter().all(|at| at.command.verdict_margin < 0.0));
}

#[test]
fn a_contact_that_no_surface_of_the_set_lets_keep_is_infeasible() {
    let run = unknown(Experiment::paper(0.004, 0.6), [1e5, 5e5], 4e5, 0.5).run();
    let (last, verdicts) = (run.last(), run.infeasible());
    println!("{verdicts} infeasible, {} N at most, rests at {} N", run.peak_normal(), last.truth.normal_force_n);
    assert!(verdicts > 0);
    assert_eq!(last.command.stop_reason, StopReason::Infeasible.code());
    assert!(last.is_in(ipc_types::Mode::Stopped) && last.truth.normal_force_n < 100.0 / NORMAL[1]);
}
