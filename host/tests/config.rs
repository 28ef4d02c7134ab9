//! The configuration mechanism, on a sample with every kind of key.

use std::collections::BTreeSet;
use std::ops::Bound;
use std::path::{Path, PathBuf};

use admittance_host::config::mutation::{MutationKind, check_every_key, mutations};
use admittance_host::config::{
    ConfigError, ConfigErrors, Kind, LoadError, Problem, Section, keys_markdown, load, parse,
};
use admittance_host::exit::ExitCode;
use admittance_host::{config_enum, config_section};

config_enum! {
    /// Which law computes the offset.
    pub enum Law {
        /// The predictive controller,
        /// with its verdict.
        Mpc = "mpc",
        /// The damping baseline (3).
        HighDamping = "high_damping",
    }
}

config_section! {
    /// The control law.
    pub struct Control {
        /// Time between two samples,
        /// exactly.
        sampling_time_s: f64, unit "s", range 0.0001..=0.1;
        /// Steps that the law looks ahead.
        horizon: u32 = 5, unit "steps", range 1..=32;
        /// Which law runs.
        law: Law = Law::Mpc;
        /// Laws that may be switched to.
        laws: Vec<Law> = vec![Law::HighDamping];
        /// Weight of each axis.
        weights: Vec<f64>, unit "1", range 0.0..=1e9, length 1..=6;
        /// Stiffness of the surface.
        stiffness_n_per_m: f64 = 1e5, unit "N/m", range (Bound::Excluded(0.0), Bound::Unbounded);
        /// Where the surface is; detected when absent.
        contact_point_m: Option<[f64; 3]>, unit "m", range -10.0..=10.0;
        /// Force at which a stop ends.
        stop_force_n: Option<f64> = Some(100.0), unit "N", range 1.0..1000.0;
        /// Seed of the noise.
        seed: u64 = 1, unit "1";
        /// Whether the law is on from the start.
        enabled: bool = true;
        /// Rotation of the surface.
        surface: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]], unit "1", range -1.0..=1.0;
    }
    cross_check release_below_minimum;
}

fn release_below_minimum(control: &Control, path: &str, errors: &mut Vec<ConfigError>) {
    if control.weights[0] > 500.0 && control.horizon > 30 {
        errors.push(ConfigError::new(format!("{path}.horizon"), control.horizon, "at most 30 with weights[0] > 500"));
    }
    if control.weights[0] > 600.0 {
        errors.push(ConfigError::new(format!("{path}.weights[0]"), control.weights[0], "at most 600"));
    }
}

config_section! {
    /// A joint.
    pub struct Joint {
        /// Length of the link that it moves.
        length_m: f64, unit "m", range 0.0..=5.0;
        /// Time constant of its speed loop.
        time_constant_s: f64 = 0.015, unit "s", range 0.0..=1.0;
    }
}

config_section! {
    /// The arm.
    pub struct Robot {
        /// What logs call it.
        name: String = "arm".to_owned(), length 1..=16;
        /// One table for each joint, from the base.
        joint: Vec<Joint>, length 1..=8;
    }
}

config_section! {
    /// Where shared memory is.
    pub struct Ipc {
        /// Directory of the services' files.
        root_path: PathBuf = PathBuf::from("/run/admittanced"), length 1..=60;
        /// Cycles without an answer before the controller stops.
        patience: i32 = -1, unit "cycles", range -1..;
    }
}

config_section! {
    /// Noise of the sensor.
    pub struct Noise {
        /// Standard deviation.
        deviation_n: f64, unit "N", range 0.0..=10.0;
    }
}

config_section! {
    /// The whole file.
    pub struct Config {
        /// Name of the cell.
        cell: Option<String>, length 2..;
        /// The control law.
        control: Control;
        /// The arm.
        robot: Robot;
        /// Where shared memory is.
        ipc: Ipc;
        /// Noise; none when absent.
        noise: Option<Noise>;
    }
}

const VALID: &str = r#"
cell = "north"

[control]
sampling_time_s = 0.004
law = "high_damping"
weights = [1.0, 2]
contact_point_m = [1.32, 0.68, 0.0]

[robot]
name = "2R"
[[robot.joint]]
length_m = 1.0
[[robot.joint]]
length_m = 1.0
time_constant_s = 0.01
"#;

fn errors_of(text: &str) -> ConfigErrors {
    parse::<Config>(text, "cell.toml").expect_err("the text must not be accepted")
}

/// The valid text with one piece replaced.
fn with(old: &str, new: &str) -> String {
    assert!(VALID.contains(old));
    VALID.replacen(old, new, 1)
}

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
fn every_key_is_driven_through_every_mistake() {
    let count = check_every_key::<Config>(VALID).unwrap_or_else(|failures| panic!("{}", failures.join("\n")));
    assert!(count > 100, "{count}");

    let keys = Config::keys("");
    let mutations = mutations(&keys, VALID);
    let kinds: BTreeSet<_> = mutations.iter().map(|mutation| format!("{:?}", mutation.kind)).collect();
    assert_eq!(kinds.len(), 11, "a sample with every kind of key has every kind of mistake: {kinds:?}");
    let expected = |key: &str, kind, value: &str| {
        let found = mutations.iter().any(|m| m.key == key && m.kind == kind && m.value == value);
        assert!(found, "{key} {kind:?} {value}");
    };
    expected("control.sampling_time_s", MutationKind::TooHigh, "0.10000000000000002");
    expected("control.horizon", MutationKind::TooLow, "0");
    expected("control.stiffness_n_per_m", MutationKind::TooLow, "0.0");
    expected("control.stop_force_n", MutationKind::TooHigh, "1000.0");
    expected("control.seed", MutationKind::TooLow, "-1");
    expected("control.surface[0][0]", MutationKind::NotANumber, "nan");
    expected("control.laws[0]", MutationKind::NotAChoice, "\"none_of_these\"");
    expected("robot.joint[0].length_m", MutationKind::Missing, "");
    expected("robot.joint", MutationKind::TooShort, "[]");
    expected("robot.joint[0].time_constant_s", MutationKind::Infinite, "inf");
    expected("noise.deviation_n", MutationKind::Missing, "");
    expected("cell", MutationKind::TooShort, "\"x\"");
    for key in keys.iter().filter(|key| !matches!(key.kind, Kind::Section(_))) {
        let path = key.path.replace("[]", "[0]");
        let wrong_type = mutations.iter().any(|m| m.key == path && m.kind == MutationKind::WrongType);
        let unknown = mutations.iter().any(|m| m.key == format!("{path}x") && m.kind == MutationKind::Unknown);
        assert!(wrong_type && unknown, "{path}");
    }
}

#[test]
fn verify_refuses_an_outcome_that_does_not_fit() {
    let all = mutations(&Config::keys(""), VALID);
    let valid = parse::<Config>(VALID, "");
    let other = parse::<Config>(&with("law = \"high_damping\"", "law = 1\nhorizon = 99\nhorizom = 4"), "");
    for mutation in &all {
        let fits_valid = mutation.kind == MutationKind::Omitted;
        assert_eq!(mutation.verify(&valid).is_ok(), fits_valid, "{mutation:?}");
        // It has an error of control.law's type and of a misspelt horizon too, but with another value and another key.
        assert!(mutation.verify(&other).is_err(), "{mutation:?}");
    }
}

config_section! {
    /// A section with mistakes in its declaration.
    pub struct Misdeclared {
        /// A default that its own range does not accept.
        speed_m_s: f64 = 2.0, unit "m/s", range 0.0..=1.0;
        /// A list with such a default.
        angles_rad: [f64; 2] = [0.0, 4.0], unit "rad", range -3.2..=3.2;
        /// A number without a unit.
        count: u32 = 1;
        /// A key that another one needs, though it has a default.
        noise: Option<Noise>;
    }
    cross_check count_two_needs_noise;
}

fn count_two_needs_noise(section: &Misdeclared, _: &str, errors: &mut Vec<ConfigError>) {
    if section.count == 2 && section.noise.is_none() {
        errors.push(ConfigError::new("count", 2, "1, or a [noise]"));
    }
}

#[test]
fn mistakes_of_a_declaration_are_found() {
    let text = "speed_m_s = 0.5\nangles_rad = [1.0, 1.0]\ncount = 2\nnoise.deviation_n = 1.0";
    let failures = check_every_key::<Misdeclared>(text).unwrap_err();
    assert_eq!(
        failures,
        [
            "speed_m_s: default: default = 2.0: accepted: 0 to 1 m/s",
            "angles_rad: default: default[1] = 4.0: accepted: -3.2 to 3.2 rad",
            "count: a number without a unit (\"1\" if it has no dimension)",
        ],
        "and nothing about noise, which only a rule between keys needs"
    );
    assert_eq!(check_every_key::<Misdeclared>("count = 2").unwrap_err().len(), 1, "not valid to begin with");
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
cell.toml:1: cell = 3: is an integer; accepted: string, at least 2 characters
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
            "robot.name = \"\": accepted: string, 1 to 16 characters",
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
fn keys_tell_all_that_was_declared() {
    let keys = Config::keys("");
    let key = |path: &str| keys.iter().find(|key| key.path == path).unwrap_or_else(|| panic!("{path}"));
    let sampling = key("control.sampling_time_s");
    assert_eq!(sampling.meaning, "Time between two samples, exactly.");
    assert_eq!((sampling.unit, sampling.range.as_str(), sampling.is_required()), (Some("s"), "0.0001 to 0.1 s", true));
    assert_eq!(key("control.horizon").default.as_deref(), Some("5"));
    assert_eq!(key("control.law").default.as_deref(), Some("\"mpc\""));
    assert_eq!(key("control.stiffness_n_per_m").range, "above 0 N/m");
    assert_eq!(key("control.stop_force_n").range, "1 to below 1000 N");
    assert_eq!(key("control.surface").default.as_deref(), Some("[[1.0, 0.0], [0.0, 1.0]]"));
    assert_eq!(key("control.surface").kind.name(), "array of 2 arrays of 2 numbers");
    assert_eq!(key("robot.joint[].length_m").range, "0 to 5 m");
    assert!(key("robot.joint").is_required());
    assert!(!key("ipc").is_required() && !key("noise").is_required() && key("control").is_required());
    assert_eq!(Joint::keys("robot.joint[]")[0].path, "robot.joint[].length_m");

    let table = keys_markdown(&keys);
    assert_eq!(table.lines().count(), keys.len() + 2);
    let row =
        "| `control.sampling_time_s` | number | s | 0.0001 to 0.1 s | required | Time between two samples, exactly. |";
    assert!(table.contains(row), "{table}");
    let row = "| `control.law` | name |  | \"mpc\" or \"high_damping\" | `\"mpc\"` | Which law runs.<br>`\"mpc\"`: The \
               predictive controller, with its verdict.<br>`\"high_damping\"`: The damping baseline (3). |";
    assert!(table.contains(row), "{table}");
}

#[test]
fn enums_know_their_names() {
    assert_eq!(Law::ALL, [Law::Mpc, Law::HighDamping]);
    assert_eq!(Law::HighDamping.name(), "high_damping");
    assert_eq!(format!("{:>5}", Law::Mpc), "  mpc");
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
