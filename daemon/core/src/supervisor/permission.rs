//! Whether control may begin or go on.

use admittance_vocabulary::StopReason;

use super::{Cause, Mode, Supervisor};
use crate::intake::Accepted;

/// Of the last 100 samples so many may be missed, a third: the law, its verdicts and guards count on
/// one every T_s, and each one less is a cycle in which a touch is not seen.
const MOST_MISSED: u32 = 33;
/// Control that has ended for that does not begin again before there are fewer.
const FEW_MISSED: u32 = 10;

/// Whether a person lets the daemon be in control.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Permission {
    Given,
    /// Control ends, or does not begin: disabled, or for good on shutdown.
    Withdrawn(Ending),
}

/// Why permission is withdrawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// Until control is enabled again.
    Disabled,
    /// For good: the daemon ends.
    Shutdown,
}

impl Ending {
    /// The reason on the wire.
    pub fn reason(self) -> StopReason {
        match self {
            Self::Disabled => StopReason::Disabled,
            Self::Shutdown => StopReason::Shutdown,
        }
    }

    pub(super) fn cause(self) -> Cause {
        match self {
            Self::Disabled => Cause::Disabled,
            Self::Shutdown => Cause::Shutdown,
        }
    }
}

impl<const D: usize> Supervisor<D> {
    /// What keeps control from beginning.
    pub(super) fn objection<const N: usize>(&self, sample: &Accepted<N, D>) -> Option<Cause> {
        match self.permission {
            Permission::Withdrawn(ending) => Some(ending.cause()),
            Permission::Given if !sample.drives_enabled => Some(Cause::DrivesDisabled),
            Permission::Given => self.untimely(sample),
        }
    }

    /// What keeps control from going on; a request waits while the offset `is_ramping` to zero.
    pub(super) fn end_of_control<const N: usize>(&self, sample: &Accepted<N, D>, is_ramping: bool) -> Option<Cause> {
        let untimely = self.untimely(sample);
        match self.permission {
            Permission::Withdrawn(_) if is_ramping && untimely.is_none() => None,
            Permission::Withdrawn(ending) => Some(ending.cause()),
            Permission::Given => untimely,
        }
    }

    /// What is wrong with when samples come. In contact the law has acted on the sample before this
    /// one for too long where more were missed than its plan may bridge; in free motion it has not
    /// acted at all.
    fn untimely<const N: usize>(&self, sample: &Accepted<N, D>) -> Option<Cause> {
        let (arrival, timing) = (&sample.arrival, &self.settings.timing);
        let is_too_old = arrival.missed > 0 && arrival.age > timing.bridge() + timing.sampling_time;
        let most = match self.mode {
            Mode::Idle(Some(StopReason::SamplesMissed)) => FEW_MISSED,
            _ => MOST_MISSED,
        };
        if arrival.missed_lately > most || (is_too_old && matches!(self.mode, Mode::Contact(_))) {
            return Some(Cause::SamplesMissed);
        }
        sample.is_rate_wrong.then_some(Cause::RateMismatch)
    }
}
