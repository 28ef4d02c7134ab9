//! One cycle, in order: validate the sample → contact activation → feasibility and MPC → limit → outcome.

use nalgebra::SVector;

use crate::condensation::Workspace;
use crate::contact::{Contact, SurfaceSigns};
use crate::damping;
use crate::detection::Detection;
use crate::guards::Expected;
use crate::horizon::Horizon;
use crate::jump::PositionTrack;
use crate::mode::{Mode, StopReason, Transition};
use crate::optimization::Optimized;
use crate::outcome::{Counters, Motion, Outcome, Source};
use crate::parameters::{ContactPoint, Law, LowerBound, OnContactLost, OnInfeasible, ParameterError, Parameters};
use crate::plan::{Plan, nanoseconds};
use crate::qp::QpSolver;
use crate::robot::{InverseJacobian, Kinematics, Singular, right_inverse};
use crate::sample::{Sample, SampleFault, SampleHistory};
use crate::stopping;
use crate::under_way::UnderWay;
use crate::warm_start::WarmStart;

/// What a cycle starts from.
#[derive(Debug, Clone, Copy)]
pub enum Event<'a, const N: usize, const D: usize> {
    /// A state sample arrived.
    Sample(&'a Sample<N, D>),
    /// None did for longer than allowed.
    Silence,
}

/// The state between cycles.
#[derive(Debug)]
pub struct Controller<const N: usize, const D: usize, S, B> {
    pub(crate) parameters: Parameters<N, D>,
    pub(crate) solver: S,
    pub(crate) horizon: Horizon<N, D>,
    pub(crate) workspace: Workspace<B>,
    pub(crate) warm_start: WarmStart,
    pub(crate) contact: Contact<D>,
    pub(crate) plan: Plan<D>,
    /// Whether the plan is one of several steps, made in contact.
    pub(crate) planned: bool,
    /// Axes on which f̂ has reached f_min since they joined.
    pub(crate) reached: [bool; D],
    /// Largest s·f_lin on each axis since the contact began, N.
    pub(crate) deepest: [f64; D],
    pub(crate) surface_signs: SurfaceSigns<D>,
    pub(crate) detection: Detection,
    pub(crate) under_way: UnderWay<D>,
    /// Cycles in a row in which the force was not the predicted one.
    pub(crate) mismatches: u32,
    pub(crate) expected: Expected,
    /// Offset of the last command: where the ramp of a released axis starts.
    pub(crate) offset: SVector<f64, D>,
    /// Whether the damping law still has to come, at the release rate, from where another controller's offset was.
    catching_up: bool,
    pub(crate) mode: Mode,
    pub(crate) history: SampleHistory,
    pub(crate) track: PositionTrack<N>,
    pub(crate) last: Option<Sample<N, D>>,
    pub(crate) stop_reason: Option<StopReason>,
    /// Stamp at which stopping began, ns.
    stopping_since: u64,
    pub(crate) enabled: bool,
    pub(crate) requested: Option<StopReason>,
    /// Fallbacks in a row for want of a solution.
    pub(crate) unsolved: u32,
    pub(crate) singular: Option<Singular>,
    pub(crate) counters: Counters,
}

/// The pose of a cycle.
pub(crate) struct Pose<const N: usize, const D: usize> {
    pub(crate) kinematics: Kinematics<N>,
    pub(crate) inverse: InverseJacobian<N, D>,
}

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Controller<N, D, S, B> {
    /// A controller that has seen nothing. `storage` holds at least [`Capacity::storage_len`](crate::condensation::Capacity::storage_len) numbers for the horizon.
    ///
    /// # Errors
    /// [`ParameterError`]; a storage that is too short counts as [`ParameterError::Horizon`].
    pub fn new(parameters: Parameters<N, D>, solver: S, storage: B) -> Result<Self, ParameterError> {
        parameters.check()?;
        let horizon = parameters.horizon();
        Ok(Self {
            workspace: Workspace::new(&horizon, &parameters.mpc.weights, storage).ok_or(ParameterError::Horizon)?,
            horizon,
            warm_start: WarmStart::empty(),
            surface_signs: parameters.surface_signs(),
            enabled: parameters.start_enabled,
            stop_reason: (!parameters.start_enabled).then_some(StopReason::Disabled),
            parameters,
            solver,
            contact: Contact::none(),
            plan: Plan::empty(),
            planned: false,
            reached: [false; D],
            deepest: [0.0; D],
            detection: Detection::new(),
            under_way: UnderWay::none(),
            mismatches: 0,
            expected: Expected::nothing(),
            offset: SVector::zeros(),
            catching_up: false,
            mode: Mode::Idle,
            history: SampleHistory::new(),
            track: PositionTrack::new(),
            last: None,
            stopping_since: 0,
            requested: None,
            unsolved: 0,
            singular: None,
            counters: Counters::default(),
        })
    }

    /// The plan of the last answer, from the instant at which its command acts.
    pub fn plan(&self) -> &Plan<D> {
        &self.plan
    }

    /// The solver, for what it keeps beside its answers.
    pub fn solver_mut(&mut self) -> &mut S {
        &mut self.solver
    }

    /// The mode.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Running counts.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Where the surface is believed to be, base frame, m: the configured point, or what the samples so far say.
    pub fn contact_point(&self) -> &nalgebra::Vector3<f64> {
        &self.parameters.environment.contact.position
    }

    /// Believes the surface to be at `position` (base frame, m): for a replay that begins after earlier contacts.
    pub fn assume_contact_point(&mut self, position: nalgebra::Vector3<f64>) {
        self.parameters.environment.contact.position = position;
    }

    /// Samples that never arrived, and samples at irregular spacing.
    pub fn history(&self) -> &SampleHistory {
        &self.history
    }

    /// How singular the pose was that stopped the arm.
    pub fn singular(&self) -> Option<Singular> {
        self.singular
    }

    /// Goes on where `old` is, with this controller's own parameters: mode, contact, plan, samples and counts.
    pub fn continue_from(&mut self, old: &Self) {
        (self.mode, self.contact, self.offset) = (old.mode, old.contact, old.offset);
        (self.plan, self.planned, self.under_way) = (old.plan, old.planned, old.under_way);
        (self.reached, self.deepest, self.detection) = (old.reached, old.deepest, old.detection);
        (self.expected, self.mismatches) = (old.expected, old.mismatches);
        if self.parameters.contact_point != ContactPoint::Configured {
            self.parameters.environment.contact = old.parameters.environment.contact;
        }
        (self.history, self.track, self.last) = (old.history, old.track, old.last);
        self.counters = old.counters;
        (self.stop_reason, self.stopping_since, self.singular) = (old.stop_reason, old.stopping_since, old.singular);
        (self.enabled, self.requested, self.unsolved) = (old.enabled, old.requested, old.unsolved);
        self.catching_up = true;
    }

    /// One cycle. `now` is the time in ns of CLOCK_MONOTONIC; `expired` is asked before and between solver iterations.
    pub fn step(&mut self, event: Event<'_, N, D>, now: u64, expired: &mut dyn FnMut() -> bool) -> Outcome<N, D> {
        self.counters.cycles += 1;
        let (outcome, stamp) = match event {
            Event::Sample(sample) => match self.check(sample, now) {
                Ok(()) => (self.on_sample(sample, expired), sample.stamp),
                Err(fault) => (self.on_fault(fault, now), now),
            },
            Event::Silence => (self.on_fault(SampleFault::Silence, now), now),
        };
        let offset = (outcome.motion == Motion::Offset).then_some(outcome.velocity_offset);
        self.under_way.push(stamp.saturating_add(nanoseconds(self.parameters.timing.command_delay)), offset);
        outcome
    }

    fn check(&mut self, sample: &Sample<N, D>, now: u64) -> Result<(), SampleFault> {
        self.history.check(sample, now, &self.parameters.timing)?;
        self.track.follow(sample, self.parameters.limits.joint_speed.as_ref())
    }

    fn on_sample(&mut self, sample: &Sample<N, D>, expired: &mut dyn FnMut() -> bool) -> Outcome<N, D> {
        let restarted = self.history.is_new_run(sample) && self.last.is_some();
        self.history.accept(sample, &self.parameters.timing);
        self.last = Some(*sample);
        let touched = Contact::none().update(&self.parameters.thresholds, None, &sample.wrench).is_any();
        if self.mode == Mode::Idle {
            if let Some(reason) = self.reason_to_stay_idle(sample) {
                self.stop_reason = Some(reason);
                return self.idle(sample);
            }
            self.stop_reason = None;
            self.mode = self.mode.after(if touched { Transition::Halt } else { Transition::Ready });
            if touched {
                self.stop_reason = Some(StopReason::StartedInContact);
            }
        } else if restarted && touched && matches!(self.mode, Mode::Free | Mode::Contact | Mode::Stopping) {
            self.halt(StopReason::StartedInContact);
        }
        if self.mode == Mode::Stopped {
            return self.stopped(sample);
        }
        if !sample.drives_enabled {
            return self.end_control(sample, StopReason::DrivesDisabled);
        }
        let kinematics = self.parameters.chain.kinematics(&sample.joint_position);
        let bound = self.parameters.minimum_reciprocal_condition;
        // In contact the arm is stopped while J still inverts: held at once, what its joints still turn would press on the spring.
        let least = if self.comes_to_rest_by_model() { bound * stopping::CONDITION_LEFT } else { bound };
        let inverse = match right_inverse(&kinematics.task_jacobian::<D>(), least) {
            Ok(inverse) => inverse,
            Err(singular) => {
                self.singular = Some(singular);
                self.halt(StopReason::Singular);
                return self.stopped(sample);
            }
        };
        let pose = Pose { kinematics, inverse };
        self.follow_contact(sample, &pose);
        let guarded = self.guard(sample, &pose);
        if self.mode != Mode::Stopping {
            let was_held = self.mode == Mode::Contact && self.should_keep_contact(sample);
            let transition = if self.contact.is_any() { Transition::Touch } else { Transition::Release };
            let was_in_contact = self.mode == Mode::Contact;
            self.mode = self.mode.after(transition);
            if was_in_contact && self.mode == Mode::Free {
                self.settle_offset();
            }
            if was_held && self.mode == Mode::Free {
                self.counters.contacts_lost += 1;
                if self.parameters.mpc.on_contact_lost == OnContactLost::Stop {
                    self.halt(StopReason::ContactLost);
                    return self.stopped(sample);
                }
            }
            self.forget_released();
            if let Some(reason) = guarded {
                match self.mode {
                    Mode::Contact => self.begin_stop(reason, sample.stamp),
                    _ => {
                        self.halt(reason);
                        return self.stopped(sample);
                    }
                }
            }
            if pose.inverse.reciprocal_condition < bound {
                let reciprocal_condition = pose.inverse.reciprocal_condition;
                self.singular = Some(Singular { reciprocal_condition });
                match self.mode {
                    Mode::Contact => self.begin_stop(StopReason::Singular, sample.stamp),
                    _ => {
                        self.halt(StopReason::Singular);
                        return self.stopped(sample);
                    }
                }
            }
            let wrong_rate = self.history.wrong_rate(&self.parameters.timing).map(|_| StopReason::RateMismatch);
            if let Some(reason) = self.requested.or(wrong_rate) {
                if self.mode == Mode::Contact {
                    self.begin_stop(reason, sample.stamp);
                } else if self.offset.iter().all(|o| *o == 0.0) || wrong_rate.is_some() {
                    return self.end_control(sample, reason);
                }
            }
        }
        match self.mode {
            Mode::Stopping => self.stop(sample, &pose, expired),
            Mode::Contact if self.parameters.law == Law::Mpc => self.control(sample, &pose, expired),
            _ => self.without_prediction(sample, &pose),
        }
    }

    /// Whether a stop now is, or would be, the minimum-force stop.
    fn comes_to_rest_by_model(&self) -> bool {
        let by_model =
            self.parameters.law == Law::Mpc && self.parameters.mpc.on_infeasible == OnInfeasible::MinimumForceStop;
        by_model && matches!(self.mode, Mode::Contact | Mode::Stopping)
    }

    /// The ramp of a released axis starts from where its plan was to end, not from what one cycle was to do on the way there.
    fn settle_offset(&mut self) {
        // With a limit on its rate the offset may not jump; and the paper's ramp starts from the last offset.
        let parameters = &self.parameters;
        let may_jump = parameters.limits.inward_rate.is_none() && parameters.mpc.lower_bound == LowerBound::OnceReached;
        let Some(last) = self.plan.last().filter(|_| self.planned && may_jump) else { return };
        for axis in 0..D {
            let (low, high) = (self.offset[axis].min(0.0), self.offset[axis].max(0.0));
            self.offset[axis] = last[axis].clamp(low, high);
        }
    }

    fn reason_to_stay_idle(&self, sample: &Sample<N, D>) -> Option<StopReason> {
        if !self.enabled {
            return Some(self.requested.unwrap_or(StopReason::Disabled));
        }
        if !sample.drives_enabled {
            return Some(StopReason::DrivesDisabled);
        }
        self.history.wrong_rate(&self.parameters.timing).map(|_| StopReason::RateMismatch)
    }

    /// Contact under the MPC.
    fn control(
        &mut self,
        sample: &Sample<N, D>,
        pose: &Pose<N, D>,
        expired: &mut dyn FnMut() -> bool,
    ) -> Outcome<N, D> {
        let optimized = self.optimize(sample, pose, expired);
        let mut outcome = self.outcome(Source::Mpc);
        outcome.iterations = optimized.iterations();
        match optimized {
            Optimized::Planned { verdict, .. } => {
                self.unsolved = 0;
                outcome.verdict = verdict;
            }
            Optimized::Infeasible { verdict, .. } => {
                match self.parameters.mpc.on_infeasible {
                    OnInfeasible::Halt => {
                        self.halt(StopReason::Infeasible);
                        outcome = self.stopped(sample);
                    }
                    OnInfeasible::MinimumForceStop => {
                        self.begin_stop(StopReason::Infeasible, sample.stamp);
                        outcome = self.stop(sample, pose, expired);
                    }
                }
                outcome.verdict = verdict;
                return outcome;
            }
            Optimized::Expired { .. } | Optimized::Failed { .. } => {
                let has_expired = matches!(optimized, Optimized::Expired { .. });
                outcome.expired_at = has_expired.then_some(optimized.iterations());
                self.unsolved += 1;
                if self.unsolved > self.parameters.timing.max_consecutive_fallbacks {
                    let reason = if has_expired { StopReason::FallbackExhausted } else { StopReason::SolverFailed };
                    self.begin_stop(reason, sample.stamp);
                }
                outcome.source = self.fall_back(sample);
            }
        }
        self.finish(outcome, sample, pose)
    }

    /// On the way to standstill.
    fn stop(&mut self, sample: &Sample<N, D>, pose: &Pose<N, D>, expired: &mut dyn FnMut() -> bool) -> Outcome<N, D> {
        let too_long =
            sample.stamp.saturating_sub(self.stopping_since) > nanoseconds(self.parameters.stopping.stop_timeout);
        if too_long || self.may_rest(sample, pose) {
            self.mode = self.mode.after(Transition::Rest);
            return self.stopped(sample);
        }
        let optimized = self.optimize_stop(sample, pose, expired);
        let mut outcome = self.outcome(Source::MinimumForce);
        outcome.iterations = optimized.iterations();
        if matches!(optimized, Optimized::Planned { .. }) {
            self.unsolved = 0;
        } else {
            self.unsolved += 1;
            outcome.expired_at = matches!(optimized, Optimized::Expired { .. }).then_some(optimized.iterations());
            outcome.source = self.fall_back_while_stopping(sample);
        }
        self.finish(outcome, sample, pose)
    }

    /// Free motion, and the damping law anywhere.
    fn without_prediction(&mut self, sample: &Sample<N, D>, pose: &Pose<N, D>) -> Outcome<N, D> {
        self.unsolved = 0;
        let (offset, source) = match &self.parameters.law {
            Law::Damping { damping } if self.requested.is_none() => {
                let admittance = &self.parameters.thresholds.admittance;
                let wanted = damping::velocity_offset(damping, admittance, &sample.wrench);
                (self.caught_up(wanted), Source::Damping)
            }
            _ => {
                let ramp = self.released_offset(self.parameters.timing.sampling_time);
                (ramp, if ramp.iter().all(|o| *o == 0.0) { Source::None } else { Source::Ramp })
            }
        };
        self.set_plan(sample.stamp, offset);
        let outcome = self.outcome(source);
        self.finish(outcome, sample, pose)
    }

    /// `wanted`, as far as the release rate lets the last offset get there in a cycle after another controller gave that one.
    /// In contact the law acts at once.
    fn caught_up(&mut self, wanted: SVector<f64, D>) -> SVector<f64, D> {
        if !self.catching_up || self.contact.is_any() {
            self.catching_up = false;
            return wanted;
        }
        let step = self.parameters.limits.release_rate * self.parameters.timing.sampling_time;
        let next = self
            .offset
            .zip_map(&wanted, |from, to| if (to - from).abs() <= step { to } else { from + step.copysign(to - from) });
        self.catching_up = next != wanted;
        next
    }

    pub(crate) fn begin_stop(&mut self, reason: StopReason, stamp: u64) {
        if self.mode == Mode::Contact {
            self.mode = self.mode.after(Transition::Stop);
            self.stop_reason = Some(reason);
            self.stopping_since = stamp;
        }
    }

    pub(crate) fn halt(&mut self, reason: StopReason) {
        self.mode = self.mode.after(Transition::Halt);
        self.stop_reason.get_or_insert(reason);
    }

    /// Control ends: in free motion Idle, in contact zero joint velocity.
    fn end_control(&mut self, sample: &Sample<N, D>, reason: StopReason) -> Outcome<N, D> {
        if self.mode == Mode::Free {
            self.mode = self.mode.after(Transition::Disable);
            self.stop_reason = Some(reason);
            return self.idle(sample);
        }
        self.halt(reason);
        self.stopped(sample)
    }
}
