//! Age, order and rate of the samples.

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

/// Order and rate of the samples so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SampleOrder {
    last: Option<Stamped>,
    /// Spacing of the last two samples in s.
    spacing: Option<f64>,
    /// First sample of the block of [`RATE_BLOCK`] over which the mean spacing is taken.
    block: Option<Stamped>,
    /// Samples that have waited for a block to begin.
    waiting: u64,
    /// Mean spacing of the last complete block in s.
    mean_spacing: Option<f64>,
    missed: u64,
    irregular: u64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Stamped {
    boot_id: u64,
    sequence: u64,
    stamp: Instant,
}

/// Samples over which the mean spacing is taken, from one that is evenly spaced to another: a
/// single late stamp says nothing about the rate. Where no stamps are even, twice as many.
const RATE_BLOCK: u64 = 100;
/// Relative deviation of the mean spacing from T_s that refuses control: a little more than one
/// cycle of a block, which a single overrun takes.
const RATE_TOLERANCE: f64 = 0.0101;
/// Relative deviation of one spacing from T_s that is counted, and from the one before that is
/// uneven.
const SPACING_TOLERANCE: f64 = 0.1;

impl SampleOrder {
    /// Nothing seen.
    pub(super) fn new() -> Self {
        Self { last: None, spacing: None, block: None, waiting: 0, mean_spacing: None, missed: 0, irregular: 0 }
    }

    /// Samples that never arrived, by gaps in the sequence.
    pub(super) fn missed(&self) -> u64 {
        self.missed
    }

    /// Samples whose spacing differed from T_s by more than 10 %.
    pub(super) fn irregular(&self) -> u64 {
        self.irregular
    }

    /// Mean spacing of the last block of samples in s, if it differs from T_s by more than 1 %.
    pub(super) fn wrong_rate(&self, timing: &Timing) -> Option<f64> {
        self.mean_spacing.filter(|mean| deviation(*mean, timing) > RATE_TOLERANCE)
    }

    /// Checks a sample against the clock and the samples before it.
    ///
    /// # Errors
    /// Stale, from the future, or out of order.
    pub(super) fn check<const N: usize, const D: usize>(
        &self,
        sample: &Sample<N, D>,
        now: Instant,
        timing: &Timing,
    ) -> Result<(), SampleFault> {
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

    /// Records a sample that passed all checks. Returns whether it comes from another run of the
    /// motion controller than the previous one.
    pub(super) fn accept<const N: usize, const D: usize>(&mut self, sample: &Sample<N, D>, timing: &Timing) -> bool {
        let now = Stamped { boot_id: sample.boot_id, sequence: sample.sequence, stamp: sample.stamp };
        let before = self.last.replace(now);
        match before.filter(|last| last.boot_id == now.boot_id) {
            Some(last) => {
                // Two runs of the motion controller may both jump by nearly 2⁶⁴.
                self.missed = self.missed.saturating_add(now.sequence - last.sequence - 1);
                let found = spacing(&last, &now);
                if deviation(found, timing) > SPACING_TOLERANCE {
                    self.irregular += 1;
                }
                let is_even = self.spacing.replace(found).is_some_and(|before| is_close(found, before));
                if now.stamp.since(last.stamp) > timing.pause() {
                    self.block = None;
                }
                self.measure_rate(now, is_even);
            }
            None => (self.spacing, self.block, self.waiting, self.mean_spacing) = (None, None, 0, None),
        }
        before.is_some_and(|last| last.boot_id != now.boot_id)
    }

    /// Ends the block with the sample `now`, if it is long enough, and begins the next; `is_even`:
    /// its spacing is that of the samples before it.
    fn measure_rate(&mut self, now: Stamped, is_even: bool) {
        let count = self.block.map_or(0, |start| now.sequence - start.sequence);
        match self.block {
            Some(start) if count >= 2 * RATE_BLOCK || (count >= RATE_BLOCK && is_even) => {
                self.mean_spacing = Some(spacing(&start, &now));
                self.block = Some(now);
            }
            None if is_even || self.waiting >= RATE_BLOCK => (self.block, self.waiting) = (Some(now), 0),
            None => self.waiting += 1,
            Some(_) => {}
        }
    }
}

/// Mean time in s per sequence number between two samples.
fn spacing(from: &Stamped, to: &Stamped) -> f64 {
    to.stamp.since(from.stamp).seconds() / (to.sequence - from.sequence) as f64
}

/// Whether two spacings differ by at most 10 %.
fn is_close(spacing: f64, other: f64) -> bool {
    (spacing / other - 1.0).abs() <= SPACING_TOLERANCE
}

/// Relative deviation of a spacing in s from T_s.
fn deviation(spacing: f64, timing: &Timing) -> f64 {
    (spacing / timing.sampling_time.seconds() - 1.0).abs()
}
