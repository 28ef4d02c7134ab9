//! `[mpc]`: horizon, cost and bounds of the prediction.

use admittance_core::mpc::GROWING_STEPS;
use admittance_core::output::MAX_STEPS;
use admittance_host::config::ConfigError;
use admittance_host::{config_enum, config_section};

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
    /// How fast the arm may be commanded into the surface while it is in contact. In a
    /// minimum-force stop it never is.
    pub enum InwardSpeedName {
        /// At most as fast as the commanded twist has moved in during this contact, or 0.01 m/s.
        Approach = "approach",
        /// As fast as the other limits allow: the model is trusted to stop it in time.
        Free = "free",
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

config_section! {
    /// The MPC (18). A minimum-force stop uses its model and horizon under every law.
    pub struct MpcSection {
        /// How the continuous model becomes a step.
        discretization: DiscretizationName = DiscretizationName::Zoh;
        /// Number of steps H of one sampling time each; not together with step_lengths_s. Without
        /// either, at most 16 steps span three of the slowest joint's time constants: the first
        /// four of one sampling time, the others growing.
        horizon: Option<u32>, unit "steps", range 2..=32;
        /// Length of each step, the first equal to the sampling time; not together with horizon.
        step_lengths_s: Option<Vec<f64>>, unit "s", range 0.0001..=0.1, length 2..=32;
        /// Into how many equal parts the first step is divided, each with an input of its own: with
        /// a slow cycle the arm may so approach faster. The motion controller has to play the plan
        /// within its cycle, and says so in its samples (`plays_plan`); else there is one input.
        /// When absent: as many as last 1 ms or more, four at most; one where horizon or
        /// step_lengths_s says what the steps are.
        inputs_per_cycle: Option<u32>, unit "inputs", range 1..=8;
        /// Where the force is bounded.
        force_points: ForcePointsName = ForcePointsName::Dense;
        /// Whether commands that are given but do not act yet (control.command_delay_s) are part of
        /// the model.
        model_delay: bool = true;
        /// Which axes get an input.
        inputs: InputsName = InputsName::All;
        /// How fast the arm may be commanded into the surface. When absent: "approach", but "free"
        /// with contact.lower_bound = "always", as in the paper.
        inward_speed: Option<InwardSpeedName>;
        /// Whether position_weight and velocity_weight are per joint or per task axis.
        weights: WeightSpace = WeightSpace::Task;
        /// Weight of position errors, per joint (1/rad²; 1/m² of a prismatic one) or task axis (1/m², 1/rad²).
        position_weight: Vec<f64>, unit "1/rad^2, 1/m^2", range 0.0..=1e9, length 2..=8;
        /// Weight of velocity errors, per joint (s²/rad², or s²/m²) or task axis (s²/m², s²/rad²).
        velocity_weight: Vec<f64>, unit "s^2/rad^2, s^2/m^2", range 0.0..=1e9, length 2..=8;
        /// Weight of the wrench estimate, per task axis.
        wrench_weight: Vec<f64>, unit "1/N^2, 1/(N m)^2", range 0.0..=1e6, length 2..=6, each "axis";
        /// Weight R of the offset, per task axis.
        input_weight: Vec<f64>, unit "s^2/m^2, s^2/rad^2", range 1e-6..=1e9, length 2..=6, each "axis";
        /// What an infeasible verdict leads to.
        on_infeasible: OnInfeasibleName = OnInfeasibleName::MinimumForce;
        /// A solution is accepted if its relative KKT residual is at most 1000 times this.
        solver_tolerance: f64 = 1e-8, unit "1", range 1e-12..=1e-4;
        /// Iteration limit of the solver. The active-set method takes one for every bound that
        /// begins or ceases to hold.
        max_iterations: u32 = 300, unit "iterations", range 5..=2000;
        removed solver "there is one solver, the active-set method; Clarabel judges it in admittance-lab";
    }
    cross_check check_horizon;
}

fn check_horizon(mpc: &MpcSection, path: &str, errors: &mut Vec<ConfigError>) {
    if mpc.horizon.is_some() && mpc.step_lengths_s.is_some() {
        let accepted = format!("{path}.horizon or {path}.step_lengths_s, or neither");
        errors.push(ConfigError::new(format!("{path}.horizon"), "given together with step_lengths_s", accepted));
    }
    let longest = GROWING_STEPS as u32;
    let steps = mpc.step_lengths_s.as_ref().map_or(mpc.horizon.unwrap_or(longest), |steps| steps.len() as u32);
    let most = (MAX_STEPS as u32 + 1).saturating_sub(steps);
    if let Some(inputs) = mpc.inputs_per_cycle.filter(|inputs| *inputs > most) {
        let accepted = format!("at most {most}: a horizon of {steps} steps may have {MAX_STEPS} with those");
        errors.push(ConfigError::new(format!("{path}.inputs_per_cycle"), inputs, accepted));
    }
}
