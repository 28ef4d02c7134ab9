//! The `[twist]` section: a motion controller takes its commanded motion from other programs, the same in an edge's
//! configuration and in a plant's scenario.

use admittance_client::LeadLimits;
use admittance_core::quantities::Span;

use crate::config_section;

config_section! {
    /// Other programs lead the arm, `admittancectl move` for one: what they may ask for.
    pub struct TwistSection {
        /// Fastest that the TCP may be led; what is faster is brought down, with its turning.
        linear_limit_m_s: f64, unit "m/s", range 0.001..=5.0;
        /// Fastest that it may be turned; what is faster is brought down, with its motion.
        angular_limit_rad_s: f64, unit "rad/s", range 0.001..=10.0;
        /// Fastest change of the motion, also to rest when nobody leads any more.
        linear_acceleration_m_s2: f64 = 0.5, unit "m/s^2", range 0.01..=50.0;
        /// Fastest change of the turning.
        angular_acceleration_rad_s2: f64 = 2.5, unit "rad/s^2", range 0.01..=100.0;
        /// The longest that a program may ask to be followed after its last word.
        longest_valid_s: f64 = 0.2, unit "s", range 0.1..=5.0;
    }
}

impl TwistSection {
    /// The limits that it says.
    pub fn limits(&self) -> LeadLimits {
        LeadLimits {
            linear_m_s: self.linear_limit_m_s,
            angular_rad_s: self.angular_limit_rad_s,
            linear_acceleration_m_s2: self.linear_acceleration_m_s2,
            angular_acceleration_rad_s2: self.angular_acceleration_rad_s2,
            longest_valid_ns: Span::from_seconds(self.longest_valid_s).nanoseconds(),
        }
    }
}
