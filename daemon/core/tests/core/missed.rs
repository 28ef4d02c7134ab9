//! Samples that were never seen: counted, and a stop where the law acted on an old one for too long
//! or again and again. A sample that was refused was seen.

use crate::common::scripted::{Scenario, assert_held, contact, scenario, touched};
use crate::common::{PlanarController, parameters, pressing, step};
use admittance_core::Outcome;
use admittance_core::Parameters;
use admittance_core::intake::Sample;
use admittance_core::mpc::qp::QpSolver;
use admittance_core::vocabulary::{ModeName as Mode, Motion, StopReason};

/// So many cycles may pass on the last plan.
fn bridging(cycles: u32) -> Parameters<2, 2> {
    let mut parameters = parameters();
    parameters.timing.max_consecutive_fallbacks = cycles;
    parameters
}

/// Goes on in contact: the sequence was `last`, and so many samples never came.
fn after(controller: &mut Scenario, last: &mut u64, missed: u64) -> Outcome<2, 2> {
    *last += missed + 1;
    step(controller, &contact(*last))
}

#[test]
fn in_contact_as_many_may_be_missed_in_a_row_as_the_plan_bridges() {
    for bridged in [0, 1, 3, 10, 20] {
        let (mut controller, _) = touched(bridging(bridged), &[]);
        let mut last = 2;
        let outcome = after(&mut controller, &mut last, u64::from(bridged));
        assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Contact, None), "{bridged} missed");
        assert_eq!(controller.counters().missed, u64::from(bridged));
        // Their age is known to the cycle, and the next one is none the worse.
        assert_eq!(after(&mut controller, &mut last, 0).mode, Mode::Contact);
        let (mut controller, _) = touched(bridging(bridged), &[]);
        let outcome = after(&mut controller, &mut 2, u64::from(bridged) + 1);
        // At a force that the stop may rest at.
        assert_held(&outcome, StopReason::SamplesMissed, "one more");
        let arrival = outcome.arrival.expect("it is good");
        assert_eq!(arrival.missed, u64::from(bridged) + 1);
        assert_eq!(arrival.age.nanoseconds(), (u64::from(bridged) + 2) * 4_000_000);
    }
}

/// The first of the controller's samples at which it says that samples were missed, where of each
/// `period` samples the last `missed` are.
fn stopped_at<S: QpSolver>(
    controller: &mut PlanarController<S>,
    make: fn(u64) -> Sample<2, 2>,
    period: u64,
    missed: u64,
) -> Option<u64> {
    (3..800).filter(|sequence| (sequence - 3) % period < period - missed).find(|sequence| {
        let outcome = step(controller, &make(*sequence));
        if outcome.stop_reason.is_some() {
            assert_eq!(outcome.stop_reason, Some(StopReason::SamplesMissed), "{missed} of {period}");
        }
        outcome.stop_reason.is_some()
    })
}

#[test]
fn more_than_a_third_missed_again_and_again_is_a_stop() {
    let cases = [(13, 12), (2, 1), (3, 2), (5, 2), (3, 1), (4, 1), (40, 8), (50, 18)];
    let found = cases.map(|(period, missed)| {
        let (mut controller, _) = touched(bridging(20), &[]);
        (period, missed, stopped_at(&mut controller, contact, period, missed))
    });
    let stopped = |of: usize| found[of].2;
    // The third gap of twelve.
    assert_eq!(stopped(0), Some(3 + 3 * 13), "{found:?}");
    assert!((1..=3).all(|case| stopped(case).is_some_and(|at| at <= 90)), "{found:?}");
    assert!((4..=6).all(|case| stopped(case).is_none()), "a third at most: {found:?}");
    assert!(stopped(7).is_some(), "{found:?}");
}

fn in_the_air(sequence: u64) -> Sample<2, 2> {
    pressing(-100.0, sequence)
}

#[test]
fn in_free_motion_it_holds_until_samples_come_again() {
    let mut controller = scenario(bridging(3), &[]);
    (1..3).for_each(|sequence| assert_eq!(step(&mut controller, &in_the_air(sequence)).mode, Mode::Free));
    let at = stopped_at(&mut controller, in_the_air, 13, 12).expect("it is noticed");
    // For as long as it goes on, and then until few of the last hundred were missed.
    for sequence in (at..at + 400).filter(|sequence| (sequence - 3) % 13 == 0) {
        let outcome = step(&mut controller, &in_the_air(sequence + 13));
        assert_eq!((outcome.mode, outcome.movement.motion), (Mode::Idle, Motion::Hold), "{sequence}");
        assert_eq!(outcome.stop_reason, Some(StopReason::SamplesMissed));
    }
    let begin = at + 500;
    let again = (begin..begin + 300).find(|s| step(&mut controller, &in_the_air(*s)).mode == Mode::Free);
    assert!(again.is_some_and(|again| again > begin + 50 && again <= begin + 100), "{again:?} after {begin}");
    // One long gap is a pause in free motion, and no habit.
    let last = again.expect("just found");
    assert_eq!(step(&mut controller, &in_the_air(last + 60)).mode, Mode::Free);
}

#[test]
fn a_refused_sample_was_seen() {
    let (mut controller, _) = touched(bridging(3), &[]);
    for sequence in 3..400 {
        let refused = sequence % 3 != 0;
        let outcome = step(&mut controller, &Sample { wrench_valid: !refused, ..contact(sequence) });
        assert_eq!((outcome.mode, outcome.fault.is_some()), (Mode::Contact, refused), "{sequence}");
    }
    let counters = controller.counters();
    assert_eq!((counters.missed, counters.rejected), (0, 264));
}

#[test]
fn a_sequence_left_at_zero_is_named() {
    let mut controller = scenario(parameters(), &[]);
    for cycle in 1..10 {
        let outcome = step(&mut controller, &Sample { sequence: 0, ..in_the_air(cycle) });
        assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Idle, None));
        let fault = outcome.fault.expect("it is refused").to_string();
        assert!(fault.starts_with("sequence = 0: "), "{fault}");
    }
}
