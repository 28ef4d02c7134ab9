//! The arm's way through a recording: stretches of samples without a gap, with the commands that
//! were in force.

use std::collections::BTreeMap;
use std::path::Path;

use admittance_runner::config::{Config, WrenchSection, WrenchSourceName};
use ipc_types::{CommandSample, Fault, MAX_PLAN, Motion, RecordKind, RecordSample, StateSample};

use super::arm::{Arm, Axes, Joints, Placed};
use crate::recording::{Item, Recording};
use crate::{Exit, Outcome};

/// Samples further apart than this many cycles have something between them that nobody saw.
const LONGEST_GAP_CYCLES: f64 = 1.5;
/// A shorter stretch tells nothing.
const SHORTEST_S: f64 = 0.2;

/// A command as the motion controller plays it.
#[derive(Debug, Clone, Default)]
pub(super) struct Command {
    /// When the sample was measured that it answers, s.
    pub(super) sample_s: f64,
    /// Whether the joints hold.
    pub(super) holds: bool,
    /// Ends of the plan's steps after the command acts, s.
    pub(super) ends_s: Vec<f64>,
    /// The offset of each step, or the only one.
    pub(super) offsets: Vec<Axes>,
}

/// Samples in a row. Times are in s since the first.
#[derive(Default)]
pub(super) struct Track {
    boot_id: u64,
    first_ns: u64,
    pub(super) time_s: Vec<f64>,
    pub(super) position: Vec<Joints>,
    pub(super) velocity: Vec<Joints>,
    pub(super) twist: Vec<Axes>,
    /// As the sample gives it, or as it follows from motor torques; `None` where it must not be used.
    pub(super) wrench: Vec<Option<[f64; 6]>>,
    /// Samples whose wrench is at the end of the sensor's range.
    pub(super) saturated: usize,
    /// Sequence of the command in force at each sample.
    pub(super) applied: Vec<u64>,
    /// Whether the daemon took the arm for free.
    pub(super) is_free: Vec<bool>,
    pub(super) commands: BTreeMap<u64, Command>,
    pub(super) placed: Vec<Placed>,
}

impl Track {
    pub(super) fn len(&self) -> usize {
        self.time_s.len()
    }

    fn add(&mut self, record: &RecordSample, wrench: &WrenchSection, arm: &dyn Arm) -> Result<(), String> {
        let state = &record.state;
        if self.time_s.is_empty() {
            (self.boot_id, self.first_ns) = (state.boot_id, state.stamp_ns);
        }
        let time_s = self.since(state.stamp_ns);
        self.time_s.push(time_s);
        self.position.push(state.joint_position);
        self.velocity.push(state.joint_velocity);
        self.twist.push(state.twist_reference);
        let (given, is_usable) = match wrench.source {
            WrenchSourceName::Sample => (state.wrench, state.wrench_valid == 1),
            // What the daemon made of the torques.
            WrenchSourceName::MotorTorque => (record.wrench, record.fault == Fault::NONE),
        };
        let is_usable = is_usable && given.iter().all(|value| value.is_finite());
        // The daemon does not use such a sample either.
        let ends = wrench.saturation.as_ref();
        let is_saturated = ends.is_some_and(|ends| given.iter().zip(ends).any(|(value, end)| value.abs() >= *end));
        self.saturated += usize::from(is_usable && is_saturated);
        self.wrench.push((is_usable && !is_saturated).then_some(given));
        self.applied.push(state.applied_command_sequence);
        self.is_free.push(record.command.active_axes == 0);
        self.placed.push(arm.at(&state.joint_position));
        if record.command.state_stamp_ns == state.stamp_ns {
            self.commands.insert(record.command.sequence, played(&record.command, time_s)?);
        }
        Ok(())
    }

    /// Whether both have a sample in common.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        self.has_first_of(other) || other.has_first_of(self)
    }

    fn has_first_of(&self, other: &Self) -> bool {
        if self.boot_id != other.boot_id || other.first_ns < self.first_ns {
            return false;
        }
        let at_s = self.since(other.first_ns);
        let at = self.time_s.partition_point(|time_s| *time_s < at_s);
        // Stamps of simulated time begin anew in every run: what the arm did then is compared as well.
        self.time_s.get(at) == Some(&at_s)
            && self.position.get(at) == other.position.first()
            && self.velocity.get(at) == other.velocity.first()
    }

    fn since(&self, stamp_ns: u64) -> f64 {
        (stamp_ns - self.first_ns) as f64 * 1e-9
    }

    /// Where the motion controller does not say which command is in force: as the configured delay
    /// has it.
    fn suppose_applied(&mut self, delay_s: f64) {
        if self.applied.iter().any(|sequence| *sequence != 0) {
            return;
        }
        let mut commands: Vec<(f64, u64)> =
            self.commands.iter().map(|(number, command)| (command.sample_s, *number)).collect();
        commands.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut commands, mut newest) = (commands.into_iter().peekable(), 0);
        for (applied, time_s) in self.applied.iter_mut().zip(&self.time_s) {
            while let Some((_, number)) = commands.next_if(|(sample_s, _)| sample_s + delay_s < *time_s) {
                newest = newest.max(number);
            }
            *applied = newest;
        }
    }
}

/// A command, or what is wrong with it.
fn played(command: &CommandSample, sample_s: f64) -> Result<Command, String> {
    let length = command.plan_length as usize;
    let wrong =
        |what: String, accepted: &str| Err(format!("command {}: {what}: accepted {accepted}", command.sequence));
    if length > MAX_PLAN {
        return wrong(format!("plan_length = {length}"), &format!("are 0 to {MAX_PLAN}"));
    }
    let ends = &command.plan_end_ns[..length];
    if ends.first() == Some(&0) || ends.windows(2).any(|pair| pair[0] >= pair[1]) {
        return wrong(format!("plan_end_ns = {ends:?}"), "are ends above 0 that increase");
    }
    let mut offsets = command.planned_offset[..length].iter().chain([&command.velocity_offset]);
    if let Some(offset) = offsets.find(|offset| offset.iter().any(|part| !part.is_finite())) {
        return wrong(format!("an offset of {offset:?}"), "are finite numbers");
    }
    Ok(Command {
        sample_s,
        holds: command.motion == Motion::Hold.code(),
        ends_s: command.plan_end_ns[..length].iter().map(|end| *end as f64 * 1e-9).collect(),
        offsets: if length == 0 {
            vec![command.velocity_offset]
        } else {
            // The first step is velocity_offset.
            let later = command.planned_offset[1..length].iter().copied();
            std::iter::once(command.velocity_offset).chain(later).collect()
        },
    })
}

/// Where one stretch ends and the next begins.
fn follows(last: &StateSample, next: &StateSample, longest_ns: f64) -> bool {
    next.boot_id == last.boot_id
        && next.stamp_ns > last.stamp_ns
        && ((next.stamp_ns - last.stamp_ns) as f64) < longest_ns
}

/// The stretches of a recording in which the arm followed.
///
/// # Errors
/// A message of it cannot be read, or a command of it cannot be played.
pub(super) fn tracks(path: &Path, recording: &Recording, config: &Config, arm: &dyn Arm) -> Outcome<Vec<Track>> {
    let records = recording.items().filter_map(|item| match item {
        Ok(Item::Record(record)) => Some(Ok(record)),
        Ok(Item::Truth(_)) => None,
        Err(why) => Some(Err(why)),
    });
    of_records(records, config, arm, &|why| (Exit::DataError, format!("{}: {why}", path.display())))
}

/// The same of records; `refused` says whose they are.
///
/// # Errors
/// As [`tracks`].
pub(super) fn of_records(
    records: impl Iterator<Item = Outcome<Box<RecordSample>>>,
    config: &Config,
    arm: &dyn Arm,
    refused: &dyn Fn(String) -> (Exit, String),
) -> Outcome<Vec<Track>> {
    let joints = config.robot.joint.len() as u32;
    let longest_ns = LONGEST_GAP_CYCLES * config.control.sampling_time_s * 1e9;
    let (mut tracks, mut track, mut last) = (Vec::new(), Track::default(), None::<StateSample>);
    for record in records {
        let record = record?;
        let state = record.state;
        if record.kind != RecordKind::Sample.code() || last.is_some_and(|last| is_repeated(&last, &state)) {
            continue;
        }
        let numbers = state.joint_position.iter().chain(&state.joint_velocity).chain(&state.twist_reference);
        let is_usable =
            state.joint_count == joints && state.drives_enabled == 1 && numbers.into_iter().all(|v| v.is_finite());
        if !is_usable || last.is_some_and(|last| !follows(&last, &state, longest_ns)) {
            tracks.push(std::mem::take(&mut track));
        }
        last = is_usable.then_some(state);
        if is_usable {
            track.add(&record, &config.wrench, arm).map_err(refused)?;
        }
    }
    tracks.push(track);
    tracks.retain(|track| track.time_s.last().is_some_and(|end| *end > SHORTEST_S));
    tracks.iter_mut().for_each(|track| track.suppose_applied(config.control.command_delay_s));
    Ok(tracks)
}

fn is_repeated(last: &StateSample, state: &StateSample) -> bool {
    state.boot_id == last.boot_id && state.sequence == last.sequence
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command(length: u32, ends_ns: &[u64]) -> CommandSample {
        let mut command = CommandSample { sequence: 7, plan_length: length, ..CommandSample::zeroed() };
        command.plan_end_ns[..ends_ns.len()].copy_from_slice(ends_ns);
        command
    }

    #[test]
    fn a_plan_that_nobody_can_play_is_named() {
        assert!(played(&command(2, &[4, 8]), 0.0).is_ok());
        let mut not_finite = command(1, &[4]);
        not_finite.velocity_offset[2] = f64::NAN;
        for (command, said) in [
            (command(33, &[]), "command 7: plan_length = 33: accepted are 0 to 32"),
            (command(2, &[8, 8]), "command 7: plan_end_ns = [8, 8]"),
            (command(1, &[0]), "plan_end_ns = [0]"),
            (not_finite, "NaN"),
        ] {
            let why = played(&command, 0.0).expect_err("refused");
            assert!(why.contains(said), "{why}");
        }
    }

    #[test]
    fn the_newest_command_that_acts_is_supposed_to_be_in_force() {
        let of = |sample_s: f64| Command { sample_s, ..Command::default() };
        let mut track = Track {
            time_s: vec![0.0, 0.5, 1.5, 2.5, 9.0],
            applied: vec![0; 5],
            commands: [(3, of(0.0)), (5, of(1.0)), (4, of(2.0))].into(),
            ..Track::default()
        };
        track.suppose_applied(0.25);
        assert_eq!(track.applied, [0, 3, 5, 5, 5]);
    }
}
