//! Whether control may begin or go on.

use admittance_vocabulary::StopReason;

use super::Cause;

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
