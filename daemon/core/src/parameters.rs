//! Everything that a controller is told when it is made. The shell reads it from the configuration and checks the ranges;
//! [`Parameters::check`] repeats only what the law cannot live without.

use nalgebra::SVector;

use crate::contact::Thresholds;
use crate::cost::Weights;
use crate::environment::Environment;
use crate::horizon::Horizon;
use crate::model::Discretization;
use crate::plan::MAX_STEPS;
use crate::robot::Chain;

/// Which law answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law<const D: usize> {
    /// MPC-based admittance control (18).
    Mpc,
    /// Classic admittance control (3), for comparison: acts on every sample, in contact or not.
    Damping {
        /// Diagonal of D in N·s/m and N·m·s/rad.
        damping: SVector<f64, D>,
    },
}

/// Which axes get an input once any axis is in contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputSelection {
    /// The axes in contact (III.C).
    Active,
    /// Every admittance axis.
    All,
}

/// What an infeasible verdict leads to. Both are latched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnInfeasible {
    /// Zero joint velocity at once (III.C).
    Halt,
    /// The lowest force that can still be reached, then zero joint velocity.
    MinimumForceStop,
}

/// Settings of the MPC (18).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mpc<const N: usize, const D: usize> {
    /// How (10), (13) become steps.
    pub discretization: Discretization,
    /// Length of each step in s; the first `horizon` count.
    pub steps: [f64; MAX_STEPS],
    /// H.
    pub horizon: usize,
    /// Which axes get an input.
    pub inputs: InputSelection,
    /// Q.
    pub weights: Weights<N, D>,
    /// R, diagonal, 1/(m/s)² and 1/(rad/s)²; above 0.
    pub input_weight: SVector<f64, D>,
    /// f_max per axis in N and N·m.
    pub force_limit: SVector<f64, D>,
    /// f_min per axis in N and N·m: lower bound of s·f_lin.
    pub minimum_force: SVector<f64, D>,
    /// What infeasibility leads to.
    pub on_infeasible: OnInfeasible,
    /// Largest KKT residual of a solution that may be used, relative to the values that it is made of.
    pub solution_tolerance: f64,
}

impl<const N: usize, const D: usize> Mpc<N, D> {
    /// Lengths of the H steps in s.
    pub fn steps(&self) -> &[f64] {
        &self.steps[..self.horizon.min(MAX_STEPS)]
    }
}

/// When samples and answers are good enough. In s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// T_s.
    pub sampling_time: f64,
    /// The command for the sample stamped t acts at t plus this.
    pub command_delay: f64,
    /// An older sample is stale.
    pub max_sample_age: f64,
    /// Cycles in a row that the last plan may stand in for an answer.
    pub max_consecutive_fallbacks: u32,
}

/// How a stop goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stopping {
    /// Speed in m/s along the outward normal of the open-loop retreat, and the most that a stopped arm may move away with.
    pub retreat_speed: f64,
    /// Longest open-loop retreat in s.
    pub retreat_time: f64,
    /// Pressing force in N below which a stop may come to rest.
    pub stop_force: f64,
    /// Longest minimum-force stop in s; then the arm is held whatever the force is.
    pub stop_timeout: f64,
}

/// Bounds of the offset that hold for every law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetLimits<const D: usize> {
    /// Largest |Δṗ| per axis, m/s and rad/s.
    pub offset: SVector<f64, D>,
    /// Rate at which the offset of a released axis returns to zero, m/s² and rad/s².
    pub release_rate: f64,
}

/// Everything a controller is told when it is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters<const N: usize, const D: usize> {
    /// The arm.
    pub chain: Chain<N>,
    /// Reciprocal condition number of J below which the pose counts as singular.
    pub minimum_reciprocal_condition: f64,
    /// T_V per joint in s.
    pub velocity_time_constant: SVector<f64, N>,
    /// T_est per axis in s; 0 for ideal force measurement.
    pub wrench_time_constant: SVector<f64, D>,
    /// The environment.
    pub environment: Environment<D>,
    /// β and the release threshold.
    pub thresholds: Thresholds<D>,
    /// Which law answers.
    pub law: Law<D>,
    /// The MPC; a minimum-force stop uses its model, horizon and limits under every law.
    pub mpc: Mpc<N, D>,
    /// Bounds of the offset.
    pub limits: OffsetLimits<D>,
    /// Timing.
    pub timing: Timing,
    /// Stops.
    pub stopping: Stopping,
    /// Whether the first valid sample without contact starts control.
    pub start_enabled: bool,
}

/// What the law cannot live with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterError {
    /// The horizon is 0, longer than [`MAX_STEPS`], or has a step that is not above zero.
    Horizon,
    /// T_s is not above zero.
    SamplingTime,
    /// A time constant of a joint is not above zero, or one of the wrench estimate is negative.
    TimeConstant,
    /// An input weight is not above zero: the QP would not be strictly convex.
    InputWeight,
    /// A release threshold is above its activation threshold, or one of them is negative.
    Thresholds,
    /// A force limit is not above its minimum force.
    ForceLimit,
    /// A damping is not above zero.
    Damping,
}

impl core::fmt::Display for ParameterError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Horizon => "the horizon must have 1 to 32 steps, each longer than 0 s",
            Self::SamplingTime => "the sampling time must be above 0 s",
            Self::TimeConstant => {
                "joint time constants must be above 0 s, those of the wrench estimate must not be negative"
            }
            Self::InputWeight => "input weights must be above 0",
            Self::Thresholds => "release thresholds must be between 0 and the activation threshold",
            Self::ForceLimit => "force limits must be above the minimum force",
            Self::Damping => "damping must be above 0",
        })
    }
}

impl core::error::Error for ParameterError {}

impl<const N: usize, const D: usize> Parameters<N, D> {
    /// The horizon of the MPC; the force is bounded at the end of every step.
    pub fn horizon(&self) -> Horizon<N, D> {
        Horizon::new(
            self.mpc.discretization,
            self.mpc.steps(),
            |_| &[],
            &self.velocity_time_constant,
            &self.wrench_time_constant,
        )
    }

    /// Checks what the law cannot live without.
    ///
    /// # Errors
    /// The first [`ParameterError`] found.
    pub fn check(&self) -> Result<(), ParameterError> {
        let positive = |value: &f64| *value > 0.0 && value.is_finite();
        let mpc = &self.mpc;
        if mpc.horizon == 0 || mpc.horizon > MAX_STEPS || !mpc.steps().iter().all(positive) {
            return Err(ParameterError::Horizon);
        }
        if !positive(&self.timing.sampling_time) {
            return Err(ParameterError::SamplingTime);
        }
        if !self.velocity_time_constant.iter().all(positive) || !self.wrench_time_constant.iter().all(|t| *t >= 0.0) {
            return Err(ParameterError::TimeConstant);
        }
        if !mpc.input_weight.iter().all(positive) {
            return Err(ParameterError::InputWeight);
        }
        let thresholds = &self.thresholds;
        if !(0..D).all(|a| 0.0 <= thresholds.release[a] && thresholds.release[a] <= thresholds.activation[a]) {
            return Err(ParameterError::Thresholds);
        }
        if !(0..D).all(|axis| mpc.minimum_force[axis] < mpc.force_limit[axis]) {
            return Err(ParameterError::ForceLimit);
        }
        match &self.law {
            Law::Damping { damping } if !damping.iter().all(positive) => Err(ParameterError::Damping),
            _ => Ok(()),
        }
    }
}
