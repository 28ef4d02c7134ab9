//! Which samples may reach the law: tests of this stage alone.

use nalgebra::Vector2;

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
    assert_eq!(intake.rejected(), 6);
    let silence = intake.silence(next.stamp).expect("there was a sample");
    assert_eq!(silence, next.stamp.since(first.stamp));
}

#[test]
fn another_run_of_the_motion_controller_is_known_by_its_first_sample() {
    let mut intake = intake();
    let is_new = [7, 7, 8, 8].map(|boot_id| {
        let sequence = 1 + intake.last().map_or(0, |last| (last.stamp.nanoseconds() - 1_000_000_000) / 4_000_000);
        let sample = Sample { boot_id, ..pressing(-100.0, sequence) };
        intake.take(Event::Sample(&sample), sample.stamp).expect("it is good").is_new_run
    });
    assert_eq!(is_new, [false, false, true, false]);
}
