//! The plausible cell: the world that a careful commissioning leaves open, drawn at random, and
//! what a contact in it shows.

mod contact;
mod world;

pub(crate) use contact::Losses;
pub use contact::{Contact, Peak, outward, outward_by, press, press_seen};
pub(crate) use world::NOISE_N;
pub use world::{Cause, World};

use admittance_host::robot_description::VelocityLoopDescription;
use admittance_runner::config::{Config, ContactPointName};
use plant_sim::scenario::Scenario;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::limits::{self, Approach, Cases, Found, highest_safe, highest_safe_speed};

/// What a careful person tells a contact point within, m.
pub(crate) const CONTACT_TOLERANCE_M: f64 = 5e-4;

/// The world with a number among those of a seed, for an arm with so many joints.
pub fn world(seed: u64, index: u64, joints: usize) -> World {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(index);
    World::draw(&mut generator, joints)
}

/// The configuration at another cycle time in s and stiffness in N/m.
///
/// # Errors
/// What its checks do not accept.
pub fn config_for(base: &Config, sampling_time_s: f64, stiffness_n_m: f64) -> Result<Config, String> {
    limits::config_for(base, sampling_time_s, stiffness_n_m)
}

/// A configured cell, and the way in which its arm approaches the surface.
#[derive(Debug, Clone)]
pub struct Cell {
    /// What the controller is told.
    config: Config,
    /// What the plant is where a world does not say otherwise.
    truth: Config,
    approach: Approach,
    /// Highest safe speed in m/s with the model as told: what `admittancectl limits` names.
    pub highest_speed_m_s: f64,
}

impl Cell {
    /// The cell of a configuration at another cycle time, with the joint position at contact (rad)
    /// and the direction of the approach that `admittancectl limits` takes.
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
        Ok(Self::known(config, &approach, highest_speed_m_s))
    }

    /// The same where all of that is known.
    pub(crate) fn known(config: Config, approach: &Approach, highest_speed_m_s: f64) -> Self {
        Self { truth: config.clone(), config, approach: approach.clone(), highest_speed_m_s }
    }

    /// The same cell where the stiffness is only known to be within a factor of `within` of the one told,
    /// and the contact point within 0.5 mm. The speed stays.
    #[must_use]
    pub fn knowing_a_range(mut self, within: f64) -> Self {
        let environment = &mut self.config.environment;
        let told = environment.normal_stiffness_n_m;
        environment.stiffness_range_n_m = Some([told / within, told * within]);
        environment.contact_tolerance_m =
            (environment.contact == ContactPointName::Configured).then_some(CONTACT_TOLERANCE_M);
        environment.wrench_noise_n = world::NOISE_N;
        self
    }

    /// The same cell whose arm is told to follow up to `lag_tolerance_s` later than its model. The speed stays.
    #[must_use]
    pub fn allowing_lag(mut self, lag_tolerance_s: f64) -> Self {
        self.config.control.lag_tolerance_s = lag_tolerance_s;
        self
    }

    /// The same cell whose wrench is told to lag by up to this share longer than T_est. The speed stays.
    #[must_use]
    pub fn allowing_wrench_lag(mut self, wrench_lag_tolerance: f64) -> Self {
        self.config.contact.wrench_lag_tolerance = wrench_lag_tolerance;
        self
    }

    /// The same cell whose controller is told that the speed loops are of second order, with this damping ratio
    /// in each joint. The speed stays.
    #[must_use]
    pub fn following_with_damping(mut self, damping: f64) -> Self {
        let robot = &mut self.config.robot;
        let told = robot.velocity_loop.take();
        let (dead_time_s, report_lag_s) = told.map_or((None, 0.0), |told| (told.dead_time_s, told.report_lag_s));
        let damping = Some(vec![damping; robot.joint.len()]);
        robot.velocity_loop = Some(VelocityLoopDescription { damping, dead_time_s, report_lag_s });
        self
    }

    /// The same cell with other weights: those of the wrench (Q_w) and of the input (R), times these factors. The
    /// speed stays.
    #[must_use]
    pub fn weighing(mut self, wrench: f64, input: f64) -> Self {
        let mpc = &mut self.config.mpc;
        mpc.wrench_weight.iter_mut().for_each(|weight| *weight *= wrench);
        mpc.input_weight.iter_mut().for_each(|weight| *weight *= input);
        self
    }

    /// The highest speed, not above the one with the model as told, at which in none of so many
    /// worlds a force exceeds its limit or the controller stops. (Losses of contact do not count:
    /// they are no danger, and loops of second order have them at any speed.) `tried` is told of
    /// each contact that was simulated.
    ///
    /// # Errors
    /// What controller or plant do not accept.
    pub(crate) fn plausible_speed(
        &self,
        seed: u64,
        worlds: u64,
        threads: usize,
        tried: &(impl Fn() + Sync),
    ) -> Result<Found<String>, String> {
        let joints = self.config.robot.joint.len();
        let try_case = |speed: f64, index: u64| {
            let contact = press(&self.config, &self.scenario(&world(seed, index, joints), speed, |_| true));
            tried();
            let Ok(contact) = contact else { return Ok(Err("an approach that is out of reach".to_owned())) };
            Ok(match contact.stop_reason {
                _ if contact.is_over => Err(format!("{:.2} times the force limit", contact.peak_ratio)),
                Some(reason) => Err(format!("stop: {reason}")),
                None if !contact.is_complete => Err("no contact, or a sample that was not used".to_owned()),
                None => Ok(()),
            })
        };
        highest_safe(self.highest_speed_m_s, &Cases { count: worlds, threads, try_case })
    }

    /// The configuration, which believes what it was told.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The plant of a world in which only the causes of `is_on` differ from what was told.
    pub fn scenario(&self, world: &World, speed_m_s: f64, is_on: impl Fn(Cause) -> bool) -> Scenario {
        let mut scenario = self.approach.scenario(&self.truth, speed_m_s, world.contact_phase);
        world.apply(&mut scenario, is_on);
        scenario
    }
}
