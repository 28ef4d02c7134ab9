//! A motion that is no longer one.

/// Where the motion of the arm ended to be finite, or its masses to be invertible in a step.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the motion of the arm is no longer finite, or too fast for its masses to be computed, {time_s:.4} s after its start: joint {joint} was the fastest before, at \
     {velocity_rad_s:.3e} rad/s or m/s: the drives or the steps of the scenario do not hold this arm"
)]
pub struct Divergence {
    /// When the step that failed began: from the start of the motion, in s; before, when its sample was.
    pub time_s: f64,
    /// Index of the joint that was the fastest, from 0.
    pub joint: usize,
    /// How fast, the last time that it was finite.
    pub velocity_rad_s: f64,
}
