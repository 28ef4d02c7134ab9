//! The pressing force that f̂ should show: what the filter (6) makes of the spring at the measured
//! poses.

use crate::quantities::Instant;

/// The force expected of the last sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Pressing force that f̂ should show, N.
    pub pressing: f64,
    /// Force of the spring at the pose that f̂ shows, a dead time before the sample, N.
    pub spring: f64,
    /// The sample that they are of.
    pub stamp: Instant,
}

impl Expected {
    pub(super) fn nothing() -> Self {
        Self { pressing: 0.0, spring: 0.0, stamp: Instant::default() }
    }

    /// On to the sample stamped `stamp`, at which the `spring` presses (N). f̂ follows it with the
    /// time constant `lag` (s); the force counts as a straight line between samples.
    pub(super) fn follow(&mut self, stamp: Instant, spring: f64, lag: f64) {
        let elapsed = stamp.since(self.stamp).seconds();
        self.pressing = filtered(self.pressing, self.spring, spring, elapsed, lag);
        (self.spring, self.stamp) = (spring, stamp);
    }

    /// Starts again from the `measured` pressing force, because the surface is not known yet.
    pub(super) fn begin(&mut self, stamp: Instant, spring: f64, measured: f64) {
        *self = Self { pressing: measured, spring, stamp };
    }
}

/// What a filter with the time constant `lag` (s) makes of `value` in `elapsed` s, in which its
/// input goes in a straight line.
pub(super) fn filtered(value: f64, from: f64, to: f64, elapsed: f64, lag: f64) -> f64 {
    if lag <= 0.0 || elapsed <= 0.0 {
        return to;
    }
    let left = libm::exp(-elapsed / lag);
    let by_end = 1.0 - (1.0 - left) * lag / elapsed;
    left * value + (1.0 - left) * from + by_end * (to - from)
}
