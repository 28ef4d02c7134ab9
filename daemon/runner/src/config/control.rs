//! `[control]`: the cycle.

use admittance_host::config::ConfigError;
use admittance_host::{config_enum, config_section};
use ipc_types::Law;

config_enum! {
    /// Which law computes the offset.
    pub enum LawName {
        /// MPC-based admittance control (18).
        Mpc = "mpc",
        /// Classic admittance control (3), for comparison.
        Damping = "damping",
    }
}

impl LawName {
    /// The law of this name.
    pub const fn law(self) -> Law {
        match self {
            Self::Mpc => Law::Mpc,
            Self::Damping => Law::Damping,
        }
    }

    /// The name of a law.
    pub const fn of(law: Law) -> Self {
        match law {
            Law::Mpc => Self::Mpc,
            Law::Damping => Self::Damping,
        }
    }
}

config_enum! {
    /// How the real-time thread waits for the next state sample.
    pub enum Wait {
        /// Blocks until the motion controller notifies: least processor time, slowest to wake.
        Event = "event",
        /// Sleeps until shortly before the next sample is due, then spins.
        Hybrid = "hybrid",
        /// Spins as long as samples come: fastest, and takes a whole processor, which should be
        /// isolated (admittancectl doctor).
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
        /// The command for a sample acts this long after the sample's stamp; agreed with the motion
        /// controller.
        command_delay_s: f64 = 0.0, unit "s", range 0.0..=0.2;
        /// By how much later than the model says the arm may follow its commands: speed loops that are
        /// slower or of a higher order than told, delays that nobody told. Until the arm was
        /// halted, a plan leaves free below the limit what it would press deeper in this time, where it
        /// can: an impact is softer, and the tool may leave the surface after it. Of a surface of which a range is
        /// told, what an arm that follows as much earlier would keep is no reason to stop. After a touch the force
        /// comes down more slowly, with a time constant that is 1.4 times this longer.
        lag_tolerance_s: f64 = 0.0, unit "s", range 0.0..=0.02;
        /// An answer published later than this after the sample's stamp is late; the solver is cut
        /// short before.
        answer_budget_s: f64, unit "s", range 0.00001..=0.1;
        /// An older sample is stale, and a silence of this length counts as one.
        max_sample_age_s: f64, unit "s", range 0.0001..=1.0;
        /// How the real-time thread waits for the next sample, and admittance-egm for its robot's next
        /// message, where "spin" is as "hybrid".
        wait: Wait = Wait::Hybrid;
        /// With wait = "hybrid": how long before and after the instant at which a sample is due the
        /// thread spins.
        spin_s: f64 = 0.0003, unit "s", range 0.00001..=0.01;
        /// Cycles in a row that the last plan may stand in for an answer.
        max_consecutive_fallbacks: u32 = 3, unit "cycles", range 0..=20;
        /// Whether the first valid sample without contact starts control.
        start_enabled: bool = true;
        /// Reciprocal condition number of the Jacobian below which the pose counts as singular and
        /// stops the arm: in contact at a low force, from where the arm would come to rest at such a
        /// pose, and with some way left to the singularity.
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
