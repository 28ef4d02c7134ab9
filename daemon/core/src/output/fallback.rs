//! What the arm does when there is no usable sample, or no solution in time. In contact the last
//! plan goes on by elapsed time, then the arm retreats open loop; nothing is read as zero and no
//! wrench is kept.

use admittance_vocabulary::Source;
use nalgebra::SVector;

use super::{Movement, Output};
use crate::intake::Accepted;
use crate::quantities::Instant;
use crate::surface::Surface;

impl<const N: usize, const D: usize> Output<N, D> {
    /// Without a sample in free motion: a ramp to zero continues.
    pub(crate) fn play_ramp(&mut self, now: Instant, last: &Accepted<N, D>) -> Movement<N, D> {
        self.shift_plan(now);
        self.after_sample(Source::Ramp, now, last)
    }

    /// Without a sample in contact: the last plan continues.
    pub(crate) fn play_plan(&mut self, now: Instant, last: &Accepted<N, D>) -> Movement<N, D> {
        self.fallbacks += 1;
        self.shift_plan(now);
        self.after_sample(Source::Plan, now, last)
    }

    /// The same in a stop: the plan may be that of the contact before it, which pressed.
    pub(crate) fn play_plan_in_stop(
        &mut self,
        now: Instant,
        last: &Accepted<N, D>,
        surface: &Surface<D>,
    ) -> Movement<N, D> {
        self.plan.stay_outward(surface, &last.twist_reference);
        self.play_plan(now, last)
    }

    /// Without a sample for longer than a plan lasts: leaves the surface, open loop.
    pub(crate) fn retreat(&mut self, now: Instant, last: &Accepted<N, D>, surface: &Surface<D>) -> Movement<N, D> {
        let offset = self.retreat_offset(&last.twist_reference, surface);
        self.set_constant(now, offset);
        self.after_sample(Source::Retreat, now, last)
    }

    /// Whether the limits leave [`Self::retreat`] unchanged.
    pub(crate) fn can_retreat(&self, twist_reference: &SVector<f64, D>, surface: &Surface<D>) -> bool {
        self.is_within_limits(&self.retreat_offset(twist_reference, surface))
    }

    /// The twist that leaves the surface at the retreat speed, as an offset to ṗ0.
    fn retreat_offset(&self, twist_reference: &SVector<f64, D>, surface: &Surface<D>) -> SVector<f64, D> {
        surface.normal * self.settings.retreat_speed - twist_reference
    }

    /// Without a solution: the last plan's offset for this instant; without a plan, the offset that
    /// cancels the part of ṗ0 into the surface.
    pub(crate) fn fall_back(&mut self, sample: &Accepted<N, D>, surface: &Surface<D>) -> Movement<N, D> {
        self.fallbacks += 1;
        if self.plan.is_prediction() {
            self.shift_plan(sample.stamp);
            return self.at_sample(Source::Plan, sample);
        }
        let inward = surface.outward_speed(&sample.twist_reference).min(0.0);
        self.set_constant(sample.stamp, surface.normal * -inward);
        self.at_sample(Source::Retreat, sample)
    }

    /// [`Self::fall_back`] of a stop: never inward, though the plan may be that of the contact
    /// before it. Once its plan `is_exhausted` it leaves the surface, open
    /// loop: held on the spring it would never reach a low force.
    pub(crate) fn fall_back_in_stop(
        &mut self,
        sample: &Accepted<N, D>,
        surface: &Surface<D>,
        is_exhausted: bool,
    ) -> Movement<N, D> {
        let has_plan = self.plan.is_prediction() && !is_exhausted;
        self.plan.stay_outward(surface, &sample.twist_reference);
        if has_plan || !self.can_retreat(&sample.twist_reference, surface) {
            return self.fall_back(sample, surface);
        }
        self.fallbacks += 1;
        let offset = self.retreat_offset(&sample.twist_reference, surface);
        self.set_constant(sample.stamp, offset);
        self.at_sample(Source::Retreat, sample)
    }

    fn shift_plan(&mut self, start: Instant) {
        self.plan.shift(start, self.settings.timing.validity());
    }
}
