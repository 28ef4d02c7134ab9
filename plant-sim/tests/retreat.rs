//! How a plant leaves the surface before it ends.

mod common;

use admittance_client::Reception;
use common::{command, paper, scenario};
use ipc_types::{CommandSample, Motion, StateSample};
use plant_sim::faults::FaultKind;
use plant_sim::plant::{CycleTiming, Plant, Retreated};
use plant_sim::scenario::{FaultSection, Scenario};
use plant_sim::setup;

/// Presses for a while, ends as the shell does, and returns how the retreat went, how long it took
/// in s, and what was commanded meanwhile.
fn ended(scenario: &Scenario, law: impl Fn(&StateSample) -> CommandSample) -> (Retreated, f64, Vec<[f64; 2]>) {
    let mut plant: Plant<2, 2> = setup::plant(scenario, 1_000_000_000, 1, false).expect("the scenario can be set up");
    let turn = |plant: &mut Plant<2, 2>| {
        let state = *plant.sample();
        assert_eq!(plant.receive(&law(&state), state.stamp_ns).expect("acceptable"), Some(Reception::InTime));
        let truth = plant.settle(CycleTiming::default());
        plant.integrate();
        (state, truth)
    };
    let mut last = None;
    while plant.index() < 220 {
        last = Some(turn(&mut plant).1);
    }
    assert_eq!(last.expect("some cycles").in_contact, 1);
    plant.begin_retreat();
    let mut commanded = Vec::new();
    while plant.retreated().is_none() {
        let (state, _) = turn(&mut plant);
        commanded.push([state.twist_reference[0], state.twist_reference[1]]);
    }
    (plant.retreated().expect("it is over"), commanded.len() as f64 * 0.004, commanded)
}

/// The damping law (3): the arm settles on the surface.
fn damping(state: &StateSample) -> CommandSample {
    command(state, &[-0.001 * state.wrench[0], -0.001 * state.wrench[1]])
}

fn hold(state: &StateSample) -> CommandSample {
    CommandSample { motion: Motion::Hold.code(), ..command(state, &[0.0, 0.0]) }
}

#[test]
fn it_is_a_motion_out_of_the_surface_and_a_rest() {
    let (retreated, took_s, commanded) = ended(&paper(0.5), damping);
    assert!(retreated.is_clear && !retreated.was_jogged, "{retreated:?}");
    assert!((0.005..0.01).contains(&retreated.gap_m), "{retreated:?}");
    assert!((0.2..0.6).contains(&took_s), "{took_s} s");
    // The first sample had told of the motion before.
    assert_eq!(commanded[0], [0.0, -0.25]);
    let normal = [0.422_618_261_740_699_44, 0.906_307_787_036_649_9];
    assert_eq!(commanded[1], normal.map(|n| n * 0.05));
    assert_eq!(commanded.last(), Some(&[0.0, 0.0]));
}

#[test]
fn a_daemon_that_holds_or_presses_is_left_out_in_the_end() {
    let presses = |state: &StateSample| {
        let is_leaving = state.twist_reference[1] > 0.0;
        if is_leaving { command(state, &[-0.03, -0.06]) } else { damping(state) }
    };
    let holds = |state: &StateSample| if state.wrench[1] < -20.0 { hold(state) } else { damping(state) };
    for (what, (retreated, took_s, _)) in
        [("presses", ended(&paper(0.5), presses)), ("holds", ended(&paper(0.5), holds))]
    {
        assert!(retreated.is_clear && retreated.was_jogged, "{what}: {retreated:?}");
        assert!((0.8..1.3).contains(&took_s), "{what}: {took_s} s");
    }
}

#[test]
fn it_ends_where_the_arm_cannot_move() {
    let mut scenario = paper(0.5);
    scenario.fault = vec![FaultSection { at_s: 0.88, duration_s: 60.0, kind: FaultKind::DrivesDisabled }];
    let (retreated, took_s, _) = ended(&scenario, damping);
    assert!(!retreated.is_clear && took_s < 2.0, "{retreated:?} after {took_s} s");
}

#[test]
fn an_arm_that_is_clear_stays_where_it_is() {
    for scenario in [paper(0.5), scenario(common::PLANAR_FREE)] {
        let mut plant: Plant<2, 2> = setup::plant(&scenario, 1_000_000_000, 1, false).expect("can be set up");
        plant.begin_retreat();
        assert!(plant.retreated().is_some_and(|retreated| !retreated.was_jogged));
    }
}
