//! Activation and release per axis (III.C), the plan over uneven steps, and the mode table.

use admittance_core::contact::{Contact, Thresholds};
use admittance_core::mode::{Mode, Transition};
use admittance_core::plan::{MAX_STEPS, Plan, nanoseconds};
use nalgebra::{Vector2, Vector3};

fn thresholds() -> Thresholds<3> {
    Thresholds {
        admittance: [true, false, true],
        activation: Vector3::new(5.0, 5.0, 8.0),
        release: Vector3::new(3.0, 3.0, 8.0),
    }
}

#[test]
fn an_axis_joins_above_activation_and_leaves_below_release() {
    let contact = |from: Contact<3>, wrench: [f64; 3]| from.update(&thresholds(), None, &wrench.into());
    let at_threshold = contact(Contact::none(), [5.0, 0.0, -8.0]);
    assert!(!at_threshold.is_any(), "the threshold itself is no contact");
    let touched = contact(Contact::none(), [5.1, 0.0, -8.1]);
    assert_eq!(touched.active(), [true, false, true]);
    assert_eq!((touched.sign(0), touched.sign(1), touched.sign(2)), (Some(1.0), None, Some(-1.0)));
    // Between the thresholds it keeps what it was.
    assert!(contact(touched, [3.0, 0.0, 0.0]).active()[0]);
    assert!(!contact(Contact::none(), [4.0, 0.0, 0.0]).is_any());
    assert!(!contact(touched, [2.9, 0.0, 0.0]).is_any());
}

#[test]
fn the_sign_of_an_active_axis_never_flips() {
    let mut contact = Contact::none();
    for wrench in [6.0, 20.0, -20.0, -20.0, 4.0, 6.0] {
        let next = contact.update(&thresholds(), None, &Vector3::new(wrench, 0.0, 0.0));
        if let (Some(before), Some(after)) = (contact.sign(0), next.sign(0)) {
            assert_eq!(before, after, "at {wrench} N");
        }
        assert!(!(wrench < 0.0 && contact.sign(0) == Some(1.0)) || next.sign(0).is_none(), "release comes first");
        contact = next;
    }
    assert_eq!(contact.sign(0), Some(1.0));
}

#[test]
fn the_mask_has_one_bit_per_active_admittance_axis() {
    for (wrench, mask) in [([9.0, 9.0, 9.0], 0b101), ([9.0, 9.0, 0.0], 0b001), ([0.0, 9.0, -9.0], 0b100), ([0.0; 3], 0)]
    {
        assert_eq!(Contact::none().update(&thresholds(), None, &wrench.into()).mask(), mask, "{wrench:?}");
    }
    // NaN never activates.
    assert!(!Contact::none().update(&thresholds(), None, &Vector3::repeat(f64::NAN)).is_any());
}

fn x(value: f64) -> Vector2<f64> {
    Vector2::new(value, -value)
}

/// Steps of 1, 4 and 2 ms from 100 ns on.
fn plan() -> Plan<2> {
    let mut plan = Plan::empty();
    plan.restart(100);
    for (value, duration) in [(1.0, 0.001), (2.0, 0.004), (3.0, 0.002)] {
        plan.push(x(value), duration);
    }
    plan
}

#[test]
fn a_plan_is_read_by_elapsed_time() {
    assert_eq!(Plan::<2>::empty().at(5), None);
    let plan = plan();
    let cases =
        [(0, 1.0), (100, 1.0), (1_000_099, 1.0), (1_000_100, 2.0), (5_000_099, 2.0), (5_000_100, 3.0), (u64::MAX, 3.0)];
    for (stamp, value) in cases {
        assert_eq!(plan.at(stamp), Some(x(value)), "at {stamp} ns");
    }
}

#[test]
fn a_shifted_plan_says_the_same_for_every_later_instant() {
    for shift in [100, 500_000, 1_000_100, 3_000_000, 6_900_000] {
        let mut shifted = plan();
        shifted.shift(shift, 9_000_000);
        for stamp in (shift..20_000_000).step_by(250_000) {
            assert_eq!(shifted.at(stamp), plan().at(stamp), "shifted to {shift} ns, at {stamp} ns");
        }
        let first = shifted.steps().next().map(|(offset, _)| *offset);
        assert_eq!(first, plan().at(shift), "steps that have ended are gone");
        let last_end = shifted.steps().last().expect("a step stays").1;
        assert_eq!(last_end, 9_000_000, "the last step stays for as long as the command is valid");
    }
    let mut over = plan();
    over.shift(50_000_000, 8_000_000);
    assert_eq!(over.steps().map(|(offset, end)| (*offset, end)).collect::<Vec<_>>(), [(x(3.0), 8_000_000)]);
    let mut none = Plan::<2>::empty();
    none.shift(5, 5);
    assert_eq!(none.steps().len(), 0);
}

#[test]
fn a_plan_holds_no_more_than_its_steps_and_cuts_to_the_limit() {
    let mut long = Plan::empty();
    for value in 0..MAX_STEPS + 3 {
        long.push(x(value as f64), 0.001);
    }
    assert_eq!(long.steps().len(), MAX_STEPS);
    assert_eq!(long.steps().last().map(|(offset, end)| (offset.x, end)), Some((31.0, 32_000_000)));

    let mut plan = plan();
    assert!(!plan.limit(&Vector2::new(3.0, 3.0)));
    assert!(plan.limit(&Vector2::new(2.5, 1.5)));
    let offsets: Vec<_> = plan.steps().map(|(offset, _)| (offset.x, offset.y)).collect();
    assert_eq!(offsets, [(1.0, -1.0), (2.0, -1.5), (2.5, -1.5)]);
}

#[test]
fn seconds_become_whole_nanoseconds() {
    assert_eq!(
        (nanoseconds(0.004), nanoseconds(1.4e-9), nanoseconds(-1.0), nanoseconds(f64::NAN)),
        (4_000_000, 1, 0, 0)
    );
}

#[test]
fn every_listed_transition_leads_where_the_table_says_and_no_other_leads_anywhere() {
    use Mode::{Contact, Free, Idle, Stopped, Stopping};
    use Transition::{Disable, ForcedReset, Halt, Ready, Release, Reset, Rest, Stop, Touch};
    let modes = [Idle, Free, Contact, Stopping, Stopped];
    // Rows: transitions; columns: the mode before, in the order above.
    let table = [
        (Ready, [Free, Free, Contact, Stopping, Stopped]),
        (Touch, [Idle, Contact, Contact, Stopping, Stopped]),
        (Release, [Idle, Free, Free, Stopping, Stopped]),
        (Disable, [Idle, Idle, Contact, Stopping, Stopped]),
        (Stop, [Idle, Free, Stopping, Stopping, Stopped]),
        (Halt, [Stopped, Stopped, Stopped, Stopped, Stopped]),
        (Rest, [Idle, Free, Contact, Stopped, Stopped]),
        (Reset, [Idle, Free, Contact, Stopping, Idle]),
        (ForcedReset, [Idle, Free, Contact, Stopping, Free]),
    ];
    for (transition, after) in table {
        for (before, after) in modes.into_iter().zip(after) {
            assert_eq!(before.after(transition), after, "{before:?} on {transition:?}");
        }
    }
}
