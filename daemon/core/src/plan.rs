//! The plan of a cycle: offsets piecewise constant in time. It shifts by time, so that a late cycle, uneven steps and a
//! missed command all find the offset that was meant for their instant.

use nalgebra::SVector;

/// Largest number of steps.
pub const MAX_STEPS: usize = 32;

/// Part of a limit by which an offset at it may be off for rounding.
const ROUNDING: f64 = 1e-9;

/// Offsets from the instant at which the command acts onward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan<const D: usize> {
    offsets: [SVector<f64, D>; MAX_STEPS],
    /// End of each step in ns after the plan's origin.
    ends: [u64; MAX_STEPS],
    len: usize,
    /// Stamp in ns of the sample that the plan answers: its origin, up to the command delay.
    stamp: u64,
}

impl<const D: usize> Plan<D> {
    /// No plan.
    pub fn empty() -> Self {
        Self { offsets: [SVector::zeros(); MAX_STEPS], ends: [0; MAX_STEPS], len: 0, stamp: 0 }
    }

    /// Forgets the steps; the plan now answers the sample stamped `stamp` ns.
    pub fn restart(&mut self, stamp: u64) {
        self.len = 0;
        self.stamp = stamp;
    }

    /// Appends a step of `duration` s; beyond [`MAX_STEPS`] it is dropped.
    pub fn push(&mut self, offset: SVector<f64, D>, duration: f64) {
        if self.len < MAX_STEPS {
            let start = if self.len == 0 { 0 } else { self.ends[self.len - 1] };
            self.offsets[self.len] = offset;
            self.ends[self.len] = start.saturating_add(nanoseconds(duration));
            self.len += 1;
        }
    }

    /// The steps: offset and end in ns after the origin.
    pub fn steps(&self) -> impl ExactSizeIterator<Item = (&SVector<f64, D>, u64)> {
        self.offsets[..self.len].iter().zip(self.ends[..self.len].iter().copied())
    }

    /// The offset meant for the sample stamped `stamp` ns; the last step's beyond the end, `None` without a plan.
    pub fn at(&self, stamp: u64) -> Option<SVector<f64, D>> {
        let elapsed = stamp.saturating_sub(self.stamp);
        let step = self.ends[..self.len].iter().position(|&end| elapsed < end);
        let last = self.len.checked_sub(1)?;
        Some(self.offsets[step.unwrap_or(last)])
    }

    /// The offset of the last step.
    pub fn last(&self) -> Option<SVector<f64, D>> {
        Some(self.offsets[self.len.checked_sub(1)?])
    }

    /// Cuts every offset to ±`limit` per axis; says whether it had to, beyond rounding.
    pub fn limit(&mut self, limit: &SVector<f64, D>) -> bool {
        let mut cut = false;
        for offset in &mut self.offsets[..self.len] {
            for axis in 0..D {
                let limited = offset[axis].clamp(-limit[axis], limit[axis]);
                // A plan that just keeps the limit as a constraint may miss it by a rounding.
                cut |= (limited - offset[axis]).abs() > ROUNDING * limit[axis] || offset[axis].is_nan();
                offset[axis] = limited;
            }
        }
        cut
    }

    /// Shifts the origin to `stamp` ns: steps that have ended by then go, the last one stays until `end` ns after it.
    pub fn shift(&mut self, stamp: u64, end: u64) {
        let elapsed = stamp.saturating_sub(self.stamp);
        let Some(last) = self.len.checked_sub(1) else { return };
        let gone = self.ends[..self.len].iter().position(|&end| elapsed < end).unwrap_or(last);
        self.offsets.copy_within(gone..self.len, 0);
        self.ends.copy_within(gone..self.len, 0);
        self.len -= gone;
        for step_end in &mut self.ends[..self.len] {
            *step_end = step_end.saturating_sub(elapsed);
        }
        let last = self.len - 1;
        self.ends[last] = self.ends[last].max(end);
        self.stamp = stamp;
    }
}

/// Seconds to whole nanoseconds; negative and NaN become 0.
pub fn nanoseconds(seconds: f64) -> u64 {
    libm::round(seconds * 1e9) as u64
}
