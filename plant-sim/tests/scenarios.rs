//! Scenario files: the shipped ones work, and mistakes are named.

mod common;

use admittance_host::config::mutation::check_every_key;
use admittance_host::config::parse;
use common::{PAPER, PLANAR_FREE, SIX_JOINT, run, scenario};
use ipc_types::VirtualPlant;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;
use plant_sim::setup::SetupError;

#[test]
fn every_shipped_scenario_runs_to_its_end() {
    let directory = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let mut shipped = 0;
    for entry in std::fs::read_dir(directory).expect("scenarios are shipped") {
        let path = entry.expect("readable").path();
        let scenario: Scenario = admittance_host::config::load(&path).unwrap_or_else(|error| panic!("{error}"));
        let axes = scenario.robot.task_axes as usize;
        let truths = run(&scenario, |_| vec![0.0; axes]);
        let motion: f64 = scenario.motion.iter().map(|phase| phase.duration_s).sum();
        let last = truths.last().expect("a run");
        assert!((last.scenario_time_s - motion).abs() < 1e-9, "{}", path.display());
        assert!((truths[0].scenario_time_s + scenario.timing.settle_s).abs() < 1e-9, "{}", path.display());
        shipped += 1;
    }
    assert!(shipped >= 3, "{shipped} scenarios");
}

#[test]
fn every_key_is_checked() {
    // A text with every key that a scenario can have.
    let full = format!(
        "{}\n[[fault]]\nat_s = 0.5\nduration_s = 0.1\nkind = \"drop\"\n",
        PAPER.replace("wrench = 0.0", "wrench = 0.0\njoint_position_rad = 0.0\njoint_velocity_rad_s = 0.0\nseed = 1")
    );
    match check_every_key::<Scenario>(&full) {
        Ok(mutations) => assert!(mutations > 150, "{mutations} mutations"),
        Err(failures) => panic!("{}", failures.join("\n")),
    }
}

#[test]
fn every_key_of_a_surface_is_checked() {
    let tables = "\n[surface.step]\ndirection = [1.0, 0.0, 0.0]\nat_m = 0.1\nwidth_m = 0.0\nstiffness_n_m = 2e5\n\
                  [surface.hunt_crossley]\nexponent = 1.5\ndepth_m = 0.001\ndamping_s_m = 1.0\n\
                  [surface.plate]\nvelocity_m_s = 0.01\namplitude_m = 0.001\nfrequency_hz = 3.0\n";
    let keys = "stiffness_n_m = 1e5\nshape = \"sphere\"\ncurvature_1_m = 2.0";
    let full = format!("{}{tables}", PAPER.replace("stiffness_n_m = 1e5", keys));
    let hardening = format!("{PAPER}\n[surface.hardening]\ndepth_m = 0.001\n");
    for text in [full, hardening] {
        check_every_key::<Scenario>(&text).unwrap_or_else(|failures| panic!("{}", failures.join("\n")));
    }
}

#[test]
fn keys_of_a_surface_fit_each_other() {
    let hunt = "\n[surface.hunt_crossley]\ndamping_s_m = 1.0\n";
    let hardening = "\n[surface.hardening]\ndepth_m = 0.001\n";
    let step = "\n[surface.step]\ndirection = [0.0, 0.0, 0.0]\nat_m = 0.1\nstiffness_n_m = 2e5\n";
    for (key, tables, error) in [
        ("shape = \"sphere\"", "", "surface.curvature_1_m = 0"),
        ("shape = \"plane\"\ncurvature_1_m = 2.0", "", "surface.curvature_1_m = 2"),
        ("curvature_1_m = 2.0\naxis = [0.42, 0.9, 0.0]", "", "surface.axis"),
        ("", &format!("{hunt}{hardening}"), "surface.hardening = { depth_m = 0.001 }"),
        ("axis = [1.0, 0.0, 0.0]", "", "surface.axis = [1.0, 0.0, 0.0]"),
        ("maxwell_relaxation_time_s = 0.1", "", "surface.maxwell_relaxation_time_s = 0.1"),
        ("slip_velocity_m_s = 0.1", "", "surface.slip_velocity_m_s = 0.1"),
        ("", "\n[surface.plate]\nfrequency_hz = 3.0\n", "surface.plate.frequency_hz = 3"),
        ("", "\n[surface.plate]\namplitude_m = 0.1\nfrequency_hz = 1000.0\n", "surface.plate.amplitude_m = 0.1"),
        ("damping_n_s_m = 3.0", hunt, "surface.damping_n_s_m = 3"),
        ("maxwell_stiffness_n_m = 5e4", hardening, "surface.maxwell_stiffness_n_m = 50000"),
        ("", step, "surface.step.direction"),
    ] {
        let text = format!("{}{tables}", PAPER.replace("stiffness_n_m = 1e5", &format!("stiffness_n_m = 1e5\n{key}")));
        let found = parse::<Scenario>(&text, "paper.toml").expect_err(error).to_string();
        assert!(found.contains(error) && found.contains("accepted"), "{error}: {found}");
    }
}

#[test]
fn lengths_follow_the_arm() {
    let errors = |from: &str, to: &str| {
        let text = PAPER.replacen(from, to, 1);
        assert_ne!(text, PAPER, "{from} is part of the scenario");
        parse::<Scenario>(&text, "paper.toml").expect_err("not acceptable").to_string()
    };
    for (from, to, key) in [
        ("[1.3, -1.4]", "[1.3, -1.4, 0.2]", "start.joint_position_rad = 3 values"),
        (
            "time_constant_s = [0.020, 0.020]",
            "time_constant_s = [0.020, 0.020, 0.0]",
            "wrench.time_constant_s = 3 values",
        ),
        ("[0.0, -0.25]", "[0.0, -0.25, 0.0]", "motion[0].twist = 3 values"),
        ("[0.015, 0.010]", "[0.015, 0.010, 0.010]", "robot.velocity_time_constant_s"),
        ("task_axes = 2", "task_axes = 3", "robot.task_axes"),
    ] {
        let text = errors(from, to);
        assert!(text.contains(key), "{text}");
    }
    let coarse = PAPER.replace("sampling_time_s = 0.004", "sampling_time_s = 0.0005").replace("0.0001", "0.001");
    let text = parse::<Scenario>(&coarse, "paper.toml").expect_err("not acceptable").to_string();
    assert!(text.contains("timing.substep_s = 0.001") && text.contains("0.0005 s"), "{text}");
    let zero = errors("[0.42261826174069944, 0.9063077870366499, 0.0]", "[0.0, 0.0, 0.0]");
    assert!(zero.contains("surface.normal"), "{zero}");
}

fn setup_error(change: impl Fn(&mut Scenario)) -> SetupError {
    let mut scenario = scenario(PAPER);
    change(&mut scenario);
    VirtualRun::new(&scenario).expect_err("cannot be set up")
}

#[test]
fn a_start_that_cannot_be_is_refused() {
    let stretched = setup_error(|scenario| scenario.start.joint_position_rad = vec![0.5, 0.0]);
    assert!(matches!(stretched, SetupError::SingularStart { .. }), "{stretched}");
    assert!(stretched.to_string().contains("start.joint_position_rad = [0.5, 0.0]"), "{stretched}");

    let far = setup_error(|scenario| scenario.surface.as_mut().expect("a surface").point_m = [2.5, 0.0, 0.0]);
    assert!(matches!(far, SetupError::Unreachable { .. }), "{far}");

    // Away from the surface: the start that meets the point is inside the material.
    let away = setup_error(|scenario| scenario.motion[0].twist = vec![0.0, 0.25]);
    assert!(matches!(away, SetupError::NotApproaching { .. }), "{away}");
    assert!(away.to_string().contains("start.contact_time_s"), "{away}");
    let still = setup_error(|scenario| scenario.motion[0].twist = vec![0.0, 0.0]);
    assert!(matches!(still, SetupError::NotApproaching { .. }), "{still}");

    // A start in contact is allowed where no instant of contact is asked for.
    let mut pressing = scenario(PAPER);
    pressing.start.contact_time_s = None;
    pressing.start.joint_position_rad = vec![0.9, -1.3];
    let mut run = VirtualRun::new(&pressing).expect("can be set up");
    assert_eq!(run.advance(None).expect("nothing to reject").in_contact, 1);
}

#[test]
fn an_arm_without_code_is_refused() {
    let mut odd = scenario(SIX_JOINT);
    odd.robot.task_axes = 3;
    assert!(matches!(VirtualRun::new(&odd), Err(SetupError::Arm { joints: 6, axes: 3 })));
}

#[test]
fn the_command_path_is_followed_exactly() {
    // q0 after each phase is where the integral of the commanded velocity leads.
    let scenario = scenario(PLANAR_FREE);
    let mut run = VirtualRun::new(&scenario).expect("can be set up");
    let tcp = |q: &[f64]| [q[0].cos() + (q[0] + q[1]).cos(), q[0].sin() + (q[0] + q[1]).sin()];
    let start = tcp(&scenario.start.joint_position_rad);
    let mut last = start;
    while !run.is_finished() {
        last = tcp(&run.sample().expect("published").joint_position_reference);
        run.advance(None).expect("nothing to reject");
    }
    let expected = [start[0] + 0.4 * 0.2 - 0.6 * 0.1, start[1] - 0.6 * 0.25 + 0.6 * 0.25];
    assert!((last[0] - expected[0]).abs() < 1e-9 && (last[1] - expected[1]).abs() < 1e-9, "{last:?} {expected:?}");
}
