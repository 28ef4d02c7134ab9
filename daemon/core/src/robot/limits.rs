//! Limits of the joints and of the offset.

use admittance_drive_limits::DriveLimits;
use nalgebra::SVector;

/// A lower and an upper bound for each of K values; infinite where a value is not bounded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval<const K: usize> {
    /// Lower bounds.
    pub lower: SVector<f64, K>,
    /// Upper bounds.
    pub upper: SVector<f64, K>,
}

/// Limits of joints and offset. Every optimisation has them as constraints; an offset that is not
/// optimised is clamped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionLimits<const N: usize, const D: usize> {
    /// Largest |Δṗ| per axis, m/s and rad/s.
    pub offset: SVector<f64, D>,
    /// Rate at which the offset of a released axis returns to zero, m/s² and rad/s².
    pub release_rate: f64,
    /// Largest rate of the offset per axis toward the surface, and either way on an axis without a
    /// normal component; m/s² and rad/s².
    pub inward_rate: Option<SVector<f64, D>>,
    /// Largest rate of the offset per axis out of the surface, m/s² and rad/s².
    pub outward_rate: Option<SVector<f64, D>>,
    /// Largest joint speed reference, rad/s or m/s.
    pub joint_speed: Option<SVector<f64, N>>,
    /// Joint positions, rad or m.
    pub joint_position: Option<Interval<N>>,
    /// What the drives allow of the joint velocity references, J⁻¹ (ṗ0 + Δṗ), as they are streamed.
    pub drives: Option<Drives<N>>,
}

/// Limits of the drives, which no reference may exceed, whatever it is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drives<const N: usize> {
    /// Speed, acceleration and jerk of the references.
    pub limits: DriveLimits<N>,
    /// Whether a minimum-force stop, and what brings the arm to rest after it, may exceed the jerk.
    pub stop_exceeds_jerk: bool,
}

impl<const N: usize> Drives<N> {
    /// What holds in a stop, or out of one.
    pub fn limits(&self, in_stop: bool) -> DriveLimits<N> {
        let jerk = if in_stop && self.stop_exceeds_jerk { [f64::INFINITY; N] } else { self.limits.jerk };
        DriveLimits { jerk, ..self.limits }
    }
}
