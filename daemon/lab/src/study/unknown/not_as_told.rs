//! What nobody told of the worlds of a study: the surface's normal, friction, damping, the lag and the
//! bias of the wrench.

use std::ops::RangeInclusive;

use serde::Serialize;
use toml::Table;

use super::super::draw::Draw;
use crate::keys::set;

/// By how much the worlds are not as they are told.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, clap::Args)]
pub(crate) struct NotAsTold {
    /// With --surface: the surface's normal is up to so many degrees from the told one.
    #[arg(long, default_value_t = 0.0, value_name = "DEGREES", value_parser = tilt, requires = "surface", allow_hyphen_values = true)]
    pub(crate) tilt_deg: f64,
    /// With --surface: Coulomb's coefficient of friction.
    #[arg(long, default_value_t = 0.0, value_parser = friction, requires = "surface", allow_hyphen_values = true)]
    pub(crate) friction: f64,
    /// With --surface: damping of the surface along its normal, N s/m.
    #[arg(long, default_value_t = 0.0, value_name = "N S/M", value_parser = damping, requires = "surface", allow_hyphen_values = true)]
    pub(crate) damping: f64,
    /// With --surface: T_est that is told, of the true one.
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR", value_parser = told_lag, requires = "surface", allow_hyphen_values = true)]
    pub(crate) told_lag: f64,
    /// With --surface: what the wrench shows beside the force, against it or with it along the normal, N.
    #[arg(long, default_value_t = 0.0, value_name = "N", value_parser = bias, requires = "surface", allow_hyphen_values = true)]
    pub(crate) bias_n: f64,
    /// With --surface: noise of the wrench that is told, of the true one.
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR", value_parser = told_noise, requires = "surface", allow_hyphen_values = true)]
    pub(crate) told_noise: f64,
    /// With a range: the contact point is told, and the surface up to so far from it, above or below.
    #[arg(long, default_value_t = 0.0, value_name = "M", value_parser = point, requires = "surface", allow_hyphen_values = true)]
    pub(crate) contact_tolerance_m: f64,
    /// With a range: the surface is so many times as hard as the hardest that is told.
    #[arg(long, value_name = "FACTOR", value_parser = outside, requires = "surface", allow_hyphen_values = true)]
    pub(crate) outside: Option<f64>,
}

/// What environment.normal_tolerance_rad accepts.
fn tilt(text: &str) -> Result<f64, String> {
    within(text, 0.0..=20.0, "degrees")
}

/// What a scenario accepts as surface.friction.
fn friction(text: &str) -> Result<f64, String> {
    within(text, 0.0..=2.0, "")
}

/// What a scenario accepts as surface.damping_n_s_m.
fn damping(text: &str) -> Result<f64, String> {
    within(text, 0.0..=1e5, "N s/m")
}

/// What leaves contact.wrench_time_constant_s in its range, whatever is drawn.
fn told_lag(text: &str) -> Result<f64, String> {
    within(text, 0.0..=10.0, "times the true lag")
}

/// What a scenario accepts as sensor.bias.
fn bias(text: &str) -> Result<f64, String> {
    within(text, -1e4..=1e4, "N")
}

/// What leaves environment.wrench_noise_n in its range.
fn told_noise(text: &str) -> Result<f64, String> {
    within(text, 0.0..=10.0, "times the true noise")
}

/// What environment.contact_tolerance_m accepts, or none.
fn point(text: &str) -> Result<f64, String> {
    within(text, 0.0..=0.1, "m")
}

/// Harder than told.
fn outside(text: &str) -> Result<f64, String> {
    within(text, 1.0..=10.0, "times the hardest")
}

/// β is five of them, and below the least force limit that is drawn, 50 N.
pub(crate) fn noise(text: &str) -> Result<f64, String> {
    within(text, 0.0..=9.9, "N")
}

/// What contact.risk accepts.
pub(crate) fn risk(text: &str) -> Result<f64, String> {
    within(text, 0.0..=1.0, "")
}

/// A number of an option, refused before anything runs.
fn within(text: &str, accepted: RangeInclusive<f64>, unit: &str) -> Result<f64, String> {
    let range = format!("accepted: {} to {} {unit}", accepted.start(), accepted.end()).trim_end().to_owned();
    let value: f64 = text.parse().map_err(|_| format!("not a number; {range}"))?;
    if accepted.contains(&value) { Ok(value) } else { Err(range) }
}

impl NotAsTold {
    /// The option that is given and says nothing without a range.
    pub(crate) fn of_a_range(&self) -> Option<&'static str> {
        let point = (self.contact_tolerance_m > 0.0).then_some("--contact-tolerance-m");
        point.or(self.outside.map(|_| "--outside"))
    }

    /// The contact as it is, of which `told` is what the controller is told: the surface is tilted to
    /// either side, half of the time as far as it may be.
    pub(super) fn actual(&self, told: &Draw) -> Draw {
        Draw {
            angle_rad: told.angle_rad + self.tilt_deg.to_radians() * (2.0 * side(told)).clamp(-1.0, 1.0),
            ..told.clone()
        }
    }

    /// Where a surface begins that is touched at `touched` (m), as it is told: off by up to the tolerance
    /// along the normal.
    pub(super) fn told_point_m(&self, told: &Draw, touched: [f64; 3]) -> [f64; 3] {
        let off = self.contact_tolerance_m * another_side(told);
        let normal = told.normal();
        std::array::from_fn(|axis| touched[axis] + off * normal[axis])
    }

    /// The controller's configuration with it.
    pub(super) fn tell(&self, told: &Draw, config: &mut Table) {
        let lag = told.wrench_time_constant_s * self.told_lag;
        set(config, "contact", "wrench_time_constant_s", told.of_axes(lag, lag));
    }

    /// The plant's scenario with it.
    pub(super) fn put_into(&self, draw: &Draw, scenario: &mut Table) {
        set(scenario, "surface", "friction", self.friction);
        set(scenario, "surface", "damping_n_s_m", self.damping);
        if self.bias_n != 0.0 {
            let bias = self.bias_n * side(draw).signum();
            let [x, y, z] = draw.normal().map(|part| -part * bias);
            set(scenario, "sensor", "in_base_axes", true);
            set(scenario, "sensor", "bias", vec![x, y, z, 0.0, 0.0, 0.0]);
        }
    }
}

/// From −1 to 1, evenly; digits of the contact's phase, which has nothing to do with it.
fn side(draw: &Draw) -> f64 {
    2.0 * (draw.contact_phase * 1e9).fract() - 1.0
}

/// The same of other digits.
fn another_side(draw: &Draw) -> f64 {
    2.0 * (draw.contact_phase * 1e11).fract() - 1.0
}
