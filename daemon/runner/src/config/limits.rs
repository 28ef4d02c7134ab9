//! `[limits]`: of joints and offset.

use admittance_host::config::ConfigError;
use admittance_host::config_section;

config_section! {
    /// Limits of joints and offset. The MPC and the minimum-force stop know them as constraints;
    /// an offset that is not optimised is clamped to `velocity_offset`, but where the limits of the drives ask for more.
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
        /// Largest change of each joint's speed reference, J⁻¹ (ṗ0 + Δṗ), from one that is streamed to the next, over
        /// the time between them; of a prismatic joint in m/s^2. When present, every command keeps it, a jump of
        /// ṗ0 itself is ramped, and so is coming to a standstill; joint_speed_rad_s then holds in free motion too.
        joint_acceleration_rad_s2: Option<Vec<f64>>, unit "rad/s^2, m/s^2", range 0.01..=1e5, length 2..=8;
        /// Largest change of that, over the same time; of a prismatic joint in m/s^3. Only together with
        /// joint_acceleration_rad_s2; unlimited when absent.
        joint_jerk_rad_s3: Option<Vec<f64>>, unit "rad/s^3, m/s^3", range 0.1..=1e8, length 2..=8;
        /// Whether a minimum-force stop, and coming to rest after it, may exceed joint_jerk_rad_s3.
        stop_exceeds_jerk: bool = false;
        /// Largest rate of Δṗ per task axis toward the surface, and either way on an axis that does
        /// not feel it. Not together with joint_acceleration_rad_s2.
        inward_rate_m_s2: Option<Vec<f64>>, unit "m/s^2, rad/s^2", range 0.01..=1e5, length 2..=6, each "axis";
        /// Largest rate of Δṗ per task axis out of the surface; unlimited when absent.
        outward_rate_m_s2: Option<Vec<f64>>, unit "m/s^2, rad/s^2", range 0.01..=1e5, length 2..=6, each "axis";
        /// Rate at which the offset of a released axis returns to zero.
        release_rate_m_s2: f64 = 10.0, unit "m/s^2, rad/s^2", range 0.01..=1000.0;
    }
    cross_check positions_and_drives;
}

fn positions_and_drives(limits: &LimitsSection, path: &str, errors: &mut Vec<ConfigError>) {
    joint_positions(limits, path, errors);
    if limits.joint_jerk_rad_s3.is_some() && limits.joint_acceleration_rad_s2.is_none() {
        let accepted = format!("a limit of the acceleration beside {path}.joint_jerk_rad_s3");
        errors.push(ConfigError::new(format!("{path}.joint_acceleration_rad_s2"), "absent", accepted));
    }
    if let (Some(_), Some(rate)) = (&limits.joint_acceleration_rad_s2, &limits.inward_rate_m_s2) {
        let accepted =
            format!("absent beside {path}.joint_acceleration_rad_s2, which may need another rate to be kept");
        errors.push(ConfigError::new(format!("{path}.inward_rate_m_s2"), format!("{rate:?}"), accepted));
    }
    if limits.stop_exceeds_jerk && limits.joint_jerk_rad_s3.is_none() {
        let accepted = format!("false, since there is no {path}.joint_jerk_rad_s3");
        errors.push(ConfigError::new(format!("{path}.stop_exceeds_jerk"), true, accepted));
    }
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
