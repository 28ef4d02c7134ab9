//! The generalised momentum p = M q̇, and what of its rate the motion itself brings about.

use nalgebra::SVector;

use super::at::DynamicsAt;
use super::spatial::{Force, Motion};

/// The momentum of an arm that moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Momentum<const N: usize> {
    /// p = M q̇ in N m s, of a joint that slides in N s.
    pub momentum: SVector<f64, N>,
    /// Cᵀ q̇ = ∂(½ q̇ᵀ M q̇)/∂q in N m or N: ṗ is this and the torques less G and Jᵀ f̂.
    pub carried: SVector<f64, N>,
}

impl<const N: usize> DynamicsAt<'_, N> {
    /// At a velocity in rad/s or m/s. A joint that moves by dq moves all bodies after it as one, so that what
    /// they have of the velocity before it changes by (v × s) dq: no derivative of M is needed.
    pub fn momentum(&self, velocity: &SVector<f64, N>) -> Momentum<N> {
        let (mut v, mut velocities) = (Motion::ZERO, [Motion::ZERO; N]);
        // Of all bodies from the joint on.
        let mut carried_on = [Force::ZERO; N];
        for joint in 0..N {
            v = self.placements[joint].body_has(&v) + self.motion(joint, velocity[joint]);
            velocities[joint] = v;
            carried_on[joint] = &self.arm.links[joint] * &v;
        }
        let mut answer = Momentum { momentum: self.arm.reflected.component_mul(velocity), carried: SVector::zeros() };
        for joint in (0..N).rev() {
            let axis = self.motion(joint, 1.0);
            answer.momentum[joint] += self.along(joint, &carried_on[joint]);
            answer.carried[joint] = velocities[joint].cross(&axis).dot(&carried_on[joint]);
            if joint > 0 {
                let handed_on = self.placements[joint].parent_has(&carried_on[joint]);
                carried_on[joint - 1] += handed_on;
            }
        }
        answer
    }
}
