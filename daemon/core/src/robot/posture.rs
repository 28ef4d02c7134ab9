//! The arm at one joint position: all the kinematics that a cycle needs, computed once.

use nalgebra::{SMatrix, SVector, Vector3};

use super::{
    Chain, InverseJacobian, Kinematics, NullSpace, Pose, Resolution, Singular, resolved_inverse, right_inverse,
};
use crate::quantities::on_task_axes;

/// Way in rad or m by which the joints are moved to see how the condition of J changes.
const PROBE: f64 = 1e-4;

/// Ψ(q), J(q) and J⁻¹(q).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Posture<const N: usize, const D: usize> {
    kinematics: Kinematics<N>,
    jacobian: SMatrix<f64, D, N>,
    inverse: Result<InverseJacobian<N, D>, Singular>,
}

impl<const N: usize, const D: usize> Posture<N, D> {
    /// The posture of `chain` at the joint position `q` in rad or m.
    pub fn new(chain: &Chain<N>, q: &SVector<f64, N>) -> Self {
        let kinematics = chain.kinematics(q);
        let jacobian = kinematics.task_jacobian::<D>();
        let inverse = resolved_inverse(&jacobian, kinematics.axes, &kinematics.resolution, 0.0);
        Self { kinematics, jacobian, inverse }
    }

    /// Ψ(q).
    pub fn pose(&self) -> &Pose {
        &self.kinematics.pose
    }

    /// Linear (m/s) and angular velocity (rad/s) of the TCP at the joint velocity, rad/s or m/s, base
    /// frame.
    pub fn velocity(&self, joint_velocity: &SVector<f64, N>) -> (Vector3<f64>, Vector3<f64>) {
        let twist = self.kinematics.jacobian * joint_velocity;
        (twist.fixed_rows::<3>(0).into_owned(), twist.fixed_rows::<3>(3).into_owned())
    }

    /// The task rows of J(q), D×N; zero on axes that are none of the task.
    pub fn jacobian(&self) -> &SMatrix<f64, D, N> {
        &self.jacobian
    }

    /// J̇ q̇: the acceleration (m/s², rad/s²) of the TCP on the task axes while every joint keeps
    /// its velocity q̇ in rad/s or m/s.
    pub fn acceleration_at_constant_joint_velocity(&self, joint_velocity: &SVector<f64, N>) -> SVector<f64, D> {
        let mut acceleration = SVector::zeros();
        self.each_turning_column(joint_velocity, |joint, column| acceleration += column * joint_velocity[joint]);
        acceleration
    }

    /// q̈ (rad/s² or m/s²) within the null space of joints that move with q̇ (rad/s or m/s) and go on by J⁻¹ of the same
    /// twist: J⁻¹ = W⁻¹Jᵀ(JW⁻¹Jᵀ)⁻¹ turns there as well, by P W⁻¹ J̇ᵀ (JW⁻¹Jᵀ)⁻¹ with P = I − J⁻¹J. About that where J⁻¹ is
    /// damped. 0 of an arm that is not redundant, and where J has no inverse.
    pub fn null_acceleration_at_constant_twist(&self, joint_velocity: &SVector<f64, N>) -> SVector<f64, N> {
        let is_redundant = (0..D).filter(|&axis| self.kinematics.axes.has(axis)).count() < N;
        let Some(inverse) = self.inverse.as_ref().ok().filter(|_| is_redundant) else { return SVector::zeros() };
        let mobility = self.kinematics.resolution.mobility();
        // (JW⁻¹Jᵀ)⁻¹ ẋ = J⁻ᵀ W J⁻¹ ẋ.
        let least = inverse.matrix * (self.jacobian * joint_velocity);
        let price = inverse.matrix.tr_mul(&least.component_div(&mobility));
        let mut pushed = SVector::<f64, N>::zeros();
        self.each_turning_column(joint_velocity, |joint, column| pushed[joint] = mobility[joint] * column.dot(&price));
        pushed - inverse.matrix * (self.jacobian * pushed)
    }

    /// The columns of J̇ while the joints move with q̇ (rad/s or m/s), one joint after the other.
    fn each_turning_column(&self, joint_velocity: &SVector<f64, N>, mut each: impl FnMut(usize, SVector<f64, D>)) {
        // ∂/∂q_j of z_i × (p − o_i), the column of joint i: z_j × (z_i × (p − o_i)) for j ≤ i, else
        // z_i × (z_j × (p − o_j)); of z_i, where the joint slides, z_j × z_i for j < i, else 0. The joints up
        // to i turn by `turning`; those beyond move the TCP by `further`.
        let (mut turning, (mut further, _)) = (Vector3::zeros(), self.velocity(joint_velocity));
        for (joint, column) in self.kinematics.jacobian.column_iter().enumerate() {
            let (moved, axis) = (column.fixed_rows::<3>(0).into_owned(), column.fixed_rows::<3>(3).into_owned());
            let angular = turning.cross(&axis);
            turning += axis * joint_velocity[joint];
            further -= moved * joint_velocity[joint];
            let linear = turning.cross(&moved) + axis.cross(&further);
            each(joint, self.kinematics.axes.kept(&on_task_axes(&linear, &angular)));
        }
    }

    /// Reciprocal condition number of J after the joints of `chain` have moved on by `way` (rad or m), to
    /// first order: near a singular pose the least singular value falls evenly, and beyond it
    /// another posture begins, which the arm cannot reach under control.
    pub fn reciprocal_condition_after(&self, chain: &Chain<N>, q: &SVector<f64, N>, way: &SVector<f64, N>) -> f64 {
        let here = self.reciprocal_condition();
        let length = way.norm();
        if length < PROBE {
            return here;
        }
        let share = PROBE / length;
        let there = chain.kinematics(&(q + way * share)).inverse::<D>(0.0);
        let there = there.map_or(0.0, |inverse| inverse.reciprocal_condition);
        here + (there - here) / share
    }

    fn reciprocal_condition(&self) -> f64 {
        match &self.inverse {
            Ok(inverse) => inverse.reciprocal_condition,
            Err(singular) => singular.reciprocal_condition,
        }
    }

    /// The joint velocities that leave the task where it is; `None` where J has no inverse.
    pub fn null_space(&self) -> Option<NullSpace<N>> {
        NullSpace::of(&self.jacobian, self.kinematics.axes, &self.kinematics.resolution)
    }

    /// J⁻¹ of least norm and exactly, whatever the resolution: what torques show of a wrench hangs on it.
    ///
    /// # Errors
    /// [`Singular`] with the reciprocal condition number.
    pub fn least_norm_inverse(&self) -> Result<InverseJacobian<N, D>, Singular> {
        match self.inverse {
            Ok(inverse) if self.kinematics.resolution == Resolution::LEAST_NORM => Ok(inverse),
            _ => right_inverse(&self.jacobian, self.kinematics.axes, 0.0),
        }
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
