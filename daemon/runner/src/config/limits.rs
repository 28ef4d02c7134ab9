//! `[limits]`: of joints and offset.

use admittance_host::config::ConfigError;
use admittance_host::config_section;

config_section! {
    /// Limits of joints and offset. The MPC and the minimum-force stop know them as constraints;
    /// an offset that is not optimised is clamped to `velocity_offset`.
    pub struct LimitsSection {
        /// Largest |Δṗ| per task axis.
        velocity_offset: Vec<f64>, unit "m/s, rad/s", range 0.001..=20.0, length 2..=6, each "axis";
        /// Largest speed reference of each joint, J⁻¹ (ṗ0 + Δṗ); of a prismatic joint in m/s.
        joint_speed_rad_s: Option<Vec<f64>>, unit "rad/s, m/s", range 0.01..=100.0, length 2..=8;
        /// Smallest position of each joint, of a prismatic joint in m; together with
        /// joint_position_max_rad.
        joint_position_min_rad: Option<Vec<f64>>, unit "rad, m", range -100.0..=100.0, length 2..=8;
        /// Largest position of each joint, likewise.
        joint_position_max_rad: Option<Vec<f64>>, unit "rad, m", range -100.0..=100.0, length 2..=8;
        /// Largest rate of Δṗ per task axis toward the surface, and either way on an axis that does
        /// not feel it.
        inward_rate_m_s2: Option<Vec<f64>>, unit "m/s^2, rad/s^2", range 0.01..=1e5, length 2..=6, each "axis";
        /// Largest rate of Δṗ per task axis out of the surface; unlimited when absent.
        outward_rate_m_s2: Option<Vec<f64>>, unit "m/s^2, rad/s^2", range 0.01..=1e5, length 2..=6, each "axis";
        /// Rate at which the offset of a released axis returns to zero.
        release_rate_m_s2: f64 = 10.0, unit "m/s^2, rad/s^2", range 0.01..=1000.0;
    }
    cross_check joint_positions;
}

fn joint_positions(limits: &LimitsSection, path: &str, errors: &mut Vec<ConfigError>) {
    match (&limits.joint_position_min_rad, &limits.joint_position_max_rad) {
        (Some(min), Some(max)) => {
            for (joint, (min, max)) in min.iter().zip(max).enumerate().filter(|(_, (min, max))| min >= max) {
                let accepted = format!("below {path}.joint_position_max_rad[{joint}] = {max}");
                errors.push(ConfigError::new(format!("{path}.joint_position_min_rad[{joint}]"), min, accepted));
            }
        }
        (None, None) => {}
        (min, _) => {
            let absent = if min.is_some() { "max" } else { "min" };
            let accepted = "both joint_position_min_rad and joint_position_max_rad, or neither";
            errors.push(ConfigError::new(format!("{path}.joint_position_{absent}_rad"), "absent", accepted));
        }
    }
}
