//! One cycle on wire samples: a state sample in, a command out. No I/O and no clock, so that tests and studies drive the
//! same code in virtual time that the real-time thread drives in real time.

use std::any::Any;

use admittance_core::condensation::Capacity;
use admittance_core::controller::{Controller, Event};
use admittance_core::mode::{Mode, StopReason};
use admittance_core::outcome::{Counters, Outcome};
use admittance_core::parameters::Parameters;
use admittance_core::plan::nanoseconds;
use admittance_core::sample::SampleFault;
use admittance_core::wrench::Conditioning;
use admittance_core::{EnableRefused, ResetRefused, robot::Singular};
use ipc_types::{CommandSample, StateSample, TASK_AXES};
use nalgebra::{Matrix3, SVector};

use crate::config::Config;
use crate::settings::Settings;
use crate::solver::Solver;
use crate::{parameters, wire};

/// What a cycle tells besides its command, for log and record.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CycleReport {
    /// Why the sample did not reach the law.
    pub fault: Option<SampleFault>,
    /// Iterations of the solver.
    pub iterations: u32,
    /// The iteration at which time was up.
    pub expired_at: Option<u32>,
    /// Whether a limit had to cut the offset after the law.
    pub limited: bool,
    /// Mean spacing of the samples in s while it is off the sampling time.
    pub wrong_rate: Option<f64>,
    /// Singular pose, if that is why the arm is stopped.
    pub singular: Option<Singular>,
    /// f̂ as the law saw it, in N and N·m; zero when the sample did not reach it.
    pub wrench: [f64; TASK_AXES],
    /// When the solver ended, ns of CLOCK_MONOTONIC; 0 when it was not called. A measurement, no part of the answer.
    pub solver_ended_ns: u64,
}

impl CycleReport {
    /// Its fault as a code.
    pub fn fault_code(&self) -> ipc_types::Fault {
        wire::fault(self.fault.as_ref())
    }
}

/// The reason that an order to stop gave on the wire; `None` for one that no order gives.
pub fn ordered_reason(code: u32) -> Option<StopReason> {
    [StopReason::Shutdown, StopReason::Disabled].into_iter().find(|reason| wire::stop_reason(*reason).code() == code)
}

/// A controller for some arm, on wire samples.
pub trait Cycle {
    /// Answers `state` at the time `now` (ns of CLOCK_MONOTONIC). `expired` is asked between solver iterations. Writes all
    /// of `command` but its sequence, boot id, stamp, compute time and late count.
    fn answer(
        &mut self,
        state: &StateSample,
        now: u64,
        expired: &mut dyn FnMut() -> bool,
        command: &mut CommandSample,
    ) -> CycleReport;

    /// What follows from there being no sample for too long.
    fn silence(&mut self, now: u64, command: &mut CommandSample) -> CycleReport;

    /// Ends control; see [`Controller::request_stop`].
    fn request_stop(&mut self, reason: StopReason);

    /// Lets control begin; see [`Controller::enable`].
    ///
    /// # Errors
    /// [`EnableRefused`].
    fn enable(&mut self) -> Result<bool, EnableRefused>;

    /// Whether control is enabled.
    fn is_enabled(&self) -> bool;

    /// What requests may change, as it is in force.
    fn settings(&self) -> &Settings;

    /// Leaves Stopped; see [`Controller::reset`].
    ///
    /// # Errors
    /// [`ResetRefused`].
    fn reset(&mut self, force: bool) -> Result<(), ResetRefused>;

    /// The mode.
    fn mode(&self) -> Mode;

    /// Where the surface is believed to be; see [`Controller::contact_point`].
    fn contact_point(&self) -> [f64; 3];

    /// Believes the surface to be elsewhere; see [`Controller::assume_contact_point`].
    fn assume_contact_point(&mut self, position: [f64; 3]);

    /// Running counts; see [`Controller::counters`].
    fn counters(&self) -> Counters;

    /// Goes on where `old` is, with this controller's parameters. False when `old` is for another arm.
    fn take_over(&mut self, old: &dyn Cycle) -> bool;

    /// For [`Self::take_over`].
    fn as_any(&self) -> &dyn Any;
}

struct ArmCycle<const N: usize, const D: usize> {
    controller: Controller<N, D, Solver, Box<[f64]>>,
    conditioning: Conditioning<D>,
    command_delay: u64,
    parameters: Parameters<N, D>,
    settings: Settings,
}

/// The controller that a (checked) configuration describes: the one match over the arms.
///
/// # Errors
/// A sentence that says what the core does not accept.
pub fn build(config: &Config) -> Result<Box<dyn Cycle + Send>, String> {
    match (config.robot.joint.len(), config.robot.task_axes) {
        (2, 2) => build_arm::<2, 2>(config),
        (6, 6) => build_arm::<6, 6>(config),
        (7, 6) => build_arm::<7, 6>(config),
        (joints, axes) => Err(format!(
            "robot: {joints} joints with {axes} task axes: accepted are 2 joints with 2 axes, 6 or 7 joints with 6"
        )),
    }
}

fn build_arm<const N: usize, const D: usize>(config: &Config) -> Result<Box<dyn Cycle + Send>, String> {
    let misfit = "the configuration's lists do not fit the arm: run admittancectl validate on it";
    let parameters = parameters::parameters::<N, D>(config).ok_or(misfit)?;
    let conditioning = parameters::conditioning(&config.wrench).ok_or(misfit)?;
    let solver = Solver::new(&config.mpc, &parameters);
    let storage = vec![0.0; Capacity::new::<N, D>(parameters.mpc.horizon).storage_len()].into_boxed_slice();
    let controller = Controller::new(parameters, solver, storage).map_err(|error| error.to_string())?;
    let command_delay = nanoseconds(parameters.timing.command_delay);
    let settings = Settings::of(config);
    Ok(Box::new(ArmCycle { controller, conditioning, command_delay, parameters, settings }))
}

impl<const N: usize, const D: usize> ArmCycle<N, D> {
    /// f̂ of a state sample, whether or not it may be used.
    fn wrench(&self, state: &StateSample) -> SVector<f64, D> {
        let orientation = if self.conditioning.needs_orientation() {
            let position = SVector::<f64, N>::from_fn(|joint, _| state.joint_position[joint]);
            self.parameters.chain.kinematics(&position).pose.rotation
        } else {
            Matrix3::identity()
        };
        self.conditioning.wrench(&state.wrench.into(), &orientation)
    }

    /// `planned_at`: the instant from which the plan counts; `stamp`: from which the command is valid; ns both.
    fn write(
        &mut self,
        outcome: &Outcome<N, D>,
        planned_at: u64,
        stamp: u64,
        command: &mut CommandSample,
    ) -> CycleReport {
        wire::write_outcome(command, outcome, &self.controller);
        // On the wire the plan counts from the sample that the command names, which may be long gone.
        let since = planned_at.saturating_sub(command.state_stamp_ns);
        for end in &mut command.plan_end_ns[..command.plan_length as usize] {
            *end = end.saturating_add(since);
        }
        command.valid_until_ns = stamp.saturating_add(self.command_delay).saturating_add(self.controller.validity());
        CycleReport {
            fault: outcome.fault,
            iterations: outcome.iterations,
            expired_at: outcome.expired_at,
            limited: outcome.limited,
            wrong_rate: self.controller.history().wrong_rate(&self.parameters.timing),
            singular: self.controller.singular(),
            wrench: [0.0; TASK_AXES],
            solver_ended_ns: self.controller.solver_mut().take_end(),
        }
    }
}

impl<const N: usize, const D: usize> Cycle for ArmCycle<N, D> {
    fn answer(
        &mut self,
        state: &StateSample,
        now: u64,
        expired: &mut dyn FnMut() -> bool,
        command: &mut CommandSample,
    ) -> CycleReport {
        let wrench = self.wrench(state);
        let sample = wire::sample(state, &wrench, self.conditioning.saturated(&state.wrench.into()));
        let outcome = self.controller.step(Event::Sample(&sample), now, expired);
        command.state_sequence = state.sequence;
        command.state_stamp_ns = state.stamp_ns;
        // A stamp that is not to be trusted must not make a command valid for ever.
        let planned_at = if outcome.fault.is_some() { now } else { state.stamp_ns };
        let mut report = self.write(&outcome, planned_at, state.stamp_ns.min(now), command);
        if report.fault.is_none() {
            report.wrench = wire::padded(wrench.as_slice());
        }
        report
    }

    fn silence(&mut self, now: u64, command: &mut CommandSample) -> CycleReport {
        let outcome = self.controller.step(Event::Silence, now, &mut || false);
        self.write(&outcome, now, now, command)
    }

    fn request_stop(&mut self, reason: StopReason) {
        self.controller.request_stop(reason);
    }

    fn enable(&mut self) -> Result<bool, EnableRefused> {
        self.controller.enable()
    }

    fn is_enabled(&self) -> bool {
        self.controller.is_enabled()
    }

    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn reset(&mut self, force: bool) -> Result<(), ResetRefused> {
        self.controller.reset(force)
    }

    fn mode(&self) -> Mode {
        self.controller.mode()
    }

    fn contact_point(&self) -> [f64; 3] {
        (*self.controller.contact_point()).into()
    }

    fn assume_contact_point(&mut self, position: [f64; 3]) {
        self.controller.assume_contact_point(position.into());
    }

    fn counters(&self) -> Counters {
        self.controller.counters()
    }

    fn take_over(&mut self, old: &dyn Cycle) -> bool {
        let Some(old) = old.as_any().downcast_ref::<Self>() else { return false };
        self.controller.continue_from(&old.controller);
        true
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}
