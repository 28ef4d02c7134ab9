//! A heavy tool on a sensor at the flange, which feels what accelerates it: 3 kg, brought to speed
//! and stopped by a surface. Told of it, the daemon sees what presses; told of its weight alone, it
//! took the approach for a touch, and the touch for a pull.

use admittance_host::robot_description::VelocityLoopDescription;
use admittance_runner::config::ContactPointName;
use end_to_end::closed_loop::{Experiment, NORMAL, Run};
use ipc_types::{Mode, StopReason};

const MASS_KG: f64 = 3.0;
/// f_max in N, and what the linear model may miss of it.
const MOST: f64 = 200.0 + 0.5;

/// The paper's contact with the tool; the arm lies, its weight does not matter.
fn experiment(sampling_time: f64, speed: f64) -> Experiment {
    let (origin_m, center_m) = ([-0.15, 0.0, 0.0], [-0.06, 0.02, 0.0]);
    Experiment::paper(sampling_time, speed).with_tool(MASS_KG, origin_m, [0.0, 0.0, 0.7], center_m)
}

/// Whether an axis was taken to be in contact before the tool touched.
fn is_early(run: &Run) -> bool {
    let touch = run.instants.iter().position(|at| at.truth.in_contact == 1).unwrap_or(run.instants.len());
    run.instants[..touch]
        .iter()
        .any(|at| at.command.active_axes != 0 || !(at.is_in(Mode::Free) || at.is_in(Mode::Idle)))
}

#[test]
fn a_heavy_tool_touches_and_presses_as_without_its_inertia() {
    for (sampling_time, speed) in [(0.004, 0.1), (0.004, 0.25), (0.001, 0.25), (0.001, 0.5)] {
        let mut unaware = 0;
        experiment(sampling_time, speed).at_instants(8, |share, run| {
            let what = format!("{speed} m/s at {sampling_time} s, contact at {share}");
            println!("{what}: peak {:.1} N, settled {:.2} N", run.peak(1), run.settled_normal());
            assert!(!is_early(run), "{what}: a touch is felt in the air");
            assert_eq!((run.stop_reason(), run.losses(), run.infeasible()), (None, 0, 0), "{what}");
            assert!(run.peak(1) <= MOST, "{what}: peak {} N", run.peak(1));
            assert!((run.settled_normal() - 14.2).abs() < 1.0, "{what}: settled at {} N", run.settled_normal());
        });
        // What the daemon knew before: the weight, which does not act in the arm's plane.
        let mut told_nothing = experiment(sampling_time, speed);
        told_nothing.config.wrench.tool_mass_kg = 0.0;
        told_nothing.at_instants(8, |_, run| {
            unaware += u32::from(is_early(run) || run.stop_reason().is_some() || run.losses() > 0);
        });
        println!("{unaware} of 8 without compensation touch too early, stop or lose contact");
        assert!(unaware >= 6, "{unaware} of 8 at {speed} m/s and {sampling_time} s");
    }
}

#[test]
fn a_heavy_tool_that_halts_on_its_way_is_neither_a_touch_nor_a_pull() {
    for (sampling_time, lag) in [(0.004, 0.02), (0.001, 0.02), (0.004, 0.005), (0.004, 0.0)] {
        // Where the sensor shows a jump of the acceleration at once, half a cycle of it is left.
        let speed = if lag > 0.0 { 0.25 } else { 0.1 };
        let down = [0.0, -speed];
        let experiment = experiment(sampling_time, speed).with_wrench_lag(lag);
        experiment.with_motion(&[(0.1, &down), (0.04, &[0.0, 0.0]), (0.8, &down)]).at_instants(4, |share, run| {
            let what = format!("{sampling_time} s, T_est {lag} s, contact at {share}");
            assert!(run.touched() && !is_early(run), "{what}: a touch is felt in the air");
            assert_eq!((run.stop_reason(), run.losses()), (None, 0), "{what}");
            assert!(run.peak(1) <= MOST, "{what}: peak {} N", run.peak(1));
        });
    }
}

#[test]
fn a_velocity_that_is_reported_late_feigns_no_force_above_the_limit() {
    // The arm brakes by some 200 m/s² and a cycle later than it was told; q̇ comes 2 ms late.
    let (origin_m, center_m) = ([-0.15, 0.0, 0.0], [-0.08, 0.0, 0.0]);
    for speed in [0.25, 0.3, 0.35] {
        let mut late = Experiment::paper(0.001, speed).with_tool(2.0, origin_m, [0.0; 3], center_m);
        late.config.control.lag_tolerance_s = 0.005;
        late.scenario.robot.velocity_loop =
            Some(VelocityLoopDescription { damping: None, dead_time_s: None, report_lag_s: 0.002 });
        late.scenario.timing.command_delay_s = 0.0015;
        late.at_instants(8, |share, run| {
            println!("{speed} m/s, contact at {share}: peak {:.1} N, stop {:?}", run.peak(1), run.stop_reason());
            assert_eq!(run.stop_reason(), None, "{speed} m/s, contact at {share}");
            assert!(run.peak(1) <= MOST, "{speed} m/s, contact at {share}: peak {} N", run.peak(1));
        });
    }
}

/// A stop for a pull asks the joint positions as well, since q̇ that is reported late misses the tool's inertia: a real one is found all
/// the same, a cycle later than without the tool at most.
#[test]
fn a_surface_that_pulls_is_found_with_a_heavy_tool_too() {
    for (sampling_time, speed) in [(0.004, 0.05), (0.001, 0.05), (0.001, 0.1)] {
        let stopped_s = |mut experiment: Experiment| {
            // The believed surface faces the other way.
            experiment.config.environment.surface_normal =
                experiment.config.environment.surface_normal.map(|part| -part);
            (experiment.config.stopping.mismatch_n, experiment.config.stopping.force_guard_n) = (None, None);
            experiment.scenario.robot.velocity_loop =
                Some(VelocityLoopDescription { damping: None, dead_time_s: None, report_lag_s: 0.002 });
            let mut after_touch = Vec::new();
            experiment.at_instants(8, |share, run| {
                let what = format!("{speed} m/s at {sampling_time} s, contact at {share}");
                assert_eq!(run.stop_reason(), Some(StopReason::ModelDisagrees.code()), "{what}");
                let stopping =
                    run.instants.iter().find(|at| at.command.stop_reason != StopReason::NONE).expect("it stops");
                let touched = run.instants.iter().find(|at| at.truth.peak_wrench != [0.0; 6]).expect("it touches");
                after_touch.push(stopping.time() - touched.time());
            });
            after_touch
        };
        let (with_tool, without) =
            (stopped_s(experiment(sampling_time, speed)), stopped_s(Experiment::paper(sampling_time, speed)));
        println!(
            "{speed} m/s at {sampling_time} s: stopped after {with_tool:.4?} s, without the tool after {without:.4?} s"
        );
        for (with_tool, without) in with_tool.into_iter().zip(without) {
            assert!(with_tool <= without + 1.01 * sampling_time, "{with_tool} s, without the tool {without} s");
        }
    }
}

/// What is held of a surface follows f̂ less, the more the positions differ from q̇: still enough where it is a degree off, up or down.
#[test]
fn a_surface_is_followed_with_a_heavy_tool_and_a_coarse_encoder() {
    let [x, y] = NORMAL;
    for (sampling_time, side) in [(0.001, 1.0), (0.001, -1.0), (0.004, 1.0), (0.004, -1.0)] {
        let settled = |noise_rad: f64| {
            let along = [side * 0.1 * y, -side * 0.1 * x];
            let mut slide = experiment(sampling_time, 0.1).with_motion(&[(0.25, &[-0.1 * x, -0.1 * y]), (1.0, &along)]);
            let environment = &mut slide.config.environment;
            environment.stiffness_range_n_m = Some([3e4, 3e5]);
            (environment.contact, environment.contact_point_m) = (ContactPointName::Detected, None);
            environment.wrench_noise_n = 0.5;
            slide.config.contact.normal_force_reference_n = 20.0;
            (slide.scenario.noise.wrench, slide.scenario.noise.joint_position_rad) = (0.5, noise_rad);
            let (sin, cos) = 1.0_f64.to_radians().sin_cos();
            slide.scenario.surface.as_mut().expect("a surface").normal = [cos * x + sin * y, cos * y - sin * x, 0.0];
            let run = slide.run();
            let what = format!("{sampling_time} s, to {side}, positions with {noise_rad} rad of noise");
            println!("{what}: {:.2} N, {} losses, stop {:?}", run.settled_normal(), run.losses(), run.stop_reason());
            assert_eq!((run.stop_reason(), run.losses()), (None, 0), "{what}");
            assert!(run.peak(1) <= MOST, "{what}: peak {} N", run.peak(1));
            run.settled_normal()
        };
        // 20 N are asked for. At 1e-4 rad the depth itself is known within 0.07 mm, which is 7 N here.
        let off = |settled: f64| (settled - 20.0).abs();
        let exact = settled(0.0);
        assert!(off(exact) < 1.5, "{exact} N at {sampling_time} s, to {side}");
        for (noise_rad, more) in [(1e-5, 0.5), (1e-4, 2.0)] {
            let coarse = settled(noise_rad);
            assert!(off(coarse) < off(exact) + more, "{coarse} N with {noise_rad} rad, {exact} N without");
        }
    }
}
