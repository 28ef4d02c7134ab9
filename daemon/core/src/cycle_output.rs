//! What a cycle answers: all that the wire, the log and a record need.

use admittance_vocabulary::{ModeName, StopReason};
use nalgebra::SVector;

use crate::belief::Snapshot;
use crate::intake::{Arrival, SampleFault, WrongRate};
use crate::mpc::Verdict;
use crate::output::{Movement, Plan};
use crate::quantities::Span;
use crate::robot::Singular;

/// The answer of one cycle, with the plan behind it.
#[derive(Debug, Clone, Copy)]
#[must_use]
pub struct CycleOutput<'a, const N: usize, const D: usize> {
    /// What was decided, and why.
    pub outcome: Outcome<N, D>,
    /// The plan that holds, from the instant at which the command acts.
    pub plan: &'a Plan<D>,
    /// How long the command stays valid after it acts.
    pub validity: Span,
}

/// What was decided in one cycle, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome<const N: usize, const D: usize> {
    /// What the motion controller shall do.
    pub movement: Movement<N, D>,
    /// The mode after this cycle.
    pub mode: ModeName,
    /// The feasibility verdict.
    pub verdict: Verdict,
    /// Why the controller is stopping or stopped, or why it is not in control.
    pub stop_reason: Option<StopReason>,
    /// How singular the pose was, if that is why.
    pub singular: Option<Singular>,
    /// Axes in contact, one bit each.
    pub active_axes: u32,
    /// f̂ as the law saw it, in N and N·m; `None` when the sample did not reach it.
    pub wrench: Option<SVector<f64, D>>,
    /// The same without the lag of f̂; see [`WithoutLag`](crate::belief::WithoutLag).
    pub wrench_without_lag: Option<SVector<f64, D>>,
    /// Standard deviation of f̂ in N and N·m as motor torques show it; 0 of a wrench that is given.
    pub wrench_deviation: Option<SVector<f64, D>>,
    /// Why this cycle's sample did not reach the law.
    pub fault: Option<SampleFault>,
    /// How the sample followed the one before it; `None` when it did not reach the law.
    pub arrival: Option<Arrival>,
    /// The rate of the samples, while it is another than the configured one.
    pub wrong_rate: Option<WrongRate>,
    /// Iterations of the solver.
    pub iterations: u32,
    /// The iteration at which `expired` answered true.
    pub expired_iteration: Option<u32>,
    /// The belief about the surface after this cycle.
    pub belief: Snapshot,
    /// Running counts.
    pub counters: Counters,
}

/// Counts since the controller was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Cycles answered.
    pub cycles: u64,
    /// Cycles in contact answered by the last plan, and cycles without a solution answered by a
    /// retreat. A retreat without a sample does not count.
    pub fallback: u64,
    /// Samples that did not reach the law.
    pub rejected: u64,
    /// Samples that were never seen, by gaps in their sequence for which there was time.
    pub missed: u64,
    /// Samples whose spacing differed from the sampling time by more than 10 %.
    pub irregular: u64,
    /// Offsets that a limit had to cut after the law.
    pub limited: u64,
    /// Contacts lost that should have been kept.
    pub contacts_lost: u64,
    /// Samples whose force, without the lag of f̂, was beyond its limit.
    pub exceeded: u64,
}
