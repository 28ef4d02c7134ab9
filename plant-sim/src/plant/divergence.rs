//! A motion that is no longer one.

/// Where the motion of the arm ended to be finite.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the motion of the arm is no longer finite, {time_s:.4} s after its start: joint {joint} was the fastest before, at \
     {velocity_rad_s:.3e} rad/s: the drives or the steps of the scenario do not hold this arm"
)]
pub struct Divergence {
    /// From the start of the motion, in s; below zero before.
    pub time_s: f64,
    /// Index of the joint that was the fastest, from 0.
    pub joint: usize,
    /// How fast, the last time that it was finite.
    pub velocity_rad_s: f64,
}
