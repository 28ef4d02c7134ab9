//! `[stopping]`: how a stop goes; `[damping]`: the law for comparison.

use admittance_host::config_section;

config_section! {
    /// How a stop goes.
    pub struct StoppingSection {
        /// Speed of the open-loop retreat, and the most that a stopped arm may move away with.
        retreat_speed_m_s: f64 = 0.05, unit "m/s", range 0.001..=1.0;
        /// Longest open-loop retreat.
        retreat_time_s: f64 = 0.1, unit "s", range 0.0..=2.0;
        /// Pressing force below which a stop may come to rest; half the smallest force limit of x y
        /// z when absent.
        stop_force_n: Option<f64>, unit "N", range 0.1..=1e5;
        /// Longest duration of a minimum-force stop; after it the arm is held, whatever the force.
        stop_timeout_s: f64 = 1.0, unit "s", range 0.01..=10.0;
        /// A force this far above its limit stops, whatever the model says: the measured one, or
        /// the one without the lag of contact.wrench_time_constant_s. No such guard when absent.
        force_guard_n: Option<f64>, unit "N, N m", range 0.0..=1e5;
        /// A measured pressing force this far from the one that the model expects at the measured
        /// pose stops; no such guard when absent. An error of 1 mm in the contact point is 100 N at
        /// 1e5 N/m.
        mismatch_n: Option<f64>, unit "N", range 0.1..=1e5;
        /// Consecutive cycles of that before the arm stops.
        mismatch_cycles: u32 = 3, unit "cycles", range 1..=1000;
    }
}

config_section! {
    /// The damping law (3).
    pub struct DampingSection {
        /// Diagonal of D, per task axis.
        damping_n_s_m: Vec<f64>, unit "N s/m, N m s/rad", range 0.1..=1e7, length 2..=6, each "axis";
    }
}
