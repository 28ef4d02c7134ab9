//! Arms with masses that the steps of a scenario do not hold: said at the start where it can be known,
//! and a loud end where not.

mod common;

use std::process::Command;

use common::{SIX_JOINT_MASSES, command, run, scenario};
use ipc_types::VirtualPlant;
use plant_sim::rigid_body::{RigidBodySection, RigidJointSection, Unresolved};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;
use plant_sim::setup::SetupError;

fn masses(scenario: &mut Scenario) -> &mut RigidBodySection {
    scenario.rigid_body.as_mut().expect("masses")
}

fn refused(change: impl Fn(&mut Scenario)) -> (Unresolved, String) {
    let mut scenario = scenario(SIX_JOINT_MASSES);
    change(&mut scenario);
    match VirtualRun::new(&scenario) {
        Err(SetupError::Unresolved(why)) => (why, why.to_string()),
        other => panic!("not refused for its steps: {other:?}"),
    }
}

#[test]
fn a_hard_gear_without_damping_is_refused_and_runs_with_the_step_that_is_accepted() {
    let hard = |joint: &mut RigidJointSection| {
        (joint.gear_stiffness_n_m_rad, joint.gear_damping_n_m_s_rad) = (Some(1e6), 0.0);
    };
    let (why, text) = refused(|scenario| masses(scenario).joint.iter_mut().for_each(hard));
    let Unresolved::Gear { accepted_step_s, .. } = why else { panic!("{text}") };
    assert!(text.contains("gear_stiffness_n_m_rad = 1000000") && text.contains("timing.substep_s"), "{text}");
    // One joint alone: the textbook's two masses on a spring, ω² = k (1/m + 1/M), but for what the other
    // links add; the last link is light.
    let (why, text) = refused(|scenario| hard(&mut masses(scenario).joint[5]));
    let Unresolved::Gear { joint: 5, frequency_hz, .. } = why else { panic!("{text}") };
    let (rotor, link) = (2.5e-5 * 101.0 * 101.0, 0.003);
    let alone = (1e6f64 * (1.0 / rotor + 1.0 / link)).sqrt() / std::f64::consts::TAU;
    assert!((frequency_hz / alone - 1.0).abs() < 0.1, "{frequency_hz} Hz, alone {alone} Hz");
    let mut slow = scenario(SIX_JOINT_MASSES);
    masses(&mut slow).joint.iter_mut().for_each(hard);
    slow.timing.substep_s = accepted_step_s * 0.99;
    slow.motion[0].duration_s = 0.3;
    slow.start.contact_time_s = None;
    slow.surface = None;
    let truths = run(&slow, |_| vec![0.0; 6]);
    let fastest = truths.iter().flat_map(|truth| truth.joint_velocity).map(f64::abs).fold(0.0, f64::max);
    assert!(fastest < 1.0, "{fastest} rad/s");
}

#[test]
fn a_surface_a_damper_and_a_gain_that_the_step_does_not_hold_are_named() {
    let (why, text) = refused(|scenario| {
        scenario.surface.as_mut().expect("a surface").stiffness_n_m = 1e8;
    });
    assert!(matches!(why, Unresolved::Surface { .. }) && text.contains("surface.stiffness_n_m"), "{text}");
    let (why, text) = refused(|scenario| masses(scenario).joint[3].gear_damping_n_m_s_rad = 4000.0);
    let Unresolved::Damper { joint: 3, accepted, .. } = why else { panic!("{text}") };
    assert!(accepted < 4000.0 && text.contains("joint[3].gear_damping_n_m_s_rad = 4000"), "{text}");
    let (why, text) = refused(|scenario| {
        let wrist = &mut masses(scenario).joint[5];
        (wrist.gear_stiffness_n_m_rad, wrist.rotor_inertia_kg_m2) = (None, 0.0);
        wrist.speed_gain_n_m_s_rad = 200.0;
    });
    let Unresolved::Gain { joint: 5, accepted, .. } = why else { panic!("{text}") };
    // Its link alone: 0.003 kg m² in a tick of 0.125 ms, of which the integral part is 1/160.
    assert!((accepted / (0.003 / 125e-6 / (1.0 + 1.0 / 160.0)) - 1.0).abs() < 0.1, "{text}");
}

/// Friction and damping of the surface are part of the step: a light arm on them does not chatter.
#[test]
fn a_rough_and_damped_surface_holds_a_light_arm() {
    for joint_mass_kg in [0.05, 2.0] {
        let mut rough = scenario(SIX_JOINT_MASSES);
        for joint in &mut masses(&mut rough).joint {
            joint.mass_kg = joint.mass_kg.min(joint_mass_kg);
        }
        let surface = rough.surface.as_mut().expect("a surface");
        (surface.stiffness_n_m, surface.damping_n_s_m, surface.friction) = (1e4, 2e4, 0.5);
        let truths = run(&rough, |_| vec![0.0; 6]);
        let speed = |truth: &ipc_types::TruthSample| truth.tcp_twist.iter().take(3).map(|v| v * v).sum::<f64>().sqrt();
        let fastest = truths.iter().map(speed).fold(0.0, f64::max);
        assert!(fastest < 0.3, "the tool is at {fastest} m/s of 0.14 m/s that are asked for");
        assert!(truths.last().expect("a run").in_contact == 1);
    }
}

#[test]
fn a_drive_that_cannot_hold_its_arm_is_named() {
    let mut weak = scenario(SIX_JOINT_MASSES);
    assert!(VirtualRun::new(&weak).expect("runs").overloads().is_empty());
    masses(&mut weak).joint[1].torque_limit_n_m = Some(10.0);
    // Where it sinks it does not meet a surface as it should.
    let refused = VirtualRun::new(&weak).expect_err("no start").to_string();
    assert!(refused.contains("rigid_body.joint[1].torque_limit_n_m = 10"), "{refused}");
    weak.surface = None;
    weak.start.contact_time_s = None;
    let run = VirtualRun::new(&weak).expect("it runs, and sinks");
    let [overload] = run.overloads() else { panic!("{:?}", run.overloads()) };
    assert_eq!((overload.joint, overload.limit), (1, 10.0));
    let text = overload.to_string();
    assert!(text.contains("rigid_body.joint[1].torque_limit_n_m = 10") && text.contains("N m there"), "{text}");
}

#[test]
fn an_arm_that_starts_in_contact_starts_in_balance() {
    let mut pressing = scenario(SIX_JOINT_MASSES);
    let truths = run(&pressing, |_| vec![0.0; 6]);
    let touch = truths.iter().find(|truth| truth.in_contact == 1).expect("a touch");
    // 1 mm deep, at rest: 100 N.
    pressing.start.joint_position_rad = touch.joint_position[..6].to_vec();
    pressing.start.contact_time_s = None;
    pressing.motion[0].twist = vec![0.0; 6];
    pressing.surface.as_mut().expect("a surface").point_m = touch.tcp_position;
    pressing.surface.as_mut().expect("a surface").point_m[2] += 0.001;
    let truths = run(&pressing, |_| vec![0.0; 6]);
    for truth in &truths {
        assert!(
            (truth.normal_force_n - 100.0).abs() < 0.5,
            "{} N at {} s",
            truth.normal_force_n,
            truth.scenario_time_s
        );
    }
}

/// The shipped file with drives whose ticks are too slow for their gears' swings, which they feed: the
/// steps are fine, the drives are not.
fn bursting() -> String {
    let (surface, wrench) = ("[surface]", "[wrench]");
    let from = SIX_JOINT_MASSES.find(surface).expect("a surface");
    let to = SIX_JOINT_MASSES.find(wrench).expect("a wrench");
    let without_surface = format!("{}{}", &SIX_JOINT_MASSES[..from], &SIX_JOINT_MASSES[to..]);
    let line = |line: &str| match line.split(" = ").next().unwrap_or_default() {
        "contact_time_s"
        | "contact_phase"
        | "gear_damping_n_m_s_rad"
        | "viscous_friction_n_m_s_rad"
        | "coulomb_friction_n_m"
        | "breakaway_friction_n_m"
        | "torque_limit_n_m"
        | "encoder_counts" => String::new(),
        "rate_hz" => "rate_hz = 500.0".to_owned(),
        "substep_s" => "substep_s = 1e-4".to_owned(),
        "settle_s" => "settle_s = 20.0".to_owned(),
        // Of the shoulder: it swings at some 1000 rad/s, half a turn of which a drive sees late.
        "gear_stiffness_n_m_rad" => line.replace("40000.0", "1.9e6"),
        "speed_gain_n_m_s_rad" => line.replace("400.0", "700.0").replace("150.0", "100.0"),
        _ => line.to_owned(),
    };
    without_surface.lines().map(line).collect::<Vec<_>>().join("\n")
}

#[test]
fn a_motion_that_is_no_longer_finite_ends_the_run() {
    let mut run = VirtualRun::new(&scenario(&bursting())).expect("can be set up");
    let mut why = None;
    while why.is_none() && !run.is_finished() {
        let answer = run.sample().map(|state| command(state, &[0.0; 6]));
        why = run.advance(answer.as_ref()).err();
    }
    let why = why.expect("it bursts");
    assert!(why.contains("no longer finite") && why.contains("joint") && why.contains("rad/s"), "{why}");
}

#[test]
fn a_motion_that_is_no_longer_finite_ends_the_program() {
    let directory = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("burst-{}", std::process::id()));
    std::fs::create_dir_all(&directory).expect("a directory");
    let file = directory.join("bursting.toml");
    std::fs::write(&file, bursting()).expect("written");
    let mut plant = Command::new(env!("CARGO_BIN_EXE_plant-sim"));
    plant.args(["--controller-timeout", "60", "--prefix"]).arg(format!("burst{}_", std::process::id()));
    let ended = plant.arg("--root-path").arg(&directory).arg("--scenario").arg(&file).output().expect("it starts");
    std::fs::remove_dir_all(&directory).expect("removed");
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(70), "{said}");
    assert!(said.contains("no longer finite"), "{said}");
}
