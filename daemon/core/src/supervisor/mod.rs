//! The mode with its data, the causes that change it, the guards, and what a person may ask between
//! cycles.
//!
//! Everything that changes the mode goes through [`decide`]:
//!
//! ```
//! use admittance_core::supervisor::{Cause, OnContactLost, OnInfeasible, Policy, decide};
//! use admittance_vocabulary::ModeName;
//!
//! let policy = Policy {
//!     on_infeasible: OnInfeasible::MinimumForceStop,
//!     on_contact_lost: OnContactLost::Continue,
//! };
//! assert_eq!(decide(ModeName::Contact, Cause::Infeasible, policy), ModeName::Stopping);
//! // A stop is latched, whatever comes.
//! assert_eq!(decide(ModeName::Stopped, Cause::Ready, policy), ModeName::Stopped);
//! ```

mod cause;
mod contact_memory;
mod fallback;
mod guards;
mod mode;
mod orders;
mod permission;
mod settings;
mod task;
#[cfg(test)]
mod tests;

use admittance_vocabulary::{ModeName, StopReason};
use nalgebra::SVector;

pub use cause::{Cause, Policy, decide};
pub(crate) use contact_memory::ContactMemory;
pub use guards::Guards;
pub(crate) use mode::{Mode, Stop, Stopping};
pub use orders::{EnableRefused, ResetRefused};
pub use permission::Ending;
pub(crate) use settings::Settings;
pub use settings::{OnContactLost, OnInfeasible};

pub(crate) use task::{Bridge, Task};

use crate::belief::{Belief, Felt, NOISE_DEVIATIONS};
use crate::intake::{Accepted, band_along};
use crate::mpc::{Demand, InwardSpeed, LowerBound, Situation};
use crate::output::ContactEnd;
use crate::quantities::Instant;
use crate::robot::Singular;
use permission::Permission;

/// A stop begins at the least reciprocal condition number of J, and may go on down to this part of
/// it.
const CONDITION_LEFT: f64 = 0.1;

/// The stage.
#[derive(Debug)]
pub(crate) struct Supervisor<const D: usize> {
    settings: Settings<D>,
    mode: Mode<D>,
    permission: Permission,
    /// Whether the arm was held when permission was withdrawn, and has not been let go since.
    still_holds: bool,
    contacts_lost: u64,
    exceeded: u64,
}

/// Whether Idle for this reason is not a loss of control: nothing seen yet, or withdrawn by a
/// person.
fn is_withdrawn(reason: Option<StopReason>) -> bool {
    matches!(reason, None | Some(StopReason::Disabled | StopReason::Shutdown))
}

impl<const D: usize> Supervisor<D> {
    /// Idle, with nothing seen.
    pub(crate) fn new(settings: Settings<D>) -> Self {
        let (mode, permission) = if settings.start_enabled {
            (Mode::Idle(None), Permission::Given)
        } else {
            (Mode::Idle(Some(StopReason::Disabled)), Permission::Withdrawn(Ending::Disabled))
        };
        Self { settings, mode, permission, still_holds: false, contacts_lost: 0, exceeded: 0 }
    }

    /// Takes over the state of `old`, with these settings.
    pub(crate) fn take_over(&mut self, old: &Self) {
        let Self { settings: _, mode, permission, still_holds, contacts_lost, exceeded } = old;
        (self.mode, self.permission, self.still_holds) = (*mode, *permission, *still_holds);
        (self.contacts_lost, self.exceeded) = (*contacts_lost, *exceeded);
    }

    /// The mode.
    pub(crate) fn mode(&self) -> &Mode<D> {
        &self.mode
    }

    /// Whether the law answers: not Idle, and not Stopped.
    pub(crate) fn is_in_control(&self) -> bool {
        matches!(self.mode, Mode::Free { .. } | Mode::Contact(_) | Mode::Stopping(_))
    }

    /// Whether an arm that is not in control stands still: control was given, and cannot act.
    /// Withdrawn since, it lets the arm go with the first sample that shows no force.
    pub(crate) fn holds(&self) -> bool {
        matches!(self.mode, Mode::Idle(reason) if !is_withdrawn(reason)) && (self.is_enabled() || self.still_holds)
    }

    /// Contacts lost that should have been kept.
    pub(crate) fn contacts_lost(&self) -> u64 {
        self.contacts_lost
    }

    /// Cycles in which the force was beyond its limit.
    pub(crate) fn exceeded(&self) -> u64 {
        self.exceeded
    }

    /// Whether the model of the stop under way must be wrong: it led to the stop, or half the time that
    /// a stop may take has not brought the arm to rest. (By a model that takes the tool for nearly off
    /// the surface there is nothing to do, whatever is measured.)
    pub(crate) fn doubts_model(&self, now: Instant) -> bool {
        let Mode::Stopping(Stopping { stop, since, .. }) = &self.mode else { return false };
        use StopReason as R;
        let is_long = now.since(*since) > self.settings.stop_timeout * 0.5;
        is_long
            || matches!(stop.reason, R::MeasuredForce | R::ForceExceeded | R::ModelDisagrees | R::SurfaceOutsideRange)
    }

    /// Goes to the mode that a cause leads to at the instant `at`.
    fn apply(&mut self, cause: Cause, at: Instant) {
        self.apply_at_pose(cause, at, None);
    }

    fn apply_at_pose(&mut self, cause: Cause, at: Instant, singular: Option<Singular>) {
        let next = decide(self.mode.name(), cause, self.settings.policy);
        let stop = cause.reason().map(|reason| Stop { reason, singular });
        self.mode = match (next, self.mode) {
            (ModeName::Idle, Mode::Idle(reason)) => Mode::Idle(cause.reason().or(reason)),
            (ModeName::Idle, _) => Mode::Idle(cause.reason()),
            (ModeName::Free, mode @ Mode::Free { .. }) => mode,
            (ModeName::Free, before) => {
                let bounced = if let Mode::Contact(memory) = before { memory.way_back(at) } else { None };
                Mode::Free { pull: None, bounced }
            }
            (ModeName::Contact, mode @ Mode::Contact(_)) => mode,
            (ModeName::Contact, Mode::Free { bounced, .. }) => Mode::Contact(ContactMemory::new(bounced, at)),
            (ModeName::Contact, _) => Mode::Contact(ContactMemory::new(None, at)),
            (ModeName::Stopping | ModeName::Stopped, mode @ Mode::Stopped(_)) => mode,
            (ModeName::Stopping, mode @ Mode::Stopping(_)) => mode,
            (ModeName::Stopping, mode) => {
                let unsolved = if let Mode::Contact(memory) = mode { memory.unsolved } else { 0 };
                stop.map_or(mode, |stop| Mode::Stopping(Stopping { stop, since: at, unsolved }))
            }
            (ModeName::Stopped, Mode::Stopping(Stopping { stop, .. })) => Mode::Stopped(stop),
            (ModeName::Stopped, mode) => stop.map_or(mode, Mode::Stopped),
        };
    }

    /// A valid sample came: may control begin, or go on? `felt` says whether it feels a force.
    pub(crate) fn admit<const N: usize>(&mut self, sample: &Accepted<N, D>, felt: &Felt<D>) {
        let cause = match self.mode {
            Mode::Idle(_) => match self.objection(sample) {
                // Let go, a held arm would press on.
                Some(Cause::Disabled | Cause::Shutdown) if felt.is_any() && self.holds() => {
                    Some(Cause::StartedInContact)
                }
                Some(objection) => Some(objection),
                None if felt.is_any() => Some(Cause::StartedInContact),
                None => Some(Cause::Ready),
            },
            Mode::Free { .. } | Mode::Contact(_) | Mode::Stopping(_) | Mode::Stopped(_) => {
                (sample.arrival.is_new_run && felt.is_any()).then_some(Cause::StartedInContact)
            }
        };
        self.still_holds = false;
        if let Some(cause) = cause {
            self.apply(cause, sample.stamp);
        }
        if self.is_in_control() && !sample.drives_enabled {
            self.apply(Cause::DrivesDisabled, sample.stamp);
        }
        if self.is_in_control()
            && let Err(singular) = sample.posture.inverse(self.least_condition())
        {
            self.apply_at_pose(Cause::Singular, sample.stamp, Some(singular));
        }
    }

    /// In contact the arm is stopped while J still inverts: held at once, what its joints still
    /// turn would press on the spring.
    fn least_condition(&self) -> f64 {
        let least = self.settings.minimum_reciprocal_condition;
        if self.would_stop_by_model() { least * CONDITION_LEFT } else { least }
    }

    /// Whether the arm is in contact, and would be stopped at the lowest force instead of being
    /// held.
    pub(crate) fn would_stop_by_model(&self) -> bool {
        self.settings.predicts
            && self.settings.policy.on_infeasible == OnInfeasible::MinimumForceStop
            && matches!(self.mode, Mode::Contact(_) | Mode::Stopping(_))
    }

    /// Counts a cycle in which the force, without the lag of f̂ or as a set of surfaces knows it, is
    /// beyond what a plan may have.
    pub(crate) fn count_exceeded(&mut self, belief: &Belief<D>) {
        let Settings { force_limit, limit_tolerance, thresholds, .. } = &self.settings;
        let tolerance = |axis: usize| limit_tolerance * force_limit[axis];
        let passed = self.settings.limits().are_passed_without_lag(belief.without_lag(), tolerance);
        let along = |axis: usize| (force_limit[axis] + tolerance(axis)) / belief.surface().normal[axis].abs();
        let limit = belief.normal_signs().axes(&thresholds.admittance).map(along).fold(f64::INFINITY, f64::min);
        let by_set = || belief.set().is_some_and(|set| set.has_exceeded(limit));
        self.exceeded += u64::from(passed || by_set());
    }

    /// What the guards say about a sample. In contact they also count the cycles in a row.
    pub(crate) fn guard<const N: usize>(&mut self, sample: &Accepted<N, D>, belief: &Belief<D>) -> Option<Cause> {
        let Settings { guards, thresholds, wrench_noise, sign, .. } = &self.settings;
        let normal = &belief.surface().normal;
        // What the pressing force may be off by.
        let pressing = band_along(&sample.wrench_covariance, normal) + sample.feigned_wrench.dot(normal).abs();
        let (limits, noise) = (self.settings.limits(), wrench_noise.max().max(pressing / NOISE_DEVIATIONS));
        let measured = guards.measured(&sample.wrench, &sample.unsure(), &limits);
        // What the tool may feign is off already: without the lag it is more.
        let exceeded = guards.exceeded(belief.without_lag(), &sample.torque_band(), &limits);
        match &mut self.mode {
            // A touch is for the MPC to judge first: its stop knows what is attainable.
            Mode::Free { pull, .. } => measured.or(exceeded.filter(|_| !belief.contact().is_any())).or_else(|| {
                let most = guards::most_pull(*sign, thresholds, noise, belief);
                let forces = [&sample.wrench, &sample.wrench_by_position];
                let forces = forces.map(|wrench| belief.surface().pressing_force(wrench));
                *pull = guards::Pull::followed(*pull, sample.stamp, forces, most);
                pull.and_then(|pull| pull.contradicts(sample.stamp, most))
            }),
            Mode::Contact(memory) => measured.or(exceeded).or_else(|| {
                let mismatches = guards.mismatches(&sample.wrench, noise, belief);
                memory.mismatches = if mismatches { memory.mismatches + 1 } else { 0 };
                let outside = || belief.is_outside_range().then_some(Cause::SurfaceOutsideRange);
                guards.disagrees(memory.mismatches).or_else(outside)
            }),
            Mode::Idle(_) | Mode::Stopping(_) | Mode::Stopped(_) => None,
        }
    }

    /// Follows contact as it begins and ends. Returns how one has just ended.
    #[must_use]
    pub(crate) fn follow_contact<const N: usize>(
        &mut self,
        sample: &Accepted<N, D>,
        belief: &Belief<D>,
    ) -> Option<ContactEnd> {
        let contact = belief.contact();
        let was_in_contact = matches!(self.mode, Mode::Contact(_));
        let mut end = ContactEnd::Released;
        if contact.is_any() {
            self.apply(Cause::Touch, sample.stamp);
        } else if self.keeps_contact(sample, belief) {
            self.contacts_lost += 1;
            end = ContactEnd::Lost;
            self.apply(Cause::ContactLost, sample.stamp);
        } else {
            self.apply(Cause::Release, sample.stamp);
        }
        if let Mode::Contact(memory) = &mut self.mode {
            memory.follow(contact, &sample.wrench, &belief.least_force(&self.settings.minimum_force));
            memory.follow_impact(sample, belief);
        }
        (was_in_contact && matches!(self.mode, Mode::Free { .. })).then_some(end)
    }

    /// The offset of free motion: one that slows an arm down which has bounced off and comes back.
    pub(crate) fn free_offset<const N: usize>(
        &mut self,
        sample: &Accepted<N, D>,
        belief: &Belief<D>,
    ) -> SVector<f64, D> {
        let may_slow = self.is_enabled() && self.settings.inward_speed == InwardSpeed::Approach;
        let Mode::Free { bounced, .. } = &mut self.mode else { return SVector::zeros() };
        let way = bounced.filter(|_| may_slow);
        let offset = way.and_then(|way| way.offset(&sample.twist_reference, belief.surface(), sample.stamp));
        *bounced = way.filter(|_| offset.is_some());
        offset.unwrap_or_else(SVector::zeros)
    }

    /// Whether the minimum force is in force: losing contact now is against the law's intent.
    fn keeps_contact<const N: usize>(&self, sample: &Accepted<N, D>, belief: &Belief<D>) -> bool {
        let Mode::Contact(memory) = &self.mode else { return false };
        self.settings.predicts
            && self.settings.lower_bound == LowerBound::OnceReached
            && !belief.is_left_by(&sample.twist_reference)
            && memory.has_reached()
    }

    /// Stops or ends control if something requires it: the `guards`, a pose that is nearly singular,
    /// here or as `singular_ahead` says where the arm would come to rest, samples that don't come as
    /// they should, or a request to end control, in free motion once the offset is zero.
    pub(crate) fn heed<const N: usize>(
        &mut self,
        guards: Option<Cause>,
        singular_ahead: Option<Singular>,
        sample: &Accepted<N, D>,
        offset_is_zero: bool,
    ) {
        let stamp = sample.stamp;
        if let Some(cause) = guards {
            self.apply(cause, stamp);
        }
        let here = sample.posture.inverse(self.settings.minimum_reciprocal_condition).err();
        if let Some(singular) = here.or(singular_ahead).filter(|_| self.is_in_control()) {
            self.apply_at_pose(Cause::NearlySingular, stamp, Some(singular));
        }
        let is_ramping = matches!(self.mode, Mode::Free { .. }) && !offset_is_zero;
        if let Some(cause) = self.end_of_control(sample, is_ramping).filter(|_| self.is_in_control()) {
            self.apply(cause, stamp);
        }
    }

    /// Whether a stop at the lowest force is under way.
    pub(crate) fn is_stopping(&self) -> bool {
        matches!(self.mode, Mode::Stopping(_))
    }

    /// What the MPC is to predict in this cycle.
    pub(crate) fn task(&self) -> Option<Task> {
        match self.mode {
            Mode::Contact(_) if self.settings.predicts => Some(Task::Press),
            Mode::Stopping(_) => Some(Task::Stop),
            Mode::Contact(_) | Mode::Idle(_) | Mode::Free { .. } | Mode::Stopped(_) => None,
        }
    }

    /// What the prediction must achieve for the contact.
    pub(crate) fn demand<const N: usize>(&mut self, situation: &Situation<'_, N, D>) -> Demand<D> {
        let (belief, twist_reference) = (situation.belief, &situation.sample.twist_reference);
        let (active, signs) = (belief.contact().active(), belief.bounded_signs());
        let (mut minimum, mut kept, mut inward_speed) = ([f64::NEG_INFINITY; D], [f64::NEG_INFINITY; D], f64::INFINITY);
        let mut settles = false;
        if let Mode::Contact(memory) = &mut self.mode {
            if self.settings.inward_speed == InwardSpeed::Approach {
                inward_speed = memory.inward_speed(situation.sample.stamp);
                settles = memory.is_settling();
            }
            let leaves = belief.is_left_by(twist_reference);
            let least_force = belief.least_force(&self.settings.minimum_force);
            for axis in (0..D).filter(|&axis| signs[axis] != 0.0 && belief.asks_for_force(axis)) {
                let minimum_force = least_force[axis];
                minimum[axis] = match self.settings.lower_bound {
                    LowerBound::Always => minimum_force,
                    LowerBound::OnceReached if leaves => f64::NEG_INFINITY,
                    LowerBound::OnceReached => {
                        memory.lower_bound(axis, situation.spring_force(axis, signs[axis]), minimum_force)
                    }
                };
                // An arm that was halted short of f_min goes on to it.
                kept[axis] = if settles && minimum[axis] > f64::NEG_INFINITY { minimum_force } else { minimum[axis] };
            }
        }
        Demand { active, signs, minimum, kept, inward_speed, settles }
    }
}
