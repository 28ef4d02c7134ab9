//! The horizon: steps, and the instants at which the force is bounded. Nothing here changes between cycles.

use nalgebra::SVector;

use crate::model::{Discretization, Step};
use crate::plan::MAX_STEPS;

/// Largest number of instants at which the force is bounded.
pub const MAX_FORCE_POINTS: usize = 3 * MAX_STEPS;

/// An instant within a step, or at its end: q there = q + a q̇ + b r, of q and q̇ at the start of the step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForcePoint<const N: usize> {
    /// The step, from 0.
    pub step: usize,
    /// Seconds from the sample.
    pub time: f64,
    /// a in s.
    pub position_by_velocity: SVector<f64, N>,
    /// b in s.
    pub position_by_reference: SVector<f64, N>,
}

/// The steps of the prediction with the model's constants for each.
#[derive(Debug, Clone)]
pub struct Horizon<const N: usize, const D: usize> {
    steps: [Step<N, D>; MAX_STEPS],
    /// Start of each step in s from the sample.
    starts: [f64; MAX_STEPS],
    /// Length of each step over the mean length.
    shares: [f64; MAX_STEPS],
    len: usize,
    is_even: bool,
    follows_within: bool,
    points: [ForcePoint<N>; MAX_FORCE_POINTS],
    point_count: usize,
}

/// The first point is this part of a sampling time after the inputs begin to act.
const FIRST_POINT: f64 = 1.0 / 32.0;
/// Each later one is later by this part.
const POINT_GROWTH: f64 = 1.0 / 7.0;
/// Points closer to the end of their step than this part of it are left to the end.
const NEAR_END: f64 = 0.02;

/// Parts of steps at whose ends the force is bounded, besides at the ends of the steps.
#[derive(Debug, Clone)]
pub struct Parts {
    parts: [f64; MAX_FORCE_POINTS],
    /// First and last plus one of each step.
    ranges: [(usize, usize); MAX_STEPS],
}

impl Parts {
    /// None: the force is bounded at the ends of the steps.
    pub fn none() -> Self {
        Self { parts: [0.0; MAX_FORCE_POINTS], ranges: [(0, 0); MAX_STEPS] }
    }

    /// Points whose times grow by 1/7 from one to the next, from 1/32 of the first step on until `slowest_lag` s have passed.
    ///
    /// Between two points δ apart a force exceeds the larger of them by at most δ² f̈ / 8. To come to standstill after t a
    /// speed v must fall by v/t a second, so that f̈ is k v/t, while the force rises by k v t / 2 until then; with δ = t/7 what
    /// is missed is 1/200 of what the force still rises by. A force that peaks late is looked at closer when its time comes:
    /// only the first sampling time of a plan is ever acted on before the next. What joints that still accelerate add within
    /// the first point is below 1/8000 of K_e Δ T_s²/T_V for a change Δ of their speed reference.
    pub fn dense(durations: &[f64], slowest_lag: f64) -> Self {
        let mut parts = Self::none();
        let (mut start, mut count) = (0.0, 0);
        let mut time = durations.first().map_or(0.0, |first| first * FIRST_POINT);
        for (&duration, range) in durations.iter().zip(&mut parts.ranges) {
            range.0 = count;
            while time < (start + duration * (1.0 - NEAR_END)).min(slowest_lag) && count < MAX_FORCE_POINTS - MAX_STEPS
            {
                if time > start {
                    parts.parts[count] = (time - start) / duration;
                    count += 1;
                }
                time *= 1.0 + POINT_GROWTH;
            }
            range.1 = count;
            start += duration;
            // The end of the step is a point itself.
            time = if time < start { start * (1.0 + POINT_GROWTH) } else { time };
        }
        parts
    }

    /// Those of one step, ascending, each above 0 and below 1.
    pub fn of(&self, step: usize) -> &[f64] {
        let (first, end) = self.ranges[step];
        &self.parts[first..end]
    }
}

/// Longest horizon of [`growing_steps`].
const GROWING_STEPS: usize = 16;
/// How many of them have the length of the first.
const EVEN_STEPS: usize = 4;

/// At most 16 step lengths in s that span `span` s: the first four of one sampling time each, the others growing by one
/// ratio; where even steps reach as far, fewer of those. A fast cycle needs a horizon as long in time as a slow one.
pub fn growing_steps(sampling_time: f64, span: f64) -> ([f64; MAX_STEPS], usize) {
    let mut steps = [0.0; MAX_STEPS];
    let even = libm::ceil(span / sampling_time - 1e-9).max(EVEN_STEPS as f64);
    if even <= GROWING_STEPS as f64 {
        steps.fill(sampling_time);
        return (steps, even as usize);
    }
    let growing = |ratio: f64| {
        (1..=GROWING_STEPS - EVEN_STEPS).fold((1.0, 0.0), |(length, sum), _| (length * ratio, sum + length * ratio)).1
    };
    let missing = span / sampling_time - EVEN_STEPS as f64;
    let (mut low, mut high) = (1.0, 100.0);
    for _ in 0..60 {
        let ratio = (low + high) / 2.0;
        if growing(ratio) < missing { low = ratio } else { high = ratio }
    }
    let mut length = sampling_time;
    for (index, step) in steps[..GROWING_STEPS].iter_mut().enumerate() {
        if index >= EVEN_STEPS {
            length *= low;
        }
        *step = length;
    }
    (steps, GROWING_STEPS)
}

/// Whether any joint position at the end of a stretch depends on the reference during it.
fn acts_at_once<const N: usize>(position_by_reference: &SVector<f64, N>) -> bool {
    position_by_reference.iter().any(|b| *b != 0.0)
}

/// Whether a wrench estimate at the end of a step depends on the motion within it.
fn follows_within<const N: usize, const D: usize>(step: &Step<N, D>) -> bool {
    step.wrench_by_velocity.iter().chain(&step.wrench_by_reference).any(|value| *value != 0.0)
}

impl<const N: usize, const D: usize> Horizon<N, D> {
    /// A horizon of steps with the given lengths in s. The force is bounded at the end of every step, and within step k
    /// at the parts of it (between 0 and 1, ascending) that `inside(k)` gives; instants that no input reaches are left out,
    /// and so is what exceeds [`MAX_STEPS`] or [`MAX_FORCE_POINTS`].
    pub fn new<'a>(
        discretization: Discretization,
        durations: &[f64],
        inside: impl Fn(usize) -> &'a [f64],
        velocity_time_constant: &SVector<f64, N>,
        wrench_time_constant: &SVector<f64, D>,
    ) -> Self {
        let stretch = |duration| discretization.step(duration, velocity_time_constant, wrench_time_constant);
        let none = ForcePoint {
            step: 0,
            time: 0.0,
            position_by_velocity: SVector::zeros(),
            position_by_reference: SVector::zeros(),
        };
        let mut horizon = Self {
            steps: [stretch(0.0); MAX_STEPS],
            starts: [0.0; MAX_STEPS],
            shares: [1.0; MAX_STEPS],
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
                        position_by_velocity: to_here.position_by_velocity,
                        position_by_reference: to_here.position_by_reference,
                    };
                    horizon.point_count += 1;
                }
            }
            start += duration;
        }
        horizon
    }

    /// The same horizon with the cost (18a) to the letter: every step counts once, whatever its length.
    #[must_use]
    pub fn counting_steps(mut self) -> Self {
        self.shares = [1.0; MAX_STEPS];
        self
    }

    /// The steps.
    pub fn steps(&self) -> &[Step<N, D>] {
        &self.steps[..self.len]
    }

    /// Whether all steps are of one length.
    pub fn is_even(&self) -> bool {
        self.is_even
    }

    /// Whether a wrench estimate at the end of a step depends on the motion within it: not under Euler, unless the force is
    /// measured ideally.
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

    /// How much step `step` counts in the cost: its length over the mean length. Over even steps all count once, as in (18a);
    /// over uneven ones the cost stays an integral over time.
    pub fn share(&self, step: usize) -> f64 {
        self.shares[step]
    }

    /// Start of step `step` in s from the sample.
    pub fn start_of(&self, step: usize) -> f64 {
        self.starts[step]
    }
}
