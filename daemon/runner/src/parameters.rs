//! From the configuration to the core's parameters.

use admittance_core::belief::{ContactPoint, ContactSign, ImpactLink, Prior, Thresholds};
use admittance_core::intake::{Conditioning, GivenIn, GivenSign, Timing, WrenchSource};
use admittance_core::mpc::Weights;
use admittance_core::mpc::{
    Discretization, ForcePoints, InputSelection, InwardSpeed, LowerBound, Options, growing_steps,
};
use admittance_core::output::{Law, MAX_STEPS};
use admittance_core::quantities::{Span, is_linear};
use admittance_core::robot::{DriveLimits, Drives, Interval, MotionLimits, Pose, rotation_from_rpy};
use admittance_core::supervisor::{Guards, OnContactLost, OnInfeasible, Policy};
use admittance_core::surface::Surface;
use admittance_core::{Parameters, Stopping, with_arm};
use nalgebra::{SVector, Vector3};

use crate::config::{
    Config, ContactPointName, ContactSignName, DiscretizationName, ForcePointsName, GivenInName, GivenSignName,
    InputsName, InwardSpeedName, LawName, LowerBoundName, OnContactLostName, OnInfeasibleName, WeightSpace,
    WrenchSection, WrenchSourceName,
};

/// Span of a horizon that is not given, in time constants of the slowest joint.
const HORIZON_LAGS: f64 = 3.0;
/// Largest KKT residual of a usable solution, as a multiple of mpc.solver_tolerance.
const RESIDUAL_FACTOR: f64 = 1e3;

/// The parameters for N joints and D axes, and for so many inputs within a cycle, base frame:
/// [`Parameters::seen_from`] leads to those of another. `None` if the configuration is for another arm.
///
/// The configuration has passed its checks: lengths and ranges are as declared.
pub fn parameters<const N: usize, const D: usize>(config: &Config, inputs_per_cycle: u32) -> Option<Parameters<N, D>> {
    let chain = config.robot.chain::<N>()?.with_resolution(config.redundancy.inverse()?);
    let vector = |values: &[f64]| (values.len() == D).then(|| SVector::<f64, D>::from_column_slice(values));
    let joints = |values: &[f64]| (values.len() == N).then(|| SVector::<f64, N>::from_column_slice(values));
    let (contact, mpc, limits) = (&config.contact, &config.mpc, &config.limits);
    let loops = config.robot.velocity_loops::<N>()?;

    let mut steps = [0.0; MAX_STEPS];
    let mut horizon = match &mpc.step_lengths_s {
        Some(lengths) => {
            steps.iter_mut().zip(lengths).for_each(|(step, length)| *step = *length);
            lengths.len()
        }
        None => match mpc.horizon {
            Some(horizon) => {
                steps = [config.control.sampling_time_s; MAX_STEPS];
                horizon as usize
            }
            None => {
                let horizon;
                (steps, horizon) = growing_steps(config.control.sampling_time_s, HORIZON_LAGS * loops.slowest());
                horizon
            }
        },
    };
    // The motion controller plays the plan by elapsed time: pieces of a cycle are steps like others.
    let pieces = inputs_per_cycle as usize;
    steps.copy_within(1..=MAX_STEPS - pieces, pieces);
    steps[..pieces].fill(config.control.sampling_time_s / pieces as f64);
    horizon += pieces - 1;
    let wrench = vector(&mpc.wrench_weight)?;
    let weights = match mpc.weights {
        WeightSpace::Joint => {
            Weights::Joint { position: joints(&mpc.position_weight)?, velocity: joints(&mpc.velocity_weight)?, wrench }
        }
        WeightSpace::Task => {
            Weights::Task { position: vector(&mpc.position_weight)?, velocity: vector(&mpc.velocity_weight)?, wrench }
        }
    };
    let law = match (config.control.law, &config.damping) {
        (LawName::Mpc, _) => Law::Mpc,
        (LawName::Damping, damping) => Law::Damping { damping: vector(&damping.as_ref()?.damping_n_s_m)? },
    };
    let environment = &config.environment;
    let force_limit = vector(&contact.force_limit)?;
    let linear = (0..D).filter(|axis| is_linear(*axis) && config.robot.controlled().has(*axis));
    let smallest = linear.map(|axis| force_limit[axis]).fold(f64::INFINITY, f64::min);
    Some(Parameters {
        chain,
        minimum_reciprocal_condition: config.control.minimum_reciprocal_condition,
        redundancy: config.redundancy.beside(config)?,
        loops,
        wrench_time_constant: vector(&contact.wrench_time_constant_s)?,
        wrench_dead_time: Span::from_seconds(contact.wrench_dead_time_s),
        wrench_noise: SVector::from_fn(|axis, _| if is_linear(axis) { environment.wrench_noise_n } else { 0.0 }),
        wrench_source: match config.wrench.source {
            WrenchSourceName::Sample => WrenchSource::Sample,
            WrenchSourceName::MotorTorque => {
                WrenchSource::MotorTorque(config.dynamics.as_ref()?.model(&chain, config.wrench.gravity_m_s2.into())?)
            }
        },
        impact: match &config.dynamics {
            Some(dynamics) => {
                Some(dynamics.impact(&chain, config.wrench.gravity_m_s2.into(), environment.in_impact())?)
            }
            None => None,
        },
        conditioning: conditioning(&config.wrench)?,
        surface: Surface::plane(
            environment.normal_stiffness_n_m,
            &config.robot.controlled().kept(&Vector3::from(environment.surface_normal)),
            Pose {
                position: environment.contact_point_m.unwrap_or_default().into(),
                rotation: rotation_from_rpy(environment.contact_rpy_rad),
            },
        ),
        thresholds: Thresholds {
            admittance: contact.admittance_axes.as_slice().try_into().ok()?,
            activation: vector(&contact.activation_threshold)?,
            release: vector(&contact.release_threshold)?,
        },
        sign: match contact.sign {
            ContactSignName::Wrench => ContactSign::Wrench,
            ContactSignName::Normal => ContactSign::Normal,
        },
        law,
        mpc: Options {
            discretization: match mpc.discretization {
                DiscretizationName::Euler => Discretization::Euler,
                DiscretizationName::Zoh => Discretization::Zoh,
            },
            steps,
            horizon,
            inputs: match mpc.inputs {
                InputsName::Active => InputSelection::Active,
                InputsName::All => InputSelection::All,
            },
            weights,
            input_weight: vector(&mpc.input_weight)?,
            force_limit,
            minimum_force: vector(&contact.minimum_force)?,
            limit_tolerance: contact.limit_tolerance,
            lag_tolerance: config.control.lag_tolerance_s,
            wrench_lag_tolerance: contact.wrench_lag_tolerance,
            lower_bound: match contact.lower_bound {
                LowerBoundName::Always => LowerBound::Always,
                LowerBoundName::OnceReached => LowerBound::OnceReached,
            },
            inward_speed: match (mpc.inward_speed, contact.lower_bound) {
                (Some(InwardSpeedName::Approach), _) | (None, LowerBoundName::OnceReached) => InwardSpeed::Approach,
                (Some(InwardSpeedName::Free), _) | (None, LowerBoundName::Always) => InwardSpeed::Free,
            },
            force_points: match mpc.force_points {
                ForcePointsName::StepEnds => ForcePoints::StepEnds,
                ForcePointsName::Dense => ForcePoints::Dense,
            },
            models_delay: mpc.model_delay,
            normal_force_reference: contact.normal_force_reference_n,
            solution_tolerance: mpc.solver_tolerance * RESIDUAL_FACTOR,
        },
        limits: MotionLimits {
            offset: vector(&limits.velocity_offset)?,
            release_rate: limits.release_rate_m_s2,
            inward_rate: optional(&limits.inward_rate_m_s2, vector)?,
            outward_rate: optional(&limits.outward_rate_m_s2, vector)?,
            joint_speed: optional(&limits.joint_speed_rad_s, joints)?,
            joint_position: match (&limits.joint_position_min_rad, &limits.joint_position_max_rad) {
                (Some(min), Some(max)) => Some(Interval { lower: joints(min)?, upper: joints(max)? }),
                _ => None,
            },
            drives: match &limits.joint_acceleration_rad_s2 {
                None => None,
                Some(acceleration) => Some(Drives {
                    limits: DriveLimits {
                        speed: of_joints(limits.joint_speed_rad_s.as_deref())?,
                        acceleration: of_joints(Some(acceleration))?,
                        jerk: of_joints(limits.joint_jerk_rad_s3.as_deref())?,
                    },
                    stop_exceeds_jerk: limits.stop_exceeds_jerk,
                }),
            },
        },
        contact_point: match (environment.unknown_stiffness(), environment.contact) {
            (Some(stiffness), contact) => ContactPoint::Learned(Prior {
                stiffness,
                depth_tolerance: environment.contact_tolerance_m.filter(|_| contact == ContactPointName::Configured),
                normal_tolerance: environment.normal_tolerance_rad,
                risk: config.contact.risk,
            }),
            (None, ContactPointName::Configured) => ContactPoint::Configured,
            (None, ContactPointName::Detected) => ContactPoint::Detected { wrench_noise: environment.wrench_noise_n },
        },
        policy: Policy {
            on_infeasible: match mpc.on_infeasible {
                OnInfeasibleName::Halt => OnInfeasible::Halt,
                OnInfeasibleName::MinimumForce => OnInfeasible::MinimumForceStop,
            },
            on_contact_lost: match contact.on_contact_lost {
                OnContactLostName::Continue => OnContactLost::Continue,
                OnContactLostName::Stop => OnContactLost::Stop,
            },
        },
        guards: Guards {
            force: config.stopping.force_guard_n,
            mismatch: config.stopping.mismatch_n,
            mismatch_cycles: config.stopping.mismatch_cycles,
        },
        timing: Timing {
            sampling_time: Span::from_seconds(config.control.sampling_time_s),
            command_delay: Span::from_seconds(config.control.command_delay_s),
            max_sample_age: Span::from_seconds(config.control.max_sample_age_s),
            max_consecutive_fallbacks: config.control.max_consecutive_fallbacks,
        },
        stopping: Stopping {
            retreat_speed: config.stopping.retreat_speed_m_s,
            retreat_time: Span::from_seconds(config.stopping.retreat_time_s),
            stop_force: config.stopping.stop_force_n.unwrap_or(smallest / 2.0),
            stop_timeout: Span::from_seconds(config.stopping.stop_timeout_s),
        },
        start_enabled: config.control.start_enabled,
    })
}

/// The tool as an impact along the surface's normal meets it, at a joint position in rad or m; `None` where
/// no masses are told, or no gear gives.
pub fn link_in_impact(config: &Config, joint_position: &[f64]) -> Option<ImpactLink> {
    let normal = Vector3::from(config.environment.surface_normal).try_normalize(1e-3)?;
    let (joints, axes) = (config.robot.joint.len(), config.robot.task_axes);
    with_arm!((joints, axes), <N, D> => {
        let q = SVector::<f64, N>::from_column_slice(joint_position.get(..N)?);
        let parameters = parameters::<N, D>(config, 1)?;
        parameters.impact?.link(&q, &normal)
    }, else None)
}

/// How f̂ follows from the state sample; `None` if the deadband has another number of axes than D.
pub fn conditioning<const D: usize>(wrench: &WrenchSection) -> Option<Conditioning<D>> {
    let deadband = |values: &[f64]| (values.len() == D).then(|| SVector::<f64, D>::from_column_slice(values));
    Some(Conditioning {
        given_in: match wrench.given_in {
            GivenInName::Base => GivenIn::Base,
            GivenInName::Sensor => GivenIn::Sensor(Pose {
                position: wrench.sensor_origin_m.into(),
                rotation: rotation_from_rpy(wrench.sensor_rpy_rad),
            }),
        },
        sign: match wrench.sign {
            GivenSignName::OnEnvironment => GivenSign::OnEnvironment,
            GivenSignName::Reaction => GivenSign::Reaction,
        },
        bias: wrench.bias.into(),
        saturation: wrench.saturation.map(Into::into),
        deadband: optional(&wrench.deadband, deadband)?.unwrap_or_else(SVector::zeros),
        tool_mass: wrench.tool_mass_kg,
        tool_weight: Vector3::from(wrench.gravity_m_s2) * wrench.tool_mass_kg,
        tool_center_of_gravity: wrench.tool_center_of_gravity_m.into(),
    })
}

/// Limits of N joints, infinite where there are none; `None` if there are others.
fn of_joints<const N: usize>(limits: Option<&[f64]>) -> Option<[f64; N]> {
    limits.map_or(Some([f64::INFINITY; N]), |limits| limits.try_into().ok())
}

/// An optional list as a vector; `None` if its length differs.
fn optional<const K: usize>(
    values: &Option<Vec<f64>>,
    vector: impl Fn(&[f64]) -> Option<SVector<f64, K>>,
) -> Option<Option<SVector<f64, K>>> {
    values.as_ref().map_or(Some(None), |values| vector(values).map(Some))
}
