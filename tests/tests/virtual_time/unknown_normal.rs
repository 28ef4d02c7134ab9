//! A surface whose normal is told with a tolerance, in virtual time: the tool slides over it as if
//! the normal had been told, plane or cylinder, with friction and without.

use admittance_runner::config::ContactPointName;
use end_to_end::closed_loop::{Experiment, Instant, NORMAL, Run};
use ipc_types::StopReason;

const SIX_JOINT: &str = include_str!("../../../deploy/robots/six-joint.toml");
const SIX_JOINT_SCENARIO: &str = include_str!("../../../plant-sim/scenarios/six-joint.toml");

/// How fast the tool approaches, and then slides, m/s; the phases of the motion in s.
const SPEED: f64 = 0.1;
const APPROACH_S: f64 = 0.25;
const SLIDE_S: f64 = 1.0;
/// From when on the force has settled, s.
const SETTLED_S: f64 = 0.6;
/// The force that is asked for along the told normal, N.
const ASKED_N: f64 = 20.0;

/// What the surface is and nobody told.
#[derive(Debug, Clone, Copy)]
struct Surface {
    tilt_deg: f64,
    curvature_1_m: f64,
    friction: f64,
}

/// An approach along the told normal, and a slide along the surface as it was told, towards +x or −x.
fn slide(surface: Surface, sampling_time: f64, side: f64) -> Experiment {
    let [x, y] = NORMAL;
    let along = [side * SPEED * y, -side * SPEED * x];
    let mut experiment = Experiment::paper(sampling_time, SPEED)
        .with_motion(&[(APPROACH_S, &[-SPEED * x, -SPEED * y]), (SLIDE_S, &along)]);
    let environment = &mut experiment.config.environment;
    environment.stiffness_range_n_m = Some([3e4, 3e5]);
    (environment.contact, environment.contact_point_m) = (ContactPointName::Detected, None);
    (environment.normal_tolerance_rad, environment.wrench_noise_n) = (10f64.to_radians(), 0.5);
    experiment.config.contact.normal_force_reference_n = ASKED_N;
    experiment.config.mpc.inputs_per_cycle = Some(if sampling_time > 0.002 { 8 } else { 2 });
    experiment.scenario.noise.wrench = 0.5;
    let (sin, cos) = surface.tilt_deg.to_radians().sin_cos();
    let is = experiment.scenario.surface.as_mut().expect("a surface");
    is.normal = [cos * x + sin * y, cos * y - sin * x, 0.0];
    (is.curvature_1_m, is.friction) = (surface.curvature_1_m, surface.friction);
    experiment
}

/// Six joints on a table that is tilted along and across their path, which is along x.
fn six_joints_slide(along_deg: f64, across_deg: f64, friction: f64) {
    let mut experiment = Experiment::new(SIX_JOINT, SIX_JOINT_SCENARIO, 0.001)
        .with_motion(&[(APPROACH_S, &[0.0, 0.0, -SPEED, 0.0, 0.0, 0.0]), (SLIDE_S, &[SPEED, 0.0, 0.0, 0.0, 0.0, 0.0])]);
    let environment = &mut experiment.config.environment;
    environment.stiffness_range_n_m = Some([3e4, 3e5]);
    (environment.contact, environment.contact_point_m) = (ContactPointName::Detected, None);
    (environment.normal_tolerance_rad, environment.wrench_noise_n) = (10f64.to_radians(), 0.5);
    experiment.config.contact.normal_force_reference_n = ASKED_N;
    experiment.scenario.noise.wrench = 0.5;
    let surface = experiment.scenario.surface.as_mut().expect("a surface");
    surface.normal = [along_deg.to_radians().tan(), across_deg.to_radians().tan(), 1.0];
    surface.friction = friction;
    let run = experiment.run();
    let what = format!("{along_deg}, {across_deg} degrees, friction {friction}");
    let last = run.instants.last().expect("a run");
    let surface = experiment.scenario.surface.as_ref().expect("a surface");
    let length = surface.normal.iter().map(|part| part * part).sum::<f64>().sqrt();
    let error = (0..3).map(|axis| (last.normal[axis] - surface.normal[axis] / length).abs()).fold(0.0, f64::max);
    let (losses, force) = (last.truth.contact_losses, last.truth.normal_force_n);
    println!("{what}: {losses} losses, {force:.2} N, the normal known within {error:.4} rad");
    assert_eq!(last.command.stop_reason, StopReason::NONE, "{what}");
    assert_eq!((losses, last.truth.in_contact), (0, 1), "{what}");
    assert!((force - ASKED_N).abs() <= 1.0, "{what}: {force} N");
    assert!(error < 0.005, "{what}: {error} rad");
}

/// The outward normal where the tool is.
fn normal_at(experiment: &Experiment, position: [f64; 3]) -> [f64; 2] {
    let surface = experiment.scenario.surface.as_ref().expect("a surface");
    let bent = |axis: usize| surface.normal[axis] + surface.curvature_1_m * (position[axis] - surface.point_m[axis]);
    let length = bent(0).hypot(bent(1));
    [bent(0) / length, bent(1) / length]
}

/// Neither chatter nor a stop; the force as it is asked, and the speed along the true surface.
fn slides_as_told(what: &str, experiment: &Experiment) {
    let run: Run = experiment.run();
    let last = run.instants.last().expect("a run");
    let settles = |at: &&Instant| at.time() > SETTLED_S && at.state.twist_reference[0] != 0.0;
    let settled: Vec<_> = run.instants.iter().filter(settles).collect();
    let forces = || settled.iter().map(|at| at.truth.normal_force_n);
    let (least, most) = (forces().fold(f64::INFINITY, f64::min), forces().fold(0.0, f64::max));
    let mean = forces().sum::<f64>() / settled.len() as f64;
    let along = |at: &[f64], n: [f64; 2]| n[1] * at[0] - n[0] * at[1];
    let part = settled.iter().map(|at| {
        let normal = normal_at(experiment, at.truth.tcp_position);
        along(&at.truth.tcp_twist, normal) / along(&at.state.twist_reference, normal)
    });
    let (slowest, fastest) =
        part.fold((f64::INFINITY, 0.0), |(least, most): (f64, f64), x| (least.min(x), most.max(x)));
    println!(
        "{what}: {} losses, force {least:.1} to {most:.1} N, mean {mean:.2}; speed {slowest:.3} to {fastest:.3}; {:?}",
        last.truth.contact_losses, last.command.stop_reason
    );
    assert_eq!(last.command.stop_reason, StopReason::NONE, "{what}");
    assert_eq!((last.truth.contact_losses, last.truth.in_contact), (0, 1), "{what}");
    assert!((mean - ASKED_N).abs() <= 1.0, "{what}: {mean} N");
    assert!(least > 0.5 * ASKED_N && most < 1.5 * ASKED_N, "{what}: {least} to {most} N");
    assert!(slowest > 0.97 && fastest < 1.03, "{what}: {slowest} to {fastest}");
}

#[test]
fn ten_degrees_of_tilt_are_learned() {
    for sampling_time in [0.001, 0.004] {
        for tilt_deg in [-10.0, -5.0, 0.5, 10.0] {
            for (friction, side) in [(0.0, 1.0), (0.5, 1.0), (0.5, -1.0)] {
                let surface = Surface { tilt_deg, curvature_1_m: 0.0, friction };
                let what = format!("{} ms, {surface:?}, {side}", sampling_time * 1e3);
                slides_as_told(&what, &slide(surface, sampling_time, side));
            }
        }
    }
}

#[test]
fn a_cylinder_is_followed() {
    for sampling_time in [0.001, 0.004] {
        for curvature_1_m in [5.0, -5.0] {
            for friction in [0.0, 0.5] {
                let surface = Surface { tilt_deg: 0.0, curvature_1_m, friction };
                let what = format!("{} ms, {surface:?}", sampling_time * 1e3);
                slides_as_told(&what, &slide(surface, sampling_time, 1.0));
            }
        }
    }
}

#[test]
fn six_joints_learn_a_tilt_across_their_path_as_well() {
    for (along_deg, across_deg) in [(10.0, 0.0), (0.0, 8.0), (-6.0, -6.0)] {
        for friction in [0.0, 0.5] {
            six_joints_slide(along_deg, across_deg, friction);
        }
    }
}

/// 10 cm from the point that is told the surface is 18 mm deeper, or less deep: far beyond the tolerance of
/// the point, and within what a tilt makes of it. It was not believed in, and nothing bounded the force.
#[test]
fn a_point_told_with_a_tolerance_is_one_of_a_tilted_surface() {
    for tilt_deg in [-10.0, 10.0] {
        for away in [-0.1, 0.1] {
            let surface = Surface { tilt_deg, curvature_1_m: 0.0, friction: 0.3 };
            let mut experiment = slide(surface, 0.001, 1.0);
            let is = experiment.scenario.surface.as_ref().expect("a surface");
            let ([x, y], [at_x, at_y, _]) = (NORMAL, is.point_m);
            // On the surface as it is, so that the point itself is right.
            let told = [at_x + away * is.normal[1], at_y - away * is.normal[0], 0.0];
            let off = (told[0] - at_x) * x + (told[1] - at_y) * y;
            assert!(off.abs() > 0.017, "{off} m");
            let environment = &mut experiment.config.environment;
            (environment.contact, environment.contact_point_m) = (ContactPointName::Configured, Some(told));
            environment.contact_tolerance_m = Some(0.001);
            slides_as_told(&format!("{surface:?}, told {away} m away"), &experiment);
        }
    }
}

#[test]
fn a_normal_is_remembered_for_a_second() {
    let [x, y] = NORMAL;
    let mut experiment = slide(Surface { tilt_deg: 8.0, curvature_1_m: 0.0, friction: 0.3 }, 0.001, 1.0);
    let away = [0.1 * x, 0.1 * y];
    let motion: [(f64, &[f64]); 4] =
        [(APPROACH_S, &[-SPEED * x, -SPEED * y]), (0.3, &[SPEED * y, -SPEED * x]), (0.2, &away), (1.3, &[0.0, 0.0])];
    experiment = experiment.with_motion(&motion);
    let run = experiment.run();
    let told = [x, y, 0.0];
    let tilt = |at: &Instant| (0..3).map(|axis| (at.normal[axis] - told[axis]).powi(2)).sum::<f64>().sqrt();
    let last = run.instants.iter().rposition(|at| at.truth.in_contact == 1).expect("a contact");
    let after = |seconds: f64| &run.instants[last + (seconds * 1000.0) as usize];
    assert!((tilt(after(0.5)) - 8.0_f64.to_radians()).abs() < 0.01, "{}", tilt(after(0.5)));
    assert!(tilt(after(1.2)) < 1e-12, "{}", tilt(after(1.2)));
    // What is left of it is the spring along the normal that holds.
    assert!(run.instants.iter().all(|at| at.stiffness.is_finite() && at.stiffness > 2.9e4));
}
