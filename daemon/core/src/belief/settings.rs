//! What the belief is told.

use nalgebra::SVector;

use super::{ContactPoint, ContactSign, NOISE_DEVIATIONS, SurfaceSet, SurfaceSigns, Thresholds};
use crate::quantities::Span;
use crate::surface::Surface;

/// Settings of this stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settings<const D: usize> {
    /// The surface as configured.
    pub surface: Surface<D>,
    /// Where its contact point comes from.
    pub contact_point: ContactPoint,
    /// β and the release threshold.
    pub thresholds: Thresholds<D>,
    /// Where the sign of a contact comes from.
    pub sign: ContactSign,
    /// T_est per axis in s; 0 for ideal force measurement.
    pub wrench_time_constant: SVector<f64, D>,
    /// By how much later f̂ shows the force, besides.
    pub wrench_dead_time: Span,
    /// Standard deviation of f̂ per axis in N and N·m, as it is told; 0 where it is not.
    pub wrench_noise: SVector<f64, D>,
    /// f_max per axis in N and N·m.
    pub force_limit: SVector<f64, D>,
    /// T_s.
    pub sampling_time: Span,
}

impl<const D: usize> Settings<D> {
    /// The noise of f̂ to reckon with: where it is not told, what β leaves room for.
    pub(super) fn likely_noise(&self) -> SVector<f64, D> {
        self.wrench_noise.zip_map(&self.thresholds.activation, |told, activation| {
            if told > 0.0 { told } else { activation / NOISE_DEVIATIONS }
        })
    }

    /// The set before anything was seen; `None` where the surface is told.
    pub(super) fn set(&self) -> Option<SurfaceSet> {
        let ContactPoint::Learned(prior) = &self.contact_point else { return None };
        let (thresholds, normal) = (&self.thresholds, &self.surface.normal);
        let mut felt = SurfaceSigns::of(normal).axes(&thresholds.admittance).peekable();
        let lag = felt.peek().map_or(0.0, |axis| self.wrench_time_constant[*axis]);
        let felt = felt.map(|axis| thresholds.activation[axis] / normal[axis].abs()).fold(f64::INFINITY, f64::min);
        let depth = -self.surface.height(&self.surface.contact.position);
        Some(SurfaceSet::new(prior, lag, self.wrench_noise.max(), felt, depth))
    }
}
