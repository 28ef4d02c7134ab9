//! The modes, Idle → Free → Contact → Stopping → Stopped, each with what it must remember.

use admittance_vocabulary::{ModeName, StopReason};

use super::contact_memory::{ContactMemory, Return};
use super::guards::Pull;
use crate::quantities::Instant;
use crate::robot::Singular;

/// What the controller is doing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Mode<const D: usize> {
    /// Not in control: no valid sample yet, or for this reason. Before the first sample, and where
    /// a person has withdrawn control in free motion, the offset is zero; else the arm is held.
    Idle(Option<StopReason>),
    /// In control, no axis in contact.
    Free {
        /// What pulls as if it were the surface.
        pull: Option<Pull>,
        /// The way back to a surface that the tool has bounced off.
        bounced: Option<Return>,
    },
    /// At least one axis in contact.
    Contact(ContactMemory<D>),
    /// On the way to standstill at the lowest force.
    Stopping(Stopping),
    /// Held at standstill until a reset.
    Stopped(Stop),
}

/// Why the arm is stopped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stop {
    /// The first reason.
    pub reason: StopReason,
    /// How singular the pose was, if that is the reason.
    pub singular: Option<Singular>,
}

/// A stop under way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stopping {
    /// Why.
    pub stop: Stop,
    /// When it began.
    pub since: Instant,
    /// Cycles in a row without a solution.
    pub unsolved: u32,
}

impl<const D: usize> Mode<D> {
    /// Its name.
    pub(crate) fn name(&self) -> ModeName {
        match self {
            Self::Idle(_) => ModeName::Idle,
            Self::Free { .. } => ModeName::Free,
            Self::Contact(_) => ModeName::Contact,
            Self::Stopping(_) => ModeName::Stopping,
            Self::Stopped(_) => ModeName::Stopped,
        }
    }

    /// Why the arm is stopping or stopped, or why it is not in control.
    pub(crate) fn stop_reason(&self) -> Option<StopReason> {
        match self {
            Self::Idle(reason) => *reason,
            Self::Free { .. } | Self::Contact(_) => None,
            Self::Stopping(stopping) => Some(stopping.stop.reason),
            Self::Stopped(stop) => Some(stop.reason),
        }
    }

    /// How singular the pose was that has stopped the arm.
    pub(crate) fn singular(&self) -> Option<Singular> {
        match self {
            Self::Idle(_) | Self::Free { .. } | Self::Contact(_) => None,
            Self::Stopping(stopping) => stopping.stop.singular,
            Self::Stopped(stop) => stop.singular,
        }
    }
}
