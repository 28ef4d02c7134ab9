//! The inverse of the wrench filter, against the filter itself in fine steps.

use nalgebra::{Vector2, Vector6};

use super::*;
use crate::common;
use crate::intake::{Event, Intake, Sample};
use crate::quantities::GivenWrench;

const LAG: f64 = 0.020;
const LIMIT: f64 = 200.0;

fn inverse(noise: f64, limit: f64, cycle: f64) -> LagInverse<2> {
    let both = Vector2::repeat;
    LagInverse::new(both(LAG), &both(noise), &both(limit), Span::from_seconds(cycle))
}

fn follow(inverse: &mut LagInverse<2>, sequence: u64, stamp: u64, wrench: [f64; 2]) -> WithoutLag<2> {
    let wrench = GivenWrench(Vector6::new(wrench[0], wrench[1], 0.0, 0.0, 0.0, 0.0));
    let sample =
        Sample { sequence, stamp: Instant::from_nanoseconds(stamp), wrench, ..common::pressing(0.0, sequence) };
    let mut intake = Intake::new(common::parameters().intake());
    inverse.follow(intake.take(Event::Sample(&sample), sample.stamp).expect("a good sample"));
    *inverse.force()
}

/// f̂ at uneven stamps (s) of a force, by the filter in steps of a microsecond.
fn filtered(force: impl Fn(f64) -> f64, stamps: &[f64]) -> Vec<f64> {
    const STEP: f64 = 1e-6;
    let (mut estimate, mut time) = (0.0, 0.0);
    let until = |stamp: &f64| {
        while time < *stamp {
            estimate += (force(time + STEP / 2.0) - estimate) * (1.0 - f64::exp(-STEP / LAG));
            time += STEP;
        }
        estimate
    };
    stamps.iter().map(until).collect()
}

/// Stamps 0.8 to 1.2 cycles apart, and one gap.
fn uneven(cycle: f64, count: usize) -> Vec<f64> {
    let mut stamp = 0.0;
    let spacing = |index: usize| if index == count / 2 { 3.0 } else { [1.0, 1.2, 0.8][index % 3] };
    (0..count)
        .map(|index| {
            stamp += cycle * spacing(index);
            stamp
        })
        .collect()
}

#[test]
fn it_is_the_mean_of_the_force_over_the_window_at_any_spacing() {
    let force = |time: f64| if time < 0.03 { 0.0 } else { 260.0 * ((time - 0.03) * 180.0).sin().max(0.0) };
    for (cycle, noise, window) in [(0.004, 0.0, 1), (0.004, 2.0, 2), (0.001, 0.0, 1), (0.001, 2.0, 6)] {
        let mut inverse = inverse(noise, LIMIT, cycle);
        assert_eq!(inverse.window.map(|it| it.samples), [window; 2], "{cycle} s, {noise} N");
        let stamps = uneven(cycle, (0.1 / cycle) as usize);
        let estimates = filtered(force, &stamps);
        let (mut shown, mut checked) = (0.0_f64, 0);
        for (index, (stamp, estimate)) in stamps.iter().zip(&estimates).enumerate() {
            let found = follow(&mut inverse, index as u64 + 1, (stamp * 1e9) as u64 + 1_000_000_000, [*estimate, 0.0]);
            let is_before = |before: &&f64| stamp - **before >= cycle * (window as f64 - 0.1) - 1e-12;
            let Some(begin) = stamps[..index].iter().rfind(is_before).copied() else {
                assert_eq!((found.wrench[0], found.noise_gain[0]), (*estimate, 1.0), "no whole window yet");
                continue;
            };
            // The mean itself, weights e^(−age/T_est), by a sum of its own.
            const PARTS: i32 = 4000;
            let (mut sum, mut weights) = (0.0, 0.0);
            for part in 0..PARTS {
                let time = begin + (stamp - begin) * (f64::from(part) + 0.5) / f64::from(PARTS);
                let weight = ((time - stamp) / LAG).exp();
                (sum, weights) = (sum + weight * force(time), weights + weight);
            }
            assert!((found.wrench[0] - sum / weights).abs() < 0.1, "{cycle} s at {stamp}: {found:?}");
            shown = shown.max(found.wrench[0]);
            checked += 1;
        }
        assert!(checked > 20 && shown < 260.0 && shown > 220.0, "{shown} N of 260");
        assert!(estimates.iter().copied().fold(0.0, f64::max) < 180.0, "f̂ lags");
    }
}

#[test]
fn its_noise_is_what_it_says() {
    // White noise of 1 N, evenly distributed: ±√3.
    let mut state = 1_u64;
    let mut draw = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 12.0_f64.sqrt()
    };
    for (cycle, noise) in [(4_000_000, 0.0), (4_000_000, 2.0), (1_000_000, 1.0)] {
        let mut inverse = inverse(noise, LIMIT, cycle as f64 * 1e-9);
        let (mut squares, mut gain, mut count) = (0.0, 0.0, 0.0);
        for sequence in 1..20_000_u64 {
            let found = follow(&mut inverse, sequence, 1_000_000_000 + sequence * cycle, [draw(), 0.0]);
            if sequence > 32 {
                (squares, count, gain) = (squares + found.wrench[0].powi(2), count + 1.0, found.noise_gain[0]);
            }
        }
        let real = f64::sqrt(squares / count);
        assert!((real / gain - 1.0).abs() < 0.05, "{cycle} ns, told {noise} N: {real}, said to be {gain}");
        assert!(NOISE_DEVIATIONS * gain * noise <= 0.25 * LIMIT, "the window is long enough");
    }
}

#[test]
fn a_window_is_no_longer_than_the_lag_and_none_is_needed_without() {
    // A limit that is hopeless with this noise.
    assert_eq!(inverse(5.0, 10.0, 0.004).window.map(|it| it.samples), [5; 2]);
    assert_eq!(inverse(5.0, 10.0, 0.000_25).window.map(|it| it.samples), [KEPT - 1; 2]);
    let mut ideal =
        LagInverse::new(Vector2::new(0.0, LAG), &Vector2::zeros(), &Vector2::repeat(LIMIT), Span::from_seconds(0.004));
    follow(&mut ideal, 1, 1_000_000_000, [0.0, 0.0]);
    let found = follow(&mut ideal, 2, 1_004_000_000, [30.0, 30.0]);
    assert_eq!((found.wrench[0], found.noise_gain[0]), (30.0, 1.0));
    assert!(found.wrench[1] > 160.0);
}

#[test]
fn noise_that_no_window_takes_out_is_said() {
    // e^(−0.31) = 0.73345 of f̂ is left: 5 σ √(1 + a²) / (1 − a) = 23.2625 σ, of which 5 N are
    // allowed for.
    let found = NoiseWindow::of(1.0, 20.0, 0.1, Span::from_seconds(0.001));
    assert_eq!(found.samples, KEPT - 1);
    assert!((found.noise - 23.2625).abs() < 1e-4 && (found.excess - 18.2625).abs() < 1e-4, "{found:?}");
    for quiet in [
        NoiseWindow::of(1.0, 200.0, 0.02, Span::from_seconds(0.001)),
        NoiseWindow::of(9.0, 9.0, 0.0, Span::from_seconds(0.001)),
    ] {
        assert_eq!(quiet.excess, 0.0, "{quiet:?}");
    }
}

#[test]
fn after_a_restart_of_the_motion_controller_nothing_of_before_counts() {
    let mut inverse = inverse(0.0, LIMIT, 0.004);
    for sequence in 1..50 {
        follow(&mut inverse, sequence, 1_000_000_000 + sequence * 4_000_000, [100.0, 0.0]);
    }
    assert_eq!(follow(&mut inverse, 1, 5_000_000, [0.0, 0.0]).wrench[0], 0.0);
    assert!(follow(&mut inverse, 2, 9_000_000, [10.0, 0.0]).wrench[0] > 50.0);
}

#[test]
fn a_late_stamp_claims_no_force_that_was_not_there() {
    // A touch that rises to 145 N and stays there, measured on schedule.
    let force = |time: f64| (16_000.0 * (time - 0.02)).clamp(0.0, 145.0);
    for (cycle, noise) in [(0.004, 0.0), (0.001, 0.0), (0.001, 2.0)] {
        let count = (0.06 / cycle) as usize;
        let stamps: Vec<f64> = (1..=count).map(|index| cycle * index as f64).collect();
        let estimates = filtered(force, &stamps);
        for (late, by) in (1..count - 1).flat_map(|late| [0.3, 0.5, 0.8, 0.95].map(|by| (late, by))) {
            let mut inverse = inverse(noise, LIMIT, cycle);
            for (index, (stamp, estimate)) in stamps.iter().zip(&estimates).enumerate() {
                let stamp = stamp + if index == late { by * cycle } else { 0.0 };
                let found =
                    follow(&mut inverse, index as u64 + 1, (stamp * 1e9) as u64 + 1_000_000_000, [*estimate, 0.0]);
                let what = format!("{cycle} s, sample {index}, {late} late by {by} of a cycle: {found:?}");
                assert!(found.wrench[0] < 146.0, "{what}");
            }
        }
    }
}

#[test]
fn what_only_one_way_of_seeing_the_tool_shows_is_not_certain() {
    for (shown, expected) in [
        ([30.0, 20.0, 0.0], 20.0),
        ([20.0, 30.0, 0.0], 20.0),
        ([-30.0, -20.0, 0.0], -20.0),
        ([30.0, -20.0, 0.0], 0.0),
        ([30.0, 20.0, 5.0], 15.0),
        ([-30.0, -20.0, 5.0], -15.0),
        ([30.0, 20.0, -50.0], 0.0),
    ] {
        assert_eq!(shown_by_both(shown), expected, "{shown:?}");
    }
}
