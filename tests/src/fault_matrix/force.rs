//! What the true normal force stays under, as a number.

use admittance_core::quantities::Span;
use admittance_host::config::parse;
use admittance_runner::config::Config;
use ipc_types::{CommandSample, TruthSample};
use nalgebra::Vector2;
use plant_sim::scenario::{MotionSection, Scenario};

use super::row::Force;
use crate::closed_loop::Experiment;

/// For what a plan and a coast as straight lines leave out: the joints turn meanwhile, and lag
/// unequally.
const MARGIN: f64 = 1.1;
/// The same for small forces, N.
const MARGIN_N: f64 = 2.0;
/// Over what eight instants of contact show in virtual time.
const VIRTUAL_MARGIN: f64 = 1.25;
const INSTANTS: u32 = 8;

/// What the bounds are computed from.
pub(super) struct Situation<'a> {
    pub(super) daemon: &'a str,
    pub(super) scenario: &'a str,
    /// The last command and truth before the fault.
    pub(super) before: (&'a CommandSample, &'a TruthSample),
}

/// The bound in N.
pub(super) fn bound(force: Force, situation: &Situation<'_>) -> f64 {
    let config: Config = parse(situation.daemon, "daemon.toml").expect("the row's configuration is valid");
    let scenario: Scenario = parse(situation.scenario, "scenario.toml").expect("the row's scenario is valid");
    match force {
        Force::None => 0.0,
        Force::Limit => limit(&config),
        Force::PlanThenHold => plan_then_hold(&scenario, situation.before),
        Force::VirtualTime => virtual_time(config, scenario) * VIRTUAL_MARGIN,
    }
}

/// The smallest f_max / |n|: on a plane all forces are one normal force.
pub(super) fn limit(config: &Config) -> f64 {
    let normal = config.environment.surface_normal;
    let most = normal.iter().zip(&config.contact.force_limit).map(|(n, limit)| limit / n.abs());
    most.fold(f64::INFINITY, f64::min)
}

fn plan_then_hold(scenario: &Scenario, (command, truth): (&CommandSample, &TruthSample)) -> f64 {
    let Some(surface) = &scenario.surface else { return 0.0 };
    let inward = |twist: &[f64; 6]| -surface.normal.iter().zip(twist).map(|(n, v)| n * v).sum::<f64>();
    let reference: [f64; 6] = std::array::from_fn(|axis| command.twist_command[axis] - command.velocity_offset[axis]);
    let delay_ns = (scenario.timing.command_delay_s * 1e9) as u64;
    let valid_ns = command.valid_until_ns.saturating_sub(command.state_stamp_ns + delay_ns);
    let steps = command.plan_length as usize;
    let (mut begun, mut way) = (0, 0.0);
    for step in 0..steps {
        // The last step is played until the command is valid no longer.
        let end = if step + 1 < steps { command.plan_end_ns[step].min(valid_ns) } else { valid_ns };
        let twist = std::array::from_fn(|axis| reference[axis] + command.planned_offset[step][axis]);
        way += inward(&twist).max(0.0) * Span::from_nanoseconds(end.saturating_sub(begun)).seconds();
        begun = end;
    }
    way += inward(&coast(scenario, truth)).max(0.0);
    (truth.normal_force_n + surface.stiffness_n_m * way) * MARGIN + MARGIN_N
}

/// The way in m that the TCP coasts when the arm is held: every joint goes on for its own time
/// constant, so that even an arm that moves along the surface coasts into it.
fn coast(scenario: &Scenario, truth: &TruthSample) -> [f64; 6] {
    let chain = scenario.robot.chain::<2>().expect("the planar arm");
    let kinematics = chain.kinematics(&Vector2::from_column_slice(&truth.joint_position[..2]));
    let lags = &scenario.robot.velocity_time_constant_s;
    let turned = Vector2::from_fn(|joint, _| truth.joint_velocity[joint] * lags[joint]);
    let way = kinematics.task_jacobian::<2>() * turned;
    std::array::from_fn(|axis| way.get(axis).copied().unwrap_or(0.0))
}

/// The largest force of the first phase of the motion.
fn virtual_time(config: Config, mut scenario: Scenario) -> f64 {
    scenario.fault = Vec::new();
    scenario.motion = scenario.motion.into_iter().take(1).collect();
    if let [MotionSection { duration_s, .. }] = scenario.motion.as_mut_slice() {
        *duration_s = duration_s.min(0.8);
    }
    let mut peak = 0.0_f64;
    Experiment { config, scenario }.at_instants(INSTANTS, |_, run| peak = peak.max(run.peak_normal()));
    peak
}
