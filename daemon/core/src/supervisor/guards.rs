//! Guards that do not rely on the model: they check the measured force, and change nothing.

use nalgebra::SVector;

use super::Cause;
use crate::belief::{Belief, ContactSign, NOISE_DEVIATIONS, Thresholds, WithoutLag};
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
    /// Whether some |f̂| is above its limit by more than the guard allows, and than it is `unsure` by (N,
    /// N·m).
    pub(super) fn measured<const D: usize>(
        &self,
        wrench: &SVector<f64, D>,
        unsure: &SVector<f64, D>,
        limits: &Limits<'_, D>,
    ) -> Option<Cause> {
        let beyond = self.force?;
        let noise = |axis: usize| NOISE_DEVIATIONS * limits.noise[axis];
        limits.are_passed(wrench, |axis| beyond + noise(axis) + unsure[axis]).then_some(Cause::MeasuredForce)
    }

    /// The same of the force without the lag of f̂, as far as it is not what a tool may feign.
    pub(super) fn exceeded<const D: usize>(
        &self,
        force: &WithoutLag<D>,
        unsure: &SVector<f64, D>,
        limits: &Limits<'_, D>,
    ) -> Option<Cause> {
        let beyond = self.force?;
        let certain = WithoutLag { wrench: force.certain, ..*force };
        limits.are_passed_without_lag(&certain, |axis| beyond + unsure[axis]).then_some(Cause::ForceExceeded)
    }

    /// Whether the force is further from the expected one than the guard and noise allow, in this
    /// cycle. `noise` is the standard deviation of f̂ in N; the expected force has that of the
    /// contact point.
    pub(super) fn mismatches<const D: usize>(&self, wrench: &SVector<f64, D>, noise: f64, belief: &Belief<D>) -> bool {
        let Some(most) = self.mismatch else { return false };
        let pressing = belief.surface().pressing_force(wrench);
        let by_noise = NOISE_DEVIATIONS * (noise + belief.deviation());
        (pressing - belief.expected_pressing()).abs() > most + by_noise
    }

    /// Whether this many cycles in a row are too many.
    pub(super) fn disagrees(&self, mismatches: u32) -> Option<Cause> {
        (mismatches > 0 && mismatches >= self.mismatch_cycles).then_some(Cause::ModelDisagrees)
    }
}

/// The limits of the force, and the noise that it is measured with.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits<'a, const D: usize> {
    /// f_max per axis in N and N·m.
    pub force: &'a SVector<f64, D>,
    /// Standard deviation of f̂ in N and N·m.
    pub noise: &'a SVector<f64, D>,
    /// Axes that have a limit.
    pub admittance: &'a [bool; D],
}

impl<const D: usize> Limits<'_, D> {
    /// Whether the force without the lag of f̂ is `beyond` its limit on an axis (N, N·m), and that
    /// is not noise.
    pub(super) fn are_passed_without_lag(&self, force: &WithoutLag<D>, beyond: impl Fn(usize) -> f64) -> bool {
        self.are_passed(&force.wrench, |axis| beyond(axis) + force.noise(axis, self.noise[axis]))
    }

    /// Whether |force| is this far `beyond` its limit on an axis.
    fn are_passed(&self, force: &SVector<f64, D>, beyond: impl Fn(usize) -> f64) -> bool {
        (0..D).any(|axis| self.admittance[axis] && force[axis].abs() > self.force[axis] + beyond(axis))
    }
}

/// What seems to pull in free motion, as no surface can.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pull {
    since: Instant,
    samples: u32,
    /// Sum of the pressing forces of these samples as the joint positions show the tool's motion, N.
    by_position: f64,
}

impl Pull {
    /// The pull after a sample of this `stamp`, by its pressing forces in N as q̇ and as the joint positions show the tool's motion;
    /// `most`: a pull that is none, N.
    pub(super) fn followed(
        last: Option<Self>,
        stamp: Instant,
        [by_velocity, by_position]: [f64; 2],
        most: f64,
    ) -> Option<Self> {
        let before = last.unwrap_or(Self { since: stamp, samples: 0, by_position: 0.0 });
        let so_far =
            Self { samples: before.samples.saturating_add(1), by_position: before.by_position + by_position, ..before };
        (by_velocity < -most).then_some(so_far)
    }

    /// Whether it has lasted for so long that the model must be wrong. An arm that sets off or brakes shakes a tool whose inertia q̇ misses
    /// where it is reported late: so the mean by the positions has to pull as well. (Each of them may be off by a coarse encoder.)
    pub(super) fn contradicts(&self, now: Instant, most: f64) -> Option<Cause> {
        let is_seen = self.by_position < -most * f64::from(self.samples);
        (is_seen && now.since(self.since) >= BRIEF_PULL).then_some(Cause::ModelDisagrees)
    }
}

/// How much a surface that can only be pressed may pull, N: β and `noise` (the standard deviation in N). Friction may turn the sign
/// of one axis, never that of the force along the normal.
pub(super) fn most_pull<const D: usize>(
    sign: ContactSign,
    thresholds: &Thresholds<D>,
    noise: f64,
    belief: &Belief<D>,
) -> f64 {
    if sign != ContactSign::Normal {
        return f64::INFINITY;
    }
    let felt = belief.surface_signs().axes(&thresholds.admittance).map(|axis| thresholds.activation[axis]);
    felt.fold(f64::INFINITY, f64::min).max(NOISE_DEVIATIONS * noise)
}

#[cfg(test)]
mod tests;
