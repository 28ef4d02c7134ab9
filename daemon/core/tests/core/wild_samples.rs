//! Whatever a motion controller sends, `step` neither panics nor emits anything but finite numbers
//! within the limits.

use crate::common;
use crate::common::{PlanarController, at, given, ns, pushing};
use admittance_core::Outcome;
use admittance_core::Parameters;
use admittance_core::intake::Event;
use admittance_core::intake::{Sample, SampleFault};
use admittance_core::mpc::qp::ActiveSet;
use admittance_core::supervisor::OnInfeasible;
use admittance_core::vocabulary::ModeName as Mode;
use admittance_core::vocabulary::Motion;
use nalgebra::Vector2;
use proptest::prelude::*;

/// Any bit pattern, special values, and magnitudes around the accepted limits.
fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<u64>().prop_map(f64::from_bits),
        prop::sample::select(vec![
            0.0,
            -0.0,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            f64::MIN,
            f64::MIN_POSITIVE,
            5e-324,
            1e300,
            -1e300,
            1e16,
            1e6,
            -1e6,
        ]),
        -1e6..1e6_f64,
        -10.0..10.0_f64,
    ]
}

fn wild_vector() -> impl Strategy<Value = Vector2<f64>> {
    [wild(), wild()].prop_map(Vector2::from)
}

/// How an otherwise plausible sample is spoiled.
#[derive(Debug, Clone)]
enum Spoil {
    Nothing,
    Position(Vector2<f64>),
    Velocity(Vector2<f64>),
    PositionReference(Vector2<f64>),
    TwistReference(Vector2<f64>),
    Wrench(Vector2<f64>),
    Everything([Vector2<f64>; 5]),
    Stamp(u64),
    Sequence(u64),
    Boot(u64, u64),
    JointCount(u32),
    Flags(bool, bool),
    Silence,
    Reset(bool),
}

fn spoil() -> impl Strategy<Value = Spoil> {
    prop_oneof![
        4 => Just(Spoil::Nothing),
        2 => wild_vector().prop_map(Spoil::Position),
        2 => wild_vector().prop_map(Spoil::Velocity),
        2 => wild_vector().prop_map(Spoil::PositionReference),
        2 => wild_vector().prop_map(Spoil::TwistReference),
        2 => wild_vector().prop_map(Spoil::Wrench),
        1 => [wild_vector(), wild_vector(), wild_vector(), wild_vector(), wild_vector()].prop_map(Spoil::Everything),
        1 => prop_oneof![any::<u64>(), 0..20_000_000_u64].prop_map(Spoil::Stamp),
        1 => any::<u64>().prop_map(Spoil::Sequence),
        1 => (any::<u64>(), prop_oneof![any::<u64>(), Just(0), Just(u64::MAX)]).prop_map(|(boot, at)| Spoil::Boot(boot, at)),
        1 => any::<u32>().prop_map(Spoil::JointCount),
        1 => any::<(bool, bool)>().prop_map(|(wrench, drives)| Spoil::Flags(wrench, drives)),
        1 => Just(Spoil::Silence),
        2 => any::<bool>().prop_map(Spoil::Reset),
    ]
}

type Wild = PlanarController<ActiveSet<Vec<f64>>>;

/// One cycle on a sample that presses with `force`, spoiled.
fn cycle(controller: &mut Wild, sample: &mut Sample<2, 2>, spoil: &Spoil) -> Outcome<2, 2> {
    let now = sample.stamp;
    match *spoil {
        Spoil::Nothing => {}
        Spoil::Position(value) => sample.joint_position = value,
        Spoil::Velocity(value) => sample.joint_velocity = value,
        Spoil::PositionReference(value) => sample.joint_position_reference = value,
        Spoil::TwistReference(value) => sample.twist_reference = value,
        Spoil::Wrench(value) => sample.wrench = given(value),
        Spoil::Everything([position, velocity, reference, twist, wrench]) => {
            (sample.joint_position, sample.joint_velocity) = (position, velocity);
            (sample.joint_position_reference, sample.twist_reference) = (reference, twist);
            sample.wrench = given(wrench);
        }
        // A small one is an age or, half of the time, a lead.
        Spoil::Stamp(stamp) if stamp < 20_000_000 => sample.stamp = sample.stamp + ns(10_000_000) - ns(stamp),
        Spoil::Stamp(stamp) => sample.stamp = at(stamp),
        Spoil::Sequence(sequence) => sample.sequence = sequence,
        Spoil::Boot(boot, sequence) => (sample.boot_id, sample.sequence) = (boot, sequence),
        Spoil::JointCount(count) => sample.joint_count = count,
        Spoil::Flags(wrench, drives) => (sample.wrench_valid, sample.drives_enabled) = (wrench, drives),
        Spoil::Silence => return controller.step(Event::Silence, now, &mut || false),
        Spoil::Reset(force) => {
            // Refused or not: what follows must stay within the limits.
            let _ = controller.reset(force);
        }
    }
    controller.step(Event::Sample(sample), now, &mut || false)
}

fn check(outcome: &Outcome<2, 2>, controller: &Wild, limits: &Vector2<f64>) -> Result<(), TestCaseError> {
    let within = |offset: &Vector2<f64>| (0..2).all(|axis| offset[axis].abs() <= limits[axis]);
    prop_assert!(within(&outcome.movement.velocity_offset), "velocity offset {:?}", outcome);
    for (step, (offset, _)) in controller.plan().steps().enumerate() {
        prop_assert!(within(offset), "step {step} of the plan: {offset:?} after {outcome:?}");
    }
    let finite = |vector: &Vector2<f64>| vector.iter().all(|value| value.is_finite());
    prop_assert!(
        finite(&outcome.movement.joint_velocity_offset) && finite(&outcome.movement.twist_command),
        "{outcome:?}"
    );
    if outcome.movement.motion == Motion::Hold || outcome.mode == Mode::Idle {
        prop_assert_eq!(outcome.movement.velocity_offset, Vector2::zeros());
    }
    Ok(())
}

fn controller(parameters: Parameters<2, 2>) -> Wild {
    common::controller(parameters, common::active_set())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_sequence_of_samples_makes_step_emit_anything_out_of_bounds(
        // 0: nothing before the wild samples; otherwise that many cycles of contact.
        history in 0..4_u64,
        minimum_force_stop in any::<bool>(),
        cycles in prop::collection::vec((spoil(), -50.0..300.0_f64, -0.3..0.3_f64), 1..25),
    ) {
        let mut parameters = common::parameters();
        if minimum_force_stop {
            parameters.policy.on_infeasible = OnInfeasible::MinimumForceStop;
        }
        let mut controller = controller(parameters);
        if history > 0 {
            common::step(&mut controller, &pushing(-100.0, 0.05, 1));
            for sequence in 2..2 + history {
                prop_assert_eq!(common::step(&mut controller, &pushing(60.0, 0.05, sequence)).mode, Mode::Contact);
            }
        }
        for (sequence, (spoil, force, speed)) in (2 + history..).zip(&cycles) {
            let outcome = cycle(&mut controller, &mut pushing(*force, *speed, sequence), spoil);
            check(&outcome, &controller, &parameters.limits.offset)?;
        }
    }
}

#[test]
fn values_beyond_every_arm_never_reach_the_law() {
    for value in [1.1e6, -1e300, f64::MAX] {
        let mut controller = controller(common::parameters());
        common::step(&mut controller, &pushing(-100.0, 0.05, 1));
        common::step(&mut controller, &pushing(60.0, 0.05, 2));
        let sample = Sample { wrench: given(Vector2::new(-30.0, value)), ..pushing(60.0, 0.05, 3) };
        let outcome = common::step(&mut controller, &sample);
        assert!(
            matches!(outcome.fault, Some(SampleFault::Implausible { index: 1, .. })),
            "{value}: {:?}",
            outcome.fault
        );
    }
}
