//! The prediction: a problem in, a solution out. In contact it is (18), in a stop the least
//! violation of the force limit; both predict with one model, are condensed, solved and checked by
//! the same code. This stage never sees the mode.
//!
//! The path of a problem, file by file: `situation` (what is known when the inputs begin to
//! act) → `contact` or `stop` (cost and bounds) → [`model`] (17) over a [`horizon`]
//! → [`condensation`] (one dense QP) → [`warm_start`] → [`qp`] (solve and check) → `verdict`.
//!
//! ```
//! use admittance_core::mpc::Verdict;
//! # use admittance_core::Controller;
//! # use admittance_core::intake::{Event, Sample};
//! # use admittance_core::mpc::ActiveSet;
//! # use admittance_core::quantities::{GivenWrench, Instant, Span};
//! # use nalgebra::{Vector2, Vector6};
//! # mod planar { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/doc/planar_arm.rs")); }
//! # let mut parameters = planar::planar_arm();
//! # parameters.limits.joint_speed = Some(Vector2::repeat(0.05));
//! # let capacity = parameters.solver_capacity();
//! # let solver = ActiveSet::new(capacity, 100, vec![0.0; capacity.storage_len()]).unwrap();
//! # let storage = vec![0.0; parameters.storage_len()];
//! # let q = Vector2::new(1.2097, -1.4682);
//! # let mut sample = Sample {
//! #     sequence: 1,
//! #     stamp: Instant::from_nanoseconds(1_000_000_000),
//! #     boot_id: 7,
//! #     joint_count: 2,
//! #     wrench_valid: true,
//! #     drives_enabled: true,
//! #     joint_position: q,
//! #     joint_velocity: Vector2::zeros(),
//! #     joint_position_reference: q,
//! #     joint_velocity_reference: None,
//! #     twist_reference: Vector2::new(0.0, -0.05),
//! #     wrench: GivenWrench(Vector6::zeros()),
//! #     torque_valid: false,
//! #     joint_torque: Vector2::zeros(),
//! # };
//! # sample.joint_position.x -= 0.0031;
//! # let mut controller = Controller::new(parameters, solver, storage).unwrap();
//! # let _ = controller.step(Event::Sample(&sample), sample.stamp, &mut || false);
//! # sample.sequence += 1;
//! # sample.stamp = sample.stamp + Span::from_seconds(0.004);
//!
//! // 3 mm deep in a surface of 1e5 N/m, 200 N allowed: at 0.05 rad/s no input helps in time.
//! sample.wrench = GivenWrench(Vector6::new(-120.0, -260.0, 0.0, 0.0, 0.0, 0.0));
//! let answer = controller.step(Event::Sample(&sample), sample.stamp, &mut || false);
//! let outcome = answer.outcome;
//! let Verdict::Infeasible { shortfall, .. } = outcome.verdict else { panic!("{outcome:?}") };
//! assert!(shortfall > 0.0, "newtons above what is allowed");
//! ```

mod beyond;
#[doc(hidden)]
pub mod condensation;
#[doc(hidden)]
pub mod constraints;
mod contact;
#[doc(hidden)]
pub mod cost;
mod drive_way;
mod every_surface;
mod fastest_outward;
#[doc(hidden)]
pub mod force_points;
mod full_outward;
mod growing_steps;
#[doc(hidden)]
pub mod horizon;
mod impact;
mod inward_speed;
mod joint_response;
mod late_arm;
#[doc(hidden)]
pub mod model;
mod options;
#[doc(hidden)]
pub mod qp;
mod situation;
mod solve;
mod step;
mod stop;
#[cfg(test)]
mod tests;
mod too_fast;
mod verdict;
#[doc(hidden)]
pub mod warm_start;

use nalgebra::SVector;

pub use cost::Weights;
pub use growing_steps::{GROWING_STEPS, growing_steps};
pub use model::Discretization;
pub use options::{ForcePoints, InputSelection, InwardSpeed, LowerBound, Options};
pub use qp::{ActiveSet, QpSolver, SolverCapacity};
pub(crate) use situation::Situation;
pub(crate) use step::carried_by;
pub use verdict::Verdict;

use crate::intake::Timing;
use crate::output::Plan;
use crate::robot::{MotionLimits, VelocityLoops};
use condensation::Workspace;
use horizon::Horizon;
use warm_start::WarmStart;

/// Settings of this stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settings<const N: usize, const D: usize> {
    /// Horizon, cost and bounds.
    pub options: Options<N, D>,
    /// The joint speed loops.
    pub loops: VelocityLoops<N>,
    /// T_est per axis in s; 0 for ideal force measurement.
    pub wrench_time_constant: SVector<f64, D>,
    /// Axes that admittance control may take over.
    pub admittance: [bool; D],
    /// Limits of joints and offset.
    pub limits: MotionLimits<N, D>,
    /// When commands act.
    pub timing: Timing,
    /// Pressing force in N below which a stop may come to rest.
    pub stop_force: f64,
}

/// What a contact requires of a prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Demand<const D: usize> {
    /// Axes in contact.
    pub active: [bool; D],
    /// s of every axis whose force is bounded; 0 of the others.
    pub signs: [f64; D],
    /// Lower bound of s·f_lin in N; −∞ where none holds.
    pub minimum: [f64; D],
    /// The force that is to be kept in N, where a lower bound holds: the bound, or more.
    pub kept: [f64; D],
    /// Largest speed into the surface that may be commanded, m/s; ∞ where it is not bounded.
    pub inward_speed: f64,
    /// Whether the arm has been brought to a halt, and the force is to settle.
    pub settles: bool,
}

/// What became of a problem.
#[derive(Debug, Clone, Copy, PartialEq)]
#[must_use]
pub(crate) enum Solution<P> {
    /// Solved.
    Planned {
        /// The inputs, as offsets to ṗ0.
        plan: P,
        /// Whether the force bounds are met.
        verdict: Verdict,
        /// Iterations of the solver.
        iterations: u32,
    },
    /// Proven infeasible.
    Infeasible {
        /// The proof in newtons.
        verdict: Verdict,
        /// Iterations of the solver.
        iterations: u32,
    },
    /// Out of time.
    Expired {
        /// The iteration at which it was.
        iterations: u32,
    },
    /// No answer, or one that does not pass the checks.
    Failed {
        /// Iterations of the solver.
        iterations: u32,
    },
}

/// The stage.
#[derive(Debug)]
pub(crate) struct Mpc<const N: usize, const D: usize, S, B> {
    settings: Settings<N, D>,
    solver: S,
    horizon: Horizon<N, D>,
    workspace: Workspace<B>,
    warm_start: WarmStart,
    /// The last solution.
    plan: Plan<D>,
    /// s·f_lin in N at which a stop was found standing above the limit, until it is below.
    stuck_at: Option<SVector<f64, D>>,
}

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Mpc<N, D, S, B> {
    /// A stage that has solved nothing yet; `None` when `storage` is shorter than the
    /// [`Capacity`](condensation::Capacity) of the horizon asks for.
    pub(crate) fn new(settings: Settings<N, D>, solver: S, storage: B) -> Option<Self> {
        let options = &settings.options;
        let horizon = options
            .horizon(settings.timing.sampling_time.seconds(), &settings.loops, &settings.wrench_time_constant)
            .fading_with(settings.settling_time());
        Some(Self {
            workspace: Workspace::new(&horizon, &options.weights, storage)?,
            horizon,
            warm_start: WarmStart::empty(),
            plan: Plan::empty(),
            stuck_at: None,
            settings,
            solver,
        })
    }

    /// Forgets earlier problems: a contact has ended. Otherwise the last bits of the
    /// next would depend on it, and a replay may begin between them.
    pub(crate) fn forget(&mut self) {
        self.warm_start.forget();
        self.stuck_at = None;
    }
}

impl<P> Solution<P> {
    /// Iterations of the solver.
    pub(crate) fn iterations(&self) -> u32 {
        match *self {
            Self::Planned { iterations, .. }
            | Self::Infeasible { iterations, .. }
            | Self::Expired { iterations }
            | Self::Failed { iterations } => iterations,
        }
    }

    /// The iteration at which time was up.
    pub(crate) fn expired_iteration(&self) -> Option<u32> {
        matches!(self, Self::Expired { .. }).then_some(self.iterations())
    }

    /// The verdict, if there is an answer.
    pub(crate) fn verdict(&self) -> Verdict {
        match self {
            Self::Planned { verdict, .. } | Self::Infeasible { verdict, .. } => *verdict,
            Self::Expired { .. } | Self::Failed { .. } => Verdict::None,
        }
    }

    fn with<Q>(self, plan: Q) -> Solution<Q> {
        match self {
            Self::Planned { verdict, iterations, .. } => Solution::Planned { plan, verdict, iterations },
            Self::Infeasible { verdict, iterations } => Solution::Infeasible { verdict, iterations },
            Self::Expired { iterations } => Solution::Expired { iterations },
            Self::Failed { iterations } => Solution::Failed { iterations },
        }
    }

    /// The same with the iterations of a problem before it.
    fn after(mut self, before: u32) -> Self {
        let (Self::Planned { iterations, .. }
        | Self::Infeasible { iterations, .. }
        | Self::Expired { iterations }
        | Self::Failed { iterations }) = &mut self;
        *iterations += before;
        self
    }

    /// The same with its verdict counted from the sample, which is `delay` s before its inputs act.
    fn shifted(mut self, delay: f64) -> Self {
        if let Self::Planned { verdict, .. } | Self::Infeasible { verdict, .. } = &mut self {
            verdict.shift(delay);
        }
        self
    }
}
