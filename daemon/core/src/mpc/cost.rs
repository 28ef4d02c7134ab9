//! The cost (18a): Σ_{k=1..H} (x_k − x⁰)ᵀ Q (x_k − x⁰) + Σ_{k=0..H−1} (u_k − u⁰)ᵀ R (u_k − u⁰);
//! over uneven steps each counts by its length, see
//! [`Horizon::share`](crate::mpc::horizon::Horizon::share).

use nalgebra::SVector;

/// Q. The blocks between q, q̇ and f̂ are zero; only the axes with a wrench state count in the
/// last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Weights<const N: usize, const D: usize> {
    /// Diagonal in joint space, as (23a).
    Joint {
        /// Weight of each joint's position error, 1/rad².
        position: SVector<f64, N>,
        /// Weight of each joint's velocity error, s²/rad².
        velocity: SVector<f64, N>,
        /// Weight of each axis's wrench error, 1/N² and 1/(N·m)².
        wrench: SVector<f64, D>,
    },
    /// Diagonal in task space, Jᵀ W J: what the joints do that the TCP does not feel costs nothing.
    Task {
        /// Weight of the TCP's position error, 1/m² and 1/rad²; 0 gives the position up.
        position: SVector<f64, D>,
        /// Weight of the TCP's velocity error, s²/m² and s²/rad².
        velocity: SVector<f64, D>,
        /// Weight of each axis's wrench error, 1/N² and 1/(N·m)².
        wrench: SVector<f64, D>,
    },
}

/// x⁰ = [q0; q̇0; f_ref] and u⁰. The paper's are constant over the horizon, with f_ref (remark 3) and u⁰
/// 0; what makes a force settle fades over the horizon, see
/// [`Horizon::left_in`](crate::mpc::horizon::Horizon::left_in).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetPoint<const N: usize, const D: usize> {
    /// q0: the commanded joint position in rad.
    pub joint_position: SVector<f64, N>,
    /// q̇0 = J⁻¹ ṗ0 in rad/s.
    pub joint_velocity: SVector<f64, N>,
    /// f_ref in N and N·m, robot on environment.
    pub wrench: SVector<f64, D>,
    /// u⁰ in m/s and rad/s: the offset that costs nothing.
    pub input: SVector<f64, D>,
    /// What is added to q̇0 at first, and fades, in rad/s.
    pub fading_velocity: SVector<f64, N>,
    /// What is added to u⁰ at first, and fades, in m/s and rad/s.
    pub fading_input: SVector<f64, D>,
}
