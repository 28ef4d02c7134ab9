//! Stops, retreat, reset and the next touch in a task frame: as in the base frame.

use admittance_runner::config::FrameName;
use admittance_runner::cycle::Cycle;
use end_to_end::closed_loop::{Experiment, Run};
use ipc_types::{Mode, Motion, StateSample, StopReason};

use super::turned_world::{difference, rotation, turned_world};

const CONFIG: &str = include_str!("../../../deploy/robots/six-joint.toml");
const SCENARIO: &str = include_str!("../../../plant-sim/scenarios/six-joint.toml");
const RPY: [f64; 3] = [0.4, -0.7, 1.1];
const LINEAR: [bool; 6] = [true, true, true, false, false, false];
/// f_max on every linear direction, and where a stop may rest, N.
const LIMIT: f64 = 150.0;
const STOP_FORCE: f64 = 75.0;
/// When the arm has retreated, s.
const RESET_S: f64 = 0.95;

/// Down until it stops, back, and down again slowly.
fn there_and_back(gives_way: [bool; 6], speed: f64) -> Experiment {
    let along = |z: f64| [0.0, 0.0, z, 0.0, 0.0, 0.0];
    let motion = [(0.5, along(-speed)), (0.5, along(0.04)), (1.0, along(-0.05))];
    let motion: Vec<(f64, &[f64])> = motion.iter().map(|(duration, twist)| (*duration, &twist[..])).collect();
    let mut experiment = Experiment::new(CONFIG, SCENARIO, 0.001).with_motion(&motion);
    experiment.config.contact.admittance_axes = gives_way.to_vec();
    experiment
}

/// Runs it; a person resets the stop once the arm has retreated.
fn run(experiment: &Experiment) -> Run {
    let mut cycles = 0;
    experiment.run_with(|cycle: &mut dyn Cycle, _: &StateSample| {
        cycles += 1;
        if cycles == (RESET_S * 1e3) as u32 {
            cycle.reset(false).unwrap_or_else(|why| panic!("{why:?} in {:?}", cycle.mode()));
        }
    })
}

/// What each stop is, and how it comes about.
fn cases() -> Vec<(StopReason, Experiment)> {
    let infeasible = |gives_way| there_and_back(gives_way, 0.45);
    let mut all = vec![
        (StopReason::Infeasible, infeasible(LINEAR)),
        (StopReason::Infeasible, infeasible([true; 6])),
        (StopReason::Infeasible, infeasible([false, false, true, false, false, false])),
    ];
    // Harder than told: the guards see it.
    let mut harder = there_and_back(LINEAR, 0.25);
    harder.scenario.surface.as_mut().expect("a surface").stiffness_n_m *= 6.0;
    all.push((StopReason::ForceExceeded, harder));
    all
}

#[test]
fn a_stop_a_retreat_and_a_reset_are_those_of_the_base_frame() {
    let by = rotation(RPY);
    for (reason, plain) in cases() {
        let mut other = turned_world(plain.clone(), &by);
        (other.config.task.frame, other.config.task.rpy_rad) = (FrameName::Rpy, RPY);
        let (plain, other) = (run(&plain), run(&other));
        assert_eq!(plain.stop_reason(), Some(reason.code()));
        let is_over = |run: &Run| run.last().is_in(Mode::Contact) || run.last().is_in(Mode::Free);
        assert!(is_over(&plain) && is_over(&other), "it touches again");
        let (force, offset) = difference(&plain, &other, &by);
        println!(
            "{reason:?}: peak {:.1} N, forces differ by {force:.1e} N, offsets by {offset:.1e}",
            plain.peak_normal()
        );
        // A force that settles comes to its bound to 1e-9 N, where rounding says in either world whether the solver counts the
        // row: 1e-7 m/s for a cycle, and 5e-6 N from then on.
        assert!(force < 1e-5 && offset < 1e-6, "{reason:?}: {force} N, {offset}");
        for (at, same) in plain.instants.iter().zip(&other.instants) {
            let of = |at: &end_to_end::closed_loop::Instant| {
                (at.command.mode, at.command.motion, at.command.verdict, at.command.stop_reason, at.command.active_axes)
            };
            assert_eq!(of(at), of(same), "{reason:?} at {} s", at.time());
        }
    }
}

/// In frames that no turned world is the same as: the tool's, and the surface's with a lean.
#[test]
fn a_stop_in_any_frame_rests_low_and_can_be_left() {
    for (reason, mut experiment) in cases() {
        for frame in [FrameName::Tool, FrameName::Surface] {
            experiment.config.task.frame = frame;
            let run = run(&experiment);
            let what = format!("{reason:?} in {frame}");
            assert_eq!(run.stop_reason(), Some(reason.code()), "{what}");
            let stopped = run.instants.iter().position(|at| at.is_in(Mode::Stopped)).expect("it comes to rest");
            let held = &run.instants[stopped..];
            let resting: f64 = held.iter().take(50).map(|at| at.truth.normal_force_n).fold(0.0, f64::max);
            assert!(resting <= STOP_FORCE + 0.5, "{what}: rests at {resting} N");
            assert_eq!(held[0].command.motion, Motion::Hold.code(), "{what}");
            let retreat = held.iter().find(|at| at.command.motion == Motion::Offset.code()).expect("it may retreat");
            let out = retreat.state.twist_reference[2] + retreat.command.velocity_offset[2];
            assert!(out > 0.0 && retreat.is_in(Mode::Stopped), "{what}: {out} m/s");
            let after = run.instants.iter().filter(|at| at.time() > RESET_S + 0.1);
            let peak = after.clone().map(|at| at.truth.peak_normal_force_n).fold(0.0, f64::max);
            let touches = after.filter(|at| at.is_in(Mode::Contact)).count();
            println!(
                "{what}: peak {:.1} N, rests at {resting:.1} N, touches again with {peak:.1} N",
                run.peak_normal()
            );
            assert!(touches > 100, "{what}: {touches} cycles in contact after the reset");
            assert!(peak <= LIMIT + 0.5 || reason == StopReason::ForceExceeded, "{what}: {peak} N");
        }
    }
}
