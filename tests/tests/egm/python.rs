//! ABBRobotEGM, which nobody here wrote, on both sides.

use std::process::Command;

use end_to_end::session::output;
use end_to_end::{Need, needs, python};

use crate::cell::Cell;

#[test]
fn abb_robot_egm_drives_the_emulated_robot_and_reads_the_edge() {
    if !needs(Need::AbbRobotEgm) {
        return;
    }
    let python = python().expect("the need is met");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/python/abb_robot_egm.py");
    let cell = Cell::start();
    let json = |command: &mut Command| -> serde_json::Value {
        let (code, text) = output(command);
        assert_eq!(code, Some(0), "{text}");
        let line = text.lines().find(|line| line.starts_with('{')).unwrap_or_else(|| panic!("no result: {text}"));
        serde_json::from_str(line).expect("JSON")
    };
    // A surface would be in its way, and the arm's own motion plays no part.
    let changes = [("surface.stiffness_n_m", "100.0"), ("timing.settle_s", "20.0"), ("egm.jitter_s", "0.0")];
    let plant = cell.plant(&changes, cell.address());
    let plant_arguments = plant.get_args().take_while(|argument| *argument != "--egm");
    let mut sensor = Command::new(&python);
    sensor.arg(script).arg("sensor").arg(plant.get_program()).args(plant_arguments);
    let session = json(&mut sensor);
    assert_eq!((&session["cycles"], &session["planned"], &session["force"]), (&1000.into(), &6.into(), &6.into()));
    assert_eq!((&session["motors_on"], &session["rapid_running"]), (&true.into(), &true.into()), "{session}");
    for (speed, expected) in
        session["speed"].as_array().into_iter().flatten().zip(session["expected"].as_array().into_iter().flatten())
    {
        let (speed, expected) = (speed.as_f64().expect("a number"), expected.as_f64().expect("a number"));
        assert!((speed - expected).abs() < 0.01 * expected.abs(), "{session}");
    }

    let mut robot = Command::new(&python);
    robot.arg(script).arg("robot").arg(cell.port.to_string());
    let answers = json(&mut robot);
    assert_eq!((&answers["answers"], &answers["type"]), (&200.into(), &"MSGTYPE_CORRECTION".into()), "{answers}");
    assert_eq!((&answers["joints"], &answers["external"]), (&vec![0.0; 6].into(), &vec![0.0; 2].into()), "{answers}");
    assert_eq!(answers["has_position"], false);
}
