//! Age, order and number of the samples.

use super::rate::{Rate, WrongRate};
use super::{Sample, SampleFault};
use crate::quantities::{Instant, Span};

/// When samples and commands are in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// T_s.
    pub sampling_time: Span,
    /// The command for the sample stamped t acts at t plus this.
    pub command_delay: Span,
    /// An older sample is stale.
    pub max_sample_age: Span,
    /// Cycles in a row that the last plan may stand in for an answer.
    pub max_consecutive_fallbacks: u32,
}

impl Timing {
    /// How long a command stays valid after it acts: its own cycle and the fallbacks that may
    /// follow.
    pub fn validity(&self) -> Span {
        self.sampling_time * f64::from(1 + self.max_consecutive_fallbacks)
    }

    /// Samples further apart than this have a pause between them, not a rate.
    pub fn pause(&self) -> Span {
        self.max_sample_age + self.sampling_time
    }

    /// How long after the last sample its plan may stand in for an answer. Half a cycle of grace: a
    /// cycle without a sample begins later than the missing sample would have.
    pub fn bridge(&self) -> Span {
        self.sampling_time * (f64::from(self.max_consecutive_fallbacks) + 0.5)
    }
}

/// How an accepted sample follows the one before it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Arrival {
    /// Time between their stamps: so old had what the law acted on become.
    pub age: Span,
    /// Samples between them that were never seen.
    pub missed: u64,
    /// The same of the last [`Arrival::LATELY`] samples, of one gap [`Arrival::LONGEST_GAP`] at
    /// most.
    pub missed_lately: u32,
    /// Numbers between them for which there was no time: the sequence jumped.
    pub skipped: u64,
    /// Whether it comes from another run of the motion controller.
    pub is_new_run: bool,
}

impl Arrival {
    /// Samples over which [`Self::missed_lately`] counts.
    pub const LATELY: u32 = 100;
    /// One gap is no habit: it does not count further than this, the most that plans may ever
    /// bridge.
    pub const LONGEST_GAP: u64 = 20;
}

/// Order and rate of the samples so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SampleOrder {
    last: Option<Stamped>,
    /// Samples of this run by their sequence, without what it skipped.
    number: u64,
    /// Samples since the last one that were seen, and refused.
    refused: u64,
    /// Which samples were never seen: one bit each, the lowest for the last.
    unseen: u128,
    rate: Rate,
    missed: u64,
    irregular: u64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Stamped {
    boot_id: u64,
    sequence: u64,
    stamp: Instant,
}

/// Relative deviation of one spacing from T_s that is counted.
const SPACING_TOLERANCE: f64 = 0.1;
/// A sample that was missed took at least this part of T_s: where there was less time for each, the
/// sequence has jumped.
const LEAST_CYCLE: f64 = 0.5;

impl SampleOrder {
    /// Nothing seen.
    pub(super) fn new() -> Self {
        Self { last: None, number: 0, refused: 0, unseen: 0, rate: Rate::new(), missed: 0, irregular: 0 }
    }

    /// The same, from here on with this timing.
    pub(super) fn under(&self, timing: &Timing) -> Self {
        Self { rate: self.rate.against(timing), ..*self }
    }

    /// Samples that were never seen, by gaps in the sequence for which there was time.
    pub(super) fn missed(&self) -> u64 {
        self.missed
    }

    /// Samples whose spacing differed from T_s by more than 10 %.
    pub(super) fn irregular(&self) -> u64 {
        self.irregular
    }

    /// Whether samples come at another rate than 1 / T_s.
    pub(super) fn is_rate_wrong(&self) -> bool {
        self.rate.is_wrong()
    }

    /// The rate of the samples where it is wrong.
    pub(super) fn wrong_rate(&self) -> Option<WrongRate> {
        self.rate.wrong()
    }

    /// Checks a sample against the clock and the samples before it.
    ///
    /// # Errors
    /// Not numbered, stale, from the future, or out of order.
    pub(super) fn check<const N: usize, const D: usize>(
        &self,
        sample: &Sample<N, D>,
        now: Instant,
        timing: &Timing,
    ) -> Result<(), SampleFault> {
        if sample.sequence == 0 {
            return Err(SampleFault::Unnumbered);
        }
        let age = now.since(sample.stamp);
        if age > timing.max_sample_age {
            return Err(SampleFault::Stale { age });
        }
        let ahead = sample.stamp.since(now);
        if ahead > timing.sampling_time {
            return Err(SampleFault::FromFuture { ahead });
        }
        if let Some(last) = self.last.filter(|last| last.boot_id == sample.boot_id)
            && (sample.sequence <= last.sequence || sample.stamp <= last.stamp)
        {
            return Err(SampleFault::OutOfOrder { sequence: sample.sequence, last: last.sequence });
        }
        Ok(())
    }

    /// Records that a sample was seen and refused: it was not missed.
    pub(super) fn refuse(&mut self) {
        self.refused += 1;
    }

    /// Records a sample that passed all checks, and tells how it follows the one before it.
    pub(super) fn accept<const N: usize, const D: usize>(&mut self, sample: &Sample<N, D>, timing: &Timing) -> Arrival {
        let now = Stamped { boot_id: sample.boot_id, sequence: sample.sequence, stamp: sample.stamp };
        let refused = core::mem::take(&mut self.refused);
        let Some(last) = self.last.replace(now) else {
            self.rate.follow(0, now.stamp, timing);
            return Arrival::default();
        };
        if last.boot_id != now.boot_id {
            (self.number, self.unseen, self.rate) = (0, 0, Rate::new());
            self.rate.follow(0, now.stamp, timing);
            return Arrival { is_new_run: true, ..Arrival::default() };
        }
        let (age, between) = (now.stamp.since(last.stamp), now.sequence - last.sequence - 1);
        let has_jumped = age.seconds() < between as f64 * LEAST_CYCLE * timing.sampling_time.seconds();
        let (between, skipped) = if has_jumped { (0, between) } else { (between, 0) };
        let missed = between.saturating_sub(refused);
        // Two runs of the motion controller may both miss nearly 2⁶⁴.
        self.missed = self.missed.saturating_add(missed);
        let gap = missed.min(Arrival::LONGEST_GAP);
        self.unseen = (self.unseen << (gap + 1) | ((1 << gap) - 1) << 1) & ((1 << Arrival::LATELY) - 1);
        self.number += between + 1;
        if age > timing.pause() {
            self.rate.pause();
        }
        self.rate.follow(self.number, now.stamp, timing);
        let spacing = age.seconds() / (between + 1) as f64;
        self.irregular += u64::from((spacing / timing.sampling_time.seconds() - 1.0).abs() > SPACING_TOLERANCE);
        Arrival { age, missed, missed_lately: self.unseen.count_ones(), skipped, is_new_run: false }
    }
}
