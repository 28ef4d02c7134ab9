//! What a surface is shaped like, as seen from one of its points.

use nalgebra::Vector3;

/// The shape of a surface that at one point, the origin here, has the outward normal n.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// Flat.
    Plane,
    /// Round in one direction.
    Cylinder {
        /// 1/radius in 1/m, not 0; above zero it falls away to both sides, below zero it is a hollow.
        curvature: f64,
        /// Direction of its axis, length 1, at a right angle to n.
        axis: Vector3<f64>,
    },
    /// Round in all directions.
    Sphere {
        /// As of a cylinder: a ball above zero, a bowl below.
        curvature: f64,
    },
}

impl Shape {
    /// Depth in m of a place below the undeformed surface; negative is a gap.
    pub(super) fn penetration(&self, normal: &Vector3<f64>, place: &Vector3<f64>) -> f64 {
        match self.round(place) {
            None => -normal.dot(place),
            // (1 − |n + κ u|) / κ without the loss of digits of a large radius.
            Some((curvature, across)) => {
                let radial = normal + across * curvature;
                -(2.0 * normal.dot(&across) + curvature * across.norm_squared()) / (1.0 + radial.norm())
            }
        }
    }

    /// Unit vector out of the material at a place.
    pub(super) fn normal_at(&self, normal: &Vector3<f64>, place: &Vector3<f64>) -> Vector3<f64> {
        self.round(place).map_or(*normal, |(curvature, across)| (normal + across * curvature).normalize())
    }

    /// κ, and the part u of a place in the directions in which the surface is round: n + κ u leads out
    /// of the surface there.
    fn round(&self, place: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        match self {
            Self::Plane => None,
            Self::Cylinder { curvature, axis } => Some((*curvature, place - axis * axis.dot(place))),
            Self::Sphere { curvature } => Some((*curvature, *place)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sphere_is_round_in_all_directions() {
        // A ball and a bowl of 0.2 m about a middle on the z axis.
        for (curvature, middle) in [(5.0, -0.2), (-5.0, 0.2)] {
            let (shape, normal) = (Shape::Sphere { curvature }, Vector3::z());
            for way in [Vector3::new(0.3, -0.4, 0.9), Vector3::new(-0.8, 0.1, 0.2), Vector3::z()] {
                // Out of the material is away from the middle of a ball, and towards that of a bowl.
                let out = way.normalize();
                let place = Vector3::z() * middle + out * (0.2 * curvature.signum() - 0.001);
                assert!((shape.penetration(&normal, &place) - 0.001).abs() < 1e-12, "{curvature}, {way}");
                assert!((shape.normal_at(&normal, &place) - out).norm() < 1e-12, "{curvature}, {way}");
            }
        }
        // 30 mm beside the top of the ball: 0.2 − √(0.2² − 0.03²) lower, by a right triangle.
        let beside =
            Shape::Sphere { curvature: 5.0 }.penetration(&Vector3::z(), &Vector3::new(0.03, 0.0, -0.002_262_800_67));
        assert!(beside.abs() < 1e-7, "{beside} m");
    }
}
