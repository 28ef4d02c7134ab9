//! Task frames on a six-joint arm: which direction gives way, that a frame is only a point of view, and
//! the tool's, which turns.

use admittance_runner::config::FrameName;
use admittance_runner::cycle::{self, Cycle};
use end_to_end::closed_loop::{Experiment, Instant, Run};
use ipc_types::StateSample;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::straight_line::{off_the_line, sideways_offset};
use super::turned_world::{difference, rotation, turned, turned_world, vector};

const CONFIG: &str = include_str!("../../../deploy/robots/six-joint.toml");
const SCENARIO: &str = include_str!("../../../plant-sim/scenarios/six-joint.toml");
/// f_max on every linear direction in N, and what the linear model may miss of it.
const MOST: f64 = 150.0 + 0.5;
/// f_min on z, N.
const LEAST: f64 = 6.0;
const ONE_DIRECTION: [bool; 6] = [false, false, true, false, false, false];
/// A frame along nothing in particular.
const RPY: [f64; 3] = [0.4, -0.7, 1.1];

/// As shipped, at 1 kHz, with this frame; these directions of it give way.
fn experiment(frame: FrameName, gives_way: [bool; 6]) -> Experiment {
    let mut experiment = Experiment::new(CONFIG, SCENARIO, 0.001);
    experiment.config.task.frame = frame;
    experiment.config.contact.admittance_axes = gives_way.to_vec();
    experiment
}

/// How the tool stands at the touch.
fn tool() -> Matrix3<f64> {
    let mut free = experiment(FrameName::Base, ONE_DIRECTION).with_motion(&[(0.001, &[0.0; 6])]);
    free.scenario.start.contact_time_s = None;
    Rotation3::new(vector(&free.run().instants[0].truth.tcp_rotation)).into_inner()
}

/// The same with joints that are alike: where one is slower, a twist has sideways parts while it changes.
fn with_equal_joints(mut experiment: Experiment) -> Experiment {
    experiment.config.robot.velocity_time_constant_s.fill(0.01);
    experiment.scenario.robot.velocity_time_constant_s.fill(0.01);
    experiment
}

#[test]
fn only_the_direction_that_gives_way_leaves_its_path() {
    let along_tool = tool().column(2).into_owned();
    for (frame, normal) in [
        (FrameName::Surface, Vector3::new(0.25, -0.1, 1.0).normalize()),
        // 0.2 rad off the tool's axis: the plate pushes sideways too, and nothing gives way there.
        (FrameName::Tool, Rotation3::new(Vector3::new(0.12, 0.16, 0.0)) * -along_tool),
    ] {
        let inward = if frame == FrameName::Tool { along_tool } else { -normal };
        let twist = turned(&Matrix3::identity(), &[inward.x * 0.01, inward.y * 0.01, inward.z * 0.01, 0.0, 0.0, 0.0]);
        let experiment = with_equal_joints(experiment(frame, ONE_DIRECTION));
        let run = experiment.with_normal(normal.into()).with_motion(&[(0.6, &twist)]).run();
        assert!(run.touched(), "{frame}");
        assert_eq!((run.stop_reason(), run.infeasible(), run.losses(), run.limited()), (None, 0, 0, 0), "{frame}");
        assert!(run.peak_normal() <= MOST, "{frame}: peak {} N", run.peak_normal());
        let gives_way = run.instants.iter().map(|at| vector(&at.command.velocity_offset).dot(&inward).abs());
        let gives_way = gives_way.fold(0.0, f64::max);
        let sideways = sideways_offset(&run, |_| inward);
        let (way, turn) = off_the_line(&run, &inward);
        println!(
            "{frame}: peak {:.1} N, settled {:.2} N, gives way at {gives_way:.3} m/s, off the line by {way:.1e} m and \
             {turn:.1e} rad, sideways offset {sideways:.1e}",
            run.peak_normal(),
            run.settled_normal()
        );
        assert!(gives_way > 0.009, "{frame}: {gives_way} m/s");
        assert!(way < 1e-6 && turn < 1e-6, "{frame}: {way} m, {turn} rad");
    }
}

#[test]
fn a_world_that_is_turned_with_its_frame_is_the_same_world() {
    let (by, sensor) = (rotation(RPY), ([0.0, 0.0, -0.08], [0.0, 0.0, 0.8], [0.0, 0.01, -0.03]));
    for (mass_kg, gives_way) in [(0.0, ONE_DIRECTION), (0.0, [true; 6]), (1.5, [true, true, true, false, false, false])]
    {
        let mut plain = experiment(FrameName::Base, gives_way);
        if mass_kg > 0.0 {
            plain = plain.with_tool(mass_kg, sensor.0, sensor.1, sensor.2);
        }
        let mut other = turned_world(plain.clone(), &by);
        (other.config.task.frame, other.config.task.rpy_rad) = (FrameName::Rpy, RPY);
        let (plain, other) = (plain.run(), other.run());
        assert!(plain.touched() && plain.peak_normal() > 10.0);
        let (force, offset) = difference(&plain, &other, &by);
        println!("{gives_way:?}, {mass_kg} kg: forces differ by {force:.1e} N, offsets by {offset:.1e}");
        assert!(force < 1e-9 && offset < 1e-9, "{force} N, {offset}");
        for (one, other) in plain.instants.iter().zip(&other.instants) {
            for axis in 0..6 {
                assert!((one.report.wrench[axis] - other.report.wrench[axis]).abs() < 1e-9, "f̂ is in the frame");
            }
            let point = by.tr_mul(&vector(&other.contact_point));
            assert!((point - vector(&one.contact_point)).norm() < 1e-12, "the contact point is in the base frame");
        }
    }
}

#[test]
fn a_frame_that_is_turned_about_the_normal_changes_nothing() {
    // x and y have the same limits and weights, and feel nothing: which of them is which does not matter.
    let linear = [true, true, true, false, false, false];
    let plain = experiment(FrameName::Base, linear).run();
    let mut other = experiment(FrameName::Rpy, linear);
    other.config.task.rpy_rad = [0.0, 0.0, 0.7];
    let fixed = other.run();
    let (force, offset) = difference(&plain, &fixed, &Matrix3::identity());
    println!("about the normal: forces differ by {force:.1e} N, offsets by {offset:.1e}");
    assert!(plain.peak_normal() > 10.0 && force < 1e-9 && offset < 1e-9, "{force} N, {offset}");
    // Nor does a change of the frame, there and back, in the middle of the contact.
    let (base, mut cycles) = (experiment(FrameName::Base, linear), 0);
    let change = |cycle: &mut Box<dyn Cycle>, _: &StateSample| {
        cycles += 1;
        let config = match cycles {
            300 => &other.config,
            500 => &base.config,
            _ => return,
        };
        let mut new = cycle::build(config).expect("a known arm");
        assert!(new.take_over(cycle.as_ref()), "the same arm");
        *cycle = new;
    };
    let changed = base.run_replacing(change, |_, _| false);
    let (force, offset) = difference(&plain, &changed, &Matrix3::identity());
    println!("changed in contact: forces differ by {force:.1e} N, offsets by {offset:.1e}");
    assert!(force < 1e-9 && offset < 1e-9, "{force} N, {offset}");
}

#[test]
fn another_configuration_takes_a_turning_frame_over() {
    let linear = [true, true, true, false, false, false];
    let turning =
        |frame: FrameName| experiment(frame, linear).with_motion(&[(0.6, &[0.05, 0.0, -0.05, 0.3, 0.0, 0.0])]);
    let tool = turning(FrameName::Tool);
    let plain = tool.run();
    for (name, between) in [("the same", &tool), ("base", &turning(FrameName::Base))] {
        let mut cycles = 0;
        let change = |cycle: &mut Box<dyn Cycle>, _: &StateSample| {
            cycles += 1;
            let config = match cycles {
                300 => &between.config,
                400 => &tool.config,
                _ => return,
            };
            let mut new = cycle::build(config).expect("a known arm");
            assert!(new.take_over(cycle.as_ref()), "the same arm");
            *cycle = new;
        };
        let changed = tool.run_replacing(change, |_, _| false);
        let (force, offset) = difference(&plain, &changed, &Matrix3::identity());
        println!("{name}: forces differ by {force:.1e} N, offsets by {offset:.1e} m/s");
        assert_eq!((changed.stop_reason(), changed.losses()), (None, 0), "{name}");
        assert!(changed.peak_normal() <= MOST, "{name}: {} N", changed.peak_normal());
        // In the base frame other directions have the limits.
        assert!(name == "base" || (force < 1e-9 && offset < 1e-9), "{name}: {force} N, {offset}");
    }
}

/// Largest force in N between samples within so many s after the touch.
fn peak_within(run: &Run, after_s: f64) -> f64 {
    let impact = run.instants.iter().filter(|at| at.time() < 0.2 + after_s);
    impact.map(|at| at.truth.peak_normal_force_n).fold(0.0, f64::max)
}

#[test]
fn a_direction_that_leans_off_the_normal_keeps_its_least_force_and_its_limit() {
    for lean in [0.0, 0.15, 0.3, 0.45, 0.6] {
        let mut experiment =
            experiment(FrameName::Rpy, ONE_DIRECTION).with_motion(&[(1.5, &[0.0, 0.0, -0.05, 0.0, 0.0, 0.0])]);
        experiment.config.task.rpy_rad = [lean, 0.0, 0.0];
        let run = experiment.run();
        println!("{lean} rad: peak {:.1} N, settled {:.2} N", run.peak_normal(), run.settled_normal());
        assert_eq!((run.stop_reason(), run.losses(), run.infeasible()), (None, 0, 0), "{lean} rad");
        // f_min and f_max are of the direction: along the normal they are as much more as the direction leans.
        assert!((run.settled_normal() * lean.cos() - LEAST).abs() < 0.1, "{lean} rad: {} N", run.settled_normal());
        assert!(run.peak_normal() * lean.cos() <= MOST, "{lean} rad: {} N", run.peak_normal());
    }
}

/// The tool turns about its own x while it presses along the base frame's z, at this rate in rad/s.
fn rolling(frame: FrameName, rate: f64, gives_way: [bool; 6]) -> Run {
    let about = tool().column(0) * rate;
    let twist = [0.0, 0.0, -0.05, about.x, about.y, about.z];
    experiment(frame, gives_way).with_motion(&[(0.7, &twist)]).run()
}

#[test]
fn a_frame_that_turns_with_the_tool_keeps_the_limit() {
    for rate in [0.0, 0.3, 1.0] {
        let [tool, fixed] = [FrameName::Tool, FrameName::Surface].map(|frame| rolling(frame, rate, ONE_DIRECTION));
        for (name, run) in [("tool", &tool), ("surface", &fixed)] {
            println!(
                "{rate} rad/s, {name}: impact {:.2} N, peak {:.2} N, settled {:.2} N, infeasible {}, losses {}, stop {:?}",
                peak_within(run, 0.1),
                run.peak_normal(),
                run.settled_normal(),
                run.infeasible(),
                run.losses(),
                run.stop_reason()
            );
        }
        let lean = |at: &Instant| {
            let along = Rotation3::new(vector(&at.truth.tcp_rotation)) * Vector3::z();
            along.z.abs().min(1.0).acos()
        };
        println!("{rate} rad/s: the tool leans {:.3} rad at the end", tool.settled(lean));
        assert!(tool.touched() && tool.peak_normal() <= MOST, "{rate} rad/s: peak {} N", tool.peak_normal());
        assert_eq!((tool.stop_reason(), tool.losses(), tool.infeasible()), (None, 0, 0), "{rate} rad/s");
        // The direction that gives way is the tool's of that sample.
        for at in tool.instants.iter().filter(|at| at.command.active_axes != 0) {
            let q = UnitQuaternion::from_scaled_axis(vector(&at.truth.tcp_rotation));
            let offset = q.inverse() * vector(&at.command.velocity_offset);
            assert!(offset.x.abs() < 1e-9 && offset.y.abs() < 1e-9, "{offset}");
        }
    }
}
