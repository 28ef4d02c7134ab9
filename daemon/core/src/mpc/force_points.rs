//! The points within its steps at which a horizon bounds the force.

use crate::mpc::horizon::MAX_FORCE_POINTS;
use crate::output::MAX_STEPS;

/// The first point is this part of a sampling time after the inputs begin to act.
const FIRST_POINT: f64 = 1.0 / 32.0;
/// Each later one is later by this part.
const POINT_GROWTH: f64 = 1.0 / 7.0;
/// Points closer to the end of their step than this part of it are dropped: the end is a point
/// itself.
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

    /// Points whose times grow by 1/7 from one to the next, from 1/32 of the sampling time on until
    /// `slowest_lag` s have passed.
    ///
    /// Between two points δ apart a force exceeds the larger of them by at most δ² f̈ / 8. To come
    /// to standstill after t a speed v must fall by v/t a second, so that f̈ is k v/t, while the
    /// force rises by k v t / 2 until then; with δ = t/7 what is missed is 1/200 of what the force
    /// still rises by. A force that peaks late is resolved more finely when its time comes: only
    /// the first sampling time of a plan is ever acted on before the next. What joints that still
    /// accelerate add within the first point is below 1/8000 of K_e Δ T_s²/T_V for a change Δ of
    /// their speed reference.
    pub fn dense(durations: &[f64], sampling_time: f64, slowest_lag: f64) -> Self {
        let mut parts = Self::none();
        let (mut start, mut count) = (0.0, 0);
        let mut time = sampling_time * FIRST_POINT;
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
