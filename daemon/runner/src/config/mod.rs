//! The configuration file: every key with its unit and range. `admittancectl validate` checks a
//! file against it.

use admittance_core::output::MAX_DELAY_CYCLES;
use admittance_core::quantities::Span;
use admittance_host::config::ConfigError;
use admittance_host::ipc_section::IpcSection;
use admittance_host::realtime::RealtimeSection;
use admittance_host::robot_description::{RobotDescription, VelocityLoopDescription};
use admittance_host::{config_file, config_section};

use crate::task_frame::TaskFrame;

mod contact;
mod control;
mod dynamics;
mod environment;
mod law;
mod limits;
mod motor_torque;
mod mpc;
mod plausibility;
mod redundancy;
mod requests;
mod stopping;
mod task;
mod unknown_surface;
mod warnings;
mod wrench;

pub use contact::{ContactSection, ContactSignName, LowerBoundName, OnContactLostName};
pub use control::{Control, LawName, Wait};
pub use dynamics::{DynamicsSection, JointDynamics};
pub use environment::{ContactPointName, EnvironmentSection};
pub use limits::LimitsSection;
pub use mpc::{
    DiscretizationName, ForcePointsName, InputsName, InwardSpeedName, MpcSection, OnInfeasibleName, WeightSpace,
};
pub use plausibility::{contact_distance_m, has_regular_pose, reach_m};
pub use redundancy::{RedundancySection, ResolutionName};
pub use requests::RequestsSection;
pub use stopping::{DampingSection, StoppingSection};
pub use task::{FrameName, TaskSection};
pub use wrench::{GivenInName, GivenSignName, WrenchSection, WrenchSourceName};

config_section! {
    /// The whole file.
    pub struct Config {
        /// Where the daemon meets its motion controller.
        ipc: IpcSection;
        /// The arm.
        robot: RobotDescription;
        /// The cycle.
        control: Control;
        /// How the state sample's wrench is given.
        wrench: WrenchSection;
        /// Masses, friction and gears of the arm; required with wrench.source = "motor_torque".
        dynamics: Option<DynamicsSection>;
        /// The frame of the task.
        task: TaskSection;
        /// Which joint velocity is taken for a twist.
        redundancy: RedundancySection;
        /// Contact and force.
        contact: ContactSection;
        /// The surface.
        environment: EnvironmentSection;
        /// The MPC.
        mpc: MpcSection;
        /// The damping law; required with law = "damping".
        damping: Option<DampingSection>;
        /// Bounds of the offset.
        limits: LimitsSection;
        /// How a stop goes.
        stopping: StoppingSection;
        /// What requests may change.
        requests: RequestsSection;
        /// How the real-time thread runs.
        realtime: RealtimeSection;
    }
    cross_check sizes_and_laws;
}

config_file!(Config, completed Config::with_named_axes);

fn sizes_and_laws(config: &Config, _: &str, errors: &mut Vec<ConfigError>) {
    let axes = config.robot.task_axes as usize;
    let joints = config.robot.joint.len();
    let weighted = match config.mpc.weights {
        WeightSpace::Joint => (joints, "one for each joint"),
        WeightSpace::Task => (axes, "one for each task axis"),
    };
    let per_axis = (axes, "one for each task axis");
    // Where there is none, more is said about it below.
    let gives_way = Some(config.contact.admittance_axes.len()).filter(|found| *found > 0).unwrap_or(axes);
    let damping = config.damping.as_ref().map_or(axes, |damping| damping.damping_n_s_m.len());
    let lengths = [
        ("contact.admittance_axes", gives_way, per_axis),
        ("contact.activation_threshold", config.contact.activation_threshold.len(), per_axis),
        ("contact.release_threshold", config.contact.release_threshold.len(), per_axis),
        ("contact.force_limit", config.contact.force_limit.len(), per_axis),
        ("contact.minimum_force", config.contact.minimum_force.len(), per_axis),
        ("contact.wrench_time_constant_s", config.contact.wrench_time_constant_s.len(), per_axis),
        ("mpc.position_weight", config.mpc.position_weight.len(), weighted),
        ("mpc.velocity_weight", config.mpc.velocity_weight.len(), weighted),
        ("mpc.wrench_weight", config.mpc.wrench_weight.len(), per_axis),
        ("mpc.input_weight", config.mpc.input_weight.len(), per_axis),
        ("limits.velocity_offset", config.limits.velocity_offset.len(), per_axis),
        ("damping.damping_n_s_m", damping, per_axis),
    ];
    let limits = &config.limits;
    let per_joint = (joints, "one for each joint");
    let optional = [
        ("limits.joint_speed_rad_s", &limits.joint_speed_rad_s, per_joint),
        ("limits.joint_acceleration_rad_s2", &limits.joint_acceleration_rad_s2, per_joint),
        ("limits.joint_jerk_rad_s3", &limits.joint_jerk_rad_s3, per_joint),
        ("limits.joint_position_min_rad", &limits.joint_position_min_rad, per_joint),
        ("limits.joint_position_max_rad", &limits.joint_position_max_rad, per_joint),
        ("limits.inward_rate_m_s2", &limits.inward_rate_m_s2, per_axis),
        ("limits.outward_rate_m_s2", &limits.outward_rate_m_s2, per_axis),
        ("wrench.deadband", &config.wrench.deadband, per_axis),
        ("requests.force_limit_min", &config.requests.force_limit_min, per_axis),
        ("requests.force_limit_max", &config.requests.force_limit_max, per_axis),
    ];
    let optional = optional.into_iter().filter_map(|(key, list, which)| Some((key, list.as_ref()?.len(), which)));
    for (key, found, (accepted, which)) in lengths.into_iter().chain(optional) {
        if found != accepted {
            errors.push(ConfigError::new(key, format!("{found} values"), format!("{accepted} values, {which}")));
        }
    }
    if config.control.law == LawName::Damping && config.damping.is_none() {
        errors.push(ConfigError::new("damping", "absent", "a [damping] section, since control.law = \"damping\""));
    }
    let sampling_time = config.control.sampling_time_s;
    if let Some(first) = config.mpc.step_lengths_s.as_ref().and_then(|steps| steps.first())
        && *first != sampling_time
    {
        errors.push(ConfigError::new(
            "mpc.step_lengths_s[0]",
            first,
            format!("control.sampling_time_s = {sampling_time}"),
        ));
    }
    let normal = config.environment.surface_normal;
    let seen = TaskFrame::of(config).vector(normal.into());
    let in_task: f64 = config.robot.linear_axes().map(|axis| seen[axis] * seen[axis]).sum();
    if in_task < 1e-6 {
        errors.push(ConfigError::new(
            "environment.surface_normal",
            format!("{normal:?}"),
            "a vector with a component on the controlled axes",
        ));
    }
    let delayed = config.control.command_delay_s;
    if config.mpc.model_delay && delayed > MAX_DELAY_CYCLES * sampling_time {
        let accepted =
            format!("at most {MAX_DELAY_CYCLES} control.sampling_time_s = {sampling_time} s with mpc.model_delay");
        errors.push(ConfigError::new("control.command_delay_s", delayed, accepted));
    }
    let tolerance = config.environment.normal_tolerance_rad;
    if tolerance > 0.0 && axes > 2 && config.robot.linear_axes().count() < 3 {
        let accepted = "0 with a robot.controlled_axes that lacks x, y or z: the normal is learned in space";
        errors.push(ConfigError::new("environment.normal_tolerance_rad", tolerance, accepted));
    }
    plausibility::check_arm(config, errors);
    check_velocity_loop(config, errors);
    check_wrench_dead_time(config, errors);
    dynamics::check_joints(config, errors);
    motor_torque::check_motor_torque(config, errors);
    task::check_task_frame(config, errors);
    redundancy::check_redundancy(config, errors);
    // What the deadband hides must be released already: hysteresis and limits see the whole force.
    let releases = config.wrench.deadband.iter().flatten().zip(&config.contact.release_threshold);
    for (axis, (deadband, release)) in releases.enumerate().filter(|(_, (deadband, release))| deadband > release) {
        let accepted = format!("at most contact.release_threshold[{axis}] = {release}");
        errors.push(ConfigError::new(format!("wrench.deadband[{axis}]"), deadband, accepted));
    }
    task::check_gives_way(config, errors);
    law::check_law(config, errors);
}

/// What the belief can have of a wrench that comes late.
fn check_wrench_dead_time(config: &Config, errors: &mut Vec<ConfigError>) {
    let (found, sampling_time) = (config.contact.wrench_dead_time_s, config.control.sampling_time_s);
    let mut wants = |accepted: String| errors.push(ConfigError::new("contact.wrench_dead_time_s", found, accepted));
    if Span::from_seconds(found) > Span::from_seconds(MAX_DELAY_CYCLES * sampling_time) {
        wants(format!("at most {MAX_DELAY_CYCLES} control.sampling_time_s = {sampling_time} s"));
    }
    if found > 0.0 && config.environment.contact == ContactPointName::Detected {
        wants("0 with environment.contact = \"detected\"".to_owned());
    }
    if found > 0.0 && config.environment.unknown_stiffness().is_some() {
        wants("0 with environment.stiffness_range_n_m".to_owned());
    }
    if found > 0.0 && config.wrench.tool_mass_kg > 0.0 {
        wants(format!(
            "0 with wrench.tool_mass_kg = {}: the tool's inertia comes late, too",
            config.wrench.tool_mass_kg
        ));
    }
    let mpc = &config.mpc;
    if found > 0.0 && (mpc.discretization == DiscretizationName::Euler || !mpc.model_delay) {
        wants("0, or mpc.discretization = \"zoh\" and mpc.model_delay = true".to_owned());
    }
}

/// An input that nobody chose lasts at least so long, in s, and a cycle has no more of them.
const DEFAULT_INPUT_S: f64 = 0.001;
const MOST_DEFAULT_INPUTS: u64 = 4;

impl Config {
    /// Into how many inputs the first step is divided where the motion controller plays them.
    pub fn inputs_per_cycle(&self) -> u32 {
        let (mpc, sampling_time) = (&self.mpc, self.control.sampling_time_s);
        mpc.inputs_per_cycle.unwrap_or_else(|| {
            // Who says what the steps are means those.
            if mpc.horizon.is_some() || mpc.step_lengths_s.is_some() {
                return 1;
            }
            let [least, most] = self.robot.velocity_loop.as_ref().map_or([0.0; 2], dead_times);
            let spread = Span::from_seconds((most - least).max(0.0));
            let [cycle, input] = [sampling_time, DEFAULT_INPUT_S].map(|t| Span::from_seconds(t).nanoseconds());
            let wanted = (cycle / input).clamp(1, MOST_DEFAULT_INPUTS) as u32;
            let suits = |inputs: &u32| spread <= Span::from_seconds(sampling_time / f64::from(*inputs));
            (1..=wanted).rev().find(suits).unwrap_or(1)
        })
    }
}

/// The shortest and the longest dead time of the speed loops, s; the shortest is infinite where none is told.
fn dead_times(velocity_loop: &VelocityLoopDescription) -> [f64; 2] {
    let each = velocity_loop.dead_time_s.iter().flatten().copied();
    each.fold([f64::INFINITY, 0.0], |[least, most], t| [t.min(least), t.max(most)])
}

/// What the model can have of the speed loops.
fn check_velocity_loop(config: &Config, errors: &mut Vec<ConfigError>) {
    let (Some(velocity_loop), mpc) = (&config.robot.velocity_loop, &config.mpc) else { return };
    let key = |name: &str| format!("robot.velocity_loop.{name}");
    let is_beyond = |values: &Option<Vec<f64>>| values.iter().flatten().any(|value| *value > 0.0);
    let beyond = [
        ("damping", is_beyond(&velocity_loop.damping)),
        ("dead_time_s", is_beyond(&velocity_loop.dead_time_s)),
        ("report_lag_s", velocity_loop.report_lag_s > 0.0),
    ];
    if let Some((name, _)) = beyond.into_iter().find(|(_, is_beyond)| *is_beyond) {
        let mut wants = |what: &str| {
            errors.push(ConfigError::new(key(name), "above 0", format!("0 throughout, or {what}")));
        };
        if mpc.discretization == DiscretizationName::Euler {
            wants("mpc.discretization = \"zoh\": Euler's model has loops of first order alone");
        } else if !mpc.model_delay {
            wants("mpc.model_delay = true: without it the model knows of no delay");
        }
    }
    let [least, most] = dead_times(velocity_loop);
    let sampling_time = config.control.sampling_time_s;
    let inputs = f64::from(config.inputs_per_cycle());
    let shortest = mpc.step_lengths_s.iter().flatten().copied().fold(sampling_time / inputs, f64::min);
    if Span::from_seconds(most - least) > Span::from_seconds(shortest) {
        let accepted = format!("values at most {shortest} s apart, the shortest step of the prediction");
        errors.push(ConfigError::new(key("dead_time_s"), format!("{least} to {most}"), accepted));
    }
    let left = MAX_DELAY_CYCLES * sampling_time - config.control.command_delay_s;
    if Span::from_seconds(most) > Span::from_seconds(left) {
        let accepted = format!(
            "at most {left} s: with control.command_delay_s {MAX_DELAY_CYCLES} control.sampling_time_s = {sampling_time} s"
        );
        errors.push(ConfigError::new(key("dead_time_s"), most, accepted));
    }
}
