//! `[environment]`: the surface as it is told.

use admittance_host::config::ConfigError;
use admittance_host::{config_enum, config_section};

config_enum! {
    /// Where the contact point comes from.
    pub enum ContactPointName {
        /// contact_point_m.
        Configured = "configured",
        /// The first samples in contact say how deep the surface is along its normal.
        Detected = "detected",
    }
}

config_section! {
    /// The surface: a stiff plane, base frame.
    pub struct EnvironmentSection {
        /// Stiffness along the normal, k_env of (19).
        normal_stiffness_n_m: f64, unit "N/m", range 100.0..=1e8;
        /// Outward normal, out of the material; any length above zero. (21):
        /// [sin(angle), cos(angle), 0].
        surface_normal: [f64; 3], unit "1", range -1.0..=1.0;
        /// Where the contact point comes from.
        contact: ContactPointName = ContactPointName::Configured;
        /// Position of the TCP at first contact; not used with contact = "detected".
        contact_point_m: Option<[f64; 3]>, unit "m", range -100.0..=100.0;
        /// Least and greatest stiffness along the normal, of a surface that is not known: then it is
        /// learned at touch, and the law keeps the limit for all that it may still be.
        /// normal_stiffness_n_m is what is believed before. Absent: that is the stiffness.
        stiffness_range_n_m: Option<[f64; 2]>, unit "N/m", range 100.0..=1e8;
        /// Stiffness as an impact meets it, before gears give; looked at with [dynamics] whose gears give.
        /// `admittancectl identify` finds it. Absent: the greatest that is told, without the part of it
        /// that the gears have.
        impact_stiffness_n_m: Option<f64>, unit "N/m", range 100.0..=1e8;
        /// The hardest that the surface may be in an impact, looked at where impact_stiffness_n_m is: a verdict is
        /// feasible only where it would be on that too. `admittancectl identify` finds it. Absent: as the press and
        /// gears a quarter softer than told leave it.
        most_impact_stiffness_n_m: Option<f64>, unit "N/m", range 100.0..=1e8;
        /// With a range: by how much the surface may be deeper or less deep at touch, along
        /// surface_normal, than the plane through contact_point_m. With normal_tolerance_rad the tilt
        /// times the distance from that point comes on top. Absent with contact = "detected": then it
        /// may begin at any depth.
        contact_tolerance_m: Option<f64>, unit "m", range 1e-6..=1.0;
        /// With a range: by how much the surface may be tilted against surface_normal. Then the normal
        /// is learned too, from the path that the tool takes over the surface. 0: it is told.
        normal_tolerance_rad: f64 = 0.0, unit "rad", range 0.0..=0.35;
        /// Standard deviation of the wrench's noise on one axis of x y z. The guards of [stopping]
        /// allow for five of them, and with contact = "detected" the verdict's margin is reduced by
        /// the force error that two of them cause through the contact point. 0 is not told.
        wrench_noise_n: f64 = 0.0, unit "N", range 0.0..=100.0;
        /// Orientation of the TCP at first contact: fixed-axis roll, pitch, yaw.
        contact_rpy_rad: [f64; 3] = [0.0, 0.0, 0.0], unit "rad", range -7.0..=7.0;
    }
    cross_check known_surface;
}

fn known_surface(environment: &EnvironmentSection, path: &str, errors: &mut Vec<ConfigError>) {
    known_contact_point(environment, path, errors);
    super::unknown_surface::check(environment, path, errors);
}

fn known_contact_point(environment: &EnvironmentSection, path: &str, errors: &mut Vec<ConfigError>) {
    if environment.contact == ContactPointName::Configured && environment.contact_point_m.is_none() {
        let accepted = format!("three coordinates, or {path}.contact = \"detected\"");
        errors.push(ConfigError::new(format!("{path}.contact_point_m"), "absent", accepted));
    }
}
