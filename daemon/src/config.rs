//! The configuration file: every key with its unit and range. `admittancectl validate` checks a file against it.

use admittance_core::under_way::MAX_DELAY_CYCLES;
use admittance_host::config::ConfigError;
use admittance_host::ipc_section::IpcSection;
use admittance_host::realtime::RealtimeSection;
use admittance_host::robot_description::RobotDescription;
use admittance_host::{config_enum, config_section};

mod requests;
mod wrench;

pub use requests::RequestsSection;
pub use wrench::{GivenInName, GivenSignName, WrenchSection};

config_enum! {
    /// Which law computes the offset.
    pub enum LawName {
        /// MPC-based admittance control (18).
        Mpc = "mpc",
        /// Classic admittance control (3), for comparison.
        Damping = "damping",
    }
}

config_enum! {
    /// How the real-time thread waits for the next state sample.
    pub enum Wait {
        /// Blocks until the motion controller notifies: least processor time, slowest to wake.
        Event = "event",
        /// Sleeps until shortly before the next sample is due, then spins.
        Hybrid = "hybrid",
        /// Spins as long as samples come: fastest, and takes a whole processor, which should be isolated (admittancectl doctor).
        Spin = "spin",
    }
}

config_section! {
    /// The cycle.
    pub struct Control {
        /// Which law computes the offset.
        law: LawName = LawName::Mpc;
        /// Time between two state samples, T_s.
        sampling_time_s: f64, unit "s", range 0.0001..=0.1;
        /// The command for a sample acts this long after the sample's stamp; agreed with the motion controller.
        command_delay_s: f64 = 0.0, unit "s", range 0.0..=0.2;
        /// An answer published later than this after the sample's stamp is late; the solver is cut short before.
        answer_budget_s: f64, unit "s", range 0.00001..=0.1;
        /// An older sample is stale, and a silence of this length counts as one.
        max_sample_age_s: f64, unit "s", range 0.0001..=1.0;
        /// How the real-time thread waits for the next sample.
        wait: Wait = Wait::Hybrid;
        /// With wait = "hybrid": how long before and after the instant at which a sample is due the thread spins.
        spin_s: f64 = 0.0003, unit "s", range 0.00001..=0.01;
        /// Cycles in a row that the last plan may stand in for an answer.
        max_consecutive_fallbacks: u32 = 3, unit "cycles", range 0..=20;
        /// Whether the first valid sample without contact starts control.
        start_enabled: bool = true;
        /// Reciprocal condition number of the Jacobian below which the pose counts as singular and stops the arm: in contact at
        /// a low force, for which there must be some way left to the singularity.
        minimum_reciprocal_condition: f64 = 0.05, unit "1", range 1e-6..=0.3;
    }
    cross_check answer_in_time;
}

fn answer_in_time(control: &Control, path: &str, errors: &mut Vec<ConfigError>) {
    if control.answer_budget_s > control.sampling_time_s {
        let accepted = format!("at most {path}.sampling_time_s = {} s", control.sampling_time_s);
        errors.push(ConfigError::new(format!("{path}.answer_budget_s"), control.answer_budget_s, accepted));
    }
    if control.spin_s > control.sampling_time_s / 2.0 {
        let accepted = format!("at most half of {path}.sampling_time_s = {} s", control.sampling_time_s);
        errors.push(ConfigError::new(format!("{path}.spin_s"), control.spin_s, accepted));
    }
    if control.max_sample_age_s < control.sampling_time_s {
        let accepted = format!("at least {path}.sampling_time_s = {} s", control.sampling_time_s);
        errors.push(ConfigError::new(format!("{path}.max_sample_age_s"), control.max_sample_age_s, accepted));
    }
}

config_enum! {
    /// Where the sign of a contact comes from.
    pub enum ContactSignName {
        /// From the surface normal: in contact every admittance axis with a component of it has an upper bound; an axis
        /// without one has none and does not join by itself.
        Normal = "normal",
        /// From f̂ when the axis joins; only axes in contact have bounds (the paper).
        Wrench = "wrench",
    }
}

config_enum! {
    /// When the minimum force holds.
    pub enum LowerBoundName {
        /// Once it has been reached, until the commanded twist points out of the surface.
        OnceReached = "once_reached",
        /// As long as an axis is active (18e): it then can make the problem infeasible, and the arm cannot lift off.
        Always = "always",
    }
}

config_enum! {
    /// What losing the contact, once the minimum force was reached, leads to.
    pub enum OnContactLostName {
        /// Control goes on in free motion.
        Continue = "continue",
        /// Zero joint velocity until a reset.
        Stop = "stop",
    }
}

config_section! {
    /// Contact and force, one value per task axis: N on x y z, N·m on rx ry rz.
    pub struct ContactSection {
        /// Axes that admittance control may take over.
        admittance_axes: Vec<bool>, length 2..=6;
        /// |f̂| above which an axis joins, β.
        activation_threshold: Vec<f64>, unit "N, N m", range 0.001..=1e4, length 2..=6;
        /// |f̂| below which an active axis leaves; at most the activation threshold, which the paper uses for both.
        release_threshold: Vec<f64>, unit "N, N m", range 0.0..=1e4, length 2..=6;
        /// Largest |f| on an active axis, f_max.
        force_limit: Vec<f64>, unit "N, N m", range 0.01..=1e5, length 2..=6;
        /// Smallest |f| on an active axis, f_min: contact must not be lost.
        minimum_force: Vec<f64>, unit "N, N m", range 0.0..=1e4, length 2..=6;
        /// Time constant of the wrench estimate T_est (6); 0 for a sensor without lag.
        wrench_time_constant_s: Vec<f64>, unit "s", range 0.0..=0.5, length 2..=6;
        /// Force along the inward normal that the cost aims at: f_ref of the set point.
        normal_force_reference_n: f64 = 0.0, unit "N", range 0.0..=1e5;
        /// Where the sign of a contact comes from.
        sign: ContactSignName = ContactSignName::Normal;
        /// When the minimum force holds.
        lower_bound: LowerBoundName = LowerBoundName::OnceReached;
        /// What losing the contact, once the minimum force was reached, leads to.
        on_contact_lost: OnContactLostName = OnContactLostName::Continue;
        /// Part of the force limit by which a plan may exceed it before that is infeasible: for what a linear model leaves out.
        limit_tolerance: f64 = 0.0025, unit "1", range 0.0..=0.1;
    }
    cross_check ordered_thresholds;
}

fn ordered_thresholds(contact: &ContactSection, path: &str, errors: &mut Vec<ConfigError>) {
    let mut pairwise = |low: (&str, &[f64]), high: (&str, &[f64]), strictly: bool| {
        for (axis, (a, b)) in low.1.iter().zip(high.1).enumerate() {
            if a > b || strictly && a >= b {
                let word = if strictly { "below" } else { "at most" };
                let accepted = format!("{word} {path}.{}[{axis}] = {b}", high.0);
                errors.push(ConfigError::new(format!("{path}.{}[{axis}]", low.0), a, accepted));
            }
        }
    };
    let activation = ("activation_threshold", contact.activation_threshold.as_slice());
    let limit = ("force_limit", contact.force_limit.as_slice());
    pairwise(("release_threshold", &contact.release_threshold), activation, false);
    pairwise(activation, limit, true);
    pairwise(("minimum_force", &contact.minimum_force), limit, true);
}

config_enum! {
    /// Where the contact point comes from.
    pub enum ContactPointName {
        /// contact_point_m.
        Configured = "configured",
        /// The first samples in contact say how deep the surface is along its normal.
        Detected = "detected",
    }
}

config_section! {
    /// The surface: a stiff plane, base frame.
    pub struct EnvironmentSection {
        /// Stiffness along the normal, k_env of (19).
        normal_stiffness_n_m: f64, unit "N/m", range 100.0..=1e8;
        /// Outward normal, out of the material; any length above zero. (21): [sin(angle), cos(angle), 0].
        surface_normal: [f64; 3], unit "1", range -1.0..=1.0;
        /// Where the contact point comes from.
        contact: ContactPointName = ContactPointName::Configured;
        /// Position of the TCP at first contact; not used with contact = "detected".
        contact_point_m: Option<[f64; 3]>, unit "m", range -100.0..=100.0;
        /// Standard deviation of the wrench estimate on one axis; with contact = "detected" the margin of the verdict is
        /// reduced by what two of them make of the contact point.
        wrench_noise_n: f64 = 0.0, unit "N", range 0.0..=100.0;
        /// Orientation of the TCP at first contact: fixed-axis roll, pitch, yaw.
        contact_rpy_rad: [f64; 3] = [0.0, 0.0, 0.0], unit "rad", range -7.0..=7.0;
    }
    cross_check known_contact_point;
}

fn known_contact_point(environment: &EnvironmentSection, path: &str, errors: &mut Vec<ConfigError>) {
    if environment.contact == ContactPointName::Configured && environment.contact_point_m.is_none() {
        let accepted = format!("three coordinates, or {path}.contact = \"detected\"");
        errors.push(ConfigError::new(format!("{path}.contact_point_m"), "absent", accepted));
    }
}

config_enum! {
    /// How the continuous model becomes a step.
    pub enum DiscretizationName {
        /// Exact under a constant joint velocity reference.
        Zoh = "zoh",
        /// First-order Euler (17).
        Euler = "euler",
    }
}

config_enum! {
    /// Where the force is bounded.
    pub enum ForcePointsName {
        /// Within steps as well, where the force may peak between their ends.
        Dense = "dense",
        /// At the end of every step that an input reaches.
        StepEnds = "step_ends",
    }
}

config_enum! {
    /// Which axes get an input once any axis is in contact.
    pub enum InputsName {
        /// The axes in contact (III.C).
        Active = "active",
        /// Every admittance axis.
        All = "all",
    }
}

config_enum! {
    /// The space of the weights on position and velocity.
    pub enum WeightSpace {
        /// One weight per joint, as (23a).
        Joint = "joint",
        /// One weight per task axis.
        Task = "task",
    }
}

config_enum! {
    /// What an infeasible verdict leads to; both stay until a reset.
    pub enum OnInfeasibleName {
        /// Zero joint velocity at once (III.C).
        Halt = "halt",
        /// The lowest force that can still be reached, then zero joint velocity.
        MinimumForce = "minimum_force",
    }
}

config_enum! {
    /// Who solves the QP of a cycle.
    pub enum SolverName {
        /// The structured dual active-set method.
        ActiveSet = "active_set",
        /// Clarabel, a general interior-point method: the reference, many times slower.
        Clarabel = "clarabel",
    }
}

config_section! {
    /// The MPC (18). A minimum-force stop uses its model and horizon under every law.
    pub struct MpcSection {
        /// How the continuous model becomes a step.
        discretization: DiscretizationName = DiscretizationName::Zoh;
        /// Number of steps H of one sampling time each; not together with step_lengths_s. Without either, at most 16 steps span
        /// three of the slowest joint's time constants: the first four of one sampling time, the others growing.
        horizon: Option<u32>, unit "steps", range 2..=32;
        /// Length of each step, the first equal to the sampling time; not together with horizon.
        step_lengths_s: Option<Vec<f64>>, unit "s", range 0.0001..=0.1, length 2..=32;
        /// Where the force is bounded.
        force_points: ForcePointsName = ForcePointsName::Dense;
        /// Whether commands that are given but do not act yet (control.command_delay_s) are part of the model.
        model_delay: bool = true;
        /// Which axes get an input.
        inputs: InputsName = InputsName::All;
        /// Whether position_weight and velocity_weight are per joint or per task axis.
        weights: WeightSpace = WeightSpace::Task;
        /// Weight of position errors, per joint (1/rad²) or task axis (1/m², 1/rad²).
        position_weight: Vec<f64>, unit "1/rad^2, 1/m^2", range 0.0..=1e9, length 2..=8;
        /// Weight of velocity errors, per joint (s²/rad²) or task axis (s²/m², s²/rad²).
        velocity_weight: Vec<f64>, unit "s^2/rad^2, s^2/m^2", range 0.0..=1e9, length 2..=8;
        /// Weight of the wrench estimate, per task axis.
        wrench_weight: Vec<f64>, unit "1/N^2, 1/(N m)^2", range 0.0..=1e6, length 2..=6;
        /// Weight R of the offset, per task axis.
        input_weight: Vec<f64>, unit "s^2/m^2, s^2/rad^2", range 1e-6..=1e9, length 2..=6;
        /// What an infeasible verdict leads to.
        on_infeasible: OnInfeasibleName = OnInfeasibleName::MinimumForce;
        /// Who solves the QP.
        solver: SolverName = SolverName::ActiveSet;
        /// Relative tolerance of Clarabel. Under either solver a solution is used if its residual is at most 1000 times this.
        solver_tolerance: f64 = 1e-8, unit "1", range 1e-12..=1e-4;
        /// Iteration limit of the solver. The active-set method takes one for every bound that begins or ceases to hold.
        max_iterations: u32 = 300, unit "iterations", range 5..=2000;
    }
    cross_check one_kind_of_horizon;
}

fn one_kind_of_horizon(mpc: &MpcSection, path: &str, errors: &mut Vec<ConfigError>) {
    if mpc.horizon.is_some() && mpc.step_lengths_s.is_some() {
        let accepted = format!("{path}.horizon or {path}.step_lengths_s, or neither");
        errors.push(ConfigError::new(format!("{path}.horizon"), "given together with step_lengths_s", accepted));
    }
}

config_section! {
    /// The damping law (3).
    pub struct DampingSection {
        /// Diagonal of D, per task axis.
        damping_n_s_m: Vec<f64>, unit "N s/m, N m s/rad", range 0.1..=1e7, length 2..=6;
    }
}

config_section! {
    /// Limits of joints and offset. The MPC and the minimum-force stop know them as constraints; of what is not optimised the
    /// offset is cut.
    pub struct LimitsSection {
        /// Largest |Δṗ| per task axis.
        velocity_offset: Vec<f64>, unit "m/s, rad/s", range 0.001..=20.0, length 2..=6;
        /// Largest speed reference of each joint, J⁻¹ (ṗ0 + Δṗ).
        joint_speed_rad_s: Option<Vec<f64>>, unit "rad/s", range 0.01..=100.0, length 2..=8;
        /// Smallest position of each joint; together with joint_position_max_rad.
        joint_position_min_rad: Option<Vec<f64>>, unit "rad", range -100.0..=100.0, length 2..=8;
        /// Largest position of each joint.
        joint_position_max_rad: Option<Vec<f64>>, unit "rad", range -100.0..=100.0, length 2..=8;
        /// Largest rate of Δṗ per task axis toward the surface, and either way on an axis that does not feel it.
        inward_rate_m_s2: Option<Vec<f64>>, unit "m/s^2, rad/s^2", range 0.01..=1e5, length 2..=6;
        /// Largest rate of Δṗ per task axis out of the surface; unlimited when absent.
        outward_rate_m_s2: Option<Vec<f64>>, unit "m/s^2, rad/s^2", range 0.01..=1e5, length 2..=6;
        /// Rate at which the offset of a released axis returns to zero.
        release_rate_m_s2: f64 = 10.0, unit "m/s^2, rad/s^2", range 0.01..=1000.0;
    }
}

config_section! {
    /// How a stop goes.
    pub struct StoppingSection {
        /// Speed of the open-loop retreat, and the most that a stopped arm may move away with.
        retreat_speed_m_s: f64 = 0.05, unit "m/s", range 0.001..=1.0;
        /// Longest open-loop retreat.
        retreat_time_s: f64 = 0.1, unit "s", range 0.0..=2.0;
        /// Pressing force below which a stop may come to rest; half the smallest force limit of x y z when absent.
        stop_force_n: Option<f64>, unit "N", range 0.1..=1e5;
        /// Longest minimum-force stop; then the arm is held whatever the force is.
        stop_timeout_s: f64 = 1.0, unit "s", range 0.01..=10.0;
        /// A measured force this far above its limit stops, whatever the model says; no such guard when absent.
        force_guard_n: Option<f64>, unit "N, N m", range 0.0..=1e5;
        /// A measured pressing force this far from the one that the model expects at the measured pose stops; no such guard when
        /// absent. An error of 1 mm in the contact point is 100 N at 1e5 N/m.
        mismatch_n: Option<f64>, unit "N", range 0.1..=1e5;
        /// For so many cycles in a row.
        mismatch_cycles: u32 = 3, unit "cycles", range 1..=1000;
    }
}

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

fn sizes_and_laws(config: &Config, _: &str, errors: &mut Vec<ConfigError>) {
    let axes = config.robot.task_axes as usize;
    let joints = config.robot.joint.len();
    let weighted = match config.mpc.weights {
        WeightSpace::Joint => (joints, "one for each joint"),
        WeightSpace::Task => (axes, "one for each task axis"),
    };
    let per_axis = (axes, "one for each task axis");
    let damping = config.damping.as_ref().map_or(axes, |damping| damping.damping_n_s_m.len());
    let lengths = [
        ("contact.admittance_axes", config.contact.admittance_axes.len(), per_axis),
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
    let in_task: f64 = normal.iter().take(axes.min(3)).map(|n| n * n).sum();
    if in_task < 1e-6 {
        errors.push(ConfigError::new(
            "environment.surface_normal",
            format!("{normal:?}"),
            "a vector with a component on the task axes",
        ));
    }
    let delayed = config.control.command_delay_s;
    if config.mpc.model_delay && delayed > MAX_DELAY_CYCLES * sampling_time {
        let accepted =
            format!("at most {MAX_DELAY_CYCLES} control.sampling_time_s = {sampling_time} s with mpc.model_delay");
        errors.push(ConfigError::new("control.command_delay_s", delayed, accepted));
    }
    joint_positions(limits, errors);
    // What the deadband hides must be released already: hysteresis and limits see the whole force.
    let releases = config.wrench.deadband.iter().flatten().zip(&config.contact.release_threshold);
    for (axis, (deadband, release)) in releases.enumerate().filter(|(_, (deadband, release))| deadband > release) {
        let accepted = format!("at most contact.release_threshold[{axis}] = {release}");
        errors.push(ConfigError::new(format!("wrench.deadband[{axis}]"), deadband, accepted));
    }
    // A limit below the threshold of activation would be passed before the law begins.
    if !config.contact.admittance_axes.contains(&true) {
        errors.push(ConfigError::new("contact.admittance_axes", "all false", "at least one true"));
    }
}

fn joint_positions(limits: &LimitsSection, errors: &mut Vec<ConfigError>) {
    match (&limits.joint_position_min_rad, &limits.joint_position_max_rad) {
        (Some(min), Some(max)) => {
            for (joint, (min, max)) in min.iter().zip(max).enumerate().filter(|(_, (min, max))| min >= max) {
                let accepted = format!("below limits.joint_position_max_rad[{joint}] = {max}");
                errors.push(ConfigError::new(format!("limits.joint_position_min_rad[{joint}]"), min, accepted));
            }
        }
        (None, None) => {}
        (min, _) => {
            let absent = if min.is_some() { "max" } else { "min" };
            let accepted = "both joint_position_min_rad and joint_position_max_rad, or neither";
            errors.push(ConfigError::new(format!("limits.joint_position_{absent}_rad"), "absent", accepted));
        }
    }
}
