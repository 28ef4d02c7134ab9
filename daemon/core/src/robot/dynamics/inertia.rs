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
    /// What a tensor has to be, in words, for messages.
    pub const ACCEPTED: &str = "the tensor of a body: principal moments above zero, none above the sum of the others";

    /// With the elements xx yy zz xy xz yz of the tensor, kg m²: xy is −∫ x y dm, as in URDF.
    pub fn of_elements(mass: f64, center_of_gravity: [f64; 3], [xx, yy, zz, xy, xz, yz]: [f64; 6]) -> Self {
        let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        Self { mass, center_of_gravity: center_of_gravity.into(), inertia }
    }

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
        let (c, mass) = (&self.center_of_gravity, self.mass);
        let [x, y, z] = [c.x, c.y, c.z];
        // Written out: of c cᵀ as a product of matrices a build of rustc 1.95 made z² out of y z.
        let [xy, xz, yz] = [-mass * x * y, -mass * x * z, -mass * y * z];
        let steiner = Matrix3::new(
            mass * (y * y + z * z),
            xy,
            xz,
            xy,
            mass * (x * x + z * z),
            yz,
            xz,
            yz,
            mass * (x * x + y * y),
        );
        SpatialInertia { mass, first_moment: c * mass, rotational: self.inertia + steiner }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn about_the_frame_s_origin_it_is_what_the_parallel_axis_theorem_says() {
        // Each element written out by itself.
        let (m, [x, y, z]) = (7.4, [0.227074, 0.077762, 0.119897]);
        let [xx, yy, zz, xy, xz, yz] = [0.05, 0.1, 0.06, 0.01, 0.011, -0.012];
        let found = LinkInertia::of_elements(m, [x, y, z], [xx, yy, zz, xy, xz, yz]).spatial();
        let expected = [
            [xx + m * (y * y + z * z), xy - m * x * y, xz - m * x * z],
            [xy - m * x * y, yy + m * (x * x + z * z), yz - m * y * z],
            [xz - m * x * z, yz - m * y * z, zz + m * (x * x + y * y)],
        ];
        for (row, values) in expected.iter().enumerate() {
            for (column, value) in values.iter().enumerate() {
                let element = found.rotational[(row, column)];
                assert!((element - value).abs() < 1e-12, "[{row}][{column}]: {element}, not {value}");
            }
        }
    }
}
