//! What the supervisor asks of the later stages.

/// What a prediction is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Task {
    /// The contact problem.
    Press,
    /// The minimum-force stop.
    Stop,
}

/// How a cycle without a usable sample is bridged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use]
pub(crate) enum Bridge {
    /// In free motion a ramp to zero continues.
    Ramp,
    /// In contact the last plan continues.
    Plan,
    /// Leaves the surface, open loop.
    Retreat,
    /// Not in control.
    Rest,
    /// Zero joint velocity.
    Hold,
}
