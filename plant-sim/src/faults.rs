//! Faults of the motion controller that a scenario scripts: what reaches the daemon while each one
//! lasts.

use admittance_host::config_enum;
use ipc_types::StateSample;

config_enum! {
    /// What goes wrong.
    pub enum FaultKind {
        /// State samples are not published; the plant goes on.
        Drop = "drop",
        /// The last state sample is published again and again, with its old stamp and sequence.
        Freeze = "freeze",
        /// The first sample is published in place of the last one, with its own stamp and sequence,
        /// and none in between: over k + 1 samples, one that is late by k periods.
        Late = "late",
        /// Of thirteen state samples twelve are not published; the sequence goes on.
        Sparse = "sparse",
        /// State samples are published without a notification.
        Unnotified = "unnotified",
        /// Each cycle lasts 5 ms longer than it should; no sample is lost.
        Overrun = "overrun",
        /// The stamp of the first sample is one cycle late; the next ones are on schedule again.
        LateStamp = "late_stamp",
        /// The sequence is left at 0.
        Unnumbered = "unnumbered",
        /// The sequence jumps ahead by a million at the first sample, and goes on from there.
        SequenceJump = "sequence_jump",
        /// The stamp is a second old; the sequence goes on.
        Stale = "stale",
        /// The stamp is a second ahead; the sequence goes on.
        FromFuture = "from_future",
        /// The sequence counts down.
        OutOfOrder = "out_of_order",
        /// The second joint is 0.1 rad from where it is.
        PositionJump = "position_jump",
        /// The second joint position is not a number.
        NanJointPosition = "nan_joint_position",
        /// The second joint velocity is not a number.
        NanJointVelocity = "nan_joint_velocity",
        /// The second commanded joint position is not a number.
        NanJointPositionReference = "nan_joint_position_reference",
        /// The commanded TCP velocity on y is not a number.
        NanTwistReference = "nan_twist_reference",
        /// The wrench on y is not a number although the sample calls it valid.
        NanWrench = "nan_wrench",
        /// The second joint position is infinite.
        InfJointPosition = "inf_joint_position",
        /// The second joint velocity is infinite.
        InfJointVelocity = "inf_joint_velocity",
        /// The second commanded joint position is infinite.
        InfJointPositionReference = "inf_joint_position_reference",
        /// The commanded TCP velocity on y is minus infinite.
        InfTwistReference = "inf_twist_reference",
        /// The wrench on y is minus infinite although the sample calls it valid.
        InfWrench = "inf_wrench",
        /// The wrench is flagged as not valid, and zero.
        WrenchInvalid = "wrench_invalid",
        /// The drives are disabled: the joints are braked, the command does not advance, and the
        /// sample says so.
        DrivesDisabled = "drives_disabled",
        /// The sample claims one joint more than the robot has.
        JointCount = "joint_count",
        /// The sample says that the joints do not follow what the daemon resolves, though they do.
        NotFollowing = "not_following",
        /// The plant sees no commands.
        CommandLoss = "command_loss",
    }
}

/// Of so many samples in a row one is published.
const SPARSE: i64 = 13;
/// By how much a cycle is longer, ns.
const OVERRUN_NS: u64 = 5_000_000;
/// By how much the sequence jumps.
const SEQUENCE_JUMP: u64 = 1_000_000;
/// By how much a stamp is off, ns.
const OFF_NS: u64 = 1_000_000_000;
/// By how much a joint position is off, rad.
const JUMP_RAD: f64 = 0.1;
/// The array element that is falsified: not the first, since a check might look at that one only.
const SPOILED: usize = 1;

/// One scripted fault, in samples counted from the start of the motion (negative: before it).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// What goes wrong.
    pub kind: FaultKind,
    /// First sample with the fault.
    pub first: i64,
    /// First sample without it again.
    pub end: i64,
}

/// The faults of a scenario; several may act at once.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Faults(Vec<Fault>);

impl Faults {
    /// These faults, in any order.
    pub fn new(faults: Vec<Fault>) -> Self {
        Self(faults)
    }

    /// Whether a fault of this kind acts at the sample with this index.
    pub fn active(&self, kind: FaultKind, index: i64) -> bool {
        self.0.iter().any(|fault| fault.kind == kind && (fault.first..fault.end).contains(&index))
    }

    /// Whether the sample with this index is published at all.
    pub fn publishes(&self, index: i64) -> bool {
        let is_held = |fault: &Fault| match fault.kind {
            FaultKind::Late => (fault.first..fault.end - 1).contains(&index),
            FaultKind::Sparse => (fault.first..fault.end).contains(&index) && (index - fault.first) % SPARSE != 0,
            _ => false,
        };
        !self.active(FaultKind::Drop, index) && !self.0.iter().any(is_held)
    }

    /// How much longer the cycle lasts that begins with the sample with this index, ns.
    pub fn overrun_ns(&self, index: i64) -> u64 {
        if self.active(FaultKind::Overrun, index) { OVERRUN_NS } else { 0 }
    }

    /// By how much the sequence of the sample with this index is ahead of the one before it.
    pub fn sequence_step(&self, index: i64) -> u64 {
        let jumps = |fault: &&Fault| fault.kind == FaultKind::SequenceJump && fault.first == index;
        1 + SEQUENCE_JUMP * self.0.iter().filter(jumps).count() as u64
    }

    /// Whether an older sample is shown at this index.
    pub fn repeats(&self, index: i64) -> bool {
        let is_late = |fault: &Fault| fault.kind == FaultKind::Late && (fault.first + 1..fault.end).contains(&index);
        self.active(FaultKind::Freeze, index) || self.0.iter().any(is_late)
    }

    /// Falsifies the sample with this index, of a controller with this cycle; whether and when it is published, and what happens to
    /// commands, is handled elsewhere.
    pub fn falsify(&self, sample: &mut StateSample, index: i64, sampling_time_ns: u64) {
        for fault in self.0.iter().filter(|fault| (fault.first..fault.end).contains(&index)) {
            match fault.kind {
                FaultKind::LateStamp if index == fault.first => sample.stamp_ns += sampling_time_ns,
                FaultKind::Unnumbered => sample.sequence = 0,
                FaultKind::Stale => sample.stamp_ns = sample.stamp_ns.saturating_sub(OFF_NS),
                FaultKind::FromFuture => sample.stamp_ns = sample.stamp_ns.saturating_add(OFF_NS),
                FaultKind::OutOfOrder => {
                    let spoiled = index.abs_diff(fault.first) + 1;
                    sample.sequence = sample.sequence.saturating_sub(2 * spoiled).max(1);
                }
                FaultKind::PositionJump => sample.joint_position[SPOILED] += JUMP_RAD,
                FaultKind::NanJointPosition => sample.joint_position[SPOILED] = f64::NAN,
                FaultKind::NanJointVelocity => sample.joint_velocity[SPOILED] = f64::NAN,
                FaultKind::NanJointPositionReference => sample.joint_position_reference[SPOILED] = f64::NAN,
                FaultKind::NanTwistReference => sample.twist_reference[SPOILED] = f64::NAN,
                FaultKind::NanWrench => sample.wrench[SPOILED] = f64::NAN,
                FaultKind::InfJointPosition => sample.joint_position[SPOILED] = f64::INFINITY,
                FaultKind::InfJointVelocity => sample.joint_velocity[SPOILED] = f64::INFINITY,
                FaultKind::InfJointPositionReference => sample.joint_position_reference[SPOILED] = f64::INFINITY,
                FaultKind::InfTwistReference => sample.twist_reference[SPOILED] = f64::NEG_INFINITY,
                FaultKind::InfWrench => sample.wrench[SPOILED] = f64::NEG_INFINITY,
                FaultKind::WrenchInvalid => {
                    sample.wrench_valid = 0;
                    sample.wrench.fill(0.0);
                    sample.torque_valid = 0;
                    sample.joint_torque.fill(0.0);
                }
                FaultKind::DrivesDisabled => sample.drives_enabled = 0,
                FaultKind::JointCount => sample.joint_count += 1,
                FaultKind::NotFollowing => sample.follows_joint_velocity = 0,
                FaultKind::Drop | FaultKind::Freeze | FaultKind::Late | FaultKind::Sparse | FaultKind::LateStamp => {}
                FaultKind::Unnotified | FaultKind::Overrun | FaultKind::SequenceJump | FaultKind::CommandLoss => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::layout::WireType;

    use super::*;

    #[test]
    fn faults_combine_and_end() {
        let fault = |kind, first, end| Fault { kind, first, end };
        let faults = Faults::new(vec![
            fault(FaultKind::NanWrench, 3, 6),
            fault(FaultKind::JointCount, 5, 7),
            fault(FaultKind::DrivesDisabled, -2, 0),
        ]);
        let at = |index| {
            let mut sample =
                StateSample { joint_count: 2, wrench_valid: 1, drives_enabled: 1, ..StateSample::zeroed() };
            faults.falsify(&mut sample, index, 4_000_000);
            (sample.wrench[SPOILED].is_nan(), sample.joint_count, sample.drives_enabled)
        };
        assert_eq!(at(-3), (false, 2, 1));
        assert_eq!(at(-2), (false, 2, 0));
        assert_eq!(at(0), (false, 2, 1));
        assert_eq!(at(4), (true, 2, 1));
        assert_eq!(at(5), (true, 3, 1));
        assert_eq!(at(6), (false, 3, 1));
        assert!(faults.active(FaultKind::NanWrench, 3) && !faults.active(FaultKind::Drop, 3));
    }

    #[test]
    fn a_late_sample_takes_the_place_of_the_last_one() {
        let faults = Faults::new(vec![Fault { kind: FaultKind::Late, first: 4, end: 7 }]);
        let seen: Vec<(bool, bool)> = (3..8).map(|index| (faults.publishes(index), faults.repeats(index))).collect();
        assert_eq!(seen, [(true, false), (false, false), (false, true), (true, true), (true, false)]);
    }

    #[test]
    fn one_of_thirteen_is_published_and_a_sequence_jumps_once() {
        let [sparse, jump, overrun] = [FaultKind::Sparse, FaultKind::SequenceJump, FaultKind::Overrun]
            .map(|kind| Faults::new(vec![Fault { kind, first: 4, end: 40 }]));
        let published: Vec<i64> = (3..42).filter(|index| sparse.publishes(*index)).collect();
        assert_eq!(published, [3, 4, 17, 30, 40, 41]);
        assert_eq!([3, 4, 5].map(|index| jump.sequence_step(index)), [1, 1_000_001, 1]);
        assert_eq!([3, 4, 39, 40].map(|index| overrun.overrun_ns(index)), [0, 5_000_000, 5_000_000, 0]);
    }

    #[test]
    fn one_stamp_is_late_by_a_cycle() {
        let faults = Faults::new(vec![Fault { kind: FaultKind::LateStamp, first: 4, end: 7 }]);
        let stamp = |index| {
            let mut sample = StateSample { stamp_ns: 100, ..StateSample::zeroed() };
            faults.falsify(&mut sample, index, 40);
            sample.stamp_ns
        };
        assert_eq!([3, 4, 5, 6].map(stamp), [100, 140, 100, 100]);
    }

    #[test]
    fn each_kind_spoils_its_own_field_and_nothing_else() {
        let sound = StateSample {
            sequence: 10,
            stamp_ns: 5_000_000_000,
            joint_count: 2,
            wrench_valid: 1,
            drives_enabled: 1,
            follows_joint_velocity: 1,
            wrench: [1.0; 6],
            ..StateSample::zeroed()
        };
        for kind in FaultKind::ALL {
            let mut sample = sound;
            Faults::new(vec![Fault { kind: *kind, first: 0, end: 1 }]).falsify(&mut sample, 0, 4_000_000);
            let (json, before) = (sample.to_json(), sound.to_json());
            let fields = json.as_object().expect("an object");
            let spoiled: Vec<&str> = fields
                .iter()
                .filter(|(field, value)| before[field.as_str()] != **value)
                .map(|(f, _)| f.as_str())
                .collect();
            let expected: &[&str] = match kind.name() {
                "drop" | "freeze" | "late" | "sparse" | "unnotified" | "overrun" | "sequence_jump" | "command_loss" => {
                    &[]
                }
                "unnumbered" => &["sequence"],
                "stale" | "from_future" | "late_stamp" => &["stamp_ns"],
                "out_of_order" => &["sequence"],
                "position_jump" => &["joint_position"],
                "wrench_invalid" => &["wrench", "wrench_valid"],
                "drives_disabled" => &["drives_enabled"],
                "joint_count" => &["joint_count"],
                "not_following" => &["follows_joint_velocity"],
                other => &[other.split_once('_').expect("nan_ or inf_ and the field").1],
            };
            let mut spoiled = spoiled;
            spoiled.sort_unstable();
            assert_eq!(spoiled, expected, "{kind}");
        }
    }
}
