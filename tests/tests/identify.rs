//! `admittancectl identify` on recordings of an arm that the daemon was told wrongly.

use std::path::Path;
use std::process::Command;

use admittance_host::config::parse;
use admittance_host::robot_description::VelocityLoopDescription;
use admittance_runner::config::Config;
use admittancectl::virtual_recording;
use end_to_end::binaries;
use end_to_end::closed_loop::Experiment;
use end_to_end::session::{output, with_keys};
use plant_sim::scenario::Scenario;
use serde_json::Value;

const CONFIG: &str = include_str!("../../deploy/robots/six-joint.toml");
const FREE: &str = include_str!("../../plant-sim/scenarios/identify-free.toml");
const TOUCH: &str = include_str!("../../plant-sim/scenarios/identify-touch.toml");
const MASSES: &str = include_str!("../../plant-sim/scenarios/identify-masses.toml");

/// Phases of the free motion that change all speeds.
const LIVELY_PHASES: usize = 24;

/// Loops, tool, wrench and floor as they are told: wrong by 20 to 30 %. Free motion
/// is recorded without control, as commissioning has it: a wrong tool feigns touches.
const WRONG: [(&str, &str); 8] = [
    ("robot.velocity_time_constant_s", "[0.012, 0.019, 0.0095, 0.0075, 0.0125, 0.0075]"),
    ("contact.wrench_time_constant_s", "[0.025, 0.025, 0.025, 0.025, 0.025, 0.025]"),
    ("contact.activation_threshold", "[15.0, 15.0, 15.0, 3.0, 3.0, 3.0]"),
    ("environment.normal_stiffness_n_m", "1.3e5"),
    ("wrench.given_in", "\"sensor\""),
    ("wrench.sensor_origin_m", "[0.0, 0.0, -0.15]"),
    ("wrench.tool_mass_kg", "1.2"),
    ("wrench.tool_center_of_gravity_m", "[0.0, -0.01, -0.05]"),
];

fn experiment(config: &str, scenario: &str) -> Experiment {
    let config: Config = parse(config, "controller.toml").expect("the config is valid");
    let scenario: Scenario = parse(scenario, "scenario.toml").expect("the scenario is valid");
    Experiment { config, scenario }
}

/// Runs to the end of the motion, and records it; `text` is the configuration that the recording has.
fn record(experiment: &Experiment, text: &str, file: &Path) {
    let output = std::io::BufWriter::new(std::fs::File::create(file).expect("a file"));
    virtual_recording::record(&experiment.config, text, &experiment.scenario, output).expect("it runs");
}

fn identify(words: &[&str], files: &[&Path]) -> Value {
    let mut command = Command::new(&binaries().admittancectl);
    command.arg("identify").args(files).arg("--json").args(words);
    let found = command.output().expect("it starts");
    assert_eq!(found.status.code(), Some(0), "{}", String::from_utf8_lossy(&found.stderr));
    serde_json::from_slice(&found.stdout).expect("JSON")
}

/// Values that were to be found, and how many intervals held them.
#[derive(Default)]
struct Judged {
    all: u32,
    held: u32,
}

impl Judged {
    fn judge(&mut self, what: &str, found: &Value, truth: f64, most: f64) {
        let of = |key: &str| found[key].as_f64().unwrap_or_else(|| panic!("{what} was not found: {found}"));
        let (value, half_width) = (of("value"), of("half_width"));
        println!("{what}: {value:.6} +- {half_width:.6}, true {truth}");
        assert!((value - truth).abs() <= most, "{what}: {value}, true {truth}, allowed {most}");
        self.all += 1;
        self.held += u32::from((value - truth).abs() <= half_width);
    }
}

#[test]
fn an_arm_that_was_told_wrongly_is_found() {
    let directory = tempfile::tempdir().expect("a directory");
    let [free, touch] = ["free.mcap", "touch.mcap"].map(|name| directory.path().join(name));
    let text = with_keys(CONFIG, &WRONG);
    let report_lag_s = 0.002;
    let dead_times = [0.0012, 0.001, 0.0019, 0.0011, 0.0015, 0.001];
    let mut judged = Judged::default();
    // What is allowed for already is never lowered.
    for (seed, allowed) in [("1", "0.0"), ("2", "0.0"), ("3", "0.3")] {
        let text = with_keys(&text, &[("contact.wrench_lag_tolerance", allowed)]);
        let changes = [("wrench.delay_s", "0.0015"), ("timing.command_delay_s", "0.0007"), ("noise.seed", seed)];
        let with_loops = |scenario: &str| {
            let mut experiment = experiment(&text, &with_keys(scenario, &changes));
            let dead_time_s = Some(dead_times.to_vec());
            experiment.scenario.robot.velocity_loop =
                Some(VelocityLoopDescription { damping: None, dead_time_s, report_lag_s });
            experiment
        };
        let (mut experiment, touching) = (with_loops(FREE), with_loops(TOUCH));
        experiment.config.control.start_enabled = false;
        record(&experiment, &text, &free);
        record(&touching, &text, &touch);
        let new = directory.path().join(format!("{seed}.toml"));
        let found = identify(&["--write", new.to_str().expect("text")], &[&free, &touch]);
        for (joint, truth) in experiment.scenario.robot.velocity_time_constant_s.iter().enumerate() {
            let of = &found["joints"][joint];
            judged.judge(&format!("time constant {joint}"), &of["time_constant_s"], *truth, 0.01 * truth);
            judged.judge(&format!("dead time {joint}"), &of["dead_time_s"], dead_times[joint], 1e-4);
            assert!(of["damping"].is_null(), "{of}");
        }
        // The plant filters what it shows in steps of 0.1 ms, by the velocity at the end of each.
        judged.judge("report lag", &found["report_lag_s"], report_lag_s - 5e-5, 1e-4);
        judged.judge("command delay", &found["command_delay_s"], 0.0007, 1e-4);
        judged.judge("mass", &found["tool"]["mass_kg"], 1.5, 0.015);
        for (axis, truth) in [0.01, -0.02, -0.06].into_iter().enumerate() {
            judged.judge("centre of gravity", &found["tool"]["center_of_gravity_m"][axis], truth, 0.003);
        }
        judged.judge("noise", &found["tool"]["noise_n"], 0.3, 0.02);
        judged.judge("wrench lag", &found["wrench_time_constant_s"], 0.02, 0.001);
        judged.judge("wrench dead time", &found["wrench_dead_time_s"], 0.0015, 2e-4);
        judged.judge("stiffness", &found["stiffness_n_m"], 1e5, 2e3);
        let (code, said) = output(Command::new(&binaries().admittancectl).arg("validate").arg(&new));
        assert_eq!(code, Some(0), "{said}");
        let fragment = found["fragment"].as_str().expect("a fragment");
        assert!(fragment.contains("# was 1.2;") && fragment.contains("tool_mass_kg = 1."), "{fragment}");
        assert_eq!(fragment.contains("\nwrench_lag_tolerance = 0.0"), allowed == "0.0", "{fragment}");
    }
    println!("{} of {} intervals hold the truth", judged.held, judged.all);
    assert!(judged.held * 100 >= judged.all * 90, "{} of {}", judged.held, judged.all);
}

#[test]
fn loops_of_an_arm_with_masses_predict_a_motion_that_they_have_not_seen() {
    let directory = tempfile::tempdir().expect("a directory");
    let (file, fresh) = (directory.path().join("identify.mcap"), directory.path().join("fresh.mcap"));
    let text = with_keys(CONFIG, &WRONG[..2]);
    record(&experiment(&text, MASSES), &text, &file);
    // Other speeds, in another order, from another start of the noise.
    let mut other = experiment(&text, MASSES);
    other.scenario.motion.truncate(LIVELY_PHASES);
    other.scenario.motion.reverse();
    for phase in &mut other.scenario.motion {
        phase.duration_s *= 1.1;
        phase.twist.iter_mut().for_each(|part| *part *= 0.8);
    }
    (other.scenario.surface, other.scenario.start.contact_time_s, other.scenario.noise.seed) = (None, None, 7);
    record(&other, &text, &fresh);
    let found = identify(&["--check", fresh.to_str().expect("text")], &[&file]);
    let joints = found["check"].as_array().expect("all joints");
    assert_eq!(joints.len(), 6);
    let error = |joint: &Value, key: &str| joint[key].as_f64().expect("a number");
    joints.iter().for_each(|joint| println!("{joint}"));
    for joint in joints {
        assert!(error(joint, "found_error") <= 0.03, "{joint}");
    }
    let mean = |key: &str| joints.iter().map(|joint| error(joint, key)).sum::<f64>() / 6.0;
    assert!(mean("found_error") < mean("configured_error"), "{joints:?}");
}

#[test]
fn what_cannot_be_used_or_written_is_named_and_left_as_it_is() {
    let directory = tempfile::tempdir().expect("a directory");
    let of = |name: &str| directory.path().join(name).to_str().expect("text").to_owned();
    let [free, other, short, pipe] = &["free.mcap", "other.mcap", "short.mcap", "pipe"].map(of);
    let longer = with_keys(CONFIG, &[("robot.tool.origin_m", "[0.0, 0.0, 0.16]")]);
    let mut brief = experiment(CONFIG, FREE);
    brief.scenario.motion.truncate(6);
    record(&brief, CONFIG, free.as_ref());
    record(&brief, &longer, other.as_ref());
    brief.scenario.motion.truncate(1);
    brief.scenario.timing.settle_s = 0.01;
    record(&brief, CONFIG, short.as_ref());
    let before = std::fs::read(free).expect("readable");
    assert!(Command::new("mkfifo").arg(pipe).status().expect("it starts").success());
    let [check, write, page] = &["--check", "--write", "--directory"].map(str::to_owned);
    for (arguments, expected, words) in [
        (vec![free, free], 65, "was given already"),
        (vec![free, other], 65, "robot.tool.origin_m = [0.0, 0.0, 0.16]: accepted is [0.0, 0.0, 0.15]"),
        (vec![free, check, short], 65, "short.mcap: no motion in it"),
        (vec![free, check, free], 65, "was given already"),
        (vec![free, write, free], 73, "is never overwritten"),
        (vec![free, write, pipe], 73, "is never overwritten"),
        (vec![free, page, free], 73, "it is no directory"),
    ] {
        let (code, said) = output(Command::new(&binaries().admittancectl).arg("identify").args(arguments));
        assert!(code == Some(expected) && said.contains(words), "{words}: {code:?}: {said}");
    }
    assert_eq!(std::fs::read(free).expect("readable"), before);
}
