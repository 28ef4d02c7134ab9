//! The observer against golden/momentum_observer.json, which shares no code with it, and against what
//! its model (6) says.

use nalgebra::{Matrix3, SVector, Vector3, Vector6};
use serde::Deserialize;

use super::{MomentumObserver, TorqueModel, unseen};
use crate::common::golden_arm::GoldenArm;
use crate::intake::{Conditioning, Event, Intake, Sample, SampleFault, Settings, Timing, WrenchSource};
use crate::quantities::{GivenWrench, Instant, Span};
use crate::robot::{Chain, JointFriction, Pose, Posture, TaskAxes};
use crate::surface::Surface;

/// Relative to the largest entry of an answer.
const AGREEMENT: f64 = 1e-8;

#[derive(Deserialize)]
struct Golden {
    arm: GoldenArm,
    told: Told,
    steps: Vec<Step>,
}

#[derive(Deserialize)]
struct Told {
    friction: FrictionData,
    mass_tolerance: f64,
    acceleration_tolerance: f64,
    torque_noise: [f64; 6],
    velocity_noise: f64,
    lag: f64,
}

#[derive(Deserialize)]
struct FrictionData {
    viscous: [f64; 6],
    coulomb: [f64; 6],
    breakaway: [f64; 6],
    stribeck_velocity: f64,
    slip_velocity: f64,
    tolerance: f64,
    unknown: f64,
}

#[derive(Deserialize)]
struct Step {
    given: Given,
    answers: Answers,
}

#[derive(Deserialize)]
struct Given {
    time: f64,
    q: [f64; 6],
    velocity: [f64; 6],
    torque: [f64; 6],
}

#[derive(Deserialize)]
struct Answers {
    wrench: [f64; 6],
    deviation: [f64; 6],
}

fn golden() -> Golden {
    serde_json::from_str(include_str!("../../../tests/golden/momentum_observer.json"))
        .expect("the golden file is what its script wrote")
}

impl Golden {
    fn model(&self) -> TorqueModel<6> {
        let Told { friction, .. } = &self.told;
        TorqueModel {
            dynamics: self.arm.dynamics(),
            friction: std::array::from_fn(|joint| JointFriction {
                viscous: friction.viscous[joint],
                coulomb: friction.coulomb[joint],
                breakaway: friction.breakaway[joint],
                stribeck_velocity: friction.stribeck_velocity,
                slip_velocity: friction.slip_velocity,
                tolerance: friction.tolerance,
                unknown: friction.unknown,
            }),
            mass_tolerance: self.told.mass_tolerance,
            acceleration_tolerance: self.told.acceleration_tolerance,
            torque_noise: self.told.torque_noise.into(),
            velocity_noise: self.told.velocity_noise,
        }
    }

    fn chain(&self) -> Chain<6> {
        self.arm.chain()
    }

    fn settings(&self) -> Settings<6, 6> {
        Settings {
            chain: self.chain(),
            timing: Timing {
                sampling_time: Span::from_seconds(0.001),
                command_delay: Span::ZERO,
                max_sample_age: Span::from_seconds(0.003),
                max_consecutive_fallbacks: 3,
            },
            conditioning: Conditioning::none(),
            wrench_time_constant: Vector6::repeat(self.told.lag),
            wrench_lag_tolerance: 0.0,
            resolves: false,
            joint_speed: None,
            source: WrenchSource::MotorTorque(self.model()),
            largest_deviation: Vector6::repeat(f64::INFINITY),
            // Far above the arm: the tool is never clear of it, and nothing is learned.
            surface: floor(100.0),
        }
    }
}

/// A level surface at a height in m.
fn floor(height: f64) -> Surface<6> {
    let contact = Pose { position: Vector3::new(0.0, 0.0, height), rotation: Matrix3::identity() };
    Surface::plane(1e5, &Vector3::z(), contact)
}

fn sample(time: f64, q: [f64; 6], velocity: [f64; 6], torque: SVector<f64, 6>) -> Sample<6, 6> {
    Sample {
        sequence: 1,
        stamp: Instant::from_nanoseconds(1_000_000_000) + Span::from_seconds(time),
        boot_id: 7,
        joint_count: 6,
        wrench_valid: false,
        drives_enabled: true,
        joint_position: q.into(),
        joint_velocity: velocity.into(),
        joint_position_reference: q.into(),
        joint_velocity_reference: None,
        twist_reference: Vector6::zeros(),
        wrench: GivenWrench(Vector6::zeros()),
        torque_valid: true,
        joint_torque: torque,
    }
}

#[test]
fn it_is_the_filter_that_was_written_independently() {
    let golden = golden();
    let (model, settings) = (golden.model(), golden.settings());
    let mut observer: Option<MomentumObserver<6, 6>> = None;
    for Step { given, answers } in &golden.steps {
        let sample = sample(given.time, given.q, given.velocity, given.torque.into());
        let posture = Posture::new(&settings.chain, &sample.joint_position);
        observer = MomentumObserver::followed(observer.as_ref(), &model, &settings, &sample, &posture);
        let estimate = observer.as_ref().expect("far from singular").estimate();
        let close = |what: &str, found: Vector6<f64>, expected: [f64; 6]| {
            let expected = Vector6::from(expected);
            let error = (found - expected).amax();
            assert!(error <= AGREEMENT * expected.amax(), "{what} off by {error:e} at {} s", given.time);
        };
        close("f̂", estimate.wrench, answers.wrench);
        close("σ", estimate.covariance.diagonal().map(f64::sqrt), answers.deviation);
    }
    assert_eq!(golden.steps.len(), 59);
}

/// f̂ of an arm at rest, from 0.5 s on under a wrench of 1 in every component; by the time in ms since.
fn risen(golden: &Golden, lag: f64) -> Vec<Vector6<f64>> {
    let model = golden.model();
    let settings = Settings { wrench_time_constant: Vector6::repeat(lag), ..golden.settings() };
    let q = [0.3, 1.2, -1.8, 2.2, 1.57, 0.3];
    let posture = Posture::new(&settings.chain, &q.into());
    let mut observer: Option<MomentumObserver<6, 6>> = None;
    let mut found = Vec::new();
    for index in 0..900 {
        let wrench = if index > 500 { Vector6::repeat(1.0) } else { Vector6::zeros() };
        let torque = model.dynamics.at(&q.into()).bias(&SVector::zeros(), &wrench);
        let sample = sample(f64::from(index) * 0.001, q, [0.0; 6], torque);
        observer = MomentumObserver::followed(observer.as_ref(), &model, &settings, &sample, &posture);
        if index >= 500 {
            found.push(observer.as_ref().expect("far from singular").estimate().wrench);
        }
    }
    found
}

#[test]
fn its_lag_is_the_one_that_the_model_is_told() {
    let golden = golden();
    for lag in [0.01, 0.02, 0.05] {
        let found = risen(&golden, lag);
        let last = found.last().expect("samples");
        for axis in 0..6 {
            assert!((last[axis] - 1.0).abs() < 1e-3, "axis {axis}: {} in the end", last[axis]);
            // The area above a step's answer is the lag, whatever the filter's order.
            let area: f64 = found[1..].iter().map(|wrench| (1.0 - wrench[axis]) * 0.001).sum();
            assert!((area - lag).abs() < 0.1 * lag, "axis {axis}: lag {area} s, told {lag} s");
        }
    }
}

#[test]
fn where_the_arm_is_stretched_it_says_which_force_it_does_not_see() {
    let golden = golden();
    let (model, settings) = (golden.model(), golden.settings());
    let deviation = |elbow: f64| {
        let q = [0.0, 1.57, elbow, 1.57, 1.57, 0.3];
        let torque = model.dynamics.at(&q.into()).gravity_torque();
        let sample = sample(0.0, q, [0.0; 6], torque);
        let posture = Posture::<6, 6>::new(&settings.chain, &sample.joint_position);
        let observer = MomentumObserver::followed(None, &model, &settings, &sample, &posture);
        (
            observer.map(|observer| observer.estimate().covariance.diagonal().map(f64::sqrt)),
            unseen(TaskAxes::ALL, &posture),
        )
    };
    let (bent, _) = deviation(1.0);
    let (straighter, worst) = deviation(0.02);
    let (bent, straighter) = (bent.expect("far from singular"), straighter.expect("not quite singular"));
    assert!(straighter[worst] > 20.0 * bent[worst], "{straighter} {bent}");
    let (stretched, still_worst) = deviation(0.0);
    assert_eq!((stretched, still_worst), (None, worst));
}

/// f̂ and its faults, as the stage has them.
fn taken(settings: Settings<6, 6>, alter: impl Fn(&mut Sample<6, 6>)) -> Result<Vector6<f64>, SampleFault> {
    let q = [0.3, 1.2, -1.8, 2.2, 1.57, 0.3];
    let WrenchSource::MotorTorque(model) = &settings.source else { panic!("of motor torques") };
    let wrench = Vector6::new(0.0, 0.0, -100.0, 0.0, 0.0, 0.0);
    let mut sample = sample(0.0, q, [0.0; 6], model.dynamics.at(&q.into()).bias(&SVector::zeros(), &wrench));
    alter(&mut sample);
    Intake::new(settings).take(Event::Sample(&sample), sample.stamp).map(|accepted| accepted.wrench)
}

#[test]
fn a_sample_without_usable_torques_is_no_sample() {
    let settings = golden().settings();
    let found = taken(settings, |_| {}).expect("the sample's own wrench is not valid, and not asked for");
    assert!((found - Vector6::new(0.0, 0.0, -100.0, 0.0, 0.0, 0.0)).amax() < 1e-9, "{found}");
    assert_eq!(taken(settings, |sample| sample.torque_valid = false), Err(SampleFault::TorqueInvalid));
    let spoilt = taken(settings, |sample| sample.joint_torque[2] = f64::NAN).expect_err("no number");
    assert_eq!(spoilt.to_string(), "joint_torque[2] is not finite");
    // Sticking joints hide more than 5 N.
    let strict = Settings { largest_deviation: Vector6::repeat(5.0), ..settings };
    let unseen = taken(strict, |_| {}).expect_err("too unsure");
    assert!(matches!(unseen, SampleFault::WrenchUnseen { deviation, .. } if deviation > 5.0), "{unseen:?}");
    assert!(unseen.to_string().starts_with("the torques do not show the wrench on axis "), "{unseen}");
    assert_eq!(unseen.name().name(), "WrenchInvalid");
}

#[test]
fn torques_that_show_too_little_are_followed_all_the_same() {
    let golden = golden();
    let settings = Settings { largest_deviation: Vector6::repeat(1e-3), ..golden.settings() };
    let torque = golden.model().dynamics.at(&[0.3, 1.2, -1.8, 2.2, 1.57, 0.3].into()).gravity_torque();
    let mut intake = Intake::new(settings);
    for cycle in 0..20_u32 {
        let at_rest = sample(0.001 * f64::from(cycle), [0.3, 1.2, -1.8, 2.2, 1.57, 0.3], [0.0; 6], torque);
        let sample = Sample { sequence: u64::from(cycle) + 1, ..at_rest };
        assert!(matches!(intake.take(Event::Sample(&sample), sample.stamp), Err(SampleFault::WrenchUnseen { .. })));
        let stamp = intake.observer.as_ref().map(|observer| observer.stamp);
        assert_eq!(stamp, Some(sample.stamp), "cycle {cycle}");
    }
}
