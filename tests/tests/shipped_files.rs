//! Every shipped file is valid, and every key of every kind of file gets its own clear error when
//! it is wrong.

use std::path::{Path, PathBuf};

use admittance_egm::config::EdgeConfig;
use admittance_host::config::{load, mutation::check_every_key};
use admittance_runner::config::Config;
use admittance_runner::cycle;
use end_to_end::closed_loop::Experiment;
use end_to_end::session::{MPC_PAPER, PAPER_SCENARIO};
use plant_sim::scenario::{Scenario, SensorSection};

const EDGE: &str = include_str!("../../deploy/egm/six-joint.egm.toml");
const SCENARIO_BY_EGM: &str = include_str!("../../plant-sim/scenarios/six-joint-egm.toml");

fn toml_files(directory: &str) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(directory);
    let entries =
        std::fs::read_dir(&root).expect("the directory is there").map(|entry| entry.expect("readable").path());
    let files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|end| end == "toml")).collect();
    assert!(!files.is_empty(), "no TOML files in {}", root.display());
    files
}

#[test]
fn shipped_configs_and_scenarios_are_valid_and_describe_something_that_starts() {
    let (edges, of_egm): (Vec<PathBuf>, Vec<PathBuf>) =
        toml_files("deploy/egm").into_iter().partition(|path| path.to_string_lossy().ends_with(".egm.toml"));
    assert!(!edges.is_empty());
    for path in edges {
        let edge: EdgeConfig = load(&path).unwrap_or_else(|error| panic!("{error}"));
        // It stands beside a daemon's file whose arm it fits.
        let daemon = PathBuf::from(path.to_string_lossy().replace(".egm.toml", ".toml"));
        let daemon: Config = load(&daemon).unwrap_or_else(|error| panic!("{error}"));
        let units = admittance_egm::config::units(&daemon);
        edge.egm.speed_limit(&units).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        edge.egm.torque_factors(units.len(), daemon.wrench.source).unwrap_or_else(|error| panic!("{error}"));
    }
    for path in [toml_files("deploy/robots"), toml_files("deploy/demo"), of_egm].concat() {
        let config: Config = load(&path).unwrap_or_else(|error| panic!("{error}"));
        cycle::build(&config).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        config.ipc.settings(None, None, None).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
    for path in toml_files("plant-sim/scenarios") {
        let scenario: Scenario = load(&path).unwrap_or_else(|error| panic!("{error}"));
        plant_sim::run::VirtualRun::new(&scenario).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}

#[test]
fn each_robot_s_configuration_presses_and_slides_in_its_scenario() {
    let read = |path: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
        std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let pairs = [
        ("planar", "paper", 1, 200.0),
        ("planar-three", "planar-three", 1, 150.0),
        ("scara", "scara", 2, 150.0),
        ("gantry", "gantry", 2, 150.0),
        ("five-joint", "five-joint", 2, 150.0),
        ("six-joint", "six-joint", 2, 150.0),
        ("seven-joint", "seven-joint", 2, 150.0),
        ("fr3", "fr3", 2, 150.0),
        ("rail", "rail", 2, 150.0),
        ("eight-joint", "eight-joint", 2, 150.0),
    ];
    // ur10e follows the damping law, which keeps no limit: virtual_time/ur10e_impact.rs.
    assert_eq!(toml_files("deploy/robots").len(), pairs.len() + 1, "each robot has a scenario");
    for (robot, scenario, axis, force_limit) in pairs {
        let config = read(&format!("deploy/robots/{robot}.toml"));
        let scenario = read(&format!("plant-sim/scenarios/{scenario}.toml"));
        let told = admittance_host::config::parse::<Config>(&config, robot).expect("valid");
        let run = Experiment::new(&config, &scenario, told.control.sampling_time_s).run();
        // The least normal force of which every axis that feels it has its minimum.
        let length = told.environment.surface_normal.iter().map(|n| n * n).sum::<f64>().sqrt();
        let shares = told.environment.surface_normal.iter().zip(&told.contact.minimum_force);
        let least = shares.filter(|(n, _)| **n != 0.0).map(|(n, least)| least * length / n.abs()).fold(0.0, f64::max);
        let peak = run.peak(axis);
        println!("{robot}: peak {peak:.1} N, settled {:.1} N", run.settled_normal());
        assert!(run.touched() && peak <= force_limit + 0.5, "{robot}: peak {peak} N");
        assert_eq!((run.stop_reason(), run.infeasible(), run.losses()), (None, 0, 0), "{robot}");
        assert!((run.settled_normal() - least).abs() < 1.0, "{robot}: settles at {} N", run.settled_normal());
        assert!((run.tangential_share() - 1.0).abs() < 0.01, "{robot} slides");
    }
}

/// What a gantry is given on the axes that it doesn't control changes nothing.
#[test]
fn a_wrench_or_twist_on_an_axis_that_is_not_controlled_is_not_looked_at() {
    let read = |path: &str| {
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)).expect("it is shipped")
    };
    let mut experiment =
        Experiment::new(&read("deploy/robots/gantry.toml"), &read("plant-sim/scenarios/gantry.toml"), 0.001);
    let plain = experiment.run();
    // Beyond every threshold and limit of a torque.
    experiment.scenario.sensor = Some(SensorSection {
        in_base_axes: true,
        bias: [0.0, 0.0, 0.0, 30.0, -30.0, 40.0],
        ..Experiment::new(&read("deploy/robots/gantry.toml"), &read("plant-sim/scenarios/gantry.toml"), 0.001)
            .with_tool(0.0, [0.0; 3], [0.0; 3], [0.0; 3])
            .scenario
            .sensor
            .expect("a sensor")
    });
    experiment.scenario.motion[0].twist = vec![0.08, 0.06, -0.1, 0.3, -0.2, 0.1];
    let turned = experiment.run();
    assert_eq!((turned.stop_reason(), turned.losses()), (None, 0));
    assert!(turned.last().state.wrench[3] > 20.0, "it is given: {:?}", turned.last().state.wrench);
    for (one, other) in plain.instants.iter().zip(&turned.instants) {
        assert_eq!(one.command.velocity_offset, other.command.velocity_offset);
        assert_eq!(other.command.twist_command[3..], [0.0; 3]);
        assert_eq!(other.report.wrench[3..], [0.0; 3]);
    }
}

#[test]
fn every_key_missing_unknown_out_of_range_or_of_the_wrong_type_is_named() {
    let daemon = check_every_key::<Config>(MPC_PAPER).unwrap_or_else(|failures| panic!("{}", failures.join("\n")));
    let plant =
        check_every_key::<Scenario>(PAPER_SCENARIO).unwrap_or_else(|failures| panic!("{}", failures.join("\n")));
    let edge = check_every_key::<EdgeConfig>(EDGE).unwrap_or_else(|failures| panic!("{}", failures.join("\n")));
    let robot =
        check_every_key::<Scenario>(SCENARIO_BY_EGM).unwrap_or_else(|failures| panic!("{}", failures.join("\n")));
    println!("{daemon} wrong configurations, {plant} and {robot} wrong scenarios, {edge} wrong files of the EGM edge");
    assert!(daemon > 100 && plant > 80 && robot > 80 && edge > 25, "{daemon}, {plant}, {robot} and {edge} are too few");
}

#[test]
fn keys_that_do_not_fit_each_other_are_named() {
    let cases: [(&[(&str, &str)], &str); 12] = [
        (&[("contact.force_limit", "[200.0]")], "contact.force_limit"),
        (&[("contact.release_threshold", "[6.0, 5.0]")], "contact.release_threshold[0]"),
        (&[("contact.minimum_force", "[300.0, 0.0]")], "contact.minimum_force[0]"),
        (&[("mpc.step_lengths_s", "[0.004, 0.004]")], "mpc.horizon"),
        (&[("control.law", "\"damping\"")], "damping"),
        (&[("control.answer_budget_s", "0.005")], "control.answer_budget_s"),
        (&[("environment.surface_normal", "[0.0, 0.0, 1.0]")], "environment.surface_normal"),
        (&[("contact.admittance_axes", "[false, false]")], "contact.admittance_axes"),
        (&[("robot.task_axes", "4")], "robot.task_axes"),
        (&[("robot.controlled_axes", "[\"y\", \"rz\"]")], "robot.controlled_axes[1]"),
        (&[("robot.controlled_axes", "[\"y\", \"y\"]")], "robot.controlled_axes[1]"),
        (&[("robot.controlled_axes", "[\"y\"]")], "contact.admittance_axes[0]"),
    ];
    for (changes, key) in cases {
        let text = end_to_end::session::with_keys(MPC_PAPER, changes);
        let errors = admittance_host::config::parse::<Config>(&text, "changed.toml").expect_err(key).to_string();
        assert!(errors.contains(key) && errors.contains("accepted"), "{key}: {errors}");
    }
}

#[test]
fn scenarios_that_cannot_be_set_up_say_why() {
    let setup = |changes: &[(&str, &str)]| {
        let text = end_to_end::session::with_keys(PAPER_SCENARIO, changes);
        let scenario: Scenario = admittance_host::config::parse(&text, "changed.toml").expect("valid by itself");
        plant_sim::run::VirtualRun::new(&scenario).expect_err("cannot be set up").to_string()
    };
    assert!(setup(&[("start.joint_position_rad", "[1.0, 0.0]")]).contains("J is not invertible"));
    let far = setup(&[("surface.point_m", "[3.0, 0.68, 0.0]")]);
    assert!(far.contains("start.contact_time_s") && far.contains("surface.point_m = [3.0, 0.68, 0.0]"), "{far}");
}
