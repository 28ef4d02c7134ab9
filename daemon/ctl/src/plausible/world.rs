//! A world as it may be where the configuration was filled in with care.

use std::f64::consts::TAU;

use admittance_host::robot_description::VelocityLoopDescription;
use plant_sim::scenario::Scenario;
use rand::{Rng, RngExt};
use serde::Serialize;

/// Ranges: factors of what was told, or values where nothing was told.
const STIFFNESS: (f64, f64) = (0.5, 2.0);
const TILT_RAD: f64 = 1.0 / 180.0 * std::f64::consts::PI;
const TIME_CONSTANT: (f64, f64) = (0.75, 1.25);
const DAMPING: (f64, f64) = (0.5, 1.0);
const EXTRA_DELAY_S: f64 = 0.0015;
const REPORT_LAG_S: f64 = 0.002;
const FRICTION: f64 = 0.3;
const SURFACE_DAMPING_N_S_M: f64 = 100.0;
pub(crate) const NOISE_N: f64 = 0.5;
const TOOL_MASS: (f64, f64) = (0.9, 1.1);

/// What may differ from what was told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Of the surface, along its normal.
    Stiffness,
    /// Where the surface points.
    Normal,
    /// Time constants of the speed loops.
    SpeedLoops,
    /// Speed loops of second order.
    SecondOrder,
    /// T_est of the wrench.
    WrenchLag,
    /// Commands act later.
    Delay,
    /// Joint velocities are reported late.
    ReportLag,
    /// On the surface.
    Friction,
    /// Of the surface, along its normal.
    SurfaceDamping,
    /// Of the wrench.
    Noise,
    /// Of what hangs on the sensor.
    ToolMass,
}

impl Cause {
    /// All.
    pub const ALL: [Self; 11] = [
        Self::Stiffness,
        Self::Normal,
        Self::SpeedLoops,
        Self::SecondOrder,
        Self::WrenchLag,
        Self::Delay,
        Self::ReportLag,
        Self::Friction,
        Self::SurfaceDamping,
        Self::Noise,
        Self::ToolMass,
    ];
}

/// A world.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct World {
    /// True stiffness over the one told.
    pub stiffness_factor: f64,
    /// Angle between the true normal and the one told, and about which direction it is tilted, rad.
    pub tilt_rad: f64,
    /// 0 to 2π.
    pub tilt_direction_rad: f64,
    /// True T_V of each joint over the one told.
    pub time_constant_factor: Vec<f64>,
    /// Damping of each joint's loop of second order; `None`: the loops are of first order.
    pub damping: Option<Vec<f64>>,
    /// True T_est over the one told.
    pub wrench_lag_factor: f64,
    /// By how much later than told commands act, s.
    pub extra_delay_s: f64,
    /// Lag of the reported joint velocities, s.
    pub report_lag_s: f64,
    /// Coulomb friction coefficient.
    pub friction: f64,
    /// Of the surface, N s/m.
    pub surface_damping_n_s_m: f64,
    /// Of the noise.
    pub noise_seed: u64,
    /// Instant of contact within a cycle, as a share of it.
    pub contact_phase: f64,
    /// True mass of the tool over the one told.
    pub tool_mass_factor: f64,
}

impl World {
    /// Draws one for an arm with so many joints.
    pub fn draw(generator: &mut impl Rng, joints: usize) -> Self {
        let mut share = || generator.random::<f64>();
        let between = |(low, high): (f64, f64), share: f64| low + (high - low) * share;
        Self {
            stiffness_factor: STIFFNESS.0 * (STIFFNESS.1 / STIFFNESS.0).powf(share()),
            tilt_rad: TILT_RAD * share(),
            tilt_direction_rad: TAU * share(),
            time_constant_factor: (0..joints).map(|_| between(TIME_CONSTANT, share())).collect(),
            damping: {
                let damping: Vec<f64> = (0..joints).map(|_| between(DAMPING, share())).collect();
                (share() < 0.5).then_some(damping)
            },
            wrench_lag_factor: between(TIME_CONSTANT, share()),
            extra_delay_s: EXTRA_DELAY_S * share(),
            report_lag_s: REPORT_LAG_S * share(),
            friction: FRICTION * share(),
            surface_damping_n_s_m: SURFACE_DAMPING_N_S_M * share(),
            noise_seed: (share() * 1e9) as u64,
            contact_phase: share(),
            // What is new is drawn last: the worlds stay what they were.
            tool_mass_factor: between(TOOL_MASS, share()),
        }
    }

    /// Makes the plant this world, as far as `is_on` says.
    pub fn apply(&self, scenario: &mut Scenario, is_on: impl Fn(Cause) -> bool) {
        let linear: Vec<usize> = scenario.robot.linear_axes().collect();
        if let Some(surface) = &mut scenario.surface {
            if is_on(Cause::Stiffness) {
                surface.stiffness_n_m *= self.stiffness_factor;
            }
            if is_on(Cause::Normal) {
                surface.normal = tilted(surface.normal, self.tilt_rad, self.tilt_direction_rad, &linear);
            }
            if is_on(Cause::Friction) {
                surface.friction = self.friction;
            }
            if is_on(Cause::SurfaceDamping) {
                surface.damping_n_s_m = self.surface_damping_n_s_m;
            }
        }
        if is_on(Cause::SpeedLoops) {
            let lags = &mut scenario.robot.velocity_time_constant_s;
            lags.iter_mut().zip(&self.time_constant_factor).for_each(|(lag, factor)| *lag *= factor);
        }
        let told = scenario.robot.velocity_loop.take();
        let (told_damping, dead_time_s, told_lag_s) =
            told.map_or((None, None, 0.0), |told| (told.damping, told.dead_time_s, told.report_lag_s));
        scenario.robot.velocity_loop = Some(VelocityLoopDescription {
            damping: self.damping.clone().filter(|_| is_on(Cause::SecondOrder)).or(told_damping),
            dead_time_s,
            report_lag_s: told_lag_s + if is_on(Cause::ReportLag) { self.report_lag_s } else { 0.0 },
        });
        if is_on(Cause::WrenchLag) {
            scenario.wrench.time_constant_s.iter_mut().for_each(|lag| *lag *= self.wrench_lag_factor);
        }
        if is_on(Cause::Delay) {
            scenario.timing.command_delay_s += self.extra_delay_s;
        }
        if is_on(Cause::ToolMass)
            && let Some(sensor) = &mut scenario.sensor
        {
            sensor.tool_mass_kg *= self.tool_mass_factor;
        }
        if is_on(Cause::Noise) {
            (scenario.noise.wrench, scenario.noise.seed) = (NOISE_N, self.noise_seed);
        }
    }
}

/// A normal turned by `angle` towards `direction` (both rad), within the plane of an arm that moves along two of the
/// axes x y z; not at all where it moves along one.
fn tilted(normal: [f64; 3], angle: f64, direction: f64, linear: &[usize]) -> [f64; 3] {
    if linear.len() < 2 {
        return normal;
    }
    let n = nalgebra::Vector3::from(normal).normalize();
    let beside = (0..3).find(|axis| !linear.contains(axis));
    let axis = if let Some(beside) = beside {
        nalgebra::Unit::new_unchecked(nalgebra::Vector3::ith(beside, 1.0))
    } else {
        // Any direction across the normal, turned about it.
        let across = n.cross(&nalgebra::Vector3::from_fn(|axis, _| f64::from(u8::from(axis == n.iamin()))));
        let about = nalgebra::Rotation3::from_axis_angle(&nalgebra::Unit::new_normalize(n), direction);
        nalgebra::Unit::new_normalize(about * across)
    };
    let angle = if beside.is_some() { angle * direction.cos() } else { angle };
    (nalgebra::Rotation3::from_axis_angle(&axis, angle) * n).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_tilts_within_what_the_arm_moves_along() {
        let (normal, angle) = ([0.0, 0.8, 0.6], 0.1);
        for direction in [0.0, 1.0, 2.5] {
            let in_the_plane = tilted(normal, angle, direction, &[1, 2]);
            assert!(in_the_plane[0].abs() < 1e-15, "{in_the_plane:?}");
            let turned: f64 = in_the_plane.iter().zip(normal).map(|(a, b)| a * b).sum();
            assert!((turned.acos() - angle * direction.cos().abs()).abs() < 1e-9);
            assert_eq!(tilted([0.0, 0.0, 1.0], angle, direction, &[2]), [0.0, 0.0, 1.0]);
            let anywhere = tilted(normal, angle, direction, &[0, 1, 2]);
            assert!((anywhere.iter().zip(normal).map(|(a, b)| a * b).sum::<f64>().acos() - angle).abs() < 1e-9);
        }
    }

    #[test]
    fn the_tool_alone_is_heavier_where_nothing_else_differs() {
        use admittance_runner::config::Config;
        let text = include_str!("../../../../deploy/demo/mpc-default.toml");
        let mut config: Config = admittance_host::config::parse(text, "mpc-default.toml").unwrap();
        config.wrench.tool_mass_kg = 2.0;
        let told = crate::limits::Approach::new(&config, None, None).unwrap().scenario(&config, 0.2, 0.5);
        let mut factors = Vec::new();
        for index in 0..50 {
            let world = super::super::world(1, index, 2);
            let mut scenario = told.clone();
            world.apply(&mut scenario, |cause| cause == Cause::ToolMass);
            assert_eq!(scenario.surface, told.surface);
            factors.push(scenario.sensor.unwrap().tool_mass_kg / 2.0);
            assert!((factors[index as usize] - world.tool_mass_factor).abs() < 1e-12);
        }
        let (least, most) = factors.iter().fold((f64::MAX, 0.0_f64), |(a, b), &f| (a.min(f), b.max(f)));
        assert!((0.9..0.92).contains(&least) && (1.08..1.1).contains(&most), "{least} to {most}");
    }

    #[test]
    fn a_tilt_keeps_length_and_angle() {
        for (normal, direction) in [([0.0, 0.0, 1.0], 0.3), ([0.6, 0.0, 0.8], 4.0), ([1.0, 0.0, 0.0], 2.0)] {
            let turned = nalgebra::Vector3::from(tilted(normal, 0.01, direction, &[0, 1, 2]));
            assert!((turned.norm() - 1.0).abs() < 1e-12);
            assert!((turned.angle(&nalgebra::Vector3::from(normal)) - 0.01).abs() < 1e-9);
        }
        let turned = tilted([0.0, 1.0, 0.0], 0.01, 0.0, &[0, 1]);
        assert!(turned[2] == 0.0 && (turned[0] + 0.01f64.sin()).abs() < 1e-12, "{turned:?}");
    }
}
