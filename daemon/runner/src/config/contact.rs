//! `[contact]`: which axes, which forces.

use admittance_host::config::ConfigError;
use admittance_host::{config_enum, config_section};

config_enum! {
    /// Where the sign of a contact comes from.
    pub enum ContactSignName {
        /// From the surface normal: in contact every admittance axis with a component of it has an
        /// upper bound; an axis without one has none and does not join by itself.
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
        /// As long as an axis is active (18e): it then can make the problem infeasible, and the arm
        /// cannot lift off.
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
        /// Axes that admittance control may take over. Required, unless task.axes names them.
        admittance_axes: Vec<bool> = Vec::new(), length 0..=6, each "axis";
        /// |f̂| above which an axis joins, β. With environment.stiffness_range_n_m a contact begins at 0.8 β already,
        /// once the samples show a surface.
        activation_threshold: Vec<f64>, unit "N, N m", range 0.001..=1e4, length 2..=6, each "axis";
        /// |f̂| below which an active axis leaves; at most the activation threshold, which the
        /// paper uses for both.
        release_threshold: Vec<f64>, unit "N, N m", range 0.0..=1e4, length 2..=6, each "axis";
        /// Largest |f| on an active axis, f_max.
        force_limit: Vec<f64>, unit "N, N m", range 0.01..=1e5, length 2..=6, each "axis";
        /// Smallest |f| on an active axis, f_min: contact must not be lost.
        minimum_force: Vec<f64>, unit "N, N m", range 0.0..=1e4, length 2..=6, each "axis";
        /// Time constant of the wrench estimate T_est (6); 0 for a sensor without lag.
        wrench_time_constant_s: Vec<f64>, unit "s", range 0.0..=0.5, length 2..=6, each "axis";
        /// By what share of wrench_time_constant_s its lag may be longer than that. A verdict is feasible only
        /// where the force would be kept if f̂ hid so much more of what it does not show yet; else it is AtRisk.
        /// Of the inertia of wrench.tool_mass_kg f̂ may show as much for a force: touch and guards allow for that.
        /// Of a surface of which a range is told, the force comes down more slowly after a touch, the more f̂ still shows.
        wrench_lag_tolerance: f64 = 0.0, unit "1", range 0.0..=1.0;
        /// By how much later the wrench estimate shows the force, besides that lag: transport, a
        /// filter that delays. Not with environment.contact = "detected".
        wrench_dead_time_s: f64 = 0.0, unit "s", range 0.0..=0.1;
        /// Force along the inward normal that the cost aims at: f_ref of the set point.
        normal_force_reference_n: f64 = 0.0, unit "N", range 0.0..=1e5;
        /// Where the sign of a contact comes from.
        sign: ContactSignName = ContactSignName::Normal;
        /// When the minimum force holds.
        lower_bound: LowerBoundName = LowerBoundName::OnceReached;
        /// What losing the contact, once the minimum force was reached, leads to.
        on_contact_lost: OnContactLostName = OnContactLostName::Continue;
        /// Part of the force limit by which a plan may exceed it before that is infeasible: for
        /// what a linear model leaves out.
        limit_tolerance: f64 = 0.0025, unit "1", range 0.0..=0.1;
        /// With environment.stiffness_range_n_m: from which share of the surfaces that may be there,
        /// and can't be kept below the limit, on to stop. 1 stops only where none can be kept.
        risk: f64 = 0.99, unit "1", range 0.0..=1.0;
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
