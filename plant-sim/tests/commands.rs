//! When commands act, what is played if they are missed, and which are rejected.

mod common;

use admittance_client::{Playback, Rejection};
use common::{command, paper, scenario};
use ipc_types::{CommandSample, Motion, StateSample, TruthSample, VirtualPlant};
use plant_sim::plant::{CycleTiming, Led, Plant};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;
use plant_sim::setup;

const SAMPLING_TIME_NS: u64 = 4_000_000;

/// The planar arm at rest in free space: it moves by offsets alone.
fn at_rest(command_delay_s: f64) -> Scenario {
    let mut scenario = paper(0.0);
    scenario.timing.command_delay_s = command_delay_s;
    scenario.surface = None;
    scenario.start.contact_time_s = None;
    scenario.motion[0].twist = vec![0.0, 0.0];
    scenario
}

fn plant(scenario: &Scenario) -> Plant<2, 2> {
    setup::plant::<2, 2>(scenario, 1_000_000_000, 1, false).expect("the scenario can be set up")
}

fn step(plant: &mut Plant<2, 2>) -> TruthSample {
    let truth = plant.settle(CycleTiming::default());
    plant.integrate();
    truth
}

/// The instant at which the first joint's velocity reference changed from 0 to `reference`.
fn acted_at_ns(truth: &TruthSample, reference: f64) -> f64 {
    truth.stamp_ns as f64 + 0.015e9 * (1.0 - truth.joint_velocity[0] / reference).ln()
}

/// The velocity reference of the first joint for an offset of 1 µm/s: so small that J stays.
const OFFSET: [f64; 2] = [1e-6, -2e-6];

fn reference(state: &StateSample) -> f64 {
    let (q1, q12) = (state.joint_position[0], state.joint_position[0] + state.joint_position[1]);
    let j = nalgebra::Matrix2::new(-q1.sin() - q12.sin(), -q12.sin(), q1.cos() + q12.cos(), q12.cos());
    (j.try_inverse().expect("a bent arm") * nalgebra::Vector2::from(OFFSET))[0]
}

#[test]
fn a_command_acts_at_its_instant_exactly() {
    for delay_ns in [0, 250_000, 1_234_567, SAMPLING_TIME_NS, 2 * SAMPLING_TIME_NS, 9_100_000] {
        let mut run = VirtualRun::new(&at_rest(delay_ns as f64 * 1e-9)).expect("the scenario can be set up");
        let (mut acts_ns, mut expected_reference) = (0, 0.0);
        for cycle in 0..20 {
            let state = *run.sample().expect("published");
            let answer = if cycle < 5 { command(&state, &[0.0, 0.0]) } else { command(&state, &OFFSET) };
            if cycle == 5 {
                acts_ns = state.stamp_ns + delay_ns;
                expected_reference = reference(&state);
            }
            let truth = run.advance(Some(&answer)).expect("acceptable");
            assert_eq!(truth.missed_commands, 0, "delay {delay_ns}");
            if cycle < 5 || truth.stamp_ns <= acts_ns {
                assert_eq!(truth.joint_velocity[0], 0.0, "delay {delay_ns}: moved before {acts_ns}");
            } else if truth.stamp_ns <= acts_ns + SAMPLING_TIME_NS {
                let acted = acted_at_ns(&truth, expected_reference);
                assert!((acted - acts_ns as f64).abs() < 5.0, "delay {delay_ns}: {acted} for {acts_ns}");
            }
            let in_force = truth.stamp_ns >= acts_ns && acts_ns > 0;
            assert_eq!(truth.velocity_offset[0] != 0.0, in_force, "delay {delay_ns} cycle {cycle}");
        }
    }
}

/// An answer with a plan: 1, 2, 3 µm/s in x, each for one sampling time, valid for 2.5 of them
/// after it acts.
fn planned(state: &StateSample, delay_ns: u64) -> CommandSample {
    let mut command = command(state, &[1e-6, 0.0]);
    command.plan_length = 3;
    for step in 0..3 {
        command.plan_end_ns[step] = (step as u64 + 1) * SAMPLING_TIME_NS;
        command.planned_offset[step][0] = (step + 1) as f64 * 1e-6;
    }
    command.valid_until_ns = state.stamp_ns + delay_ns + SAMPLING_TIME_NS * 5 / 2;
    command
}

#[test]
fn a_missed_command_means_the_plan_and_then_hold() {
    for delay_ns in [0, 250_000] {
        let mut run = VirtualRun::new(&at_rest(delay_ns as f64 * 1e-9)).expect("the scenario can be set up");
        let state = *run.sample().expect("published");
        let mut truths = vec![run.advance(Some(&planned(&state, delay_ns))).expect("acceptable")];
        truths.extend((0..6).map(|_| run.advance(None).expect("nothing to reject")));
        // At delay 0 the truth of a sample already shows the step that begins there.
        let shown: Vec<_> = truths.iter().map(|truth| (truth.velocity_offset[0], truth.motion)).collect();
        let (offset, hold) = (|step: i32| (f64::from(step) * 1e-6, Motion::Offset.code()), (0.0, Motion::Hold.code()));
        let expected = if delay_ns == 0 {
            [offset(1), offset(2), offset(3), hold, hold, hold, hold]
        } else {
            [offset(0), offset(1), offset(2), hold, hold, hold, hold]
        };
        if delay_ns == 0 {
            assert_eq!(shown, expected);
        } else {
            // 2.5 sampling times after 0.25 ms the third sample still moves.
            assert_eq!(shown[..3], expected[..3]);
            assert_eq!(shown[3..], expected[3..]);
        }
        let missed: Vec<_> = truths.iter().map(|truth| (truth.missed, truth.missed_commands)).collect();
        assert_eq!(missed, [(0, 0), (1, 1), (1, 2), (1, 3), (1, 4), (1, 5), (1, 6)], "delay {delay_ns}");
        // Hold begins at valid-until to the nanosecond: from there on the joint velocity only
        // decays.
        let valid_until_ns = 1_000_000_000 + delay_ns + SAMPLING_TIME_NS * 5 / 2;
        let decayed =
            |truth: &TruthSample| truth.joint_velocity[0] * ((truth.stamp_ns - valid_until_ns) as f64 / 0.015e9).exp();
        let (first, second) = (decayed(&truths[3]), decayed(&truths[4]));
        assert!((first / second - 1.0).abs() < 1e-12 && first != 0.0);
        assert!(velocity_at_hold(&truths[2], valid_until_ns, delay_ns, first), "delay {delay_ns}");
    }
}

/// Whether integrating from the sample before by hand gives the joint velocity `expected` at the
/// instant of hold.
fn velocity_at_hold(before: &TruthSample, hold_ns: u64, delay_ns: u64, expected: f64) -> bool {
    let (q1, q12) = (before.joint_position[0], before.joint_position[0] + before.joint_position[1]);
    let j = nalgebra::Matrix2::new(-q1.sin() - q12.sin(), -q12.sin(), q1.cos() + q12.cos(), q12.cos());
    let reference = |offset: f64| (j.try_inverse().expect("a bent arm") * nalgebra::Vector2::new(offset, 0.0))[0];
    let decay = |velocity: f64, reference: f64, duration_ns: u64| {
        reference + (velocity - reference) * (-(duration_ns as f64) / 0.015e9).exp()
    };
    let third_ns = before.stamp_ns + delay_ns;
    let velocity = decay(before.joint_velocity[0], reference(2e-6), delay_ns);
    let velocity = decay(velocity, reference(3e-6), hold_ns - third_ns);
    (velocity / expected - 1.0).abs() < 1e-5
}

#[test]
fn the_last_step_of_a_plan_lasts_until_the_command_is_no_longer_valid() {
    let mut plant = plant(&at_rest(0.0));
    let mut long = planned(plant.sample(), 0);
    long.valid_until_ns += 10 * SAMPLING_TIME_NS;
    plant.receive(&long, 1_000_000_000).expect("acceptable");
    let offsets: Vec<_> = (0..14).map(|_| step(&mut plant).velocity_offset[0]).collect();
    assert_eq!(offsets[2..12], [3e-6; 10]);
    assert_eq!(offsets[13], 0.0);
}

#[test]
fn before_the_first_command_nothing_is_missed_and_the_offset_is_zero() {
    let mut scenario = paper(0.0);
    scenario.timing.settle_s = 0.0;
    let mut plant = plant(&scenario);
    for _ in 0..10 {
        let truth = step(&mut plant);
        assert_eq!((truth.missed, truth.missed_commands, truth.motion), (0, 0, Motion::Offset.code()));
        assert_eq!(truth.velocity_offset, [0.0; 6]);
    }
    assert!(plant.joint_position()[0] != plant.sample().joint_position_reference[0], "it lags behind its command");
    assert_eq!(plant.sample().applied_command_sequence, 0);
    let mut first = command(plant.sample(), &[0.0, 0.0]);
    first.sequence = 42;
    plant.receive(&first, plant.now_ns()).expect("acceptable");
    step(&mut plant);
    assert_eq!(plant.sample().applied_command_sequence, 42);
    assert_eq!(step(&mut plant).missed_commands, 1);
}

#[test]
fn samples_from_before_the_first_command_are_never_missed() {
    // With a delay of two cycles two of them are still due when the first command comes.
    let mut plant = plant(&at_rest(0.0081));
    for cycle in 0..20 {
        if cycle >= 5 {
            plant.receive(&command(plant.sample(), &OFFSET), plant.now_ns()).expect("acceptable");
        }
        let truth = step(&mut plant);
        assert_eq!((truth.missed, truth.missed_commands), (0, 0), "cycle {cycle}");
    }
    let shown: Vec<_> = (0..4).map(|_| step(&mut plant).missed).collect();
    assert_eq!(shown, [0, 0, 1, 1], "two commands are under way");
}

#[test]
fn hold_stops_the_joints_whatever_the_command() {
    let mut scenario = paper(0.0);
    scenario.timing.settle_s = 0.0;
    let mut plant = plant(&scenario);
    for cycle in 0..100 {
        let mut answer = command(plant.sample(), &[0.1, 0.1]);
        if cycle >= 30 {
            answer.motion = Motion::Hold.code();
        }
        plant.receive(&answer, plant.now_ns()).expect("acceptable");
        step(&mut plant);
    }
    let sample = plant.sample();
    assert!(sample.joint_velocity[..2].iter().all(|velocity| velocity.abs() < 1e-6), "{:?}", sample.joint_velocity);
    assert_eq!(sample.twist_reference[1], -0.25, "the command goes on");
    assert!((sample.joint_position_reference[1] - sample.joint_position[1]).abs() > 0.01, "and q0 with it");
}

#[test]
fn a_late_command_acts_from_the_next_sample() {
    let mut plant = plant(&at_rest(0.00025));
    let answer = command(plant.sample(), &[0.0, 0.0]);
    plant.receive(&answer, plant.now_ns()).expect("acceptable");
    step(&mut plant);
    let late = command(plant.sample(), &OFFSET);
    plant.receive(&late, plant.now_ns() + 250_001).expect("acceptable, but late");
    let truth = step(&mut plant);
    assert_eq!((truth.missed, truth.missed_commands, truth.velocity_offset[0]), (1, 1, 0.0));
    assert_eq!(plant.sample().joint_velocity[0], 0.0, "the cycle that it answers goes without it");
    let truth = step(&mut plant);
    assert_eq!(truth.velocity_offset[0], OFFSET[0]);
    assert!(plant.sample().joint_velocity[0] != 0.0);
}

#[test]
fn what_is_not_acceptable_counts_as_missed() {
    let rejected = |spoil: &dyn Fn(&mut CommandSample)| {
        let mut plant = plant(&at_rest(0.0));
        for _ in 0..3 {
            let good = command(plant.sample(), &[1e-6, 0.0]);
            plant.receive(&good, plant.now_ns()).expect("acceptable");
            step(&mut plant);
        }
        let mut bad = command(plant.sample(), &[5.0, 0.0]);
        spoil(&mut bad);
        let rejection = plant.receive(&bad, plant.now_ns()).expect_err("not acceptable");
        let truth = step(&mut plant);
        assert_eq!((truth.missed, truth.velocity_offset[0]), (1, 1e-6), "{rejection}: the last good one plays on");
        assert_eq!((plant.playback().rejected(), plant.playback().missed()), (1, 1));
        rejection
    };
    type Spoil = fn(&mut CommandSample);
    let fields: [(&str, Spoil); 4] = [
        ("velocity_offset", |c| c.velocity_offset[5] = f64::NAN),
        ("joint_velocity_offset", |c| c.joint_velocity_offset[1] = f64::INFINITY),
        ("twist_command", |c| c.twist_command[0] = f64::NEG_INFINITY),
        ("planned_offset", |c| {
            (c.plan_length, c.plan_end_ns[0], c.planned_offset[0][1]) = (1, 4_000_000, f64::NAN);
        }),
    ];
    for (name, spoil) in fields {
        assert!(matches!(rejected(&spoil), Rejection::NotFinite { field, .. } if field == name), "{name}");
    }
    let count = rejected(&|c| c.joint_count = 6);
    assert!(count.to_string().contains("6 joints; this robot has 2"), "{count}");
    assert!(matches!(rejected(&|c| c.motion = 2), Rejection::Motion { motion: 2, .. }));
    assert!(matches!(rejected(&|c| c.plan_length = 33), Rejection::Plan { length: 33, .. }));
    let falling: Spoil = |c| (c.plan_length, c.plan_end_ns[0], c.plan_end_ns[1]) = (2, 8, 8);
    assert!(matches!(rejected(&falling), Rejection::Plan { length: 2, .. }));
    assert!(matches!(rejected(&|c| c.state_sequence -= 2), Rejection::Older { answered: 2, newest: 3, .. }));
    assert!(matches!(rejected(&|c| c.state_sequence += 1), Rejection::UnknownSample { answered: 5, .. }));
    assert!(matches!(rejected(&|c| c.state_stamp_ns += 1), Rejection::UnknownSample { .. }));
    assert!(matches!(rejected(&|c| c.state_sequence = 0), Rejection::Older { answered: 0, .. }));
}

#[test]
fn a_hold_from_a_daemon_that_answered_nothing_yet_is_taken() {
    let mut plant = plant(&at_rest(0.0));
    let hold = CommandSample {
        sequence: 1,
        boot_id: 7,
        joint_count: 2,
        motion: Motion::Hold.code(),
        ..CommandSample::zeroed()
    };
    plant.receive(&hold, plant.now_ns()).expect("holding is always right");
    step(&mut plant);
    assert_eq!(step(&mut plant).motion, Motion::Hold.code());
}

#[test]
fn the_motion_waits_for_the_first_command() {
    for settle_s in [0.0, 0.02] {
        let mut scenario = at_rest(0.00025);
        scenario.timing.settle_s = settle_s;
        let mut plant = setup::plant::<2, 2>(&scenario, 1_000_000_000, 1, true).expect("the scenario can be set up");
        for _ in 0..50 {
            assert!(step(&mut plant).scenario_time_s < 0.0, "settle {settle_s}");
        }
        let mut cycles = 0;
        while plant.index() < 0 {
            plant.receive(&command(plant.sample(), &[0.0, 0.0]), plant.now_ns()).expect("acceptable");
            step(&mut plant);
            cycles += 1;
        }
        assert_eq!(cycles, if settle_s == 0.0 { 1 } else { 5 }, "settling counts from the first command");
    }
}

#[test]
fn faults_change_what_is_published_only() {
    let mut faulty = scenario(common::PLANAR_FREE);
    let kinds = ["drop", "freeze", "nan_wrench", "wrench_invalid", "joint_count", "drives_disabled", "command_loss"];
    for (index, kind) in kinds.into_iter().enumerate() {
        let at = 0.1 + 0.1 * index as f64;
        let text = format!("{}\n[[fault]]\nat_s = {at}\nduration_s = 0.02\nkind = \"{kind}\"\n", common::PLANAR_FREE);
        faulty.fault.push(scenario(&text).fault[0].clone());
    }
    let mut run = VirtualRun::new(&faulty).expect("the scenario can be set up");
    let mut seen = std::collections::BTreeMap::<&str, u32>::new();
    let (mut newest, mut missed) = (0, 0);
    while !run.is_finished() {
        let state = run.sample().copied();
        let answer = state.filter(|state| state.sequence > newest).map(|state| {
            let mut answer = command(&state, &[0.0, 0.0]);
            answer.joint_count = 2;
            answer
        });
        match &state {
            None => *seen.entry("drop").or_default() += 1,
            Some(state) if state.sequence == newest => *seen.entry("freeze").or_default() += 1,
            Some(state) => {
                newest = state.sequence;
                assert_eq!(state.stamp_ns, run.now_ns());
                *seen.entry("nan_wrench").or_default() += u32::from(state.wrench[1].is_nan());
                *seen.entry("wrench_invalid").or_default() += u32::from(state.wrench_valid == 0);
                *seen.entry("joint_count").or_default() += u32::from(state.joint_count == 3);
                *seen.entry("drives_disabled").or_default() += u32::from(state.drives_enabled == 0);
            }
        }
        let truth = run.advance(answer.as_ref()).expect("acceptable");
        missed += truth.missed;
    }
    for kind in ["drop", "freeze", "nan_wrench", "wrench_invalid", "joint_count", "drives_disabled"] {
        assert_eq!(seen.get(kind), Some(&5), "{kind}");
    }
    assert_eq!(missed, 15, "no answer to dropped and frozen samples, none seen in a command loss");
}

#[test]
fn disabled_drives_brake_the_arm_and_stop_its_command() {
    let mut scenario = paper(0.0);
    scenario.fault = vec![
        common::scenario(&format!(
            "{}\n[[fault]]\nat_s = 0.2\nduration_s = 0.2\nkind = \"drives_disabled\"\n",
            common::PAPER
        ))
        .fault[0]
            .clone(),
    ];
    let truths = common::run(&scenario, |_| vec![0.05, 0.0]);
    let at = |time: f64| truths.iter().find(|truth| truth.scenario_time_s > time).expect("within the run");
    assert!(at(0.18).joint_velocity[1].abs() > 0.05);
    assert!(at(0.39).joint_velocity[1].abs() < 1e-4);
    assert!(at(0.5).joint_velocity[1].abs() > 0.05, "and then it goes on");
}

/// A plant that is led from outside by the rules of the client moves as the one that plays by itself, bit for bit.
#[test]
fn a_led_plant_moves_as_one_that_plays_commands_itself() {
    let mut scenario = paper(0.0);
    scenario.timing.command_delay_s = 0.00025;
    let (mut own, mut led) = (plant(&scenario), plant(&scenario));
    let mut playback = Playback::new(2, 250_000, SAMPLING_TIME_NS);
    for cycle in 0..400 {
        let measured = StateSample { applied_command_sequence: playback.applied_sequence(), ..*led.sample() };
        assert_eq!(*own.sample(), measured, "cycle {cycle}");
        let state = *own.sample();
        playback.begin_sample(state.sequence, state.stamp_ns);
        // Every fourth is missed, and its plan played on.
        if cycle % 4 != 3 {
            let answer = planned(&state, 250_000);
            own.receive(&answer, own.now_ns()).expect("acceptable");
            playback.receive(&answer, own.now_ns()).expect("acceptable");
        }
        let end_ns = led.cycle_end_ns();
        let missed = playback.is_missing(end_ns);
        let missed_commands = playback.missed() + u64::from(missed);
        playback.apply_due(led.now_ns());
        let applied = playback.applied(led.now_ns());
        let told = Led { timing: CycleTiming::default(), applied, missed, missed_commands };
        assert_eq!(own.settle(CycleTiming::default()), led.led_truth(&told), "cycle {cycle}");
        own.integrate();
        while led.now_ns() < end_ns {
            playback.apply_due(led.now_ns());
            let until = [playback.next_due(), playback.next_change(led.now_ns())];
            led.follow(&playback.applied(led.now_ns()), until.into_iter().flatten().fold(end_ns, u64::min));
        }
        led.arrive(playback.has_received());
    }
    assert!(own.sample().wrench[1] != 0.0, "it touches");
}
