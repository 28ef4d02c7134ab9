//! Forward dynamics: the acceleration that torques bring about.

use nalgebra::{SVector, Vector6};

use super::at::DynamicsAt;

impl<const N: usize> DynamicsAt<'_, N> {
    /// q̈ = M⁻¹ (τ − C q̇ − G − Jᵀ f̂) in rad/s² or m/s² (Featherstone, section 6.1), from torques at the joints
    /// in N m or N, friction taken off, the velocity in rad/s or m/s, and the wrench that the robot exerts on the
    /// environment at the TCP, base frame, in N and N m. `None` where values are not finite.
    pub fn acceleration(
        &self,
        velocity: &SVector<f64, N>,
        torque: &SVector<f64, N>,
        wrench: &Vector6<f64>,
    ) -> Option<SVector<f64, N>> {
        let free = torque - self.bias(velocity, wrench);
        self.mass_matrix().cholesky().map(|factor| factor.solve(&free)).filter(|a| a.iter().all(|a| a.is_finite()))
    }
}
