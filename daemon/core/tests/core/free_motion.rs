//! What is felt before any contact.

use crate::common::scripted::{assert_stopping, scenario};
use crate::common::{given, model, normal, parameters, pushing, step};
use admittance_core::Parameters;
use admittance_core::belief::ContactSign;
use admittance_core::intake::Sample;
use admittance_core::vocabulary::{ModeName as Mode, StopReason};

#[test]
fn a_brief_pull_in_free_motion_is_no_contradiction_and_a_long_one_a_stop() {
    let parameters = || Parameters { sign: ContactSign::Normal, ..parameters() };
    let pulled = |sequence| Sample { wrench: given(normal() * 12.0), ..pushing(-20.0, 0.1, sequence) };
    let mut controller = scenario(parameters(), &[]);
    // Two samples 4 ms apart, twice.
    for (sequence, is_pulled) in (1..).zip([false, true, true, false, true, true, false]) {
        let sample = if is_pulled { pulled(sequence) } else { pushing(-20.0, 0.1, sequence) };
        assert_eq!(step(&mut controller, &sample).mode, Mode::Free, "sample {sequence}");
    }
    for sequence in 8..=9 {
        assert_eq!(step(&mut controller, &pulled(sequence)).mode, Mode::Free, "sample {sequence}");
    }
    // It is not held at once: what the joints still turn would press.
    let moving = |sequence| {
        let sample = pulled(sequence);
        let inverse = model(&parameters(), &sample.joint_position).jacobian_inverse;
        Sample { joint_velocity: inverse * sample.twist_reference, ..sample }
    };
    let outcome = step(&mut controller, &moving(10));
    assert_stopping(&outcome, StopReason::ModelDisagrees);
    assert!(normal().dot(&outcome.movement.twist_command) >= -1e-9, "{:?}", outcome.movement);
    // Nothing was touched: the surface stays where it is told to be.
    let outcome = step(&mut controller, &moving(11));
    assert_eq!(outcome.belief.contact_point, parameters().surface.contact.position);
}
