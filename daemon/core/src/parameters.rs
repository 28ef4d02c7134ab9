//! The parameters of a controller, and which stage gets which. They never change: what is learned
//! belongs to [`belief`](crate::belief).

use nalgebra::{Matrix3, SVector};

use crate::belief::{self, ContactPoint, ContactSign, ImpactModel, SurfaceSigns, Thresholds};
use crate::intake::{self, Conditioning, Timing, TorqueModel, WrenchSource};
use crate::mpc::condensation::{Capacity, MAX_ROWS};
use crate::mpc::{self, Discretization, LowerBound, Options, SolverCapacity};
use crate::output::{self, Law, MAX_STEPS};
use crate::quantities::Span;
use crate::redundancy::{self, Redundancy};
use crate::robot::{Chain, DriveLimits, MotionLimits, VelocityLoops};
use crate::supervisor::{self, Guards, Policy};
use crate::surface::Surface;
use crate::turn::Turn;

/// How a stop goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stopping {
    /// Speed in m/s along the outward normal of the open-loop retreat, and the limit for a stopped
    /// arm that moves away.
    pub retreat_speed: f64,
    /// Longest open-loop retreat.
    pub retreat_time: Span,
    /// Pressing force in N below which a stop may come to rest.
    pub stop_force: f64,
    /// Longest duration of a minimum-force stop; after it the arm is held, whatever the force.
    pub stop_timeout: Span,
}

/// The parameters of a controller. The runner reads them from the configuration and checks the
/// ranges; [`Parameters::check`] repeats only the checks that the law depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters<const N: usize, const D: usize> {
    /// The arm.
    pub chain: Chain<N>,
    /// Reciprocal condition number of J below which the pose counts as singular; in contact a
    /// minimum-force stop begins there.
    pub minimum_reciprocal_condition: f64,
    /// What the joints do beside the task; `None` leaves the resolution of a twist to the motion controller,
    /// by the least norm.
    pub redundancy: Option<Redundancy<N>>,
    /// The joint speed loops.
    pub loops: VelocityLoops<N>,
    /// T_est per axis in s; 0 for ideal force measurement.
    pub wrench_time_constant: SVector<f64, D>,
    /// By how much later f̂ shows the force, besides that lag.
    pub wrench_dead_time: Span,
    /// Standard deviation of f̂ per axis in N and N·m, as it is told; 0 where it is not.
    pub wrench_noise: SVector<f64, D>,
    /// Where the wrench comes from.
    pub wrench_source: WrenchSource<N>,
    /// How f̂ follows from the wrench as it is given.
    pub conditioning: Conditioning<D>,
    /// The surface.
    pub surface: Surface<D>,
    /// Where its contact point comes from.
    pub contact_point: ContactPoint,
    /// β and the release threshold.
    pub thresholds: Thresholds<D>,
    /// Where the sign of a contact comes from.
    pub sign: ContactSign,
    /// Which law answers.
    pub law: Law<D>,
    /// The MPC; a minimum-force stop uses its model, horizon and limits under every law.
    pub mpc: Options<N, D>,
    /// What an impact is reckoned with; `None` where no masses are told.
    pub impact: Option<ImpactModel<N>>,
    /// Limits of joints and offset.
    pub limits: MotionLimits<N, D>,
    /// What to do about a force that cannot be kept.
    pub policy: Policy,
    /// Guards.
    pub guards: Guards,
    /// Timing.
    pub timing: Timing,
    /// Stops.
    pub stopping: Stopping,
    /// Whether the first valid sample without contact starts control.
    pub start_enabled: bool,
}

impl<const N: usize, const D: usize> Parameters<N, D> {
    /// The same with everything expressed in another frame, whose `axes` are given in the present one as
    /// columns: arm, surface and conditioning of a wrench that samples give. Limits, thresholds and
    /// weights are of its directions.
    #[must_use]
    pub fn seen_from(&self, axes: &Matrix3<f64>) -> Self {
        let turn = Turn::between(&Matrix3::identity(), axes);
        Self {
            chain: self.chain.seen_from(&turn),
            surface: self.surface.turned(&turn),
            conditioning: self.conditioning.seen_from(&turn),
            impact: self.impact.map(|model| model.seen_from(&turn)),
            ..*self
        }
    }
}

/// What each stage is told.
impl<const N: usize, const D: usize> Parameters<N, D> {
    pub(crate) fn intake(&self) -> intake::Settings<N, D> {
        intake::Settings {
            chain: self.chain,
            timing: self.timing,
            conditioning: self.conditioning,
            wrench_time_constant: self.wrench_time_constant,
            wrench_lag_tolerance: self.mpc.wrench_lag_tolerance,
            resolves: self.redundancy.is_some(),
            joint_speed: self.limits.joint_speed,
            source: self.wrench_source,
            surface: self.surface,
            // A force that may be off by more than its limit says nothing of it.
            largest_deviation: SVector::from_fn(|axis, _| match self.thresholds.admittance[axis] {
                true => self.mpc.force_limit[axis] / 3.0,
                false => f64::INFINITY,
            }),
        }
    }

    pub(crate) fn belief(&self) -> belief::Settings<D> {
        belief::Settings {
            surface: self.surface,
            contact_point: self.contact_point,
            thresholds: self.thresholds,
            sign: self.sign,
            wrench_time_constant: self.wrench_time_constant,
            wrench_dead_time: self.wrench_dead_time,
            wrench_noise: self.wrench_noise,
            force_limit: self.mpc.force_limit,
            sampling_time: self.timing.sampling_time,
        }
    }

    /// Time from one streamed reference to the next: a cycle, or the inputs within it.
    pub fn tick(&self) -> Span {
        self.mpc.tick(self.timing.sampling_time)
    }

    /// Whether the way into the surface has to be known within a cycle: where the surface is learned,
    /// and where its point is detected while several inputs within a cycle bend the way.
    pub(crate) fn follows_way(&self) -> bool {
        match self.contact_point {
            ContactPoint::Configured => false,
            ContactPoint::Detected { .. } => {
                self.mpc.steps().first().is_some_and(|step| *step < self.timing.sampling_time.seconds())
            }
            ContactPoint::Learned(_) => true,
        }
    }

    pub(crate) fn null_motion(&self) -> redundancy::Settings<N> {
        redundancy::Settings::new(self.redundancy, &self.limits, self.timing, self.tick())
    }

    pub(crate) fn supervisor(&self) -> supervisor::Settings<D> {
        supervisor::Settings {
            predicts: match self.law {
                Law::Mpc => true,
                Law::Damping { .. } => false,
            },
            policy: self.policy,
            thresholds: self.thresholds,
            sign: self.sign,
            force_limit: self.mpc.force_limit,
            limit_tolerance: self.mpc.limit_tolerance,
            wrench_noise: self.wrench_noise,
            minimum_force: self.mpc.minimum_force,
            lower_bound: self.mpc.lower_bound,
            inward_speed: self.mpc.inward_speed,
            guards: self.guards,
            timing: self.timing,
            minimum_reciprocal_condition: self.minimum_reciprocal_condition,
            retreat_time: self.stopping.retreat_time,
            stop_timeout: self.stopping.stop_timeout,
            start_enabled: self.start_enabled,
        }
    }

    pub(crate) fn mpc(&self) -> mpc::Settings<N, D> {
        mpc::Settings {
            options: self.mpc,
            loops: self.loops,
            wrench_time_constant: self.wrench_time_constant,
            admittance: self.thresholds.admittance,
            limits: self.limits,
            timing: self.timing,
            stop_force: self.stopping.stop_force,
        }
    }

    pub(crate) fn output(&self) -> output::Settings<N, D> {
        output::Settings {
            law: self.law,
            admittance: self.thresholds.admittance,
            offset_limit: self.limits.offset,
            release_rate: self.limits.release_rate,
            // With a limit on its rate the offset may not jump; and the paper's ramp starts from
            // the last offset.
            may_settle: self.limits.inward_rate.is_none()
                && self.limits.drives.is_none()
                && self.mpc.lower_bound == LowerBound::OnceReached,
            drives: self.limits.drives,
            tick: self.tick(),
            resolves: self.redundancy.is_some(),
            retreat_speed: self.stopping.retreat_speed,
            minimum_reciprocal_condition: self.minimum_reciprocal_condition,
            timing: self.timing,
        }
    }
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
    /// A damping, dead time or lag of the speed loops is negative or no number; the dead times
    /// differ by more than the shortest step; the longest, with the command delay, is longer than
    /// [`MAX_DELAY_CYCLES`](output::MAX_DELAY_CYCLES); or there is one of these, and the model is
    /// not exact or leaves delays out.
    VelocityLoops,
    /// There are more admittance axes than joints.
    AdmittanceAxes,
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
    /// The contact point is to be detected, but the estimates of the axes that feel it differ in
    /// T_est, or have a dead time.
    Detection,
    /// The wrench has a dead time longer than [`MAX_DELAY_CYCLES`](output::MAX_DELAY_CYCLES), or a
    /// tool whose inertia would come late as well, or the model is not exact or leaves delays out.
    WrenchDeadTime,
    /// The wrench is to follow from motor torques, and the axes differ in T_est, or it is 0, or there is a dead
    /// time; or the noise of torques or velocity is not above zero.
    MotorTorque,
    /// A limit of the drives is not above zero.
    DriveLimits,
    /// The storage is shorter than the horizon needs.
    Storage,
}

impl core::fmt::Display for ParameterError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Horizon => "the horizon must have 1 to 32 steps, each longer than 0 s",
            Self::SamplingTime => "the sampling time must be above 0 s",
            Self::TimeConstant => {
                "joint time constants must be above 0 s, those of the wrench estimate must not be negative"
            }
            Self::VelocityLoops => {
                "damping, dead times and lags of the speed loops must not be negative, the dead times must not differ \
                 by more than the shortest step, no longer than 8 sampling times with the command delay, and the \
                 discretization must be exact"
            }
            Self::AdmittanceAxes => "no more axes may give way than the arm has joints",
            Self::InputWeight => "input weights must be above 0",
            Self::Thresholds => "release thresholds must be between 0 and the activation threshold",
            Self::ForceLimit => "force limits must be above the minimum force",
            Self::Damping => "damping must be above 0",
            Self::MinimumForce => {
                "where the minimum force holds once reached, it must be above the release threshold on every axis \
                 with a normal component n, and the largest of minimum_force / |n| below the smallest of \
                 force_limit / |n|"
            }
            Self::Detection => {
                "a detected contact point needs one wrench_time_constant_s on all axes with a normal component, and \
                 no dead time of the wrench"
            }
            Self::WrenchDeadTime => {
                "a dead time of the wrench must be at most 8 sampling times, with exact discretization, modelled delays \
                 and no tool whose inertia is compensated"
            }
            Self::MotorTorque => {
                "a wrench from motor torques needs one wrench_time_constant_s above 0 s on all axes, no dead time, and noise \
                 of torques and velocity above 0"
            }
            Self::DriveLimits => "speed, acceleration and jerk of the joints must be above 0",
            Self::Storage => "the storage of the MPC is shorter than its horizon needs",
        })
    }
}

impl core::error::Error for ParameterError {}

impl<const N: usize, const D: usize> Parameters<N, D> {
    /// The largest problem of the MPC.
    pub fn solver_capacity(&self) -> SolverCapacity {
        SolverCapacity { variables: self.admittance_axes() * self.mpc.horizon + 1, rows: MAX_ROWS }
    }

    fn admittance_axes(&self) -> usize {
        self.thresholds.admittance.iter().filter(|admittance| **admittance).count()
    }

    /// Numbers that the MPC needs for its matrices.
    pub fn storage_len(&self) -> usize {
        Capacity::new::<N, D>(self.mpc.horizon, mpc::carried_by(&self.loops)).storage_len()
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
        if !positive(&self.timing.sampling_time.seconds()) {
            return Err(ParameterError::SamplingTime);
        }
        if !self.loops.time_constant.iter().all(positive) || !self.wrench_time_constant.iter().all(|t| *t >= 0.0) {
            return Err(ParameterError::TimeConstant);
        }
        if !self.can_predict_loops() {
            return Err(ParameterError::VelocityLoops);
        }
        if self.admittance_axes() > N {
            return Err(ParameterError::AdmittanceAxes);
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
        let felt = || self.felt_axes().map(|axis| self.wrench_time_constant[axis]);
        let is_detected = self.contact_point != ContactPoint::Configured;
        if is_detected && (self.wrench_dead_time > Span::default() || felt().any(|lag| felt().next() != Some(lag))) {
            return Err(ParameterError::Detection);
        }
        if self.wrench_dead_time > Span::default() && !self.can_wait_for_wrench() {
            return Err(ParameterError::WrenchDeadTime);
        }
        if let WrenchSource::MotorTorque(model) = &self.wrench_source
            && !self.can_observe(model)
        {
            return Err(ParameterError::MotorTorque);
        }
        if let Some(drives) = &self.limits.drives {
            let DriveLimits { speed, acceleration, jerk } = &drives.limits;
            if !speed.iter().chain(acceleration).chain(jerk).all(|limit| *limit > 0.0) {
                return Err(ParameterError::DriveLimits);
            }
        }
        match &self.law {
            Law::Damping { damping } if !damping.iter().all(positive) => Err(ParameterError::Damping),
            _ => Ok(()),
        }
    }

    /// Whether the model can have these speed loops.
    fn can_predict_loops(&self) -> bool {
        let (loops, mpc) = (&self.loops, &self.mpc);
        let known = |value: &f64| *value >= 0.0 && value.is_finite();
        let shortest = mpc.steps().iter().copied().fold(f64::INFINITY, f64::min);
        let most = self.timing.sampling_time * output::MAX_DELAY_CYCLES;
        let delay = self.timing.command_delay + Span::from_seconds(loops.dead_time.max());
        let is_simple = loops.is_plain() && loops.dead_time.max() == 0.0 && loops.report_lag == 0.0;
        loops.damping.iter().chain(&loops.dead_time).chain([&loops.report_lag]).all(known)
            && Span::from_seconds(loops.further_dead_time().max()) <= Span::from_seconds(shortest)
            && (is_simple || (mpc.discretization == Discretization::Zoh && mpc.models_delay))
            && (is_simple || delay <= most)
    }

    /// Whether a wrench that comes late can be expected.
    fn can_wait_for_wrench(&self) -> bool {
        self.wrench_dead_time <= self.timing.sampling_time * output::MAX_DELAY_CYCLES
            && self.mpc.discretization == Discretization::Zoh
            && self.mpc.models_delay
            && self.conditioning.tool_mass == 0.0
    }

    /// Whether the observer has one lag, and noise to weigh.
    fn can_observe(&self, model: &TorqueModel<N>) -> bool {
        let lags = &self.wrench_time_constant;
        lags.iter().all(|lag| *lag > 0.0 && *lag == lags.max())
            && self.wrench_dead_time == Span::ZERO
            && model.torque_noise.iter().chain([&model.velocity_noise]).all(|noise| *noise > 0.0)
    }

    /// The admittance axes that feel the surface.
    fn felt_axes(&self) -> impl Iterator<Item = usize> + use<N, D> {
        SurfaceSigns::of(&self.surface.normal).axes(&self.thresholds.admittance)
    }

    /// On a plane all forces are components of one normal force: every bound on an axis bounds it.
    fn can_hold_minimum(&self) -> bool {
        let (mpc, normal) = (&self.mpc, &self.surface.normal);
        let bounded = || self.felt_axes();
        let least = bounded().map(|axis| mpc.minimum_force[axis] / normal[axis].abs()).fold(0.0, f64::max);
        let most = bounded().map(|axis| mpc.force_limit[axis] / normal[axis].abs()).fold(f64::INFINITY, f64::min);
        least < most && bounded().all(|axis| self.thresholds.release[axis] < mpc.minimum_force[axis])
    }
}
