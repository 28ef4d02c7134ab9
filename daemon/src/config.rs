//! The configuration file: every key with its unit and range. `admittancectl validate` checks a file against it.

use admittance_host::config::ConfigError;
use admittance_host::ipc_section::IpcSection;
use admittance_host::realtime::RealtimeSection;
use admittance_host::robot_description::RobotDescription;
use admittance_host::{config_enum, config_section};

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
        /// Blocks until shortly before the next sample is due, then spins.
        Hybrid = "hybrid",
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
        /// Reciprocal condition number of the Jacobian below which the pose counts as singular.
        minimum_reciprocal_condition: f64 = 0.01, unit "1", range 1e-6..=0.3;
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

config_section! {
    /// The surface: a stiff plane, base frame.
    pub struct EnvironmentSection {
        /// Stiffness along the normal, k_env of (19).
        normal_stiffness_n_m: f64, unit "N/m", range 100.0..=1e8;
        /// Outward normal, out of the material; any length above zero. (21): [sin(angle), cos(angle), 0].
        surface_normal: [f64; 3], unit "1", range -1.0..=1.0;
        /// Position of the TCP at first contact.
        contact_point_m: [f64; 3], unit "m", range -100.0..=100.0;
        /// Orientation of the TCP at first contact: fixed-axis roll, pitch, yaw.
        contact_rpy_rad: [f64; 3] = [0.0, 0.0, 0.0], unit "rad", range -7.0..=7.0;
    }
}

config_enum! {
    /// How the continuous model becomes a step.
    pub enum DiscretizationName {
        /// First-order Euler (17).
        Euler = "euler",
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
        discretization: DiscretizationName = DiscretizationName::Euler;
        /// Number of steps H of one sampling time each; not together with step_lengths_s.
        horizon: Option<u32>, unit "steps", range 2..=32;
        /// Length of each step, the first equal to the sampling time; not together with horizon.
        step_lengths_s: Option<Vec<f64>>, unit "s", range 0.0001..=0.1, length 2..=32;
        /// Which axes get an input.
        inputs: InputsName = InputsName::Active;
        /// Whether position_weight and velocity_weight are per joint or per task axis.
        weights: WeightSpace = WeightSpace::Joint;
        /// Weight of position errors, per joint (1/rad²) or task axis (1/m², 1/rad²).
        position_weight: Vec<f64>, unit "1/rad^2, 1/m^2", range 0.0..=1e9, length 2..=8;
        /// Weight of velocity errors, per joint (s²/rad²) or task axis (s²/m², s²/rad²).
        velocity_weight: Vec<f64>, unit "s^2/rad^2, s^2/m^2", range 0.0..=1e9, length 2..=8;
        /// Weight of the wrench estimate, per task axis.
        wrench_weight: Vec<f64>, unit "1/N^2, 1/(N m)^2", range 0.0..=1e6, length 2..=6;
        /// Weight R of the offset, per task axis.
        input_weight: Vec<f64>, unit "s^2/m^2, s^2/rad^2", range 1e-6..=1e9, length 2..=6;
        /// What an infeasible verdict leads to.
        on_infeasible: OnInfeasibleName = OnInfeasibleName::Halt;
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
    if mpc.horizon.is_some() == mpc.step_lengths_s.is_some() {
        let found = if mpc.horizon.is_some() { "given together with step_lengths_s" } else { "absent" };
        errors.push(ConfigError::new(
            format!("{path}.horizon"),
            found,
            format!("either {path}.horizon or {path}.step_lengths_s"),
        ));
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
    /// Bounds of the offset under every law.
    pub struct LimitsSection {
        /// Largest |Δṗ| per task axis.
        velocity_offset: Vec<f64>, unit "m/s, rad/s", range 0.001..=20.0, length 2..=6;
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
    for (key, found, (accepted, which)) in lengths {
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
    // A limit below the threshold of activation would be passed before the law begins.
    if !config.contact.admittance_axes.contains(&true) {
        errors.push(ConfigError::new("contact.admittance_axes", "all false", "at least one true"));
    }
}
