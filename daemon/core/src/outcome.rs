//! What a cycle answers.

use nalgebra::SVector;

use crate::feasibility::Verdict;
use crate::mode::{Mode, StopReason};
use crate::sample::SampleFault;

/// What the motion controller shall do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// Follow ṗ0 + Δṗ.
    Offset,
    /// Zero joint velocity, whatever ṗ0 is.
    Hold,
}

/// Where the offset comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// No axis in contact: zero.
    None,
    /// The MPC (18).
    Mpc,
    /// The damping law (3).
    Damping,
    /// The last plan, by elapsed time.
    Plan,
    /// Open loop out of the surface, or what keeps ṗ0 from pushing on.
    Retreat,
    /// The offset of released axes returning to zero.
    Ramp,
    /// The minimum-force stop.
    MinimumForce,
}

/// The answer of one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome<const N: usize, const D: usize> {
    /// Offset or hold.
    pub motion: Motion,
    /// The mode after this cycle.
    pub mode: Mode,
    /// Where the offset comes from.
    pub source: Source,
    /// The feasibility verdict.
    pub verdict: Verdict,
    /// Why the controller is stopping or stopped, or why it stays idle.
    pub stop_reason: Option<StopReason>,
    /// Axes in contact, one bit each.
    pub active_axes: u32,
    /// Δṗ in m/s and rad/s.
    pub velocity_offset: SVector<f64, D>,
    /// J⁻¹ Δṗ in rad/s.
    pub joint_velocity_offset: SVector<f64, N>,
    /// ṗ0 + Δṗ in m/s and rad/s; zero while held.
    pub twist_command: SVector<f64, D>,
    /// Why this cycle's sample did not reach the law.
    pub fault: Option<SampleFault>,
    /// Iterations of the solver.
    pub iterations: u32,
    /// The iteration at which `expired` answered true.
    pub expired_at: Option<u32>,
    /// Whether a limit had to cut the offset after the law.
    pub limited: bool,
}

/// Running counts since the controller was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Cycles answered.
    pub cycles: u64,
    /// Cycles in contact answered by the last plan instead of the law.
    pub fallback: u64,
    /// Samples that did not reach the law, and silences.
    pub rejected: u64,
    /// Offsets that a limit had to cut after the law.
    pub limited: u64,
    /// Contacts lost that should have been kept.
    pub contacts_lost: u64,
}
