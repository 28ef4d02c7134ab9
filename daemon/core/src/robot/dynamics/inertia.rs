//! The mass of a link and where it sits.

use nalgebra::{Matrix3, Vector3};

use super::spatial::SpatialInertia;

/// A link's mass distribution, in the frame of the joint that moves it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkInertia {
    /// kg.
    pub mass: f64,
    /// Centre of gravity in the link's frame, m.
    pub center_of_gravity: Vector3<f64>,
    /// Inertia about the centre of gravity, along the axes of the link's frame, kg m².
    pub inertia: Matrix3<f64>,
}

impl LinkInertia {
    /// Whether a body can have it: mass and inertia above zero, and no principal moment larger than
    /// the other two together.
    pub fn is_physical(&self) -> bool {
        let finite = self.center_of_gravity.iter().chain(self.inertia.iter()).all(|value| value.is_finite());
        if !(finite && self.mass.is_finite() && self.mass > 0.0) {
            return false;
        }
        let scale = self.inertia.amax();
        let asymmetry = (self.inertia - self.inertia.transpose()).amax();
        let principal = self.inertia.symmetric_eigenvalues();
        // A flat plate has one moment that is the sum of the others, but for rounding.
        let largest = principal.max();
        asymmetry <= 1e-9 * scale && principal.min() > 0.0 && 2.0 * largest <= principal.sum() + 1e-9 * scale
    }

    /// About the frame's origin: the parallel axis theorem.
    pub(super) fn spatial(&self) -> SpatialInertia {
        let c = &self.center_of_gravity;
        let steiner = (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * self.mass;
        SpatialInertia { mass: self.mass, first_moment: c * self.mass, rotational: self.inertia + steiner }
    }
}
