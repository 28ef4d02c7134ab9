//! The horizon: steps, and the instants at which the force is bounded. Nothing here changes between
//! cycles.

use nalgebra::SVector;

use crate::mpc::model::{CARRIED, Discretization, Step};
use crate::output::MAX_STEPS;
use crate::robot::VelocityLoops;

/// Largest number of instants at which the force is bounded.
pub const MAX_FORCE_POINTS: usize = 3 * MAX_STEPS;

/// An instant within a step, or at its end: q there = q + Σ a_c c + b r, of q and of what the
/// joints carry at the start of the step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForcePoint<const N: usize> {
    /// The step, from 0.
    pub step: usize,
    /// Seconds from the sample.
    pub time: f64,
    /// a, in the order of [`Step`].
    pub position_by: [SVector<f64, N>; CARRIED],
    /// b in s.
    pub position_by_reference: SVector<f64, N>,
}

/// The steps of the prediction with the model's constants for each.
#[derive(Debug, Clone)]
pub struct Horizon<const N: usize, const D: usize> {
    steps: [Step<N, D>; MAX_STEPS],
    until_rest: [SVector<f64, N>; CARRIED],
    /// Start of each step in s from the sample.
    starts: [f64; MAX_STEPS],
    /// Length of each step over the mean length.
    shares: [f64; MAX_STEPS],
    /// Which part of what fades is left in each step, on average.
    left: [f64; MAX_STEPS],
    len: usize,
    is_even: bool,
    follows_within: bool,
    points: [ForcePoint<N>; MAX_FORCE_POINTS],
    point_count: usize,
}

/// Whether any joint position at the end of an interval depends on the reference during it.
fn acts_at_once<const N: usize>(position_by_reference: &SVector<f64, N>) -> bool {
    position_by_reference.iter().any(|b| *b != 0.0)
}

/// Whether a wrench estimate at the end of a step depends on the motion within it.
fn follows_within<const N: usize, const D: usize>(step: &Step<N, D>) -> bool {
    step.wrench_by.iter().flatten().chain(&step.wrench_by_reference).any(|value| *value != 0.0)
}

impl<const N: usize, const D: usize> Horizon<N, D> {
    /// A horizon of steps with the given lengths in s. The force is bounded at the end of every
    /// step, and within step k at the parts of it (between 0 and 1, ascending) that `inside(k)`
    /// gives; instants that no input reaches are left out, and so is what exceeds [`MAX_STEPS`] or
    /// [`MAX_FORCE_POINTS`].
    pub fn new<'a>(
        discretization: Discretization,
        durations: &[f64],
        inside: impl Fn(usize) -> &'a [f64],
        loops: &VelocityLoops<N>,
        wrench_time_constant: &SVector<f64, D>,
    ) -> Self {
        let stretch = |duration| discretization.step(duration, loops, wrench_time_constant);
        let none = ForcePoint {
            step: 0,
            time: 0.0,
            position_by: [SVector::zeros(); CARRIED],
            position_by_reference: SVector::zeros(),
        };
        let mut horizon = Self {
            steps: [stretch(0.0); MAX_STEPS],
            until_rest: loops.until_rest(),
            starts: [0.0; MAX_STEPS],
            shares: [1.0; MAX_STEPS],
            left: [1.0; MAX_STEPS],
            len: durations.len().min(MAX_STEPS),
            is_even: durations.windows(2).all(|pair| pair[0] == pair[1]),
            follows_within: false,
            points: [none; MAX_FORCE_POINTS],
            point_count: 0,
        };
        let mean = durations.iter().sum::<f64>() / durations.len() as f64;
        let mut start = 0.0;
        for (step, &duration) in durations.iter().enumerate().take(MAX_STEPS) {
            horizon.steps[step] = stretch(duration);
            horizon.starts[step] = start;
            horizon.shares[step] = if horizon.is_even { 1.0 } else { duration / mean };
            horizon.follows_within |= follows_within(&horizon.steps[step]);
            for &part in inside(step).iter().chain(&[1.0]) {
                let to_here = stretch(duration * part);
                let reached = step > 0 || acts_at_once(&to_here.position_by_reference);
                if reached && horizon.point_count < MAX_FORCE_POINTS {
                    horizon.points[horizon.point_count] = ForcePoint {
                        step,
                        time: start + duration * part,
                        position_by: to_here.position_by,
                        position_by_reference: to_here.position_by_reference,
                    };
                    horizon.point_count += 1;
                }
            }
            start += duration;
        }
        horizon
    }

    /// The same horizon with the cost exactly as in (18a): every step counts once, whatever its
    /// length.
    #[must_use]
    pub fn counting_steps(mut self) -> Self {
        self.shares = [1.0; MAX_STEPS];
        self
    }

    /// The same horizon, in which the fading parts of set points decay with this time constant (s, finite and above 0), from its
    /// start on. Each step uses the mean over its length. Without this call they do not decay.
    #[must_use]
    pub fn fading_with(mut self, time_constant: f64) -> Self {
        for step in 0..self.len {
            let (start, duration) = (self.starts[step], self.steps[step].duration);
            let within = -libm::expm1(-duration / time_constant) * time_constant / duration;
            self.left[step] = libm::exp(-start / time_constant) * within;
        }
        self
    }

    /// The steps.
    pub fn steps(&self) -> &[Step<N, D>] {
        &self.steps[..self.len]
    }

    /// How many numbers the joints carry from step to step: 1 or [`CARRIED`].
    pub fn carried(&self) -> usize {
        self.steps[0].carried
    }

    /// How much further a joint moves by each of them until it rests under zero reference.
    pub fn until_rest(&self) -> &[SVector<f64, N>; CARRIED] {
        &self.until_rest
    }

    /// Whether all steps are of one length.
    pub fn is_even(&self) -> bool {
        self.is_even
    }

    /// Whether a wrench estimate at the end of a step depends on the motion within it: not under
    /// Euler, unless the force is measured ideally.
    pub fn follows_within(&self) -> bool {
        self.follows_within
    }

    /// The instants at which the force is bounded, in ascending order.
    pub fn force_points(&self) -> &[ForcePoint<N>] {
        &self.points[..self.point_count]
    }

    /// First step at whose end an input can have moved a joint.
    pub fn first_reached(&self) -> usize {
        usize::from(!acts_at_once(&self.steps[0].position_by_reference)).min(self.len)
    }

    /// How much step `step` counts in the cost: its length over the mean length. Over even steps
    /// all count once, as in (18a); over uneven ones the cost stays an integral over time.
    pub fn share(&self, step: usize) -> f64 {
        self.shares[step]
    }

    /// Which part of what fades is left in step `step`, on average; 1 where nothing does.
    pub fn left_in(&self, step: usize) -> f64 {
        self.left[step]
    }

    /// Time in s for which the input before step `step` has acted: the length of the step before; of the first
    /// that of itself, since inputs follow one another as quickly from cycle to cycle.
    pub fn since_change(&self, step: usize) -> f64 {
        self.steps[step.saturating_sub(1)].duration
    }

    /// That over the same before the step before: 1 where they are alike.
    pub(crate) fn since_ratio(&self, step: usize) -> f64 {
        self.since_change(step) / self.since_change(step.saturating_sub(1))
    }

    /// Start of step `step` in s from the sample.
    pub fn start_of(&self, step: usize) -> f64 {
        self.starts[step]
    }
}
