//! Guards that do not rely on the model: they check the measured force, and change nothing.

use nalgebra::SVector;

use super::Cause;
use crate::belief::{Belief, ContactSign, Thresholds};
use crate::quantities::{Instant, Span};

/// A pull as brief as this is no contradiction: the tool's own mass pulls while the arm brakes.
const BRIEF_PULL: Span = Span::from_nanoseconds(5_000_000);

/// The guards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guards {
    /// f̂ above f_max by more than this (N, N·m) stops.
    pub force: Option<f64>,
    /// A pressing force further than this (N) from the predicted one stops.
    pub mismatch: Option<f64>,
    /// So many cycles in a row.
    pub mismatch_cycles: u32,
}

impl Guards {
    /// Whether some |f̂| is above its limit by more than the guard allows.
    pub(super) fn exceeded<const D: usize>(
        &self,
        wrench: &SVector<f64, D>,
        force_limit: &SVector<f64, D>,
        admittance: &[bool; D],
    ) -> Option<Cause> {
        let beyond = self.force?;
        let is_beyond = |axis: usize| admittance[axis] && wrench[axis].abs() > force_limit[axis] + beyond;
        (0..D).any(is_beyond).then_some(Cause::MeasuredForce)
    }

    /// Whether the force is further from the expected one than the guard allows, in this cycle.
    pub(super) fn mismatches<const D: usize>(&self, wrench: &SVector<f64, D>, belief: &Belief<D>) -> bool {
        let pressing = belief.surface().pressing_force(wrench);
        self.mismatch.is_some_and(|most| (pressing - belief.expected_pressing()).abs() > most)
    }

    /// Whether this many cycles in a row are too many.
    pub(super) fn disagrees(&self, mismatches: u32) -> Option<Cause> {
        (mismatches > 0 && mismatches >= self.mismatch_cycles).then_some(Cause::ModelDisagrees)
    }
}

/// Whether the wrench pulls on a surface that can only be pressed. Friction may turn the sign of
/// one axis, never that of the force along the normal.
pub(super) fn pulls<const D: usize>(
    sign: ContactSign,
    thresholds: &Thresholds<D>,
    wrench: &SVector<f64, D>,
    belief: &Belief<D>,
) -> bool {
    let felt = belief.surface_signs().axes(&thresholds.admittance).map(|axis| thresholds.activation[axis]);
    let pulls = belief.surface().pressing_force(wrench) < -felt.fold(f64::INFINITY, f64::min);
    sign == ContactSign::Normal && pulls
}

/// Whether the wrench has pulled for so long that the model must be wrong.
pub(super) fn contradicts(pulled_since: Option<Instant>, now: Instant) -> Option<Cause> {
    pulled_since.filter(|since| now.since(*since) >= BRIEF_PULL).map(|_| Cause::ModelDisagrees)
}
