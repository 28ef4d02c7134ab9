//! What a command says of the daemon's state.

use std::fmt;

use ipc_types::{CommandSample, Mode, Motion, StopReason};

/// What a command says of the daemon's state.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Said {
    /// Mode.
    pub mode: Mode,
    /// Offset or hold.
    pub motion: Motion,
    /// Stop reason, if there is one.
    pub reason: Option<StopReason>,
}

/// Free motion under control.
pub const FREE: Said = Said { mode: Mode::Free, motion: Motion::Offset, reason: None };
/// Contact under control.
pub const CONTACT: Said = Said { mode: Mode::Contact, motion: Motion::Offset, reason: None };

/// On the way to a low force.
pub const fn stopping(reason: StopReason) -> Said {
    Said { mode: Mode::Stopping, motion: Motion::Offset, reason: Some(reason) }
}

/// Held until a reset.
pub const fn stopped(reason: StopReason) -> Said {
    Said { mode: Mode::Stopped, motion: Motion::Hold, reason: Some(reason) }
}

/// Not controlling, because a person wants it so.
pub const fn withdrawn(reason: StopReason) -> Said {
    Said { mode: Mode::Idle, motion: Motion::Offset, reason: Some(reason) }
}

/// Held, because control is lost.
pub const fn idle(reason: StopReason) -> Said {
    Said { mode: Mode::Idle, motion: Motion::Hold, reason: Some(reason) }
}

impl Said {
    /// What this command says; `None` when a code is not of the contract.
    pub fn of(command: &CommandSample) -> Option<Self> {
        Some(Self {
            mode: Mode::from_code(command.mode)?,
            motion: Motion::from_code(command.motion)?,
            reason: match command.stop_reason {
                StopReason::NONE => None,
                code => Some(StopReason::from_code(code)?),
            },
        })
    }
}

impl fmt::Display for Said {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {}", self.mode.name(), self.motion.name())?;
        self.reason.map_or(Ok(()), |reason| write!(f, ", {reason}"))
    }
}

impl fmt::Debug for Said {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}
