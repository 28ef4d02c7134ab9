//! An arm's commissioning: a recording of touches and lively motion, and what `identify` makes of it.

use admittance_host::config::parse;
use admittance_runner::config::Config;
use admittance_runner::cycle;
use admittancectl::identify;
use admittancectl::virtual_recording::VirtualRecords;
use ipc_types::RecordSample;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::{MotionSection, Scenario};
use toml::{Table, Value};

use super::draw::{Cell, numbers};
use crate::keys::set;

/// Touches at these speeds, m/s, and how long they press, s.
const TOUCHES_M_S: [f64; 3] = [0.04, 0.06, 0.08];
const PRESS_S: f64 = 0.4;
const APPROACH_S: f64 = 0.3;
/// Back by so many m afterwards.
const CLEAR_M: f64 = 0.03;
/// Changes of speed in the air, each there and back.
const CHANGES: usize = 10;
const CHANGE_S: f64 = 0.12;
const REST_S: f64 = 0.06;
/// Largest parts of a twist in the air.
const LINEAR_M_S: f64 = 0.15;
const ANGULAR_RAD_S: f64 = 0.5;
/// Of the law that touches, N s/m.
const DAMPING_N_S_M: f64 = 1500.0;

/// What the daemon is told of an identified arm: a configuration without the limit of a contact.
pub(super) struct Commissioned {
    pub(super) told: Table,
    /// What the recording did not tell.
    pub(super) unknown: Vec<String>,
}

/// Records the arm of a cell and identifies it.
///
/// # Errors
/// What cannot be simulated or identified.
pub(super) fn commission(cell: &Cell, seed: u64, arm: u64) -> Result<Commissioned, String> {
    let mut told = cell.told.clone();
    let axes = cell.plant.robot.task_axes as usize;
    set(&mut told, "control", "law", "damping");
    let damping = Value::Array((0..axes).map(|axis| if axis < 3 { DAMPING_N_S_M } else { 100.0 }.into()).collect());
    set(&mut told, "damping", "damping_n_s_m", damping);
    // Nothing of a touch shall stop the recording.
    set(&mut told, "stopping", "force_guard_n", 5000.0);
    set(&mut told, "stopping", "mismatch_n", 5000.0);
    let text = told.to_string();
    let config: Config = parse(&text, "told").map_err(|error| error.to_string())?;
    // In the air nobody shall add to the motion.
    let mut left_alone = config.clone();
    left_alone.control.start_enabled = false;
    let recordings = [recorded(&left_alone, &lively(cell, seed, arm))?, recorded(&config, &touching(cell, seed, arm))?];
    let identified = identify::configuration(&text, &recordings).map_err(|(_, why)| why)?;
    let mut told: Table = identified.configuration.parse().map_err(|error: toml::de::Error| error.to_string())?;
    set(&mut told, "control", "law", "mpc");
    let untouched = |section: &str, key: &str| cell.told.get(section).and_then(|table| table.get(key)).cloned();
    for key in ["force_guard_n", "mismatch_n"] {
        match untouched("stopping", key) {
            Some(value) => set(&mut told, "stopping", key, value),
            None => drop(told.get_mut("stopping").and_then(Value::as_table_mut).map(|table| table.remove(key))),
        }
    }
    told.remove("damping");
    Ok(Commissioned { told, unknown: identified.unknown })
}

fn recorded(config: &Config, scenario: &Scenario) -> Result<Vec<RecordSample>, String> {
    let plant = VirtualRun::new(scenario).map_err(|error| error.to_string())?;
    let mut run = VirtualRecords::new(cycle::build(config)?, plant);
    let mut records = Vec::new();
    while let Some((record, _)) = run.next(|_, _| false)? {
        records.push(record);
    }
    Ok(records)
}

/// Rounds a duration up to whole cycles.
fn phase(cell: &Cell, duration_s: f64, twist: Vec<f64>) -> MotionSection {
    let cycle_s = cell.plant.timing.sampling_time_s;
    MotionSection { duration_s: (duration_s / cycle_s).ceil() * cycle_s, twist, beside_rad_s: None }
}

/// Touches of the surface.
fn touching(cell: &Cell, seed: u64, arm: u64) -> Scenario {
    let mut plant = cell.plant.clone();
    let along_normal = |speed: f64| cell.twist(cell.normal.map(|part| part * speed));
    let approach_s = phase(cell, APPROACH_S, Vec::new()).duration_s;
    plant.start.contact_time_s = Some(approach_s);
    plant.start.contact_phase = numbers(seed ^ 0xa11, arm)(0.0, 1.0);
    plant.motion = Vec::new();
    for (number, speed) in TOUCHES_M_S.into_iter().enumerate() {
        let until_touch_s = if number == 0 { approach_s } else { CLEAR_M / speed };
        plant.motion.push(phase(cell, until_touch_s + PRESS_S, along_normal(-speed)));
        plant.motion.push(phase(cell, CLEAR_M / 0.1, along_normal(0.1)));
    }
    plant
}

/// Lively motion without a surface.
fn lively(cell: &Cell, seed: u64, arm: u64) -> Scenario {
    let mut plant = cell.plant.clone();
    let mut draw = numbers(seed ^ 0xa12, arm);
    plant.surface = None;
    plant.start.contact_time_s = None;
    let axes = plant.robot.task_axes as usize;
    plant.motion = Vec::new();
    for _ in 0..CHANGES {
        let part = |axis: usize| if axis < 3 { LINEAR_M_S } else { ANGULAR_RAD_S };
        let twist: Vec<f64> =
            (0..axes).map(|axis| part(axis) * draw(0.4, 1.0) * if draw(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 }).collect();
        let back = twist.iter().map(|part| -part).collect();
        let rest = || phase(cell, REST_S, vec![0.0; axes]);
        plant.motion.extend([phase(cell, CHANGE_S, twist), rest(), phase(cell, CHANGE_S, back), rest()]);
    }
    plant
}
