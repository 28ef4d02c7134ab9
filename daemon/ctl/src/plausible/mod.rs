//! The plausible cell: the world that a careful commissioning leaves open, drawn at random, and what
//! a contact in it shows.

mod contact;
mod world;

pub use contact::{Contact, press};
pub use world::{Cause, World};

use admittance_runner::config::Config;
use plant_sim::scenario::Scenario;

use crate::limits::{Approach, highest_safe_speed};

/// A configured cell, and the way in which its arm approaches the surface.
#[derive(Debug, Clone)]
pub struct Cell {
    config: Config,
    approach: Approach,
    /// Highest safe speed in m/s with the model as told: what `admittancectl limits` names.
    pub highest_speed_m_s: f64,
}

impl Cell {
    /// The cell of a configuration at another cycle time, with the joint position at contact (rad) and
    /// the direction of the approach that `admittancectl limits` takes.
    ///
    /// # Errors
    /// What cannot be simulated, and a cell without a safe speed.
    pub fn new(
        base: &Config,
        sampling_time_s: f64,
        joints: Option<&[f64]>,
        direction: Option<&[f64]>,
        instants: u32,
    ) -> Result<Self, String> {
        let approach = Approach::new(base, joints, direction).map_err(|(_, why)| why)?;
        let (config, highest_speed_m_s) = highest_safe_speed(base, &approach, sampling_time_s, instants)?;
        Ok(Self { config, approach, highest_speed_m_s })
    }

    /// The configuration, which believes what it was told.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The plant of a world in which only the causes of `is_on` differ from what was told.
    pub fn scenario(&self, world: &World, speed_m_s: f64, is_on: impl Fn(Cause) -> bool) -> Scenario {
        let mut scenario = self.approach.scenario(&self.config, speed_m_s, world.contact_phase);
        world.apply(&mut scenario, is_on);
        scenario
    }
}
