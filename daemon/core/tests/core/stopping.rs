//! How the controller stops on request, and how it leaves a stop.

use crate::common;
use crate::common::scripted::{assert_held, assert_stopping, close, contact, scenario, touched};
use crate::common::{normal, parameters, pressing, pushing, step};
use admittance_core::intake::Sample;
use admittance_core::supervisor::{Ending, ResetRefused};
use admittance_core::vocabulary::{ModeName as Mode, StopReason};
use admittance_core::vocabulary::{Motion, Source};
use nalgebra::Vector2;

#[test]
fn a_stop_on_request_ramps_to_zero_in_free_motion() {
    let (mut controller, outcome) = touched(parameters(), &[]);
    let mut before = outcome.movement.velocity_offset;
    controller.end(Ending::Shutdown);
    let mut cycles = 0;
    for sequence in 3.. {
        let outcome = step(&mut controller, &pressing(-100.0, sequence));
        if outcome.mode == Mode::Idle {
            assert_eq!((outcome.stop_reason, before), (Some(StopReason::Shutdown), Vector2::zeros()));
            assert_eq!(outcome.movement.velocity_offset, Vector2::zeros());
            break;
        }
        assert_eq!(outcome.mode, Mode::Free);
        // 10 m/s² over 4 ms.
        for axis in 0..2 {
            let expected = (before[axis].abs() - 0.04).max(0.0).copysign(before[axis]);
            assert!(
                (outcome.movement.velocity_offset[axis] - expected).abs() < 1e-12,
                "{} after {before}",
                outcome.movement.velocity_offset
            );
        }
        before = outcome.movement.velocity_offset;
        cycles += 1;
        assert!(cycles < 100, "it never gets to zero");
    }
    assert!(cycles > 1, "there was nothing to ramp");
    assert_eq!(step(&mut controller, &pressing(-100.0, 500)).stop_reason, Some(StopReason::Shutdown), "stays idle");
}

#[test]
fn a_stop_on_request_in_contact_comes_to_rest_at_a_low_force() {
    let (mut controller, _) = touched(parameters(), &[]);
    controller.end(Ending::Shutdown);
    let outcome = step(&mut controller, &pushing(150.0, 0.05, 3));
    assert_stopping(&outcome, StopReason::Shutdown);
    assert_eq!(outcome.movement.source, Source::MinimumForce);
    assert!(
        normal().dot(&outcome.movement.twist_command) > 0.0,
        "out of the surface: {}",
        outcome.movement.twist_command
    );
    // Low force, but still moving in: no rest yet.
    let inward = Sample { joint_velocity: contact_velocity(-0.05), ..pressing(50.0, 4) };
    assert_stopping(&step(&mut controller, &inward), StopReason::Shutdown);
    assert_held(&step(&mut controller, &pressing(50.0, 5)), StopReason::Shutdown, "at rest");

    // A force that does not fade: held when the time is up.
    let (mut controller, _) = touched(parameters(), &[]);
    controller.end(Ending::Shutdown);
    for sequence in 3..=253 {
        assert_stopping(&step(&mut controller, &pressing(150.0, sequence)), StopReason::Shutdown);
    }
    assert_held(&step(&mut controller, &pressing(150.0, 254)), StopReason::Shutdown, "time is up");
}

/// Joint velocity that moves the TCP out of the surface at `speed`.
fn contact_velocity(speed: f64) -> Vector2<f64> {
    let model = common::model(&parameters(), &contact(1).joint_position);
    let twist = normal() * speed;
    model.jacobian_inverse * twist
}

#[test]
fn the_way_out_of_a_stop_leads_over_a_retreat_and_a_reset() {
    let mut controller = scenario(parameters(), &[]);
    assert_eq!(controller.reset(false), Err(ResetRefused::NotStopped(Mode::Idle)));
    assert_held(&step(&mut controller, &contact(1)), StopReason::StartedInContact, "inward");
    let refused = controller.reset(false);
    assert!(
        matches!(refused, Err(ResetRefused::ReferenceInward { speed }) if (speed - 0.05).abs() < 1e-12),
        "{refused:?}"
    );
    assert_held(&step(&mut controller, &pressing(60.0, 2)), StopReason::StartedInContact, "no reference");
    let refused = controller.reset(false);
    assert!(
        matches!(refused, Err(ResetRefused::ForceAboveRelease { axis: 0, release: 5.0, force }) if force < -5.0),
        "{refused:?}"
    );
    // Out of the surface, but never faster than the retreat speed, however fast the reference is.
    for (sequence, commanded, allowed) in [(3, 0.02, 0.02), (4, 0.3, 0.05), (5, 1.5, 0.05)] {
        let outcome = step(&mut controller, &pushing(60.0, -commanded, sequence));
        assert_eq!(
            (outcome.movement.motion, outcome.mode, outcome.movement.source),
            (Motion::Offset, Mode::Stopped, Source::Retreat)
        );
        assert!(
            close(&outcome.movement.twist_command, &(normal() * allowed)),
            "{commanded} m/s: {}",
            outcome.movement.twist_command
        );
    }
    // The offset that would slow this one down is beyond the limit.
    let outcome = step(&mut controller, &pushing(60.0, -4.0, 6));
    assert_held(&outcome, StopReason::StartedInContact, "too fast to be slowed down");

    step(&mut controller, &pushing(0.0, -0.02, 7));
    assert_eq!(controller.reset(false), Ok(()));
    assert_eq!(controller.mode(), Mode::Idle);
    let outcome = step(&mut controller, &pressing(-100.0, 8));
    assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Free, None));
    let outcome = step(&mut controller, &contact(9));
    assert_eq!((outcome.mode, outcome.movement.source), (Mode::Contact, Source::Mpc));
}

#[test]
fn a_forced_reset_goes_straight_back_to_control_in_contact() {
    let mut controller = scenario(parameters(), &[]);
    step(&mut controller, &contact(1));
    assert_eq!(controller.reset(true), Ok(()));
    assert_eq!(controller.mode(), Mode::Free);
    let outcome = step(&mut controller, &contact(2));
    assert_eq!((outcome.mode, outcome.movement.source, outcome.stop_reason), (Mode::Contact, Source::Mpc, None));
}
