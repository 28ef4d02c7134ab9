//! Records of a contact in virtual time, replayed.

use admittance_host::robot_description::VelocityLoopDescription;
use admittance_runner::config::{FrameName, GivenInName};
use admittance_runner::cycle;
use ipc_types::{MAX_JOINTS, StateSample};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::{Scenario, SensorSection};

use super::*;
use crate::recording::PRESENT_RECORD_VERSION;
use crate::virtual_recording::VirtualRecords;

const CONFIG: &str = include_str!("../../../../../deploy/demo/mpc-default.toml");
const SIX_JOINTS: &str = include_str!("../../../../../deploy/robots/six-joint.toml");
const SIX_JOINT_SCENARIO: &str = include_str!("../../../../../plant-sim/scenarios/six-joint.toml");
const SCENARIO: &str = include_str!("../../../../../plant-sim/scenarios/paper.toml");

fn config() -> Config {
    config::parse(CONFIG, "mpc-default.toml").expect("valid")
}

fn scenario() -> Scenario {
    config::parse(SCENARIO, "paper.toml").expect("valid")
}

/// What a daemon would record of the paper's contact in virtual time. Its time is up as `is_over`
/// says of a record's sequence and of how often the law has asked.
fn records(is_over: fn(u64, u64) -> bool) -> Vec<RecordSample> {
    records_of(&config(), &scenario(), is_over)
}

/// The same of another configuration and plant.
fn records_of(config: &Config, scenario: &Scenario, is_over: fn(u64, u64) -> bool) -> Vec<RecordSample> {
    let plant = VirtualRun::new(scenario).expect("the scenario can be set up");
    let mut run = VirtualRecords::new(cycle::build(config).expect("a known arm"), plant);
    let next = || run.next(is_over).expect("no faults in this scenario").map(|(record, _)| record);
    std::iter::from_fn(next).collect()
}

/// Replays records until one differs; the sequence of that one, and how many were compared.
fn replay(records: &[RecordSample]) -> (Option<u64>, u64) {
    replay_of(config(), records)
}

/// The same under another configuration.
fn replay_of(config: Config, records: &[RecordSample]) -> (Option<u64>, u64) {
    let configurations = BTreeMap::new();
    let mut session = Session::new(config, &configurations, PRESENT_RECORD_VERSION).expect("a known arm");
    for record in records {
        if session.take(record).expect("sound records").is_some() {
            return (Some(record.sequence), session.compared());
        }
    }
    (None, session.compared())
}

#[test]
fn a_time_that_was_up_is_up_again_at_the_same_question() {
    // In every third cycle at the first question, else at the second.
    let mut records = records(|sequence, asked| asked >= if sequence.is_multiple_of(3) { 1 } else { 2 });
    let count = records.len() as u64;
    let expired: Vec<usize> = (0..records.len()).filter(|index| records[*index].expired_at > 0).collect();
    for question in 1..=2 {
        assert!(expired.iter().any(|index| records[*index].expired_at == question), "a cycle of {question} questions");
    }
    assert_eq!(replay(&records), (None, count));
    let first = expired[0];
    records[first].expired_at = 0;
    assert_eq!(replay(&records), (Some(records[first].sequence), first as u64));
}

#[test]
fn one_bit_is_found_wherever_it_is() {
    let records = records(|_, _| false);
    let touched = records.iter().position(|record| record.command.active_axes != 0).expect("a contact");
    let alterations: [fn(&mut RecordSample); 5] = [
        |record| record.command.velocity_offset[1] = f64::from_bits(record.command.velocity_offset[1].to_bits() ^ 1),
        |record| record.command.planned_offset[31][5] = -0.0,
        |record| record.command.valid_until_ns += 1,
        |record| record.command.rejected_count += 1,
        |record| record.iterations += 1,
    ];
    for alter in alterations {
        let mut records = records.clone();
        alter(&mut records[touched + 3]);
        assert_eq!(replay(&records), (Some(touched as u64 + 4), touched as u64 + 3));
    }
    // A different sample leads to a different answer.
    let mut records = records;
    records[touched + 3].state.wrench[1] -= 1.0;
    assert_eq!(replay(&records).0, Some(touched as u64 + 4));
}

#[test]
fn after_a_gap_the_replay_begins_anew_in_free_motion() {
    let records = records(|_, _| false);
    let touched = records.iter().position(|record| record.command.active_axes != 0).expect("a contact");
    let begin = touched - RUN_IN as usize - 10;
    let compared = |records: &[RecordSample]| replay(records);
    // As a recording that begins late.
    assert_eq!(compared(&records[begin..]), (None, (records.len() - begin) as u64 - RUN_IN));
    // A gap before the run-in, and one within it.
    let gap = [&records[..50], &records[begin..]].concat();
    assert_eq!(compared(&gap), (None, 50 + (records.len() - begin) as u64 - RUN_IN));
    let late_gap = [&records[..begin + 20], &records[begin + 21..]].concat();
    assert_eq!(compared(&late_gap), (None, (begin + 20) as u64), "too few cycles are left to find the state from");
    assert_eq!(compared(&records[touched..]), (None, 0));
}

#[test]
fn a_replay_that_begins_late_knows_how_the_tool_was_moved() {
    let (mut config, mut scenario) = (config(), scenario());
    (config.wrench.given_in, config.wrench.tool_mass_kg) = (GivenInName::Sensor, 2.0);
    scenario.sensor = Some(SensorSection {
        origin_m: [0.0; 3],
        rpy_rad: [0.0; 3],
        in_base_axes: false,
        reports_reaction: false,
        bias: [0.0; 6],
        tool_mass_kg: 2.0,
        tool_center_of_gravity_m: [0.0; 3],
        gravity_m_s2: config.wrench.gravity_m_s2,
        range: None,
    });
    // The tool never stands still.
    scenario.noise.joint_velocity_rad_s = 1e-3;
    // A filter that forgets in ten times the run-in.
    config.contact.wrench_time_constant_s.fill(0.2);
    scenario.wrench.time_constant_s.fill(0.2);
    let mut records = records_of(&config, &scenario, |_, _| false);
    let touched = records.iter().position(|record| record.command.active_axes != 0).expect("a contact");
    let begin = touched - RUN_IN as usize - 10;
    let late = (records.len() - begin) as u64 - RUN_IN;
    assert_eq!(replay_of(config.clone(), &records[begin..]), (None, late));
    // It is the record that tells.
    records[begin].tool_acceleration = [0.0; 6];
    assert_eq!(replay_of(config, &records[begin..]).1, 0);
}

#[test]
fn a_replay_that_begins_late_knows_how_the_joints_moved() {
    let (mut config, mut scenario) = (config(), scenario());
    // An estimate that forgets in a few run-ins, and is never steady.
    let loops = VelocityLoopDescription { damping: Some(vec![0.1, 0.0]), dead_time_s: None, report_lag_s: 0.1 };
    config.robot.velocity_loop = Some(loops.clone());
    scenario.robot.velocity_loop = Some(loops);
    scenario.noise.joint_velocity_rad_s = 1e-3;
    scenario.start.contact_time_s = Some(0.8);
    let mut records = records_of(&config, &scenario, |_, _| false);
    let touched = records.iter().position(|record| record.command.active_axes != 0).expect("a contact");
    let begin = touched - RUN_IN as usize - 10;
    let late = (records.len() - begin) as u64 - RUN_IN;
    assert_eq!(replay_of(config.clone(), &records[begin..]), (None, late));
    // It is the record that tells.
    records[begin].joint_velocity = [0.0; MAX_JOINTS];
    assert_eq!(replay_of(config, &records[begin..]).1, 0);
}

#[test]
fn a_replay_has_the_task_frame_that_there_was() {
    let mut config: Config = config::parse(SIX_JOINTS, "six-joint.toml").expect("valid");
    let mut scenario: Scenario = config::parse(SIX_JOINT_SCENARIO, "six-joint.toml").expect("valid");
    config.contact.admittance_axes = vec![false, false, true, false, false, false];
    // A sensor that turns with the tool, and a tool that turns from the start.
    (config.wrench.given_in, config.wrench.tool_mass_kg) = (GivenInName::Sensor, 0.5);
    scenario.sensor = Some(SensorSection {
        origin_m: [0.0; 3],
        rpy_rad: [0.0; 3],
        in_base_axes: false,
        reports_reaction: false,
        bias: [0.0; 6],
        tool_mass_kg: 0.5,
        tool_center_of_gravity_m: [0.0; 3],
        gravity_m_s2: config.wrench.gravity_m_s2,
        range: None,
    });
    scenario.motion[0].twist = vec![0.0, 0.0, -0.05, 0.3, 0.1, 0.0];
    for frame in [FrameName::Rpy, FrameName::Tool] {
        (config.task.frame, config.task.rpy_rad) = (frame, [0.2, 0.1, 0.0]);
        let records = records_of(&config, &scenario, |_, _| false);
        assert_eq!(replay_of(config.clone(), &records), (None, records.len() as u64), "{frame}");
        let touched = records.iter().position(|record| record.command.active_axes != 0).expect("a contact");
        let begin = touched - RUN_IN as usize - 10;
        let late = (records.len() - begin) as u64 - RUN_IN;
        assert_eq!(replay_of(config.clone(), &records[begin..]), (None, late), "{frame}, begun late");
        // Under another frame it is another answer.
        config.task.frame = FrameName::Base;
        assert!(replay_of(config.clone(), &records).0.is_some(), "{frame}");
    }
}

/// What a daemon would record of a free motion whose controller pauses for so long, in ns, before the
/// sample with this index.
fn paused(pause_ns: u64, at: usize) -> Vec<RecordSample> {
    let mut scenario = scenario();
    scenario.start.contact_time_s = Some(4.0);
    scenario.motion.iter_mut().for_each(|motion| (motion.duration_s, motion.twist) = (4.2, vec![0.0, -0.02]));
    let age_ns = (config().control.max_sample_age_s * 1e9) as u64;
    let mut cycle = cycle::build(&config()).expect("a known arm");
    let (mut command, mut records, mut last_ns) = (CommandSample::zeroed(), Vec::new(), None);
    let mut record = |kind: RecordKind, state: StateSample, now_ns: u64| {
        let now = Instant::from_nanoseconds(now_ns);
        let report = match kind {
            RecordKind::Silence => cycle.silence(now, &mut command),
            _ => cycle.answer(&state, now, &mut || false, &mut command),
        };
        command.sequence += 1;
        let sequence = records.len() as u64 + 1;
        let shell = RecordSample { sequence, now_ns, boot_id: 7, kind: kind.code(), state, ..RecordSample::zeroed() };
        let mut record = RecordSample { command: CommandSample { boot_id: 7, ..command }, ..shell };
        report.write(&mut record);
        cycle.write(&mut record);
        records.push(record);
    };
    for (index, unpaused) in records_of(&config(), &scenario, |_, _| false).iter().enumerate() {
        let mut state = unpaused.state;
        state.stamp_ns += if index < at { 0 } else { pause_ns };
        while let Some(silent_ns) = last_ns.map(|last| last + age_ns).filter(|silent| *silent < state.stamp_ns) {
            record(RecordKind::Silence, StateSample::zeroed(), silent_ns);
            last_ns = Some(silent_ns);
        }
        record(RecordKind::Sample, state, state.stamp_ns);
        last_ns = Some(state.stamp_ns);
    }
    records
}

#[test]
fn a_pause_before_or_after_the_first_record_is_no_difference() {
    let free = |record: &&RecordSample| record.command.mode == Mode::Free.code();
    for pause_ns in [2_000_000, 5_000_000, 9_000_000, 30_000_000, 400_000_000] {
        let records = paused(pause_ns, 500);
        assert_eq!(replay(&records).0, None, "{pause_ns} ns, from the first record on");
        for begin in [20, 33, 77, 101, 250, 333, 480, 510] {
            assert_eq!(replay(&records[begin..]).0, None, "{pause_ns} ns, begun at {begin}");
        }
        assert!(records.iter().filter(free).count() > 500, "{pause_ns} ns");
    }
}

#[test]
fn another_difference_after_a_late_beginning_is_one() {
    let mut records = paused(2_000_000, 500);
    records[700].command.velocity_offset[0] = 1e-9;
    assert_eq!(replay(&records[20..]).0, Some(701));
}
