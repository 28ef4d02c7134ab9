//! The spring's force at the last samples: f̂ shows it after the dead time of the wrench.

use super::expectation::filtered;
use crate::quantities::{Instant, Span};

/// Samples kept: more than the longest dead time spans.
const SAMPLES: usize = 16;

/// Pressing forces in N, negative above the surface, by the instants at which the spring had them;
/// straight lines in between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpringHistory {
    forces: [(Instant, f64); SAMPLES],
    len: usize,
}

impl SpringHistory {
    /// Nothing seen yet.
    pub(super) fn empty() -> Self {
        Self { forces: [(Instant::default(), 0.0); SAMPLES], len: 0 }
    }

    /// The force at a later instant than any before.
    pub(super) fn push(&mut self, stamp: Instant, force: f64) {
        if self.len == SAMPLES {
            self.forces.copy_within(1.., 0);
            self.len -= 1;
        }
        self.forces[self.len] = (stamp, force);
        self.len += 1;
    }

    /// Adds to every force, in N: the surface is believed to be elsewhere.
    pub(super) fn raise(&mut self, by: f64) {
        self.forces[..self.len].iter_mut().for_each(|(_, force)| *force += by);
    }

    /// The force at an instant; before the first that is known, as it was then.
    pub(super) fn at(&self, instant: Instant) -> f64 {
        let known = &self.forces[..self.len];
        let next = known.partition_point(|(stamp, _)| *stamp <= instant);
        match (next.checked_sub(1).map(|before| known[before]), known.get(next).copied()) {
            (Some((start, from)), Some((end, to))) => {
                let share = instant.since(start).seconds() / end.since(start).seconds();
                from + (to - from) * share
            }
            (Some((_, force)), None) | (None, Some((_, force))) => force,
            (None, None) => 0.0,
        }
    }

    /// What a filter with the time constant `lag` (s) that shows `shown` N after `dead_time` will
    /// have come to when everything until `now` has reached it, in N.
    pub(super) fn ahead(&self, shown: f64, now: Instant, dead_time: Span, lag: f64) -> f64 {
        let start = now - dead_time;
        let (mut value, mut from) = (shown, (start, self.at(start)));
        let within = self.forces[..self.len].iter().filter(|(stamp, _)| *stamp > start && *stamp < now);
        for &to in within.chain(&[(now, self.at(now))]) {
            // Above the surface nothing presses.
            value = filtered(value, from.1.max(0.0), to.1.max(0.0), to.0.since(from.0).seconds(), lag);
            from = to;
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_that_rises_evenly_is_shown_later_by_lag_and_dead_time() {
        // r(t) = s t through a lag T and a dead time D: s (t − D − T) once all else has faded.
        let (slope, lag, dead_time) = (1000.0, 0.002, Span::from_seconds(0.0037));
        let (mut history, mut now) = (SpringHistory::empty(), Instant::from_nanoseconds(1_000_000_000));
        let start = now;
        let force = |at: Instant| slope * at.since(start).seconds();
        for _ in 0..40 {
            now = now + Span::from_seconds(0.001);
            history.push(now, force(now));
        }
        assert!((history.at(now - dead_time) - force(now - dead_time)).abs() < 1e-9);
        let shown = force(now - dead_time) - slope * lag;
        let ahead = history.ahead(shown, now, dead_time, lag);
        assert!((ahead - (force(now) - slope * lag)).abs() < 1e-9, "{ahead}");
        assert!((history.ahead(0.0, now, dead_time, 0.0) - force(now)).abs() < 1e-12, "without lag it is the force");
        history.raise(5.0);
        assert!((history.at(now) - force(now) - 5.0).abs() < 1e-12);
    }
}
