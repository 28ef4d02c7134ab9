//! Limits of the joints and of the offset.

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
}
