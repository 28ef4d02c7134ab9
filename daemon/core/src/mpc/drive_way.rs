//! Inputs that the drives allow, whatever else holds: the way of the references from where they are to where a
//! contact or a stop would lead without a force.
//!
//! Limits of drives are hard, and so are those of speed, offset and position. A reference that is beyond one of
//! these and cannot be back at once would leave no input at all. So each of them is as wide as this way needs:
//! what contradicts the drives then is the force alone. The way also tells how axes without an input follow a
//! ṗ0 that jumps.

use nalgebra::SVector;

use super::Situation;
use super::constraints::{Constraints, DriveBounds};
use crate::output::MAX_STEPS;
use crate::robot::{DriveLimits, Interval, Reference};

/// Part of the limits that is left to rounding, and to what J turns until a command acts.
const ROOM: f64 = 1e-3;
/// Room for rounding where the limits leave no other way, m/s or rad/s.
const ROUNDING: f64 = 1e-9;

/// What the drives allow in a cycle, and from where.
#[derive(Debug, Clone, Copy)]
pub(super) struct Driven<const N: usize> {
    pub(super) limits: DriveLimits<N>,
    pub(super) before: Reference<N>,
}

/// A way from step to step.
#[derive(Debug, Clone, Copy)]
pub(super) struct DriveWay<const N: usize, const D: usize> {
    driven: Driven<N>,
    /// What is streamed in each step, rad/s.
    references: [SVector<f64, N>; MAX_STEPS],
    /// ṗ in each step, by the J of now.
    pub(super) twists: [SVector<f64, D>; MAX_STEPS],
}

impl<const N: usize, const D: usize> Situation<'_, N, D> {
    /// What the drives allow here of the references of a twist; `None` where they are not limited.
    pub(super) fn driven(&self, in_stop: bool) -> Option<Driven<N>> {
        let mut limits = self.output.drive_limits(in_stop)?;
        limits.acceleration = limits.acceleration.map(|limit| limit * (1.0 - ROOM));
        limits.jerk = limits.jerk.map(|limit| limit * (1.0 - ROOM));
        let before = self.output.streamed_before(self.sample.stamp);
        let steady = || Reference::steady(self.streamed(&self.sample.twist_reference, 0.0).into());
        Some(Driven { limits, before: before.unwrap_or_else(steady) })
    }

    /// What is streamed for a twist `since` s after the command for this sample, rad/s.
    fn streamed(&self, twist: &SVector<f64, D>, since: f64) -> SVector<f64, N> {
        self.joint_velocity(twist) + self.output.turning() * self.output.turned_until(since)
    }
}

impl<const N: usize> Driven<N> {
    /// The reference after this one on the way to `target`, without regard to how J⁻¹ resolves a twist.
    pub(super) fn advance(&mut self, since: f64, target: &SVector<f64, N>) -> SVector<f64, N> {
        self.before = self.limits.follow(&self.before, since, &(*target).into());
        self.before.velocity.into()
    }
}

impl<const N: usize, const D: usize> DriveWay<N, D> {
    /// A way that has not been gone.
    pub(super) fn new(driven: Driven<N>) -> Self {
        Self { driven, references: [SVector::zeros(); MAX_STEPS], twists: [SVector::zeros(); MAX_STEPS] }
    }

    /// Goes to the twist that `target` gives for each step.
    pub(super) fn lead(
        &mut self,
        situation: &Situation<'_, N, D>,
        steps: &[f64],
        target: impl Fn(usize) -> SVector<f64, D>,
    ) {
        let Driven { limits, before: mut reference } = self.driven;
        let mut start = 0.0;
        for (step, length) in steps.iter().enumerate() {
            let since = steps[step.saturating_sub(1)];
            let wanted = target(step);
            let streamed = situation.streamed(&wanted, start).into();
            let aim = limits.within_speed(&streamed);
            let twist = if aim == streamed && limits.allow(&reference, since, &aim) {
                wanted
            } else {
                let turned = situation.streamed(&SVector::zeros(), start);
                let onto = |velocity: [f64; N]| -> SVector<f64, D> {
                    situation.sample.posture.jacobian() * (SVector::from(velocity) - turned)
                };
                let (coasting, aim) = (onto(limits.coasting(&reference, since, &aim)), onto(aim));
                let [from, to] = [&coasting, &aim].map(|twist| situation.streamed(twist, start).into());
                coasting + (aim - coasting) * limits.share(&reference, since, &from, &to)
            };
            let reached = situation.streamed(&twist, start);
            reference = reference.then(reached.into(), since);
            (self.references[step], self.twists[step]) = (reached, twist);
            start += length;
        }
    }

    /// How far the joints come on it, rad.
    pub(super) fn length(&self, steps: &[f64]) -> SVector<f64, N> {
        steps.iter().zip(&self.references).fold(SVector::zeros(), |sum, (length, reference)| sum + reference * *length)
    }
}

impl<const N: usize> Driven<N> {
    /// How far each joint comes at most until it stands still, rad: A² / 2 a, and what the jerk makes of it.
    pub(super) fn braking_way(&self) -> SVector<f64, N> {
        SVector::from_fn(|joint, _| {
            let speed = self.before.velocity[joint].abs();
            let (acceleration, jerk) = (self.limits.acceleration[joint], self.limits.jerk[joint]);
            speed * speed / (2.0 * acceleration) + speed * acceleration / jerk
        })
    }
}

impl<const N: usize, const D: usize> Constraints<'_, N, D> {
    /// The bounds of what the drives are given for a twist; widens the other limits of joints and inputs as far as `way`
    /// needs it. `known` are the joint references in each step without the inputs, with what the joints do beside the
    /// task, and `base` is the twist that inputs are counted from.
    pub(super) fn keep_drives(
        &mut self,
        way: &DriveWay<N, D>,
        situation: &Situation<'_, N, D>,
        steps: &[f64],
        known: (&[SVector<f64, D>], &[SVector<f64, N>]),
        base: &SVector<f64, D>,
    ) -> DriveBounds<N> {
        let Driven { limits, before } = way.driven;
        let mut bounds = DriveBounds {
            acceleration: limits.acceleration.into(),
            jerk: limits.jerk.into(),
            before,
            without_inputs: [SVector::zeros(); MAX_STEPS],
        };
        let (known_twist, known_reference) = known;
        let (mut start, mut reference) = (0.0, before);
        for (step, length) in steps.iter().enumerate() {
            let since = steps[step.saturating_sub(1)];
            let turned = situation.streamed(&SVector::zeros(), start);
            let beside = situation.beside.ahead(start);
            let known = beside.map_or(known_reference[step], |beside| known_reference[step] - beside);
            bounds.without_inputs[step] = known + turned;
            let next = reference.then(way.references[step].into(), since);
            for joint in 0..N {
                let change = next.acceleration[joint];
                bounds.acceleration[joint] = bounds.acceleration[joint].max(change.abs());
                bounds.jerk[joint] = bounds.jerk[joint].max((change - reference.acceleration[joint]).abs() / since);
            }
            reference = next;
            let own = way.references[step] - turned;
            let own = beside.map_or(own, |beside| own + beside);
            if let Some(speed) = &mut self.joint_speed {
                (speed.lower, speed.upper) = (speed.lower.inf(&own), speed.upper.sup(&own));
            }
            let twist = way.twists[step] - base;
            if let Some(Interval { lower, upper }) = &mut self.offset {
                (*lower, *upper) = (lower.inf(&twist), upper.sup(&twist));
            }
            if let Some(speed) = &mut self.normal_speed {
                let left = speed.normal.dot(&(way.twists[step] - known_twist[step])) - ROUNDING;
                speed.least[step] = speed.least[step].min(left);
            }
            start += length;
        }
        bounds
    }
}
