//! The wire enums: the names that the law shares, and those that only the wire needs.

use admittance_vocabulary::{EnumInfo, Named, vocabulary};
pub use admittance_vocabulary::{
    FaultName as Fault, LawName as Law, ModeName as Mode, Motion, Side, Source, StopReason, TaskAxis,
    VerdictName as Verdict,
};

vocabulary! {
    /// What a request asks of the daemon.
    pub enum RequestKind as "RequestKind" {
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

vocabulary! {
    /// How a request ended.
    pub enum ResponseStatus as "ResponseStatus" {
        Done = 0 "The request was carried out.";
        Refused = 1 "The request was refused; the text says why.";
        Expired = 2 "The request arrived after its deadline; nothing was done.";
        Unknown = 3 "The request kind is not known to this daemon; nothing was done.";
    }
}

vocabulary! {
    /// What a record tells of.
    pub enum RecordKind as "RecordKind" {
        Sample = 1 "A state sample was answered.";
        Silence = 2 "There was no state sample for too long.";
        Reset = 3 "A reset was asked for.";
        Stop = 4 "The end of control was ordered.";
        Replaced = 5 "A configuration that was read again was handed over.";
        Adjusted = 6 "Values that a request changed were handed over.";
        Enable = 7 "Enabling control was asked for.";
    }
}

vocabulary! {
    /// The axes in which a twist is given. It is of the TCP in either.
    pub enum TwistFrame as "TwistFrame" {
        Base = 0 as "base" "Axes of the robot's base frame.";
        Tool = 1 as "tool" "Axes of the tool's frame as it is measured to stand.";
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
    TaskAxis::INFO,
    TwistFrame::INFO,
];
