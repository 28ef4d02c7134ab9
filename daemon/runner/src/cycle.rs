//! One cycle on wire samples: a state sample in, a command out, for an arm that is known at run
//! time only.

use std::any::Any;

use admittance_core::Controller;
use admittance_core::belief::{Expected, JointMotion, Snapshot};
use admittance_core::intake::{Arrival, Event, SampleFault, WrongRate};
use admittance_core::mpc::qp::{Answer, Qp, QpOutcome};
use admittance_core::mpc::{ActiveSet, QpSolver};
use admittance_core::quantities::{Instant, Span};
use admittance_core::robot::{SUPPORTED_ARMS, Singular};
use admittance_core::supervisor::{EnableRefused, Ending, ResetRefused};
use admittance_core::with_arm;
use admittance_core::{Counters, CycleOutput, Parameters, Turn};
use ipc_types::{CommandSample, Fault, MAX_JOINTS, Mode, RecordSample, StateSample, StopReason, TASK_AXES};
use nalgebra::SVector;

use crate::config::{Config, FrameName};
use crate::settings::Settings;
use crate::task_frame::TaskFrame;
use crate::{parameters, wire};

/// What a cycle reports besides its command, for log and record.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CycleReport {
    /// Why the sample did not reach the law.
    pub fault: Option<SampleFault>,
    /// Iterations of the solver.
    pub iterations: u32,
    /// The iteration at which time was up.
    pub expired_iteration: Option<u32>,
    /// Whether a limit had to cut the offset after the law.
    pub limited: bool,
    /// How the sample followed the one before it; `None` when it did not reach the law.
    pub arrival: Option<Arrival>,
    /// Whether the thread found the sample without having been notified of it.
    pub is_unnotified: bool,
    /// The rate of the samples, while it is another than the configured one.
    pub wrong_rate: Option<WrongRate>,
    /// How singular the pose was, if that is why the arm is stopped.
    pub singular: Option<Singular>,
    /// f̂ as the law saw it, in the task frame, in N and N·m; zero when the sample did not reach it.
    pub wrench: [f64; TASK_AXES],
    /// The same without the lag of f̂.
    pub wrench_without_lag: [f64; TASK_AXES],
    /// Standard deviation of f̂ from motor torques, in N and N·m; zero of a wrench that is given.
    pub wrench_deviation: [f64; TASK_AXES],
}

impl CycleReport {
    /// Writes the cycle's own part into a record.
    pub fn write(&self, record: &mut RecordSample) {
        record.iterations = self.iterations;
        record.fault = Fault::code_of(self.fault.as_ref().map(SampleFault::name));
        record.limited = u32::from(self.limited);
        record.wrench = self.wrench;
        record.wrench_without_lag = self.wrench_without_lag;
        record.wrench_deviation = self.wrench_deviation;
    }
}

/// Why control ends, by an order's reason on the wire; `None` for a reason that no order gives.
pub fn ending(reason: StopReason) -> Option<Ending> {
    match reason {
        StopReason::Disabled => Some(Ending::Disabled),
        StopReason::Shutdown => Some(Ending::Shutdown),
        _ => None,
    }
}

/// The solver of the law.
pub type Solver = ActiveSet<Box<[f64]>>;

/// A controller for some arm, on wire samples.
pub trait Cycle: Send {
    /// Answers `state` at the time `now`. `expired` is called before and between solver iterations.
    /// Fills in `command`, except its sequence, boot id, stamp, compute time and late count.
    fn answer(
        &mut self,
        state: &StateSample,
        now: Instant,
        expired: &mut dyn FnMut() -> bool,
        command: &mut CommandSample,
    ) -> CycleReport;

    /// Handles the silence when there has been no sample for too long.
    fn silence(&mut self, now: Instant, command: &mut CommandSample) -> CycleReport;

    /// Ends control; see [`Controller::end`].
    fn end(&mut self, ending: Ending);

    /// Lets control begin; see [`Controller::enable`].
    ///
    /// # Errors
    /// [`EnableRefused`].
    fn enable(&mut self) -> Result<bool, EnableRefused>;

    /// Leaves Stopped; see [`Controller::reset`].
    ///
    /// # Errors
    /// [`ResetRefused`].
    fn reset(&mut self, force: bool) -> Result<(), ResetRefused>;

    /// The mode.
    fn mode(&self) -> Mode;

    /// Whether control is enabled.
    fn is_enabled(&self) -> bool;

    /// Running counts.
    fn counters(&self) -> Counters;

    /// The belief about the surface, base frame.
    fn belief(&self) -> Snapshot;

    /// What the wrench shows of the tool's acceleration, in the task frame; see
    /// [`Controller::tool_acceleration`].
    fn tool_acceleration(&self) -> [f64; TASK_AXES];

    /// q̇ in rad/s and q̈ in rad/s² as the law sees them; see [`Controller::joint_motion`].
    fn joint_motion(&self) -> [[f64; MAX_JOINTS]; 2];

    /// The values that requests may change, as they are in force.
    fn settings(&self) -> &Settings;

    /// Takes over the state of `old`, but keeps this controller's parameters. False when `old` is
    /// for another arm.
    fn take_over(&mut self, old: &dyn Cycle) -> bool;

    /// For [`Self::take_over`].
    fn as_any(&self) -> &dyn Any;
}

impl dyn Cycle + '_ {
    /// Writes the state after a cycle or an order into a record.
    pub fn write(&self, record: &mut RecordSample) {
        let (counters, belief) = (self.counters(), self.belief());
        record.limited_count = counters.limited;
        record.contact_losses = counters.contacts_lost;
        record.exceeded_count = counters.exceeded;
        record.enabled = u32::from(self.is_enabled());
        record.contact_point = belief.contact_point.into();
        record.belief_uncertainty_n = belief.uncertainty;
        record.believed_stiffness_n_m = belief.stiffness;
        record.believed_stiffness_band_n_m = belief.stiffness_band.into();
        record.believed_normal = belief.normal.into();
        record.expected_pressing_n = belief.expected.pressing;
        record.expected_spring_n = belief.expected.spring;
        record.expected_stamp_ns = belief.expected.stamp.nanoseconds();
        record.tool_acceleration = self.tool_acceleration();
        [record.joint_velocity, record.joint_acceleration] = self.joint_motion();
        self.settings().write(record);
    }
}

/// What a record keeps of what the controller remembers for long.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Memory {
    /// The belief about the surface.
    pub belief: Snapshot,
    /// What the wrench shows of the tool's acceleration, in m/s² and m²/s².
    pub tool_acceleration: [f64; TASK_AXES],
    /// q̇ in rad/s and q̈ in rad/s² as the law saw them.
    pub joint_motion: [[f64; MAX_JOINTS]; 2],
}

impl Memory {
    /// That of a record.
    pub fn recorded(record: &RecordSample) -> Self {
        let expected = Expected {
            pressing: record.expected_pressing_n,
            spring: record.expected_spring_n,
            stamp: Instant::from_nanoseconds(record.expected_stamp_ns),
        };
        let (contact_point, uncertainty) = (record.contact_point.into(), record.belief_uncertainty_n);
        let (stiffness, [least, most]) = (record.believed_stiffness_n_m, record.believed_stiffness_band_n_m);
        let normal = record.believed_normal.into();
        let belief =
            Snapshot { contact_point, normal, uncertainty, expected, stiffness, stiffness_band: (least, most) };
        let joint_motion = [record.joint_velocity, record.joint_acceleration];
        Self { belief, tool_acceleration: record.tool_acceleration, joint_motion }
    }
}

/// The controller that a (checked) configuration describes.
///
/// # Errors
/// A sentence about what the law does not accept.
pub fn build(config: &Config) -> Result<Box<dyn Cycle>, String> {
    build_with(config, None, &|solver| Box::new(solver))
}

/// The same, starting from a recorded memory: for a replay that begins after earlier contacts.
///
/// # Errors
/// As [`build`].
pub fn build_remembering(config: &Config, memory: &Memory) -> Result<Box<dyn Cycle>, String> {
    build_with(config, Some(memory), &|solver| Box::new(solver))
}

/// The same with another solver in the place of its own, which it may ask: for measurements.
///
/// # Errors
/// As [`build`].
pub fn build_watched(
    config: &Config,
    watch: &dyn Fn(Solver) -> Box<dyn QpSolver + Send>,
) -> Result<Box<dyn Cycle>, String> {
    build_with(config, None, watch)
}

/// Any solver, so that the law is compiled once for each arm: that takes half a minute an arm.
struct AnySolver(Box<dyn QpSolver + Send>);

impl QpSolver for AnySolver {
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome {
        self.0.solve(qp, answer, expired)
    }
}

fn build_with(
    config: &Config,
    memory: Option<&Memory>,
    wrap: &dyn Fn(Solver) -> Box<dyn QpSolver + Send>,
) -> Result<Box<dyn Cycle>, String> {
    let (joints, axes, frame) = (config.robot.joint.len(), config.robot.task_axes, TaskFrame::of(config));
    with_arm!((joints, axes), <N, D> => {
        let controller = |inputs_per_cycle: u32| -> Result<_, String> {
            let in_base = parameters::parameters::<N, D>(config, inputs_per_cycle)
                .ok_or("the configuration's lists do not fit the arm: run admittancectl validate on it")?;
            let parameters = frame.see(&in_base);
            let capacity = parameters.solver_capacity();
            let solver = ActiveSet::new(capacity, config.mpc.max_iterations, zeros(capacity.storage_len()))
                .ok_or("the horizon is longer than the solver takes")?;
            let storage = zeros(parameters.storage_len());
            let controller = Controller::new(parameters, AnySolver(wrap(solver)), storage).map_err(|error| error.to_string())?;
            let controller = Box::new(match memory {
                Some(memory) => {
                    let [velocity, acceleration] =
                        memory.joint_motion.map(|joints| SVector::<f64, N>::from_fn(|joint, _| joints[joint]));
                    let Snapshot { contact_point, normal, .. } = memory.belief;
                    let (contact_point, normal) = (frame.vector(contact_point), frame.vector(normal));
                    let belief = Snapshot { contact_point, normal, ..memory.belief };
                    let controller = controller.believing(&belief).feeling(&memory.tool_acceleration.into());
                    controller.moving(&JointMotion { velocity, acceleration })
                }
                None => controller,
            });
            Ok(InFrame { controller, in_base: Box::new(in_base) })
        };
        let inputs = config.inputs_per_cycle();
        Ok(Box::new(ArmCycle {
            own: controller(1)?,
            other: if inputs > 1 { Some(controller(inputs)?) } else { None },
            plays_plan: false,
            command_delay: Span::from_seconds(config.control.command_delay_s),
            frame,
            follows_tool: config.task.frame == FrameName::Tool,
            is_placed: config.task.frame != FrameName::Tool,
            settings: Settings::of(config),
        }))
    }, else {
        Err(format!("robot: {joints} joints with {axes} task axes: accepted are {SUPPORTED_ARMS}"))
    })
}

fn zeros(length: usize) -> Box<[f64]> {
    vec![0.0; length].into_boxed_slice()
}

/// A controller in the task frame.
struct InFrame<const N: usize, const D: usize> {
    controller: Box<Controller<N, D, AnySolver, Box<[f64]>>>,
    /// Its parameters in the base frame.
    in_base: Box<Parameters<N, D>>,
}

impl<const N: usize, const D: usize> InFrame<N, D> {
    /// Goes over to a frame, which a turn leads to from its own.
    fn turn(&mut self, frame: &TaskFrame, turn: &Turn) {
        self.controller.turn(&frame.see(&self.in_base), turn);
    }
}

struct ArmCycle<const N: usize, const D: usize> {
    own: InFrame<N, D>,
    /// The one for a motion controller that differs in whether it plays the plan within its cycle;
    /// `None` where there is one input per cycle for all. Where the frame follows the tool it is left
    /// behind.
    other: Option<InFrame<N, D>>,
    /// Whether the last sample's motion controller does.
    plays_plan: bool,
    command_delay: Span,
    /// That of the controller; samples and commands are in the base frame.
    frame: TaskFrame,
    /// Whether it turns with the tool.
    follows_tool: bool,
    /// Whether what is remembered is of it: of a tool's from the first sample on.
    is_placed: bool,
    settings: Settings,
}

impl<const N: usize, const D: usize> ArmCycle<N, D> {
    /// Whoever follows the first input for a whole cycle must get one that is meant for it.
    fn suit(&mut self, plays_plan: bool) {
        if let Some(other) = self.other.as_mut().filter(|_| plays_plan != self.plays_plan) {
            if self.follows_tool {
                other.turn(&self.frame, &Turn::none());
            }
            other.controller.take_over(&self.own.controller);
            std::mem::swap(&mut self.own, other);
        }
        self.plays_plan = plays_plan;
    }

    /// Lets the frame follow the tool, to where a sample says that it is.
    fn follow_tool(&mut self, state: &StateSample, now: Instant) {
        if !self.follows_tool || !self.own.controller.believes_position(&wire::sample(state, &self.frame), now) {
            return;
        }
        let position = SVector::from_fn(|joint, _| state.joint_position[joint]);
        let next = TaskFrame::at(&self.own.in_base.chain.kinematics(&position).pose.rotation);
        // What a replay remembers from before the first sample is of the first one's frame.
        let turn = if self.is_placed { self.frame.to(&next) } else { Some(Turn::none()) };
        if let Some(turn) = turn {
            self.own.turn(&next, &turn);
        }
        (self.frame, self.is_placed) = (next, true);
    }

    /// Takes an event. `valid_from` is the instant from which the command is valid, `planned_from`
    /// the one from which its plan counts.
    fn step(
        &mut self,
        event: Event<'_, N, D>,
        now: Instant,
        expired: &mut dyn FnMut() -> bool,
        command: &mut CommandSample,
    ) -> CycleReport {
        let named = Instant::from_nanoseconds(command.state_stamp_ns);
        let answer = self.own.controller.step(event, now, expired);
        let outcome = &answer.outcome;
        // An implausible stamp must not make a command valid for ever. On the wire the plan counts
        // from the sample that the command names, which may be long gone.
        let is_used = outcome.fault.is_none();
        let planned_from = if is_used { named } else { now };
        let valid_from = match event {
            Event::Sample(sample) => sample.stamp.min(now),
            Event::Silence => now,
        };
        wire::write_answer(command, &answer, &self.frame, planned_from.since(named).nanoseconds());
        command.valid_until_ns = (valid_from + self.command_delay + answer.validity).nanoseconds();
        report(&answer)
    }
}

fn report<const N: usize, const D: usize>(answer: &CycleOutput<'_, N, D>) -> CycleReport {
    let outcome = &answer.outcome;
    CycleReport {
        fault: outcome.fault,
        iterations: outcome.iterations,
        expired_iteration: outcome.expired_iteration,
        limited: outcome.movement.limited,
        arrival: outcome.arrival,
        is_unnotified: false,
        wrong_rate: outcome.wrong_rate,
        singular: outcome.singular,
        wrench: outcome.wrench.map_or([0.0; TASK_AXES], |wrench| wire::padded(wrench.as_slice())),
        wrench_without_lag: outcome
            .wrench_without_lag
            .map_or([0.0; TASK_AXES], |wrench| wire::padded(wrench.as_slice())),
        wrench_deviation: outcome
            .wrench_deviation
            .map_or([0.0; TASK_AXES], |deviation| wire::padded(deviation.as_slice())),
    }
}

impl<const N: usize, const D: usize> Cycle for ArmCycle<N, D> {
    fn answer(
        &mut self,
        state: &StateSample,
        now: Instant,
        expired: &mut dyn FnMut() -> bool,
        command: &mut CommandSample,
    ) -> CycleReport {
        // A sample without a number cannot be named: the command goes on naming the one before.
        if state.sequence > 0 {
            (command.state_sequence, command.state_stamp_ns) = (state.sequence, state.stamp_ns);
        }
        self.suit(state.plays_plan == 1);
        self.follow_tool(state, now);
        self.step(Event::Sample(&wire::sample(state, &self.frame)), now, expired, command)
    }

    fn silence(&mut self, now: Instant, command: &mut CommandSample) -> CycleReport {
        self.step(Event::Silence, now, &mut || false, command)
    }

    fn end(&mut self, ending: Ending) {
        self.own.controller.end(ending);
    }

    fn enable(&mut self) -> Result<bool, EnableRefused> {
        self.own.controller.enable()
    }

    fn reset(&mut self, force: bool) -> Result<(), ResetRefused> {
        self.own.controller.reset(force)
    }

    fn mode(&self) -> Mode {
        self.own.controller.mode()
    }

    fn is_enabled(&self) -> bool {
        self.own.controller.is_enabled()
    }

    fn counters(&self) -> Counters {
        self.own.controller.counters()
    }

    fn belief(&self) -> Snapshot {
        let belief = self.own.controller.belief();
        if self.frame.axes().is_none() {
            return belief;
        }
        // What is told is so to the bit: a replay begins with it.
        let InFrame { controller, in_base } = &self.own;
        let is_told = belief.contact_point == controller.parameters().surface.contact.position;
        let believed = self.frame.vector_in_base(belief.contact_point);
        let contact_point = if is_told { in_base.surface.contact.position } else { believed };
        Snapshot { contact_point, normal: self.frame.vector_in_base(belief.normal), ..belief }
    }

    fn tool_acceleration(&self) -> [f64; TASK_AXES] {
        wire::padded(self.own.controller.tool_acceleration().as_slice())
    }

    fn joint_motion(&self) -> [[f64; MAX_JOINTS]; 2] {
        let motion = self.own.controller.joint_motion();
        [wire::padded(motion.velocity.as_slice()), wire::padded(motion.acceleration.as_slice())]
    }

    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn take_over(&mut self, old: &dyn Cycle) -> bool {
        let Some(old) = old.as_any().downcast_ref::<Self>() else { return false };
        // Without `..`: a new field has to say here what becomes of it.
        let Self { own, other: _, plays_plan, command_delay: _, frame, follows_tool: _, is_placed, settings: _ } = old;
        self.suit(*plays_plan);
        let turn = frame.to(&self.frame);
        if turn.is_some() {
            // What it takes over is of the old frame.
            self.own.turn(frame, &Turn::none());
        }
        self.own.controller.take_over(&own.controller);
        match turn {
            Some(turn) if !self.follows_tool => self.own.turn(&self.frame, &turn),
            _ => (self.frame, self.is_placed) = (*frame, *is_placed),
        }
        true
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}
