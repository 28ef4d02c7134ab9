//! Random long contacts: arm, pose, surface, motion, and what nobody told. A contact's numbers
//! depend on the seed and its index alone.

use std::f64::consts::{PI, TAU};

use admittance_host::config::parse;
use admittance_runner::config::{Config, ContactPointName};
use admittancectl::plausible::{self, Cause};
use nalgebra::{Unit, Vector3};
use plant_sim::pose;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::{MotionSection, Scenario};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Names of the cells, which take turns.
pub(super) const CELLS: [&str; 4] =
    ["six joints, 1 ms", "seven joints, 1 ms", "six joints, 4 ms", "seven joints, 4 ms"];
const FILES: [(&str, &str); 2] = [
    (
        include_str!("../../../../../deploy/robots/six-joint.toml"),
        include_str!("../../../../../plant-sim/scenarios/six-joint.toml"),
    ),
    (
        include_str!("../../../../../deploy/robots/seven-joint.toml"),
        include_str!("../../../../../plant-sim/scenarios/seven-joint.toml"),
    ),
];
const SAMPLING_TIMES_S: [f64; 2] = [0.001, 0.004];

/// Reciprocal condition of the Jacobian at contact, at least: half of what the shipped poses have.
const LEAST_CONDITION: f64 = 0.03;
const MOST_TRIES: u32 = 100_000;
/// Stiffness along the normal in N/m, even in its logarithm.
const STIFFNESS_N_M: (f64, f64) = (1e4, 1e6);
/// The force may rise by so many newtons a second when the tool touches.
const TOUCH_N_S: f64 = 2000.0;
const FASTEST_TOUCH_M_S: f64 = 0.1;
/// The touch, from the start of the motion.
const TOUCH_S: f64 = 0.12;
/// Length of a contact in cycles.
const CYCLES: (f64, f64) = (2000.0, 6000.0);
/// Phases that a scenario takes, in pairs there and back.
const MOST_PAIRS: usize = 31;
/// A way along the surface and its speed.
const WAY_M: (f64, f64) = (0.003, 0.06);
const SLIDE_M_S: (f64, f64) = (0.005, 0.2);
/// A turn on the way.
const TURN_RAD: f64 = 0.15;
/// Pressing on while sliding, m/s.
const PRESS_M_S: f64 = 0.01;

/// A contact.
#[derive(Debug, Clone)]
pub(super) struct Draw {
    pub(super) cell: &'static str,
    pub(super) config: Config,
    pub(super) scenario: Scenario,
    /// What the plant does that the controller was not told.
    pub(super) untold: Vec<Cause>,
}

impl Draw {
    /// The contact with this index.
    ///
    /// # Errors
    /// A shipped file that cannot be used, or no pose in very many tries.
    pub(super) fn new(seed: u64, index: u64) -> Result<Self, String> {
        let cell = (index % CELLS.len() as u64) as usize;
        let (config, scenario) = FILES[cell % 2];
        let config: Config = parse(config, CELLS[cell]).map_err(|error| error.to_string())?;
        let scenario: Scenario = parse(scenario, CELLS[cell]).map_err(|error| error.to_string())?;
        let mut numbers = Numbers(ChaCha8Rng::seed_from_u64(seed));
        numbers.0.set_stream(index);
        for _ in 0..MOST_TRIES {
            let candidate = candidate(&mut numbers, &config, &scenario, SAMPLING_TIMES_S[cell / 2], (seed, index))?;
            // The plant looks for the start from which the lagging arm touches, not always with
            // success.
            if let Some((config, scenario, untold)) = candidate.filter(|(_, plant, _)| VirtualRun::new(plant).is_ok()) {
                return Ok(Self { cell: CELLS[cell], config, scenario, untold });
            }
        }
        Err(format!("contact {index} of seed {seed}: no acceptable pose in {MOST_TRIES} tries"))
    }
}

struct Numbers(ChaCha8Rng);

impl Numbers {
    fn within(&mut self, (low, high): (f64, f64)) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    fn log_within(&mut self, (low, high): (f64, f64)) -> f64 {
        self.within((low.ln(), high.ln())).exp()
    }

    /// True once in `count` times.
    fn one_in(&mut self, count: u32) -> bool {
        self.0.random_range(0..count) == 0
    }

    fn direction(&mut self) -> Vector3<f64> {
        let (height, around) = (self.within((-1.0, 1.0)), self.within((0.0, TAU)));
        let radius = (1.0 - height * height).sqrt();
        Vector3::new(radius * around.cos(), radius * around.sin(), height)
    }
}

type Candidate = Option<(Config, Scenario, Vec<Cause>)>;

fn candidate(
    numbers: &mut Numbers,
    config: &Config,
    scenario: &Scenario,
    sampling_time_s: f64,
    (seed, index): (u64, u64),
) -> Result<Candidate, String> {
    let joints = scenario.robot.joint.len();
    let position: Vec<f64> = (0..joints).map(|_| numbers.within((-PI, PI))).collect();
    let Some(pose) = pose::at(&scenario.robot, &position).filter(|pose| pose.reciprocal_condition >= LEAST_CONDITION)
    else {
        return Ok(None);
    };
    let normal = numbers.direction();
    let stiffness = numbers.log_within(STIFFNESS_N_M);
    let mut config = plausible::config_for(config, sampling_time_s, stiffness)?;
    config.environment.surface_normal = normal.into();
    config.environment.contact_point_m = Some(pose.tcp_position_m);
    if numbers.one_in(4) {
        (config.environment.contact, config.environment.contact_point_m) = (ContactPointName::Detected, None);
    }
    // As shipped, and the axis along the normal alone, and all of them.
    if numbers.one_in(8) {
        config.contact.admittance_axes = (0..6).map(|axis| axis == normal.iamax()).collect();
    } else if numbers.one_in(8) {
        config.contact.admittance_axes = vec![true; 6];
    }
    // As shipped, and up to the hard weights that the first version had.
    if numbers.one_in(2) {
        config.mpc.wrench_weight = vec![numbers.log_within((1e-5, 1e-2)); 6];
    }
    if numbers.one_in(4) {
        config.contact.normal_force_reference_n = numbers.within((5.0, 60.0));
    }
    let mut scenario = scenario.clone();
    let timing = &mut scenario.timing;
    (timing.sampling_time_s, timing.settle_s) = (sampling_time_s, 2.0 * sampling_time_s);
    timing.command_delay_s = config.control.command_delay_s;
    timing.substep_s = sampling_time_s / 10.0;
    scenario.start.joint_position_rad = position;
    scenario.start.contact_time_s = Some(TOUCH_S);
    scenario.start.contact_phase = numbers.within((0.0, 1.0));
    if let Some(surface) = &mut scenario.surface {
        (surface.point_m, surface.normal, surface.stiffness_n_m) = (pose.tcp_position_m, normal.into(), stiffness);
    }
    scenario.motion = motion(numbers, &normal, stiffness, sampling_time_s);
    let world = plausible::world(seed, index, joints);
    let untold: Vec<Cause> = Cause::ALL.into_iter().filter(|_| numbers.one_in(3)).collect();
    let told = numbers.one_in(4);
    let untold = if told { Vec::new() } else { untold };
    world.apply(&mut scenario, |cause| untold.contains(&cause));
    if untold.contains(&Cause::Noise) && numbers.one_in(2) {
        (scenario.noise.joint_position_rad, scenario.noise.joint_velocity_rad_s) = (1e-5, 0.002);
    }
    Ok(Some((config, scenario, untold)))
}

/// A touch, and ways along the surface, there and back.
fn motion(numbers: &mut Numbers, normal: &Vector3<f64>, stiffness: f64, sampling_time_s: f64) -> Vec<MotionSection> {
    let touch = numbers.within((0.3, 1.0)) * (TOUCH_N_S / stiffness).min(FASTEST_TOUCH_M_S);
    let whole_cycles = |time_s: f64| (time_s / sampling_time_s).ceil() * sampling_time_s;
    let phase = |duration_s: f64, speed: Vector3<f64>, turn: Vector3<f64>| MotionSection {
        duration_s,
        twist: speed.iter().chain(turn.iter()).copied().collect(),
        beside_rad_s: None,
    };
    let mut left_s = sampling_time_s * numbers.within(CYCLES);
    let mut phases = vec![phase(whole_cycles(TOUCH_S + 0.1), normal * -touch, Vector3::zeros())];
    for _ in 0..MOST_PAIRS {
        if left_s <= 0.0 {
            break;
        }
        let along = Unit::new_normalize(numbers.direction().cross(normal)).into_inner();
        let (way, speed) = (numbers.within(WAY_M), numbers.log_within(SLIDE_M_S));
        let duration_s = whole_cycles((way / speed).clamp(50.0 * sampling_time_s, 400.0 * sampling_time_s));
        let turn =
            if numbers.one_in(2) { numbers.direction() * numbers.within((0.0, TURN_RAD)) } else { Vector3::zeros() };
        let press = if numbers.one_in(2) { numbers.within((0.0, PRESS_M_S)).min(touch) } else { 0.0 };
        // Now and then it lifts off and touches again.
        let (there, back) = if numbers.one_in(8) { (touch, -touch) } else { (-press, -press) };
        let along = along * (way / duration_s).min(speed);
        let turn = turn / duration_s;
        phases.push(phase(duration_s, along + normal * there, turn));
        phases.push(phase(duration_s, normal * back - along, -turn));
        left_s -= 2.0 * duration_s;
    }
    phases
}

#[cfg(test)]
mod tests {
    use admittance_host::config::Section;

    use super::*;

    #[test]
    fn every_draw_is_accepted_and_depends_on_seed_and_index_alone() {
        for index in 0..60 {
            let Draw { config, scenario, untold, .. } = Draw::new(5, index).unwrap();
            let mut errors = Vec::new();
            config.check("", &mut errors);
            scenario.check("", &mut errors);
            assert!(errors.is_empty(), "contact {index}: {errors:?}");
            admittance_runner::cycle::build(&config).unwrap();
            let again = Draw::new(5, index).unwrap();
            assert_eq!((&config, &scenario, &untold), (&again.config, &again.scenario, &again.untold));
            assert_ne!(scenario.motion, Draw::new(6, index).unwrap().scenario.motion);
        }
    }
}
