//! The rate of the samples: the wrong one refuses control, one late stamp does not.

use crate::common::scripted::{assert_stopping, contact, scenario, touched};
use crate::common::{CYCLE, at, ns, parameters, pressing, pushing, step};
use admittance_core::intake::Sample;
use admittance_core::vocabulary::{ModeName as Mode, Motion, StopReason};

/// `sample` as if every cycle so far had been 5 % too long.
fn slow(sample: Sample<2, 2>) -> Sample<2, 2> {
    Sample { stamp: at(1_000_000_000 + sample.sequence * CYCLE / 100 * 105), ..sample }
}

#[test]
fn the_wrong_rate_refuses_control_and_stops_in_contact() {
    let mut controller = scenario(parameters(), &[]);
    // A block begins and ends with even spacings.
    for sequence in 1..=102 {
        assert_eq!(step(&mut controller, &slow(pressing(-100.0, sequence))).mode, Mode::Free, "sample {sequence}");
    }
    for sequence in 103..=210 {
        let outcome = step(&mut controller, &slow(pressing(-100.0, sequence)));
        assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Idle, Some(StopReason::RateMismatch)), "{sequence}");
        assert_eq!(outcome.movement.motion, Motion::Hold, "{sequence}: the arm would drive on without control");
    }
    // The right rate from here on: after a block of 100 all is well.
    let start = slow(pressing(-100.0, 210)).stamp;
    for sequence in 211..=400 {
        let stamp = start + ns((sequence - 210) * CYCLE);
        let outcome = step(&mut controller, &Sample { stamp, ..pressing(-100.0, sequence) });
        assert!(sequence < 400 || outcome.mode == Mode::Free, "{:?}", outcome.stop_reason);
    }

    let mut controller = scenario(parameters(), &[]);
    step(&mut controller, &slow(pressing(-100.0, 1)));
    for sequence in 2..=102 {
        assert_eq!(step(&mut controller, &slow(pushing(150.0, 0.05, sequence))).mode, Mode::Contact);
    }
    assert_stopping(&step(&mut controller, &slow(pushing(150.0, 0.05, 103))), StopReason::RateMismatch);
}

#[test]
fn one_late_stamp_is_no_rate_wherever_it_comes() {
    for late in 3..=210 {
        let (mut controller, _) = touched(parameters(), &[]);
        for sequence in 3..=420 {
            // A cycle late, then back on schedule: the next sample has the same stamp.
            let delay = ns(if sequence == late { CYCLE } else { 0 });
            let sample = contact(sequence);
            let outcome = step(&mut controller, &Sample { stamp: sample.stamp + delay, ..sample });
            assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Contact, None), "{late} late, at {sequence}");
            assert_eq!(outcome.fault.is_some(), sequence == late + 1, "{late} late, at {sequence}");
        }
    }
}

#[test]
fn a_shift_of_one_cycle_is_no_rate_and_uneven_stamps_hide_none() {
    for late in 3..=210 {
        let (mut controller, _) = touched(parameters(), &[]);
        for sequence in 3..=420 {
            // One overrun: all later stamps are a cycle late.
            let delay = ns(if sequence >= late { CYCLE } else { 0 });
            let sample = contact(sequence);
            let outcome = step(&mut controller, &Sample { stamp: sample.stamp + delay, ..sample });
            assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Contact, None), "{late} late, at {sequence}");
        }
    }
    // No two spacings in a row are alike, and they are 25 % too long in the mean.
    let mut controller = scenario(parameters(), &[]);
    let uneven = |sequence: u64| at(1_000_000_000 + CYCLE * 5 * sequence / 4 + CYCLE / 2 * (sequence % 2));
    let found = (1..=420).find(|&sequence| {
        let sample = Sample { stamp: uneven(sequence), ..pressing(-100.0, sequence) };
        step(&mut controller, &sample).stop_reason == Some(StopReason::RateMismatch)
    });
    assert!(found.is_some_and(|sequence| sequence <= 310), "{found:?}");
}
