//! Requests between cycles: disabling and enabling control, and replacing the controller.

use admittance_core::Outcome;
use admittance_core::Parameters;
use admittance_core::belief::ContactSign;
use admittance_core::belief::Thresholds;
use admittance_core::intake::SampleFault;
use admittance_core::mpc::{InputSelection, LowerBound};
use admittance_core::output::Law;
use admittance_core::supervisor::OnInfeasible;
use admittance_core::supervisor::{EnableRefused, Ending, ResetRefused};
use admittance_core::vocabulary::{ModeName as Mode, Motion, Source, StopReason};
use nalgebra::{Vector2, Vector6};

use crate::common::{PlanarController, active_set, controller, parameters, pressing, pushing, step};
use admittance_core::intake::{Event, Sample};
use admittance_core::mpc::qp::ActiveSet;

type Planar = PlanarController<ActiveSet<Vec<f64>>>;

fn with(parameters: Parameters<2, 2>) -> Planar {
    controller(parameters, active_set())
}

/// A controller with its own parameters that takes over the state of `old`.
fn instead(old: &Planar, parameters: Parameters<2, 2>) -> Planar {
    let mut new = with(parameters);
    new.take_over(old);
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
    parameters.sign = ContactSign::Normal;
    parameters.mpc.lower_bound = LowerBound::OnceReached;
    parameters.policy.on_infeasible = OnInfeasible::MinimumForceStop;
    parameters
}

fn largest_change(one: &Vector2<f64>, other: &Vector2<f64>) -> f64 {
    (one - other).amax()
}

/// Held after a silence on a surface that ṗ0 pushes into, then told to end.
#[test]
fn an_arm_that_is_held_without_control_is_not_let_go_while_it_presses() {
    for (ending, presses) in [Ending::Disabled, Ending::Shutdown].map(|it| [(it, true), (it, false)]).concat() {
        let mut controller = with(parameters());
        let sample = |sequence| pushing(if presses { 60.0 } else { -50.0 }, 0.05, sequence);
        assert_eq!(step(&mut controller, &pushing(-50.0, 0.05, 1)).mode, Mode::Free);
        let silence = |controller: &mut Planar, late| {
            controller.step(Event::Silence, pressing(0.0, late).stamp, &mut || false).movement.motion
        };
        assert_eq!((silence(&mut controller, 100), controller.mode()), (Motion::Hold, Mode::Idle));
        controller.end(ending);
        assert_eq!(silence(&mut controller, 101), Motion::Hold, "nobody knows what it touches");
        for sequence in 102..105 {
            let outcome = step(&mut controller, &sample(sequence));
            let expected = if presses {
                (Motion::Hold, Mode::Stopped, Some(StopReason::StartedInContact))
            } else {
                (Motion::Offset, Mode::Idle, Some(ending.reason()))
            };
            assert_eq!((outcome.movement.motion, outcome.mode, outcome.stop_reason), expected, "{presses}");
        }
        // Once it is let go, or where control never was, a silence is none of the daemon's
        // business.
        if !presses {
            assert_eq!(silence(&mut controller, 200), Motion::Offset);
        }
    }
}

#[test]
fn disabled_in_free_motion_is_idle_until_enabled() {
    let mut controller = with(parameters());
    assert_eq!(step(&mut controller, &pressing(-50.0, 1)).mode, Mode::Free);
    assert_eq!(controller.enable(), Ok(false), "it is enabled already");
    controller.end(Ending::Disabled);
    assert!(!controller.is_enabled());
    for sequence in 2..5 {
        let outcome = step(&mut controller, &pressing(-50.0, sequence));
        assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Idle, Some(StopReason::Disabled)));
    }
    // The arm touches, so control does not begin.
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
    controller.end(Ending::Disabled);
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
    controller.end(Ending::Shutdown);
    controller.end(Ending::Disabled);
    assert_eq!(controller.enable(), Err(EnableRefused::Ending));
    let outcome = step(&mut controller, &pressing(-50.0, 2));
    assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Idle, Some(StopReason::Shutdown)));
}

#[test]
fn another_law_in_free_motion_takes_over_at_the_release_rate() {
    // 4 N, which is free motion, over 10 N s/m.
    let free = |sequence| pressing(4.0, sequence);
    let wanted = -free(1).wrench.0.fixed_rows::<2>(0) / 10.0;
    let rate = parameters().limits.release_rate * parameters().timing.sampling_time.seconds();
    let mut before = with(parameters());
    assert_eq!(step(&mut before, &free(1)).movement.velocity_offset, Vector2::zeros());
    let mut now = instead(&before, damping(10.0));
    let (mut last, mut cycles) = (Vector2::zeros(), 0);
    while last != wanted {
        cycles += 1;
        let outcome = step(&mut now, &free(1 + cycles));
        assert_eq!((outcome.mode, outcome.movement.source), (Mode::Free, Source::Damping));
        assert!(largest_change(&outcome.movement.velocity_offset, &last) <= rate * (1.0 + 1e-12), "cycle {cycles}");
        last = outcome.movement.velocity_offset;
        assert!(cycles < 100, "{last} does not become {wanted}");
    }
    assert!(cycles > 5, "{cycles} cycles test nothing");
    // And back.
    let mut back = instead(&now, parameters());
    while last != Vector2::zeros() {
        cycles += 1;
        let outcome = step(&mut back, &free(1 + cycles));
        assert!(largest_change(&outcome.movement.velocity_offset, &last) <= rate * (1.0 + 1e-12), "cycle {cycles}");
        last = outcome.movement.velocity_offset;
        assert!(cycles < 200, "{last} does not become zero");
    }
}

/// In contact at 150 N with offsets up to `offset` m/s; then, with another force limit, at the same
/// force again. The cycles before and after.
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
    assert_eq!((before.mode, before.movement.source), (Mode::Contact, Source::Mpc), "{before:?}");
    parameters.mpc.force_limit = Vector2::repeat(limit);
    let mut changed = instead(&controller, parameters);
    [before, step(&mut changed, &pushing(150.0, 0.02, 12))]
}

#[test]
fn a_force_limit_below_the_force_is_reached_if_that_is_feasible_and_else_stops_at_a_low_force() {
    let outward = |outcome: &Outcome<2, 2>| crate::common::normal().dot(&outcome.movement.twist_command);
    let [_, after] = limited_anew(60.0, 2.0, None);
    assert_eq!((after.mode, after.movement.source, after.stop_reason), (Mode::Contact, Source::Mpc, None), "{after:?}");
    assert!(outward(&after) > 0.1, "away from the surface: {} m/s", outward(&after));
    // Offsets this small cannot take 90 N away in time.
    let [_, after] = limited_anew(60.0, 0.1, None);
    assert_eq!((after.mode, after.stop_reason), (Mode::Stopping, Some(StopReason::Infeasible)), "{after:?}");
    assert_eq!(after.movement.source, Source::MinimumForce);
    assert!(outward(&after) > 0.0, "away from the surface: {} m/s", outward(&after));
    let [_, after] = limited_anew(180.0, 0.1, None);
    assert_eq!((after.mode, after.movement.source, after.stop_reason), (Mode::Contact, Source::Mpc, None), "{after:?}");
}

#[test]
fn a_raised_force_limit_moves_the_offset_by_its_rate_at_most() {
    let rate = 2.0;
    let [before, after] = limited_anew(400.0, 2.0, Some(rate));
    let inward = -(after.movement.velocity_offset - before.movement.velocity_offset);
    let most = rate * parameters().timing.sampling_time.seconds();
    assert!((0..2).all(|axis| inward[axis] <= most + 1e-9), "{inward} in a cycle");
}

/// End of the sensor's range, N.
const RANGE: f64 = 500.0;

/// The sample with a component of its wrench at the end of the range.
fn at_the_end(mut sample: Sample<2, 2>, component: usize) -> Sample<2, 2> {
    sample.wrench.0[component] = -RANGE;
    sample
}

#[test]
fn a_saturated_wrench_never_reaches_the_law() {
    let mut parameters = stopping_at_a_low_force();
    parameters.conditioning.saturation = Some(Vector6::repeat(RANGE));
    let mut controller = with(parameters);
    step(&mut controller, &pressing(-50.0, 1));
    step(&mut controller, &pushing(60.0, 0.02, 2));
    let saturated = at_the_end(pushing(150.0, 0.02, 3), 2);
    let outcome = step(&mut controller, &saturated);
    assert_eq!(outcome.fault, Some(SampleFault::WrenchSaturated { index: 2 }));
    assert_eq!((outcome.mode, outcome.movement.source), (Mode::Contact, Source::Plan), "the last plan goes on");
    let invalid = Sample { wrench_valid: false, ..saturated };
    assert_eq!(step(&mut controller, &invalid).fault, Some(SampleFault::WrenchInvalid));
    for sequence in 4..200 {
        let outcome = step(&mut controller, &at_the_end(pushing(150.0, 0.02, sequence), 0));
        if outcome.mode == Mode::Stopped {
            assert_eq!(outcome.stop_reason, Some(StopReason::SampleInvalid));
            return;
        }
    }
    panic!("a sensor that stays at its end stops the arm");
}
