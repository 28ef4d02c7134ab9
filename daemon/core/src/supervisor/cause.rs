//! What makes the mode change, and to what: one pure function over every mode and every cause. The
//! table in `docs/architecture.md` is printed from it.

use admittance_vocabulary::{ModeName, StopReason, vocabulary};

use super::{OnContactLost, OnInfeasible};

vocabulary! {
    /// What may make the mode change.
    pub enum Cause as "Cause" {
        Ready = 0 "A valid sample without force while control is enabled.";
        Touch = 1 "An axis came into contact.";
        Release = 2 "The last axis left contact, as it was told to or before f_min was reached.";
        ContactLost = 3 "The last axis left a contact that should have been kept.";
        StartedInContact = 4 "The first sample of a run of the motion controller is above the activation threshold.";
        Disabled = 5 "A person has disabled control, and in free motion the offset is zero.";
        Shutdown = 6 "The daemon is ending, and in free motion the offset is zero.";
        DrivesDisabled = 7 "The drives are off.";
        RateMismatch = 8 "The samples come at another rate than configured.";
        SamplesMissed = 25 "Samples were never seen: more in a row than the last plan lasts, or again and again.";
        Singular = 9 "J has no inverse, or in contact none to stop with.";
        NearlySingular = 10 "J is nearly singular.";
        MeasuredForce = 11 "The measured force is above its limit by more than the guard allows.";
        ForceExceeded = 24 "The force without the lag of its estimate is above its limit by more than the guard allows.";
        ModelDisagrees = 12 "The measured force is not the predicted one, or pulls.";
        SurfaceOutsideRange = 26 "The surface is harder than the stiffest that was told.";
        Infeasible = 13 "No input meets the force bounds.";
        FallbackExhausted = 14 "Too many cycles in a row in which the solver ran out of time.";
        SolverFailed = 15 "Too many cycles in a row in which the solver gave no usable answer.";
        Silence = 16 "No sample for longer than the last plan lasts.";
        SampleStale = 17 "Only stale samples for longer than the last plan lasts.";
        SampleInvalid = 18 "Only invalid samples for longer than the last plan lasts.";
        JointCount = 19 "Only samples of another arm for longer than the last plan lasts.";
        RetreatOver = 20 "The open-loop retreat has lasted long enough, or the limits forbid it.";
        Rest = 21 "The stop may come to rest.";
        Reset = 22 "A person resets.";
        ForcedReset = 23 "A person insists on a reset: straight back to control.";
    }
}

impl Cause {
    /// The stop reason that this cause gives; `None` if the present one is kept.
    pub(super) fn reason(self) -> Option<StopReason> {
        match self {
            Self::ContactLost => Some(StopReason::ContactLost),
            Self::StartedInContact => Some(StopReason::StartedInContact),
            Self::Disabled => Some(StopReason::Disabled),
            Self::Shutdown => Some(StopReason::Shutdown),
            Self::DrivesDisabled => Some(StopReason::DrivesDisabled),
            Self::RateMismatch => Some(StopReason::RateMismatch),
            Self::SamplesMissed => Some(StopReason::SamplesMissed),
            Self::Singular | Self::NearlySingular => Some(StopReason::Singular),
            Self::MeasuredForce => Some(StopReason::MeasuredForce),
            Self::ForceExceeded => Some(StopReason::ForceExceeded),
            Self::ModelDisagrees => Some(StopReason::ModelDisagrees),
            Self::SurfaceOutsideRange => Some(StopReason::SurfaceOutsideRange),
            Self::Infeasible => Some(StopReason::Infeasible),
            Self::FallbackExhausted => Some(StopReason::FallbackExhausted),
            Self::SolverFailed => Some(StopReason::SolverFailed),
            Self::Silence | Self::SampleStale => Some(StopReason::SampleStale),
            Self::SampleInvalid => Some(StopReason::SampleInvalid),
            Self::JointCount => Some(StopReason::JointCount),
            Self::Ready
            | Self::Touch
            | Self::Release
            | Self::RetreatOver
            | Self::Rest
            | Self::Reset
            | Self::ForcedReset => None,
        }
    }
}

/// What the configuration says about the two causes that leave a choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Policy {
    /// What an infeasible verdict leads to.
    pub on_infeasible: OnInfeasible,
    /// What losing a contact leads to.
    pub on_contact_lost: OnContactLost,
}

/// The next mode. Every pair is defined; pairs that cannot occur change nothing.
pub fn decide(mode: ModeName, cause: Cause, policy: Policy) -> ModeName {
    use Cause as C;
    use ModeName::{Contact, Free, Idle, Stopped, Stopping};
    match mode {
        Idle => match cause {
            C::Ready => Free,
            C::StartedInContact => Stopped,
            // Not in control: a cause only changes the reason.
            C::Touch | C::Release | C::ContactLost | C::Disabled | C::Shutdown | C::DrivesDisabled => Idle,
            C::RateMismatch | C::Singular | C::NearlySingular | C::MeasuredForce | C::ForceExceeded => Idle,
            C::ModelDisagrees
            | C::SurfaceOutsideRange
            | C::Infeasible
            | C::FallbackExhausted
            | C::SolverFailed
            | C::Silence
            | C::SampleStale => Idle,
            C::SampleInvalid | C::JointCount | C::SamplesMissed | C::RetreatOver | C::Rest => Idle,
            C::Reset | C::ForcedReset => Idle,
        },
        Free => match cause {
            C::Touch => Contact,
            C::Disabled | C::Shutdown | C::DrivesDisabled | C::RateMismatch | C::SamplesMissed | C::Silence => Idle,
            // What pulls may be the surface: held at once, what the joints still turn would press.
            C::ModelDisagrees | C::SurfaceOutsideRange => Stopping,
            // A force on no axis in contact: the surface's model cannot stop what the arm has met.
            C::MeasuredForce | C::ForceExceeded | C::StartedInContact | C::Singular => Stopped,
            C::NearlySingular | C::SampleStale | C::SampleInvalid | C::JointCount => Stopped,
            C::Ready | C::Release | C::ContactLost | C::Infeasible | C::FallbackExhausted => Free,
            C::SolverFailed | C::RetreatOver | C::Rest | C::Reset | C::ForcedReset => Free,
        },
        Contact => match cause {
            C::Release => Free,
            C::ContactLost => match policy.on_contact_lost {
                OnContactLost::Continue => Free,
                OnContactLost::Stop => Stopped,
            },
            C::Infeasible => match policy.on_infeasible {
                OnInfeasible::Halt => Stopped,
                OnInfeasible::MinimumForceStop => Stopping,
            },
            // In contact the arm stops at the lowest force, as long as it can be controlled.
            C::Disabled | C::Shutdown | C::RateMismatch | C::NearlySingular | C::MeasuredForce => Stopping,
            C::ForceExceeded | C::ModelDisagrees | C::SurfaceOutsideRange => Stopping,
            C::FallbackExhausted | C::SolverFailed => Stopping,
            C::Silence | C::SampleStale | C::SampleInvalid | C::JointCount | C::SamplesMissed => Stopping,
            C::StartedInContact | C::DrivesDisabled | C::Singular => Stopped,
            C::Ready | C::Touch | C::RetreatOver | C::Rest | C::Reset | C::ForcedReset => Contact,
        },
        Stopping => match cause {
            C::Rest | C::StartedInContact | C::DrivesDisabled | C::Singular | C::RetreatOver => Stopped,
            // It is stopping already, and keeps the first reason.
            C::Ready | C::Touch | C::Release | C::ContactLost | C::Disabled | C::Shutdown => Stopping,
            C::RateMismatch | C::NearlySingular | C::MeasuredForce | C::ForceExceeded => Stopping,
            C::ModelDisagrees
            | C::SurfaceOutsideRange
            | C::Infeasible
            | C::FallbackExhausted
            | C::SolverFailed
            | C::Silence
            | C::SampleStale => Stopping,
            C::SampleInvalid | C::JointCount | C::SamplesMissed | C::Reset | C::ForcedReset => Stopping,
        },
        Stopped => match cause {
            C::Reset => Idle,
            C::ForcedReset => Free,
            // Latched: only a person ends it.
            C::Ready | C::Touch | C::Release | C::ContactLost | C::StartedInContact => Stopped,
            C::Disabled | C::Shutdown | C::DrivesDisabled | C::RateMismatch | C::Singular => Stopped,
            C::NearlySingular | C::MeasuredForce | C::ForceExceeded | C::ModelDisagrees | C::Infeasible => Stopped,
            C::FallbackExhausted | C::SolverFailed | C::Silence | C::SampleStale | C::SampleInvalid => Stopped,
            C::SurfaceOutsideRange => Stopped,
            C::JointCount | C::SamplesMissed | C::RetreatOver | C::Rest => Stopped,
        },
    }
}
