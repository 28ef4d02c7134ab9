//! The movement of one cycle, taken from the plan.

use admittance_vocabulary::{Motion, Source};
use nalgebra::{SMatrix, SVector};

use super::Output;
use crate::intake::Accepted;
use crate::quantities::{Instant, Span};

/// What the motion controller shall do now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Movement<const N: usize, const D: usize> {
    /// Offset or hold.
    pub motion: Motion,
    /// Where the offset comes from.
    pub source: Source,
    /// Δṗ in m/s and rad/s.
    pub velocity_offset: SVector<f64, D>,
    /// J⁻¹ Δṗ in rad/s; where the joints follow what the law resolves, what they add to q̇0.
    pub joint_velocity_offset: SVector<f64, N>,
    /// J⁻¹ of the resolution, for such joints: how that changes with Δṗ.
    pub joint_per_twist: Option<SMatrix<f64, N, D>>,
    /// ṗ0 + Δṗ in m/s and rad/s; zero while held.
    pub twist_command: SVector<f64, D>,
    /// Whether a limit had to cut the offset after the law.
    pub limited: bool,
}

impl<const N: usize, const D: usize> Output<N, D> {
    /// The plan's offset for the instant of this sample, within the limits.
    pub(super) fn at_sample(&mut self, source: Source, sample: &Accepted<N, D>) -> Movement<N, D> {
        let limited = self.cut_plan();
        let source = self.driven(source, sample.stamp, sample);
        self.planned(source, sample.stamp, sample, limited)
    }

    /// Brings the plan within what the drives allow. Where that changes an offset of zero it is a ramp.
    fn driven(&mut self, source: Source, now: Instant, last: &Accepted<N, D>) -> Source {
        if !last.drives_enabled {
            self.without_drives(now);
            return source;
        }
        let in_stop = source == Source::MinimumForce;
        let changed = self.within_drives(now, &last.posture, &last.twist_reference, in_stop);
        if changed && source == Source::None { Source::Ramp } else { source }
    }

    /// The plan's offset for an instant `now`, at the posture of a sample there.
    pub(super) fn planned(
        &mut self,
        source: Source,
        now: Instant,
        sample: &Accepted<N, D>,
        limited: bool,
    ) -> Movement<N, D> {
        let offset = self.take_offset(now);
        let inverse = sample.posture.inverse(0.0);
        Movement {
            motion: Motion::Offset,
            source,
            velocity_offset: offset,
            joint_velocity_offset: inverse.map_or_else(|_| SVector::zeros(), |inverse| inverse.joint_velocity(&offset)),
            joint_per_twist: None,
            twist_command: sample.twist_reference + offset,
            limited,
        }
    }

    /// The plan's offset for the instant `now`, at the posture of the `last` good sample.
    pub(super) fn after_sample(&mut self, source: Source, now: Instant, last: &Accepted<N, D>) -> Movement<N, D> {
        let limited = self.cut_plan();
        let source = self.driven(source, now, last);
        let offset = self.take_offset(now);
        let mut movement = Movement { source, velocity_offset: offset, limited, ..Movement::none() };
        if !self.is_zero() {
            movement.twist_command = last.twist_reference + offset;
            if let Ok(inverse) = last.posture.inverse(self.settings.minimum_reciprocal_condition) {
                movement.joint_velocity_offset = inverse.joint_velocity(&offset);
            }
        }
        movement
    }

    /// No offset at the instant `now`, and nothing known of the arm.
    pub(crate) fn rest_without_sample(&mut self, now: Instant) -> Movement<N, D> {
        self.streamed = None;
        self.without_offset(now)
    }

    /// No offset from the instant `now` on.
    pub(super) fn without_offset(&mut self, now: Instant) -> Movement<N, D> {
        self.set_constant(now, SVector::zeros());
        self.offset = SVector::zeros();
        Movement::none()
    }

    /// Cuts the plan to the limits. Whether it was cut.
    fn cut_plan(&mut self) -> bool {
        let limited = self.plan.limit(&self.settings.offset_limit);
        self.limited += u64::from(limited);
        limited
    }

    /// Takes the offset of an instant from the plan.
    fn take_offset(&mut self, stamp: Instant) -> SVector<f64, D> {
        let offset = self.plan.at(stamp).unwrap_or_else(SVector::zeros);
        // The plan may have inputs within a cycle: the next one begins from the last of them.
        let last = stamp + self.settings.timing.sampling_time - Span::from_nanoseconds(1);
        self.offset = self.plan.at(last).unwrap_or(offset);
        offset
    }
}

impl<const N: usize, const D: usize> Movement<N, D> {
    fn none() -> Self {
        Self {
            motion: Motion::Offset,
            source: Source::None,
            velocity_offset: SVector::zeros(),
            joint_velocity_offset: SVector::zeros(),
            joint_per_twist: None,
            twist_command: SVector::zeros(),
            limited: false,
        }
    }
}
