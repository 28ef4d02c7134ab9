//! The controller through `step`: what it answers when the solver or the samples fail.

use crate::common::scripted::{
    Scenario, Script, assert_held, assert_stopping, close, contact, offsets, scenario, touched,
};
use crate::common::{CYCLE, at, given, normal, ns, parameters, pressing, pushing, step};
use admittance_core::Outcome;
use admittance_core::intake::Event;
use admittance_core::intake::{Field, Sample, SampleFault};
use admittance_core::mpc::Verdict;
use admittance_core::supervisor::{Ending, OnInfeasible};
use admittance_core::vocabulary::{ModeName as Mode, StopReason};
use admittance_core::vocabulary::{Motion, Source};
use nalgebra::Vector2;

#[test]
fn in_free_motion_the_offset_is_zero_and_in_contact_it_is_the_plans_first() {
    let (controller, outcome) = touched(parameters(), &[]);
    assert_eq!(outcome.movement.source, Source::Mpc);
    assert_eq!(offsets(&controller).len(), 5);
    assert_eq!(outcome.movement.velocity_offset, offsets(&controller)[0]);
    assert_eq!(outcome.movement.twist_command, contact(2).twist_reference + outcome.movement.velocity_offset);
    let q = contact(2).joint_position;
    let moved = parameters().chain.kinematics(&q).task_jacobian::<2>() * outcome.movement.joint_velocity_offset;
    assert!((moved - outcome.movement.velocity_offset).norm() < 1e-9, "J J⁻¹ Δṗ = {moved}");
    assert!(matches!(outcome.verdict, Verdict::Feasible { margin, .. } if 0.0 < margin && margin < 200.0));

    let mut controller = scenario(parameters(), &[]);
    let free = step(&mut controller, &pushing(-100.0, 0.2, 1));
    assert_eq!((free.mode, free.movement.source, free.movement.motion), (Mode::Free, Source::None, Motion::Offset));
    assert_eq!((free.movement.velocity_offset, free.verdict), (Vector2::zeros(), Verdict::None));
    assert_eq!(free.movement.twist_command, -normal() * 0.2);
}

#[test]
fn without_an_answer_the_plan_goes_on_and_one_too_many_stops() {
    let causes = [
        (Script::Expire, StopReason::FallbackExhausted),
        (Script::Fail, StopReason::SolverFailed),
        (Script::Claim(1.0), StopReason::SolverFailed),
        (Script::Claim(f64::NAN), StopReason::SolverFailed),
        (Script::Lie(0.7), StopReason::SolverFailed),
        (Script::Lie(f64::NAN), StopReason::SolverFailed),
    ];
    for (cause, reason) in causes {
        let (mut controller, _) = touched(parameters(), &[Script::Solve, cause, cause, cause, cause]);
        let plan = offsets(&controller);
        for (cycle, planned) in (1..).zip(&plan[1..]) {
            let outcome = step(&mut controller, &contact(2 + cycle));
            assert_eq!(
                (outcome.movement.source, outcome.movement.velocity_offset),
                (Source::Plan, *planned),
                "{cause:?}, {cycle}"
            );
            assert_eq!(outcome.verdict, Verdict::None, "{cause:?}: nothing is proven");
            assert_eq!(outcome.expired_iteration, (cause == Script::Expire).then_some(3), "{cause:?}");
            if cycle <= 3 {
                assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Contact, None), "{cause:?}, {cycle}");
            } else {
                assert_stopping(&outcome, reason);
            }
        }
        assert_eq!(controller.counters().fallback, 4);
        // 150 N is more than it may rest with: now it stops with the solver's help.
        let outcome = step(&mut controller, &pushing(150.0, 0.05, 7));
        assert_stopping(&outcome, reason);
        assert_eq!(outcome.movement.source, Source::MinimumForce);
    }
}

#[test]
fn an_answer_in_between_ends_the_row_of_fallbacks() {
    let e = Script::Expire;
    let (mut controller, _) = touched(parameters(), &[Script::Solve, e, e, e, Script::Solve, e, e, e, e]);
    for sequence in 3..=9 {
        let outcome = step(&mut controller, &contact(sequence));
        let source = if sequence == 6 { Source::Mpc } else { Source::Plan };
        assert_eq!((outcome.movement.source, outcome.mode), (source, Mode::Contact), "sample {sequence}");
    }
    // The next one would be the fourth; but a row does not go on in the next contact.
    assert_eq!(step(&mut controller, &pressing(-100.0, 10)).mode, Mode::Free);
    assert_eq!(step(&mut controller, &contact(11)).mode, Mode::Contact);
}

#[test]
fn time_that_is_up_before_the_optimisation_counts_as_expired() {
    let (mut controller, _) = touched(parameters(), &[]);
    let plan = offsets(&controller);
    let sample = contact(3);
    let outcome = controller.step(Event::Sample(&sample), sample.stamp, &mut || true);
    assert_eq!(
        (outcome.movement.source, outcome.movement.velocity_offset, outcome.expired_iteration),
        (Source::Plan, plan[1], Some(0))
    );
}

#[test]
fn without_a_plan_of_this_contact_the_inward_part_of_the_reference_goes() {
    let (_, outcome) = touched(parameters(), &[Script::Expire]);
    assert_eq!(outcome.movement.source, Source::Retreat);
    assert!(outcome.movement.twist_command.norm() < 1e-12, "{}", outcome.movement.twist_command);
}

/// The x axis pulls while y presses: no plane does that, and no input meets both lower bounds.
fn contradictory(sequence: u64) -> Sample<2, 2> {
    Sample { wrench: given(Vector2::new(20.0, -60.0)), ..contact(sequence) }
}

#[test]
fn proven_infeasibility_is_latched() {
    let mut controller = scenario(parameters(), &[]);
    step(&mut controller, &pressing(-100.0, 1));
    let outcome = step(&mut controller, &contradictory(2));
    assert_held(&outcome, StopReason::Infeasible, "at once");
    assert!(
        matches!(outcome.verdict, Verdict::Infeasible { shortfall, .. } if shortfall > 0.0),
        "{:?}",
        outcome.verdict
    );
    for sequence in 3..10 {
        assert_held(&step(&mut controller, &contact(sequence)), StopReason::Infeasible, "latched");
    }

    let mut gentle = parameters();
    gentle.policy.on_infeasible = OnInfeasible::MinimumForceStop;
    let mut controller = scenario(gentle, &[]);
    step(&mut controller, &pressing(-100.0, 1));
    let sample = Sample { wrench: given(Vector2::new(50.0, -160.0)), ..pushing(150.0, 0.05, 2) };
    let outcome = step(&mut controller, &sample);
    assert_stopping(&outcome, StopReason::Infeasible);
    assert_eq!(outcome.movement.source, Source::MinimumForce);
    assert!(matches!(outcome.verdict, Verdict::Infeasible { .. }));
    let outward = normal().dot(&outcome.movement.twist_command);
    assert!(outward > 0.0, "moves out at {outward} m/s");
}

/// A way to spoil a sample, and the fault and stop reason that must come of it.
type Spoiled = (fn(&mut Sample<2, 2>), fn(&SampleFault) -> bool, StopReason);

const MILLISECOND: u64 = 1_000_000;

fn spoiled() -> Vec<Spoiled> {
    fn not_finite(fault: &SampleFault, wanted: Field, at: usize) -> bool {
        matches!(fault, SampleFault::NotFinite { field, index } if *field == wanted && *index == at)
    }
    vec![
        (|s| s.joint_position[0] = f64::NAN, |f| not_finite(f, Field::JointPosition, 0), StopReason::SampleInvalid),
        (|s| s.joint_velocity[1] = f64::NAN, |f| not_finite(f, Field::JointVelocity, 1), StopReason::SampleInvalid),
        (
            |s| s.joint_position_reference[1] = f64::NAN,
            |f| not_finite(f, Field::JointPositionReference, 1),
            StopReason::SampleInvalid,
        ),
        (|s| s.twist_reference[0] = f64::NAN, |f| not_finite(f, Field::TwistReference, 0), StopReason::SampleInvalid),
        (|s| s.wrench.0[1] = f64::NAN, |f| not_finite(f, Field::Wrench, 1), StopReason::SampleInvalid),
        (|s| s.wrench.0[0] = f64::INFINITY, |f| not_finite(f, Field::Wrench, 0), StopReason::SampleInvalid),
        (|s| s.wrench_valid = false, |f| *f == SampleFault::WrenchInvalid, StopReason::SampleInvalid),
        (|s| s.joint_count = 7, |f| *f == SampleFault::JointCount { found: 7, expected: 2 }, StopReason::JointCount),
        (
            |s| s.stamp = s.stamp - ns(13 * MILLISECOND),
            |f| *f == SampleFault::Stale { age: ns(13 * MILLISECOND) },
            StopReason::SampleStale,
        ),
        (
            |s| s.stamp = s.stamp + ns(5 * MILLISECOND),
            |f| *f == SampleFault::FromFuture { ahead: ns(5 * MILLISECOND) },
            StopReason::SampleInvalid,
        ),
        (|s| s.sequence = 2, |f| *f == SampleFault::OutOfOrder { sequence: 2, last: 2 }, StopReason::SampleInvalid),
    ]
}

#[test]
fn bad_samples_in_contact_play_the_plan_then_retreat_then_stop() {
    let retreating = (parameters().stopping.retreat_time.seconds() / 0.004) as u64;
    let check =
        |index: usize, controller: &mut Scenario, next: &mut dyn FnMut(&mut Scenario, u64) -> Outcome<2, 2>, reason| {
            let plan = offsets(controller);
            for cycle in 1..=3 {
                let outcome = next(controller, 2 + cycle);
                assert_eq!(
                    (outcome.movement.source, outcome.mode),
                    (Source::Plan, Mode::Contact),
                    "fault {index}, cycle {cycle}"
                );
                assert_eq!(outcome.movement.velocity_offset, plan[cycle as usize], "fault {index}, cycle {cycle}");
                assert!(outcome.movement.joint_velocity_offset.norm() > 0.0);
            }
            for cycle in 4..4 + retreating {
                let outcome = next(controller, 2 + cycle);
                assert_stopping(&outcome, reason);
                assert_eq!(outcome.movement.source, Source::Retreat, "fault {index}, cycle {cycle}");
                assert!(
                    close(&outcome.movement.twist_command, &(normal() * 0.05)),
                    "fault {index}: {}",
                    outcome.movement.twist_command
                );
                assert_eq!(
                    controller.plan().at(at(0)),
                    Some(outcome.movement.velocity_offset),
                    "what is played on is the same"
                );
            }
            for cycle in 4 + retreating..6 + retreating {
                assert_held(&next(controller, 2 + cycle), reason, &format!("fault {index}, cycle {cycle}"));
            }
            // Good samples do not end it.
            let sequence = 10 + retreating;
            assert_held(&step(controller, &pressing(-100.0, sequence)), reason, &format!("fault {index}"));
        };
    for (index, (spoil, is_fault, reason)) in spoiled().into_iter().enumerate() {
        let (mut controller, _) = touched(parameters(), &[]);
        let mut next = |controller: &mut Scenario, sequence: u64| {
            let mut sample = contact(sequence);
            let now = sample.stamp;
            spoil(&mut sample);
            let outcome = controller.step(Event::Sample(&sample), now, &mut || false);
            assert!(outcome.fault.is_some_and(|fault| is_fault(&fault)), "fault {index}: {:?}", outcome.fault);
            outcome
        };
        check(index, &mut controller, &mut next, reason);
    }
    let (mut controller, _) = touched(parameters(), &[]);
    let mut silent = |controller: &mut Scenario, sequence: u64| {
        controller.step(Event::Silence, contact(sequence).stamp, &mut || false)
    };
    check(99, &mut controller, &mut silent, StopReason::SampleStale);
}

#[test]
fn a_good_sample_after_two_bad_ones_goes_on_in_contact() {
    let (mut controller, _) = touched(parameters(), &[]);
    let plan = offsets(&controller);
    for sequence in 3..=4 {
        step(&mut controller, &Sample { wrench_valid: false, ..contact(sequence) });
    }
    assert_eq!(controller.counters().rejected, 2);
    let late = controller.step(Event::Sample(&contact(5)), contact(5).stamp, &mut || true);
    assert_eq!(
        (late.movement.source, late.movement.velocity_offset),
        (Source::Plan, plan[3]),
        "the plan is still the optimiser's"
    );
    let outcome = step(&mut controller, &contact(6));
    assert_eq!((outcome.movement.source, outcome.mode, outcome.stop_reason), (Source::Mpc, Mode::Contact, None));
}

#[test]
fn silence_in_free_motion_ends_in_idle_and_a_sample_brings_it_back() {
    let mut controller = scenario(parameters(), &[]);
    let never = controller.step(Event::Silence, at(5 * CYCLE), &mut || false);
    assert_eq!((never.mode, never.stop_reason), (Mode::Idle, None), "before the first sample nothing is missing");
    let first = pressing(-100.0, 1);
    assert_eq!(step(&mut controller, &first).mode, Mode::Free);
    let silent = |controller: &mut Scenario, cycles: u64| {
        let outcome = controller.step(Event::Silence, first.stamp + ns(cycles * CYCLE), &mut || false);
        assert_eq!(outcome.movement.velocity_offset, Vector2::zeros());
        (outcome.mode, outcome.stop_reason, outcome.movement.motion)
    };
    assert_eq!(silent(&mut controller, 3), (Mode::Free, None, Motion::Offset));
    let held = (Mode::Idle, Some(StopReason::SampleStale), Motion::Hold);
    assert_eq!(silent(&mut controller, 4), held, "who loses control holds the arm");
    assert_eq!(silent(&mut controller, 500), held);
    // Withdrawn or not: nobody knows what it touches.
    controller.end(Ending::Disabled);
    assert_eq!(silent(&mut controller, 501), held);
    assert_eq!(controller.enable(), Ok(true));
    let back = step(&mut controller, &pressing(-100.0, 600));
    assert_eq!((back.mode, back.stop_reason), (Mode::Free, None));
}

#[test]
fn a_first_sample_in_contact_is_held() {
    let mut controller = scenario(parameters(), &[]);
    assert_held(&step(&mut controller, &contact(1)), StopReason::StartedInContact, "first sample");
    let (mut controller, _) = touched(parameters(), &[]);
    let restarted = Sample { boot_id: 8, ..contact(1) };
    let outcome = controller.step(Event::Sample(&restarted), contact(3).stamp, &mut || false);
    assert_eq!(outcome.fault, None, "another run counts from anew");
    assert_held(&outcome, StopReason::StartedInContact, "restart in contact");
    // In the air a restart changes nothing.
    let mut controller = scenario(parameters(), &[]);
    step(&mut controller, &pressing(-100.0, 5));
    let restarted = Sample { boot_id: 8, sequence: 1, ..pressing(-100.0, 6) };
    assert_eq!(step(&mut controller, &restarted).mode, Mode::Free);
}

#[test]
fn a_singular_pose_is_held() {
    for mut controller in [scenario(parameters(), &[]), touched(parameters(), &[]).0] {
        step(&mut controller, &pressing(-100.0, 1));
        // So much later that the arm can be there.
        let straight = Sample { joint_position: Vector2::new(0.5, 0.0), ..contact(40) };
        let held = step(&mut controller, &straight);
        assert_held(&held, StopReason::Singular, "stretched");
        let found = held.singular.expect("says how singular").reciprocal_condition;
        assert!(found < parameters().minimum_reciprocal_condition, "{found}");
    }
}

#[test]
fn without_drives_free_motion_ends_in_idle_and_contact_in_a_stop() {
    let off = |sample| Sample { drives_enabled: false, ..sample };
    let mut controller = scenario(parameters(), &[]);
    for sample in [off(pressing(-100.0, 1)), off(contact(2))] {
        let outcome = step(&mut controller, &sample);
        assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Idle, Some(StopReason::DrivesDisabled)));
    }
    assert_eq!(step(&mut controller, &pressing(-100.0, 3)).mode, Mode::Free);
    let outcome = step(&mut controller, &off(pressing(-100.0, 4)));
    assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Idle, Some(StopReason::DrivesDisabled)));
    assert_eq!(outcome.movement.motion, Motion::Hold);

    let (mut controller, _) = touched(parameters(), &[]);
    assert_held(&step(&mut controller, &off(contact(3))), StopReason::DrivesDisabled, "in contact");
    let leaving = off(pushing(60.0, -0.02, 4));
    assert_held(&step(&mut controller, &leaving), StopReason::DrivesDisabled, "no retreat without drives");
}
