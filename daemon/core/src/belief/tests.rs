//! The belief about the surface, tests of this stage alone; activation and release per axis
//! (III.C).

use nalgebra::{Vector2, Vector3};

use super::way::Piece;
use super::{Belief, Contact, ContactPoint, ContactSign, Prior, SurfaceSigns, Thresholds, Way};
use crate::common::{self, CYCLE, STIFFNESS, pressing};
use crate::intake::{Accepted, Event, Intake, Sample};
use crate::parameters::Parameters;

fn thresholds() -> Thresholds<3> {
    Thresholds {
        admittance: [true, false, true],
        activation: Vector3::new(5.0, 5.0, 8.0),
        release: Vector3::new(3.0, 3.0, 8.0),
    }
}

/// The contact after this wrench, without the signs of a surface.
fn touch(contact: &Contact<3>, wrench: &Vector3<f64>) -> Contact<3> {
    contact.update(&thresholds(), &thresholds().felt(wrench), None, wrench)
}

#[test]
fn an_axis_joins_above_activation_and_leaves_below_release() {
    let contact = |from: Contact<3>, wrench: [f64; 3]| touch(&from, &wrench.into());
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
fn an_unsure_wrench_touches_above_what_it_may_be_off_by() {
    let told = thresholds();
    assert_eq!(told.beyond(&Vector3::zeros()), told, "a sure one is held to what was told");
    let beyond = told.beyond(&Vector3::new(6.0, 0.0, 12.0));
    assert_eq!(beyond.activation, Vector3::new(6.0, 5.0, 12.0));
    assert_eq!(beyond.release, told.release, "a contact does not end because the wrench is less sure");
    let felt = |x: f64| beyond.felt(&Vector3::new(x, 0.0, 0.0)).is_any();
    assert_eq!((felt(5.9), felt(6.1)), (false, true));
}

#[test]
fn the_sign_of_an_active_axis_never_flips() {
    let mut contact = Contact::none();
    for wrench in [6.0, 20.0, -20.0, -20.0, 4.0, 6.0] {
        let next = touch(&contact, &Vector3::new(wrench, 0.0, 0.0));
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
        assert_eq!(touch(&Contact::none(), &wrench.into()).mask(), mask, "{wrench:?}");
    }
    // NaN never activates.
    assert!(!touch(&Contact::none(), &Vector3::repeat(f64::NAN)).is_any());
}

#[test]
fn with_the_signs_of_a_surface_an_axis_joins_with_its_own_only() {
    // Pressing on it is a force along −x; z has too small a component to be felt.
    let signs = SurfaceSigns::of(&Vector3::new(1.0, 0.0, 0.05));
    let touch = |wrench: Vector3<f64>| {
        let felt = thresholds().felt(&wrench);
        (felt.is_any(), Contact::none().update(&thresholds(), &felt, Some(&signs), &wrench).active())
    };
    assert_eq!(touch(Vector3::new(-6.0, 0.0, 0.0)), (true, [true, false, false]));
    assert_eq!(touch(Vector3::new(6.0, 0.0, 0.0)), (true, [false; 3]), "a pull is felt, but is no contact");
    assert_eq!(touch(Vector3::new(0.0, 0.0, -9.0)), (true, [false; 3]));
    assert_eq!(touch(Vector3::new(0.0, -9.0, 0.0)), (false, [false; 3]), "no admittance axis");
}

fn parameters(contact_point: ContactPoint) -> Parameters<2, 2> {
    Parameters { contact_point, sign: ContactSign::Normal, ..common::parameters() }
}

fn accepted(sample: &Sample<2, 2>) -> Accepted<2, 2> {
    let mut intake = Intake::new(common::parameters().intake());
    *intake.take(Event::Sample(sample), sample.stamp).expect("a good sample")
}

fn follow(belief: &mut Belief<2>, sample: &Sample<2, 2>, doubted: bool) {
    follow_moving(belief, sample, &sample.joint_velocity, doubted);
}

/// The same with joints that move as no sample reports.
fn follow_moving(belief: &mut Belief<2>, sample: &Sample<2, 2>, joint_velocity: &Vector2<f64>, doubted: bool) {
    let sample = accepted(sample);
    let felt = belief.felt(&sample);
    belief.follow(&sample, joint_velocity, None, &felt, doubted);
}

#[test]
fn a_surface_that_is_told_stays_where_it_is_told() {
    let told = common::parameters().surface;
    let mut belief = Belief::new(parameters(ContactPoint::Configured).belief());
    for (sequence, force) in (1..).zip([-100.0, 20.0, 150.0, 150.0, -100.0]) {
        follow(&mut belief, &pressing(force, sequence), false);
        assert_eq!(*belief.surface(), told, "{force} N");
        assert_eq!(belief.contact().is_any(), force > 5.0, "{force} N");
    }
    // A force that the pose does not explain: the model is doubted, and the surface moved to it.
    let sample = Sample { joint_position: common::indented(0.0), ..pressing(150.0, 6) };
    follow(&mut belief, &sample, true);
    let raised = told.height(&belief.surface().contact.position) - told.height(&told.contact.position);
    assert!((raised - 150.0 / STIFFNESS).abs() < 1e-9, "raised by {raised} m");
    // With the reset what is told is believed again.
    belief.release();
    assert_eq!(*belief.surface(), told);
}

#[test]
fn the_expected_force_lags_behind_the_spring_as_the_estimate_does() {
    let mut belief = Belief::new(parameters(ContactPoint::Configured).belief());
    follow(&mut belief, &pressing(0.0, 1), false);
    // T_est is five cycles: 1 − e⁻¹ of a step after five of them, but for the cycle in which it
    // rises.
    for sequence in 2..=6 {
        follow(&mut belief, &pressing(100.0, sequence), false);
    }
    let lag = 0.020;
    let cycle = CYCLE as f64 * 1e-9;
    let (least, most) = (1.0 - f64::exp(-4.0 * cycle / lag), 1.0 - f64::exp(-5.0 * cycle / lag));
    let share = belief.expected_pressing() / 100.0;
    assert!(least < share && share < most, "{share}, expected between {least} and {most}");
}

#[test]
fn a_contact_point_is_found_from_samples_that_reach_back_to_before_it() {
    let (off, uncertainty) = found_off(1.0, 1.0);
    assert!(off.abs() < 0.02e-3, "found {} mm off", off * 1e3);
    assert!(uncertainty > 0.0);
}

#[test]
fn a_contact_point_is_found_with_the_believed_velocity_not_the_reported_one() {
    assert_eq!(found_off(0.0, 1.0), found_off(1.0, 1.0));
    assert_ne!(found_off(1.0, 0.0), found_off(1.0, 1.0));
}

/// How far off a contact point is found, in m, and its uncertainty in N. Of the joints' velocity so
/// large a share is reported, and believed.
fn found_off(reported: f64, believed: f64) -> (f64, f64) {
    let noise = ContactPoint::Detected { wrench_noise: 0.1 };
    let mut wrong = parameters(noise);
    // Told half a millimetre too deep; the arm sinks in at 50 mm/s, and f̂ follows with T_est.
    wrong.surface.raise(-0.5e-3);
    let mut belief = Belief::new(wrong.belief());
    let (lag, cycle, speed) = (0.020, CYCLE as f64 * 1e-9, 0.05);
    let mut estimate = 0.0;
    for sequence in 1..40_u64 {
        let depth = speed * cycle * (sequence as f64 - 20.0);
        let q = common::indented(depth);
        // The estimate over the last cycle, in fine steps: the depth rises evenly.
        for step in 0..1000 {
            let force = STIFFNESS * (depth - speed * cycle * (1.0 - f64::from(step) / 1000.0)).max(0.0);
            estimate += (force - estimate) * (1.0 - f64::exp(-cycle / 1000.0 / lag));
        }
        let model = common::model(&common::parameters(), &q);
        let joint_velocity = model.jacobian_inverse * (common::normal() * -speed);
        let sample = Sample {
            joint_position: q,
            joint_velocity: joint_velocity * reported,
            wrench: common::given(common::normal() * -estimate),
            ..pressing(0.0, sequence)
        };
        follow_moving(&mut belief, &sample, &(joint_velocity * believed), false);
    }
    let real = common::parameters().surface;
    let off = real.height(&belief.surface().contact.position) - real.height(&real.contact.position);
    (off, belief.snapshot().uncertainty)
}

#[test]
fn what_is_felt_changes_nothing_by_itself() {
    let belief = Belief::new(parameters(ContactPoint::Configured).belief());
    let before = (belief.snapshot(), *belief.contact());
    assert!(belief.felt(&accepted(&pressing(8.0, 1))).is_any());
    assert_eq!((belief.snapshot(), *belief.contact()), before);
}

/// A surface of which only a range is told.
const RANGE: Prior = Prior { stiffness: (4e4, 2.5e5), depth_tolerance: None, normal_tolerance: 0.0, risk: 0.99 };

/// The largest f̂ in N on an axis when a contact begins, of an arm that moves in at 60 mm/s and touches in the middle of a
/// cycle; `None` where it has not begun at the second sample after that. An axis leaves below `release` N.
fn felt_at_first(contact_point: ContactPoint, release: f64) -> Option<f64> {
    felt_where_feigned(contact_point, release, 0.0)
}

/// The same where so much of f̂ (N on an axis) is the tool's own, as the joint positions show it.
fn felt_where_feigned(contact_point: ContactPoint, release: f64, feigned: f64) -> Option<f64> {
    let mut told = parameters(contact_point);
    told.thresholds.release.fill(release);
    let mut belief = Belief::new(told.belief());
    let (lag, cycle, speed) = (0.020, CYCLE as f64 * 1e-9, 0.06);
    let begins = -told.surface.height(&told.surface.contact.position);
    let mut estimate = 0.0;
    (1..=22_u64).find_map(|sequence| {
        let depth = |share: f64| speed * cycle * (sequence as f64 - 20.5 + share);
        for step in 0..1000 {
            let force = STIFFNESS * depth((f64::from(step) + 0.5) / 1000.0 - 1.0).max(0.0);
            estimate += (force - estimate) * (1.0 - f64::exp(-cycle / 1000.0 / lag));
        }
        let mut way = Way::new();
        way.push(Piece { duration: cycle, depth: [-1.0, -0.5, 0.0].map(|share| begins + depth(share)) });
        let q = common::indented(depth(0.0));
        let wrench = common::given(common::normal() * -estimate);
        let mut sample = accepted(&Sample { joint_position: q, wrench, ..pressing(0.0, sequence) });
        sample.wrench_by_position -= sample.wrench.map(f64::signum) * feigned;
        let felt = belief.felt(&sample);
        belief.follow(&sample, &sample.joint_velocity, Some(&way), &felt, false);
        belief.contact().is_any().then(|| sample.wrench.amax())
    })
}

#[test]
fn a_surface_that_the_samples_show_is_touched_before_its_force_is_above_beta() {
    let learned = ContactPoint::Learned(RANGE);
    let force = felt_at_first(learned, 3.0).expect("touched");
    assert!(force > 4.0 && force < 5.0, "{force} N");
    // Above β alone where the surface is told, and where both thresholds are one.
    assert_eq!(felt_at_first(ContactPoint::Configured, 3.0), None);
    assert_eq!(felt_at_first(learned, 5.0), None);
}

#[test]
fn a_touch_below_beta_is_one_by_both_ways_of_seeing_the_tool() {
    let begins = |feigned: f64| felt_where_feigned(ContactPoint::Learned(RANGE), 3.0, feigned).is_some();
    assert_eq!([0.0, 1.0, 3.0].map(begins), [true, true, false]);
}

#[test]
fn a_surface_is_touched_below_beta_but_not_where_f_hat_would_release_it() {
    let thresholds = |release: f64| Thresholds {
        admittance: [true; 2],
        activation: Vector2::new(5.0, 1.0),
        release: Vector2::repeat(release),
    };
    assert_eq!(thresholds(0.0).where_noticed().activation, Vector2::new(4.0, 0.8));
    assert_eq!(thresholds(0.9).where_noticed().activation, Vector2::new(4.0, 0.9));
    assert_eq!(thresholds(3.0).where_noticed().release, Vector2::repeat(3.0));
    let shown = thresholds(3.0).where_noticed().felt(&Vector2::new(0.0, -6.0));
    let begins = |estimate: f64| thresholds(3.0).held(&shown, &Vector2::new(0.0, estimate)).is_any();
    assert!(begins(-3.0) && begins(-20.0));
    // Less than that is released at once, and a pull is no touch.
    assert!(!begins(-2.9) && !begins(6.0));
}
