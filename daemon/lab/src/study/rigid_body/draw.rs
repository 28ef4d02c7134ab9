//! Random arms with masses, and what a maker's sheet tells of them; a surface for each, and contacts.

use admittance_host::config::parse;
use plant_sim::environment::{HardeningSection, HuntCrossleySection};
use plant_sim::rigid_body::{DriveSection, RigidBodySection, RigidJointSection};
use plant_sim::scenario::{MotionSection, Scenario};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use toml::{Table, Value};

use crate::keys::set;

/// The kinds of arms, which take turns.
pub(super) const KINDS: [&str; 3] = ["planar", "six joints", "seven joints"];
/// Cycle times in s.
const SAMPLING_TIMES_S: [f64; 3] = [0.001, 0.002, 0.004];
/// Surfaces, N/m.
const STIFFNESS_N_M: (f64, f64) = (1e4, 1e6);
const SPEED_M_S: (f64, f64) = (0.02, 0.4);
const LIMIT_N: (f64, f64) = (60.0, 300.0);
/// How far masses and gears may be from what the maker's sheet tells, as factors.
const SHEET_MASS: (f64, f64) = (0.9, 1.1);
const SHEET_GEAR: (f64, f64) = (0.8, 1.25);
const NOISE_N: f64 = 0.3;
/// Torque limits of the joints in N m, which the rest of a joint goes with.
const TORQUES_N_M: [&[f64]; 3] =
    [&[400.0, 200.0], &[330.0, 330.0, 150.0, 56.0, 56.0, 56.0], &[320.0, 320.0, 176.0, 176.0, 110.0, 80.0, 80.0]];

/// What makes this world another one than that of (4) and a plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Cause {
    /// Gears give.
    Gears,
    /// Friction of the joints.
    JointFriction,
    /// Torque limits, and what the drives' model is off by.
    Drives,
    /// A surface that hardens, or is damped as Hunt and Crossley say.
    SurfaceLaw,
    /// Friction on the surface.
    SurfaceFriction,
    /// A surface that is tilted, or bent.
    Shape,
    /// Noise of the wrench.
    Noise,
}

impl Cause {
    pub(super) const ALL: [Self; 7] = [
        Self::Gears,
        Self::JointFriction,
        Self::Drives,
        Self::SurfaceLaw,
        Self::SurfaceFriction,
        Self::Shape,
        Self::Noise,
    ];

    /// Takes it out of a scenario.
    pub(super) fn remove(self, scenario: &mut Scenario, told_normal: [f64; 3]) {
        if let Some(arm) = &mut scenario.rigid_body {
            for joint in &mut arm.joint {
                match self {
                    Self::Gears => joint.gear_stiffness_n_m_rad = None,
                    Self::JointFriction => {
                        (joint.viscous_friction_n_m_s_rad, joint.coulomb_friction_n_m) = (0.0, 0.0);
                        joint.breakaway_friction_n_m = None;
                    }
                    Self::Drives => joint.torque_limit_n_m = None,
                    _ => {}
                }
            }
            if self == Self::Drives {
                arm.drive.feed_forward_factor = 1.0;
            }
        }
        if let Some(surface) = &mut scenario.surface {
            match self {
                Self::SurfaceLaw => (surface.hardening, surface.hunt_crossley) = (None, None),
                Self::SurfaceFriction => surface.friction = 0.0,
                Self::Shape => (surface.curvature_1_m, surface.normal) = (0.0, told_normal),
                _ => {}
            }
        }
        if self == Self::Noise {
            scenario.noise.wrench = 0.0;
        }
    }
}

/// An arm in its cell.
#[derive(Debug, Clone)]
pub(super) struct Cell {
    pub(super) kind: &'static str,
    /// The plant as it is; its motion means nothing.
    pub(super) plant: Scenario,
    /// What the daemon is told before anything is identified.
    pub(super) told: Table,
    /// Of length 1.
    pub(super) normal: [f64; 3],
}

/// A contact of an arm.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Contact {
    pub(super) speed_m_s: f64,
    pub(super) limit_n: f64,
    phase: f64,
    /// How far the approach leans along the surface, and where to.
    lean: f64,
    towards: f64,
}

/// Random numbers of a stream of a seed.
pub(super) fn numbers(seed: u64, stream: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(stream);
    move |low, high| low + (high - low) * generator.random::<f64>()
}

fn log_uniform(draw: &mut impl FnMut(f64, f64) -> f64, (low, high): (f64, f64)) -> f64 {
    (low.ln() + (high / low).ln() * draw(0.0, 1.0)).exp()
}

fn files(kind: usize) -> (&'static str, &'static str) {
    match kind {
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
    }
}

fn list(values: impl IntoIterator<Item = f64>) -> Value {
    Value::Array(values.into_iter().map(Value::Float).collect())
}

impl Cell {
    /// The arm with a number among those of a kind.
    ///
    /// # Errors
    /// A shipped file that is none.
    pub(super) fn draw(seed: u64, kind: usize, arm: u64) -> Result<Self, String> {
        let mut draw = numbers(seed, arm * KINDS.len() as u64 + kind as u64);
        let (config, scenario) = files(kind);
        let mut plant: Scenario = parse(scenario, KINDS[kind]).map_err(|error| error.to_string())?;
        let mut told: Table = config.parse().map_err(|error: toml::de::Error| error.to_string())?;
        let cycle_s = SAMPLING_TIMES_S[(draw(0.0, 3.0) as usize).min(2)];
        set_cycle(&mut told, &mut plant, cycle_s);
        plant.timing.command_delay_s += draw(0.0, 0.001).min(0.5 * cycle_s);
        plant.timing.settle_s = 0.02;
        plant.timing.substep_s = 0.000_125;
        plant.noise.wrench = NOISE_N;
        plant.noise.seed = (draw(0.0, 1e9)) as u64;
        plant.wrench.time_constant_s.iter_mut().for_each(|lag| *lag *= draw(0.75, 1.25));
        let lag = plant.wrench.time_constant_s[0];
        plant.wrench.time_constant_s.fill(lag);
        for lag in &mut plant.robot.velocity_time_constant_s {
            *lag *= draw(0.75, 1.25);
        }
        plant.start.joint_position_rad.iter_mut().for_each(|angle| *angle += draw(-0.15, 0.15));
        let planar = plant.robot.task_axes == 2;
        let (body, sheet) = masses(&mut draw, &plant, kind, planar);
        plant.rigid_body = Some(body);
        told.insert("dynamics".to_owned(), sheet);
        let point = plant_sim::pose::at(&plant.robot, &plant.start.joint_position_rad)
            .ok_or("an arm that the plant does not know")?
            .tcp_position_m;
        let normal = self::surface(&mut draw, &mut plant, point);
        set(&mut told, "environment", "contact", "detected");
        set(&mut told, "environment", "wrench_noise_n", NOISE_N);
        set(&mut told, "environment", "surface_normal", list(normal));
        set(&mut told, "environment", "contact_point_m", list(point));
        Ok(Self { kind: KINDS[kind], plant, told, normal })
    }

    /// The plant of a contact.
    pub(super) fn scenario(&self, contact: &Contact) -> Scenario {
        let mut plant = self.plant.clone();
        let cycle_s = plant.timing.sampling_time_s;
        let whole = |time_s: f64| (time_s / cycle_s).ceil() * cycle_s;
        let approach_s = whole(0.25);
        plant.start.contact_time_s = Some(approach_s);
        plant.start.contact_phase = contact.phase;
        let along = self.along(contact.towards).map(|part| part * contact.lean);
        let twist = self.twist(std::array::from_fn(|axis| contact.speed_m_s * (along[axis] - self.normal[axis])));
        let duration_s = approach_s + whole(0.25);
        plant.motion = vec![MotionSection { duration_s, twist, beside_rad_s: None }];
        plant
    }

    /// A direction along the surface.
    fn along(&self, towards: f64) -> [f64; 3] {
        let [x, y, z] = self.normal;
        if self.plant.robot.task_axes == 2 {
            let sign = if towards < std::f64::consts::PI { 1.0 } else { -1.0 };
            return [sign * y, -sign * x, 0.0];
        }
        let n = nalgebra::Vector3::new(x, y, z);
        let across = n.cross(&nalgebra::Vector3::from_fn(|axis, _| f64::from(u8::from(axis == n.iamin())))).normalize();
        (across * towards.cos() + n.cross(&across) * towards.sin()).into()
    }

    /// A linear velocity as a twist of the arm's axes.
    pub(super) fn twist(&self, linear: [f64; 3]) -> Vec<f64> {
        let axes = self.plant.robot.task_axes as usize;
        (0..axes).map(|axis| linear.get(axis).copied().filter(|_| axis < 3).unwrap_or(0.0)).collect()
    }
}

impl Contact {
    /// The contact with a number.
    pub(super) fn draw(seed: u64, index: u64) -> Self {
        let mut draw = numbers(seed ^ 0x5eed, index);
        Self {
            speed_m_s: log_uniform(&mut draw, SPEED_M_S),
            limit_n: log_uniform(&mut draw, LIMIT_N),
            phase: draw(0.0, 1.0),
            lean: draw(0.0, 1.0),
            towards: draw(0.0, std::f64::consts::TAU),
        }
    }
}

fn set_cycle(told: &mut Table, plant: &mut Scenario, cycle_s: f64) {
    set(told, "control", "sampling_time_s", cycle_s);
    set(told, "control", "max_sample_age_s", 3.0 * cycle_s);
    set(told, "control", "answer_budget_s", 0.4 * cycle_s);
    set(told, "control", "spin_s", 0.25 * cycle_s);
    plant.timing.sampling_time_s = cycle_s;
}

/// Links as rods of random masses, and all of a joint that goes with its torque; and the sheet that tells them.
fn masses(
    draw: &mut impl FnMut(f64, f64) -> f64,
    plant: &Scenario,
    kind: usize,
    planar: bool,
) -> (RigidBodySection, Value) {
    let joints = &plant.robot.joint;
    let gives = draw(0.0, 1.0) < 0.8;
    let gear = log_uniform(draw, (0.5, 2.0));
    let mut sheet = Vec::new();
    let mut body = Vec::new();
    for (index, torque) in TORQUES_N_M[kind].iter().enumerate() {
        let torque = torque * draw(0.8, 1.25);
        let end = joints.get(index + 1).map_or(plant.robot.tool.origin_m, |next| next.origin_m);
        let length = end.iter().map(|part| part * part).sum::<f64>().sqrt();
        let mass = draw(0.7, 1.4) * (0.01 * torque + 12.0 * length * torque / (torque + 100.0)).max(0.8);
        let radius = 0.05;
        // A rod along the way to the next joint.
        let along = end.map(|part| part / length.max(1e-6));
        let (across, axial) = (mass * (length * length / 12.0 + radius * radius / 4.0), 0.5 * mass * radius * radius);
        let tensor = |i: usize, k: usize| f64::from(u8::from(i == k)) * across + (axial - across) * along[i] * along[k];
        let inertia = [tensor(0, 0), tensor(1, 1), tensor(2, 2), tensor(0, 1), tensor(0, 2), tensor(1, 2)];
        let center = end.map(|part| part * draw(0.4, 0.6));
        let stiffness = gives.then(|| 120.0 * torque * gear * draw(0.8, 1.25));
        let ratio = 101.0;
        let rotor = draw(0.7, 1.4) * 0.0055 * torque / (ratio * ratio);
        let friction = draw(0.5, 1.5);
        body.push(RigidJointSection {
            mass_kg: mass,
            center_of_gravity_m: center,
            inertia_kg_m2: inertia,
            rotor_inertia_kg_m2: rotor,
            gear_ratio: ratio,
            gear_stiffness_n_m_rad: stiffness,
            gear_damping_n_m_s_rad: stiffness.map_or(0.0, |stiffness| 0.001 * stiffness),
            viscous_friction_n_m_s_rad: 0.036 * torque * friction,
            coulomb_friction_n_m: 0.04 * torque * friction,
            breakaway_friction_n_m: Some(0.06 * torque * friction),
            stribeck_velocity_rad_s: 0.05,
            slip_velocity_rad_s: 0.001,
            torque_limit_n_m: Some(torque),
            speed_gain_n_m_s_rad: draw(0.8, 1.4) * torque,
            encoder_counts: Some(131_072),
        });
        let told = draw(SHEET_MASS.0, SHEET_MASS.1);
        let mut joint = Table::new();
        let mut tell = |key: &str, value: Value| joint.insert(key.to_owned(), value);
        tell("mass_kg", (mass * told).into());
        tell("center_of_gravity_m", list(center));
        tell("inertia_kg_m2", list(inertia.map(|element| element * told)));
        tell("rotor_inertia_kg_m2", rotor.into());
        tell("gear_ratio", ratio.into());
        if let Some(stiffness) = stiffness {
            tell("gear_stiffness_n_m_rad", (stiffness * draw(SHEET_GEAR.0, SHEET_GEAR.1)).into());
        }
        tell("viscous_friction_n_m_s_rad", 0.0.into());
        tell("coulomb_friction_n_m", 0.0.into());
        sheet.push(Value::Table(joint));
    }
    let drive =
        DriveSection { rate_hz: 8000.0, integral_time_s: draw(0.015, 0.04), feed_forward_factor: draw(0.8, 1.0) };
    // A planar arm lies.
    let gravity_m_s2 = [0.0, 0.0, if planar { 0.0 } else { -9.81 }];
    let dynamics = Table::from_iter([("joint".to_owned(), Value::Array(sheet))]);
    (RigidBodySection { gravity_m_s2, joint: body, drive }, Value::Table(dynamics))
}

/// A surface through a point. The normal that is told: up to a degree from the true one.
fn surface(draw: &mut impl FnMut(f64, f64) -> f64, plant: &mut Scenario, point_m: [f64; 3]) -> [f64; 3] {
    let planar = plant.robot.task_axes == 2;
    let Some(surface) = &mut plant.surface else { return [0.0, 0.0, 1.0] };
    let normal = nalgebra::Vector3::from(surface.normal).normalize();
    surface.point_m = point_m;
    surface.stiffness_n_m = log_uniform(draw, STIFFNESS_N_M);
    surface.friction = draw(0.0, 0.3);
    let law = draw(0.0, 1.0);
    if law < 0.2 {
        surface.hardening = Some(HardeningSection { depth_m: draw(1.0, 3.0) * 200.0 / surface.stiffness_n_m });
    } else if law < 0.4 {
        let depth_m = 100.0 / surface.stiffness_n_m;
        surface.hunt_crossley = Some(HuntCrossleySection { exponent: 1.5, depth_m, damping_s_m: draw(0.0, 1.0) });
    }
    if draw(0.0, 1.0) < 0.3 {
        surface.curvature_1_m = 1.0 / draw(0.2, 2.0);
        surface.axis = if planar { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    }
    let tilt = draw(-1.0, 1.0_f64).to_radians();
    let about = if planar { nalgebra::Vector3::z_axis() } else { nalgebra::Vector3::y_axis() };
    (nalgebra::Rotation3::from_axis_angle(&about, tilt) * normal).into()
}

impl Cell {
    /// What was told, with surface, masses, gears, lags and delay as they are: what is left then is not ignorance.
    pub(super) fn as_it_is(&self, told: &Table) -> Table {
        let mut told = told.clone();
        let joints = self.plant.rigid_body.iter().flat_map(|arm| &arm.joint);
        let sheet = told.get_mut("dynamics").and_then(|section| section.get_mut("joint")).and_then(Value::as_array_mut);
        for (joint, told) in joints.zip(sheet.into_iter().flatten().filter_map(Value::as_table_mut)) {
            told.insert("mass_kg".to_owned(), joint.mass_kg.into());
            told.insert("inertia_kg_m2".to_owned(), list(joint.inertia_kg_m2));
            if let Some(stiffness) = joint.gear_stiffness_n_m_rad {
                told.insert("gear_stiffness_n_m_rad".to_owned(), stiffness.into());
            }
        }
        if let Some(surface) = &self.plant.surface {
            for key in ["impact_stiffness_n_m", "most_impact_stiffness_n_m"] {
                set(&mut told, "environment", key, surface.stiffness_n_m);
            }
            set(&mut told, "environment", "surface_normal", list(surface.normal));
        }
        set(&mut told, "contact", "wrench_time_constant_s", list(self.plant.wrench.time_constant_s.clone()));
        set(&mut told, "contact", "wrench_dead_time_s", self.plant.wrench.delay_s);
        set(&mut told, "control", "command_delay_s", self.plant.timing.command_delay_s);
        told
    }
}
