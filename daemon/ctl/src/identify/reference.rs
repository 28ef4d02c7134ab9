//! The velocity references that the joints were given: J⁻¹ of the commanded twist and of the offset
//! that was in force, piece by piece.

use nalgebra::SVector;

use super::arm::{Axes, Joints};
use super::track::{Command, Track};

/// References by the instant (s) from which each holds.
pub(super) struct References {
    pub(super) from_s: Vec<f64>,
    pub(super) value: Vec<Joints>,
}

/// What the joints of a track were given, where commands act `delay_s` after their sample. Which
/// command is in force at a sample is recorded; when within the cycle before it began is not.
pub(super) fn references(track: &Track, delay_s: f64) -> References {
    let mut references = References { from_s: Vec::new(), value: Vec::new() };
    for sample in 0..track.len() {
        let start_s = track.time_s[sample];
        let end_s = track.time_s.get(sample + 1).copied().unwrap_or(f64::INFINITY);
        let next = track.applied.get(sample + 1).and_then(|number| track.commands.get(number));
        let now = track.commands.get(&track.applied[sample]);
        let changes = track.applied.get(sample + 1).is_some_and(|number| *number != track.applied[sample]);
        let change_s = match next {
            Some(next) if changes => (next.sample_s + delay_s).clamp(start_s, end_s),
            _ => end_s,
        };
        for (command, from_s, until_s) in [(now, start_s, change_s), (next, change_s, end_s)] {
            let mut at_s = from_s;
            while at_s < until_s {
                let (twist, next_s) = twist_of(track, sample, command, at_s, delay_s);
                references.from_s.push(at_s);
                references.value.push(joint_velocity(track, sample, at_s, &twist));
                at_s = next_s;
            }
        }
    }
    references
}

/// The twist that is followed from an instant on, and until when.
fn twist_of(track: &Track, sample: usize, command: Option<&Command>, at_s: f64, delay_s: f64) -> (Axes, f64) {
    let Some(command) = command else { return (track.twist[sample], f64::INFINITY) };
    if command.holds {
        return ([0.0; 6], f64::INFINITY);
    }
    let acts_s = command.sample_s + delay_s;
    // What ends within a picosecond has ended.
    let step = command.ends_s.partition_point(|end| acts_s + end <= at_s + 1e-12);
    let offset = command.offsets[step.min(command.offsets.len() - 1)];
    let twist = std::array::from_fn(|axis| track.twist[sample][axis] + offset[axis]);
    let next_s = if step + 1 < command.ends_s.len() { acts_s + command.ends_s[step] } else { f64::INFINITY };
    (twist, next_s)
}

/// J⁻¹ of a twist at an instant after a sample: between samples J⁻¹ is a straight line.
fn joint_velocity(track: &Track, sample: usize, at_s: f64, twist: &Axes) -> Joints {
    let twist = SVector::<f64, 6>::from_column_slice(twist);
    let here = track.placed[sample].inverse * twist;
    let Some(next) = track.placed.get(sample + 1).filter(|_| at_s > track.time_s[sample]) else { return here.into() };
    let share = (at_s - track.time_s[sample]) / (track.time_s[sample + 1] - track.time_s[sample]);
    (here + (next.inverse * twist - here) * share).into()
}

/// Whether each sample is later than any offset by at least this long: what it shows does not depend
/// on when commands act.
pub(super) fn without_offset(track: &Track, rest_s: f64) -> Vec<bool> {
    let mut last_s = f64::NEG_INFINITY;
    let is_quiet = |sample: usize| {
        let command = track.commands.get(&track.applied[sample]);
        command.is_none_or(|command| !command.holds && command.offsets.iter().flatten().all(|part| *part == 0.0))
    };
    (0..track.len())
        .map(|sample| {
            if !is_quiet(sample) {
                last_s = track.time_s[sample];
            }
            track.time_s[sample] - last_s > rest_s
        })
        .collect()
}

/// Between which delays (s) the recorded commands in force lie; `None` where no sample tells.
pub(super) fn delay_bracket(tracks: &[Track]) -> Option<(f64, f64)> {
    let (mut least, mut most) = (Vec::new(), Vec::new());
    for track in tracks {
        for sample in 1..track.len() {
            let number = track.applied[sample];
            let Some(command) = track.commands.get(&number).filter(|_| number != track.applied[sample - 1]) else {
                continue;
            };
            least.push((track.time_s[sample - 1] - command.sample_s).max(0.0));
            most.push(track.time_s[sample] - command.sample_s);
        }
    }
    // A late command or two do not count.
    let middle = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    middle(least).zip(middle(most))
}
