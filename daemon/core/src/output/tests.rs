//! The movement that the arm is told, tests of this stage alone; the plan over uneven steps.

use admittance_vocabulary::{Motion, Source};
use nalgebra::Vector2;

use super::{MAX_STEPS, Movement, Output, Plan};
use crate::common::{self, at, normal, ns, parameters, pressing, pushing};
use crate::intake::{Accepted, Event, Intake, Sample};
use crate::quantities::Span;

fn x(value: f64) -> Vector2<f64> {
    Vector2::new(value, -value)
}

/// Steps of 1, 4 and 2 ms from 100 ns on.
fn plan() -> Plan<2> {
    let mut plan = Plan::empty();
    plan.become_prediction(at(100));
    for (value, duration) in [(1.0, 0.001), (2.0, 0.004), (3.0, 0.002)] {
        plan.push(x(value), Span::from_seconds(duration));
    }
    plan
}

#[test]
fn a_plan_is_read_by_elapsed_time() {
    assert_eq!(Plan::<2>::empty().at(at(5)), None);
    let plan = plan();
    let cases =
        [(0, 1.0), (100, 1.0), (1_000_099, 1.0), (1_000_100, 2.0), (5_000_099, 2.0), (5_000_100, 3.0), (u64::MAX, 3.0)];
    for (stamp, value) in cases {
        assert_eq!(plan.at(at(stamp)), Some(x(value)), "at {stamp} ns");
    }
}

#[test]
fn a_shifted_plan_says_the_same_for_every_later_instant() {
    for shift in [100, 500_000, 1_000_100, 3_000_000, 6_900_000] {
        let mut shifted = plan();
        shifted.shift(at(shift), ns(9_000_000));
        for stamp in (shift..20_000_000).step_by(250_000) {
            assert_eq!(shifted.at(at(stamp)), plan().at(at(stamp)), "shifted to {shift} ns, at {stamp} ns");
        }
        let first = shifted.steps().next().map(|(offset, _)| *offset);
        assert_eq!(first, plan().at(at(shift)), "steps that have ended are gone");
        let last_end = shifted.steps().last().expect("a step stays").1;
        assert_eq!(last_end, ns(9_000_000), "the last step stays for as long as the command is valid");
    }
    let mut over = plan();
    over.shift(at(50_000_000), ns(8_000_000));
    assert_eq!(over.steps().map(|(offset, end)| (*offset, end)).collect::<Vec<_>>(), [(x(3.0), ns(8_000_000))]);
    let mut none = Plan::<2>::empty();
    none.shift(at(5), ns(5));
    assert_eq!(none.steps().len(), 0);
}

#[test]
fn a_plan_holds_no_more_than_its_steps_and_cuts_to_the_limit() {
    let mut long = Plan::empty();
    for value in 0..MAX_STEPS + 3 {
        long.push(x(value as f64), Span::from_seconds(0.001));
    }
    assert_eq!(long.steps().len(), MAX_STEPS);
    assert_eq!(long.steps().last().map(|(offset, end)| (offset.x, end)), Some((31.0, ns(32_000_000))));

    let mut plan = plan();
    assert!(!plan.limit(&Vector2::new(3.0, 3.0)));
    assert!(plan.limit(&Vector2::new(2.5, 1.5)));
    let offsets: Vec<_> = plan.steps().map(|(offset, _)| (offset.x, offset.y)).collect();
    assert_eq!(offsets, [(1.0, -1.0), (2.0, -1.5), (2.5, -1.5)]);
}

fn accepted(sample: &Sample<2, 2>) -> Accepted<2, 2> {
    let mut intake = Intake::new(parameters().intake());
    *intake.take(Event::Sample(sample), sample.stamp).expect("a good sample")
}

fn near(a: &Vector2<f64>, b: &Vector2<f64>) -> bool {
    (a - b).amax() < 1e-12
}

#[test]
fn a_prediction_is_followed_and_goes_on_by_elapsed_time() {
    let mut output = Output::new(parameters().output());
    let sample = accepted(&pushing(60.0, 0.05, 1));
    let mut plan = Plan::empty();
    plan.become_prediction(sample.stamp);
    for value in [0.1, 0.2, 0.3] {
        plan.push(normal() * value, Span::from_seconds(0.004));
    }
    let movement = output.follow(&plan, Source::Mpc, &sample);
    assert_eq!((movement.motion, movement.source, movement.limited), (Motion::Offset, Source::Mpc, false));
    assert!(near(&movement.twist_command, &(normal() * 0.05)), "{}", movement.twist_command);
    let joints = sample.posture.jacobian() * movement.joint_velocity_offset;
    assert!(near(&joints, &movement.velocity_offset), "{joints}");
    for (cycle, value) in [(1, 0.2), (2, 0.3), (3, 0.3)] {
        let movement = output.play_plan(sample.stamp + ns(cycle * common::CYCLE), &sample);
        assert_eq!(movement.source, Source::Plan);
        assert!(near(&movement.velocity_offset, &(normal() * value)), "cycle {cycle}: {}", movement.velocity_offset);
    }
    assert_eq!(output.fallbacks(), 3);
}

#[test]
fn what_is_beyond_the_limit_is_cut_and_counted() {
    let mut output = Output::new(parameters().output());
    let sample = accepted(&pressing(60.0, 1));
    let mut plan = Plan::empty();
    plan.become_prediction(sample.stamp);
    plan.push(Vector2::new(2.5, -0.5), Span::from_seconds(0.004));
    let movement = output.follow(&plan, Source::Mpc, &sample);
    assert_eq!((movement.velocity_offset, movement.limited), (Vector2::new(2.0, -0.5), true));
    assert_eq!(output.limited(), 1);
}

#[test]
fn without_a_plan_or_a_sample_nothing_leads_into_the_surface() {
    let mut output = Output::new(parameters().output());
    let sample = accepted(&pushing(60.0, 0.3, 1));
    let surface = parameters().surface;
    let fallback: Movement<2, 2> = output.fall_back(&sample, &surface);
    assert!(normal().dot(&fallback.twist_command).abs() < 1e-12, "{}", fallback.twist_command);
    let retreat = output.retreat(sample.stamp, &sample, &surface);
    assert!(near(&retreat.twist_command, &(normal() * 0.05)), "{}", retreat.twist_command);
    let hold: Movement<2, 2> = output.hold(sample.stamp, Some(&sample));
    assert_eq!((hold.motion, hold.velocity_offset), (Motion::Hold, Vector2::zeros()));
    // Held, it may leave the surface at the retreat speed, and never enter it.
    let leave = |twist: &Vector2<f64>, speed: f64| surface.retreat_along(twist, speed);
    let held = output.hold_or_retreat(&sample, leave);
    assert_eq!(held.motion, Motion::Hold, "{held:?}");
    let leaving = accepted(&pushing(60.0, -0.3, 1));
    let movement = output.hold_or_retreat(&leaving, leave);
    assert_eq!(movement.source, Source::Retreat);
    assert!(near(&movement.twist_command, &(normal() * 0.05)), "{}", movement.twist_command);
}

#[test]
fn a_released_offset_ramps_to_zero_at_the_release_rate() {
    let mut output = Output::new(parameters().output());
    let sample = accepted(&pressing(60.0, 1));
    let mut plan = Plan::empty();
    plan.become_prediction(sample.stamp);
    plan.push(Vector2::new(0.1, -0.05), Span::from_seconds(0.004));
    let _: Movement<2, 2> = output.follow(&plan, Source::Mpc, &sample);
    // 10 m/s² over 4 ms.
    for expected in [Vector2::new(0.06, -0.01), Vector2::new(0.02, 0.0), Vector2::zeros()] {
        let movement = output.go_on(&accepted(&pressing(-100.0, 2)), false, true, &Vector2::zeros());
        assert!(near(&movement.velocity_offset, &expected), "{}, expected {expected}", movement.velocity_offset);
    }
    assert!(output.is_zero());
}

#[test]
fn an_axis_without_admittance_has_no_offset_in_free_motion_either() {
    let mut settings = parameters().output();
    settings.admittance = [true, false];
    let mut output = Output::new(settings);
    for n in 1..20 {
        let movement = output.go_on(&accepted(&pressing(0.0, n)), false, true, &Vector2::new(0.05, 0.05));
        assert_eq!(movement.velocity_offset[1], 0.0);
    }
    assert!((output.offset()[0] - 0.05).abs() < 1e-12, "the other one has got there");
}
