//! Everything that a controller is told when it is made. The shell reads it from the configuration and checks the ranges;
//! [`Parameters::check`] repeats only what the law cannot live without.

use nalgebra::SVector;

use crate::constraints::Interval;
use crate::contact::{SurfaceSigns, Thresholds};
use crate::cost::Weights;
use crate::environment::Environment;
use crate::horizon::{Horizon, Parts};
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

/// Where the sign of a contact comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactSign {
    /// From f̂ when the axis joins; only axes in contact have bounds.
    Wrench,
    /// From the surface normal. In contact every axis with a normal component has an upper bound; one without cannot join.
    Normal,
}

/// When f_min holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LowerBound {
    /// As long as an axis is active (18e); it can make the problem infeasible.
    Always,
    /// Once it has been reached, and while ṗ0 does not point out of the surface; softly.
    OnceReached,
}

/// Where the force is bounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForcePoints {
    /// At the end of every step that an input reaches.
    StepEnds,
    /// Within steps as well: see [`Parts::dense`].
    Dense,
}

/// What losing a contact that should be kept leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnContactLost {
    /// On in free motion; it is counted.
    Continue,
    /// Zero joint velocity, latched.
    Stop,
}

/// Where the contact point comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContactPoint {
    /// [`Environment::contact`].
    Configured,
    /// From the first samples in contact, see [`detection`](crate::detection).
    Detected {
        /// Standard deviation of f̂ on one axis, in N: what the margin is reduced by follows from it.
        wrench_noise: f64,
    },
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
    /// Part of f_max by which a plan may exceed it before that counts as infeasible: what the linear model leaves out makes
    /// a plan that just kept the limit miss it a cycle later.
    pub limit_tolerance: f64,
    /// Where the sign of a contact comes from.
    pub sign: ContactSign,
    /// When f_min holds.
    pub lower_bound: LowerBound,
    /// Where the force is bounded.
    pub force_points: ForcePoints,
    /// Whether commands on their way are part of the model.
    pub models_delay: bool,
    /// Force along the inward normal that the cost aims at, in N; f_ref.
    pub normal_force_reference: f64,
    /// What infeasibility leads to.
    pub on_infeasible: OnInfeasible,
    /// What losing the contact leads to.
    pub on_contact_lost: OnContactLost,
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

/// Limits of joints and offset. Constraints of every optimisation; of what is not optimised, a clamp on the offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionLimits<const N: usize, const D: usize> {
    /// Largest |Δṗ| per axis, m/s and rad/s.
    pub offset: SVector<f64, D>,
    /// Rate at which the offset of a released axis returns to zero, m/s² and rad/s².
    pub release_rate: f64,
    /// Largest rate of the offset per axis toward the surface, and either way on an axis without a normal component; m/s²
    /// and rad/s².
    pub inward_rate: Option<SVector<f64, D>>,
    /// Largest rate of the offset per axis out of the surface, m/s² and rad/s².
    pub outward_rate: Option<SVector<f64, D>>,
    /// Largest joint speed reference, rad/s.
    pub joint_speed: Option<SVector<f64, N>>,
    /// Joint positions, rad.
    pub joint_position: Option<Interval<N>>,
}

/// Guards that do not trust the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guards {
    /// f̂ above f_max by more than this (N, N·m) stops.
    pub force: Option<f64>,
    /// A pressing force further than this (N) from the predicted one stops.
    pub mismatch: Option<f64>,
    /// So many cycles in a row.
    pub mismatch_cycles: u32,
}

/// Everything a controller is told when it is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters<const N: usize, const D: usize> {
    /// The arm.
    pub chain: Chain<N>,
    /// Reciprocal condition number of J below which the pose counts as singular; in contact a minimum-force stop begins there.
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
    /// Limits of joints and offset.
    pub limits: MotionLimits<N, D>,
    /// Where the contact point comes from.
    pub contact_point: ContactPoint,
    /// Guards.
    pub guards: Guards,
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
    /// f_min is not above the release threshold, or on a plane too large for some f_max.
    MinimumForce,
    /// The contact point is to be detected, but the estimates of the axes that feel it differ in T_est.
    Detection,
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
            Self::MinimumForce => {
                "where the minimum force holds once reached, it must be above the release threshold on every axis with a \
                 normal component n, and the largest of minimum_force / |n| below the smallest of force_limit / |n|"
            }
            Self::Detection => {
                "a detected contact point needs one wrench_time_constant_s on all axes with a normal component"
            }
        })
    }
}

impl core::error::Error for ParameterError {}

impl<const N: usize, const D: usize> Parameters<N, D> {
    /// The horizon of the MPC.
    pub fn horizon(&self) -> Horizon<N, D> {
        let lags = &self.velocity_time_constant;
        let steps = self.mpc.steps();
        let parts = match self.mpc.force_points {
            ForcePoints::StepEnds => Parts::none(),
            ForcePoints::Dense => Parts::dense(steps, lags.max()),
        };
        Horizon::new(self.mpc.discretization, steps, |step| parts.of(step), lags, &self.wrench_time_constant)
    }

    /// The signs of a contact that the surface gives.
    pub fn surface_signs(&self) -> SurfaceSigns<D> {
        SurfaceSigns::of(&self.environment.normal)
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
        if mpc.lower_bound == LowerBound::OnceReached && !self.can_hold_minimum() {
            return Err(ParameterError::MinimumForce);
        }
        let felt = || self.surface_signs().axes(&thresholds.admittance).map(|axis| self.wrench_time_constant[axis]);
        if self.contact_point != ContactPoint::Configured && felt().any(|lag| felt().next() != Some(lag)) {
            return Err(ParameterError::Detection);
        }
        match &self.law {
            Law::Damping { damping } if !damping.iter().all(positive) => Err(ParameterError::Damping),
            _ => Ok(()),
        }
    }

    /// On a plane all forces are one normal force: every bound on an axis is one on it.
    fn can_hold_minimum(&self) -> bool {
        let (mpc, normal) = (&self.mpc, &self.environment.normal);
        let bounded = || self.surface_signs().axes(&self.thresholds.admittance);
        let least = bounded().map(|axis| mpc.minimum_force[axis] / normal[axis].abs()).fold(0.0, f64::max);
        let most = bounded().map(|axis| mpc.force_limit[axis] / normal[axis].abs()).fold(f64::INFINITY, f64::min);
        least < most && bounded().all(|axis| self.thresholds.release[axis] < mpc.minimum_force[axis])
    }
}
