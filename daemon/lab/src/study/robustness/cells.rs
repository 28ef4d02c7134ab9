//! The cells of the study: the shipped ones, at two cycle times.

use admittance_host::config::parse;
use admittance_runner::config::{Config, GivenInName, WrenchSection};
use admittancectl::parallel;
use admittancectl::plausible::Cell;
use plant_sim::scenario::Scenario;

/// Instants of contact within a cycle at which the speed that `limits` names is safe: its default.
const INSTANTS: u32 = 16;

/// Names of the cells.
pub(super) const NAMES: [&str; 6] = [
    "planar, 4 ms",
    "planar, 1 ms",
    "six joints, 4 ms",
    "six joints, 1 ms",
    "seven joints, 4 ms",
    "seven joints, 1 ms",
];

/// Controller and plant, and T_s in s, of the cell with a number.
fn files(index: usize) -> (&'static str, &'static str, f64) {
    let (config, scenario) = match index / 2 {
        0 => (
            include_str!("../../../../../deploy/demo/mpc-default.toml"),
            include_str!("../../../../../plant-sim/scenarios/paper.toml"),
        ),
        1 => (
            include_str!("../../../../../deploy/robots/six-joint.toml"),
            include_str!("../../../../../plant-sim/scenarios/six-joint.toml"),
        ),
        _ => (
            include_str!("../../../../../deploy/robots/seven-joint.toml"),
            include_str!("../../../../../plant-sim/scenarios/seven-joint.toml"),
        ),
    };
    (config, scenario, [0.004, 0.001][index % 2])
}

/// A tool of 2 kg, as long as a hand, on a sensor at the flange, told as it is. A planar arm
/// stands, so that weight acts in its plane as well.
fn with_a_tool(wrench: &WrenchSection, planar: bool) -> WrenchSection {
    let along = if planar { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] };
    WrenchSection {
        given_in: GivenInName::Sensor,
        sensor_origin_m: along.map(|share| -0.15 * share),
        tool_mass_kg: 2.0,
        tool_center_of_gravity_m: along.map(|share| -0.08 * share),
        gravity_m_s2: if planar { [0.0, -9.81, 0.0] } else { [0.0, 0.0, -9.81] },
        ..wrench.clone()
    }
}

/// The cells with these names, each with the highest speed that is safe with the model as told.
///
/// # Errors
/// A shipped file that cannot be simulated.
pub(super) fn with_speeds(names: &[&str], threads: usize) -> Result<Vec<(&'static str, Cell)>, String> {
    let wanted: Vec<usize> = (0..NAMES.len()).filter(|&index| names.contains(&NAMES[index])).collect();
    parallel::map(wanted.len() as u64, threads, "cells", |index| {
        let index = wanted[index as usize];
        let (config, scenario, sampling_time_s) = files(index);
        let mut config: Config = parse(config, NAMES[index]).map_err(|error| error.to_string())?;
        let scenario: Scenario = parse(scenario, NAMES[index]).map_err(|error| error.to_string())?;
        let planar = scenario.robot.task_axes == 2;
        config.wrench = with_a_tool(&config.wrench, planar);
        // A planar arm's pose follows from the contact point.
        let joints = Some(scenario.start.joint_position_rad.as_slice()).filter(|_| !planar);
        let direction = scenario.motion.first().map(|motion| &motion.twist[..if planar { 2 } else { 3 }]);
        let cell = Cell::new(&config, sampling_time_s, joints, direction, INSTANTS);
        cell.map(|cell| (NAMES[index], cell)).map_err(|why| format!("{}: {why}", NAMES[index]))
    })
}
