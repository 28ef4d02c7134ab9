//! What no command of the daemon may be, whatever it was given: what soak and hostile suite look for.

use std::collections::HashSet;

use admittance_runner::config::Config;
use ipc_types::{CommandSample, MAX_PLAN, Mode, Motion, Side, Source, StopReason, TASK_AXES, Verdict};
use serde::{Deserialize, Serialize};

/// Part of a limit by which rounding may exceed it.
const ROUNDING: f64 = 1e-9;
/// Longest time in ns after its publication for which a command may say that it is valid.
const LONGEST_VALIDITY_NS: u64 = 2_000_000_000;

/// What must not be seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Invariant {
    /// A stopped arm is held, or moves out of the surface as the motion controller commands.
    StoppedHolds,
    /// After a feasible verdict the true force stays below the limit.
    ForceBelowLimit,
    /// Sequences grow, and a writer that has been replaced does not come back.
    SequenceGrows,
    /// Whoever stops says why.
    StopIsReported,
    /// Every number is finite, every code known, every offset within its limit, and nothing is valid
    /// for ever.
    AnswerIsSound,
}

/// What was broken, and how.
pub(crate) type Flaw = (Invariant, String);

/// What a configuration bounds.
#[derive(Debug, Clone)]
pub(crate) struct Bounds {
    joints: usize,
    /// Largest offset of each task axis, m/s or rad/s.
    offset: [f64; TASK_AXES],
    /// Outward normals that may be in force; where there are none, directions are not judged.
    normals: Vec<[f64; 3]>,
}

impl Bounds {
    pub(crate) fn of(config: &Config) -> Self {
        let mut offset = [0.0; TASK_AXES];
        offset.iter_mut().zip(&config.limits.velocity_offset).for_each(|(bound, limit)| *bound = *limit);
        Self { joints: config.robot.joint.len(), offset, normals: vec![config.environment.surface_normal] }
    }

    /// Allows what `other` does, too: while it is not known which of them is in force.
    pub(crate) fn or(mut self, other: &Self) -> Self {
        self.offset.iter_mut().zip(&other.offset).for_each(|(bound, other)| *bound = bound.max(*other));
        self.normals.extend_from_slice(&other.normals);
        self
    }

    /// The same, for a surface that requests may turn.
    pub(crate) fn without_normal(self) -> Self {
        Self { normals: Vec::new(), ..self }
    }

    /// Everything that is wrong with a command by itself.
    pub(crate) fn flaws(&self, command: &CommandSample) -> Vec<Flaw> {
        let mut flaws = Vec::new();
        let mut unsound = |what: String| flaws.push((Invariant::AnswerIsSound, what));
        let Some(motion) = self.codes(command, &mut unsound) else { return flaws };
        self.numbers(command, motion, &mut unsound);
        let is = |mode: Mode| command.mode == mode.code();
        if is(Mode::Stopped) && motion != Motion::Hold {
            let outward = |normal: &[f64; 3]| normal.iter().zip(&command.twist_command).map(|(n, v)| n * v).sum();
            let fastest = self.normals.iter().map(outward).fold(f64::NEG_INFINITY, f64::max);
            let is_inward = !self.normals.is_empty() && fastest < 0.0;
            if command.source != Source::Retreat.code() || is_inward {
                let what =
                    format!("Stopped with Offset from source {}, {fastest:.4} m/s out of the surface", command.source);
                flaws.push((Invariant::StoppedHolds, what));
            }
        }
        if (is(Mode::Stopped) || is(Mode::Stopping)) && command.stop_reason == StopReason::NONE {
            flaws.push((Invariant::StopIsReported, format!("mode {} without a stop reason", command.mode)));
        }
        flaws
    }

    /// Looks at the codes; the motion, if it is one.
    fn codes(&self, command: &CommandSample, unsound: &mut impl FnMut(String)) -> Option<Motion> {
        let known = [
            ("mode", command.mode, Mode::from_code(command.mode).is_some()),
            ("source", command.source, Source::from_code(command.source).is_some()),
            ("verdict", command.verdict, Verdict::from_code(command.verdict).is_some()),
            ("verdict_side", command.verdict_side, is_none_or(command.verdict_side, Side::from_code)),
            ("stop_reason", command.stop_reason, is_none_or(command.stop_reason, StopReason::from_code)),
            ("joint_count", command.joint_count, command.joint_count as usize == self.joints),
            ("active_axes", command.active_axes, command.active_axes < 1 << TASK_AXES),
            ("verdict_axis", command.verdict_axis, (command.verdict_axis as usize) < TASK_AXES),
            ("plan_length", command.plan_length, command.plan_length as usize <= MAX_PLAN),
        ];
        for (field, value, _) in known.iter().filter(|(_, _, is_known)| !is_known) {
            unsound(format!("{field} = {value}"));
        }
        let motion = Motion::from_code(command.motion);
        if motion.is_none() {
            unsound(format!("motion = {}", command.motion));
        }
        motion.filter(|_| known.iter().all(|(_, _, is_known)| *is_known))
    }

    fn numbers(&self, command: &CommandSample, motion: Motion, unsound: &mut impl FnMut(String)) {
        let plan = &command.planned_offset[..command.plan_length as usize];
        let arrays: [(&str, &[f64]); 4] = [
            ("joint_velocity_offset", &command.joint_velocity_offset),
            ("twist_command", &command.twist_command),
            ("verdict_time_s", std::slice::from_ref(&command.verdict_time_s)),
            ("verdict_margin", std::slice::from_ref(&command.verdict_margin)),
        ];
        for (field, values) in arrays.iter().filter(|(_, values)| values.iter().any(|value| !value.is_finite())) {
            unsound(format!("{field} = {values:?}"));
        }
        if !(0.0..=1.0).contains(&command.verdict_share) {
            unsound(format!("verdict_share = {}", command.verdict_share));
        }
        for offset in std::iter::once(&command.velocity_offset).chain(plan) {
            // Written so that NaN is beyond it.
            let is_within = |(value, bound): (&f64, &f64)| value.abs() <= bound * (1.0 + ROUNDING);
            if !offset.iter().zip(&self.offset).all(is_within) {
                unsound(format!("offset {offset:?}, limit {:?}", self.offset));
                break;
            }
        }
        if motion == Motion::Hold && command.twist_command.iter().any(|value| *value != 0.0) {
            unsound(format!("Hold with twist_command = {:?}", command.twist_command));
        }
        if command.plan_end_ns[..plan.len()].windows(2).any(|ends| ends[0] >= ends[1]) {
            unsound(format!("plan_end_ns = {:?}", &command.plan_end_ns[..plan.len()]));
        }
        if command.valid_until_ns > command.stamp_ns.saturating_add(LONGEST_VALIDITY_NS) {
            unsound(format!("valid until {} ns, published at {} ns", command.valid_until_ns, command.stamp_ns));
        }
    }
}

fn is_none_or<T>(code: u32, from_code: impl Fn(u32) -> Option<T>) -> bool {
    code == 0 || from_code(code).is_some()
}

/// A sequence that restarts with its writer.
#[derive(Debug, Default)]
pub(crate) struct Sequence {
    pub(crate) boot_id: u64,
    last: u64,
    gone: HashSet<u64>,
}

impl Sequence {
    /// Why this number cannot come next.
    pub(crate) fn check(&mut self, boot_id: u64, sequence: u64) -> Option<String> {
        if boot_id != self.boot_id {
            let (before, last) =
                (std::mem::replace(&mut self.boot_id, boot_id), std::mem::replace(&mut self.last, sequence));
            self.gone.insert(before);
            return self.gone.contains(&boot_id).then(|| format!("{boot_id:#x} is back, after {before:#x} at {last}"));
        }
        let last = std::mem::replace(&mut self.last, sequence);
        (sequence <= last).then(|| format!("{sequence} after {last}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use admittancectl::demo::CONTROLLERS;

    fn bounds() -> Bounds {
        let config = admittance_host::config::parse(CONTROLLERS[3].config, "daemon.toml").expect("shipped");
        Bounds { normals: vec![[0.0, 1.0, 0.0]], ..Bounds::of(&config) }
    }

    fn held() -> CommandSample {
        CommandSample {
            joint_count: 2,
            mode: Mode::Stopped.code(),
            motion: Motion::Hold.code(),
            stop_reason: StopReason::Infeasible.code(),
            stamp_ns: 1_000,
            ..CommandSample::zeroed()
        }
    }

    #[test]
    fn a_retreat_is_no_push_and_a_push_is_none() {
        assert_eq!(bounds().flaws(&held()), []);
        let retreat = CommandSample {
            motion: Motion::Offset.code(),
            source: Source::Retreat.code(),
            twist_command: [0.0, 0.05, 0.0, 0.0, 0.0, 0.0],
            ..held()
        };
        assert_eq!(bounds().flaws(&retreat), []);
        let push = CommandSample { twist_command: [0.0, -0.05, 0.0, 0.0, 0.0, 0.0], ..retreat };
        assert_eq!(bounds().flaws(&push)[0].0, Invariant::StoppedHolds);
        let turned = Bounds { normals: vec![[0.0, -1.0, 0.0]], ..bounds() };
        assert_eq!(bounds().or(&turned).flaws(&push), []);
        assert_eq!(bounds().without_normal().flaws(&push), []);
        let silent = CommandSample { stop_reason: StopReason::NONE, ..held() };
        assert_eq!(bounds().flaws(&silent)[0].0, Invariant::StopIsReported);
    }

    #[test]
    fn what_is_not_sound_is_named() {
        let free = CommandSample { mode: Mode::Free.code(), motion: Motion::Offset.code(), stop_reason: 0, ..held() };
        assert_eq!(bounds().flaws(&free), []);
        let with = |change: &dyn Fn(&mut CommandSample)| {
            let mut command = free;
            change(&mut command);
            command
        };
        let unsound: [(&str, CommandSample); 12] = [
            ("offset", with(&|command| command.velocity_offset[1] = f64::NAN)),
            ("offset", with(&|command| command.velocity_offset[0] = 10.001)),
            // An axis that the arm does not have.
            ("offset", with(&|command| command.velocity_offset[2] = 0.001)),
            ("offset", with(&|command| (command.plan_length, command.planned_offset[0][1]) = (1, -11.0))),
            ("plan_end_ns", with(&|command| command.plan_length = 2)),
            ("plan_length", with(&|command| command.plan_length = 33)),
            ("twist_command", with(&|command| command.twist_command[0] = f64::INFINITY)),
            ("joint_velocity_offset", with(&|command| command.joint_velocity_offset[0] = f64::NAN)),
            ("motion", with(&|command| command.motion = 7)),
            ("mode", with(&|command| command.mode = 7)),
            ("valid until", with(&|command| command.valid_until_ns = u64::MAX)),
            ("Hold with", with(&|command| (command.motion, command.twist_command[0]) = (Motion::Hold.code(), 0.1))),
        ];
        for (field, command) in unsound {
            let flaws = bounds().flaws(&command);
            assert!(flaws.iter().all(|(invariant, _)| *invariant == Invariant::AnswerIsSound), "{flaws:?}");
            assert!(flaws.iter().any(|(_, what)| what.starts_with(field)), "{field}: {flaws:?}");
        }
    }

    #[test]
    fn a_sequence_grows_until_its_writer_is_another_one() {
        let mut sequence = Sequence::default();
        assert_eq!([sequence.check(1, 5), sequence.check(1, 6), sequence.check(2, 1)], [None, None, None]);
        assert!(sequence.check(2, 1).is_some_and(|why| why == "1 after 1"));
        assert!(sequence.check(1, 7).is_some_and(|why| why.contains("is back")));
    }
}
