//! From a scenario to a plant: units, and the start pose that makes the contact come at the instant
//! asked for.

use admittance_core::quantities::Span;
use admittance_core::robot::{Chain, DynamicsError, Pose, SUPPORTED_ARMS};
use nalgebra::{SVector, Vector3};

use crate::environment::SurfaceSection;
use crate::faults::{Fault, Faults};
use crate::joint_loop::JointLoop;
use crate::joints::Joints;
use crate::motion::{Commanded, CommandedMotion, MINIMUM_RECIPROCAL_CONDITION};
use crate::noise::{Noise, NoiseLevels};
use crate::plant::{Plant, PlantParameters};
use crate::rigid_body::{Overload, Spring, Unresolved};
use crate::scenario::{FollowsName, Scenario};
use crate::seconds;
use crate::wrench_estimate::WrenchEstimate;
use crate::wrench_sensor::WrenchSensor;

/// Why a scenario that passed its checks cannot be set up.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// Joints and task axes are not one of the pairs that the plant knows.
    #[error("robot: {joints} joints with {axes} task axes: accepted are {}", SUPPORTED_ARMS)]
    Arm {
        /// Joints.
        joints: usize,
        /// Task axes.
        axes: u32,
    },
    /// The masses are those of no arm.
    #[error("rigid_body: {0}")]
    Masses(#[from] DynamicsError),
    /// Its steps are too long for it.
    #[error(transparent)]
    Unresolved(#[from] Unresolved),
    /// A drive does not hold the arm where it starts, and no start was found for the contact.
    #[error("start.contact_time_s: no start was found from which the motion touches then: {0}")]
    Overloaded(Overload),
    /// The arm starts where J has no inverse.
    #[error(
        "start.joint_position_rad = {position:?}: J is not invertible there (reciprocal condition {found:.1e}, accepted: at \
         least {MINIMUM_RECIPROCAL_CONDITION:.1e}): bend the arm"
    )]
    SingularStart {
        /// The joint position in rad.
        position: Vec<f64>,
        /// Reciprocal condition number.
        found: f64,
    },
    /// No start pose brings the contact at the instant asked for.
    #[error(
        "start.contact_time_s = {contact_time_s}: no start was found from which the motion touches surface.point_m = {point_m:?} \
         then{}; move the point into reach, or start.joint_position_rad closer to the pose at contact", by_plate(.carried_m)
    )]
    Unreachable {
        /// The time in s.
        contact_time_s: f64,
        /// As the scenario has it, in m.
        point_m: [f64; 3],
        /// How far [surface.plate] has carried it by then along the normal, in m; `None` at rest.
        carried_m: Option<f64>,
    },
    /// The start that meets the point at that instant does not come from outside the surface.
    #[error(
        "start.contact_time_s = {contact_time_s}: the motion does not come from outside the surface to surface.point_m = \
         {point_m:?} then{}: let motion[..].twist lead against surface.normal, faster than a plate that goes away, or leave \
         contact_time_s out to start in contact", by_plate(.carried_m)
    )]
    NotApproaching {
        /// The time in s.
        contact_time_s: f64,
        /// As the scenario has it, in m.
        point_m: [f64; 3],
        /// How far [surface.plate] has carried it by then along the normal, in m; `None` at rest.
        carried_m: Option<f64>,
    },
}

/// What the plate has to do with it.
fn by_plate(carried_m: &Option<f64>) -> String {
    carried_m.map_or_else(String::new, |way| {
        format!(
            ", which [surface.plate] (velocity_m_s, amplitude_m) has by then carried {way:.4} m along surface.normal"
        )
    })
}

const START_ITERATIONS: usize = 12;
/// Distance in m from the contact point at the instant of contact that is near enough: 1 nm.
const START_TOLERANCE_M: f64 = 1e-9;

fn nanoseconds(seconds: f64) -> u64 {
    Span::from_seconds(seconds).nanoseconds()
}

/// Whole samples in `seconds`.
fn samples(seconds: f64, sampling_time_s: f64) -> i64 {
    (seconds / sampling_time_s).round() as i64
}

/// The plant of a scenario, with its first sample stamped `first_stamp_ns`. With `wait_for_command`
/// the motion starts only after the first valid command.
///
/// # Errors
/// [`SetupError`].
pub fn plant<const N: usize, const D: usize>(
    scenario: &Scenario,
    first_stamp_ns: u64,
    boot_id: u64,
    wait_for_command: bool,
) -> Result<Plant<N, D>, SetupError> {
    let axes = scenario.robot.task_axes;
    let wrong_arm = SetupError::Arm { joints: scenario.robot.joint.len(), axes };
    let chain = scenario.robot.chain::<N>().filter(|_| axes as usize == D).ok_or(wrong_arm.clone())?;
    let timing = &scenario.timing;
    let in_samples = |seconds| samples(seconds, timing.sampling_time_s);
    let vector = |values: &[f64]| SVector::<f64, D>::from_column_slice(values);
    let joints = |values: &[f64]| SVector::<f64, N>::from_column_slice(values);
    let loops = scenario.robot.velocity_loops::<N>().ok_or(wrong_arm.clone())?;
    let start = joints(&scenario.start.joint_position_rad);
    let parameters = PlantParameters {
        joints: match &scenario.rigid_body {
            None => Joints::FirstOrder(JointLoop::new(loops.time_constant, loops.damping)),
            Some(section) => {
                let arm = section.arm(&chain, loops.time_constant, &start).ok_or(wrong_arm)??;
                Joints::RigidBody(Box::new(arm))
            }
        },
        dead_time_ns: std::array::from_fn(|joint| nanoseconds(loops.dead_time[joint])),
        velocity_lag_s: loops.report_lag,
        drives: scenario.drives.as_ref().map(|drives| drives.drives(nanoseconds(timing.sampling_time_s))),
        start,
        surface: scenario.surface.as_ref().map(SurfaceSection::surface),
        estimate: WrenchEstimate::new(vector(&scenario.wrench.time_constant_s)),
        sensor: scenario.sensor.as_ref().map(WrenchSensor::new),
        wrench_delay_ns: nanoseconds(scenario.wrench.delay_s),
        noise: Noise::new(
            NoiseLevels {
                joint_position: scenario.noise.joint_position_rad,
                joint_velocity: scenario.noise.joint_velocity_rad_s,
                wrench: scenario.noise.wrench,
            },
            scenario.noise.seed,
        ),
        motion: CommandedMotion::new(scenario.motion.iter().map(|phase| {
            let beside = phase.beside_rad_s.as_deref().map_or_else(SVector::zeros, joints);
            (in_samples(phase.duration_s), Commanded { twist: vector(&phase.twist), beside })
        })),
        follows_joint_velocity: scenario.controller.follows == FollowsName::JointVelocity,
        faults: Faults::new(
            scenario
                .fault
                .iter()
                .map(|fault| Fault {
                    kind: fault.kind,
                    first: in_samples(fault.at_s),
                    end: in_samples(fault.at_s + fault.duration_s),
                })
                .collect(),
        ),
        sampling_time_ns: nanoseconds(timing.sampling_time_s),
        command_delay_ns: nanoseconds(timing.command_delay_s),
        substep_ns: nanoseconds(timing.substep_s),
        settle_samples: in_samples(timing.settle_s),
        wait_for_command,
        first_stamp_ns,
        boot_id,
        chain,
    };
    check_pose::<N, D>(&parameters.chain, &parameters.start)?;
    check_step(&parameters, &parameters.start, scenario)?;
    let start = match (scenario.start.contact_time_s, &parameters.surface) {
        (Some(time_s), Some(surface)) => {
            let whole = in_samples(time_s) as u64 * parameters.sampling_time_ns;
            let phase = nanoseconds(scenario.start.contact_phase * timing.sampling_time_s);
            let touch_ns = whole + phase;
            let point_m = surface.point.into();
            let carried_m = surface.plate.map(|plate| plate.at(seconds(touch_ns)).0);
            let start = solve_start(&parameters, surface.point_at(seconds(touch_ns)), touch_ns)
                .ok_or_else(|| no_start(&parameters, time_s, point_m, carried_m))?;
            if surface.penetration(&parameters.chain.kinematics(&start).pose.position, 0.0) >= 0.0 {
                return Err(SetupError::NotApproaching { contact_time_s: time_s, point_m, carried_m });
            }
            start
        }
        _ => parameters.start,
    };
    check_pose::<N, D>(&parameters.chain, &start)?;
    check_step(&parameters, &start, scenario)?;
    Ok(Plant::new(PlantParameters { start, ..parameters }))
}

/// Why no start was found: an arm that sinks does not get where it is led.
fn no_start<const N: usize, const D: usize>(
    parameters: &PlantParameters<N, D>,
    contact_time_s: f64,
    point_m: [f64; 3],
    carried_m: Option<f64>,
) -> SetupError {
    let overload = parameters.joints.overloads().first().copied();
    overload.map_or(SetupError::Unreachable { contact_time_s, point_m, carried_m }, SetupError::Overloaded)
}

/// Whether the steps resolve an arm with masses, in the air and in an impact at the fastest speed of
/// the motion.
fn check_step<const N: usize, const D: usize>(
    parameters: &PlantParameters<N, D>,
    start: &SVector<f64, N>,
    scenario: &Scenario,
) -> Result<(), SetupError> {
    let Joints::RigidBody(arm) = &parameters.joints else { return Ok(()) };
    let kinematics = parameters.chain.kinematics(start);
    let touched = parameters.surface.as_ref().and_then(|surface| {
        let normal = surface.normal_at(&kinematics.pose.position, 0.0);
        let linear = |twist: &[f64]| twist.iter().take(3).map(|speed| speed * speed).sum::<f64>().sqrt();
        let fastest = scenario.motion.iter().map(|phase| linear(&phase.twist)).fold(0.0, f64::max);
        let mass = arm.effective_mass(start, &normal)?;
        let stiffness = surface.hardest(mass, fastest + surface.most_speed());
        Some(Spring { lever: kinematics.jacobian.fixed_rows::<3>(0).tr_mul(&normal), stiffness })
    });
    Ok(arm.check_step(start, seconds(parameters.substep_ns), touched)?)
}

fn check_pose<const N: usize, const D: usize>(chain: &Chain<N>, q: &SVector<f64, N>) -> Result<(), SetupError> {
    chain.kinematics(q).inverse::<D>(MINIMUM_RECIPROCAL_CONDITION).map(|_| ()).map_err(|singular| {
        SetupError::SingularStart { position: q.as_slice().to_vec(), found: singular.reciprocal_condition }
    })
}

/// The start from which the motion, in free space, brings the TCP to `point` at `instant_ns` after
/// its start: run the same plant without a surface, shift the start by where it missed, repeat.
fn solve_start<const N: usize, const D: usize>(
    parameters: &PlantParameters<N, D>,
    point: Vector3<f64>,
    instant_ns: u64,
) -> Option<SVector<f64, N>> {
    let guess = parameters.chain.kinematics(&parameters.start).pose;
    let mut target = Pose { position: point, rotation: guess.rotation };
    let mut start = inverse_kinematics::<N, D>(&parameters.chain, &parameters.start, &target)?;
    for _ in 0..START_ITERATIONS {
        let reached = free_position(parameters, start, instant_ns)?;
        let miss = point - reached;
        if miss.norm() < START_TOLERANCE_M {
            return Some(start);
        }
        target.position += miss;
        start = inverse_kinematics::<N, D>(&parameters.chain, &start, &target)?;
    }
    None
}

/// TCP position in free space at `instant_ns` after the start of the motion.
fn free_position<const N: usize, const D: usize>(
    parameters: &PlantParameters<N, D>,
    start: SVector<f64, N>,
    instant_ns: u64,
) -> Option<Vector3<f64>> {
    let mut plant = Plant::new(PlantParameters {
        start,
        joints: parameters.joints.smooth(),
        surface: None,
        sensor: None,
        velocity_lag_s: 0.0,
        // The way of the tool is the same.
        follows_joint_velocity: false,
        settle_samples: 0,
        wait_for_command: false,
        faults: Faults::default(),
        ..parameters.clone()
    });
    let end_ns = parameters.first_stamp_ns + instant_ns;
    while plant.now_ns() + parameters.sampling_time_ns <= end_ns {
        plant.integrate_unseen();
    }
    if plant.now_ns() < end_ns {
        plant.integrate_partly(end_ns);
    }
    (!plant.met_singularity()).then(|| plant.tcp_position())
}

/// Joint position of `target` by Newton's method from `guess`.
pub(crate) fn inverse_kinematics<const N: usize, const D: usize>(
    chain: &Chain<N>,
    guess: &SVector<f64, N>,
    target: &Pose,
) -> Option<SVector<f64, N>> {
    const ITERATIONS: usize = 50;
    /// Longest step in rad: Newton must not jump to the other elbow.
    const LONGEST_STEP_RAD: f64 = 0.3;
    let mut q = *guess;
    for _ in 0..ITERATIONS {
        let kinematics = chain.kinematics(&q);
        let error = chain.axes().kept(&target.difference::<D>(&kinematics.pose));
        if error.norm() < 1e-12 {
            return Some(q);
        }
        let inverse = kinematics.inverse::<D>(MINIMUM_RECIPROCAL_CONDITION).ok()?;
        let step = inverse.joint_velocity(&error);
        q += step * (LONGEST_STEP_RAD / step.norm()).min(1.0);
    }
    let error = chain.axes().kept(&target.difference::<D>(&chain.kinematics(&q).pose));
    (error.norm() < 1e-10).then_some(q)
}
