//! The planar arm of two joints, the paper's, in closed form.

/// Two links in the plane; joint angles in rad, the second relative to the first link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlanarTwo {
    /// Lengths in m, base first.
    pub(crate) links_m: [f64; 2],
}

impl PlanarTwo {
    /// TCP position in m, base frame.
    pub(super) fn tcp(&self, q: [f64; 2]) -> [f64; 2] {
        let [l1, l2] = self.links_m;
        let q12 = q[0] + q[1];
        [l1 * q[0].cos() + l2 * q12.cos(), l1 * q[0].sin() + l2 * q12.sin()]
    }

    /// ∂TCP/∂q in m/rad, by rows.
    pub(super) fn jacobian(&self, q: [f64; 2]) -> [[f64; 2]; 2] {
        let [l1, l2] = self.links_m;
        let q12 = q[0] + q[1];
        [[-l1 * q[0].sin() - l2 * q12.sin(), -l2 * q12.sin()], [l1 * q[0].cos() + l2 * q12.cos(), l2 * q12.cos()]]
    }

    /// Joint velocity in rad/s for a TCP velocity in m/s; not finite in a singular pose.
    pub(super) fn joint_velocity(&self, q: [f64; 2], twist: [f64; 2]) -> [f64; 2] {
        let [[a, b], [c, d]] = self.jacobian(q);
        let determinant = a * d - b * c;
        [(d * twist[0] - b * twist[1]) / determinant, (a * twist[1] - c * twist[0]) / determinant]
    }

    /// Smallest over largest singular value of the Jacobian: 0 where the arm is singular, 1 at
    /// best.
    pub(super) fn reciprocal_condition(&self, q: [f64; 2]) -> f64 {
        let [[a, b], [c, d]] = self.jacobian(q);
        let (square, determinant) = (a * a + b * b + c * c + d * d, (a * d - b * c).abs());
        // σ1² + σ2² = square and σ1 σ2 = |det|.
        let (sum, difference) = ((square + 2.0 * determinant).sqrt(), (square - 2.0 * determinant).max(0.0).sqrt());
        (sum - difference) / (sum + difference)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocities_are_the_derivative_of_the_position() {
        let arm = PlanarTwo { links_m: [0.7, 0.4] };
        let (q, twist, h) = ([0.4, -1.1], [0.3, -0.2], 1e-6);
        let speed = arm.joint_velocity(q, twist);
        let at = |sign: f64| arm.tcp([q[0] + sign * h * speed[0], q[1] + sign * h * speed[1]]);
        for (axis, speed) in twist.iter().enumerate() {
            assert!(((at(1.0)[axis] - at(-1.0)[axis]) / (2.0 * h) - speed).abs() < 1e-8);
        }
    }

    #[test]
    fn condition_is_zero_when_stretched_and_one_for_equal_singular_values() {
        let arm = PlanarTwo { links_m: [1.0, 1.0] };
        assert!(arm.reciprocal_condition([0.3, 0.0]) < 1e-6);
        // Isotropic: l1 = √2 l2 and q2 = ±135°.
        let isotropic = PlanarTwo { links_m: [2f64.sqrt(), 1.0] };
        assert!((isotropic.reciprocal_condition([0.3, 135f64.to_radians()]) - 1.0).abs() < 1e-6);
    }
}
