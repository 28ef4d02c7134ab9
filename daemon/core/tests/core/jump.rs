//! Jumps of the measured joint position: refused however long they last; missed samples are not
//! jumps.

use admittance_core::Parameters;
use admittance_core::intake::Event;
use admittance_core::intake::{Sample, SampleFault};
use admittance_core::vocabulary::Motion;
use admittance_core::vocabulary::{ModeName as Mode, StopReason};
use nalgebra::Vector2;

use crate::common::{self, PlanarController, active_set, pressing, pushing, step};

fn limited() -> Parameters<2, 2> {
    let mut parameters = common::parameters();
    parameters.limits.joint_speed = Some(Vector2::repeat(3.0));
    parameters
}

fn with_contact(parameters: Parameters<2, 2>) -> PlanarController<admittance_core::mpc::qp::ActiveSet<Vec<f64>>> {
    let mut controller = common::controller(parameters, active_set());
    step(&mut controller, &pressing(-100.0, 1));
    assert_eq!(step(&mut controller, &pushing(60.0, 0.05, 2)).mode, Mode::Contact);
    controller
}

fn off(sample: Sample<2, 2>, joint: usize, by: f64) -> Sample<2, 2> {
    let mut sample = sample;
    sample.joint_position[joint] += by;
    sample
}

#[test]
fn a_jump_is_refused_by_joint_and_value_until_the_joint_is_back() {
    let mut controller = with_contact(limited());
    // 3 rad/s, twice, for 4 ms, and a milliradian.
    for sequence in 3..5 {
        let outcome = step(&mut controller, &off(pushing(60.0, 0.05, sequence), 1, 0.03));
        let Some(fault @ SampleFault::Jump { joint: 1, off, most, .. }) = outcome.fault else { panic!("{outcome:?}") };
        assert!((off - 0.03).abs() < 1e-9 && (most - 0.025).abs() < 1e-9, "{fault}");
        assert!(fault.to_string().contains("joint_position[1] jumped by 0.0300 rad, accepted: at most 0.0250 rad"));
        assert_eq!(outcome.mode, Mode::Contact, "the last plan goes on");
    }
    let back = step(&mut controller, &pushing(60.0, 0.05, 5));
    assert_eq!((back.fault, back.mode), (None, Mode::Contact));
}

#[test]
fn a_jump_that_stays_is_never_believed_under_control() {
    let mut controller = with_contact(limited());
    // Small enough for time alone to make it plausible.
    let outcomes: Vec<_> =
        (3..60).map(|sequence| step(&mut controller, &off(pushing(60.0, 0.05, sequence), 0, -0.03))).collect();
    let stopped = outcomes.iter().position(|outcome| outcome.mode == Mode::Stopped).expect("it stops");
    assert!(stopped > 3 && outcomes[..=stopped].iter().all(|o| matches!(o.fault, Some(SampleFault::Jump { .. }))));
    assert_eq!(outcomes[stopped].stop_reason, Some(StopReason::SampleInvalid));
    let held = &outcomes[stopped..];
    assert!(held.iter().all(|o| o.movement.motion == Motion::Hold && o.stop_reason == Some(StopReason::SampleInvalid)));
    assert!(held.iter().all(|o| matches!(o.fault, Some(SampleFault::Jump { .. }))), "nor of a stopped arm");
}

#[test]
fn a_stopped_arm_that_jumped_is_held_until_a_person_resets() {
    let mut controller = with_contact(limited());
    controller.step(Event::Silence, common::at(3_000_000_000), &mut || false);
    assert_eq!(controller.mode(), Mode::Stopped);
    let away = |sequence| Sample {
        stamp: common::at(3_000_000_000 + sequence * common::CYCLE),
        ..pushing(60.0, -0.05, sequence)
    };
    let retreats = step(&mut controller, &away(1000));
    assert_eq!((retreats.mode, retreats.movement.motion), (Mode::Stopped, Motion::Offset), "it may retreat");
    for sequence in 1001..1200 {
        let jumped = step(&mut controller, &off(away(sequence), 1, -0.5));
        assert!(matches!(jumped.fault, Some(SampleFault::Jump { joint: 1, .. })), "sample {sequence}");
        assert_eq!((jumped.mode, jumped.movement.motion), (Mode::Stopped, Motion::Hold), "sample {sequence}");
    }
    // The arm presses: it has to retreat first, from where it is now believed to be.
    controller.reset(false).expect_err("it presses");
    let believed = step(&mut controller, &off(away(1200), 1, -0.5));
    assert_eq!((believed.fault, believed.mode, believed.movement.motion), (None, Mode::Stopped, Motion::Offset));

    // In free space the reset is done, and control begins at the new position.
    let free = |sequence| Sample { wrench: common::given(Vector2::zeros()), ..away(sequence) };
    step(&mut controller, &off(free(1201), 1, -0.5));
    assert!(step(&mut controller, &free(1202)).fault.is_some());
    controller.reset(false).expect("nothing presses, nothing pushes");
    let begun = step(&mut controller, &free(1203));
    assert_eq!((begun.fault, begun.mode), (None, Mode::Free));
}

#[test]
fn what_moved_while_samples_were_missed_is_no_jump() {
    let mut controller = with_contact(limited());
    // Two were missed: three cycles at 5 rad/s.
    let outcome = step(&mut controller, &off(pushing(60.0, 0.05, 5), 1, 0.06));
    assert_eq!(outcome.fault, None);
    assert_eq!(step(&mut controller, &off(pushing(60.0, 0.05, 6), 1, 0.06)).fault, None);
}

#[test]
fn without_a_limit_and_across_runs_there_is_a_general_bound_or_none() {
    let mut controller = common::controller(common::parameters(), active_set());
    step(&mut controller, &pressing(-100.0, 1));
    assert_eq!(step(&mut controller, &off(pressing(-100.0, 2), 1, 0.08)).fault, None, "20 rad/s");
    let fault = step(&mut controller, &off(pressing(-100.0, 3), 1, 0.17)).fault;
    assert!(matches!(fault, Some(SampleFault::Jump { joint: 1, .. })), "{fault:?}");
    let restarted = Sample { boot_id: 8, ..off(pressing(-100.0, 4), 1, -1.0) };
    let outcome = controller.step(Event::Sample(&restarted), restarted.stamp, &mut || false);
    assert_eq!(outcome.fault, None, "another run of the motion controller may be anywhere");
}
