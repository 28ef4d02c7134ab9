//! Settings of the MPC: horizon, cost, bounds. Two profiles of one implementation, the paper's and
//! the default one, differ in these options only.

use nalgebra::SVector;

use crate::mpc::cost::Weights;
use crate::mpc::force_points::Parts;
use crate::mpc::horizon::Horizon;
use crate::mpc::model::Discretization;
use crate::output::MAX_STEPS;
use crate::quantities::Span;
use crate::robot::VelocityLoops;

/// Which axes get an input once any axis is in contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputSelection {
    /// The axes in contact (III.C).
    Active,
    /// Every admittance axis.
    All,
}

/// When f_min holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LowerBound {
    /// As long as an axis is active (18e); it can make the problem infeasible.
    Always,
    /// Once it has been reached, and while ṗ0 does not point out of the surface; as a soft bound.
    OnceReached,
}

/// How fast the arm may be commanded into the surface while it is in contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InwardSpeed {
    /// As fast as the other limits allow: the model is trusted to stop it in time.
    Free,
    /// As fast as ṗ0 has moved in during this contact.
    Approach,
}

/// Where the force is bounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForcePoints {
    /// At the end of every step that an input reaches.
    StepEnds,
    /// Within steps as well, at times that grow.
    Dense,
}

/// The options.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options<const N: usize, const D: usize> {
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
    /// Part of f_max by which a plan may exceed it before that counts as infeasible: a plan that
    /// just kept the limit would miss it a cycle later, by what the linear model leaves out.
    pub limit_tolerance: f64,
    /// By how many seconds later than the model says the arm may follow its commands.
    pub lag_tolerance: f64,
    /// By what share of T_est the lag of f̂ may be longer than told.
    pub wrench_lag_tolerance: f64,
    /// When f_min holds.
    pub lower_bound: LowerBound,
    /// How fast the arm may be commanded into the surface.
    pub inward_speed: InwardSpeed,
    /// Where the force is bounded.
    pub force_points: ForcePoints,
    /// Whether commands on their way are part of the model.
    pub models_delay: bool,
    /// Force along the inward normal that the cost aims at, in N; f_ref.
    pub normal_force_reference: f64,
    /// Largest KKT residual of a solution that may be used, relative to the values that it is made
    /// of.
    pub solution_tolerance: f64,
}

impl<const N: usize, const D: usize> Options<N, D> {
    /// Lengths of the H steps in s.
    pub fn steps(&self) -> &[f64] {
        &self.steps[..self.horizon.min(MAX_STEPS)]
    }

    /// How long one input is held: a cycle, or a piece of one.
    pub fn tick(&self, sampling_time: Span) -> Span {
        let first = self.steps().first().map_or(sampling_time, |step| Span::from_seconds(*step));
        first.min(sampling_time)
    }

    /// The horizon for these speed loops and a wrench estimate with T_est, in s.
    pub fn horizon(
        &self,
        sampling_time: f64,
        loops: &VelocityLoops<N>,
        wrench_time_constant: &SVector<f64, D>,
    ) -> Horizon<N, D> {
        let steps = self.steps();
        let parts = match self.force_points {
            ForcePoints::StepEnds => Parts::none(),
            ForcePoints::Dense => Parts::dense(steps, sampling_time, loops.slowest()),
        };
        Horizon::new(self.discretization, steps, |step| parts.of(step), loops, wrench_time_constant)
    }
}
