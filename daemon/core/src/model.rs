//! The prediction model (17): joint speed loops (4), the spring linearised at the measured pose (16), the wrench
//! estimate (6). J, J⁻¹ and Ψ are those at the measured q and stay frozen over the horizon.

use nalgebra::{SMatrix, SVector};

use crate::environment::Environment;
use crate::robot::{InverseJacobian, Kinematics};

/// x = [q; q̇; f̂] (7).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<const N: usize, const D: usize> {
    /// q in rad.
    pub joint_position: SVector<f64, N>,
    /// q̇ in rad/s.
    pub joint_velocity: SVector<f64, N>,
    /// f̂ in N and N·m, robot on environment, base frame.
    pub wrench: SVector<f64, D>,
}

impl<const N: usize, const D: usize> State<N, D> {
    /// The zero state: where the response to an input starts from.
    pub fn zeros() -> Self {
        Self { joint_position: SVector::zeros(), joint_velocity: SVector::zeros(), wrench: SVector::zeros() }
    }
}

/// How the continuous model becomes a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Discretization {
    /// First-order Euler (14), (17).
    Euler,
}

/// The model of one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model<const N: usize, const D: usize> {
    discretization: Discretization,
    /// J⁻¹(x₁), N×D.
    jacobian_inverse: SMatrix<f64, N, D>,
    /// K_e J(x₁), D×N: change of f_lin with q, in N/rad.
    wrench_per_position: SMatrix<f64, D, N>,
    /// K_e (Ψ(x₁) − Ψ(q_contact) − J(x₁) x₁): the constant part of (16), in N.
    wrench_offset: SVector<f64, D>,
    /// T_V in s.
    velocity_time_constant: SVector<f64, N>,
    /// T_est in s; 0 means f̂ = f_lin at every instant (section V).
    wrench_time_constant: SVector<f64, D>,
}

impl<const N: usize, const D: usize> Model<N, D> {
    /// The model at the measured joint position `q`.
    pub fn new(
        discretization: Discretization,
        environment: &Environment<D>,
        kinematics: &Kinematics<N>,
        inverse: &InverseJacobian<N, D>,
        q: &SVector<f64, N>,
        velocity_time_constant: SVector<f64, N>,
        wrench_time_constant: SVector<f64, D>,
    ) -> Self {
        let wrench_per_position = environment.stiffness * kinematics.task_jacobian::<D>();
        let indentation = kinematics.pose.difference::<D>(&environment.contact);
        Self {
            discretization,
            jacobian_inverse: inverse.matrix,
            wrench_per_position,
            wrench_offset: environment.stiffness * indentation - wrench_per_position * q,
            velocity_time_constant,
            wrench_time_constant,
        }
    }

    /// f_lin(q) of (16) in N.
    pub fn linear_wrench(&self, q: &SVector<f64, N>) -> SVector<f64, D> {
        self.wrench_offset + self.wrench_per_position * q
    }

    /// Row `axis` of K_e J: the change of f_lin on that axis per rad of each joint.
    pub fn wrench_gradient(&self, axis: usize) -> SVector<f64, N> {
        self.wrench_per_position.row(axis).transpose()
    }

    /// One step of `duration` s of the affine system (17) under the constant twist ṗ0 + Δṗ: A x + B Δṗ + E ṗ0 + γ.
    pub fn advance(&self, duration: f64, x: &State<N, D>, twist: &SVector<f64, D>) -> State<N, D> {
        let mut next = self.advance_linear(duration, x, &(self.jacobian_inverse * twist));
        next.wrench += self.wrench_gain(duration).component_mul(&self.wrench_offset);
        next
    }

    /// The part of [`Self::advance`] that is linear in x and in the joint velocity reference v = J⁻¹ ṗ: A x + Λ-part of B.
    /// Applied to a difference of two trajectories it carries the response to an input.
    pub fn advance_linear(
        &self,
        duration: f64,
        x: &State<N, D>,
        joint_velocity_reference: &SVector<f64, N>,
    ) -> State<N, D> {
        match self.discretization {
            Discretization::Euler => {
                let acceleration =
                    (joint_velocity_reference - x.joint_velocity).component_div(&self.velocity_time_constant);
                let joint_position = x.joint_position + x.joint_velocity * duration;
                let joint_velocity = x.joint_velocity + acceleration * duration;
                let now = self.wrench_per_position * x.joint_position;
                let then = self.wrench_per_position * joint_position;
                let gain = self.wrench_gain(duration);
                let wrench = SVector::from_fn(|axis, _| {
                    if self.wrench_time_constant[axis] > 0.0 {
                        x.wrench[axis] + gain[axis] * (now[axis] - x.wrench[axis])
                    } else {
                        then[axis]
                    }
                });
                State { joint_position, joint_velocity, wrench }
            }
        }
    }

    /// T Λ_Test per axis; 1 where the force is measured ideally.
    fn wrench_gain(&self, duration: f64) -> SVector<f64, D> {
        match self.discretization {
            Discretization::Euler => self.wrench_time_constant.map(|t| if t > 0.0 { duration / t } else { 1.0 }),
        }
    }

    /// J⁻¹ times the unit twist along `axis`: the joint velocity reference of one input, in rad/s per m/s.
    pub fn input_direction(&self, axis: usize) -> SVector<f64, N> {
        self.jacobian_inverse.column(axis).into_owned()
    }

    /// Largest f_lin along `direction` (in N, summed over axes) while the arm coasts from `x` under zero joint velocity
    /// reference: q(t) = q + T_V q̇ (1 − exp(−t/T_V)), seen at 32 instants over five of the largest T_V.
    pub fn peak_while_coasting(&self, x: &State<N, D>, direction: &SVector<f64, D>) -> f64 {
        const INSTANTS: u32 = 32;
        let end = 5.0 * self.velocity_time_constant.max();
        let mut peak = f64::NEG_INFINITY;
        for instant in 0..=INSTANTS {
            let t = end * f64::from(instant) / f64::from(INSTANTS);
            let q = SVector::from_fn(|joint, _| {
                let lag = self.velocity_time_constant[joint];
                x.joint_position[joint] + lag * x.joint_velocity[joint] * (1.0 - libm::exp(-t / lag))
            });
            peak = peak.max(direction.dot(&self.linear_wrench(&q)));
        }
        peak
    }
}
