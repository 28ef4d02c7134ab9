//! What a sample shows of a surface, by its normal as it is believed to be.

use nalgebra::Vector3;

use crate::intake::Accepted;
use crate::surface::Surface;

/// Forces in N, of the robot on the environment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ShownForce {
    /// Along the inward normal.
    pub pressing: f64,
    /// Along the surface, base frame.
    pub beside: Vector3<f64>,
    /// What of `pressing` the tool may feign, with its sign.
    pub feigned: f64,
    /// How much less presses by q̇ than by the joint positions: of the tool's inertia, which they see in two ways.
    pub differing: f64,
}

impl ShownForce {
    /// Of f̂ in a sample.
    pub(crate) fn of<const N: usize, const D: usize>(sample: &Accepted<N, D>, surface: &Surface<D>) -> Self {
        let (pressing, beside) = surface.parts(&sample.wrench);
        Self {
            pressing,
            beside,
            feigned: surface.pressing_force(&sample.feigned_wrench),
            differing: surface.pressing_force(&sample.wrench_by_position) - pressing,
        }
    }
}
