//! The arm at one joint position: all the kinematics that a cycle needs, computed once.

use nalgebra::{SMatrix, SVector, Vector3};

use super::{Chain, InverseJacobian, Kinematics, Pose, Singular, right_inverse};

/// Ψ(q), J(q) and J⁻¹(q).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Posture<const N: usize, const D: usize> {
    kinematics: Kinematics<N>,
    jacobian: SMatrix<f64, D, N>,
    inverse: Result<InverseJacobian<N, D>, Singular>,
}

impl<const N: usize, const D: usize> Posture<N, D> {
    /// The posture of `chain` at the joint position `q` in rad.
    pub fn new(chain: &Chain<N>, q: &SVector<f64, N>) -> Self {
        let kinematics = chain.kinematics(q);
        let jacobian = kinematics.task_jacobian::<D>();
        Self { kinematics, jacobian, inverse: right_inverse(&jacobian, 0.0) }
    }

    /// Ψ(q).
    pub fn pose(&self) -> &Pose {
        &self.kinematics.pose
    }

    /// Linear (m/s) and angular velocity (rad/s) of the TCP at the joint velocity in rad/s, base
    /// frame.
    pub fn velocity(&self, joint_velocity: &SVector<f64, N>) -> (Vector3<f64>, Vector3<f64>) {
        let twist = self.kinematics.jacobian * joint_velocity;
        (twist.fixed_rows::<3>(0).into_owned(), twist.fixed_rows::<3>(3).into_owned())
    }

    /// The task rows of J(q), D×N.
    pub fn jacobian(&self) -> &SMatrix<f64, D, N> {
        &self.jacobian
    }

    /// J⁻¹(q), if its reciprocal condition number is at least `least`.
    ///
    /// # Errors
    /// [`Singular`] with the reciprocal condition number.
    pub fn inverse(&self, least: f64) -> Result<&InverseJacobian<N, D>, Singular> {
        match &self.inverse {
            Ok(inverse) if inverse.reciprocal_condition >= least => Ok(inverse),
            Ok(inverse) => Err(Singular { reciprocal_condition: inverse.reciprocal_condition }),
            Err(singular) => Err(*singular),
        }
    }
}
