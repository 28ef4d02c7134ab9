//! The movement that the arm is told: the offset of this instant, from the current plan, within the
//! limits.
//!
//! The plan is the MPC's, or one offset of the damping law, of a ramp, of a retreat, or zero. This
//! stage keeps it, with the last offset and the commands under way; the supervisor decides which of
//! its methods is called in a cycle.
//!
//! ```
//! use admittance_core::quantities::{Instant, Span};
//! # use admittance_core::Controller;
//! # use admittance_core::intake::{Event, Sample};
//! # use admittance_core::mpc::ActiveSet;
//! # use admittance_core::quantities::GivenWrench;
//! # use nalgebra::{Vector2, Vector6};
//! # mod planar { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/doc/planar_arm.rs")); }
//! # let parameters = planar::planar_arm();
//! # let capacity = parameters.solver_capacity();
//! # let solver = ActiveSet::new(capacity, 100, vec![0.0; capacity.storage_len()]).unwrap();
//! # let storage = vec![0.0; parameters.storage_len()];
//! # let q = Vector2::new(1.2097, -1.4682);
//! # let mut sample = Sample {
//! #     sequence: 1,
//! #     stamp: Instant::from_nanoseconds(1_000_000_000),
//! #     boot_id: 7,
//! #     joint_count: 2,
//! #     wrench_valid: true,
//! #     drives_enabled: true,
//! #     joint_position: q,
//! #     joint_velocity: Vector2::zeros(),
//! #     joint_position_reference: q,
//! #     joint_velocity_reference: None,
//! #     twist_reference: Vector2::new(0.0, -0.05),
//! #     wrench: GivenWrench(Vector6::zeros()),
//! #     torque_valid: false,
//! #     joint_torque: Vector2::zeros(),
//! # };
//! # let mut controller = Controller::new(parameters, solver, storage).unwrap();
//! # let _ = controller.step(Event::Sample(&sample), sample.stamp, &mut || false);
//! # sample.sequence += 1;
//! # sample.stamp = sample.stamp + Span::from_seconds(0.004);
//! # sample.wrench = GivenWrench(Vector6::new(-6.0, -13.0, 0.0, 0.0, 0.0, 0.0));
//!
//! // The answer to a sample in contact: the offset of now, and the plan behind it.
//! let answer = controller.step(Event::Sample(&sample), sample.stamp, &mut || false);
//! let first = answer.outcome.movement.velocity_offset;
//! assert_eq!(answer.plan.at(sample.stamp), Some(first));
//! // It holds piecewise, for as long as the step says.
//! let (_, end) = answer.plan.steps().next().unwrap();
//! assert_eq!(answer.plan.at(sample.stamp + Span::from_seconds(0.0039)), Some(first));
//! assert_ne!(answer.plan.at(sample.stamp + end), Some(first));
//! ```

mod damping;
mod fallback;
mod movement;
mod plan;
mod ramp;
mod streamed;
#[cfg(test)]
mod tests;
mod under_way;

use nalgebra::SVector;

pub use movement::Movement;
pub use plan::{MAX_STEPS, Plan};
use streamed::Streamed;
pub use under_way::MAX_DELAY_CYCLES;
pub(crate) use under_way::UnderWay;

use crate::intake::{Accepted, Timing};
use crate::quantities::{Instant, Span};
use crate::robot::Drives;
use crate::surface::Surface;
use crate::turn::Turn;
use admittance_vocabulary::{Motion, Source};

/// Which law answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law<const D: usize> {
    /// MPC-based admittance control (18).
    Mpc,
    /// Classic admittance control (3), for comparison: acts on every sample, in contact or not.
    Damping {
        /// Diagonal of D in N·s/m and N·m·s/rad.
        damping: SVector<f64, D>,
    },
}

/// Settings of this stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settings<const N: usize, const D: usize> {
    /// Which law answers.
    pub law: Law<D>,
    /// Axes that admittance control may take over.
    pub admittance: [bool; D],
    /// Largest |Δṗ| per axis, m/s and rad/s.
    pub offset_limit: SVector<f64, D>,
    /// Rate at which the offset of a released axis returns to zero, m/s² and rad/s².
    pub release_rate: f64,
    /// Whether the ramp of a released axis may start from the end of its plan.
    pub may_settle: bool,
    /// Speed in m/s along the outward normal of an open-loop retreat, and the limit for a stopped
    /// arm that moves away.
    pub retreat_speed: f64,
    /// Reciprocal condition number of J below which no joint velocity is given.
    pub minimum_reciprocal_condition: f64,
    /// How long commands are valid and when they act.
    pub timing: Timing,
    /// What the drives allow.
    pub drives: Option<Drives<N>>,
    /// Time from one streamed reference to the next.
    pub tick: Span,
    /// Whether the joints follow what the law resolves, and not the twist.
    pub resolves: bool,
}

/// How the damping law takes over another controller's offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Handover {
    /// It comes from that offset at the release rate.
    UnderWay,
    /// It acts at once.
    Done,
}

/// How a contact has ended that leads to free motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ContactEnd {
    /// As it was told to, or before f_min was reached.
    Released,
    /// Against the law's intent.
    Lost,
}

/// The stage.
#[derive(Debug)]
pub(crate) struct Output<const N: usize, const D: usize> {
    settings: Settings<N, D>,
    plan: Plan<D>,
    /// Δṗ of the last command: where the ramp of a released axis starts.
    offset: SVector<f64, D>,
    under_way: UnderWay<D>,
    /// The joint references of the last command, where the drives limit them.
    streamed: Option<Streamed<N>>,
    turning: SVector<f64, N>,
    beside: Beside<N>,
    handover: Handover,
    limited: u64,
    fallbacks: u64,
}

/// What the joints are told beside the task, as far as the drives have to know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Beside<const N: usize> {
    /// rad/s or m/s.
    pub told: SVector<f64, N>,
    /// What it takes of the drives, rad/s² or m/s².
    pub acceleration: SVector<f64, N>,
    /// rad/s³ or m/s³.
    pub jerk: SVector<f64, N>,
    /// Whether the next reference may be without it.
    pub may_be_held: bool,
}

impl<const N: usize> Beside<N> {
    const ZERO: SVector<f64, N> = SVector::from_array_storage(nalgebra::ArrayStorage([[0.0; N]]));
    /// Nothing.
    pub(crate) const NOTHING: Self =
        Self { told: Self::ZERO, acceleration: Self::ZERO, jerk: Self::ZERO, may_be_held: true };
}

impl<const N: usize, const D: usize> Output<N, D> {
    /// Nothing told yet.
    pub(crate) fn new(settings: Settings<N, D>) -> Self {
        Self {
            settings,
            plan: Plan::empty(),
            offset: SVector::zeros(),
            under_way: UnderWay::none(),
            streamed: None,
            turning: SVector::zeros(),
            beside: Beside::NOTHING,
            handover: Handover::Done,
            limited: 0,
            fallbacks: 0,
        }
    }

    /// Takes over the state of `old`, with these settings.
    pub(crate) fn take_over(&mut self, old: &Self) {
        let Self { settings: _, plan, offset, under_way, streamed, turning, beside, handover: _, limited, fallbacks } =
            old;
        // What was streamed is told tick by tick.
        let same_tick = old.settings.tick == self.settings.tick;
        (self.streamed, self.turning, self.beside) = (streamed.filter(|_| same_tick), *turning, *beside);
        (self.plan, self.offset, self.under_way) = (*plan, *offset, *under_way);
        (self.limited, self.fallbacks) = (*limited, *fallbacks);
        self.handover = Handover::UnderWay;
    }

    /// Goes over to the frame that a turn leads to.
    pub(crate) fn turn(&mut self, turn: &Turn) {
        self.offset = turn.twist(&self.offset);
        self.plan.turn(turn);
        self.under_way.turn(turn);
    }

    /// Forgets the plan and the offset: for a reset.
    pub(crate) fn reset(&mut self) {
        (self.plan, self.offset) = (Plan::empty(), SVector::zeros());
    }

    /// Not in control, or not yet: ṗ0 unchanged. A motion beside the task may still be on its way to what is commanded.
    pub(crate) fn rest(&mut self, sample: &Accepted<N, D>, beside_is_commanded: bool) -> Movement<N, D> {
        if self.settings.drives.is_some() {
            self.set_constant(sample.stamp, SVector::zeros());
            return self.at_sample(if beside_is_commanded { Source::None } else { Source::Ramp }, sample);
        }
        let movement = self.without_offset(sample.stamp);
        Movement { twist_command: sample.twist_reference, ..movement }
    }

    /// Zero joint velocity; but ṗ0 may move the arm out of the surface, slowly: the twist that
    /// `retreat` makes of it and of the speed that is allowed. A ṗ0 that the limits do not allow to be
    /// slowed down is held too.
    pub(crate) fn hold_or_retreat(
        &mut self,
        sample: &Accepted<N, D>,
        retreat: impl FnOnce(&SVector<f64, D>, f64) -> Option<SVector<f64, D>>,
    ) -> Movement<N, D> {
        let offset = retreat(&sample.twist_reference, self.settings.retreat_speed)
            .map(|twist| twist - sample.twist_reference)
            .filter(|offset| sample.drives_enabled && self.is_within_limits(offset));
        match offset {
            Some(offset) if sample.posture.inverse(self.settings.minimum_reciprocal_condition).is_ok() => {
                self.set_constant(sample.stamp, offset);
                self.at_sample(Source::Retreat, sample)
            }
            _ => self.hold(sample.stamp, Some(sample)),
        }
    }

    /// Zero joint velocity; where the drives limit how fast, a plan that leads there from what was told to the arm
    /// whose `last` sample this is.
    pub(crate) fn hold(&mut self, now: Instant, last: Option<&Accepted<N, D>>) -> Movement<N, D> {
        if let (Some(()), Some(last)) = (self.towards_standstill(now, last, true), last) {
            return self.planned(Source::Ramp, now, last, false);
        }
        Movement { motion: Motion::Hold, ..self.without_offset(now) }
    }

    /// Free motion, and the damping law in every mode. While control is ending the damping law does
    /// not act: the offset goes to zero. Without a law it goes to `free`.
    pub(crate) fn go_on(
        &mut self,
        sample: &Accepted<N, D>,
        in_contact: bool,
        is_enabled: bool,
        free: &SVector<f64, D>,
    ) -> Movement<N, D> {
        let (offset, source) = match self.settings.law {
            Law::Damping { damping } if is_enabled => {
                let wanted = damping::velocity_offset(&damping, &self.settings.admittance, &sample.wrench);
                (self.caught_up(wanted, in_contact), Source::Damping)
            }
            Law::Mpc | Law::Damping { .. } => {
                let step = self.rate_step(self.settings.timing.sampling_time.seconds());
                let Settings { admittance, offset_limit, .. } = &self.settings;
                let free = SVector::from_fn(|axis, _| {
                    let reach = if admittance[axis] { offset_limit[axis] } else { 0.0 };
                    free[axis].clamp(-reach, reach)
                });
                let offset = ramp::towards(&self.offset, &free, step);
                (offset, if is_zero(&offset) { Source::None } else { Source::Ramp })
            }
        };
        self.set_constant(sample.stamp, offset);
        self.at_sample(source, sample)
    }

    /// `wanted`, or as close to it as the release rate allows from another controller's last
    /// offset. In contact the law acts at once.
    fn caught_up(&mut self, wanted: SVector<f64, D>, in_contact: bool) -> SVector<f64, D> {
        if self.handover == Handover::Done || in_contact {
            self.handover = Handover::Done;
            return wanted;
        }
        let next = ramp::towards(&self.offset, &wanted, self.rate_step(self.settings.timing.sampling_time.seconds()));
        if next == wanted {
            self.handover = Handover::Done;
        }
        next
    }

    /// A prediction takes over.
    pub(crate) fn follow(&mut self, plan: &Plan<D>, source: Source, sample: &Accepted<N, D>) -> Movement<N, D> {
        self.plan = *plan;
        self.at_sample(source, sample)
    }

    /// After a contact has ended: the ramp starts from where the plan would have ended, not from
    /// one cycle's offset on the way there. A contact that was lost is near: the arm approaches it
    /// anew from standstill, or from the speed that it had been slowed down to.
    pub(crate) fn settle(&mut self, end: ContactEnd, sample: &Accepted<N, D>, surface: &Surface<D>) {
        if !self.settings.may_settle || !self.plan.is_prediction() {
            return;
        }
        let Some(last) = self.plan.last() else { return };
        let outward_speed =
            |offset: &SVector<f64, D>| surface.outward_speed(&(sample.twist_reference + offset)).min(0.0);
        let before = outward_speed(&self.offset);
        self.offset.zip_apply(&last, |offset, last| *offset = last.clamp(offset.min(0.0), offset.max(0.0)));
        if end == ContactEnd::Lost {
            self.offset += surface.normal * (before - outward_speed(&self.offset)).max(0.0);
        }
    }

    /// Records the answer to a sample or silence at `stamp`: its command acts one delay later.
    pub(crate) fn send(&mut self, stamp: Instant, movement: &Movement<N, D>) {
        let from = stamp + self.settings.timing.command_delay;
        if movement.motion == Motion::Hold {
            return self.under_way.push(from, None);
        }
        self.under_way.push(from, Some(movement.velocity_offset));
        // What the plan says until the next command.
        let mut begin = Span::default();
        for (offset, end) in self.plan.steps() {
            if begin > Span::default() && begin < self.settings.timing.sampling_time {
                self.under_way.push(from + begin, Some(*offset));
            }
            begin = end;
        }
    }

    /// Offset of the last command after `since` s of ramping to zero on every axis.
    pub(crate) fn released_offset(&self, since: f64) -> SVector<f64, D> {
        ramp::towards_zero(&self.offset, self.rate_step(since))
    }

    fn rate_step(&self, since: f64) -> f64 {
        self.settings.release_rate * since
    }

    /// Whether no limit would cut `offset`: a cut one does not lead where it was meant to lead.
    fn is_within_limits(&self, offset: &SVector<f64, D>) -> bool {
        offset.iter().zip(&self.settings.offset_limit).all(|(offset, limit)| offset.abs() <= *limit)
    }

    /// A plan of one step: `offset` as long as the command is valid.
    fn set_constant(&mut self, start: Instant, offset: SVector<f64, D>) {
        self.plan.become_constant(start, offset, self.settings.timing.validity());
    }

    /// The plan that holds.
    pub(crate) fn plan(&self) -> &Plan<D> {
        &self.plan
    }

    /// Δṗ of the last command.
    pub(crate) fn offset(&self) -> &SVector<f64, D> {
        &self.offset
    }

    /// Whether it is zero.
    pub(crate) fn is_zero(&self) -> bool {
        is_zero(&self.offset)
    }

    /// Whether the motion controller may move the arm by itself from here on: there is no offset, and nothing beside the
    /// task that the drives could not do without at once.
    pub(crate) fn may_be_left(&self) -> bool {
        self.is_zero() && self.beside.may_be_held
    }

    /// Commands that are still to act.
    pub(crate) fn under_way(&self) -> &UnderWay<D> {
        &self.under_way
    }

    /// Offsets that a limit had to cut after the law.
    pub(crate) fn limited(&self) -> u64 {
        self.limited
    }

    /// Cycles in contact answered by the last plan, and cycles without a solution answered by a
    /// retreat. A retreat without a sample does not count.
    pub(crate) fn fallbacks(&self) -> u64 {
        self.fallbacks
    }
}

fn is_zero<const D: usize>(offset: &SVector<f64, D>) -> bool {
    offset.iter().all(|o| *o == 0.0)
}
