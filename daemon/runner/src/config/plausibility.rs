//! Whether the arm can do what the configuration says: what it reaches, where its Jacobian has an
//! inverse.

use admittance_core::robot::Chain;
use admittance_core::with_arm;
use admittance_host::config::{ConfigError, short};
use admittance_host::robot_description::KindName;
use nalgebra::SVector;

use super::{Config, ContactPointName};

/// Joint positions that are tried for one at which the arm can be controlled.
const POSES: u32 = 200;
/// Most that an arm presses with, in N per metre of its reach: what heavy foundry robots carry, with
/// some to spare.
pub(super) const MOST_FORCE_N_M: f64 = 5000.0;

/// How far the TCP can get from the first joint's origin, in m: the lengths of all links, and the
/// ways of prismatic joints, which have no end where no limit says one.
pub fn reach_m(config: &Config) -> f64 {
    let length = |origin: [f64; 3]| origin.map(|part| part * part).iter().sum::<f64>().sqrt();
    let (robot, limits) = (&config.robot, &config.limits);
    let links = robot.joint.iter().skip(1).map(|joint| length(joint.origin_m));
    let end = |ends: &Option<Vec<f64>>, joint: usize| {
        ends.as_ref().and_then(|ends| ends.get(joint)).map_or(f64::INFINITY, |end| end.abs())
    };
    let prismatic = robot.joint.iter().enumerate().filter(|(_, joint)| joint.kind == KindName::Prismatic);
    let ways = prismatic
        .map(|(joint, _)| end(&limits.joint_position_min_rad, joint).max(end(&limits.joint_position_max_rad, joint)));
    links.sum::<f64>() + ways.sum::<f64>() + length(robot.tool.origin_m)
}

/// Distance in m of the contact point from the first joint's origin, and of the plane through it;
/// `None` where it is not configured. On a planar arm x and y count.
pub fn contact_distance_m(config: &Config) -> Option<(f64, f64)> {
    let environment = &config.environment;
    let point = environment.contact_point_m.filter(|_| environment.contact == ContactPointName::Configured)?;
    let base = config.robot.joint.first()?.origin_m;
    let normal: Vec<f64> = config.robot.linear_axes().map(|axis| environment.surface_normal[axis]).collect();
    let offset: Vec<f64> = config.robot.linear_axes().map(|axis| point[axis] - base[axis]).collect();
    let norm = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>().sqrt();
    let along: f64 = offset.iter().zip(&normal).map(|(offset, normal)| offset * normal).sum();
    Some((norm(&offset), along.abs() / norm(&normal)))
}

/// What no motion of the arm can mend.
pub(super) fn check_arm(config: &Config, errors: &mut Vec<ConfigError>) {
    let reach = reach_m(config);
    let least = config.control.minimum_reciprocal_condition;
    let (joints, axes) = (config.robot.joint.len(), config.robot.task_axes);
    let is_regular = with_arm!((joints, axes), <N, D> => {
        config.robot.chain::<N>().is_none_or(|chain| has_regular_pose::<N, D>(&chain, least))
    }, else true);
    if !is_regular {
        let found =
            if reach.is_finite() { format!("links of {} m in all", short(reach)) } else { "as given".to_owned() };
        let accepted = format!(
            "origins and axes that leave the TCP free to move on every controlled axis (robot.task_axes = {axes}, robot.controlled_axes): at none of {POSES} poses has the \
             Jacobian a reciprocal condition of control.minimum_reciprocal_condition = {least}"
        );
        errors.push(ConfigError::new("robot.joint", found, accepted));
    }
    if let Some((_, plane)) = contact_distance_m(config).filter(|(_, plane)| *plane > reach) {
        let found = format!("{:?}", config.environment.contact_point_m.unwrap_or_default());
        let accepted = format!(
            "a point on a surface within reach: this surface is {} m away from the first joint, and the arm's links \
             reach {} m",
            short(plane),
            short(reach)
        );
        errors.push(ConfigError::new("environment.contact_point_m", found, accepted));
    }
}

/// Whether at one of many poses the Jacobian has a reciprocal condition of at least `least`.
pub fn has_regular_pose<const N: usize, const D: usize>(chain: &Chain<N>, least: f64) -> bool {
    poses::<N>().any(|position| chain.kinematics(&position).inverse::<D>(least).is_ok())
}

/// Many poses, evenly spread and the same each time.
pub(super) fn poses<const N: usize>() -> impl Iterator<Item = SVector<f64, N>> {
    // Multiples of the golden ratio, one for each joint.
    let angle = |pose: u32, joint: usize| {
        let share = (f64::from(pose) * 0.618_033_988_749_894_9 * (joint + 1) as f64).fract();
        (2.0 * share - 1.0) * std::f64::consts::PI
    };
    (1..=POSES).map(move |pose| SVector::from_fn(|joint, _| angle(pose, joint)))
}
