//! The prediction model (17): joint speed loops (4), the spring linearised at the measured pose
//! (16), the wrench estimate (6). J, J⁻¹ and Ψ are those at the measured q and stay frozen over the
//! horizon, so that a [`Step`] depends on nothing that changes between cycles.

use nalgebra::{SMatrix, SVector};

pub use super::step::{CARRIED, Discretization, Step};
use crate::robot::{Posture, Singular};
use crate::surface::Surface;

/// x = [q; q̇; f̂] (7), and what speed loops carry that are more than (4).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<const N: usize, const D: usize> {
    /// q in rad.
    pub joint_position: SVector<f64, N>,
    /// q̇ in rad/s.
    pub joint_velocity: SVector<f64, N>,
    /// q̈ in rad/s²; 0 of loops of first order.
    pub joint_acceleration: SVector<f64, N>,
    /// r before, in rad/s: it acts for the rest of its dead time.
    pub earlier_reference: SVector<f64, N>,
    /// f̂ in N and N·m, robot on environment, base frame.
    pub wrench: SVector<f64, D>,
}

impl<const N: usize, const D: usize> State<N, D> {
    /// The zero state: where the response to an input starts from.
    pub fn zeros() -> Self {
        Self::moving(SVector::zeros(), SVector::zeros(), SVector::zeros())
    }

    /// A state of loops (4): q in rad, q̇ in rad/s, f̂ in N and N·m.
    pub fn moving(joint_position: SVector<f64, N>, joint_velocity: SVector<f64, N>, wrench: SVector<f64, D>) -> Self {
        let nothing = SVector::zeros();
        Self { joint_position, joint_velocity, joint_acceleration: nothing, earlier_reference: nothing, wrench }
    }

    /// After one step under the joint velocity reference r, but for f̂, which stays: all that a question about the
    /// joints alone needs. `W` is the number of axes that the step has estimates for.
    pub(crate) fn moved<const W: usize>(&self, step: &Step<N, W>, r: &SVector<f64, N>) -> Self {
        let mut position = self.joint_position;
        let mut next = step.carried_by_reference.map(|by| by.component_mul(r));
        for (from, carried) in self.carried().iter().enumerate().take(step.carried) {
            position += step.position_by[from].component_mul(carried);
            for (next, by) in next.iter_mut().zip(&step.carried_by).take(step.carried) {
                *next += by[from].component_mul(carried);
            }
        }
        position += step.position_by_reference.component_mul(r);
        Self {
            joint_position: position,
            joint_velocity: next[0],
            joint_acceleration: next[1],
            earlier_reference: next[2],
            wrench: self.wrench,
        }
    }

    /// What the joints carry from step to step beside q, in the order of [`Step`].
    pub fn carried(&self) -> [SVector<f64, N>; CARRIED] {
        [self.joint_velocity, self.joint_acceleration, self.earlier_reference]
    }
}

/// The model of one cycle: all of (17) that depends on the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model<const N: usize, const D: usize> {
    /// J⁻¹(x₁), N×D.
    pub jacobian_inverse: SMatrix<f64, N, D>,
    /// (K_e J(x₁))ᵀ, N×D: column j is the change of f_lin on axis j with q, in N/rad.
    pub wrench_gradient: SMatrix<f64, N, D>,
    /// K_e (Ψ(x₁) − Ψ(q_contact) − J(x₁) x₁): the constant part of (16), in N.
    pub wrench_offset: SVector<f64, D>,
}

impl<const N: usize, const D: usize> Model<N, D> {
    /// The model at the measured joint position `q` with the `posture` there.
    ///
    /// # Errors
    /// [`Singular`] when J has no inverse there.
    pub fn new(surface: &Surface<D>, posture: &Posture<N, D>, q: &SVector<f64, N>) -> Result<Self, Singular> {
        let wrench_gradient = posture.jacobian().tr_mul(&surface.stiffness.transpose());
        let indentation = posture.pose().difference::<D>(&surface.contact);
        Ok(Self {
            jacobian_inverse: posture.inverse(0.0)?.matrix,
            wrench_gradient,
            wrench_offset: surface.stiffness * indentation - wrench_gradient.tr_mul(q),
        })
    }

    /// f_lin(q) of (16) in N.
    pub fn linear_wrench(&self, q: &SVector<f64, N>) -> SVector<f64, D> {
        self.wrench_offset + self.wrench_gradient.tr_mul(q)
    }

    /// f_lin(q) of (16) on one axis, in N.
    pub fn linear_wrench_on(&self, axis: usize, q: &SVector<f64, N>) -> f64 {
        self.wrench_offset[axis] + self.wrench_gradient.column(axis).dot(q)
    }

    /// One step of the affine system (17) under the constant joint velocity reference r = J⁻¹ (ṗ0 +
    /// Δṗ).
    pub fn advance(&self, step: &Step<N, D>, x: &State<N, D>, r: &SVector<f64, N>) -> State<N, D> {
        let mut within = step.wrench_by_reference.component_mul(&spread(r));
        for (carried, by) in x.carried().iter().zip(&step.wrench_by).take(step.carried) {
            within += by.component_mul(&spread(carried));
        }
        let followed = SVector::from_fn(|axis, _| self.wrench_gradient.column(axis).dot(&within.column(axis)));
        State {
            wrench: step.wrench_decay.component_mul(&x.wrench)
                + step.wrench_decay.map(|e| 1.0 - e).component_mul(&self.linear_wrench(&x.joint_position))
                + followed,
            ..x.moved(step, r)
        }
    }
}

/// The same column for every axis.
fn spread<const N: usize, const D: usize>(by_joint: &SVector<f64, N>) -> SMatrix<f64, N, D> {
    SMatrix::from_fn(|joint, _| by_joint[joint])
}
