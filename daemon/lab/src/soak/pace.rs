//! How the soak itself keeps up with a touch.

use std::fmt;
use std::time::{Duration, Instant};

/// How the soak itself kept up in a touch: what a loss may be due to.
pub(super) struct Pace {
    last: Instant,
    longest: Duration,
    /// Scenario time at the longest time between two looks, s.
    at: f64,
    asked: u32,
    slowest: Duration,
    time: f64,
}

impl Pace {
    pub(super) fn new() -> Self {
        let none = Duration::ZERO;
        Self { last: Instant::now(), longest: none, at: 0.0, asked: 0, slowest: none, time: 0.0 }
    }

    /// A look at everything, at this scenario time in s.
    pub(super) fn look(&mut self, time: f64) {
        let now = Instant::now();
        if now - self.last > self.longest {
            (self.longest, self.at) = (now - self.last, self.time);
        }
        (self.last, self.time) = (now, time);
    }

    /// Asks for control.
    pub(super) fn time<T>(&mut self, ask: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let answer = ask();
        self.asked += 1;
        self.slowest = self.slowest.max(begun.elapsed());
        answer
    }
}

impl fmt::Display for Pace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { longest, at, asked, slowest, time, .. } = self;
        write!(f, "asked {asked} times until {time:.2} s of the motion, an answer took at most {slowest:.1?}, ")?;
        write!(f, "and a look {longest:.1?}, at {at:.2} s")
    }
}
