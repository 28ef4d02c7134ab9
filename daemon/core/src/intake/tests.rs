//! Which samples may reach the law: tests of this stage alone.

use nalgebra::{Vector2, Vector3};

use super::{Event, Intake, SampleFault};
use crate::common::{at, given, parameters, pressing, pushing};
use crate::intake::Sample;
use crate::robot::Posture;

fn intake() -> Intake<2, 2> {
    Intake::new(parameters().intake())
}

#[test]
fn a_good_sample_comes_out_with_its_wrench_and_its_kinematics() {
    let mut intake = intake();
    let sample = pushing(60.0, 0.05, 1);
    let accepted = *intake.take(Event::Sample(&sample), sample.stamp).expect("it is good");
    let posture = Posture::new(&parameters().chain, &sample.joint_position);
    assert_eq!((accepted.stamp, accepted.joint_position), (sample.stamp, sample.joint_position));
    assert_eq!((accepted.wrench.x, accepted.wrench.y), (sample.wrench.0[0], sample.wrench.0[1]));
    assert_eq!(accepted.posture, posture);
    assert_eq!((intake.rejected(), intake.last()), (0, Some(&accepted)));
}

#[test]
fn a_bad_sample_is_a_fault_and_the_last_good_one_stays() {
    let mut intake = intake();
    let first = pressing(60.0, 1);
    let accepted = *intake.take(Event::Sample(&first), first.stamp).expect("it is good");
    let next = pressing(60.0, 2);
    let cases: [(Sample<2, 2>, u64); 5] = [
        (Sample { joint_count: 3, ..next }, 0),
        (Sample { wrench_valid: false, ..next }, 0),
        (Sample { wrench: given(Vector2::new(f64::NAN, 0.0)), ..next }, 0),
        (next, 1_000_000_000),
        (first, 0),
    ];
    let mut names = Vec::new();
    for (sample, late) in cases {
        let now = at(sample.stamp.nanoseconds() + late);
        let fault = intake.take(Event::Sample(&sample), now).expect_err("it is bad");
        names.push(fault.name().name());
        assert_eq!(intake.last(), Some(&accepted), "{fault}");
    }
    assert_eq!(names, ["JointCount", "WrenchInvalid", "NotFinite", "Stale", "OutOfOrder"]);
    assert_eq!(intake.take(Event::Silence, next.stamp), Err(SampleFault::Silence));
    assert_eq!(intake.rejected(), 5, "a silence is no sample");
    let silence = intake.silence(next.stamp).expect("there was a sample");
    assert_eq!(silence, next.stamp.since(first.stamp));
}

#[test]
fn another_run_of_the_motion_controller_is_known_by_its_first_sample() {
    let mut intake = intake();
    let is_new = [7, 7, 8, 8].map(|boot_id| {
        let sequence = 1 + intake.last().map_or(0, |last| (last.stamp.nanoseconds() - 1_000_000_000) / 4_000_000);
        let sample = Sample { boot_id, ..pressing(-100.0, sequence) };
        intake.take(Event::Sample(&sample), sample.stamp).expect("it is good").arrival.is_new_run
    });
    assert_eq!(is_new, [false, false, true, false]);
}

/// Where the centre of gravity `center` (m, frame of the TCP) of a tool on the planar arm is at the
/// joint position `q`.
fn place(q: &Vector2<f64>, center: &Vector2<f64>) -> Vector2<f64> {
    let (lower, upper) = (q[0].sin_cos(), (q[0] + q[1]).sin_cos());
    let (sine, cosine) = upper;
    Vector2::new(
        lower.1 + cosine + cosine * center.x - sine * center.y,
        lower.0 + sine + sine * center.x + cosine * center.y,
    )
}

#[test]
fn what_accelerates_the_tool_does_not_press() {
    let center = Vector2::new(-0.15, 0.1);
    for lag in [Vector2::new(0.02, 0.02), Vector2::new(0.02, 0.005), Vector2::zeros()] {
        let mut parameters = parameters();
        parameters.wrench_time_constant = lag;
        parameters.conditioning.tool_mass = 3.0;
        parameters.conditioning.tool_center_of_gravity = Vector3::new(center.x, center.y, 0.0);
        let mut intake = Intake::new(parameters.intake());
        let sine = |t: f64| Vector2::new(0.4 + 0.05 * (25.0 * t).sin(), -1.1 + 0.08 * (17.0 * t).sin());
        let rate = |t: f64| Vector2::new(1.25 * (25.0 * t).cos(), 1.36 * (17.0 * t).cos());
        // What the filter makes of m p̈, by small steps of p's second difference.
        let (small, per_cycle) = (1e-5, 400_u32);
        let (mut felt, mut worst, mut most) = (Vector2::<f64>::zeros(), 0.0_f64, 0.0_f64);
        for step in 0..200 * per_cycle {
            let t = f64::from(step) * small;
            let [before, here, after] = [t - small, t, t + small].map(|t| place(&sine(t), &center));
            let force = (before + after - here * 2.0) * (3.0 / (small * small));
            felt =
                felt.zip_zip_map(
                    &force,
                    &lag,
                    |felt, force, lag| {
                        if lag > 0.0 { felt + (force - felt) * (small / lag) } else { force }
                    },
                );
            if step % per_cycle != 0 {
                continue;
            }
            let (sequence, q) = (1 + u64::from(step / per_cycle), sine(t));
            let sample = Sample {
                joint_position: q,
                joint_velocity: rate(t),
                wrench: given(felt + Vector2::new(7.0, -20.0)),
                ..pressing(0.0, sequence)
            };
            let accepted = intake.take(Event::Sample(&sample), sample.stamp).expect("it is good");
            // At first nothing is known of how the tool came to move.
            if t > 0.2 {
                most = most.max(felt.norm());
                worst = worst.max((accepted.wrench - Vector2::new(7.0, -20.0)).norm());
            }
        }
        // Without a lag the acceleration is that of half a cycle ago: 2 ms of 25 rad/s.
        let close = if lag.x > 0.0 { 0.01 } else { 0.06 };
        assert!(most > 60.0 && worst < close * most, "lag {lag:?}: {worst} N of {most} N are left");
    }
}

#[test]
fn positions_show_the_motion_of_a_tool_whose_velocity_is_reported_late() {
    let mut parameters = parameters();
    parameters.conditioning.tool_mass = 3.0;
    let mut intake = Intake::new(parameters.intake());
    let lag = parameters.wrench_time_constant;
    // Both joints are accelerated from rest by 30 rad/s²; q̇ is that of 4 ms ago.
    let (mut late, mut by_position, mut most) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut at_jump, mut force_of_jump) = (0.0_f64, 0.0_f64);
    let (small, per_cycle) = (1e-5, 400_u32);
    let at = |t: f64| Vector2::new(0.4, -1.1) + Vector2::repeat(15.0 * t.max(0.0) * t.max(0.0));
    let mut felt = Vector2::<f64>::zeros();
    for step in 0..25 * per_cycle {
        let t = f64::from(step) * small - 0.02;
        let [before, here, after] = [t - small, t, t + small].map(|t| place(&at(t), &Vector2::zeros()));
        let force = (before + after - here * 2.0) * (3.0 / (small * small));
        felt += (force - felt).component_div(&lag) * small;
        if step % per_cycle != 0 {
            continue;
        }
        let sample = Sample {
            joint_position: at(t),
            joint_velocity: Vector2::repeat(30.0 * (t - 0.004).max(0.0)),
            wrench: given(felt),
            ..pressing(0.0, 1 + u64::from(step / per_cycle))
        };
        let accepted = intake.take(Event::Sample(&sample), sample.stamp).expect("it is good");
        late = late.max(accepted.wrench.norm());
        // The parabola through three samples sees a quarter too little of the jump for one cycle, and that
        // much too much in the next.
        let left = accepted.wrench_by_position.norm();
        if t > 0.01 {
            by_position = by_position.max(left)
        } else {
            at_jump = at_jump.max(left)
        };
        most = most.max(felt.norm());
        force_of_jump = force_of_jump.max(force.norm());
    }
    println!("{late} N by q̇, {by_position} N by q and {at_jump} N at the jump, of {most} N");
    assert!(most > 100.0 && late > 0.1 * most && by_position < 0.03 * most);
    // Of m a the filter shows a cycle's part.
    let shown = 1.0 - f64::exp(-0.004 / lag.x);
    assert!(at_jump > by_position && at_jump < 0.4 * force_of_jump * shown, "{at_jump} N of {force_of_jump} N");
}

#[test]
fn after_a_pause_and_in_a_new_run_the_tool_counts_as_steady() {
    let mut parameters = parameters();
    parameters.conditioning.tool_mass = 3.0;
    let felt = |change: fn(&mut Sample<2, 2>)| {
        let mut intake = Intake::new(parameters.intake());
        let mut sample = pressing(0.0, 1);
        intake.take(Event::Sample(&sample), sample.stamp).expect("it is good");
        sample = Sample { joint_velocity: Vector2::new(0.0, 0.1), ..pressing(0.0, 2) };
        change(&mut sample);
        intake.take(Event::Sample(&sample), sample.stamp).expect("it is good");
        intake.tool_acceleration().norm()
    };
    assert!(felt(|_| ()) > 1.0);
    assert_eq!(felt(|sample| sample.boot_id += 1), 0.0);
    assert_eq!(felt(|sample| sample.stamp = at(sample.stamp.nanoseconds() + 1_000_000_000)), 0.0);
}

#[test]
fn without_a_tool_any_more_nothing_is_shown_of_one() {
    let [with, without] = [3.0, 0.0].map(|mass| {
        let mut parameters = parameters();
        parameters.conditioning.tool_mass = mass;
        Intake::new(parameters.intake())
    });
    let (mut intake, mut next) = (with, without);
    let samples =
        [pressing(0.0, 1), Sample { joint_velocity: Vector2::new(0.0, 0.1), ..pressing(0.0, 2) }, pressing(0.0, 3)];
    for sample in &samples[..2] {
        intake.take(Event::Sample(sample), sample.stamp).expect("it is good");
    }
    assert!(intake.tool_acceleration().norm() > 1.0);
    next.take_over(&intake);
    next.take(Event::Sample(&samples[2]), samples[2].stamp).expect("it is good");
    assert_eq!(next.tool_acceleration().norm(), 0.0);
}

/// A filter with another T_est shows more or less of the tool's inertia than is taken out.
#[test]
fn what_a_tool_may_feign_covers_a_lag_within_its_tolerance() {
    let told = parameters().wrench_time_constant;
    for (factor, tolerance) in [(0.8, 0.25), (1.25, 0.25), (1.0, 0.0)] {
        let mut parameters = parameters();
        parameters.conditioning.tool_mass = 3.0;
        parameters.mpc.wrench_lag_tolerance = tolerance;
        let mut intake = Intake::new(parameters.intake());
        // From rest by 30 rad/s² for 20 ms, and at that speed from then on.
        let (small, cycles, per_cycle) = (1e-5, 25_u32, 400_u32);
        let turning = |t: f64| t.clamp(0.0, 0.02);
        let at = |t: f64| {
            let turned = 15.0 * turning(t) * turning(t) + 30.0 * turning(t) * (t.max(0.0) - turning(t));
            Vector2::new(0.4, -1.1) + Vector2::repeat(turned)
        };
        let mut shown = Vector2::<f64>::zeros();
        let (mut most, mut largest) = (0.0_f64, 0.0_f64);
        for step in 0..cycles * per_cycle {
            let t = f64::from(step) * small;
            let [before, here, after] = [t - small, t, t + small].map(|t| place(&at(t), &Vector2::zeros()));
            let force = (before + after - here * 2.0) * (3.0 / (small * small));
            shown += (force - shown).component_div(&(told * factor)) * small;
            if step % per_cycle != 0 {
                continue;
            }
            let sample = Sample {
                joint_position: at(t),
                joint_velocity: Vector2::repeat(30.0 * turning(t)),
                wrench: given(shown),
                ..pressing(0.0, 1 + u64::from(step / per_cycle))
            };
            let sample = intake.take(Event::Sample(&sample), sample.stamp).expect("it is good");
            let feigned = sample.feigned_wrench;
            largest = largest.max(shown.norm());
            // (As the acceleration ends, one filter falls faster than the other.)
            for axis in 0..2 {
                let left = sample.wrench[axis].abs();
                assert!(
                    left <= feigned[axis].abs() + 0.04 * largest + 0.1,
                    "T_est x {factor}, {t} s: {left} N of {feigned:?}"
                );
                most = most.max(feigned[axis].abs());
            }
            assert_eq!(sample.unsure(), feigned.abs());
        }
        println!("T_est x {factor}: {most} N may be feigned of {largest} N");
        assert_eq!(most > 0.1 * largest, tolerance > 0.0, "{most} of {largest} N");
    }
}
