//! The energy of the moving arm.

use nalgebra::SVector;

use super::at::DynamicsAt;
use super::spatial::{Motion, Placement};

impl<const N: usize> DynamicsAt<'_, N> {
    /// ½ q̇ᵀ M q̇ in J at a velocity in rad/s or m/s, link by link.
    pub fn kinetic_energy(&self, velocity: &SVector<f64, N>) -> f64 {
        let mut v = Motion::ZERO;
        let mut twice = velocity.component_mul(velocity).dot(&self.arm.reflected);
        for joint in 0..N {
            v = self.placements[joint].body_has(&v) + self.motion(joint, velocity[joint]);
            twice += v.dot(&(&self.arm.links[joint] * &v));
        }
        0.5 * twice
    }

    /// −Σ m gᵀ c in J, c from the base's origin; its gradient is G.
    pub fn potential_energy(&self) -> f64 {
        let base = |so_far: &Placement, next: &Placement| Placement {
            rotation: so_far.rotation * next.rotation,
            origin: so_far.origin + so_far.rotation * next.origin,
        };
        let mut here = Placement { rotation: nalgebra::Matrix3::identity(), origin: nalgebra::Vector3::zeros() };
        let mut energy = 0.0;
        for (placement, link) in self.placements.iter().zip(&self.arm.links) {
            here = base(&here, placement);
            let moment = here.rotation * link.first_moment + here.origin * link.mass;
            energy -= self.arm.gravity.dot(&moment);
        }
        energy
    }
}
