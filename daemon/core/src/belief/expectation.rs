//! The pressing force that f̂ should show: what the filter (6) makes of the spring at the measured
//! poses.

use crate::quantities::Instant;

/// The force expected of the last sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Pressing force that f̂ should show, N.
    pub pressing: f64,
    /// Force of the spring at the measured pose, N.
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
        self.pressing = if lag > 0.0 && elapsed > 0.0 {
            let left = libm::exp(-elapsed / lag);
            let by_end = 1.0 - (1.0 - left) * lag / elapsed;
            left * self.pressing + (1.0 - left) * self.spring + by_end * (spring - self.spring)
        } else {
            spring
        };
        (self.spring, self.stamp) = (spring, stamp);
    }

    /// Starts again from the `measured` pressing force, because the surface is not known yet.
    pub(super) fn begin(&mut self, stamp: Instant, spring: f64, measured: f64) {
        *self = Self { pressing: measured, spring, stamp };
    }
}
