//! What is asked between cycles: control disabled and enabled, and another controller in the place of the one in force.

use admittance_core::condensation::Capacity;
use admittance_core::contact::Thresholds;
use admittance_core::controller::Controller;
use admittance_core::mode::{Mode, StopReason};
use admittance_core::outcome::{Outcome, Source};
use admittance_core::parameters::{ContactSign, InputSelection, Law, LowerBound, OnInfeasible, Parameters};
use admittance_core::sample::SampleFault;
use admittance_core::{EnableRefused, ResetRefused};
use nalgebra::Vector2;

use crate::common::{PlanarController, active_set, controller, parameters, pressing, pushing, step};
use admittance_core::qp::ActiveSet;
use admittance_core::sample::Sample;

type Planar = PlanarController<ActiveSet<Vec<f64>>>;

fn with(parameters: Parameters<2, 2>) -> Planar {
    controller(parameters, active_set())
}

/// A controller of its own parameters, going on where `old` is.
fn instead(old: &Planar, parameters: Parameters<2, 2>) -> Planar {
    let storage = vec![0.0; Capacity::new::<2, 2>(parameters.mpc.horizon).storage_len()];
    let mut new = Controller::new(parameters, active_set(), storage).expect("valid parameters");
    new.continue_from(old);
    new
}

fn damping(value: f64) -> Parameters<2, 2> {
    Parameters { law: Law::Damping { damping: Vector2::repeat(value) }, ..parameters() }
}

/// A stop that comes to rest by the model, and a minimum force that is kept once reached.
fn stopping_at_a_low_force() -> Parameters<2, 2> {
    let mut parameters = parameters();
    parameters.thresholds = Thresholds { release: Vector2::repeat(1.0), ..parameters.thresholds };
    parameters.mpc.minimum_force = Vector2::repeat(2.0);
    parameters.mpc.inputs = InputSelection::All;
    parameters.mpc.sign = ContactSign::Normal;
    parameters.mpc.lower_bound = LowerBound::OnceReached;
    parameters.mpc.on_infeasible = OnInfeasible::MinimumForceStop;
    parameters
}

fn largest_change(one: &Vector2<f64>, other: &Vector2<f64>) -> f64 {
    (one - other).amax()
}

#[test]
fn disabled_in_free_motion_is_idle_until_enabled() {
    let mut controller = with(parameters());
    assert_eq!(step(&mut controller, &pressing(-50.0, 1)).mode, Mode::Free);
    assert_eq!(controller.enable(), Ok(false), "it is enabled already");
    controller.request_stop(StopReason::Disabled);
    assert!(!controller.is_enabled());
    for sequence in 2..5 {
        let outcome = step(&mut controller, &pressing(-50.0, sequence));
        assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Idle, Some(StopReason::Disabled)));
    }
    // What touches is told, and control does not begin.
    step(&mut controller, &pressing(60.0, 5));
    let refused = controller.enable();
    assert!(
        matches!(refused, Err(EnableRefused::InContact { axis: 0, force, activation: 5.0 }) if force < -5.0),
        "{refused:?}"
    );
    step(&mut controller, &pressing(-50.0, 6));
    assert_eq!(controller.enable(), Ok(true));
    let outcome = step(&mut controller, &pressing(-50.0, 7));
    assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Free, None));
}

#[test]
fn disabled_in_contact_stops_and_a_reset_leads_to_idle() {
    let mut controller = with(stopping_at_a_low_force());
    step(&mut controller, &pressing(-50.0, 1));
    assert_eq!(step(&mut controller, &pushing(40.0, 0.01, 2)).mode, Mode::Contact);
    controller.request_stop(StopReason::Disabled);
    let mut outcome = step(&mut controller, &pushing(40.0, 0.01, 3));
    let mut sequence = 3;
    while outcome.mode == Mode::Stopping && sequence < 400 {
        sequence += 1;
        outcome = step(&mut controller, &pressing(10.0, sequence));
    }
    assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Stopped, Some(StopReason::Disabled)));
    step(&mut controller, &pressing(-50.0, sequence + 1));
    assert_eq!(controller.reset(true), Err(ResetRefused::Disabled));
    assert_eq!(controller.reset(false), Ok(()));
    let outcome = step(&mut controller, &pressing(-50.0, sequence + 2));
    assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Idle, Some(StopReason::Disabled)), "it stays disabled");
    assert_eq!(controller.enable(), Ok(true));
    assert_eq!(step(&mut controller, &pressing(-50.0, sequence + 3)).mode, Mode::Free);
}

#[test]
fn the_end_of_the_daemon_is_final() {
    let mut controller = with(parameters());
    step(&mut controller, &pressing(-50.0, 1));
    controller.request_stop(StopReason::Shutdown);
    controller.request_stop(StopReason::Disabled);
    assert_eq!(controller.enable(), Err(EnableRefused::Ending));
    let outcome = step(&mut controller, &pressing(-50.0, 2));
    assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Idle, Some(StopReason::Shutdown)));
}

#[test]
fn another_law_in_free_motion_takes_over_at_the_release_rate() {
    // 4 N, which is free motion, over 10 N s/m.
    let free = |sequence| pressing(4.0, sequence);
    let wanted = -Vector2::from(free(1).wrench) / 10.0;
    let rate = parameters().limits.release_rate * parameters().timing.sampling_time;
    let mut before = with(parameters());
    assert_eq!(step(&mut before, &free(1)).velocity_offset, Vector2::zeros());
    let mut now = instead(&before, damping(10.0));
    let (mut last, mut cycles) = (Vector2::zeros(), 0);
    while last != wanted {
        cycles += 1;
        let outcome = step(&mut now, &free(1 + cycles));
        assert_eq!((outcome.mode, outcome.source), (Mode::Free, Source::Damping));
        assert!(largest_change(&outcome.velocity_offset, &last) <= rate * (1.0 + 1e-12), "cycle {cycles}");
        last = outcome.velocity_offset;
        assert!(cycles < 100, "{last} does not become {wanted}");
    }
    assert!(cycles > 5, "{cycles} cycles test nothing");
    // And back.
    let mut back = instead(&now, parameters());
    while last != Vector2::zeros() {
        cycles += 1;
        let outcome = step(&mut back, &free(1 + cycles));
        assert!(largest_change(&outcome.velocity_offset, &last) <= rate * (1.0 + 1e-12), "cycle {cycles}");
        last = outcome.velocity_offset;
        assert!(cycles < 200, "{last} does not become zero");
    }
}

/// In contact at 150 N with offsets up to `offset` m/s; then, with another force limit, at the same force again. The cycles before
/// and after.
fn limited_anew(limit: f64, offset: f64, inward_rate: Option<f64>) -> [Outcome<2, 2>; 2] {
    let mut parameters = stopping_at_a_low_force();
    parameters.limits.offset = Vector2::repeat(offset);
    parameters.limits.inward_rate = inward_rate.map(Vector2::repeat);
    let mut controller = with(parameters);
    step(&mut controller, &pressing(-50.0, 1));
    let mut before = step(&mut controller, &pushing(60.0, 0.02, 2));
    for sequence in 3..12 {
        before = step(&mut controller, &pushing(150.0, 0.02, sequence));
    }
    assert_eq!((before.mode, before.source), (Mode::Contact, Source::Mpc), "{before:?}");
    parameters.mpc.force_limit = Vector2::repeat(limit);
    let mut changed = instead(&controller, parameters);
    [before, step(&mut changed, &pushing(150.0, 0.02, 12))]
}

#[test]
fn a_force_limit_below_the_force_is_reached_if_that_is_feasible_and_else_stops_at_a_low_force() {
    let outward = |outcome: &Outcome<2, 2>| crate::common::normal().dot(&outcome.twist_command);
    let [_, after] = limited_anew(60.0, 2.0, None);
    assert_eq!((after.mode, after.source, after.stop_reason), (Mode::Contact, Source::Mpc, None), "{after:?}");
    assert!(outward(&after) > 0.1, "away from the surface: {} m/s", outward(&after));
    // Offsets this small cannot take 90 N away in time.
    let [_, after] = limited_anew(60.0, 0.1, None);
    assert_eq!((after.mode, after.stop_reason), (Mode::Stopping, Some(StopReason::Infeasible)), "{after:?}");
    assert_eq!(after.source, Source::MinimumForce);
    assert!(outward(&after) > 0.0, "away from the surface: {} m/s", outward(&after));
    let [_, after] = limited_anew(180.0, 0.1, None);
    assert_eq!((after.mode, after.source, after.stop_reason), (Mode::Contact, Source::Mpc, None), "{after:?}");
}

#[test]
fn a_raised_force_limit_moves_the_offset_by_its_rate_at_most() {
    let rate = 2.0;
    let [before, after] = limited_anew(400.0, 2.0, Some(rate));
    let inward = -(after.velocity_offset - before.velocity_offset);
    let most = rate * parameters().timing.sampling_time;
    assert!((0..2).all(|axis| inward[axis] <= most + 1e-9), "{inward} in a cycle");
}

#[test]
fn a_saturated_wrench_never_reaches_the_law() {
    let mut controller = with(stopping_at_a_low_force());
    step(&mut controller, &pressing(-50.0, 1));
    step(&mut controller, &pushing(60.0, 0.02, 2));
    let saturated = Sample { wrench_saturated: Some(2), ..pushing(150.0, 0.02, 3) };
    let outcome = step(&mut controller, &saturated);
    assert_eq!(outcome.fault, Some(SampleFault::WrenchSaturated { index: 2 }));
    assert_eq!((outcome.mode, outcome.source), (Mode::Contact, Source::Plan), "the last plan goes on");
    let invalid = Sample { wrench_valid: false, ..saturated };
    assert_eq!(step(&mut controller, &invalid).fault, Some(SampleFault::WrenchInvalid));
    for sequence in 4..200 {
        let outcome = step(&mut controller, &Sample { wrench_saturated: Some(0), ..pushing(150.0, 0.02, sequence) });
        if outcome.mode == Mode::Stopped {
            assert_eq!(outcome.stop_reason, Some(StopReason::SampleInvalid));
            return;
        }
    }
    panic!("a sensor that stays at its end stops the arm");
}
