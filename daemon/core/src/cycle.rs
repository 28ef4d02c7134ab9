//! One cycle, one screen: intake → belief → supervisor → mpc → output.

use admittance_vocabulary::{ModeName, Motion, Source};
use nalgebra::{SVector, Vector6};

use crate::belief::{Belief, JointMotion, JointObserver, Snapshot, WayObserver};
use crate::cycle_output::{Counters, CycleOutput, Outcome};
use crate::intake::{Accepted, Event, Intake, Sample, SampleFault};
use crate::mpc::qp::QpSolver;
use crate::mpc::{Mpc, Situation, Solution, Verdict};
use crate::output::{Movement, Output};
use crate::parameters::{ParameterError, Parameters};
use crate::quantities::Instant;
use crate::redundancy::{NullMotion, Wish};
use crate::robot::Singular;
use crate::supervisor::{Bridge, EnableRefused, Ending, Mode, ResetRefused, Supervisor, Task};
use crate::turn::Turn;

/// The law, as a state machine: no clock, no I/O, no heap.
#[derive(Debug)]
pub struct Controller<const N: usize, const D: usize, S, B> {
    parameters: Parameters<N, D>,
    intake: Intake<N, D>,
    belief: Belief<D>,
    joints: JointObserver<N, D>,
    /// Where that has to be known within a cycle: the way into the surface.
    way: Option<WayObserver<N, D>>,
    supervisor: Supervisor<D>,
    mpc: Mpc<N, D, S, B>,
    output: Output<N, D>,
    /// What the joints do beside the task.
    beside: NullMotion<N>,
    cycles: u64,
}

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Controller<N, D, S, B> {
    /// A controller that has seen nothing. `storage` holds at least [`Parameters::storage_len`]
    /// numbers, and the solver takes problems of [`Parameters::solver_capacity`].
    ///
    /// # Errors
    /// [`ParameterError`].
    pub fn new(parameters: Parameters<N, D>, solver: S, storage: B) -> Result<Self, ParameterError> {
        parameters.check()?;
        Ok(Self {
            intake: Intake::new(parameters.intake()),
            belief: Belief::new(parameters.belief()),
            joints: JointObserver::new(parameters.loops),
            way: parameters.follows_way().then(|| WayObserver::new(parameters.loops)),
            supervisor: Supervisor::new(parameters.supervisor()),
            mpc: Mpc::new(parameters.mpc(), solver, storage).ok_or(ParameterError::Storage)?,
            output: Output::new(parameters.output()),
            beside: NullMotion::new(parameters.null_motion()),
            cycles: 0,
            parameters,
        })
    }

    /// The same, starting from a recorded belief: for a replay that begins after earlier contacts.
    #[must_use]
    pub fn believing(mut self, snapshot: &Snapshot) -> Self {
        self.belief = self.belief.with_snapshot(snapshot);
        self
    }

    /// The same, starting from a recorded [`Self::joint_motion`], which is that of the first
    /// sample.
    #[must_use]
    pub fn moving(mut self, motion: &JointMotion<N>) -> Self {
        self.joints = self.joints.resuming(motion);
        self
    }

    /// The same, starting from a recorded [`Self::tool_acceleration`], likewise.
    #[must_use]
    pub fn feeling(mut self, tool_acceleration: &Vector6<f64>) -> Self {
        self.intake = self.intake.with_tool_acceleration(tool_acceleration);
        self
    }

    /// Takes over the state of `old`, but keeps this controller's parameters.
    pub fn take_over(&mut self, old: &Self) {
        // Without `..`: whoever adds a field must decide here what becomes of it.
        let Self { parameters: _, intake, belief, joints, way, supervisor, mpc: _, output, beside, cycles } = old;
        self.intake.take_over(intake);
        self.belief.take_over(belief);
        self.joints.take_over(joints);
        if let Some(own) = &mut self.way {
            own.take_over(way.as_ref());
        }
        self.supervisor.take_over(supervisor);
        self.output.take_over(output);
        self.beside.take_over(beside);
        self.cycles = *cycles;
    }

    /// Goes over to another frame that everything is expressed in, which a turn leads to from the present
    /// one. What is remembered is turned along; per direction it is of the new frame's directions from here
    /// on. `parameters`: those of this controller, [seen from](Parameters::seen_from) the new frame.
    pub fn turn(&mut self, parameters: &Parameters<N, D>, turn: &Turn) {
        // Without `..`: of a new field somebody has to decide here whether it is of the frame. The MPC begins
        // its next problem warm from offsets of the old one. The null space is of the joints.
        let Self { parameters: own, intake, belief, joints, way, supervisor: _, mpc: _, output, beside: _, cycles: _ } =
            self;
        intake.turn(parameters.intake(), turn);
        belief.turn(parameters.belief(), turn);
        joints.turn(&parameters.chain, turn);
        if let Some(way) = way {
            way.turn(&parameters.chain, turn);
        }
        output.turn(turn);
        *own = *parameters;
    }

    /// Whether [`Self::step`] would believe the joint positions of a sample: a frame that is the tool's must
    /// not follow one that is stale, or where the arm cannot be. Its wrench may be anything.
    pub fn believes_position(&self, sample: &Sample<N, D>, now: Instant) -> bool {
        self.intake.believes_position(sample, now)
    }

    /// Runs one cycle at the time `now`. `expired` is called before and between solver iterations.
    pub fn step(
        &mut self,
        event: Event<'_, N, D>,
        now: Instant,
        expired: &mut dyn FnMut() -> bool,
    ) -> CycleOutput<'_, N, D> {
        let Self { parameters, intake, belief, joints, way, supervisor, mpc, output, beside, cycles } = self;
        *cycles += 1;
        let sample = match intake.take(event, now) {
            Ok(sample) => sample,
            Err(fault) => return self.step_without_sample(fault, now),
        };
        let joints = joints.follow(sample, output.under_way(), beside);
        if parameters.limits.drives.is_some() {
            output.set_turning(turning(parameters, sample, &joints, output));
            if sample.arrival.is_new_run {
                output.forget_streamed();
            }
        }
        let told = (output.under_way(), &*beside);
        let way = way.as_mut().and_then(|way| way.follow(sample, &joints, told, belief.surface()));
        belief.sense(sample);
        let felt = belief.felt(sample);
        supervisor.admit(sample, &felt);
        if supervisor.is_in_control() {
            belief.follow(sample, &joints.velocity, way.as_ref(), &felt, supervisor.doubts_model(sample.stamp));
            let guards = supervisor.guard(sample, belief);
            if let Some(end) = supervisor.follow_contact(sample, belief) {
                output.settle(end, sample, belief.surface());
            }
            if matches!(supervisor.mode(), Mode::Free { .. }) {
                mpc.forget();
            }
            let singular = match supervisor.mode() {
                Mode::Contact(_) if supervisor.would_stop_by_model() => {
                    nearly_singular_ahead(parameters, sample, joints, output, beside)
                }
                _ => None,
            };
            supervisor.heed(guards, singular, sample, output.may_be_left());
        }
        supervisor.count_exceeded(belief);
        if matches!(supervisor.mode(), Mode::Idle(_)) {
            belief.release();
        }
        belief.follow_link(parameters.impact.as_ref(), sample, &joints.velocity);
        let left = output.left_by_twist(sample.stamp);
        let mut beside_is_commanded = true;
        match supervisor.mode() {
            Mode::Idle(_) if supervisor.holds() => beside.choose(sample, (&sample.twist_reference, left), Wish::Rest),
            Mode::Idle(_) => beside_is_commanded = beside.stand_by(sample, left),
            Mode::Free { .. } | Mode::Contact(_) if supervisor.is_enabled() => {
                beside.choose(sample, (&(sample.twist_reference + output.offset()), left), Wish::Aim);
            }
            Mode::Free { .. } | Mode::Contact(_) | Mode::Stopping(_) | Mode::Stopped(_) => {
                beside.choose(sample, (&sample.twist_reference, left), Wish::Rest);
            }
        }
        if parameters.limits.drives.is_some() {
            output.set_beside(beside.of_drives());
        }
        let predicted = predict(sample, (joints, beside), belief, supervisor, mpc, output, expired);
        let movement = predicted.movement.unwrap_or_else(|| match supervisor.mode() {
            Mode::Idle(_) if supervisor.holds() => output.hold(sample.stamp, Some(sample)),
            Mode::Idle(_) => output.rest(&beside.as_commanded(sample), beside_is_commanded),
            Mode::Free { .. } | Mode::Contact(_) => {
                let free = supervisor.free_offset(sample, belief);
                output.go_on(sample, belief.contact().is_any(), supervisor.is_enabled(), &free)
            }
            Mode::Stopping(_) | Mode::Stopped(_) => {
                output.hold_or_retreat(sample, |twist, speed| belief.retreat_along(twist, speed))
            }
        });
        if movement.motion == Motion::Hold {
            beside.stop();
        }
        output.send(sample.stamp, &movement);
        beside.send(sample.stamp);
        let movement = match supervisor.mode() {
            // The motion controller moves the arm as it is commanded, or holds it.
            Mode::Idle(_) if movement.source == Source::None => movement,
            Mode::Idle(_) if !supervisor.holds() => beside.shown(movement, &beside.as_commanded(sample)),
            Mode::Idle(_) | Mode::Free { .. } | Mode::Contact(_) | Mode::Stopping(_) | Mode::Stopped(_) => {
                beside.shown(movement, sample)
            }
        };
        self.answer(movement, &predicted, None)
    }

    /// A cycle without a usable sample: nothing is learned and nothing solved.
    fn step_without_sample(&mut self, fault: SampleFault, now: Instant) -> CycleOutput<'_, N, D> {
        let Self { intake, belief, supervisor, output, beside, .. } = self;
        // How the arm turned at the last one is no longer true: a ramp to standstill would never end.
        output.set_turning(SVector::zeros());
        let (last, surface) = (intake.last(), belief.surface());
        let can_retreat = last.is_some_and(|last| output.can_retreat(&last.twist_reference, surface));
        let bridge = supervisor.bridge(&fault, now, intake.silence(now), can_retreat);
        match (bridge, last) {
            // A plan goes on with what the joints do beside it.
            (Bridge::Ramp | Bridge::Plan, _) => {}
            (Bridge::Retreat | Bridge::Hold, Some(last)) => {
                beside.choose(last, (&last.twist_reference, output.left_by_twist(now)), Wish::Rest);
            }
            (Bridge::Retreat | Bridge::Rest | Bridge::Hold, _) => beside.stop(),
        }
        output.set_beside(beside.of_drives());
        let movement = match (bridge, last) {
            (Bridge::Ramp, Some(last)) => output.play_ramp(now, last),
            (Bridge::Plan, Some(last)) if supervisor.is_stopping() => output.play_plan_in_stop(now, last, surface),
            (Bridge::Plan, Some(last)) => output.play_plan(now, last),
            (Bridge::Retreat, Some(last)) => output.retreat(now, last, surface),
            (Bridge::Rest, _) => output.rest_without_sample(now),
            (Bridge::Hold | Bridge::Ramp | Bridge::Plan | Bridge::Retreat, last) => output.hold(now, last),
        };
        if movement.motion == Motion::Hold {
            beside.stop();
        }
        let shown = match (bridge, last) {
            (Bridge::Ramp | Bridge::Plan | Bridge::Retreat | Bridge::Hold, Some(last)) => beside.shown(movement, last),
            (Bridge::Rest, _) | (_, None) => movement,
        };
        // A stopped arm may retreat from where it is believed to be: that takes a person.
        if matches!(supervisor.mode(), Mode::Idle(_)) {
            intake.forget_position();
        }
        output.send(now, &movement);
        beside.send(now);
        self.answer(shown, &Predicted::nothing(), Some(fault))
    }

    fn answer(
        &self,
        movement: Movement<N, D>,
        predicted: &Predicted<N, D>,
        fault: Option<SampleFault>,
    ) -> CycleOutput<'_, N, D> {
        let (intake, mode) = (&self.intake, self.supervisor.mode());
        let outcome = Outcome {
            movement,
            mode: mode.name(),
            stop_reason: mode.stop_reason(),
            singular: mode.singular(),
            verdict: predicted.verdict,
            iterations: predicted.iterations,
            expired_iteration: predicted.expired_iteration,
            active_axes: self.belief.contact().mask(),
            wrench: intake.last().filter(|_| fault.is_none()).map(|last| last.wrench),
            wrench_deviation: intake
                .last()
                .filter(|_| fault.is_none())
                .map(|last| last.wrench_covariance.diagonal().map(libm::sqrt)),
            arrival: intake.last().filter(|_| fault.is_none()).map(|last| last.arrival),
            wrong_rate: intake.wrong_rate(),
            wrench_without_lag: fault.is_none().then(|| self.belief.without_lag().wrench),
            fault,
            belief: self.belief.snapshot(),
            counters: self.counters(),
        };
        CycleOutput { outcome, plan: self.output.plan(), validity: self.parameters.timing.validity() }
    }

    /// Ends control; it lasts until [`Self::enable`].
    pub fn end(&mut self, ending: Ending) {
        self.supervisor.withdraw(ending);
    }

    /// Lets control begin with the next sample that allows it. Returns whether that changed
    /// anything.
    ///
    /// # Errors
    /// [`EnableRefused`] with the reason.
    pub fn enable(&mut self) -> Result<bool, EnableRefused> {
        self.supervisor.enable(self.intake.last(), &self.belief)
    }

    /// Whether control may begin or go on.
    pub fn is_enabled(&self) -> bool {
        self.supervisor.is_enabled()
    }

    /// Leaves Stopped; disabled control stays disabled. Without `force`, ṗ0 must not point inward
    /// and every force must be below release. Refused or not, it accepts the joint position of the
    /// next sample, wherever that is: an arm that has to retreat first may then do so.
    ///
    /// # Errors
    /// [`ResetRefused`] with the reason.
    pub fn reset(&mut self, force: bool) -> Result<(), ResetRefused> {
        if matches!(self.supervisor.mode(), Mode::Stopped(_)) {
            self.intake.forget_position();
        }
        self.supervisor.reset(force, self.intake.last(), &self.belief)?;
        self.belief.release();
        self.output.reset();
        Ok(())
    }

    /// The parameters.
    pub fn parameters(&self) -> &Parameters<N, D> {
        &self.parameters
    }

    /// The mode.
    pub fn mode(&self) -> ModeName {
        self.supervisor.mode().name()
    }

    /// How the joints moved at the last sample.
    pub fn joint_motion(&self) -> &JointMotion<N> {
        self.joints.motion()
    }

    /// The belief about the surface.
    pub fn belief(&self) -> Snapshot {
        self.belief.snapshot()
    }

    /// What the wrench shows of the acceleration of the tool's centre of gravity, on the task axes:
    /// what a tool of 1 kg adds to it, in m/s² and m²/s².
    pub fn tool_acceleration(&self) -> &SVector<f64, D> {
        self.intake.tool_acceleration()
    }

    /// Running counts.
    pub fn counters(&self) -> Counters {
        Counters {
            cycles: self.cycles,
            fallback: self.output.fallbacks(),
            rejected: self.intake.rejected(),
            missed: self.intake.missed(),
            irregular: self.intake.irregular(),
            limited: self.output.limited(),
            contacts_lost: self.supervisor.contacts_lost(),
            exceeded: self.supervisor.exceeded(),
        }
    }
}

/// What the MPC made of a cycle.
struct Predicted<const N: usize, const D: usize> {
    /// `None` if it was not asked, J has no inverse, or the arm has come to rest.
    movement: Option<Movement<N, D>>,
    verdict: Verdict,
    iterations: u32,
    expired_iteration: Option<u32>,
}

impl<const N: usize, const D: usize> Predicted<N, D> {
    fn nothing() -> Self {
        Self { movement: None, verdict: Verdict::None, iterations: 0, expired_iteration: None }
    }
}

/// How singular J will be where the arm comes to rest if it is stopped a cycle from now. A stop that
/// begins at the pose itself has joints left that turn fast, and cannot brake them without pressing.
fn nearly_singular_ahead<const N: usize, const D: usize>(
    parameters: &Parameters<N, D>,
    sample: &Accepted<N, D>,
    joints: JointMotion<N>,
    output: &Output<N, D>,
    beside: &NullMotion<N>,
) -> Option<Singular> {
    let Parameters { chain, loops, timing, minimum_reciprocal_condition, .. } = parameters;
    let mut reference = sample.posture.inverse(0.0).ok()?.joint_velocity(&(sample.twist_reference + output.offset()));
    if let Some(beside) = beside.latest() {
        reference += beside;
    }
    let acting = loops.dead_time.add_scalar((timing.command_delay + timing.sampling_time).seconds());
    let [by_velocity, by_acceleration, _] = loops.until_rest();
    let way = by_velocity.component_mul(&joints.velocity)
        + by_acceleration.component_mul(&joints.acceleration)
        + acting.component_mul(&reference);
    let reciprocal_condition = sample.posture.reciprocal_condition_after(chain, &sample.joint_position, &way).max(0.0);
    (reciprocal_condition < *minimum_reciprocal_condition).then_some(Singular { reciprocal_condition })
}

/// By how much the joint references of a steady twist change in rad/s² as the arm turns: the twist streamed last,
/// or before the first command ṗ0.
fn turning<const N: usize, const D: usize>(
    parameters: &Parameters<N, D>,
    sample: &Accepted<N, D>,
    joints: &JointMotion<N>,
    output: &Output<N, D>,
) -> SVector<f64, N> {
    /// Time in s over which the difference is taken: far above rounding, far below what turns J.
    const AHEAD: f64 = 1e-4;
    let Ok(here) = sample.posture.inverse(0.0) else { return SVector::zeros() };
    let streamed = output.streamed_before(sample.stamp);
    let twist = streamed
        .map_or(sample.twist_reference, |reference| sample.posture.jacobian() * SVector::from(reference.velocity));
    let ahead = parameters.chain.kinematics(&(sample.joint_position + joints.velocity * AHEAD)).inverse::<D>(0.0);
    ahead
        .map_or_else(|_| SVector::zeros(), |ahead| (ahead.joint_velocity(&twist) - here.joint_velocity(&twist)) / AHEAD)
}

/// Contact and stop: asks the MPC for what the mode wants, a second time where the first answer is
/// that the contact cannot go on. The joints move like this, and do that beside the task.
fn predict<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>>(
    sample: &Accepted<N, D>,
    (joints, beside): (JointMotion<N>, &NullMotion<N>),
    belief: &Belief<D>,
    supervisor: &mut Supervisor<D>,
    mpc: &mut Mpc<N, D, S, B>,
    output: &mut Output<N, D>,
    expired: &mut dyn FnMut() -> bool,
) -> Predicted<N, D> {
    let mut predicted = Predicted::nothing();
    if supervisor.task().is_none() {
        return predicted;
    }
    let Ok(situation) = Situation::new(sample, belief, output, joints, beside) else { return predicted };
    loop {
        if supervisor.is_overdue(sample.stamp) || (supervisor.is_stopping() && mpc.may_rest(&situation)) {
            supervisor.rest(sample.stamp);
        }
        let Some(task) = supervisor.task() else { return predicted };
        let solution = match task {
            Task::Press => mpc.press(&situation, &supervisor.demand(&situation), expired),
            Task::Stop => mpc.stop(&situation, expired),
        };
        if task == Task::Press {
            predicted.verdict = solution.verdict();
        }
        if supervisor.conclude(task, &solution, sample.stamp) {
            continue;
        }
        (predicted.iterations, predicted.expired_iteration) = (solution.iterations(), solution.expired_iteration());
        let surface = belief.surface();
        predicted.movement = Some(match (solution, task) {
            (Solution::Planned { plan, .. }, Task::Press) => output.follow(plan, Source::Mpc, sample),
            (Solution::Planned { plan, .. }, Task::Stop) => output.follow(plan, Source::MinimumForce, sample),
            (_, Task::Press) => output.fall_back(sample, surface),
            (_, Task::Stop) => output.fall_back_in_stop(sample, surface, supervisor.is_plan_exhausted()),
        });
        return predicted;
    }
}
