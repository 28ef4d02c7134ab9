//! The wire enums.

use crate::layout::{EnumInfo, WireEnum};

wire_enum! {
    /// What the motion controller does with a command.
    enum Motion {
        Offset = 0 "Move with the twist reference plus the velocity offset.";
        Hold = 1 "Zero joint velocity, whatever the twist reference is.";
    }
}

wire_enum! {
    /// The mode of the daemon.
    enum Mode {
        Idle = 0 "Disabled or waiting for the first valid state sample; the offset is zero.";
        Free = 1 "No axis is in contact; the offset is zero or ramps to zero.";
        Contact = 2 "At least one axis is in contact and controlled.";
        Stopping = 3 "A minimum-force stop or a ramp to zero is under way.";
        Stopped = 4 "Latched until a reset; motion into the surface is refused.";
    }
}

wire_enum! {
    /// What the velocity offset of a command comes from.
    enum Source {
        None = 0 "No law acted: the offset is zero.";
        Mpc = 1 "The model predictive controller's solution of this cycle.";
        Damping = 2 "The damping law, equation (3).";
        Plan = 3 "Fallback: the last good plan, played by elapsed time.";
        Retreat = 4 "Fallback: open-loop retreat from the last good state.";
        Ramp = 5 "Ramp of a released axis or of a shutdown toward zero.";
        MinimumForce = 6 "The minimum-force stop: least violation of the upper force limit.";
    }
}

wire_enum! {
    /// Whether the force limits can be met over the horizon.
    enum Verdict {
        None = 0 "No verdict: no axis is in contact, or the law gives none.";
        Feasible = 1 "The limits can be met; the margin is the newtons left.";
        Infeasible = 2 "The limits cannot be met; axis, side, time and missing newtons are given.";
    }
}

wire_enum! {
    /// Which force limit a verdict speaks of.
    enum Side {
        None = 0 "No limit.";
        Upper = 1 "The upper limit: the force limit f_max.";
        Lower = 2 "The lower limit: contact would be lost.";
    }
}

wire_enum! {
    /// Why the daemon stops or has stopped.
    enum StopReason {
        None = 0 "Not stopping.";
        Infeasible = 1 "The force limits could no longer be met.";
        StartedInContact = 2 "The first valid sample was already in contact.";
        SampleStale = 3 "State samples were older than the accepted age, or stopped.";
        SampleInvalid = 4 "State samples were not finite, out of range, out of order, from the future, or jumped in position.";
        JointCount = 5 "The state sample's joint count is not the configured robot's.";
        Singular = 6 "The Jacobian is not invertible at the measured pose.";
        RateMismatch = 7 "State samples do not arrive at the configured sampling time.";
        FallbackExhausted = 8 "The plan and the retreat of the fallback were used up.";
        SolverFailed = 9 "The solver gave no usable solution and no fallback was left.";
        DrivesDisabled = 10 "The motion controller reported its drives as disabled.";
        Shutdown = 11 "The daemon is ending.";
        Disabled = 12 "Disabled by request.";
        InternalError = 13 "The daemon's real-time thread failed.";
        ContactLost = 14 "The minimum force, once reached, was not held.";
        MeasuredForce = 15 "The measured force passed the force limit by more than the guard allows.";
        ModelDisagrees = 16 "The measured force differs from the predicted one, or contradicts the surface's sign.";
    }
}

wire_enum! {
    /// What a request asks of the daemon.
    enum RequestKind {
        Status = 1 "Report the daemon's state; changes nothing.";
        Reset = 2 "Release a latched stop.";
        Enable = 3 "Let control begin, once no axis is in contact.";
        Disable = 4 "End control: in free motion the offset ramps to zero, in contact the arm stops at a low force.";
        Tare = 5 "In free motion: take the mean of the last wrenches, the tool's weight apart, as the bias.";
        SetForceLimit = 6 "Another force limit on some axes.";
        SetEnvironment = 7 "Another stiffness, normal or contact point of the surface.";
        SetLaw = 8 "Another law.";
        Reload = 9 "Read the configuration file again, as SIGHUP does: what requests have changed is dropped.";
    }
}

wire_enum! {
    /// Which law computes the offset.
    enum Law {
        Mpc = 1 "MPC-based admittance control (18).";
        Damping = 2 "Classic admittance control (3).";
    }
}

wire_enum! {
    /// How a request ended.
    enum ResponseStatus {
        Done = 0 "The request was carried out.";
        Refused = 1 "The request was refused; the text says why.";
        Expired = 2 "The request arrived after its deadline; nothing was done.";
        Unknown = 3 "The request kind is not known to this daemon; nothing was done.";
    }
}

wire_enum! {
    /// What a record tells of.
    enum RecordKind {
        Sample = 1 "A state sample was answered.";
        Silence = 2 "There was no state sample for too long.";
        Reset = 3 "A reset was asked for.";
        Stop = 4 "The end of control was ordered.";
        Replaced = 5 "A configuration that was read again was handed over.";
        Adjusted = 6 "Values that a request changed were handed over.";
        Enable = 7 "Enabling control was asked for.";
    }
}

wire_enum! {
    /// Why a state sample did not reach the law.
    enum Fault {
        None = 0 "It did.";
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
    }
}

/// Every wire enum of the contract.
pub const ENUMS: &[EnumInfo] = &[
    Motion::INFO,
    Mode::INFO,
    Source::INFO,
    Verdict::INFO,
    Side::INFO,
    StopReason::INFO,
    RequestKind::INFO,
    Law::INFO,
    ResponseStatus::INFO,
    RecordKind::INFO,
    Fault::INFO,
];
