//! `[requests]`: what requests may change while the daemon runs. What is absent they may not.

use admittance_host::config::ConfigError;
use admittance_host::config_section;

config_section! {
    /// Bounds of what requests may change (admittancectl set-force-limit, set-environment, set-law,
    /// tare). What is absent they may not change. Reset, enable, disable and reload need no
    /// permission.
    pub struct RequestsSection {
        /// Smallest force limit that a request may set, one value per task axis; together with
        /// force_limit_max.
        force_limit_min: Option<Vec<f64>>, unit "N, N m", range 0.01..=1e5, length 2..=6, each "axis";
        /// Largest force limit that a request may set, one value per task axis.
        force_limit_max: Option<Vec<f64>>, unit "N, N m", range 0.01..=1e5, length 2..=6, each "axis";
        /// Smallest normal stiffness that a request may set; together with
        /// normal_stiffness_max_n_m.
        normal_stiffness_min_n_m: Option<f64>, unit "N/m", range 100.0..=1e8;
        /// Largest normal stiffness that a request may set.
        normal_stiffness_max_n_m: Option<f64>, unit "N/m", range 100.0..=1e8;
        /// Largest angle by which a request may turn the surface normal away from this file's.
        surface_normal_angle_rad: Option<f64>, unit "rad", range 0.0..=3.15;
        /// Largest distance by which a request may move the contact point away from this file's.
        contact_point_distance_m: Option<f64>, unit "m", range 0.0..=10.0;
        /// Whether a request may change the law.
        law: bool = false;
        /// Largest magnitude of each component of the bias that a tare may arrive at: forces x y z,
        /// torques rx ry rz.
        tare_bias_max: Option<[f64; 6]>, unit "N, N m", range 0.0..=1e4;
    }
    cross_check both_ends;
}

fn both_ends(requests: &RequestsSection, path: &str, errors: &mut Vec<ConfigError>) {
    let stiffness = |value: Option<f64>| value.map(|value| vec![value]);
    let ranges = [
        ("force_limit_min", &requests.force_limit_min, "force_limit_max", &requests.force_limit_max),
        (
            "normal_stiffness_min_n_m",
            &stiffness(requests.normal_stiffness_min_n_m),
            "normal_stiffness_max_n_m",
            &stiffness(requests.normal_stiffness_max_n_m),
        ),
    ];
    for (low_key, low, high_key, high) in ranges {
        match (low, high) {
            (Some(low), Some(high)) => {
                for (low, high) in low.iter().zip(high).filter(|(low, high)| low > high) {
                    let accepted = format!("at most {path}.{high_key} = {high}");
                    errors.push(ConfigError::new(format!("{path}.{low_key}"), low, accepted));
                }
            }
            (None, None) => {}
            (low, _) => {
                let absent = if low.is_some() { high_key } else { low_key };
                let accepted = format!("both {low_key} and {high_key}, or neither");
                errors.push(ConfigError::new(format!("{path}.{absent}"), "absent", accepted));
            }
        }
    }
}
