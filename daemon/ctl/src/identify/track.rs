//! The arm's way through a recording: stretches of samples without a gap, with the commands that
//! were in force.

use std::collections::BTreeMap;

use admittance_runner::config::Config;
use ipc_types::{CommandSample, Motion, RecordKind, RecordSample, StateSample};

use super::arm::{Arm, Axes, Joints, Placed};
use crate::Exit;
use crate::recording::{Item, Recording};

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
    first_ns: u64,
    pub(super) time_s: Vec<f64>,
    pub(super) position: Vec<Joints>,
    pub(super) velocity: Vec<Joints>,
    pub(super) twist: Vec<Axes>,
    /// As the sample gives it; `None` where it must not be used.
    pub(super) wrench: Vec<Option<[f64; 6]>>,
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

    fn add(&mut self, record: &RecordSample, arm: &dyn Arm) {
        let state = &record.state;
        if self.time_s.is_empty() {
            self.first_ns = state.stamp_ns;
        }
        let time_s = self.since(state.stamp_ns);
        self.time_s.push(time_s);
        self.position.push(state.joint_position);
        self.velocity.push(state.joint_velocity);
        self.twist.push(state.twist_reference);
        let is_usable = state.wrench_valid == 1 && state.wrench.iter().all(|value| value.is_finite());
        self.wrench.push(is_usable.then_some(state.wrench));
        self.applied.push(state.applied_command_sequence);
        self.is_free.push(record.command.active_axes == 0);
        self.placed.push(arm.at(&state.joint_position));
        if record.command.state_stamp_ns == state.stamp_ns {
            self.commands.insert(record.command.sequence, played(&record.command, time_s));
        }
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
        for (applied, time_s) in self.applied.iter_mut().zip(&self.time_s) {
            let acts = |command: &Command| command.sample_s + delay_s < *time_s;
            *applied = self.commands.iter().rev().find(|(_, command)| acts(command)).map_or(0, |(number, _)| *number);
        }
    }
}

fn played(command: &CommandSample, sample_s: f64) -> Command {
    let length = command.plan_length as usize;
    Command {
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
    }
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
/// A message of it cannot be read.
pub(super) fn tracks(recording: &Recording, config: &Config, arm: &dyn Arm) -> Result<Vec<Track>, (Exit, String)> {
    let joints = config.robot.joint.len() as u32;
    let longest_ns = LONGEST_GAP_CYCLES * config.control.sampling_time_s * 1e9;
    let (mut tracks, mut track, mut last) = (Vec::new(), Track::default(), None::<StateSample>);
    for item in recording.items() {
        let Item::Record(record) = item? else { continue };
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
            track.add(&record, arm);
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
