//! The prediction model (17): joint speed loops (4), the spring linearised at the measured pose
//! (16), the wrench estimate (6). J, J⁻¹ and Ψ are those at the measured q and stay frozen over the
//! horizon, so that a [`Step`] depends on nothing that changes between cycles.

use nalgebra::{SMatrix, SVector};

use crate::robot::{Posture, Singular};
use crate::surface::Surface;

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
    /// Exact under a constant reference (zero-order hold), with J frozen.
    Zoh,
}

/// One step of the model under a constant joint velocity reference r, joint by joint and axis by
/// axis: q ← q + a q̇ + b r, q̇ ← c q̇ + d r, f̂ ← e f̂ + (1 − e) f_lin(q) + K_e J (A q̇ + B r),
/// where q and q̇ are those at its start, and A, B act joint by joint, for each axis with its own
/// numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step<const N: usize, const D: usize> {
    /// Length in s.
    pub duration: f64,
    /// a in s.
    pub position_by_velocity: SVector<f64, N>,
    /// b in s.
    pub position_by_reference: SVector<f64, N>,
    /// c.
    pub velocity_decay: SVector<f64, N>,
    /// d.
    pub velocity_by_reference: SVector<f64, N>,
    /// e.
    pub wrench_decay: SVector<f64, D>,
    /// A in s: by how much the estimate follows the motion within the step, a column for each axis.
    pub wrench_by_velocity: SMatrix<f64, N, D>,
    /// B in s.
    pub wrench_by_reference: SMatrix<f64, N, D>,
}

impl Discretization {
    /// The step of `duration` s for joints with the time constants T_V and a wrench estimate with
    /// T_est (in s; 0 means f̂ = f_lin at every instant, section V).
    pub fn step<const N: usize, const D: usize>(
        self,
        duration: f64,
        velocity_time_constant: &SVector<f64, N>,
        wrench_time_constant: &SVector<f64, D>,
    ) -> Step<N, D> {
        match self {
            Self::Euler => Step {
                duration,
                position_by_velocity: SVector::repeat(duration),
                position_by_reference: SVector::zeros(),
                velocity_decay: velocity_time_constant.map(|t| 1.0 - duration / t),
                velocity_by_reference: velocity_time_constant.map(|t| duration / t),
                wrench_decay: wrench_time_constant.map(|t| if t > 0.0 { 1.0 - duration / t } else { 0.0 }),
                wrench_by_velocity: SMatrix::from_fn(
                    |_, axis| {
                        if wrench_time_constant[axis] > 0.0 { 0.0 } else { duration }
                    },
                ),
                wrench_by_reference: SMatrix::zeros(),
            },
            Self::Zoh => {
                let position_by_velocity = velocity_time_constant.map(|t| -t * libm::expm1(-duration / t));
                let followed = |joint: usize, axis: usize| {
                    let (joint_lag, lag) = (velocity_time_constant[joint], wrench_time_constant[axis]);
                    by_velocity_within(duration, joint_lag, lag, position_by_velocity[joint])
                };
                Step {
                    duration,
                    position_by_velocity,
                    position_by_reference: position_by_velocity.map(|a| duration - a),
                    velocity_decay: velocity_time_constant.map(|t| libm::exp(-duration / t)),
                    velocity_by_reference: velocity_time_constant.map(|t| -libm::expm1(-duration / t)),
                    wrench_decay: wrench_time_constant.map(|t| if t > 0.0 { libm::exp(-duration / t) } else { 0.0 }),
                    wrench_by_velocity: SMatrix::from_fn(followed),
                    // A and B belong to q̇ and r, which together moved the joint by t, filtered as
                    // f̂ is.
                    wrench_by_reference: SMatrix::from_fn(|joint, axis| {
                        let lag = wrench_time_constant[axis];
                        duration + if lag > 0.0 { lag * libm::expm1(-duration / lag) } else { 0.0 }
                            - followed(joint, axis)
                    }),
                }
            }
        }
    }
}

/// A of an estimate with the time constant W over t = `duration` s, of a joint with the time
/// constant T: the response a(s) = T (1 − exp(−s/T)) of its position, filtered, T (1 − exp(−t/W) −
/// I), I = 1/W ∫₀ᵗ exp(−(t − s)/W) exp(−s/T) ds. `a` is a(t), which it is for W = 0.
fn by_velocity_within(duration: f64, joint_lag: f64, lag: f64, a: f64) -> f64 {
    if lag <= 0.0 {
        return a;
    }
    // I = t/W exp(−t/W) (exp(x) − 1) / x with x = t/W − t/T; and the same from the slower
    // exponential, so that nothing overflows. At W = T the quotient is 1.
    let x = duration / lag - duration / joint_lag;
    let slower = libm::exp(-duration / lag.max(joint_lag));
    let quotient = if x == 0.0 { 1.0 } else { -libm::expm1(-x.abs()) / x.abs() };
    joint_lag * (-libm::expm1(-duration / lag) - duration / lag * slower * quotient)
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
        let within = step.wrench_by_velocity.component_mul(&spread(&x.joint_velocity))
            + step.wrench_by_reference.component_mul(&spread(r));
        let followed = SVector::from_fn(|axis, _| self.wrench_gradient.column(axis).dot(&within.column(axis)));
        State {
            joint_position: x.joint_position
                + step.position_by_velocity.component_mul(&x.joint_velocity)
                + step.position_by_reference.component_mul(r),
            joint_velocity: step.velocity_decay.component_mul(&x.joint_velocity)
                + step.velocity_by_reference.component_mul(r),
            wrench: step.wrench_decay.component_mul(&x.wrench)
                + step.wrench_decay.map(|e| 1.0 - e).component_mul(&self.linear_wrench(&x.joint_position))
                + followed,
        }
    }
}

/// The same column for every axis.
fn spread<const N: usize, const D: usize>(by_joint: &SVector<f64, N>) -> SMatrix<f64, N, D> {
    SMatrix::from_fn(|joint, _| by_joint[joint])
}
