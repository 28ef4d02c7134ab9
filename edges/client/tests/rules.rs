//! Which answers a motion controller refuses, and what it then does.

use admittance_client::{Applied, Limits, Playback, Reception, Rejection};
use ipc_types::{CommandSample, Motion};

const SAMPLING_TIME_NS: u64 = 4_000_000;
const DELAY_NS: u64 = 250_000;
const START_NS: u64 = 1_000_000_000;

fn stamp(sequence: u64) -> u64 {
    START_NS + (sequence - 1) * SAMPLING_TIME_NS
}

fn answer(sequence: u64) -> CommandSample {
    let mut command = CommandSample { sequence, joint_count: 2, state_sequence: sequence, ..CommandSample::zeroed() };
    command.state_stamp_ns = stamp(sequence);
    command.valid_until_ns = stamp(sequence) + DELAY_NS + 3 * SAMPLING_TIME_NS;
    command.velocity_offset[1] = 0.05;
    command.plan_length = 2;
    command.plan_end_ns[..2].copy_from_slice(&[SAMPLING_TIME_NS, 2 * SAMPLING_TIME_NS]);
    (command.planned_offset[0][1], command.planned_offset[1][1]) = (0.05, 0.08);
    command
}

/// After this many samples.
fn playback(samples: u64, limits: Limits) -> Playback {
    let mut playback = Playback::with_limits(2, DELAY_NS, SAMPLING_TIME_NS, limits);
    (1..=samples).for_each(|sequence| playback.begin_sample(sequence, stamp(sequence)));
    playback
}

#[test]
fn a_command_beyond_the_controllers_own_limits_is_refused_and_the_plan_before_it_goes_on() {
    let limits = Limits { velocity_offset: [0.1; 6], joint_velocity_offset: [0.5; 8] };
    type Spoil = fn(&mut CommandSample);
    let spoils: [(&str, usize, Spoil); 4] = [
        ("velocity_offset", 0, |command| command.velocity_offset[0] = -0.11),
        ("joint_velocity_offset", 1, |command| command.joint_velocity_offset[1] = 0.6),
        ("planned_offset", 1, |command| command.planned_offset[1][1] = 0.11),
        // 0.03 m/s more in the second step, by joints that the daemon resolves.
        ("joint_velocity_offset", 1, |command| command.joint_per_twist[1][1] = -20.0),
    ];
    for (name, place, spoil) in spoils {
        let mut playback = playback(1, limits);
        assert_eq!(playback.receive(&answer(1), stamp(1)), Ok(Reception::InTime));
        playback.begin_sample(2, stamp(2));
        let mut wrong = answer(2);
        spoil(&mut wrong);
        let Err(Rejection::BeyondLimit { field, index, .. }) = playback.receive(&wrong, stamp(2)) else {
            panic!("{name} is beyond the limit")
        };
        assert_eq!((field, index, playback.rejected()), (name, place, 1));
        playback.apply_due(stamp(2) + DELAY_NS);
        let Applied::Offset(offset) = playback.applied(stamp(2) + DELAY_NS) else { panic!("{name}: the plan lasts") };
        assert_eq!(offset[1], 0.08, "the second step of the plan before");
        assert_eq!(playback.applied(answer(1).valid_until_ns), Applied::Hold);
    }
}

#[test]
fn joints_that_follow_are_told_every_step_of_the_plan() {
    let mut playback = playback(1, Limits::NONE);
    assert_eq!(playback.joint_velocity_offset(stamp(1)), [0.0; 8], "no command yet");
    let mut command = answer(1);
    (command.joint_velocity_offset[0], command.joint_velocity_offset[1]) = (0.3, -0.1);
    (command.joint_per_twist[0][1], command.joint_per_twist[1][1]) = (2.0, -1.0);
    assert_eq!(playback.receive(&command, stamp(1)), Ok(Reception::InTime));
    let acts = stamp(1) + DELAY_NS;
    playback.apply_due(acts);
    assert_eq!(playback.joint_velocity_offset(acts)[..3], [0.3, -0.1, 0.0], "the first step, to the bit");
    let second = playback.joint_velocity_offset(acts + SAMPLING_TIME_NS);
    assert!((second[0] - 0.36).abs() < 1e-12 && (second[1] + 0.13).abs() < 1e-12, "{second:?}");
    assert_eq!(playback.joint_velocity_offset(command.valid_until_ns), [0.0; 8], "held");
}

#[test]
fn a_hold_is_obeyed_whatever_it_would_move_by() {
    let mut playback = playback(1, Limits { velocity_offset: [0.01; 6], ..Limits::NONE });
    let hold = CommandSample { motion: Motion::Hold.code(), ..answer(1) };
    assert_eq!(playback.receive(&hold, stamp(1)), Ok(Reception::InTime));
    playback.apply_due(stamp(1) + DELAY_NS);
    assert_eq!(playback.applied(stamp(1) + DELAY_NS), Applied::Hold);
}

#[test]
fn an_answer_to_another_boot_is_refused_however_old_the_sample_is() {
    let mut playback = playback(100, Limits::NONE);
    // Both numbers are those of this boot's samples; the second is no longer remembered.
    for sequence in [98, 5] {
        let mut foreign = answer(sequence);
        foreign.state_stamp_ns -= 600_000_000;
        let refused = playback.receive(&foreign, stamp(100));
        assert!(matches!(refused, Err(Rejection::UnknownSample { .. })), "sample {sequence}: {refused:?}");
    }
    // One that this boot published so long ago is late, and nothing else.
    assert_eq!(playback.receive(&answer(5), stamp(100)), Ok(Reception::Late));
    let ahead = playback.receive(&answer(101), stamp(100));
    assert!(matches!(ahead, Err(Rejection::UnknownSample { answered: 101, .. })), "{ahead:?}");
}

#[test]
fn a_limit_that_was_forgotten_is_none() {
    for (value, joint) in [(0.0, 1), (-1.0, 0), (f64::NAN, 1)] {
        let mut limits = Limits::NONE;
        limits.joint_velocity_offset[joint] = value;
        let error = limits.validate(2).expect_err("no limit").to_string();
        assert!(error.starts_with(&format!("limit of joint_velocity_offset[{joint}] = {value}: accepted")), "{error}");
    }
    let mut limits = Limits::NONE;
    limits.joint_velocity_offset[2] = 0.0;
    assert_eq!(limits.validate(2), Ok(()), "there is no third joint");
}

/// A controller that was kept from its cycle finds two answers at once: one that was in time, and a newer one that was not.
#[test]
fn an_answer_that_is_late_is_not_lost_to_an_older_one() {
    let mut playback = Playback::new(2, 2 * SAMPLING_TIME_NS, SAMPLING_TIME_NS);
    (1..=2).for_each(|sequence| playback.begin_sample(sequence, stamp(sequence)));
    assert_eq!(playback.receive(&answer(1), stamp(2)), Ok(Reception::InTime));
    let after = stamp(4) + 1;
    let mut newer = answer(2);
    newer.valid_until_ns = stamp(8);
    (newer.velocity_offset[1], newer.plan_length) = (-0.03, 0);
    assert_eq!(playback.receive(&newer, after), Ok(Reception::Late));
    playback.apply_due(after);
    let Applied::Offset(older) = playback.applied(after) else { panic!("its plan lasts") };
    assert_eq!(older[1], 0.08, "the second step of the older one, until the next sample");
    playback.begin_sample(3, after);
    assert_eq!(playback.applied(after), Applied::Offset(newer.velocity_offset));
    assert_eq!(playback.missed(), 1);
}

/// As `docs/client.md` says for a controller that looks once per update, and acts on the answer to the sample before.
#[test]
fn a_controller_that_looks_once_per_update_misses_nothing_by_jitter() {
    let mut playback = Playback::new(2, SAMPLING_TIME_NS, SAMPLING_TIME_NS);
    let jittered = |update: u64| stamp(update) + 40_000 * (update * 7 % 5) - 80_000;
    playback.begin_sample(1, jittered(1));
    for update in 2..100 {
        let previous_ns = jittered(update - 1);
        let at = previous_ns + SAMPLING_TIME_NS;
        let mut command = answer(update - 1);
        (command.state_stamp_ns, command.valid_until_ns) = (previous_ns, previous_ns + 4 * SAMPLING_TIME_NS);
        command.velocity_offset[1] = update as f64;
        assert_eq!(playback.receive(&command, at), Ok(Reception::InTime));
        playback.apply_due(at);
        assert_eq!(playback.applied(at), Applied::Offset(command.velocity_offset), "update {update}");
        playback.begin_sample(update, jittered(update));
    }
    assert_eq!(playback.missed(), 0);
}
