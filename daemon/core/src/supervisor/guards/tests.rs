//! What the guards take for noise.

use nalgebra::Vector2;

use super::*;
use crate::common;
use crate::parameters::Parameters;

const GUARDS: Guards = Guards { force: Some(10.0), mismatch: Some(50.0), mismatch_cycles: 1 };

/// What may be noise of 2 N: five deviations.
const NOISE: f64 = 10.0;

fn parameters() -> Parameters<2, 2> {
    Parameters { sign: ContactSign::Normal, ..common::parameters() }
}

#[test]
fn a_force_is_beyond_its_limit_by_more_than_guard_and_noise() {
    let (force, noise) = (Vector2::new(200.0, 100.0), Vector2::repeat(2.0));
    let limits = Limits { force: &force, noise: &noise, admittance: &[true, true] };
    let measured = |x: f64, y: f64| GUARDS.measured(&Vector2::new(x, y), &Vector2::zeros(), &limits);
    assert_eq!(measured(209.9 + NOISE, 109.9 + NOISE), None);
    assert_eq!(measured(-210.1 - NOISE, 0.0), Some(Cause::MeasuredForce));
    assert_eq!(measured(0.0, 110.1 + NOISE), Some(Cause::MeasuredForce));
    // What f̂ may be off by for long comes on top.
    let unsure = Vector2::new(30.0, 0.0);
    let force = |x: f64| GUARDS.measured(&Vector2::new(x, 0.0), &unsure, &limits);
    assert_eq!((force(239.9 + NOISE), force(240.1 + NOISE)), (None, Some(Cause::MeasuredForce)));
    // The lag taken out makes seven times the noise.
    let (noise_gain, noise_excess) = (Vector2::new(7.0, 1.0), Vector2::zeros());
    let without_lag = |x: f64| {
        let wrench = Vector2::new(x, 0.0);
        WithoutLag { wrench, certain: wrench, noise_gain, noise_excess }
    };
    let exceeded = |x: f64| GUARDS.exceeded(&without_lag(x), &Vector2::zeros(), &limits);
    assert_eq!((exceeded(209.9 + 7.0 * NOISE), exceeded(210.1 + 7.0 * NOISE)), (None, Some(Cause::ForceExceeded)));
    let exceeded = |x: f64| GUARDS.exceeded(&without_lag(x), &unsure, &limits);
    assert_eq!((exceeded(239.9 + 7.0 * NOISE), exceeded(240.1 + 7.0 * NOISE)), (None, Some(Cause::ForceExceeded)));
    // More than told is what the window could not help.
    let loud = |x: f64| WithoutLag { noise_excess: Vector2::repeat(80.0), ..without_lag(x) };
    assert_eq!(GUARDS.exceeded(&loud(289.9), &Vector2::zeros(), &limits), None);
    assert_eq!(GUARDS.exceeded(&loud(290.1), &Vector2::zeros(), &limits), Some(Cause::ForceExceeded));
    // What a tool's motion leaves open is no force.
    let feigned = WithoutLag { certain: Vector2::new(190.0, 0.0), ..without_lag(1e3) };
    assert_eq!(GUARDS.exceeded(&feigned, &Vector2::zeros(), &limits), None);
    let blind = Guards { force: None, ..GUARDS };
    assert_eq!(blind.measured(&Vector2::repeat(1e4), &Vector2::zeros(), &limits), None);
    let limits = Limits { admittance: &[false, true], ..limits };
    assert_eq!(GUARDS.measured(&Vector2::new(1e4, 0.0), &Vector2::zeros(), &limits), None, "no admittance axis");
}

#[test]
fn noise_is_neither_a_mismatch_nor_a_pull() {
    let parameters = parameters();
    let belief = Belief::new(parameters.belief());
    let pressing = |force: f64| -common::normal() * force;
    let mismatches = |force: f64, noise| GUARDS.mismatches(&pressing(force), noise, &belief);
    assert_eq!((mismatches(49.9, 0.0), mismatches(50.1, 0.0)), (false, true), "nothing is expected");
    assert_eq!((mismatches(49.9 + NOISE, 2.0), mismatches(50.1 + NOISE, 2.0)), (false, true));
    let most_pull = |noise| most_pull(parameters.sign, &parameters.thresholds, noise, &belief);
    assert_eq!((most_pull(0.0), most_pull(2.0)), (5.0, NOISE), "β, and noise");
}

#[test]
fn a_pull_that_lasts_contradicts_by_both_ways_of_seeing_the_tool() {
    const MOST: f64 = 5.0;
    // Pressing forces by q̇ and by the positions, a sample each 1 ms: which of them is the first to contradict, from 0.
    let contradicts = |forces: &dyn Fn(u64) -> [f64; 2]| {
        let mut pull = None;
        (0..50).find(|&sample| {
            let stamp = Instant::from_nanoseconds(sample * 1_000_000);
            pull = Pull::followed(pull, stamp, forces(sample), MOST);
            pull.is_some_and(|pull| pull.contradicts(stamp, MOST).is_some())
        })
    };
    assert_eq!(contradicts(&|_| [-5.1; 2]), Some(5));
    assert_eq!(contradicts(&|_| [-4.9; 2]), None);
    assert_eq!(contradicts(&|sample| [if sample == 3 { 0.0 } else { -30.0 }; 2]), Some(9), "it begins anew");
    assert_eq!(contradicts(&|_| [-30.0, -4.9]), None, "the tool's inertia, as q̇ misses it");
    assert_eq!(contradicts(&|_| [-4.9, -30.0]), None, "as the positions miss it");
    let by_encoder = |sample: u64| if sample.is_multiple_of(2) { 20.0 } else { -40.0 };
    assert_eq!(contradicts(&|sample| [-10.0, by_encoder(sample)]), Some(5), "a coarse encoder");
}
