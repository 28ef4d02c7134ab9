//! What an arm weighs in an impact.

use nalgebra::{SVector, Vector3};

use super::at::ArmDynamics;

impl<const N: usize> ArmDynamics<N> {
    /// 1 / (nᵀ J M⁻¹ Jᵀ n) in kg at the joint position q in rad or m: the mass with which the TCP answers a
    /// force along n, a unit vector in the base frame, as long as nothing else acts on the joints
    /// (Khatib 1987). A rotor behind a gear that gives does not count in the first instants: leave it
    /// out of `reflected`. `None` where no joint moves the TCP along n, or values are not finite.
    pub fn effective_mass(&self, q: &SVector<f64, N>, direction: &Vector3<f64>) -> Option<f64> {
        self.effective_mass_by(q, &self.lever(q, direction))
    }

    /// How far the TCP moves along a unit vector in the base frame as each joint turns, m/rad.
    pub fn lever(&self, q: &SVector<f64, N>, direction: &Vector3<f64>) -> SVector<f64, N> {
        self.chain.kinematics(q).jacobian.fixed_rows::<3>(0).tr_mul(direction)
    }

    /// The same mass where that lever is known.
    pub(crate) fn effective_mass_by(&self, q: &SVector<f64, N>, lever: &SVector<f64, N>) -> Option<f64> {
        let mobility = lever.dot(&self.at(q).mass_matrix().cholesky()?.solve(lever));
        Some(1.0 / mobility).filter(|mass| mass.is_finite())
    }
}
