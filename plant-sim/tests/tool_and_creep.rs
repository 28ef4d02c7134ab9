//! What a sensor feels of an accelerated tool, and a surface that creeps, in whole runs.

mod common;

use admittance_host::robot_description::VelocityLoopDescription;
use common::{PLANAR_FREE, command, paper, run, scenario};
use ipc_types::{StateSample, TruthSample, VirtualPlant};
use nalgebra::{Rotation3, Vector3};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::{Scenario, SensorSection};

const MASS: f64 = 3.0;
const CENTER: [f64; 3] = [-0.12, 0.07, 0.0];

/// A tool on a sensor that is turned and away from the TCP, and reports the reaction.
fn sensor(in_base_axes: bool) -> SensorSection {
    SensorSection {
        origin_m: [-0.2, 0.0, 0.0],
        rpy_rad: [0.0, 0.0, 0.6],
        in_base_axes,
        reports_reaction: true,
        bias: [0.0; 6],
        tool_mass_kg: MASS,
        tool_center_of_gravity_m: CENTER,
        gravity_m_s2: [0.0, -9.81, 0.0],
        range: None,
    }
}

fn states(scenario: &Scenario) -> Vec<(StateSample, TruthSample)> {
    let mut plant = VirtualRun::new(scenario).expect("the scenario can be set up");
    let mut all = Vec::new();
    while !plant.is_finished() {
        let state = *plant.sample().expect("no fault drops samples");
        all.push((state, plant.advance(Some(&command(&state, &[0.0; 2]))).expect("the plant takes it")));
    }
    all
}

/// Velocity of the tool's centre of gravity in m/s.
fn velocity(truth: &TruthSample) -> Vector3<f64> {
    let [x, y, z, rx, ry, rz] = truth.tcp_twist;
    let lever = Rotation3::new(Vector3::from(truth.tcp_rotation)) * Vector3::from(CENTER);
    Vector3::new(x, y, z) + Vector3::new(rx, ry, rz).cross(&lever)
}

#[test]
fn a_sensor_feels_what_accelerates_the_tool_through_its_filter() {
    for (lag, damping) in [(0.02, None), (0.02, Some(vec![0.6, 0.8])), (0.0, None)] {
        let mut scenario = scenario(PLANAR_FREE);
        let sampling_time = 0.0002;
        scenario.timing.sampling_time_s = sampling_time;
        scenario.timing.command_delay_s = 0.0;
        scenario.timing.settle_s = 0.01;
        scenario.noise.wrench = 0.0;
        scenario.wrench.time_constant_s = vec![lag; 2];
        scenario.robot.velocity_loop = damping.clone().map(|damping| VelocityLoopDescription {
            damping: Some(damping),
            dead_time_s: None,
            report_lag_s: 0.0,
        });
        scenario.motion[0].twist = vec![0.6, -0.4];
        scenario.motion[0].duration_s = 0.1;
        scenario.motion.truncate(1);
        scenario.sensor = Some(sensor(true));
        let in_base = states(&scenario);
        // (m/T)(v − LP(v)), LP exact for straight lines between samples; without a lag m v̇.
        let (mut slow, mut last, mut most, mut worst) = (Vector3::zeros(), Vector3::zeros(), 0.0_f64, 0.0_f64);
        for (state, truth) in &in_base {
            let now = velocity(truth);
            let slope = (now - last) / sampling_time;
            let force = if lag > 0.0 {
                slow = now - slope * lag + (slow - last + slope * lag) * (-sampling_time / lag).exp();
                (now - slow) * (MASS / lag)
            } else {
                slope * MASS
            };
            last = now;
            // The reaction; and the robot holds the weight.
            let found = -Vector3::from_row_slice(&state.wrench[..3]) + Vector3::new(0.0, -9.81, 0.0) * MASS;
            most = most.max(force.norm());
            worst = worst.max((found - force).norm());
        }
        assert!(most > 10.0, "{most} N at most");
        // Without a lag the difference is half a sample late: a jump of q̈ is seen half.
        let close = if lag > 0.0 { 0.01 } else { 0.6 };
        assert!(worst < close * most, "lag {lag} s, {damping:?}: off by {worst} N of {most} N");
        // The same in the sensor's own axes.
        scenario.sensor = Some(sensor(false));
        for ((here, truth), (there, _)) in in_base.iter().zip(states(&scenario)) {
            let turned =
                Rotation3::new(Vector3::from(truth.tcp_rotation)) * Rotation3::from_euler_angles(0.0, 0.0, 0.6);
            let force = turned * Vector3::from_row_slice(&there.wrench[..3]);
            assert!((force - Vector3::from_row_slice(&here.wrench[..3])).norm() < 1e-9);
        }
    }
}

#[test]
fn a_surface_that_creeps_is_hard_at_first_and_soft_when_held() {
    let mut told = paper(0.3);
    told.start.contact_time_s = Some(0.2);
    told.motion[0].duration_s = 0.35;
    told.motion.truncate(1);
    let plain = run(&told, |_| vec![0.0; 2]);
    let surface = told.surface.as_mut().expect("a surface");
    surface.maxwell_stiffness_n_m = Some(surface.stiffness_n_m);
    surface.maxwell_relaxation_time_s = 1e-4;
    let quick = run(&told, |_| vec![0.0; 2]);
    told.surface.as_mut().expect("a surface").maxwell_relaxation_time_s = 10.0;
    let slow = run(&told, |_| vec![0.0; 2]);
    // An arm that nothing yields to goes the same way in all of them.
    for ((plain, quick), slow) in plain.iter().zip(&quick).zip(&slow).filter(|((plain, _), _)| plain.in_contact == 1) {
        assert!((slow.normal_force_n / plain.normal_force_n - 2.0).abs() < 0.01, "both springs");
        let damped = quick.normal_force_n - plain.normal_force_n;
        // k₁ τ δ̇ of a surface that relaxes at once.
        assert!(damped > 0.0 && damped < 0.3 * 10.0, "{damped} N of {} N", plain.normal_force_n);
    }
    assert!(plain.last().is_some_and(|truth| truth.normal_force_n > 500.0));
}
