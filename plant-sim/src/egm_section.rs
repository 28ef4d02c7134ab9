//! `[egm]` of a scenario: how the emulated robot controller speaks Externally Guided Motion.

use admittance_host::config_section;

config_section! {
    /// The emulated robot controller's end of Externally Guided Motion, and the network between. Shares are of datagrams, in
    /// both directions.
    pub struct EgmSection {
        /// CommTimeout of EGMRunJoint: without a message for so long the robot stops by itself.
        comm_timeout_s: f64 = 1.0, unit "s", range 0.01..=60.0;
        /// How fast the robot's clock runs away from this host's.
        clock_drift_ppm: f64 = 0.0, unit "ppm", range -1000.0..=1000.0;
        /// Datagrams that are lost.
        lost: f64 = 0.0, unit "1", range 0.0..=1.0;
        /// Datagrams that come twice.
        duplicated: f64 = 0.0, unit "1", range 0.0..=1.0;
        /// Datagrams that come after the one that was sent after them.
        reordered: f64 = 0.0, unit "1", range 0.0..=1.0;
        /// Most time by which a message is sent late, evenly distributed; below a cycle.
        jitter_s: f64 = 0.0, unit "s", range 0.0..=0.05;
        /// The same seed gives the same losses.
        seed: u64 = 1, unit "1";
    }
}
