//! `admittancectl simulate`: the numbers of virtual time, and what it refuses.

use std::path::Path;
use std::process::Command;

use admittance_host::config::parse;
use admittance_runner::config::Config;
use admittance_runner::cycle;
use admittance_runner::virtual_time::VirtualTime;
use admittancectl::recording::{Item, Recording};
use ipc_types::layout::WireType as _;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;
use serde_json::Value;

const CONFIG: &str = include_str!("../../../deploy/demo/mpc-default.toml");
const SCENARIO: &str = include_str!("../../../plant-sim/scenarios/paper.toml");

fn run(words: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_admittancectl")).args(words).output().expect("it starts");
    (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

/// Files in a directory of their own, by name.
fn files(contents: &[(&str, &str)]) -> (tempfile::TempDir, impl Fn(&str) -> String + use<>) {
    let directory = tempfile::tempdir().expect("a directory");
    for (name, text) in contents {
        std::fs::write(directory.path().join(name), text).expect("written");
    }
    let root = directory.path().to_str().expect("text").to_owned();
    (directory, move |name: &str| format!("{root}/{name}"))
}

/// State, command and truth of every sample, as JSON, which has every bit.
fn samples(file: &str) -> Vec<[Value; 3]> {
    let recording = Recording::open(Path::new(file)).expect("whole");
    let (mut samples, mut last) = (Vec::new(), None);
    for item in recording.items() {
        match item.expect("sound") {
            Item::Record(record) => last = Some(record),
            Item::Truth(truth) => {
                let record = last.take().expect("a record before what was true");
                samples.push([record.state.to_json(), record.command.to_json(), truth.to_json()]);
            }
        }
    }
    samples
}

#[test]
fn it_records_virtual_time_to_the_bit_and_a_replay_agrees() {
    let (_directory, path) = files(&[("daemon.toml", CONFIG), ("scenario.toml", SCENARIO)]);
    let [config, scenario, out] = ["daemon.toml", "scenario.toml", "x.mcap"].map(path);
    let (code, said) = run(&["simulate", &config, &scenario, "--out", &out]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("501 cycles of motion; contact from 0.8") && said.contains("at the end Contact"), "{said}");
    let recorded = samples(&out);
    let told: Config = parse(CONFIG, "daemon.toml").expect("shipped");
    let real: Scenario = parse(SCENARIO, "scenario.toml").expect("shipped");
    let plant = VirtualRun::new(&real).expect("shipped");
    let steps = VirtualTime::new(cycle::build(&told).expect("shipped"), plant).run().expect("it runs");
    assert_eq!(recorded.len(), steps.len());
    for ([state, command, truth], mut step) in recorded.iter().zip(steps) {
        // Of a daemon that answers at once.
        (step.command.boot_id, step.command.stamp_ns) = (1, step.state.stamp_ns);
        assert_eq!([state, command, truth], [&step.state.to_json(), &step.command.to_json(), &step.truth.to_json()]);
    }
    let (code, said) = run(&["replay", &out]);
    assert!(code == Some(0) && said.contains(&format!("{} cycles, bit-identical", recorded.len())), "{said}");
}

#[test]
fn what_it_cannot_run_is_named() {
    let with_fault = format!("{SCENARIO}\n[[fault]]\nat_s = 0.5\nduration_s = 0.1\nkind = \"drop\"\n");
    // In free space, close to stretched; a daemon in control would stop before.
    let disabled = CONFIG.replacen("[control]\n", "[control]\nstart_enabled = false\n", 1);
    let (before, after) = (SCENARIO.split("[surface]").next(), SCENARIO.split("[wrench]").nth(1));
    let free = format!("{}[wrench]{}", before.expect("text"), after.expect("a section"));
    let singular = free.replace("contact_time_s = 0.816\ncontact_phase = 0.5", "").replace("1.3, -1.4", "0.1, -0.1");
    let singular = singular.replace("twist = [0.0, -0.25]", "twist = [0.02, 0.0]");
    let six = include_str!("../../../plant-sim/scenarios/six-joint.toml");
    let (_directory, path) = files(&[
        ("daemon.toml", &disabled),
        ("scenario.toml", SCENARIO),
        ("fault.toml", &with_fault),
        ("singular.toml", &singular),
        ("six.toml", six),
        ("there.mcap", "mine"),
    ]);
    let config = path("daemon.toml");
    let refused = |scenario: &str, out: &str, more: &[&str], code: i32, words: &[&str]| {
        let arguments = [&["simulate", &config, scenario, "--out", out], more].concat();
        let (found, said) = run(&arguments);
        assert_eq!(found, Some(code), "{said}");
        words.iter().for_each(|word| assert!(said.contains(word), "{word}: {said}"));
    };
    let (good, new, there) = (path("scenario.toml"), path("new.mcap"), path("there.mcap"));
    refused(&path("six.toml"), &new, &[], 78, &["six.toml: robot.joint: 6 joints: accepted: 2"]);
    refused(&path("fault.toml"), &new, &[], 78, &["fault[0].kind = \"drop\"", "accepted: no [[fault]]"]);
    refused(&path("none.toml"), &new, &[], 66, &["none.toml"]);
    refused(&config, &new, &[], 78, &["daemon.toml"]);
    assert!(!Path::new(&new).exists(), "what is refused leaves no file");
    refused(&good, &there, &[], 73, &["there.mcap", "--overwrite"]);
    assert_eq!(std::fs::read_to_string(&there).expect("readable"), "mine");
    refused(&good, &path("no/x.mcap"), &[], 73, &["no/x.mcap"]);
    refused(&good, "/dev/full", &["--overwrite"], 74, &["/dev/full", "No space"]);
    refused(&path("singular.toml"), &new, &[], 65, &["singular.toml", "Jacobian has no inverse"]);
    assert!(!samples(&new).is_empty(), "what was until then is a recording");
}

#[test]
fn a_daemon_that_does_not_control_says_why() {
    let faster = SCENARIO.replace("sampling_time_s = 0.004", "sampling_time_s = 0.002");
    let (_directory, path) = files(&[("daemon.toml", CONFIG), ("scenario.toml", &faster)]);
    let (code, said) = run(&["simulate", &path("daemon.toml"), &path("scenario.toml"), "--out", &path("x.mcap")]);
    assert!(code == Some(0) && said.contains("at the end Idle (RateMismatch)"), "{said}");
}
