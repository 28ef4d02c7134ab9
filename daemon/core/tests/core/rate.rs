//! The rate of the samples: the wrong one refuses control, one late stamp does not.

use crate::common::scripted::{assert_stopping, contact, scenario, touched};
use crate::common::{CYCLE, at, ns, parameters, pressing, pushing, step};
use admittance_core::intake::{Sample, WrongRate};
use admittance_core::vocabulary::{ModeName as Mode, Motion, StopReason};

/// `sample` as if every cycle so far had been 5 % too long.
fn slow(sample: Sample<2, 2>) -> Sample<2, 2> {
    Sample { stamp: at(1_000_000_000 + sample.sequence * CYCLE / 100 * 105), ..sample }
}

#[test]
fn the_wrong_rate_refuses_control_and_stops_in_contact() {
    let mut controller = scenario(parameters(), &[]);
    for sequence in 1..=63 {
        assert_eq!(step(&mut controller, &slow(pressing(-100.0, sequence))).mode, Mode::Free, "sample {sequence}");
    }
    for sequence in 64..=210 {
        let outcome = step(&mut controller, &slow(pressing(-100.0, sequence)));
        assert_eq!((outcome.mode, outcome.stop_reason), (Mode::Idle, Some(StopReason::RateMismatch)), "{sequence}");
        assert_eq!(outcome.movement.motion, Motion::Hold, "{sequence}: the arm would drive on without control");
        let WrongRate { spacing, is_even } = outcome.wrong_rate.expect("it is wrong");
        assert!((spacing - 0.0042).abs() < 1e-9 && is_even, "{spacing} s");
    }
    // The right rate from here on: when most of the last 100 are right all is well.
    let start = slow(pressing(-100.0, 210)).stamp;
    for sequence in 211..=400 {
        let stamp = start + ns((sequence - 210) * CYCLE);
        let outcome = step(&mut controller, &Sample { stamp, ..pressing(-100.0, sequence) });
        assert!(sequence < 280 || outcome.mode == Mode::Free, "{sequence}: {:?}", outcome.stop_reason);
    }

    let mut controller = scenario(parameters(), &[]);
    step(&mut controller, &slow(pressing(-100.0, 1)));
    for sequence in 2..=63 {
        assert_eq!(step(&mut controller, &slow(pushing(150.0, 0.05, sequence))).mode, Mode::Contact);
    }
    assert_stopping(&step(&mut controller, &slow(pushing(150.0, 0.05, 64))), StopReason::RateMismatch);
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
    // No two spacings in a row are alike, and they are 25 % too long in the mean: the longer of them
    // is nobody's cycle.
    let mut controller = scenario(parameters(), &[]);
    let uneven = |sequence: u64| at(1_000_000_000 + CYCLE * 5 * sequence / 4 + CYCLE / 2 * (sequence % 2));
    let found = (1..=420).find(|&sequence| {
        let sample = Sample { stamp: uneven(sequence), ..pressing(-100.0, sequence) };
        step(&mut controller, &sample).stop_reason == Some(StopReason::RateMismatch)
    });
    assert!(found.is_some_and(|sequence| sequence <= 310), "{found:?}");
}

/// Samples of an arm at rest in contact, stamped by `stamp` (ns after the first, by the number of
/// cycles since); the reasons for which it stopped, without those that are about single samples.
fn stops(count: u64, mut stamp: impl FnMut(u64) -> u64) -> Vec<WrongRate> {
    let (mut controller, outcome) = touched(parameters(), &[]);
    assert_eq!(outcome.mode, Mode::Contact);
    let begun = contact(2).stamp;
    (3..count)
        .filter_map(|sequence| {
            let sample = Sample { stamp: begun + ns(stamp(sequence - 2)), ..contact(sequence) };
            let outcome = step(&mut controller, &sample);
            let is_stop = outcome.stop_reason == Some(StopReason::RateMismatch);
            outcome.wrong_rate.filter(|_| is_stop)
        })
        .collect()
}

#[test]
fn a_pause_is_a_pause() {
    // Of 0.1 to 4 cycles, after which the cycle goes on as before: one in 40 samples for ever.
    for tenths in (1..=40).step_by(3) {
        let found = stops(1000, |cycle| cycle * CYCLE + cycle / 40 * (tenths * CYCLE / 10));
        assert_eq!(found, [], "{tenths} tenths of a cycle");
    }
}

#[test]
fn jitter_is_no_rate_and_the_advice_is_right_or_absent() {
    // Late by up to 0.4 ms, in no order.
    let jitter = |cycle: u64| cycle.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32 & 0x5_ffff;
    assert_eq!(stops(2000, |cycle| cycle * CYCLE + jitter(cycle)), []);
    let wrong = stops(400, |cycle| cycle * CYCLE / 100 * 105 + jitter(cycle));
    for WrongRate { spacing, is_even } in &wrong {
        assert!(!is_even || (spacing / 0.0042 - 1.0).abs() < 0.01, "{spacing} s");
    }
    assert!(!wrong.is_empty());
    // Every other cycle is half as long again: no cycle of this length could be configured.
    let uneven = stops(400, |cycle| cycle * CYCLE + cycle.div_ceil(2) * (CYCLE / 2) + cycle % 3 * (CYCLE / 8));
    assert!(uneven.first().is_some_and(|rate| !rate.is_even), "{:?}", uneven.first());
}

#[test]
fn a_sequence_that_jumps_is_neither_a_rate_nor_missed() {
    let (mut controller, _) = touched(parameters(), &[]);
    for sequence in 3..=420 {
        let ahead = if sequence >= 200 { 1 << 40 } else { 0 };
        let sample = contact(sequence);
        let outcome = step(&mut controller, &Sample { sequence: sequence + ahead, ..sample });
        assert_eq!((outcome.mode, outcome.stop_reason, outcome.fault), (Mode::Contact, None, None), "at {sequence}");
        let skipped = outcome.arrival.expect("it is good").skipped;
        assert_eq!(skipped, if sequence == 200 { 1 << 40 } else { 0 });
    }
    assert_eq!(controller.counters().missed, 0);
    // One that counts by four, always.
    let mut controller = scenario(parameters(), &[]);
    for sequence in 1..=420 {
        let outcome = step(&mut controller, &Sample { sequence: 4 * sequence, ..slow(pressing(-100.0, sequence)) });
        let expected = if sequence < 64 { None } else { Some(StopReason::RateMismatch) };
        assert_eq!(outcome.stop_reason, expected, "the wrong rate is found by its stamps: {sequence}");
    }
}
