//! The cells that are attacked: shipped arms with what a busy machine needs.

use admittance_runner::config::Config;
use plant_sim::scenario::Scenario;
use rand::{Rng, RngExt as _};
use toml::{Table, Value};

use super::arena::parsed;
use crate::keys::{self, set};
use admittancectl::{Exit, Outcome};

/// Configuration and scenario of an arm; whether its rate may be another one.
const ARMS: [(&str, &str, bool); 3] = [
    (
        include_str!("../../../../deploy/robots/planar.toml"),
        include_str!("../../../../plant-sim/scenarios/paper.toml"),
        true,
    ),
    (
        include_str!("../../../../deploy/robots/six-joint.toml"),
        include_str!("../../../../plant-sim/scenarios/six-joint.toml"),
        false,
    ),
    (
        include_str!("../../../../deploy/robots/seven-joint.toml"),
        include_str!("../../../../plant-sim/scenarios/seven-joint.toml"),
        false,
    ),
];
/// Sampling times of the planar arm, s.
const RATES: [f64; 3] = [0.001, 0.002, 0.004];
/// How long samples may fail to come, s: the machine may be busy with other things.
const PATIENT_S: f64 = 0.1;

/// A cell as drawn.
pub(crate) struct Cell {
    /// The daemon's configuration.
    pub(crate) text: String,
    pub(crate) config: Config,
    /// What touches the surface; and the same arm at rest in the air.
    pub(crate) touch: Table,
    pub(crate) air: Scenario,
    pub(crate) air_text: String,
}

impl Cell {
    /// Every second one is the planar arm, whose rate and detection vary.
    pub(crate) fn draw(random: &mut impl Rng) -> Outcome<Self> {
        let (config, scenario, any_rate) = ARMS[[0, 0, 1, 2][random.random_range(0..4)]];
        let mut config = keys::parsed(config)?;
        let mut touch = keys::parsed(scenario)?;
        let shipped = config["control"]["sampling_time_s"].as_float().unwrap_or(RATES[0]);
        let period = if any_rate { RATES[random.random_range(0..RATES.len())] } else { shipped };
        let delay = period * 0.5;
        let control = [
            ("sampling_time_s", period.into()),
            ("command_delay_s", delay.into()),
            ("answer_budget_s", delay.into()),
            ("spin_s", (period * 0.05).into()),
            ("max_sample_age_s", PATIENT_S.into()),
            ("max_consecutive_fallbacks", 20.into()),
        ];
        control.into_iter().for_each(|(key, value): (&str, Value)| set(&mut config, "control", key, value));
        for table in [&mut config, &mut touch] {
            set(table, "ipc", "instance", "planar");
        }
        if random.random_bool(0.25) {
            set(&mut config, "environment", "contact", "detected");
        }
        for (key, value) in [("sampling_time_s", period), ("command_delay_s", delay), ("settle_s", 0.05)] {
            set(&mut touch, "timing", key, value);
        }
        set(&mut touch, "start", "contact_time_s", 0.2);
        let mut air = touch.clone();
        air.remove("surface");
        if let Some(Value::Table(start)) = air.get_mut("start") {
            start.remove("contact_time_s");
        }
        still(&mut air);
        let text = config.to_string();
        Ok(Self { config: parsed(&text)?, text, touch, air: scenario_of(&air)?, air_text: air.to_string() })
    }

    /// A touch at a drawn speed and instant.
    pub(crate) fn touch(&self, random: &mut impl Rng) -> Outcome<Scenario> {
        let mut touch = self.touch.clone();
        set(&mut touch, "start", "contact_phase", random.random_range(0.0..1.0));
        let factor: f64 = random.random_range(0.2..1.5);
        for phase in touch.get_mut("motion").and_then(Value::as_array_mut).into_iter().flatten() {
            for speed in phase.get_mut("twist").and_then(Value::as_array_mut).into_iter().flatten() {
                *speed = (speed.as_float().unwrap_or(0.0) * factor).into();
            }
        }
        scenario_of(&touch)
    }
}

/// Leaves nothing of a motion but time.
fn still(scenario: &mut Table) {
    let motion = scenario.get_mut("motion").and_then(Value::as_array_mut);
    for phase in motion.into_iter().flatten().filter_map(Value::as_table_mut) {
        phase.insert("duration_s".to_owned(), 1000.0.into());
        for speed in phase.get_mut("twist").and_then(Value::as_array_mut).into_iter().flatten() {
            *speed = 0.0.into();
        }
    }
}

fn scenario_of(table: &Table) -> Outcome<Scenario> {
    let parsed = admittance_host::config::parse(&table.to_string(), "scenario.toml");
    parsed.map_err(|error| (Exit::Internal, error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng as _;

    #[test]
    fn every_cell_that_is_drawn_has_a_daemon_and_a_plant() {
        let mut arms = std::collections::BTreeSet::new();
        for seed in 0..24 {
            let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            let cell = Cell::draw(&mut random).expect("valid");
            admittance_runner::cycle::build(&cell.config).expect("a controller");
            plant_sim::run::VirtualRun::new(&cell.air).expect("a plant in the air");
            plant_sim::run::VirtualRun::new(&cell.touch(&mut random).expect("valid")).expect("a plant that touches");
            arms.insert((cell.config.robot.joint.len(), cell.config.environment.contact_point_m.is_some()));
        }
        assert!(arms.len() >= 3, "{arms:?}");
    }
}
