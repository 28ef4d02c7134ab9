//! ABBRobotEGM, which nobody here wrote, on both sides.

use std::process::Command;

use egm_messages::{
    EgmCartesian, EgmCartesianSpeed, EgmClock, EgmEuler, EgmFeedBack, EgmHeader, EgmJoints, EgmMciState,
    EgmMeasuredForce, EgmMotorState, EgmPlanned, EgmPose, EgmQuaternion, EgmRapidCtrlExecState, EgmRobot, EgmSensor,
    EgmSpeedRef, EgmTimestamp, Message,
};
use end_to_end::session::output;
use end_to_end::{Need, needs, python};
use serde_json::{Value, json};

use crate::cell::Cell;

pub(crate) const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/python/abb_robot_egm.py");

/// The JSON object that a command prints.
pub(crate) fn said(command: &mut Command) -> Value {
    let (code, text) = output(command);
    assert_eq!(code, Some(0), "{text}");
    let line = text.lines().find(|line| line.starts_with('{')).unwrap_or_else(|| panic!("no result: {text}"));
    serde_json::from_str(line).expect("JSON")
}

/// What the package reads in a message, and the message that it makes of just that.
fn read_by_python<M: Message + Default>(kind: &str, message: &M) -> (Value, M) {
    let hex: String = message.encode_to_vec().iter().map(|byte| format!("{byte:02x}")).collect();
    let told = said(Command::new(python().expect("the need is met")).arg(SCRIPT).args(["read", kind, &hex]));
    let written = told["written"].as_str().expect("a text");
    let byte = |at: usize| u8::from_str_radix(&written[at..at + 2], 16).expect("hexadecimal");
    let bytes: Vec<u8> = (0..written.len()).step_by(2).map(byte).collect();
    (told["read"].clone(), M::decode(&bytes[..]).expect("a message"))
}

/// Something in every field, and no two numbers alike.
#[test]
fn each_decodes_the_others_messages_field_by_field() {
    if !needs(Need::AbbRobotEgm) {
        return;
    }
    let joints = |first: f64, count: u32| EgmJoints { joints: (0..count).map(|n| first + f64::from(n)).collect() };
    let values = |first: f64, count: u32| joints(first, count).joints;
    let pose = |first: f64| EgmPose {
        pos: Some(EgmCartesian { x: first, y: first + 1.0, z: first + 2.0 }),
        orient: Some(EgmQuaternion { u0: first + 3.0, u1: first + 4.0, u2: first + 5.0, u3: first + 6.0 }),
        euler: Some(EgmEuler { x: first + 7.0, y: first + 8.0, z: first + 9.0 }),
    };
    let pose_read = |first: f64| {
        json!({
            "pos": { "x": first, "y": first + 1.0, "z": first + 2.0 },
            "orient": { "u0": first + 3.0, "u1": first + 4.0, "u2": first + 5.0, "u3": first + 6.0 },
            "euler": { "x": first + 7.0, "y": first + 8.0, "z": first + 9.0 },
        })
    };

    let robot = EgmRobot {
        header: Some(EgmHeader { seqno: Some(7), tm: Some(4_000_000_001), mtype: Some(2) }),
        feed_back: Some(EgmFeedBack {
            joints: Some(joints(10.25, 6)),
            cartesian: Some(pose(100.75)),
            external_joints: Some(joints(20.25, 2)),
            time: Some(EgmClock { sec: 30, usec: 31 }),
            time_stamp: Some(EgmTimestamp { sec: Some(32), nsec: Some(33) }),
        }),
        planned: Some(EgmPlanned {
            joints: Some(joints(-40.25, 6)),
            cartesian: Some(pose(120.75)),
            external_joints: Some(joints(50.25, 2)),
            time: Some(EgmClock { sec: 60, usec: 61 }),
            time_stamp: Some(EgmTimestamp { sec: Some(62), nsec: Some(63) }),
        }),
        motor_state: Some(EgmMotorState { state: 1 }),
        mci_state: Some(EgmMciState { state: 3 }),
        mci_convergence_met: Some(true),
        rapid_exec_state: Some(EgmRapidCtrlExecState { state: 2 }),
        measured_force: Some(EgmMeasuredForce { fc_active: Some(true), force: values(70.5, 6) }),
        utilization_rate: Some(80.5),
        torque_ref: Some(joints(90.5, 6)),
    };
    let (read, written) = read_by_python("EgmRobot", &robot);
    let expected = json!({
        "header": { "seqno": 7, "tm": 4_000_000_001_u32, "mtype": "MSGTYPE_DATA" },
        "feedBack": {
            "joints": { "joints": values(10.25, 6) },
            "cartesian": pose_read(100.75),
            "externalJoints": { "joints": values(20.25, 2) },
            "time": { "sec": "30", "usec": "31" },
            "timeStamp": { "sec": "32", "nsec": "33" },
        },
        "planned": {
            "joints": { "joints": values(-40.25, 6) },
            "cartesian": pose_read(120.75),
            "externalJoints": { "joints": values(50.25, 2) },
            "time": { "sec": "60", "usec": "61" },
            "timeStamp": { "sec": "62", "nsec": "63" },
        },
        "motorState": { "state": "MOTORS_ON" },
        "mciState": { "state": "MCI_RUNNING" },
        "mciConvergenceMet": true,
        "rapidExecState": { "state": "RAPID_RUNNING" },
        "measuredForce": { "fcActive": true, "force": values(70.5, 6) },
        "utilizationRate": 80.5,
        "torqueRef": { "joints": values(90.5, 6) },
    });
    assert_eq!(read, expected, "what Python reads of a robot's message");
    assert_eq!(written, robot, "a robot's message that Python wrote");

    let sensor = EgmSensor {
        header: Some(EgmHeader { seqno: Some(9), tm: Some(11), mtype: Some(3) }),
        planned: None,
        speed_ref: Some(EgmSpeedRef {
            joints: Some(joints(-1.5, 6)),
            cartesians: Some(EgmCartesianSpeed { value: values(0.125, 6) }),
            external_joints: Some(joints(5.75, 2)),
        }),
    };
    let (read, written) = read_by_python("EgmSensor", &sensor);
    let expected = json!({
        "header": { "seqno": 9, "tm": 11, "mtype": "MSGTYPE_CORRECTION" },
        "speedRef": {
            "joints": { "joints": values(-1.5, 6) },
            "cartesians": { "value": values(0.125, 6) },
            "externalJoints": { "joints": values(5.75, 2) },
        },
    });
    assert_eq!(read, expected, "what Python reads of a sensor's message");
    assert_eq!(written, sensor, "a sensor's message that Python wrote");
}

#[test]
fn abb_robot_egm_drives_the_emulated_robot_and_reads_the_edge() {
    if !needs(Need::AbbRobotEgm) {
        return;
    }
    let python = python().expect("the need is met");
    let cell = Cell::start();
    // A surface would be in its way, and the arm's own motion plays no part.
    let changes = [("surface.stiffness_n_m", "100.0"), ("timing.settle_s", "20.0"), ("egm.jitter_s", "0.0")];
    let plant = cell.plant(&changes, cell.address());
    let plant_arguments = plant.get_args().take_while(|argument| *argument != "--egm");
    let mut sensor = Command::new(&python);
    sensor.arg(SCRIPT).arg("sensor").arg(plant.get_program()).args(plant_arguments);
    let session = said(&mut sensor);
    assert_eq!((&session["cycles"], &session["planned"], &session["force"]), (&1000.into(), &6.into(), &6.into()));
    assert_eq!((&session["motors_on"], &session["rapid_running"]), (&true.into(), &true.into()), "{session}");
    for (speed, expected) in
        session["speed"].as_array().into_iter().flatten().zip(session["expected"].as_array().into_iter().flatten())
    {
        let (speed, expected) = (speed.as_f64().expect("a number"), expected.as_f64().expect("a number"));
        assert!((speed - expected).abs() < 0.01 * expected.abs(), "{session}");
    }

    let mut robot = Command::new(&python);
    robot.arg(SCRIPT).arg("robot").arg(cell.port.to_string());
    let answers = said(&mut robot);
    assert_eq!((&answers["answers"], &answers["type"]), (&200.into(), &"MSGTYPE_CORRECTION".into()), "{answers}");
    assert_eq!((&answers["joints"], &answers["external"]), (&vec![0.0; 6].into(), &vec![0.0; 2].into()), "{answers}");
    assert_eq!(answers["has_position"], false);
}
