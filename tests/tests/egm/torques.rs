//! A robot without a force sensor: the wrench follows from its motors' torques, which EGM calls torqueRef.

use std::net::UdpSocket;
use std::process::Command;
use std::time::{Duration, Instant};

use egm_messages::{EgmJoints, Message};
use end_to_end::egm_robot::standing;
use end_to_end::session::{output, with_keys};
use end_to_end::{Need, binaries, motor_torque, needs, python, undisturbed};
use ipc_types::services::{self, Access};

use crate::cell::{Cell, Files, MOST, fastest, peak};
use crate::python::{SCRIPT, said};

const MASSES: &str = include_str!("../../../plant-sim/scenarios/six-joint-masses.toml");
/// What `motor_torque::config` asks for, N.
const PRESSING: f64 = 100.0;

/// A robot with masses, and a daemon that knows them and has no other source of its wrench.
fn files() -> Files {
    let mut files = Files::patient();
    let masses = motor_torque::with_stiff_gears(MASSES);
    files.daemon = motor_torque::config(&files.daemon, &motor_torque::dynamics(&masses, 0.0, 0.0, 1));
    files.daemon = with_keys(&files.daemon, &[("robot.velocity_loop", "{ report_lag_s = 0.0 }")]);
    files.edge = with_keys(&files.edge, &[("egm.torque_factor", "[1.0, 1.0, 1.0, 1.0, 1.0, 1.0]")]);
    files.scenario = with_keys(
        &masses,
        &[
            ("timing", "{ sampling_time_s = 0.004, command_delay_s = 0.004, settle_s = 1.0, substep_s = 0.000125 }"),
            ("surface.stiffness_n_m", "2e4"),
            ("motion", "[{ duration_s = 3.0, twist = [0.02, 0.015, -0.02, 0.0, 0.0, 0.0] }]"),
            ("egm", "{ comm_timeout_s = 0.1, clock_drift_ppm = 100.0 }"),
        ],
    );
    files
}

#[test]
fn a_robot_without_a_sensor_presses_by_its_motors_torques() {
    undisturbed(|| {
        let mut cell = Cell::of(&files());
        let (truths, said) = cell.run(&[], |_, _, _| {});
        let settled: Vec<f64> =
            truths.iter().filter(|truth| truth.scenario_time_s > 2.0).map(|truth| truth.normal_force_n).collect();
        let mean = settled.iter().sum::<f64>() / settled.len() as f64;
        let moves = truths.iter().filter(|truth| truth.scenario_time_s > 2.0).map(fastest).fold(0.0, f64::max);
        println!("peak {:.1} N, settled {mean:.1} N, {moves} rad/s: {said}", peak(&truths));
        assert!(!cell.daemon.stderr().contains("Stopped"), "{}", cell.daemon.report());
        assert!(peak(&truths) <= MOST && !said.contains("CommTimeout"), "peak {} N: {said}", peak(&truths));
        assert!((mean - PRESSING).abs() < 0.1 * PRESSING, "it presses with {mean} N");
        assert!(moves > 0.005, "it slides on");
    });
}

/// Unit, side of the gear and sign are the file's: what a robot sends comes to the daemon times that, joint by joint.
#[test]
fn torques_reach_the_daemon_in_newton_metres_on_the_joints_side() {
    let mut files = files();
    files.edge = with_keys(&files.edge, &[("egm.torque_factor", "[101.0, -101.0, 1.0, -1.0, 0.5, 2.0]")]);
    let cell = Cell::of(&files);
    let node = cell.ipc.settings().node("test").expect("a node");
    let state = services::state(&node, &cell.ipc.settings().instance, Access::Open).expect("it is there");
    let states = state.subscriber().expect("a subscriber");
    let robot = UdpSocket::bind("127.0.0.1:0").expect("a port is free");
    let (begun, mut seen) = (Instant::now(), [0; 2]);
    for cycle in 1..300_u32 {
        let mut message = standing(cycle);
        // First with torques, then with one too few.
        let torques = [0.5, 0.25, -20.0, 3.0, 8.0, -1.0];
        message.torque_ref = Some(EgmJoints { joints: torques[..if cycle < 150 { 6 } else { 5 }].to_vec() });
        robot.send_to(&message.encode_to_vec(), cell.address()).expect("sent");
        let next = begun + Duration::from_millis(4) * cycle;
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
        while let Some(sample) = states.receive().expect("received") {
            if cycle < 150 {
                assert_eq!(
                    (sample.torque_valid, sample.joint_torque[..6].to_vec()),
                    (1, vec![50.5, -25.25, -20.0, -3.0, 4.0, -2.0])
                );
                seen[0] += 1;
            } else if cycle > 155 {
                assert_eq!((sample.torque_valid, sample.joint_torque), (0, [0.0; 8]), "{sample:?}");
                seen[1] += 1;
            }
        }
    }
    assert!(seen.iter().all(|seen| *seen > 50), "{seen:?} samples");
}

/// ABBRobotEGM, which has the field from ABB's definitions, reads the same torques.
#[test]
fn abb_robot_egm_reads_the_torques_of_the_emulated_robot() {
    if !needs(Need::AbbRobotEgm) {
        return;
    }
    let cell = Cell::of(&files());
    let changes = [("timing.settle_s", "20.0"), ("egm.comm_timeout_s", "1.0"), ("surface.stiffness_n_m", "100.0")];
    let plant = cell.plant(&changes, cell.address());
    let plant_arguments = plant.get_args().take_while(|argument| *argument != "--egm");
    let mut sensor = Command::new(python().expect("the need is met"));
    sensor.arg(SCRIPT).arg("torques").arg(plant.get_program()).args(plant_arguments);
    let torques: Vec<f64> = serde_json::from_value(said(&mut sensor)["torques"].clone()).expect("numbers");
    println!("{torques:?}");
    assert_eq!(torques.len(), 6);
    // The second and third joint carry the arm: tens of N m, and more than the wrist has.
    assert!(torques[1].abs() > 20.0 && torques[1].abs() > 5.0 * torques[4].abs(), "{torques:?}");
}

#[test]
fn who_asks_for_torques_is_to_say_what_they_are() {
    let files = files();
    let cell = end_to_end::PrivateIpc::new("egm");
    let check = |edge: &str| {
        let edge = end_to_end::session::write(&cell, "edge.toml", edge);
        let daemon = end_to_end::session::write(&cell, "daemon.toml", &files.daemon);
        let mut command = Command::new(&binaries().admittance_egm);
        command.arg("--config").arg(edge).arg("--daemon-config").arg(daemon).arg("--check");
        output(&mut command)
    };
    assert_eq!(check(&files.edge).0, Some(0), "{:?}", check(&files.edge));
    for (edge, expected) in [
        (
            Files::shipped().edge,
            "egm.torque_factor is absent: accepted: 6 values, since wrench.source = \"motor_torque\"",
        ),
        (with_keys(&files.edge, &[("egm.torque_factor", "[1.0, 1.0]")]), "egm.torque_factor has 2 values: accepted: 6"),
    ] {
        let (code, text) = check(&edge);
        assert_eq!(code, Some(78), "{text}");
        assert!(text.contains(expected), "{text}");
    }
}
