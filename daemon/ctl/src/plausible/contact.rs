//! A contact of the daemon's cycle with a plant in virtual time, and what full outward speed would
//! have attained in it.

use admittance_runner::config::Config;
use admittance_runner::cycle;
use admittance_runner::virtual_time::{Step, VirtualTime};
use ipc_types::{CommandSample, Mode, Motion, StopReason, TruthSample, Verdict, VirtualPlant};
use plant_sim::pose::{self, ArmPose};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

use crate::limits::{FORCE_TOLERANCE_N, limited_axes, limited_forces};

/// Losses of contact count from so long after the first touch, in s: the first impact is over.
const IMPACT_S: f64 = 0.05;
/// Outward speed is kept up for so long after the first active sample, in s.
const OUTWARD_S: f64 = 0.1;

/// What a contact showed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Largest true force over its limit, of all limited axes.
    pub peak_ratio: f64,
    /// Whether the largest force is above its limit by more than a limit's tolerance.
    pub is_over: bool,
    /// Times that contact ended after the first impact, before any stop.
    pub late_losses: u32,
    /// Why the controller stopped; `None` where it did not.
    pub stop_reason: Option<StopReason>,
    /// Whether any verdict was infeasible.
    pub is_infeasible: bool,
    /// Whether any verdict was that it is at risk.
    pub is_at_risk: bool,
    /// Samples in which the controller counted a force above its limit.
    pub counted: u64,
    /// Whether the controller took something else for a contact, or for a surface that pulls, before the tool touched.
    pub is_mistaken: bool,
    /// Whether the tool touched, and every sample was used.
    pub is_complete: bool,
}

impl Contact {
    /// Above the limit, and nothing said so: no stop, no verdict that it can't or may not be kept, and
    /// no sample counted.
    pub fn is_silent(&self) -> bool {
        self.is_over && self.stop_reason.is_none() && !self.is_infeasible && !self.is_at_risk && self.counted == 0
    }
}

/// Losses of contact, those in the first impact apart.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Losses {
    touched_s: Option<f64>,
    seen: u32,
}

impl Losses {
    /// Times that contact ended since the truth seen last, and whether the first impact was over then.
    pub(crate) fn see(&mut self, truth: &TruthSample) -> (u32, bool) {
        if truth.in_contact == 1 {
            self.touched_s.get_or_insert(truth.scenario_time_s);
        }
        let is_late = self.touched_s.is_some_and(|touched| truth.scenario_time_s > touched + IMPACT_S);
        let new = truth.contact_losses - self.seen;
        self.seen = truth.contact_losses;
        (new, is_late)
    }
}

/// The largest force over its limit, and whether that is more than the tolerance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Peak {
    /// The force over its limit.
    pub ratio: f64,
    /// Whether it is above it by more than a limit's tolerance.
    pub is_over: bool,
}

impl Peak {
    fn see(&mut self, config: &Config, truth: &TruthSample) {
        for (_, force, limit) in limited_forces(config, truth) {
            self.ratio = self.ratio.max(force / limit);
            self.is_over |= force > limit + FORCE_TOLERANCE_N;
        }
    }
}

/// Runs the controller against the plant to the end of its motion.
///
/// # Errors
/// What controller or plant do not accept.
pub fn press(config: &Config, scenario: &Scenario) -> Result<Contact, String> {
    press_seen(config, scenario, |_| ())
}

/// The same; `see` sees each cycle.
///
/// # Errors
/// What controller or plant do not accept.
pub fn press_seen(config: &Config, scenario: &Scenario, mut see: impl FnMut(&Step)) -> Result<Contact, String> {
    let plant = VirtualRun::new(scenario).map_err(|error| error.to_string())?;
    let mut run = VirtualTime::new(cycle::build(config)?, plant);
    let (mut peak, mut losses, mut late_losses) = (Peak::default(), Losses::default(), 0);
    let (mut stop_reason, mut is_infeasible, mut is_at_risk) = (None, false, false);
    let (mut has_fault, mut has_touched, mut is_mistaken) = (false, false, false);
    while let Some(step) = run.step()? {
        see(&step);
        let Step { command, truth, report, .. } = step;
        has_fault |= report.fault.is_some();
        has_touched |= truth.peak_wrench.iter().any(|force| *force != 0.0);
        is_mistaken |= !has_touched && matches!(Mode::from_code(command.mode), Some(Mode::Contact | Mode::Stopping));
        peak.see(config, &truth);
        if let (new, true) = losses.see(&truth)
            && stop_reason.is_none()
        {
            late_losses += new;
        }
        is_infeasible |= command.verdict == Verdict::Infeasible.code();
        is_at_risk |= command.verdict == Verdict::AtRisk.code();
        if command.stop_reason != StopReason::NONE && stop_reason.is_none() {
            stop_reason = StopReason::from_code(command.stop_reason);
        }
    }
    let is_complete = losses.touched_s.is_some() && !has_fault;
    let Peak { ratio: peak_ratio, is_over } = peak;
    let counted = run.cycle.counters().exceeded;
    Ok(Contact {
        peak_ratio,
        is_over,
        late_losses,
        stop_reason,
        is_infeasible,
        is_at_risk,
        counted,
        is_mistaken,
        is_complete,
    })
}

/// The peak when every joint goes outward at its speed limit from the first active sample on: what
/// an arm attains all of whose axes may be moved.
///
/// # Errors
/// What the plant does not accept, and a configuration without limits of the joints' speeds.
pub fn outward(config: &Config, scenario: &Scenario) -> Result<Peak, String> {
    outward_by(config, scenario, |pose, normal, limits, _| pose.fastest_twist(normal, limits))
}

/// The same with the twist that `fastest` gives for a pose, the surface's normal, the limits of the joints'
/// speeds, and the twist reference.
///
/// # Errors
/// As [`outward`], and where `fastest` has no answer.
pub fn outward_by(
    config: &Config,
    scenario: &Scenario,
    fastest: impl Fn(&ArmPose, &[f64; 3], &[f64], &[f64]) -> Option<Vec<f64>>,
) -> Result<Peak, String> {
    let Some(limits) = &config.limits.joint_speed_rad_s else {
        return Err("without limits.joint_speed_rad_s nothing bounds what is attainable".to_owned());
    };
    let normal = scenario.surface.as_ref().map_or([0.0; 3], |surface| surface.normal);
    let joints = scenario.robot.joint.len();
    // When it is active is a matter of what presses, not of what a tool adds.
    let scenario = Scenario { sensor: None, ..scenario.clone() };
    let mut plant = VirtualRun::new(&scenario).map_err(|error| error.to_string())?;
    let (mut peak, mut active_s, mut has_touched) = (Peak::default(), None, false);
    while !plant.is_finished() {
        let state = *plant.sample().ok_or("the plant published no sample")?;
        let thresholds = &config.contact.activation_threshold;
        let is_active = limited_axes(config).any(|(axis, _)| state.wrench[axis].abs() > thresholds[axis]);
        let mut command = CommandSample {
            sequence: state.sequence,
            boot_id: 1,
            state_sequence: state.sequence,
            state_stamp_ns: state.stamp_ns,
            valid_until_ns: state.stamp_ns + 1_000_000_000,
            joint_count: joints as u32,
            motion: Motion::Offset.code(),
            ..CommandSample::zeroed()
        };
        if is_active || active_s.is_some() {
            let pose = pose::at(&scenario.robot, &state.joint_position[..joints]);
            let reference = &state.twist_reference[..scenario.robot.task_axes as usize];
            let twist = pose.and_then(|pose| fastest(&pose, &normal, limits, reference));
            let twist = twist.ok_or("the arm is singular, or has no way out")?;
            for ((offset, twist), known) in command.velocity_offset.iter_mut().zip(twist).zip(state.twist_reference) {
                *offset = twist - known;
            }
        }
        let truth = plant.advance(Some(&command))?;
        peak.see(config, &truth);
        if is_active {
            active_s.get_or_insert(truth.scenario_time_s);
        }
        has_touched |= truth.in_contact == 1;
        let has_left = has_touched && truth.in_contact == 0;
        if active_s.is_some_and(|active| truth.scenario_time_s > active + OUTWARD_S || has_left) {
            break;
        }
    }
    Ok(peak)
}
