//! Faults of the motion controller that a scenario scripts: what reaches the daemon while each one lasts.

use ipc_types::StateSample;

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultKind {
    /// State samples are not published; the plant goes on.
    Drop,
    /// The last state sample is published again and again, with its old stamp and sequence.
    Freeze,
    /// The first sample is published in place of the last one, with its own stamp and sequence, and none in between: over k + 1
    /// samples, one that is late by k periods.
    Late,
    /// The wrench is not a number although the sample calls it valid.
    NanWrench,
    /// The wrench is flagged as not valid, and zero.
    WrenchInvalid,
    /// The drives are disabled: the joints are braked, the command does not advance, and the sample says so.
    DrivesDisabled,
    /// The sample claims one joint more than the robot has.
    JointCount,
    /// The plant sees no commands.
    CommandLoss,
}

impl FaultKind {
    /// Every kind with its name in a scenario.
    pub const ALL: [(Self, &'static str); 8] = [
        (Self::Drop, "drop"),
        (Self::Freeze, "freeze"),
        (Self::Late, "late"),
        (Self::NanWrench, "nan_wrench"),
        (Self::WrenchInvalid, "wrench_invalid"),
        (Self::DrivesDisabled, "drives_disabled"),
        (Self::JointCount, "joint_count"),
        (Self::CommandLoss, "command_loss"),
    ];

    /// The kind of that name in a scenario.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, known)| *known == name).map(|(kind, _)| *kind)
    }
}

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
        let is_held = |fault: &Fault| fault.kind == FaultKind::Late && (fault.first..fault.end - 1).contains(&index);
        !self.active(FaultKind::Drop, index) && !self.0.iter().any(is_held)
    }

    /// Whether an older sample is shown at this index.
    pub fn repeats(&self, index: i64) -> bool {
        let is_late = |fault: &Fault| fault.kind == FaultKind::Late && (fault.first + 1..fault.end).contains(&index);
        self.active(FaultKind::Freeze, index) || self.0.iter().any(is_late)
    }

    /// Falsifies what the sample with this index says; whether and when it is published, and what becomes of commands, are not
    /// its matter.
    pub fn falsify(&self, sample: &mut StateSample, index: i64) {
        for fault in self.0.iter().filter(|fault| (fault.first..fault.end).contains(&index)) {
            match fault.kind {
                FaultKind::NanWrench => sample.wrench.fill(f64::NAN),
                FaultKind::WrenchInvalid => {
                    sample.wrench_valid = 0;
                    sample.wrench.fill(0.0);
                }
                FaultKind::DrivesDisabled => sample.drives_enabled = 0,
                FaultKind::JointCount => sample.joint_count += 1,
                FaultKind::Drop | FaultKind::Freeze | FaultKind::Late | FaultKind::CommandLoss => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
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
            faults.falsify(&mut sample, index);
            (sample.wrench[1].is_nan(), sample.joint_count, sample.drives_enabled)
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
}
