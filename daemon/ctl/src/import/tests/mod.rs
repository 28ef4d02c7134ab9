//! What a URDF becomes, and what is refused of it.

mod any_bytes;
mod refusals;

use std::path::PathBuf;

use admittance_host::config::parse;
use admittance_host::robot_description::KindName;
use admittance_runner::config::Config;
use plant_sim::scenario::Scenario;

use super::{Origin, marked, printed};

const ARM: &str = include_str!("arm.urdf");

fn origin(base: &str, tip: &str) -> Origin {
    let [base, tip] = [base, tip].map(str::to_owned);
    Origin { urdf: PathBuf::from("/arms/arm.urdf"), sha256: "0".repeat(64), base, tip }
}

/// What import prints of the arm, or says.
fn import(text: &str, scenario: bool) -> Result<String, String> {
    printed(text.as_bytes(), &origin("world", "tcp"), scenario).map_err(|refused| refused.of("arm.urdf"))
}

fn one_of(text: &str, start: &str) -> Vec<f64> {
    let line = text.lines().find_map(|line| line.strip_prefix(start)).unwrap_or_else(|| panic!("{start}: {text}"));
    let list = line.split(" = ").nth(1).and_then(|list| list.split("   #").next()).expect("a value");
    list.trim_matches(['[', ']']).split(", ").map(|value| value.parse().expect("a number")).collect()
}

/// The arm with a finger that a tip can hang on.
fn arm_with_a_finger() -> String {
    let (point, body) = (
        "<mass value=\"2\"/><inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>",
        "<mass value=\"2\"/><inertia ixx=\"1e-3\" ixy=\"0\" ixz=\"0\" iyy=\"1e-3\" iyz=\"0\" izz=\"1e-3\"/>",
    );
    assert!(ARM.contains(point));
    ARM.replacen(point, body, 1)
}

#[test]
fn fixed_joints_and_what_hangs_on_a_link_are_folded_in() {
    let config: Config = parse(&marked::with_examples(&import(ARM, false).expect("an arm")), "arm").expect("valid");
    let robot = config.robot;
    assert_eq!((robot.name.as_str(), robot.task_axes, robot.joint.len()), ("made-up \"six\"", 6, 6));
    // The stand's turn and height come before the first joint's.
    assert_eq!((robot.joint[0].origin_m, robot.joint[0].origin_rpy_rad), ([0.0, 0.0, 0.7], [0.0, 0.0, 1.5]));
    assert_eq!(robot.joint[0].axis, [0.0, 0.0, 1.0]);
    // An axis that is not said is x.
    assert_eq!(robot.joint[3].axis, [1.0, 0.0, 0.0]);
    // 9 rad is more than the robot file takes: the same turn is written with less.
    assert!((robot.joint[2].origin_rpy_rad[1].sin() - 9.0_f64.sin()).abs() < 1e-12);
    let tool = robot.tool;
    assert!((tool.origin_m[0] - 0.3).abs() < 1e-15 && tool.origin_m[2].abs() < 1e-15, "{tool:?}");
    assert!((tool.origin_rpy_rad[1] - std::f64::consts::FRAC_PI_2).abs() < 1e-12, "{tool:?}");
    let source = robot.source.expect("it is from a URDF");
    assert_eq!((source.urdf, source.tip.as_str()), (PathBuf::from("/arms/arm.urdf"), "tcp"));
    let limits = config.limits;
    let lower = limits.joint_position_min_rad.expect("said");
    assert_eq!(lower, [-100.0, -2.0, -2.6, -100.0, -2.0, -3.0]);

    let scenario: Scenario = parse(&marked::with_examples(&import(ARM, true).expect("an arm")), "arm").expect("valid");
    let bodies = scenario.rigid_body.expect("masses").joint;
    // Flange, gripper and finger: 1 kg at 0 m, 1 kg at 0.2 m, 2 kg at 0.2 m.
    let last = &bodies[5];
    assert!((last.mass_kg - 4.0).abs() < 1e-12 && (last.center_of_gravity_m[0] - 0.15).abs() < 1e-12, "{last:?}");
    let across = 0.001 + 1.0 * 0.15 * 0.15 + 3.0 * 0.05 * 0.05;
    assert!(
        (last.inertia_kg_m2[0] - 0.001).abs() < 1e-12 && (last.inertia_kg_m2[2] - across).abs() < 1e-12,
        "{last:?}"
    );
    // The inertia is along the axes of its own frame, which is turned against the link's.
    let (sine, cosine) = 0.3_f64.sin_cos();
    assert!((bodies[1].inertia_kg_m2[3] - (0.01 - 0.1) * sine * cosine).abs() < 1e-12, "{:?}", bodies[1]);
    assert_eq!((bodies[1].viscous_friction_n_m_s_rad, bodies[1].coulomb_friction_n_m), (3.0, 1.5));
    let torques: Vec<_> = bodies.iter().map(|body| body.torque_limit_n_m).collect();
    assert_eq!(torques, [None, Some(150.0), None, Some(30.0), Some(30.0), Some(20.0)]);
}

/// Two joints in the plane of x and y have the two axes of the paper's arm, any other arm all six, and of these as
/// many as its joints can move the tip on.
#[test]
fn an_arm_of_any_number_of_joints_has_the_axes_that_it_can_move() {
    // The tip is a hand's length beyond the last joint.
    let of = |text: &str, last: &str| {
        let end = format!(
            "<joint name=\"end\" type=\"fixed\"><parent link=\"{last}\"/><child link=\"end\"/><origin xyz=\"0.3 0 0\"/>\
             </joint><link name=\"end\"/></robot>"
        );
        let printed = printed(text.replacen("</robot>", &end, 1).as_bytes(), &origin("world", "end"), false)
            .unwrap_or_else(|refused| panic!("{}", refused.of("arm.urdf")));
        parse::<Config>(&marked::with_examples(&printed), "arm").unwrap_or_else(|errors| panic!("{errors}")).robot
    };
    let axes = |names: &[&str]| Some(names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>());
    let planar = of(&ARM.replacen("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 -1\"/>", 1), "upper");
    assert_eq!((planar.joint.len(), planar.task_axes, planar.controlled_axes), (2, 2, None));
    // A column that turns, a shoulder and an elbow that nod: the tip goes round, up and out.
    let nods = of(ARM, "fore");
    assert_eq!((nods.joint.len(), nods.task_axes, nods.controlled_axes), (3, 6, axes(&["x", "y", "z"])));
    let upright = ARM.replacen("<axis xyz=\"0 0 2\"/>", "<axis xyz=\"0 1 0\"/>", 1).replacen(" rpy=\"0 0 1.5\"", "", 1);
    let upright = of(&upright, "fore");
    assert_eq!((upright.joint.len(), upright.task_axes, upright.controlled_axes), (3, 6, axes(&["x", "z", "ry"])));
    let five = of(ARM, "hand");
    assert_eq!((five.joint.len(), five.task_axes, five.controlled_axes), (5, 6, axes(&["x", "y", "z", "rx", "ry"])));
}

/// Nothing is refused but what is marked, and everything that is marked is.
#[test]
fn only_what_is_marked_is_left_to_fill_in() {
    let marks = |text: &str| -> Vec<usize> {
        let is_marked = |(_, line): &(usize, &str)| !line.starts_with('#') && line.contains("# FILL IN: ");
        (1..).zip(text.lines()).filter(is_marked).map(|(number, _)| number).collect()
    };
    let lines = |errors: admittance_host::config::ConfigErrors| {
        let mut lines: Vec<usize> = errors.errors.iter().filter_map(|error| error.line).collect();
        lines.dedup();
        lines
    };
    let robot = import(ARM, false).expect("an arm");
    assert_eq!(lines(parse::<Config>(&robot, "arm").expect_err("to be filled in")), marks(&robot), "{robot}");
    let scenario = import(ARM, true).expect("an arm");
    assert_eq!(
        lines(parse::<Scenario>(&scenario, "arm").expect_err("to be filled in")),
        marks(&scenario),
        "{scenario}"
    );
    for said in ["nan where the URDF says no speed", "effort not said"] {
        assert!(robot.contains(said), "{robot}");
    }
    for said in
        ["the URDF gives this link no mass", "as if at zero: \"finger\"", "kg m^2: no body has what the URDF gives"]
    {
        assert!(scenario.contains(said), "{said}: {scenario}");
    }
    let speeds = robot.lines().find(|line| line.starts_with("joint_speed")).expect("a line");
    assert!(speeds.starts_with("joint_speed_rad_s = [nan, 2.0, nan, 3.0, 3.0, 4.0]"), "{speeds}");
}

/// Down to a finger that slides: seven joints. Down to the wrist: four, with as many axes.
#[test]
fn joints_may_slide_and_fewer_than_six_control_what_they_can() {
    let of = |tip: &str| {
        let text = printed(arm_with_a_finger().as_bytes(), &origin("world", tip), false)
            .map_err(|refused| refused.of("arm.urdf"));
        let text = text.expect("an arm");
        (parse::<Config>(&marked::with_examples(&text), "arm").expect("valid"), text)
    };
    let (config, text) = of("finger");
    let kinds: Vec<KindName> = config.robot.joint.iter().map(|joint| joint.kind).collect();
    assert_eq!(kinds[6], KindName::Prismatic);
    assert!(kinds[..6].iter().all(|kind| *kind == KindName::Revolute));
    assert_eq!(config.robot.controlled_axes, None);
    assert!(text.contains("\"finger\", prismatic, speed 0.1 m/s, effort 40 N"), "{text}");
    assert_eq!((one_of(&text, "joint_position_min_rad")[6], one_of(&text, "joint_position_max_rad")[6]), (0.01, 0.05));
    let (config, _) = of("wrist");
    assert_eq!((config.robot.joint.len(), config.robot.task_axes), (4, 6));
    let controlled = config.robot.controlled_axes.expect("four of them");
    assert_eq!(controlled, ["x", "y", "z", "rx"]);
    assert_eq!(config.contact.admittance_axes, [true, true, true, false, false, false]);
}

/// The masses of the configuration's comment are those of the scenario, and are what the wrench from motor
/// torques wants.
#[test]
fn masses_are_in_the_comment_too() {
    let robot = import(ARM, false).expect("an arm");
    let commented = one_of(&robot, "# mass_kg");
    assert_eq!(commented, one_of(&import(ARM, true).expect("an arm"), "mass_kg"));
    let (file, masses) = robot.split_once("# Masses, ").expect("they come last");
    let masses: String = masses.lines().skip(3).map(|line| format!("{}\n", line[1..].trim_start())).collect();
    let text = format!("{file}\n{masses}").replacen("sign = \"\"", "source = \"motor_torque\"\nsign = \"\"", 1);
    let config: Config = parse(&marked::with_examples(&text), "arm").unwrap_or_else(|errors| panic!("{errors}"));
    let joints = config.dynamics.expect("they are there").joint;
    assert_eq!((joints[1].viscous_friction_n_m_s_rad, joints[1].coulomb_friction_n_m), (3.0, 1.5));
    assert!(robot.contains("# coulomb_friction_n_m = nan   # FILL IN: the URDF says none"), "{robot}");
}

/// What neither plant nor observer takes is marked, and refuses no robot file: friction of a heavy joint
/// that slides, a link that weighs next to nothing or far too much.
#[test]
fn masses_and_friction_out_of_range_are_marked() {
    for (from, to, expected) in [
        (
            "damping=\"3\"",
            "damping=\"20000\"",
            "viscous_friction_n_m_s_rad = nan   # FILL IN: the URDF says 20000, accepted: 0 to 10000",
        ),
        ("friction=\"1.5\"", "friction=\"1e300\"", "coulomb_friction_n_m = nan   # FILL IN: the URDF says 1e300,"),
        (
            "<mass value=\"4\"/>",
            "<mass value=\"0.0005\"/>",
            "mass_kg = nan   # FILL IN: the URDF says 0.0005, accepted: 0.001 to 5000",
        ),
        ("<mass value=\"4\"/>", "<mass value=\"1e308\"/>", "mass_kg = nan   # FILL IN: the URDF says 1e308,"),
    ] {
        assert!(ARM.contains(from), "{from}");
        let text = ARM.replacen(from, to, 1);
        for scenario in [true, false] {
            let printed = import(&text, scenario).unwrap_or_else(|why| panic!("{to}: {why}"));
            assert!(printed.contains(expected), "{to}: {printed}");
        }
    }
}

/// Extensions are not looked at: a variable of theirs makes no xacro.
#[test]
fn an_extension_may_have_variables() {
    let plugin = "<gazebo><plugin filename=\"${sensors}/a.so\"><link name=\"${b}\"/></plugin></gazebo></robot>";
    assert_eq!(import(&ARM.replacen("</robot>", plugin, 1), false), import(ARM, false));
}

/// What urdf-rs knows of later versions: a quaternion in place of angles.
#[test]
fn a_quaternion_of_version_1_1_is_a_turn() {
    let text = ARM.replace("<robot ", "<robot version=\"1.1\" ").replace(
        "<origin xyz=\"0 0.1 0.1\"/>",
        "<origin xyz=\"0 0.1 0.1\" quat_xyzw=\"0 0 0.7071067811865476 0.7071067811865476\"/>",
    );
    let config: Config = parse(&marked::with_examples(&import(&text, false).expect("an arm")), "arm").expect("valid");
    let yaw = config.robot.joint[1].origin_rpy_rad[2];
    assert!((yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-12, "{yaw}");
}

/// Narrower ends take the place of those of the limit, and that is said; wider ones change nothing.
#[test]
fn soft_limits_are_kept_where_they_are_narrower() {
    let with = |soft: &str| {
        let text = ARM.replacen("<dynamics", &format!("<safety_controller {soft}/><dynamics"), 1);
        import(&text, false).expect("an arm")
    };
    let narrower = with("soft_lower_limit=\"-1.9\" soft_upper_limit=\"2.6\" k_velocity=\"10\"");
    assert_eq!(one_of(&narrower, "joint_position_min_rad")[1], -1.9);
    assert_eq!(one_of(&narrower, "joint_position_max_rad")[1], 2.5);
    assert!(narrower.contains("# Of joint 1: the soft limits of <safety_controller>"), "{narrower}");
    assert!(narrower.contains("\"shoulder\", revolute within soft limits"), "{narrower}");
    let wider = with("soft_lower_limit=\"-2\" soft_upper_limit=\"3\"");
    assert!(one_of(&wider, "joint_position_min_rad")[1] == -2.0 && !wider.contains("soft limits"), "{wider}");
}

/// What urdf-rs would refuse without a name, and what only the length of an axis overflows on.
#[test]
fn what_is_not_needed_may_be_absent() {
    let text = ARM.replacen("effort=\"40\"", "", 1).replacen("velocity=\"0.1\"", "jerk=\"fast\"", 1);
    assert_eq!(import(&text, true), import(ARM, true));
    let text = ARM.replacen("<axis xyz=\"0 0 2\"/>", "<axis xyz=\"1e200 1e200 0\"/>", 1);
    let config: Config = parse(&marked::with_examples(&import(&text, false).expect("an arm")), "arm").expect("valid");
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert!((config.robot.joint[0].axis[1] - half).abs() < 1e-15, "{:?}", config.robot.joint[0].axis);
}

#[test]
fn a_printed_command_is_one_that_a_shell_takes() {
    let mut origin = origin("world", "the tip's");
    origin.urdf = PathBuf::from("/my arms/arm.urdf");
    assert_eq!(origin.words(), r"'/my arms/arm.urdf' --base world --tip 'the tip'\''s'");
}
