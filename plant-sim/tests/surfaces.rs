//! Surfaces of other shapes and laws than a plane with a spring, and one that moves: against closed
//! forms, with joints of (4) and with masses.

mod common;

use common::{PAPER, SIX_JOINT, SIX_JOINT_MASSES, run, scenario};
use ipc_types::TruthSample;
use nalgebra::{Matrix2, Vector2, Vector3};
use plant_sim::environment::{
    HardeningSection, HuntCrossleySection, PlateSection, ShapeName, StiffnessStepSection, SurfaceSection,
};
use plant_sim::rigid_body::RigidBodySection;
use plant_sim::scenario::Scenario;

const STIFFNESS: f64 = 1e5;

fn surface(scenario: &mut Scenario) -> &mut SurfaceSection {
    scenario.surface.as_mut().expect("a surface")
}

fn run_at_rest(scenario: &Scenario) -> Vec<TruthSample> {
    run(scenario, |_| vec![0.0; scenario.robot.task_axes as usize])
}

fn pressing(truths: &[TruthSample]) -> impl Iterator<Item = &TruthSample> {
    truths.iter().filter(|truth| truth.normal_force_n > 1.0)
}

/// Two uniform rods of 1 m, 4 and 3 kg, that float: drives without any torque, in a plane without gravity.
const FLOATING: &str = "
[drive]
feed_forward_factor = 0.0

[[joint]]
mass_kg = 4.0
center_of_gravity_m = [0.5, 0.0, 0.0]
inertia_kg_m2 = [0.001, 0.3333333333333333, 0.3333333333333333, 0.0, 0.0, 0.0]
speed_gain_n_m_s_rad = 0.0

[[joint]]
mass_kg = 3.0
center_of_gravity_m = [0.5, 0.0, 0.0]
inertia_kg_m2 = [0.001, 0.25, 0.25, 0.0, 0.0, 0.0]
speed_gain_n_m_s_rad = 0.0
";

/// Joint positions of the floating arm, and what it weighs along the normal (0, 1): by the textbook's
/// M(q) of two links, inverted by hand.
fn floating_arm() -> ([f64; 2], f64) {
    let (q1, q2) = (0.9f64, -1.3f64);
    let (m1, m2, half, i1, i2) = (4.0, 3.0, 0.5, 1.0 / 3.0, 0.25);
    let coupled = i2 + m2 * (half * half + half * q2.cos());
    let first = i1 + i2 + m1 * half * half + m2 * (1.0 + half * half + 2.0 * half * q2.cos());
    let mass = Matrix2::new(first, coupled, coupled, i2 + m2 * half * half);
    let vertical = Vector2::new(q1.cos() + (q1 + q2).cos(), (q1 + q2).cos());
    let mobility = vertical.dot(&(mass.try_inverse().expect("a mass") * vertical));
    ([q1, q2], 1.0 / mobility)
}

/// A plate that hits the floating arm from below at this speed, and the arm's mass along its normal.
fn hit(speed: f64) -> (Scenario, f64) {
    let (joints, mass) = floating_arm();
    let mut scenario = scenario(PAPER);
    scenario.rigid_body = Some(toml_section(FLOATING));
    scenario.timing.sampling_time_s = 1e-4;
    scenario.timing.command_delay_s = 0.0;
    scenario.timing.substep_s = 2.5e-5;
    scenario.timing.settle_s = 0.001;
    scenario.start.joint_position_rad = joints.to_vec();
    scenario.start.contact_time_s = None;
    scenario.motion[0].twist = vec![0.0, 0.0];
    scenario.motion[0].duration_s = 0.06;
    let [q1, q2] = joints;
    let tcp = [q1.cos() + (q1 + q2).cos(), q1.sin() + (q1 + q2).sin() - 0.001, 0.0];
    let surface = surface(&mut scenario);
    (surface.point_m, surface.normal, surface.stiffness_n_m) = (tcp, [0.0, 1.0, 0.0], STIFFNESS);
    surface.plate = Some(PlateSection { velocity_m_s: speed, amplitude_m: 0.0, frequency_hz: 1.0 });
    (scenario, mass)
}

fn toml_section(text: &str) -> RigidBodySection {
    let lines = text.replace("[drive]", "[rigid_body.drive]").replace("[[joint]]", "[[rigid_body.joint]]");
    let whole: Scenario = admittance_host::config::parse(&format!("{PAPER}\n{lines}"), "floating").expect("valid");
    whole.rigid_body.expect("given")
}

fn peak(truths: &[TruthSample]) -> f64 {
    truths.iter().map(|truth| truth.peak_normal_force_n).fold(0.0, f64::max)
}

fn deepest(truths: &[TruthSample]) -> f64 {
    truths.iter().map(|truth| truth.penetration_m).fold(0.0, f64::max)
}

/// Velocity of the tool along the normal in m/s where it has just left the plate; later the arm turns.
fn leaving(truths: &[TruthSample]) -> f64 {
    let last = truths.iter().rposition(|truth| truth.in_contact == 1).expect("a touch");
    truths[last + 1].tcp_twist[1]
}

#[track_caller]
fn assert_near(found: f64, expected: f64, within: f64) {
    assert!((found / expected - 1.0).abs() < within, "{found}, not {expected}");
}

#[test]
fn a_linear_impact_peaks_at_the_root_of_mass_and_stiffness() {
    let speed = 0.1;
    let (scenario, mass) = hit(speed);
    let truths = run_at_rest(&scenario);
    assert_near(peak(&truths), (mass * STIFFNESS).sqrt() * speed, 2e-3);
    // Half a period in contact, from 1 mm away; a plate that weighs without end gives twice its speed.
    let touches: Vec<f64> = pressing(&truths).map(|truth| truth.scenario_time_s).collect();
    let lasted = touches[touches.len() - 1] - touches[0];
    assert!((touches[0] - 0.01).abs() < 3e-4, "{} s", touches[0]);
    assert_near(lasted, std::f64::consts::PI * (mass / STIFFNESS).sqrt(), 0.05);
    assert_near(leaving(&truths), 2.0 * speed, 5e-3);
}

#[test]
fn a_hardening_impact_peaks_where_its_energy_is_used_up() {
    let (speed, depth) = (0.1f64, 2e-4f64);
    let (mut scenario, mass) = hit(speed);
    surface(&mut scenario).hardening = Some(HardeningSection { depth_m: depth });
    let truths = run_at_rest(&scenario);
    // ½ m v² = ½ k δ² + ¼ k δ⁴/d².
    let square = depth * depth * ((1.0 + 2.0 * mass * speed * speed / (STIFFNESS * depth * depth)).sqrt() - 1.0);
    let expected = STIFFNESS * square.sqrt() * (1.0 + square / (depth * depth));
    assert!(expected > 1.2 * (mass * STIFFNESS).sqrt() * speed, "it matters: {expected} N");
    assert_near(peak(&truths), expected, 2e-3);
    assert_near(leaving(&truths), 2.0 * speed, 5e-3);
}

#[test]
fn a_hunt_crossley_impact_gives_back_what_its_law_says() {
    let (speed, exponent, depth, damping) = (0.2f64, 1.5f64, 1e-3f64, 2.0f64);
    let (mut scenario, mass) = hit(speed);
    surface(&mut scenario).hunt_crossley = Some(HuntCrossleySection { exponent, depth_m: depth, damping_s_m: damping });
    let truths = run_at_rest(&scenario);
    // m v dv = −K δⁿ (1 + α v) dδ: what is used up on the way in and given back on the way out is
    // (m/α²) (x − ln(1 + x)) with x = α v.
    let share = |x: f64| x - x.ln_1p();
    let used = share(damping * speed);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if share(-damping * middle * speed) < used { low = middle } else { high = middle }
    }
    let power = exponent + 1.0;
    let reached =
        (power * mass * used / (STIFFNESS * depth.powf(1.0 - exponent) * damping * damping)).powf(1.0 / power);
    println!("restitution {low:.4}, depth {:.3} mm", reached * 1e3);
    assert!(low < 0.85 && low > 0.5, "it loses much: {low}");
    assert_near(deepest(&truths), reached, 2e-3);
    assert_near(leaving(&truths), speed * (1.0 + low), 5e-3);
}

#[test]
fn a_ball_pushes_away_from_its_middle() {
    for text in [SIX_JOINT, SIX_JOINT_MASSES] {
        let mut scenario = scenario(text);
        let radius = 0.15;
        let surface = surface(&mut scenario);
        (surface.shape, surface.curvature_1_m) = (Some(ShapeName::Sphere), 1.0 / radius);
        let middle = Vector3::from(surface.point_m) - Vector3::z() * radius;
        let truths = run_at_rest(&scenario);
        let mut tilted = 0.0f64;
        for truth in pressing(&truths) {
            let out = Vector3::from(truth.tcp_position) - middle;
            let force = out.normalize() * (STIFFNESS * (out.norm() - radius));
            let found = Vector3::new(truth.wrench[0], truth.wrench[1], truth.wrench[2]);
            assert!((found - force).norm() < 1e-6 * force.norm(), "{found} {force}");
            tilted = tilted.max((out.x / out.norm()).abs());
        }
        assert!(tilted > 0.01, "it slides over the ball: {tilted}");
    }
}

#[test]
fn behind_a_step_the_same_depth_presses_harder() {
    let (at, behind) = (0.02, 3e5);
    for text in [SIX_JOINT, SIX_JOINT_MASSES] {
        let mut scenario = scenario(text);
        let surface = surface(&mut scenario);
        let direction = [0.8, 0.6, 0.0];
        surface.step = Some(StiffnessStepSection { direction, at_m: at, width_m: 0.0, stiffness_n_m: behind });
        let point = Vector3::from(surface.point_m);
        let truths = run_at_rest(&scenario);
        let (mut before, mut after) = (0, 0);
        for truth in pressing(&truths) {
            let along = (Vector3::from(truth.tcp_position) - point).dot(&Vector3::from(direction));
            let expected = if along > at { behind } else { STIFFNESS };
            assert_near(truth.normal_force_n / truth.penetration_m, expected, 1e-9);
            if along > at { after += 1 } else { before += 1 }
        }
        assert!(before > 50 && after > 50, "{before} and {after}");
    }
}

#[test]
fn a_plate_that_swings_presses_on_joints_that_rest() {
    let (amplitude, frequency) = (0.0005, 5.0);
    let mut scenario = scenario(PAPER);
    scenario.start.contact_time_s = None;
    scenario.start.joint_position_rad = vec![0.9, -1.3];
    scenario.motion[0].twist = vec![0.0, 0.0];
    scenario.motion[0].duration_s = 0.4;
    // 0.2 mm below the tool.
    let tcp = [0.9f64.cos() + (-0.4f64).cos(), 0.9f64.sin() + (-0.4f64).sin() - 0.0002, 0.0];
    let surface = surface(&mut scenario);
    (surface.point_m, surface.normal) = (tcp, [0.0, 1.0, 0.0]);
    surface.plate = Some(PlateSection { velocity_m_s: 0.0, amplitude_m: amplitude, frequency_hz: frequency });
    let truths = run_at_rest(&scenario);
    let mut touched = 0;
    for truth in &truths {
        let lifted = amplitude * (std::f64::consts::TAU * frequency * truth.scenario_time_s).sin();
        let depth = if truth.scenario_time_s > 0.0 { lifted - 0.0002 } else { -0.0002 };
        assert!((truth.penetration_m - depth).abs() < 1e-12, "{} m, not {depth}", truth.penetration_m);
        assert!((truth.normal_force_n - STIFFNESS * depth.max(0.0)).abs() < 1e-6, "{} N", truth.normal_force_n);
        touched += u32::from(truth.in_contact == 1);
    }
    assert!(touched > 20 && truths[truths.len() - 1].contact_losses >= 1, "{touched} samples in contact");
}

#[test]
fn the_start_meets_a_plate_that_moves_where_it_is_then() {
    for (text, velocity_m_s) in [(SIX_JOINT, 0.03), (SIX_JOINT_MASSES, -0.02)] {
        let mut scenario = scenario(text);
        surface(&mut scenario).plate = Some(PlateSection { velocity_m_s, amplitude_m: 0.0, frequency_hz: 1.0 });
        let truths = run_at_rest(&scenario);
        let touch = truths.iter().find(|truth| truth.in_contact == 1).expect("a touch").scenario_time_s;
        assert!((touch - 0.4).abs() <= 0.0021, "it touches at {touch} s, as the scenario says");
    }
}
