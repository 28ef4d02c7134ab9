//! Settings of this stage.

use nalgebra::SVector;

use super::guards::Limits;
use super::{Guards, Policy};
use crate::belief::{ContactSign, Thresholds};
use crate::intake::Timing;
use crate::mpc::{InwardSpeed, LowerBound};
use crate::quantities::Span;

/// What an infeasible verdict leads to. Both are latched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnInfeasible {
    /// Zero joint velocity at once (III.C).
    Halt,
    /// The lowest force that can still be reached, then zero joint velocity.
    MinimumForceStop,
}

/// What the loss of a contact that should be kept leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnContactLost {
    /// On in free motion; it is counted.
    Continue,
    /// Zero joint velocity, latched.
    Stop,
}

/// Settings of this stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settings<const D: usize> {
    /// Whether the law predicts: keeps the force within bounds, and stops by its model.
    pub predicts: bool,
    /// What to do about a force that cannot be kept.
    pub policy: Policy,
    /// β and the release threshold.
    pub thresholds: Thresholds<D>,
    /// Where the sign of a contact comes from.
    pub sign: ContactSign,
    /// f_max per axis in N and N·m.
    pub force_limit: SVector<f64, D>,
    /// Part of f_max by which a plan may exceed it.
    pub limit_tolerance: f64,
    /// Standard deviation of f̂ per axis in N and N·m, as it is told; 0 where it is not.
    pub wrench_noise: SVector<f64, D>,
    /// f_min per axis in N and N·m.
    pub minimum_force: SVector<f64, D>,
    /// When f_min holds.
    pub lower_bound: LowerBound,
    /// How fast the arm may be commanded into the surface in contact.
    pub inward_speed: InwardSpeed,
    /// Guards.
    pub guards: Guards,
    /// How long a plan may stand in for an answer.
    pub timing: Timing,
    /// Reciprocal condition number of J below which the pose counts as singular.
    pub minimum_reciprocal_condition: f64,
    /// Longest open-loop retreat.
    pub retreat_time: Span,
    /// Longest duration of a minimum-force stop; after it the arm is held, whatever the force.
    pub stop_timeout: Span,
    /// Whether the first valid sample without contact starts control.
    pub start_enabled: bool,
}

impl<const D: usize> Settings<D> {
    /// The limits of the force.
    pub(super) fn limits(&self) -> Limits<'_, D> {
        Limits { force: &self.force_limit, noise: &self.wrench_noise, admittance: &self.thresholds.admittance }
    }
}
