//! The rate of the samples: the median spacing of the last hundred, from their stamps. A pause or a
//! late stamp moves few spacings, and so neither makes a wrong rate nor hides one.

use super::Timing;
use crate::quantities::Instant;

/// A spacing is taken over so many cycles: it averages jitter, and evens out stamps of a coarse
/// clock. One pause shows in as many spacings.
const CYCLES: usize = 4;
/// Spacings that the rate is judged over. With those before them they are fewer samples than a
/// replay follows before it compares.
const SPACINGS: usize = 100;
/// So many of them off to the same side are a wrong rate: a few more than the median needs, for
/// jitter.
const WRONG: u32 = 60;
/// A rate is wrong until there are fewer.
const RIGHT: u32 = 40;
/// Relative deviation from T_s beyond which a spacing is off.
const TOLERANCE: f64 = 0.01;
/// Relative deviation from the median up to which a spacing agrees with it.
const AGREEMENT: f64 = 0.01;
/// Part of the spacings that must agree before the median is the controller's cycle.
const AGREE: f64 = 0.75;

/// The rate at which samples come where it is another than 1 / T_s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WrongRate {
    /// Median spacing of the last samples in s.
    pub spacing: f64,
    /// Whether most spacings are this one: then it is the motion controller's cycle.
    pub is_even: bool,
}

/// The spacings so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rate {
    /// The last samples: ring of numbers and stamps.
    samples: [(u64, Instant); CYCLES],
    /// How many of them there are, and the place of the next.
    sample: (usize, usize),
    /// The last spacings in s per cycle: ring.
    spacings: [f64; SPACINGS],
    /// How many of them there are, and the place of the next.
    spacing: (usize, usize),
    /// Which spacings are too long, and too short: one bit each, the lowest for the last.
    long: u128,
    short: u128,
    is_wrong: bool,
}

impl Rate {
    /// Nothing seen.
    pub(super) fn new() -> Self {
        Self {
            samples: [(0, Instant::from_nanoseconds(0)); CYCLES],
            sample: (0, 0),
            spacings: [0.0; SPACINGS],
            spacing: (0, 0),
            long: 0,
            short: 0,
            is_wrong: false,
        }
    }

    /// What comes is not spaced from what came.
    pub(super) fn pause(&mut self) {
        self.sample = (0, 0);
    }

    /// Takes in the stamp of the sample with this `number`, which counts those that were not taken
    /// in as well.
    pub(super) fn follow(&mut self, number: u64, stamp: Instant, timing: &Timing) {
        let (count, at) = self.sample;
        let (before, then) = core::mem::replace(&mut self.samples[at], (number, stamp));
        self.sample = ((count + 1).min(CYCLES), (at + 1) % CYCLES);
        if count == CYCLES {
            self.judge(stamp.since(then).seconds() / (number - before) as f64, timing);
        }
    }

    fn judge(&mut self, spacing: f64, timing: &Timing) {
        let (count, at) = self.spacing;
        self.spacings[at] = spacing;
        self.spacing = ((count + 1).min(SPACINGS), (at + 1) % SPACINGS);
        let off = spacing / timing.sampling_time.seconds() - 1.0;
        let window = (1 << SPACINGS) - 1;
        self.long = (self.long << 1 | u128::from(off > TOLERANCE)) & window;
        self.short = (self.short << 1 | u128::from(off < -TOLERANCE)) & window;
        let most = self.long.count_ones().max(self.short.count_ones());
        self.is_wrong = most >= if self.is_wrong { RIGHT } else { WRONG };
    }

    /// The same samples against another T_s.
    pub(super) fn against(&self, timing: &Timing) -> Self {
        let mut rate = Self { spacing: (0, 0), long: 0, short: 0, is_wrong: false, ..*self };
        let (count, at) = self.spacing;
        for place in (0..count).map(|place| (at + SPACINGS - count + place) % SPACINGS) {
            rate.judge(self.spacings[place], timing);
        }
        rate
    }

    /// Whether samples come at another rate than 1 / T_s.
    pub(super) fn is_wrong(&self) -> bool {
        self.is_wrong
    }

    /// The rate where it is wrong.
    pub(super) fn wrong(&self) -> Option<WrongRate> {
        if !self.is_wrong {
            return None;
        }
        let count = self.spacing.0;
        let mut sorted = self.spacings;
        let (_, &mut spacing, _) = sorted[..count].select_nth_unstable_by(count / 2, f64::total_cmp);
        let agrees = |found: &&f64| (**found / spacing - 1.0).abs() <= AGREEMENT;
        let agree = self.spacings[..count].iter().filter(agrees).count();
        Some(WrongRate { spacing, is_even: agree as f64 >= AGREE * count as f64 })
    }
}
