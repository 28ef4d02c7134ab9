//! The arm with masses, in virtual time.

mod common;

use common::{SIX_JOINT, SIX_JOINT_MASSES, run, scenario};
use ipc_types::TruthSample;
use plant_sim::scenario::Scenario;

/// The arm with masses whose drives know it: no friction, stiff gears, encoders without steps.
fn ideal() -> Scenario {
    let mut scenario = scenario(SIX_JOINT_MASSES);
    let arm = scenario.rigid_body.as_mut().expect("masses");
    arm.drive.feed_forward_factor = 1.0;
    for joint in &mut arm.joint {
        joint.viscous_friction_n_m_s_rad = 0.0;
        joint.coulomb_friction_n_m = 0.0;
        joint.breakaway_friction_n_m = None;
        joint.gear_stiffness_n_m_rad = None;
        joint.encoder_counts = None;
    }
    scenario
}

fn run_at_rest(scenario: &Scenario) -> Vec<TruthSample> {
    run(scenario, |_| vec![0.0; 6])
}

/// Largest difference of the joint positions in rad, up to a time in s.
fn apart(one: &[TruthSample], other: &[TruthSample], until_s: f64) -> f64 {
    assert_eq!(one.len(), other.len());
    let pairs = one.iter().zip(other).filter(|(one, _)| one.scenario_time_s <= until_s);
    let largest = |one: &TruthSample, other: &TruthSample| {
        one.joint_position.iter().zip(&other.joint_position).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
    };
    pairs.map(|(one, other)| largest(one, other)).fold(0.0, f64::max)
}

fn peak(truths: &[TruthSample]) -> f64 {
    truths.iter().map(|truth| truth.peak_normal_force_n).fold(0.0, f64::max)
}

/// (4) is what decoupling drives make of (1): paper, section II.
#[test]
fn drives_that_know_the_arm_move_it_as_first_order_loops_do() {
    let mut ideal = ideal();
    let mut first_order = scenario(SIX_JOINT);
    for scenario in [&mut ideal, &mut first_order] {
        scenario.surface = None;
        scenario.start.contact_time_s = None;
    }
    let expected = run_at_rest(&first_order);
    let free = run_at_rest(&ideal);
    let way = apart(&expected, &expected[..1].repeat(expected.len()), 1.0);
    assert!(way > 0.1, "it moves: {way} rad");
    let error = apart(&free, &expected, 1.0);
    assert!(error < 1e-3 * way, "{error} rad off on a way of {way} rad");
    // A model that is wrong, and friction, show.
    ideal.rigid_body.as_mut().expect("masses").drive.feed_forward_factor = 0.5;
    let wrong = apart(&run_at_rest(&ideal), &expected, 1.0);
    assert!(wrong > 3.0 * error, "{wrong} rad off, {error} with the right model");
}

/// The joints of (4) never feel the floor; masses are held up by it.
#[test]
fn the_floor_pushes_the_joints_back() {
    let stiff = peak(&run_at_rest(&scenario(SIX_JOINT)));
    let masses = scenario(SIX_JOINT_MASSES);
    let truths = run_at_rest(&masses);
    let touch = truths.iter().find(|truth| truth.in_contact == 1).expect("a touch").scenario_time_s;
    assert!((touch - 0.4).abs() <= 0.0021, "it touches at {touch} s, as the scenario says");
    let given = peak(&truths);
    assert!(given > 100.0 && given < 0.6 * stiff, "{given} N, of joints that feel nothing {stiff} N");
    assert!(truths.iter().all(|truth| truth.joint_velocity.iter().all(|velocity| velocity.abs() < 10.0)));
}

#[test]
fn it_rests_until_it_is_told_to_move() {
    let truths = run_at_rest(&scenario(SIX_JOINT_MASSES));
    let before = truths.iter().filter(|truth| truth.scenario_time_s < 0.0);
    let start = truths[0].joint_position;
    for truth in before {
        for (position, start) in truth.joint_position.iter().zip(&start) {
            assert!((position - start).abs() < 1e-5, "{position} from {start} at {} s", truth.scenario_time_s);
        }
    }
}

#[test]
fn halving_the_step_changes_no_peak() {
    for gear_is_stiff in [false, true] {
        let mut coarse = scenario(SIX_JOINT_MASSES);
        for joint in &mut coarse.rigid_body.as_mut().expect("masses").joint {
            if gear_is_stiff {
                joint.gear_stiffness_n_m_rad = None;
            }
        }
        let mut fine = coarse.clone();
        fine.timing.substep_s /= 2.0;
        let (one, other) = (peak(&run_at_rest(&coarse)), peak(&run_at_rest(&fine)));
        assert!((one / other - 1.0).abs() < 1e-3, "{one} N, with half the step {other} N");
    }
}

/// Halving the step of a method of second order leaves a quarter of its error, and of one of first
/// order a half.
#[test]
fn the_error_of_a_step_goes_with_its_square() {
    let mut free = scenario(SIX_JOINT_MASSES);
    free.surface = None;
    free.start.contact_time_s = None;
    for joint in &mut free.rigid_body.as_mut().expect("masses").joint {
        joint.encoder_counts = None;
        // A jump of dry friction at zero has no order.
        (joint.coulomb_friction_n_m, joint.breakaway_friction_n_m) = (0.0, None);
    }
    // Parts of a tick of the drives.
    let with_step = |substep_s: f64| {
        let mut scenario = free.clone();
        scenario.timing.substep_s = substep_s;
        run_at_rest(&scenario)
    };
    let [coarse, middle, fine] = [125e-6, 62.5e-6, 31.25e-6].map(with_step);
    let (first, second) = (apart(&coarse, &middle, 1.0), apart(&middle, &fine, 1.0));
    assert!(first > 3.0 * second && second > 0.0, "{first:e} rad, with half the step {second:e} rad");
}

#[test]
fn a_drive_gives_no_more_than_its_limit() {
    let mut weak = scenario(SIX_JOINT_MASSES);
    let strong = peak(&run_at_rest(&weak));
    weak.rigid_body.as_mut().expect("masses").joint[2].torque_limit_n_m = Some(45.0);
    let limited = peak(&run_at_rest(&weak));
    assert!(limited < 0.95 * strong, "{limited} N with a weak elbow, {strong} N with a strong one");
}

#[test]
fn an_arm_whose_drive_cannot_hold_it_sinks() {
    let mut weak = scenario(SIX_JOINT_MASSES);
    weak.surface = None;
    weak.start.contact_time_s = None;
    weak.rigid_body.as_mut().expect("masses").joint[1].torque_limit_n_m = Some(10.0);
    let truths = run_at_rest(&weak);
    let told = truths.iter().position(|truth| truth.scenario_time_s >= 0.0).expect("it is told to move");
    let sunk = (truths[told].joint_position[1] - truths[0].joint_position[1]).abs();
    assert!(sunk > 0.01, "the shoulder sinks by {sunk} rad");
}
