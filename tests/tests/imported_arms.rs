//! Arms that `admittancectl import` has made of real descriptions move and weigh as Pinocchio says.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use admittance_core::robot::{ArmDynamics, LinkInertia, Pose};
use admittance_core::with_arm;
use admittance_host::config::parse;
use admittance_runner::config::Config;
use end_to_end::{Need, binaries, needs, python};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use plant_sim::scenario::Scenario;
use serde_json::Value;

/// Random poses of each arm.
const POSES: usize = 1000;
/// m, rad, m/rad, N m; of joints that slide m/m and N.
const AGREEMENT: f64 = 1e-9;

/// What import prints.
fn imported(arm: &Value, more: &[&str]) -> String {
    let text = |key: &str| arm[key].as_str().expect("a text").to_owned();
    let mut command = Command::new(&binaries().admittancectl);
    command.args(["import", &text("urdf"), "--base", &text("base"), "--tip", &text("tip")]).args(more);
    let output = command.output().expect("it starts");
    assert!(output.status.success(), "{arm:.80}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// The text with its examples in place of what is to be filled in.
fn filled_in(printed: &str) -> String {
    let filled = printed.lines().map(|line| match (line.starts_with('#'), line.rsplit_once("; such as ")) {
        (false, Some((_, example))) => format!("{} = {example}", line.split(' ').next().unwrap_or_default()),
        _ => line.to_owned(),
    });
    filled.collect::<Vec<_>>().join("\n")
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().expect("a number")],
    }
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_column_slice(&numbers(value))
}

/// The largest differences of an arm from what Pinocchio computes: of the pose, the Jacobian and
/// the torques.
fn differences<const N: usize>(scenario: &Scenario, arm: &Value) -> [f64; 3] {
    let chain = scenario.robot.chain::<N>().expect("so many joints");
    let bodies = &scenario.rigid_body.as_ref().expect("import gives masses").joint;
    let links: [LinkInertia; N] = std::array::from_fn(|joint| {
        let body = &bodies[joint];
        LinkInertia::of_elements(body.mass_kg, body.center_of_gravity_m, body.inertia_kg_m2)
    });
    let dynamics = ArmDynamics::new(chain, links, SVector::zeros(), vector(&arm["gravity"])).expect("bodies");
    let poses = arm["poses"].as_array().expect("a list");
    assert_eq!(poses.len(), POSES);
    poses.iter().fold([0.0_f64; 3], |[pose, jacobian, torque], expected| {
        let q = SVector::<f64, N>::from_column_slice(&numbers(&expected["q"]));
        let here = chain.kinematics(&q);
        let there = Pose {
            position: vector(&expected["position"]),
            rotation: Matrix3::from_row_slice(&numbers(&expected["rotation"])),
        };
        let of_jacobian = here.jacobian - SMatrix::<f64, 6, N>::from_row_slice(&numbers(&expected["jacobian"]));
        let weight = SVector::<f64, N>::from_column_slice(&numbers(&expected["gravity_torque"]));
        [
            pose.max((here.pose.position - there.position).amax()).max((here.pose.rotation - there.rotation).amax()),
            jacobian.max(of_jacobian.amax()),
            torque.max((dynamics.at(&q).gravity_torque() - weight).amax()),
        ]
    })
}

/// Joint by joint: where the URDF says a limit, the files have it; a narrower end is a soft limit, and said
/// to be one.
fn limits_agree(config: &Config, scenario: &Scenario, printed: &str, arm: &Value) {
    let limits = &config.limits;
    let list = |list: &Option<Vec<f64>>| list.clone().expect("import prints it");
    let (lower, upper) = (list(&limits.joint_position_min_rad), list(&limits.joint_position_max_rad));
    let speeds = list(&limits.joint_speed_rad_s);
    let bodies = &scenario.rigid_body.as_ref().expect("import gives masses").joint;
    let expected = arm["limits"].as_array().expect("a list");
    assert_eq!(expected.len(), speeds.len(), "{:.80}", arm["urdf"]);
    for (joint, expected) in expected.iter().enumerate() {
        let named = format!("{}, joint {joint}: {expected}", arm["urdf"]);
        let found = [lower[joint], upper[joint]];
        let hard = if expected["position"].is_null() { vec![-100.0, 100.0] } else { numbers(&expected["position"]) };
        if found != hard[..] {
            let comment = printed.lines().find(|line| line.starts_with(&format!("# joint {joint}: ")));
            let is_soft = comment.is_some_and(|comment| comment.contains("within soft limits"));
            assert!(is_soft && found[0] >= hard[0] && found[1] <= hard[1], "{named}: {found:?}, {comment:?}");
        }
        let of = |key: &str| expected[key].as_f64().filter(|limit| *limit > 0.0);
        // Not said, or 0: the example of what is to be filled in.
        assert_eq!(speeds[joint], of("speed").unwrap_or(1.0), "{named}");
        assert_eq!(bodies[joint].torque_limit_n_m, of("effort").filter(|effort| *effort >= 0.1), "{named}");
    }
}

/// `validate` refuses what `import` has printed for the marked lines and no others.
fn only_marked_lines_are_refused(printed: &str, scenario: bool) {
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join(if scenario { "arm.scenario.toml" } else { "arm.toml" });
    std::fs::write(&file, printed).expect("written");
    let mut command = Command::new(&binaries().admittancectl);
    command.arg("validate").args(scenario.then_some("--scenario")).arg(&file);
    let output = command.output().expect("it starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(78), "{said}");
    let marked = (1..).zip(printed.lines()).filter(|(_, line)| !line.starts_with('#') && line.contains("# FILL IN: "));
    let marked: BTreeSet<usize> = marked.map(|(number, _)| number).collect();
    let line_of = |error: &str| error.split_once(".toml:")?.1.split(':').next()?.parse().ok();
    let refused: BTreeSet<usize> = said.lines().filter_map(line_of).collect();
    assert_eq!(refused, marked, "{said}");
}

#[test]
fn imported_arms_are_those_of_pinocchio() {
    if !needs(Need::RobotDescriptions) {
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/imported_arms.py");
    let mut reference = Command::new(python().expect("it is needed"));
    let output = reference.arg(script).arg(POSES.to_string()).output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let arms: Vec<Value> = serde_json::from_slice(&output.stdout).expect("JSON");
    assert!(arms.len() >= 9, "{} arms", arms.len());
    for arm in &arms {
        let name = arm["urdf"].as_str().expect("a path");
        let [robot_file, scenario_file] = [&[][..], &["--scenario"]].map(|more| imported(arm, more));
        only_marked_lines_are_refused(&robot_file, false);
        only_marked_lines_are_refused(&scenario_file, true);
        let config: Config = parse(&filled_in(&robot_file), name).unwrap_or_else(|errors| panic!("{errors}"));
        let scenario: Scenario = parse(&filled_in(&scenario_file), name).unwrap_or_else(|errors| panic!("{errors}"));
        limits_agree(&config, &scenario, &robot_file, arm);
        assert_eq!((&config.robot.joint, &config.robot.tool), (&scenario.robot.joint, &scenario.robot.tool), "{name}");
        let (joints, axes) = (config.robot.joint.len(), config.robot.task_axes);
        let found = with_arm!((joints, axes), <N, _D> => differences::<N>(&scenario, arm), else [f64::NAN; 3]);
        println!(
            "{name}: {joints} joints, pose {:.1e}, Jacobian {:.1e}, torque {:.1e} N m",
            found[0], found[1], found[2]
        );
        assert!(found.iter().all(|difference| *difference <= AGREEMENT), "{name}: {found:?}");
    }
}
