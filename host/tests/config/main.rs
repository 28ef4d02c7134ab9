//! The configuration mechanism, on a sample with every kind of key.

mod declarations;
mod mutations;
mod sample;

use std::path::Path;

use admittance_host::config::{LoadError, Problem, Section, load, parse};
use admittance_host::exit::ExitCode;
use sample::{Config, Control, Ipc, Joint, Law, Noise, VALID, errors_of, with};

#[test]
fn a_valid_text_gives_its_values_and_the_defaults() {
    let config: Config = parse(VALID, "cell.toml").unwrap();
    assert_eq!(config.cell.as_deref(), Some("north"));
    assert_eq!(config.control.sampling_time_s, 0.004);
    assert_eq!(config.control.law, Law::HighDamping);
    assert_eq!(config.control.weights, [1.0, 2.0]);
    assert_eq!(config.control.contact_point_m, Some([1.32, 0.68, 0.0]));
    assert_eq!(config.robot.joint[1], Joint { length_m: 1.0, time_constant_s: 0.01 });

    assert_eq!(config.control.horizon, 5);
    assert_eq!(config.control.laws, [Law::HighDamping]);
    assert_eq!(config.control.stiffness_n_per_m, 1e5);
    assert_eq!(config.control.stop_force_n, Some(100.0));
    assert!(config.control.enabled);
    assert_eq!(config.robot.joint[0].time_constant_s, 0.015);
    assert_eq!(config.ipc, Ipc { root_path: "/run/admittanced".into(), patience: -1 });
    assert_eq!(config.noise, None);
}

#[test]
fn plain_serde_builds_the_same_struct_and_rejects_unknown_and_missing_keys() {
    let by_serde: Config = toml::from_str(VALID).unwrap();
    assert_eq!(by_serde, parse(VALID, "").unwrap());
    let unknown = toml::from_str::<Config>(&with("law =", "lax =")).unwrap_err();
    assert!(unknown.message().contains("unknown field `lax`"), "{unknown}");
    let missing = toml::from_str::<Config>(&with("sampling_time_s = 0.004", "")).unwrap_err();
    assert!(missing.message().contains("missing field `sampling_time_s`"), "{missing}");
    let name = toml::from_str::<Config>(&with("\"high_damping\"", "\"High\"")).unwrap_err();
    assert!(name.message().contains("unknown variant `High`"), "{name}");
}

#[test]
fn all_errors_come_at_once_in_the_order_of_lines() {
    let text = "cell = 3
[control]
horizn = 5
law = \"mcp\"
weights = [1.0, -2.0, nan]
contact_point_m = [1.0, 2.0]
[robot]
joint = []
patience = 3
";
    let expected = "\
cell.toml:1: cell = 3: is an integer; accepted: string, at least 2 printable characters
cell.toml:2: control.sampling_time_s: missing; accepted: number, 0.0001 to 0.1 s
cell.toml:3: control.horizn = 5: unknown key, did you mean control.horizon? accepted: sampling_time_s, horizon, law, laws, \
weights, stiffness_n_per_m, contact_point_m, stop_force_n, seed, enabled, surface
cell.toml:4: control.law = \"mcp\": accepted: \"mpc\" or \"high_damping\"
cell.toml:5: control.weights[1] = -2.0: accepted: 0 to 1000000000
cell.toml:5: control.weights[2] = nan: accepted: 0 to 1000000000
cell.toml:6: control.contact_point_m = [1.0, 2.0]: accepted: array of 3 numbers, each -10 to 10 m
cell.toml:8: robot.joint = []: accepted: tables [[robot.joint]], of length 1 to 8
cell.toml:9: robot.patience = 3: unknown key, did you mean ipc.patience? accepted: name, joint";
    assert_eq!(errors_of(text).to_string(), expected);
}

#[test]
fn an_empty_text_names_every_required_key() {
    let errors = errors_of("");
    let keys: Vec<_> = errors.errors.iter().map(|error| error.key.as_str()).collect();
    assert_eq!(keys, ["control.sampling_time_s", "control.weights", "robot.joint"]);
    assert!(errors.errors.iter().all(|error| error.problem == Problem::Missing));
}

#[test]
fn text_that_is_not_toml_names_line_and_key() {
    let errors = errors_of("[control]\nsampling_time_s = = 5\n");
    let first = errors.to_string();
    assert!(first.starts_with("cell.toml:2: control.sampling_time_s = = 5: "), "{first}");
    assert!(first.contains("accepted: TOML"), "{first}");

    let twice = errors_of("[control]\nhorizon = 5\nhorizon = 6\n").to_string();
    assert!(twice.starts_with("cell.toml:3: control.horizon = 6: duplicate key"), "{twice}");

    let header = errors_of("[control\n").to_string();
    assert!(header.starts_with("cell.toml:1: [control: "), "{header}");
}

#[test]
fn a_list_without_its_closing_bracket_is_one_error() {
    for (begin, rest) in [
        ("weights = [1.0, 2.0", "\n[robot]\nname = \"a\"\n\n[[robot.joint]]\norigin_m = [0.0, 0.0, 0.0]\n"),
        ("weights = [[1.0], [2.0]", " # [ never closed ]\n  # ]\nlaw = \"mpc\"\nhorizon = 5\n"),
        ("weights = [\"]\", ']'", "\n"),
        ("weights = [", ""),
    ] {
        let errors = errors_of(&format!("[control]\n{begin}{rest}"));
        let text = errors.to_string();
        assert_eq!(text.lines().count(), 1, "{text}");
        let expected = format!("cell.toml:2: control.{begin}");
        assert!(text.starts_with(&expected) && text.contains("a list without its closing bracket"), "{text}");
    }
    // Whole lists over several lines are none of it, and what is wrong before the open one is said too.
    let elsewhere = errors_of("[control]\nweights = [\n  [1.0, 2.0],\n  [3.0],\n]\nhorizon = = 5\n").to_string();
    assert!(elsewhere.starts_with("cell.toml:6: control.horizon"), "{elsewhere}");
    let two = errors_of("[control]\nhorizon = = 5\nweights = [1.0\nlaw = \"mpc\"\n").to_string();
    assert!(two.contains("cell.toml:2: control.horizon") && two.contains("cell.toml:3: control.weights"), "{two}");
    let inside = errors_of("[control]\nweights = [\n  1.0 = 2,\n]\n").to_string();
    assert!(inside.starts_with("cell.toml:3: "), "{inside}");
}

#[test]
fn numbers_are_exact_and_typed() {
    let accepted = |text: &str| parse::<Config>(text, "").is_ok();
    assert!(accepted(&with("law =", "stiffness_n_per_m = 100000\nlaw =")), "a whole number for a float");
    assert!(accepted(&with("law =", "seed = 0xffff_ffff_ffff_ffff\nlaw =")), "the whole range of u64");
    assert!(!accepted(&with("law =", "seed = 18446744073709551616\nlaw =")), "one more");
    assert!(!accepted(&with("law =", "horizon = 5.0\nlaw =")), "a float for an integer");
    assert!(!accepted(&with("law =", "stiffness_n_per_m = 1e999\nlaw =")), "overflows to infinity");
    assert!(!accepted(&with("law =", "contact_point_m.x = 1\nlaw =")), "a table for an array");
    assert!(!accepted(&with("law =", "enabled = 2020-01-01\nlaw =")), "a date");
}

#[test]
fn cross_checks_run_last_and_know_the_line() {
    let text = with("weights = [1.0, 2]", "weights = [1000]\nhorizon = 31");
    let expected = "\
cell.toml:7: control.weights[0] = 1000: accepted: at most 600
cell.toml:8: control.horizon = 31: accepted: at most 30 with weights[0] > 500";
    assert_eq!(errors_of(&text).to_string(), expected);
    // The cross-check reads weights[0]: it must not run on an empty list.
    assert_eq!(errors_of(&with("weights = [1.0, 2]", "weights = []")).errors.len(), 1);
}

#[test]
fn a_struct_built_in_code_is_checked_the_same() {
    let mut config: Config = parse(VALID, "").unwrap();
    config.control.weights = vec![0.0; 7];
    config.control.weights[6] = f64::INFINITY;
    config.control.surface[1][0] = -2.0;
    config.robot.joint[1].length_m = f64::NAN;
    config.robot.name.clear();
    config.ipc.patience = -2;
    config.noise = Some(Noise { deviation_n: -0.5 });
    let mut errors = Vec::new();
    config.check("", &mut errors);
    let lines: Vec<_> = errors.iter().map(ToString::to_string).collect();
    assert_eq!(
        lines,
        [
            "control.weights = 7 elements: accepted: array of numbers, of length 1 to 6, each 0 to 1000000000",
            "control.weights[6] = inf: accepted: 0 to 1000000000",
            "control.surface[1][0] = -2: accepted: -1 to 1",
            "robot.name = \"\": accepted: string, 1 to 16 printable characters",
            "robot.joint[1].length_m = NaN: accepted: 0 to 5 m",
            "ipc.patience = -2: accepted: -1 to 2147483647 cycles",
            "noise.deviation_n = -0.5: accepted: 0 to 10 N",
        ]
    );

    // The cross-check reads weights[0]: it must not run on an empty list.
    let mut empty = parse::<Config>(VALID, "").unwrap().control;
    empty.weights.clear();
    let mut errors = Vec::new();
    empty.check("control", &mut errors);
    assert_eq!(errors.len(), 1);
    empty.weights.push(700.0);
    empty.check("control", &mut errors);
    assert_eq!(errors[1].to_string(), "control.weights[0] = 700: accepted: at most 600");

    let mut of_section = Vec::new();
    Control { horizon: 0, ..parse::<Config>(VALID, "").unwrap().control }.check("spare", &mut of_section);
    assert_eq!(of_section[0].to_string(), "spare.horizon = 0: accepted: 1 to 32 steps");
}

#[test]
fn load_tells_a_missing_file_from_a_wrong_one() {
    let missing = load::<Config>(Path::new("/nonexistent/cell.toml")).unwrap_err();
    assert_eq!(missing.exit_code(), ExitCode::NoInput);
    assert!(missing.to_string().starts_with("/nonexistent/cell.toml: cannot be read: "), "{missing}");

    let file = std::env::temp_dir().join(format!("admittance-host-config-{}.toml", std::process::id()));
    std::fs::write(&file, "cell = 1").unwrap();
    let wrong = load::<Config>(&file).unwrap_err();
    std::fs::write(&file, VALID).unwrap();
    let right = load::<Config>(&file);
    std::fs::write(&file, [0xff, 0xfe]).unwrap();
    let binary = load::<Config>(&file).unwrap_err();
    std::fs::remove_file(&file).unwrap();
    assert!(matches!(&wrong, LoadError::Config(errors) if errors.errors.len() == 4), "{wrong}");
    assert_eq!(wrong.exit_code(), ExitCode::Config);
    assert!(right.is_ok());
    assert_eq!(binary.exit_code(), ExitCode::Config);
}
