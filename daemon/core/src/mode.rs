//! The mode machine: Idle → Free → Contact → Stopping → Stopped, and why a controller does not control.

/// What the controller is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Not controlling: disabled, or no valid sample yet. The offset is zero.
    Idle,
    /// Controlling, no axis in contact.
    Free,
    /// At least one axis in contact.
    Contact,
    /// On the way to standstill at the lowest force.
    Stopping,
    /// Held at standstill until a reset.
    Stopped,
}

/// What makes the mode change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transition {
    /// A valid sample without contact while enabled.
    Ready,
    /// An axis came into contact.
    Touch,
    /// The last axis left contact.
    Release,
    /// Control ends in free motion, the offset being zero.
    Disable,
    /// Control ends in contact: bring the force down first.
    Stop,
    /// Zero joint velocity at once.
    Halt,
    /// The stop has reached its end.
    Rest,
    /// Reset by a person.
    Reset,
    /// Reset by a person who insists: straight back to control.
    ForcedReset,
}

/// Every transition there is; a transition that is not listed for a mode leaves it as it is.
const TRANSITIONS: [(Mode, Transition, Mode); 12] = [
    (Mode::Idle, Transition::Ready, Mode::Free),
    (Mode::Idle, Transition::Halt, Mode::Stopped),
    (Mode::Free, Transition::Touch, Mode::Contact),
    (Mode::Free, Transition::Disable, Mode::Idle),
    (Mode::Free, Transition::Halt, Mode::Stopped),
    (Mode::Contact, Transition::Release, Mode::Free),
    (Mode::Contact, Transition::Stop, Mode::Stopping),
    (Mode::Contact, Transition::Halt, Mode::Stopped),
    (Mode::Stopping, Transition::Rest, Mode::Stopped),
    (Mode::Stopping, Transition::Halt, Mode::Stopped),
    (Mode::Stopped, Transition::Reset, Mode::Idle),
    (Mode::Stopped, Transition::ForcedReset, Mode::Free),
];

impl Mode {
    /// The mode after `transition`.
    #[must_use]
    pub fn after(self, transition: Transition) -> Self {
        TRANSITIONS.iter().find(|(from, on, _)| *from == self && *on == transition).map_or(self, |(_, _, to)| *to)
    }
}

/// Why the controller stopped, or why it stays Idle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// The force bounds can no longer be met.
    Infeasible,
    /// The first sample (or the first after the motion controller restarted) was already in contact.
    StartedInContact,
    /// No fresh sample for too long.
    SampleStale,
    /// Samples that may not reach the law: not finite or implausibly large, from the future, out of order, with a jump in position, or their
    /// wrench marked invalid.
    SampleInvalid,
    /// Samples with another number of joints than configured.
    JointCount,
    /// J singular at the measured pose, or nearly so in contact.
    Singular,
    /// The samples come at another rate than configured.
    RateMismatch,
    /// More consecutive fallbacks than allowed because the optimisation did not end in time.
    FallbackExhausted,
    /// More consecutive fallbacks than allowed because the solver gave no usable answer.
    SolverFailed,
    /// The drives went off.
    DrivesDisabled,
    /// The daemon is shutting down.
    Shutdown,
    /// Disabled on request.
    Disabled,
    /// A contact that should have been kept was lost.
    ContactLost,
    /// The measured force is above its limit by more than the guard allows.
    MeasuredForce,
    /// The measured force is not the predicted one, or pulls where the surface can only be pressed.
    ModelDisagrees,
}
