//! A configuration with every kind of key.

use std::ops::Bound;
use std::path::PathBuf;

use admittance_host::config::{ConfigError, ConfigErrors, parse};
use admittance_host::{config_enum, config_file, config_section};

config_enum! {
    /// Which law computes the offset.
    pub enum Law {
        /// The predictive controller,
        /// with its verdict.
        Mpc = "mpc",
        /// The damping baseline (3).
        HighDamping = "high_damping",
    }
}

config_section! {
    /// The control law.
    pub struct Control {
        /// Time between two samples,
        /// exactly.
        sampling_time_s: f64, unit "s", range 0.0001..=0.1;
        /// Steps that the law looks ahead.
        horizon: u32 = 5, unit "steps", range 1..=32;
        /// Which law runs.
        law: Law = Law::Mpc;
        /// Laws that may be switched to.
        laws: Vec<Law> = vec![Law::HighDamping];
        /// Weight of each axis.
        weights: Vec<f64>, unit "1", range 0.0..=1e9, length 1..=6;
        /// Stiffness of the surface.
        stiffness_n_per_m: f64 = 1e5, unit "N/m", range (Bound::Excluded(0.0), Bound::Unbounded);
        /// Where the surface is; detected when absent.
        contact_point_m: Option<[f64; 3]>, unit "m", range -10.0..=10.0;
        /// Force at which a stop ends.
        stop_force_n: Option<f64> = Some(100.0), unit "N", range 1.0..1000.0;
        /// Seed of the noise.
        seed: u64 = 1, unit "1";
        /// Whether the law is on from the start.
        enabled: bool = true;
        /// Rotation of the surface.
        surface: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]], unit "1", range -1.0..=1.0;
    }
    cross_check release_below_minimum;
}

fn release_below_minimum(control: &Control, path: &str, errors: &mut Vec<ConfigError>) {
    if control.weights[0] > 500.0 && control.horizon > 30 {
        errors.push(ConfigError::new(format!("{path}.horizon"), control.horizon, "at most 30 with weights[0] > 500"));
    }
    if control.weights[0] > 600.0 {
        errors.push(ConfigError::new(format!("{path}.weights[0]"), control.weights[0], "at most 600"));
    }
}

config_section! {
    /// A joint.
    pub struct Joint {
        /// Length of the link that it moves.
        length_m: f64, unit "m", range 0.0..=5.0;
        /// Time constant of its speed loop.
        time_constant_s: f64 = 0.015, unit "s", range 0.0..=1.0;
    }
}

config_section! {
    /// The arm.
    pub struct Robot {
        /// What logs call it.
        name: String = "arm".to_owned(), length 1..=16;
        /// One table for each joint, from the base.
        joint: Vec<Joint>, length 1..=8;
    }
}

config_section! {
    /// Where shared memory is.
    pub struct Ipc {
        /// Directory of the services' files.
        root_path: PathBuf = PathBuf::from("/run/admittanced"), length 1..=60;
        /// Cycles without an answer before the controller stops.
        patience: i32 = -1, unit "cycles", range -1..;
    }
}

config_section! {
    /// Noise of the sensor.
    pub struct Noise {
        /// Standard deviation.
        deviation_n: f64, unit "N", range 0.0..=10.0;
    }
}

config_section! {
    /// The whole file.
    pub struct Config {
        /// Name of the cell.
        cell: Option<String>, length 2..;
        /// The control law.
        control: Control;
        /// The arm.
        robot: Robot;
        /// Where shared memory is.
        ipc: Ipc;
        /// Noise; none when absent.
        noise: Option<Noise>;
    }
}

config_file!(Config);

pub(crate) const VALID: &str = r#"
cell = "north"

[control]
sampling_time_s = 0.004
law = "high_damping"
weights = [1.0, 2]
contact_point_m = [1.32, 0.68, 0.0]

[robot]
name = "2R"
[[robot.joint]]
length_m = 1.0
[[robot.joint]]
length_m = 1.0
time_constant_s = 0.01
"#;

pub(crate) fn errors_of(text: &str) -> ConfigErrors {
    parse::<Config>(text, "cell.toml").expect_err("the text must not be accepted")
}

/// The valid text with one piece replaced.
pub(crate) fn with(old: &str, new: &str) -> String {
    assert!(VALID.contains(old));
    VALID.replacen(old, new, 1)
}
