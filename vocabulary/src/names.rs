//! The names.

use crate::vocabulary;

vocabulary! {
    /// What the motion controller does with a command.
    pub enum Motion as "Motion" {
        Offset = 0 "Move with the twist reference plus the velocity offset.";
        Hold = 1 "Zero joint velocity, whatever the twist reference is.";
    }
}

vocabulary! {
    /// The mode of the daemon.
    pub enum ModeName as "Mode" {
        Idle = 0 "Not in control. Disabled, or before the first sample: the offset is zero. Control lost: Hold.";
        Free = 1 "No axis is in contact; the offset is zero or ramps to zero.";
        Contact = 2 "At least one axis is in contact and controlled.";
        Stopping = 3 "A stop at the lowest reachable force is under way.";
        Stopped = 4 "Held until a reset; only motion out of the surface is allowed.";
    }
}

vocabulary! {
    /// The source of a command's velocity offset.
    pub enum Source as "Source" {
        None = 0 "No law acted: the offset is zero.";
        Mpc = 1 "The model predictive controller's solution of this cycle.";
        Damping = 2 "The damping law, equation (3).";
        Plan = 3 "Fallback: the last good plan, played by elapsed time.";
        Retreat = 4 "Out of the surface without a solution, or at least no further into it.";
        Ramp = 5 "The offset of released axes, or of control that ends, on its way to zero.";
        MinimumForce = 6 "The minimum-force stop: least violation of the upper force limit.";
    }
}

vocabulary! {
    /// Whether the force limits can be met over the horizon.
    pub enum VerdictName as "Verdict" {
        None = 0 "No verdict: no axis is in contact, or the law gives none.";
        Feasible = 1 "The limits can be met; the margin is the newtons left.";
        Infeasible = 2 "The limits cannot be met; axis, side, time and missing newtons are given.";
        AtRisk = 3 "Some surfaces that may be there, or a wrench within what it may be off by, cannot be kept below the limit: the offset is that for the worst of them; axis, time and its newtons above the limit are given.";
    }
}

vocabulary! {
    /// Which force limit a verdict is about.
    pub enum Side as "Side" {
        (none = 0 "No limit.");
        Upper = 1 "The upper limit: the force limit f_max.";
        Lower = 2 "The lower limit: contact would be lost.";
    }
}

vocabulary! {
    /// Why the daemon stops or has stopped, or why it is not in control.
    pub enum StopReason as "StopReason" {
        (none = 0 "Not stopping.");
        Infeasible = 1 "The force limits could no longer be met.";
        StartedInContact = 2 "The first sample, or the first after the motion controller restarted, was in contact.";
        SampleStale = 3 "State samples were older than the accepted age, or stopped.";
        SampleInvalid = 4 "State samples were not finite, out of range, out of order, from the future, or jumped in position.";
        JointCount = 5 "The state sample's joint count is not the configured robot's.";
        Singular = 6 "The Jacobian is not invertible at the measured pose, or in contact nearly so.";
        RateMismatch = 7 "State samples do not arrive at the configured sampling time.";
        FallbackExhausted = 8 "The solver ran out of time in more cycles in a row than the last plan may stand in for.";
        SolverFailed = 9 "The solver gave no usable answer in more cycles in a row than the last plan may stand in for.";
        DrivesDisabled = 10 "The motion controller reported its drives as disabled.";
        Shutdown = 11 "The daemon is ending.";
        Disabled = 12 "Disabled by request.";
        InternalError = 13 "The daemon's real-time thread failed.";
        ContactLost = 14 "The minimum force, once reached, was not held.";
        MeasuredForce = 15 "The measured force passed the force limit by more than the guard allows.";
        ModelDisagrees = 16 "The measured force differs from the predicted one, or contradicts the surface's sign.";
        ForceExceeded = 17 "The force, as it is without the lag of the wrench estimate, passed its limit by more than the guard allows.";
        SamplesMissed = 18 "State samples were missed, one after the other or again and again: what the law acted on was too old.";
        SurfaceOutsideRange = 19 "The surface is harder than the stiffest that was told.";
    }
}

vocabulary! {
    /// Which law computes the offset.
    pub enum LawName as "Law" {
        Mpc = 1 "MPC-based admittance control (18).";
        Damping = 2 "Classic admittance control (3).";
    }
}

vocabulary! {
    /// Why a state sample did not reach the law.
    pub enum FaultName as "Fault" {
        (none = 0 "It did.");
        JointCount = 1 "Its joint count is not the configured robot's.";
        NotFinite = 2 "A value is NaN or infinite.";
        Implausible = 3 "A value is larger than any arm's.";
        WrenchInvalid = 4 "Its wrench is marked as invalid.";
        Stale = 5 "It was older than the accepted age.";
        FromFuture = 6 "It was stamped more than one sampling time ahead.";
        OutOfOrder = 7 "Its sequence or stamp does not follow the last accepted one's.";
        Silence = 8 "There was none.";
        WrenchSaturated = 9 "Its wrench is at the end of the sensor's range.";
        Jump = 10 "A joint is not where it can have moved since the sample before.";
        Unnumbered = 11 "Its sequence is 0: samples count from 1.";
        NotFollowing = 12 "Its joints do not follow what the law resolves, and it is to resolve redundancy.";
    }
}

vocabulary! {
    /// A task axis: a direction of the task frame, which is the base frame unless the daemon is told
    /// otherwise. An arm has the first D of them.
    pub enum TaskAxis as "TaskAxis" {
        X = 0 as "x" "Along x of the task frame: metres, newtons.";
        Y = 1 as "y" "Along y of the task frame: metres, newtons.";
        Z = 2 as "z" "Along z of the task frame: metres, newtons.";
        Rx = 3 as "rx" "About x of the task frame: radians, newton metres.";
        Ry = 4 as "ry" "About y of the task frame: radians, newton metres.";
        Rz = 5 as "rz" "About z of the task frame: radians, newton metres.";
    }
}
