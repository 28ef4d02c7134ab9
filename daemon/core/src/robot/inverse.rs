//! The map from TCP velocity to joint velocity: J⁻¹ of (8), and for redundant arms (remark 1) the
//! solution of least norm, or of another [`Resolution`].

use nalgebra::{SMatrix, SVector};

use super::TaskAxes;

/// Which joint velocity is taken of those that bring about a twist (remark 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolution<const N: usize> {
    /// Diagonal of W, above 0: q̇ᵀ W q̇ is least. Only their ratios count. `None` is the Euclidean norm.
    pub weight: Option<SVector<f64, N>>,
    /// What is done near a singular pose; `None` inverts J exactly.
    pub damping: Option<InverseDamping>,
}

/// A damped inverse Jᵀ(JJᵀ + λ²I)⁻¹ near singular poses: joint velocities stay small, and the TCP moves
/// less than it is told. λ grows from 0 as λ² = `factor`² (1 − (c / `below`)²), where c is the
/// reciprocal condition number of J.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InverseDamping {
    /// λ at c = 0, in the units of J.
    pub factor: f64,
    /// c below which there is a λ.
    pub below: f64,
}

impl<const N: usize> Resolution<N> {
    /// The Euclidean norm, and exactly.
    pub const LEAST_NORM: Self = Self { weight: None, damping: None };

    /// W^(-1/2), the cheapest joint 1.
    fn scale(&self) -> Option<SVector<f64, N>> {
        self.weight.map(|weight| weight.map(|w| libm::sqrt(weight.min() / w)))
    }

    /// W⁻¹, the cheapest joint 1.
    pub(super) fn mobility(&self) -> SVector<f64, N> {
        self.weight.map_or_else(|| SVector::repeat(1.0), |weight| weight.map(|w| weight.min() / w))
    }
}

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
    /// Whether it is damped: J J⁻¹ is then not the identity.
    pub is_damped: bool,
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
        Ok(InverseJacobian { matrix, reciprocal_condition, is_damped: false })
    } else {
        Err(Singular { reciprocal_condition })
    }
}

/// The right inverse of least q̇ᵀ W q̇, W⁻¹Jᵀ(JW⁻¹Jᵀ)⁻¹, not damped, or how singular J is.
///
/// # Errors
/// [`Singular`] with the reciprocal condition number found.
pub(super) fn weighted_inverse<const N: usize, const D: usize>(
    jacobian: &SMatrix<f64, D, N>,
    axes: TaskAxes,
    resolution: &Resolution<N>,
    least: f64,
) -> Result<InverseJacobian<N, D>, Singular> {
    let Some(scale) = resolution.scale() else { return right_inverse(jacobian, axes, least) };
    let scaled = right_inverse(&by_joint(jacobian, &scale), axes, 0.0)?;
    let matrix: SMatrix<f64, N, D> = SMatrix::from_fn(|joint, axis| scale[joint] * scaled.matrix[(joint, axis)]);
    // Of what is used: a joint that is hardly moved is of no help where the others are singular.
    let reciprocal_condition = 1.0 / (jacobian.norm() * matrix.norm());
    if reciprocal_condition >= least {
        Ok(InverseJacobian { matrix, reciprocal_condition, is_damped: false })
    } else {
        Err(Singular { reciprocal_condition })
    }
}

/// The inverse of a resolution: [`right_inverse`] unless it says otherwise. Where it is damped, the
/// reciprocal condition number is that of the exact one, so that a pose is as singular as it is.
///
/// # Errors
/// [`Singular`] with the reciprocal condition number found.
pub fn resolved_inverse<const N: usize, const D: usize>(
    jacobian: &SMatrix<f64, D, N>,
    axes: TaskAxes,
    resolution: &Resolution<N>,
    least: f64,
) -> Result<InverseJacobian<N, D>, Singular> {
    let exact = weighted_inverse(jacobian, axes, resolution, least)?;
    let Some(InverseDamping { factor, below }) = resolution.damping else { return Ok(exact) };
    let near = 1.0 - exact.reciprocal_condition / below;
    if near <= 0.0 {
        return Ok(exact);
    }
    let scale = resolution.scale().unwrap_or_else(|| SVector::repeat(1.0));
    let scaled = by_joint(jacobian, &scale);
    let mut gram = scaled * scaled.transpose();
    let square = factor * factor * near * (2.0 - near);
    (0..D).for_each(|axis| gram[(axis, axis)] += if axes.has(axis) { square } else { 1.0 });
    let Some(gram_inverse) = gram.try_inverse() else { return Ok(exact) };
    let damped: SMatrix<f64, N, D> = scaled.transpose() * gram_inverse;
    let matrix = SMatrix::from_fn(|joint, axis| scale[joint] * damped[(joint, axis)]);
    Ok(InverseJacobian { matrix, is_damped: true, ..exact })
}

/// Every column times the number of its joint.
fn by_joint<const N: usize, const D: usize>(
    jacobian: &SMatrix<f64, D, N>,
    scale: &SVector<f64, N>,
) -> SMatrix<f64, D, N> {
    SMatrix::from_fn(|axis, joint| jacobian[(axis, joint)] * scale[joint])
}

impl<const N: usize, const D: usize> InverseJacobian<N, D> {
    /// Joint velocity in rad/s or m/s for a TCP twist in m/s and rad/s (8).
    pub fn joint_velocity(&self, twist: &SVector<f64, D>) -> SVector<f64, N> {
        self.matrix * twist
    }
}
