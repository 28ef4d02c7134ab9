//! A daemon whose wrench follows from motor torques: what it is told of an arm with masses, right or
//! wrong, and how far its f̂ is from the force in the plant.

use admittance_core::quantities::Instant;
use admittance_runner::config::Config;
use admittance_runner::cycle;
use ipc_types::{CommandSample, StateSample, TASK_AXES};

use crate::session::with_keys;

/// f_max on z, N.
pub const LIMIT: f64 = 150.0;
/// The force that is kept, N.
const PRESSING: f64 = 100.0;
/// The end of a run in which the force is settled, s.
const SETTLED_S: f64 = 0.5;

/// A number from −1 to 1 by a seed, xorshift.
fn draw(state: &mut u64) -> f64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// `[dynamics]` as a TOML value: the masses and friction of a scenario, those of each joint wrong by at
/// most these shares, evenly, and told to be that uncertain.
///
/// # Panics
/// When the scenario has no `[rigid_body]`.
pub fn dynamics(scenario: &str, masses: f64, friction: f64, seed: u64) -> String {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    for _ in 0..8 {
        draw(&mut state);
    }
    let mut plant: toml::Table = scenario.parse().expect("TOML");
    let mut told = toml::Table::new();
    told.insert("mass_tolerance".to_owned(), (masses.max(0.002) / 3f64.sqrt()).into());
    told.insert("acceleration_tolerance".to_owned(), masses.max(0.05).into());
    told.insert("friction_tolerance".to_owned(), (friction.max(0.01) / 3f64.sqrt()).into());
    let joints = plant["rigid_body"]["joint"].as_array_mut().expect("joints");
    for joint in &mut *joints {
        let joint = joint.as_table_mut().expect("a joint");
        let of_drive = ["gear_damping", "torque_limit", "speed_gain", "encoder_counts"];
        joint.retain(|key, _| !of_drive.iter().any(|name| key.starts_with(name)));
        let mass = 1.0 + masses * draw(&mut state);
        let rubbing = 1.0 + friction * draw(&mut state);
        for (key, value) in joint.iter_mut() {
            let factor = match key.as_str() {
                "mass_kg" | "inertia_kg_m2" => mass,
                key if key.contains("friction") => rubbing,
                _ => continue,
            };
            let scaled = |value: &toml::Value| toml::Value::from(value.as_float().expect("a number") * factor);
            *value = match &*value {
                toml::Value::Array(values) => values.iter().map(scaled).collect::<Vec<_>>().into(),
                value => scaled(value),
            };
        }
    }
    told.insert("joint".to_owned(), joints.clone().into());
    toml::Value::from(told).to_string()
}

/// The scenario with gears that do not give.
///
/// # Panics
/// When it has no `[rigid_body]`.
pub fn with_stiff_gears(scenario: &str) -> String {
    let mut table: toml::Table = scenario.parse().expect("TOML");
    for joint in table["rigid_body"]["joint"].as_array_mut().expect("joints") {
        let joint = joint.as_table_mut().expect("a joint");
        joint.retain(|key, _| !matches!(key, "gear_stiffness_n_m_rad" | "gear_damping_n_m_s_rad"));
    }
    table.to_string()
}

/// A configuration that takes its wrench from torques, by these `dynamics`, and presses with 100 N.
pub fn config(config: &str, dynamics: &str) -> String {
    let pressing = format!("[6.0, 6.0, {PRESSING:?}, 1.0, 1.0, 1.0]");
    let keys = [
        ("wrench", "{ source = \"motor_torque\" }"),
        ("dynamics", dynamics),
        ("contact.minimum_force", pressing.as_str()),
    ];
    with_keys(config, &keys)
}

/// What f̂ was at a sample, and the force in the plant.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// Scenario time, s.
    pub time_s: f64,
    /// f̂, N and N m.
    pub wrench: [f64; TASK_AXES],
    /// Its stated standard deviation, N and N m.
    pub deviation: [f64; TASK_AXES],
    /// That the robot exerts on the environment, base frame, N.
    pub force: [f64; 3],
}

/// How far f̂ is from the force in the plant.
#[derive(Debug, Clone, Copy)]
pub struct Judged {
    /// Of the three forces together, once settled, N.
    pub rms: f64,
    /// Share of values, of the whole run, within three of the stated deviations of the force. That has
    /// the lag that f̂ is told to have.
    pub within: f64,
    /// Largest stated deviation of a force, N.
    pub deviation: f64,
    /// Mean force once settled, N.
    pub force: f64,
}

/// Judges a run with this T_est in s and this sampling time in s.
///
/// # Panics
/// When there is none, or a sample states no deviation.
pub fn judge(lag_s: f64, sampling_time_s: f64, run: &[Seen]) -> Judged {
    let end = run.last().expect("samples").time_s;
    let decay = (-sampling_time_s / lag_s).exp();
    let (mut lagged, mut within, mut deviation) = ([0.0; 3], 0u32, 0.0f64);
    let (mut squares, mut force, mut settled) = (0.0, 0.0, 0u32);
    for seen in run {
        let mut square = 0.0;
        for (axis, lagged) in lagged.iter_mut().enumerate() {
            *lagged = seen.force[axis] + (*lagged - seen.force[axis]) * decay;
            let (off, stated) = (seen.wrench[axis] - *lagged, seen.deviation[axis]);
            assert!(stated > 0.0 && stated.is_finite(), "σ = {stated} N at {} s", seen.time_s);
            within += u32::from(off.abs() <= 3.0 * stated);
            deviation = deviation.max(stated);
            square += off * off;
        }
        if seen.time_s > end - SETTLED_S {
            squares += square;
            force += seen.force.iter().map(|value| value * value).sum::<f64>().sqrt();
            settled += 1;
        }
    }
    let settled = f64::from(settled);
    Judged {
        rms: (squares / settled).sqrt(),
        within: f64::from(within) / (3 * run.len()) as f64,
        deviation,
        force: force / settled,
    }
}

/// Judges what a daemon with this configuration makes of samples: scenario time in s, sample, force in N.
///
/// # Panics
/// As [`judge`], and when a sample does not reach the law.
pub fn judge_samples(config: &Config, samples: impl Iterator<Item = (f64, StateSample, [f64; 3])>) -> Judged {
    let mut cycle = cycle::build(config).expect("the config describes a controller");
    let mut command = CommandSample::zeroed();
    let seen = |(time_s, state, force): (f64, StateSample, [f64; 3])| {
        let now = Instant::from_nanoseconds(state.stamp_ns);
        let report = cycle.answer(&state, now, &mut || false, &mut command);
        assert_eq!(report.fault, None, "at {time_s} s");
        Seen { time_s, wrench: report.wrench, deviation: report.wrench_deviation, force }
    };
    let seen: Vec<Seen> = samples.map(seen).collect();
    judge(config.contact.wrench_time_constant_s[0], config.control.sampling_time_s, &seen)
}
