//! What `admittancectl limits` names for the demo's motion, as a person is told it.

use std::process::Command;

use end_to_end::session::output;
use end_to_end::{binaries, fresh};
use serde_json::Value;

const CONFIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/demo/mpc-default.toml");
/// Straight down, as the paper's arm moves, onto what is told.
const MOTION: [&str; 3] = ["--direction=0,-1", "--stiffness-n-m", "1e5"];

fn limits(arguments: &[&str]) -> String {
    let (code, text) =
        output(Command::new(&binaries().admittancectl).args(["limits", CONFIG]).args(MOTION).args(arguments));
    assert_eq!(code, Some(0), "{text}");
    text
}

fn json(arguments: &[&str]) -> Value {
    let text = limits(&[arguments, &["--json"]].concat());
    let begins = text.find('{').unwrap_or_else(|| panic!("no JSON: {text}"));
    serde_json::Deserializer::from_str(&text[begins..]).into_iter().next().expect("a value").expect("JSON")
}

/// What the law could accept with the exact model before it was made to forgive: 0.32 m/s at 4 ms (with one input in
/// a cycle; four make it 0.34) and 0.64 m/s at 1 ms. What forgives may not cost more than 2 %.
#[test]
fn the_demo_s_motion_keeps_the_speeds_that_it_had() {
    let found = json(&["--sampling-time-s", "0.004,0.001", "--worlds", "10"]);
    for (time, told, more) in [(0.004, 0.32, 1.08), (0.001, 0.64, 1.02)] {
        let cells = found["cells"].as_array().expect("cells");
        let cell = cells.iter().find(|cell| cell["sampling_time_s"] == time).expect("a cell");
        let speed = cell["speed_m_s"].as_f64().expect("a speed");
        println!("{time} s: {speed} m/s, then {}", cell["limited_by"]);
        assert!((0.98 * told..=more * told).contains(&speed), "{time} s: {speed} m/s, {told} m/s are expected");
    }
}

/// Two speeds: with the model as told, and in worlds as they may be; the second is what is recommended.
#[test]
fn of_two_speeds_the_one_for_worlds_that_are_not_as_told_is_recommended() {
    let own = ["--sampling-time-s", "0.004", "--instants", "4"];
    let speeds = |worlds: u64, seed: u64| {
        let found = json(&[&own[..], &["--worlds", &worlds.to_string(), "--seed", &seed.to_string()]].concat());
        let told = &found["recommended"];
        assert_eq!((told["worlds"].as_u64(), told["worlds_seed"].as_u64()), (Some(worlds), Some(seed)), "{told}");
        let [speed, as_told, share] = ["speed_m_s", "as_told_m_s", "unsafe_share_at_most"]
            .map(|key| told[key].as_f64().unwrap_or_else(|| panic!("{key}: {told}")));
        println!("{worlds} worlds of seed {seed}: {speed} of {as_told} m/s, {told}");
        assert!((1.0 - share).powi(worlds as i32) < 0.0501, "{share}");
        assert!(0.0 < speed && speed < as_told, "{told}");
        assert_eq!(found["cells"][0]["speed_m_s"].as_f64(), Some(as_told));
        [speed, as_told]
    };
    let (few, more) = (speeds(10, 1), speeds(100, 1));
    // The first ten of a hundred are the same worlds.
    assert!(more[0] <= 1.02 * few[0] && more[1] == few[1], "{few:?}, {more:?}");
    let text = limits(&[&own[..], &["--worlds", "10"]].concat());
    let expected = format!(
        "Recommended as configured: {} m/s ({} m/s with the model exactly as told). In 10 random",
        few[0], few[1]
    );
    assert!(text.contains(&expected), "{expected}: {text}");
    assert!(text.contains("of seed 1 ") && text.contains("in all but 25.9 % of such worlds at most"), "{text}");
    // Half of it is safe in worlds that nobody has chosen.
    fresh(|seed| {
        let other = speeds(20, seed);
        assert!(other[0] > 0.5 * more[0], "{other:?}");
    });
}
