//! One cycle time and one stiffness: the configuration for them, and whether an approach is safe.

use std::fmt;

use admittance_core::quantities::AXIS_NAMES;
use admittance_host::config::Section;
use admittance_runner::config::Config;
use admittance_runner::cycle;
use admittance_runner::task_frame::TaskFrame;
use admittance_runner::virtual_time::{Step, VirtualTime};
use ipc_types::{StopReason, TruthSample};
use nalgebra::{Rotation3, Vector3};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;
use serde::Serialize;

use super::approach::Approach;
use super::search::{self, Cases};
use crate::parallel::Part;
use crate::plausible::Losses;

/// By how much in N a force may exceed its limit and still count as kept.
pub(crate) const FORCE_TOLERANCE_N: f64 = 0.5;
/// Highest speed that is tried, in m/s.
const HIGHEST_M_S: f64 = 3.0;

/// Why an approach is not safe: the first problem.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Unsafe {
    /// A true force above its limit.
    Force { axis: usize, force_n: f64 },
    /// The tool left the surface after it had touched.
    ContactLost,
    /// The controller stopped.
    Stop(StopReason),
    /// A sample did not reach the law.
    Fault(String),
    /// The approach starts where the arm does not reach, or passes a singular pose.
    OutOfReach,
    /// The tool never touched.
    NoContact,
}

impl fmt::Display for Unsafe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Force { axis, force_n } => {
                write!(f, "force on {}: {force_n:.1} N", AXIS_NAMES.get(*axis).unwrap_or(&"?"))
            }
            Self::ContactLost => write!(f, "contact lost"),
            Self::Stop(reason) => write!(f, "stop: {reason}"),
            Self::Fault(fault) => write!(f, "fault: {fault}"),
            Self::OutOfReach => write!(f, "approach out of reach"),
            Self::NoContact => write!(f, "no contact"),
        }
    }
}

/// What was found for one cycle time and one stiffness.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Cell {
    /// T_s in s.
    pub(crate) sampling_time_s: f64,
    /// Stiffness along the normal in N/m, believed and true.
    pub(crate) stiffness_n_m: f64,
    /// Highest safe speed in m/s, 0 when none is; `None` when the configuration does not allow this
    /// cell.
    pub(crate) speed_m_s: Option<f64>,
    /// The next higher speed that was tried and is not safe; `None` when the highest one tried is
    /// safe.
    pub(crate) unsafe_m_s: Option<f64>,
    /// What limits the speed.
    pub(crate) limited_by: String,
    /// Whether a higher speed was safe although a lower one was not.
    pub(crate) lowered: bool,
}

impl Cell {
    /// The highest safe speed in m/s.
    ///
    /// # Errors
    /// That there is none, and why.
    pub(crate) fn safe_speed(&self) -> Result<f64, String> {
        let found = self.speed_m_s.filter(|speed| *speed > 0.0);
        found.ok_or_else(|| format!("no speed is safe: {}", self.limited_by))
    }
}

/// The configuration at another cycle time and stiffness.
///
/// # Errors
/// What its checks do not accept.
pub(crate) fn config_for(base: &Config, sampling_time_s: f64, stiffness_n_m: f64) -> Result<Config, String> {
    let mut config = base.clone();
    config.environment.normal_stiffness_n_m = stiffness_n_m;
    // A daemon that waits for someone to enable it would not do anything here.
    config.control.start_enabled = true;
    if !is_own(base, sampling_time_s) {
        let control = &mut config.control;
        let ratio = sampling_time_s / control.sampling_time_s;
        control.sampling_time_s = sampling_time_s;
        // The same share of a cycle, and the same number of cycles, within what the keys accept.
        control.answer_budget_s = (control.answer_budget_s * ratio).max(1e-5).min(sampling_time_s);
        control.max_sample_age_s = (control.max_sample_age_s * ratio).clamp(sampling_time_s.max(1e-4), 1.0);
        control.spin_s = control.spin_s.min(0.5 * sampling_time_s);
        // Step lengths belong to their own cycle time; without any the default rule holds.
        config.mpc.step_lengths_s = None;
    }
    let mut errors = Vec::new();
    config.check("", &mut errors);
    match errors.first() {
        None => Ok(config),
        Some(error) => Err(error.to_string()),
    }
}

/// Whether this is the configuration's own cycle time.
pub(crate) fn is_own(base: &Config, sampling_time_s: f64) -> bool {
    (sampling_time_s / base.control.sampling_time_s - 1.0).abs() < 1e-9
}

/// The highest speed in m/s that is tried, and what bounds it.
pub(crate) fn highest_m_s(config: &Config, approach: &Approach) -> (f64, &'static str) {
    // The arm cannot approach any faster, whatever the contact would allow.
    let at_joint_limits = approach.speed_at_joint_limits_m_s(config);
    if at_joint_limits < HIGHEST_M_S {
        (search::round_to_digits(0.995 * at_joint_limits, 3).min(at_joint_limits), "joint speed limit")
    } else {
        (HIGHEST_M_S, "highest speed tried")
    }
}

/// How long a simulated approach takes, in parts of one at a very long cycle time. (The plant steps
/// at intervals of its own, the controller once a cycle.)
pub(crate) fn weight(sampling_time_s: f64) -> u64 {
    /// The cycle time in s at which the controller takes as long as the plant.
    const EQUAL_S: f64 = 0.001;
    const PARTS: f64 = 100.0;
    (PARTS * (1.0 + EQUAL_S / sampling_time_s)) as u64
}

/// The highest safe speed of a cell.
///
/// # Errors
/// What controller or plant do not accept although the checks did.
pub(crate) fn cell(
    base: &Config,
    approach: &Approach,
    sampling_time_s: f64,
    stiffness_n_m: f64,
    instants: u32,
    progress: &Part<'_>,
) -> Result<Cell, String> {
    let none = |why: String| Cell {
        sampling_time_s,
        stiffness_n_m,
        speed_m_s: None,
        unsafe_m_s: None,
        limited_by: why,
        lowered: false,
    };
    let config = match config_for(base, sampling_time_s, stiffness_n_m) {
        Ok(config) => config,
        Err(why) => return Ok(none(why)),
    };
    let (highest, bound) = highest_m_s(&config, approach);
    let try_case = |speed: f64, instant: u64| {
        let found = is_safe(&config, approach, speed, instant as f64 / f64::from(instants));
        progress.add(weight(sampling_time_s));
        found
    };
    // The cells themselves run beside each other.
    let found = search::highest_safe(highest, &Cases { count: instants.into(), threads: 1, try_case })?;
    Ok(Cell {
        sampling_time_s,
        stiffness_n_m,
        speed_m_s: Some(found.safe_m_s),
        unsafe_m_s: found.beyond.as_ref().map(|(speed, _)| *speed),
        limited_by: found.beyond.map_or_else(|| bound.to_owned(), |(_, why)| why.to_string()),
        lowered: found.lowered,
    })
}

/// Whether the approach at one speed with one instant of contact, as a share of a cycle, is safe.
///
/// # Errors
/// As [`cell`].
pub(crate) fn is_safe(
    config: &Config,
    approach: &Approach,
    speed_m_s: f64,
    contact_phase: f64,
) -> Result<Result<(), Unsafe>, String> {
    is_safe_in(config, &approach.scenario(config, speed_m_s, contact_phase))
}

/// The same against any plant.
///
/// # Errors
/// As [`cell`].
pub(super) fn is_safe_in(config: &Config, scenario: &Scenario) -> Result<Result<(), Unsafe>, String> {
    let Ok(plant) = VirtualRun::new(scenario) else {
        return Ok(Err(Unsafe::OutOfReach));
    };
    let mut verdict = Ok(());
    let (mut touched, mut losses) = (false, Losses::default());
    let mut run = VirtualTime::new(cycle::build(config)?, plant);
    while let (true, Some(step)) = (verdict.is_ok(), run.step()?) {
        touched |= step.truth.peak_normal_force_n > 0.0;
        verdict = check(config, &step, losses.see(&step.truth));
    }
    Ok(if verdict.is_ok() && !touched { Err(Unsafe::NoContact) } else { verdict })
}

fn check(config: &Config, step: &Step, (losses, is_late): (u32, bool)) -> Result<(), Unsafe> {
    for (axis, force_n, limit) in limited_forces(config, &step.truth) {
        if force_n > limit + FORCE_TOLERANCE_N {
            return Err(Unsafe::Force { axis, force_n });
        }
    }
    // A bounce at the impact is what a tolerance of the arm's lag is told to cost.
    if losses > 0 && (is_late || config.control.lag_tolerance_s == 0.0) {
        return Err(Unsafe::ContactLost);
    }
    if let Some(fault) = &step.report.fault {
        return Err(Unsafe::Fault(format!("{fault:?}")));
    }
    match (step.command.stop_reason, StopReason::from_code(step.command.stop_reason)) {
        (StopReason::NONE, _) => Ok(()),
        (_, Some(reason)) => Err(Unsafe::Stop(reason)),
        (code, None) => Err(Unsafe::Fault(format!("stop reason {code}"))),
    }
}

/// The axes whose force is limited, and their limits in N. The plant's surface gives no moments.
pub(crate) fn limited_axes(config: &Config) -> impl Iterator<Item = (usize, f64)> + '_ {
    let contact = &config.contact;
    let axes = contact.admittance_axes.iter().zip(&contact.force_limit).enumerate().take(3);
    axes.filter(|(_, (admittance, _))| **admittance).map(|(axis, (_, limit))| (axis, *limit))
}

/// The true forces on those axes, which are of the task frame: (axis, largest magnitude in N since the truth before,
/// limit in N).
pub(crate) fn limited_forces<'a>(
    config: &'a Config,
    truth: &TruthSample,
) -> impl Iterator<Item = (usize, f64, f64)> + use<'a> {
    let tool = Rotation3::new(truth.tcp_rotation.into()).into_inner();
    let [x, y, z, ..] = truth.peak_wrench;
    // A surface gives all three of them their peak at one instant.
    let force = TaskFrame::with_tool(config, &tool).vector(Vector3::new(x, y, z));
    limited_axes(config).map(move |(axis, limit)| (axis, force[axis].abs(), limit))
}

#[cfg(test)]
mod tests {
    use admittance_runner::config::{ContactPointName, GivenInName, GivenSignName};

    use super::super::tests::planar;
    use crate::parallel::Progress;

    use super::*;

    #[test]
    fn what_hangs_on_the_cycle_time_changes_with_it() {
        let mut base = planar();
        base.mpc.step_lengths_s = Some(vec![0.004, 0.004, 0.008]);
        let own = config_for(&base, 0.004, 3e5).unwrap();
        assert_eq!(own.mpc.step_lengths_s, base.mpc.step_lengths_s);
        assert_eq!(own.environment.normal_stiffness_n_m, 3e5);
        let fast = config_for(&base, 0.00025, 1e5).unwrap();
        assert_eq!(fast.mpc.step_lengths_s, None);
        assert!((fast.control.max_sample_age_s - 3.0 * 0.00025).abs() < 1e-12);
        assert!((fast.control.answer_budget_s - 0.25 * 0.00025).abs() < 1e-12);
        assert!(fast.control.spin_s <= 0.5 * 0.00025);
        for time in [0.0001, 0.01, 0.1] {
            config_for(&base, time, 1e5).unwrap();
        }
    }

    #[test]
    fn a_delay_of_too_many_cycles_leaves_the_cell_out() {
        let mut base = planar();
        base.control.command_delay_s = 0.004;
        let approach = Approach::new(&base, None, None).unwrap();
        let cell = cell(&base, &approach, 0.00025, 1e5, 2, &Progress::silent().part(0)).unwrap();
        assert!(cell.speed_m_s.is_none() && cell.limited_by.contains("command_delay_s"), "{}", cell.limited_by);
    }

    #[test]
    fn a_sensor_as_told_changes_nothing() {
        let approach = Approach::new(&planar(), None, None).unwrap();
        for given_in in [GivenInName::Sensor, GivenInName::Base] {
            let mut config = planar();
            let wrench = &mut config.wrench;
            (wrench.given_in, wrench.sign) = (given_in, GivenSignName::Reaction);
            if given_in == GivenInName::Sensor {
                (wrench.sensor_origin_m, wrench.sensor_rpy_rad) = ([-0.2, 0.0, 0.1], [0.3, -0.2, 0.7]);
            }
            (wrench.bias, wrench.gravity_m_s2) = ([6.0, -9.0, 4.0, 0.5, -0.3, 0.2], [0.0, -9.81, 0.0]);
            (wrench.tool_mass_kg, wrench.tool_center_of_gravity_m) = (3.0, [-0.1, 0.02, 0.0]);
            assert_eq!(is_safe(&config, &approach, 0.2, 0.5).unwrap(), Ok(()), "{given_in:?}");
            let scenario = approach.scenario(&config, 0.2, 0.5);
            assert!(scenario.sensor.is_some_and(|sensor| sensor.tool_mass_kg == 3.0));
        }
        assert_eq!(approach.scenario(&planar(), 0.2, 0.5).sensor, None);
    }

    /// With a range and the tolerance the first impact bounces at this speed, far below the limit.
    #[test]
    fn a_tolerance_of_the_lag_costs_a_bounce_and_no_speed() {
        let mut config = planar();
        config.control.lag_tolerance_s = 0.005;
        let environment = &mut config.environment;
        environment.stiffness_range_n_m = Some([5e4, 2e5]);
        (environment.contact, environment.contact_point_m) = (ContactPointName::Detected, None);
        let approach = Approach::new(&config, Some(&[1.21, -1.47]), None).unwrap();
        let bounces = |instant: f64| {
            let scenario = approach.scenario(&config, 0.14, instant);
            let mut run = VirtualTime::new(cycle::build(&config).unwrap(), VirtualRun::new(&scenario).unwrap());
            let mut losses = 0;
            while let Some(step) = run.step().unwrap() {
                losses = step.truth.contact_losses;
            }
            losses > 0
        };
        let instant =
            (0..8).map(|eighth| f64::from(eighth) / 8.0).find(|instant| bounces(*instant)).expect("one bounces");
        assert_eq!(is_safe(&config, &approach, 0.14, instant).unwrap(), Ok(()));
    }

    #[test]
    fn the_shipped_profile_is_safe_at_the_papers_speed_and_not_at_four_times_it() {
        let (config, approach) = (planar(), Approach::new(&planar(), None, None).unwrap());
        assert_eq!(is_safe(&config, &approach, 0.2, 0.5).unwrap(), Ok(()));
        let why = is_safe(&config, &approach, 1.0, 0.5).unwrap().unwrap_err();
        assert!(matches!(why, Unsafe::Stop(_) | Unsafe::Force { .. }), "{why}");
    }
}
