//! The map from TCP velocity to joint velocity: J⁻¹ of (8), and for redundant arms (remark 1) the
//! least-norm solution.

use nalgebra::{SMatrix, SVector};

use super::TaskAxes;

/// J⁻¹, N×D, with how far J is from singular.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InverseJacobian<const N: usize, const D: usize> {
    /// J⁻¹, or with more joints than axes the right inverse Jᵀ(JJᵀ)⁻¹: the joint velocity of least
    /// Euclidean norm. Its columns are zero on axes that are none of the task.
    pub matrix: SMatrix<f64, N, D>,
    /// Reciprocal condition number 1 / (‖J‖ ‖J⁻¹‖) in the Frobenius norm: 0 singular, at most 1/D, of
    /// a task on fewer axes one over their number.
    /// It mixes metres and radians where D = 6, so compare it only with a bound chosen for that
    /// arm.
    pub reciprocal_condition: f64,
}

/// J has no reliable inverse at this joint position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Singular {
    /// The reciprocal condition number found; 0 where JJᵀ could not be inverted at all.
    pub reciprocal_condition: f64,
}

/// Largest ‖JX − I‖ (Frobenius) at which X counts as an inverse: far above rounding, far below 1,
/// where X is no inverse.
const LARGEST_RESIDUAL: f64 = 1e-6;

/// The right inverse of the task Jacobian J (D×N, with no more axes than joints, rows zero on all
/// others), or how singular J is when its reciprocal
/// condition number is below `minimum_reciprocal_condition`.
///
/// # Errors
/// [`Singular`] with the reciprocal condition number found.
pub fn right_inverse<const N: usize, const D: usize>(
    jacobian: &SMatrix<f64, D, N>,
    axes: TaskAxes,
    minimum_reciprocal_condition: f64,
) -> Result<InverseJacobian<N, D>, Singular> {
    let transpose = jacobian.transpose();
    // Where J has no row, its inverse has no column: whatever makes JJᵀ regular there.
    let mut gram = jacobian * transpose;
    (0..D).filter(|axis| !axes.has(*axis)).for_each(|axis| gram[(axis, axis)] = 1.0);
    let Some(gram_inverse) = gram.try_inverse() else {
        return Err(Singular { reciprocal_condition: 0.0 });
    };
    let rough: SMatrix<f64, N, D> = transpose * gram_inverse;
    // JJᵀ squares the condition number; one Newton step X(2I − JX) gives the lost digits back.
    let matrix = rough * (axes.identity::<D>() * 2.0 - jacobian * rough);
    // At a singular pose rounding makes JJᵀ invertible, and what comes out is short and wrong. A
    // matrix X with JX = I is never shorter than 1/σ_min, so this check is what makes the condition
    // number honest; NaN fails it too.
    let residual = (jacobian * matrix - axes.identity::<D>()).norm();
    let inverts = residual < LARGEST_RESIDUAL;
    let reciprocal_condition = if inverts { 1.0 / (jacobian.norm() * matrix.norm()) } else { 0.0 };
    if inverts && reciprocal_condition >= minimum_reciprocal_condition {
        Ok(InverseJacobian { matrix, reciprocal_condition })
    } else {
        Err(Singular { reciprocal_condition })
    }
}

impl<const N: usize, const D: usize> InverseJacobian<N, D> {
    /// Joint velocity in rad/s or m/s for a TCP twist in m/s and rad/s (8).
    pub fn joint_velocity(&self, twist: &SVector<f64, D>) -> SVector<f64, N> {
        self.matrix * twist
    }
}
