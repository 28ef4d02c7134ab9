//! What the drives are given: the joint velocity references J⁻¹ (ṗ0 + Δṗ) of the commands, as the motion
//! controller streams them, and how a plan is brought within the limits of the drives. What the joints do beside
//! the task has its own part of these limits; of the speed it leaves the rest.
//!
//! Every movement of this stage goes through [`Output::within_drives`], whatever it is for: a jump of
//! ṗ0 itself, a ramp, a fallback, a retreat, standing still. An input of the MPC keeps the limits by itself, and
//! is left as it is.

use nalgebra::SVector;

use super::{Beside, MAX_STEPS, Output, Plan};
use crate::intake::Accepted;
use crate::quantities::{Instant, Span};
use crate::robot::{DriveLimits, Posture, Reference};

/// Ticks after the end of a plan for which the way to standstill is followed; beyond them the arm stands.
const UNTIL_STANDSTILL: usize = 256;

/// Part of a cycle by which a tick may seem to begin too early.
const WITHIN: f64 = 1e-6;

/// What is streamed from a command on, if no other follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Streamed<const N: usize> {
    /// Before the command acts.
    before: Reference<N>,
    /// From tick to tick; the last one stays.
    references: [[f64; N]; MAX_STEPS],
    len: usize,
    /// The sample that the command answers.
    start: Instant,
}

impl<const N: usize> Streamed<N> {
    fn nothing(before: Reference<N>, start: Instant) -> Self {
        Self { before, references: [[0.0; N]; MAX_STEPS], len: 0, start }
    }

    /// An arm that stands still.
    fn standing(before: Reference<N>, start: Instant) -> Self {
        Self { len: 1, ..Self::nothing(before, start) }
    }

    fn push(&mut self, reference: &Reference<N>) {
        if self.len < MAX_STEPS {
            self.references[self.len] = reference.velocity;
            self.len += 1;
        }
    }

    /// The reference that is in force when the command for the sample stamped `stamp` begins to act.
    fn at(&self, stamp: Instant, tick: Span, validity: Span, limits: &DriveLimits<N>) -> Reference<N> {
        let elapsed = stamp.since(self.start);
        let ticks = |span: Span| libm::round(span.seconds() / tick.seconds()) as usize;
        let gone = ticks(elapsed);
        let played = gone.min(ticks(validity).max(self.len));
        let mut reference = self.before;
        for index in 0..played.min(MAX_STEPS + 1) {
            let velocity = self.references[index.min(self.len.saturating_sub(1))];
            reference = reference.then(velocity, tick.seconds());
        }
        // Without another command the motion controller brings the arm to a standstill.
        let alone = gone - played;
        if alone > UNTIL_STANDSTILL {
            return Reference::steady([0.0; N]);
        }
        for _ in 0..alone {
            reference = limits.follow(&reference, tick.seconds(), &[0.0; N]);
        }
        reference
    }

    /// The largest part of the limits of acceleration and jerk that references take from the sample stamped `stamp` on.
    fn most_used_from(&self, stamp: Instant, tick: Span, limits: &DriveLimits<N>) -> f64 {
        let (since, gone) = (tick.seconds(), libm::round(stamp.since(self.start).seconds() / tick.seconds()) as usize);
        let (mut reference, mut most) = (self.before, 0.0_f64);
        for (index, velocity) in self.references[..self.len].iter().enumerate() {
            let next = reference.then(*velocity, since);
            if index >= gone {
                for joint in 0..N {
                    let [before, change] = [&reference, &next].map(|reference| reference.acceleration[joint]);
                    let jerk = (change - before).abs() / since;
                    most = most.max(change.abs() / limits.acceleration[joint]).max(jerk / limits.jerk[joint]);
                }
            }
            reference = next;
        }
        most
    }
}

impl<const N: usize, const D: usize> Output<N, D> {
    /// The reference before the command for the sample stamped `stamp`; `None` where nothing is known of it.
    pub(crate) fn streamed_before(&self, stamp: Instant) -> Option<Reference<N>> {
        let (limits, streamed) = (self.settings.drives?.limits(false), self.streamed?);
        Some(streamed.at(stamp, self.settings.tick, self.settings.timing.validity(), &limits))
    }

    /// What is known of the references is no longer true: the motion controller has started anew.
    pub(crate) fn forget_streamed(&mut self) {
        self.streamed = None;
    }

    /// What the joints are told beside the task from here on.
    pub(crate) fn set_beside(&mut self, beside: Beside<N>) {
        self.beside = beside;
    }

    /// What the drives allow of the references of a twist.
    pub(crate) fn drive_limits(&self, in_stop: bool) -> Option<DriveLimits<N>> {
        let mut limits = self.settings.drives?.limits(in_stop);
        let Beside { told, acceleration, jerk, .. } = &self.beside;
        for (limits, taken) in
            [(&mut limits.speed, told), (&mut limits.acceleration, acceleration), (&mut limits.jerk, jerk)]
        {
            limits.iter_mut().zip(taken.iter()).for_each(|(limit, taken)| *limit = (*limit - taken.abs()).max(0.0));
        }
        Some(limits)
    }

    /// The part of the drives that the way of the last twist leaves from the sample stamped `stamp` on; `None` where nothing
    /// is known of it.
    pub(crate) fn left_by_twist(&self, stamp: Instant) -> Option<f64> {
        let (drives, streamed) = (self.settings.drives.as_ref()?, self.streamed.as_ref()?);
        Some(1.0 - streamed.most_used_from(stamp, self.settings.tick, &drives.limits))
    }

    /// By how much the references change by themselves, in rad/s² or m/s², as the arm and J with it turn.
    pub(crate) fn set_turning(&mut self, turning: SVector<f64, N>) {
        self.turning = turning;
    }

    /// That.
    pub(crate) fn turning(&self) -> &SVector<f64, N> {
        &self.turning
    }

    /// How much later than a sample J is known to have turned in the reference `since` s after its command: until the next
    /// sample, where it is known anew. Joints that follow what the law resolves have one J⁻¹ for all of a cycle.
    pub(crate) fn turned_until(&self, since: f64) -> f64 {
        let timing = &self.settings.timing;
        let cycle = timing.sampling_time.seconds();
        if self.settings.resolves {
            return if since < cycle * (1.0 - WITHIN) { 0.0 } else { cycle };
        }
        timing.command_delay.seconds() + since.min(cycle)
    }

    /// Brings the plan for the sample stamped `now` within what the drives allow, for an arm in this posture under
    /// this ṗ0. Returns whether it had to be changed.
    pub(super) fn within_drives(
        &mut self,
        now: Instant,
        posture: &Posture<N, D>,
        twist_reference: &SVector<f64, D>,
        in_stop: bool,
    ) -> bool {
        let Some(limits) = self.drive_limits(in_stop) else { return false };
        let Ok(inverse) = posture.inverse(0.0) else {
            // Nothing is known of what the motion controller makes of a twist here: its own limits are left.
            self.streamed = None;
            return false;
        };
        let tick = self.settings.tick;
        let since = tick.seconds();
        let turned = |k: usize| self.turning * self.turned_until(since * k as f64);
        let before = self.streamed_before(now).unwrap_or_else(|| {
            // Before the first command the offset is zero.
            Reference::steady((inverse.joint_velocity(twist_reference) + turned(0)).into())
        });
        let (mut reference, mut streamed) = (before, Streamed::nothing(before, now));
        let mut within = Plan::empty();
        within.become_same(&self.plan, now);
        let mut changed = false;
        let lasts = self.settings.timing.validity().max(self.settings.timing.sampling_time);
        for k in 0..MAX_STEPS {
            let begin = tick * k as f64;
            if begin >= lasts {
                break;
            }
            let offset = self.plan.at(now + begin).unwrap_or_else(SVector::zeros);
            let wanted = (inverse.joint_velocity(&(twist_reference + offset)) + turned(k)).into();
            let target = limits.within_speed(&wanted);
            if target == wanted && limits.allow(&reference, since, &wanted) {
                reference = reference.then(wanted, since);
                within.push(offset, tick);
            } else {
                changed = true;
                let onto = |velocity: [f64; N]| -> SVector<f64, D> {
                    posture.jacobian() * (SVector::from(velocity) - turned(k))
                };
                let reached = |twist: &SVector<f64, D>| inverse.joint_velocity(twist) + turned(k);
                // A redundant arm follows what J⁻¹ makes of a twist, and nothing else.
                let coasting = onto(limits.coasting(&reference, since, &target));
                let aim = onto(target);
                let share = limits.share(&reference, since, &reached(&coasting).into(), &reached(&aim).into());
                let twist = coasting + (aim - coasting) * share;
                reference = reference.then(reached(&twist).into(), since);
                within.push(twist - twist_reference, tick);
            }
            streamed.push(&reference);
        }
        within.last_until(lasts);
        (self.plan, self.streamed) = (within, Some(streamed));
        changed
    }

    /// Zero joint velocity as soon as the drives allow it: `None` where they do at once.
    pub(super) fn towards_standstill(
        &mut self,
        now: Instant,
        last: Option<&Accepted<N, D>>,
        in_stop: bool,
    ) -> Option<()> {
        let limits = self.drive_limits(in_stop)?;
        let before = self.streamed_before(now);
        let stands = before.unwrap_or(Reference::steady([0.0; N]));
        let is_allowed = self.beside.may_be_held && limits.allow(&stands, self.settings.tick.seconds(), &[0.0; N]);
        let last = last.filter(|last| last.drives_enabled && !is_allowed && last.posture.inverse(0.0).is_ok());
        let Some(last) = last else {
            self.streamed = Some(Streamed::standing(stands, now));
            return None;
        };
        self.set_constant(now, -last.twist_reference);
        let _ = self.within_drives(now, &last.posture, &last.twist_reference, in_stop);
        Some(())
    }

    /// Drives that are off follow nothing.
    pub(super) fn without_drives(&mut self, now: Instant) {
        if self.settings.drives.is_some() {
            self.streamed = Some(Streamed::standing(Reference::steady([0.0; N]), now));
        }
    }
}
