//! The plan of a cycle: offsets piecewise constant in time. It shifts by time, so that a late
//! cycle, uneven steps and a missed command all find the offset that was meant for their instant.

use nalgebra::SVector;

use crate::quantities::{Instant, Span};
use crate::surface::Surface;
use crate::turn::Turn;

/// Largest number of steps.
pub const MAX_STEPS: usize = 32;

/// Part of a limit by which rounding may put an offset beyond it.
const ROUNDING: f64 = 1e-9;

/// What a plan was made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Origin {
    /// One offset for as long as the command is valid.
    Constant,
    /// A prediction: it may continue when there is no new one.
    Prediction,
}

/// Offsets from the instant at which the command acts onward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan<const D: usize> {
    origin: Origin,
    offsets: [SVector<f64, D>; MAX_STEPS],
    /// End of each step after the plan's start, ns.
    ends: [u64; MAX_STEPS],
    len: usize,
    /// The sample that the plan answers: its start, up to the command delay.
    start: Instant,
}

impl<const D: usize> Plan<D> {
    /// No plan.
    pub fn empty() -> Self {
        Self {
            origin: Origin::Constant,
            offsets: [SVector::zeros(); MAX_STEPS],
            ends: [0; MAX_STEPS],
            len: 0,
            start: Instant::default(),
        }
    }

    /// Becomes one `offset` that lasts for `validity` from `start` on.
    pub(crate) fn become_constant(&mut self, start: Instant, offset: SVector<f64, D>, validity: Span) {
        (self.origin, self.len, self.start) = (Origin::Constant, 0, start);
        self.push(offset, validity);
    }

    /// Becomes a prediction from `start` on, still without steps.
    pub(crate) fn become_prediction(&mut self, start: Instant) {
        (self.origin, self.len, self.start) = (Origin::Prediction, 0, start);
    }

    /// Becomes one of the same origin as `other` from `start` on, still without steps.
    pub(super) fn become_same(&mut self, other: &Self, start: Instant) {
        (self.origin, self.len, self.start) = (other.origin, 0, start);
    }

    /// Lets the last step last until `validity` after the start.
    pub(super) fn last_until(&mut self, validity: Span) {
        if let Some(end) = self.ends[..self.len].last_mut() {
            *end = (*end).max(validity.nanoseconds());
        }
    }

    /// Appends a step; beyond [`MAX_STEPS`] it is dropped.
    pub(crate) fn push(&mut self, offset: SVector<f64, D>, duration: Span) {
        if self.len < MAX_STEPS {
            let begun = if self.len == 0 { 0 } else { self.ends[self.len - 1] };
            self.offsets[self.len] = offset;
            self.ends[self.len] = begun.saturating_add(duration.nanoseconds());
            self.len += 1;
        }
    }

    /// Goes over to the frame that a turn leads to.
    pub(super) fn turn(&mut self, turn: &Turn) {
        for offset in &mut self.offsets[..self.len] {
            *offset = turn.twist(offset);
        }
    }

    /// Whether it comes from a prediction.
    pub fn is_prediction(&self) -> bool {
        self.origin == Origin::Prediction
    }

    /// The steps: offset (m/s, rad/s) and end after the start.
    pub fn steps(&self) -> impl ExactSizeIterator<Item = (&SVector<f64, D>, Span)> {
        let ends = self.ends[..self.len].iter().map(|end| Span::from_nanoseconds(*end));
        self.offsets[..self.len].iter().zip(ends)
    }

    /// The offset meant for the sample stamped `stamp`; the last step's beyond the end, `None`
    /// without a plan.
    pub fn at(&self, stamp: Instant) -> Option<SVector<f64, D>> {
        let last = self.len.checked_sub(1)?;
        Some(self.offsets[self.step_at(stamp).unwrap_or(last)])
    }

    fn step_at(&self, stamp: Instant) -> Option<usize> {
        let elapsed = stamp.since(self.start).nanoseconds();
        self.ends[..self.len].iter().position(|&end| elapsed < end)
    }

    /// The offset of the last step.
    pub(super) fn last(&self) -> Option<SVector<f64, D>> {
        Some(self.offsets[self.len.checked_sub(1)?])
    }

    /// Cuts every offset to ±`limit` per axis. Returns whether that changed more than rounding.
    pub(crate) fn limit(&mut self, limit: &SVector<f64, D>) -> bool {
        let mut cut = false;
        for offset in &mut self.offsets[..self.len] {
            for axis in 0..D {
                let limited = offset[axis].clamp(-limit[axis], limit[axis]);
                // A plan that keeps the limit as an active constraint may miss it by rounding.
                cut |= (limited - offset[axis]).abs() > ROUNDING * limit[axis] || offset[axis].is_nan();
                offset[axis] = limited;
            }
        }
        cut
    }

    /// Takes out of every step what would move a ṗ0 of `twist_reference` plus its offset into the
    /// `surface`.
    pub(crate) fn stay_outward(&mut self, surface: &Surface<D>, twist_reference: &SVector<f64, D>) {
        for offset in &mut self.offsets[..self.len] {
            let inward = surface.outward_speed(&(twist_reference + *offset)).min(0.0);
            *offset -= surface.normal * inward;
        }
    }

    /// Shifts the start to `start`: steps that have ended by then go, the last one stays until
    /// `validity` after it.
    pub(crate) fn shift(&mut self, start: Instant, validity: Span) {
        let Some(last) = self.len.checked_sub(1) else { return };
        let elapsed = start.since(self.start).nanoseconds();
        let gone = self.step_at(start).unwrap_or(last);
        self.offsets.copy_within(gone..self.len, 0);
        self.ends.copy_within(gone..self.len, 0);
        self.len -= gone;
        for end in &mut self.ends[..self.len] {
            *end = end.saturating_sub(elapsed);
        }
        let last = self.len - 1;
        self.ends[last] = self.ends[last].max(validity.nanoseconds());
        self.start = start;
    }
}
