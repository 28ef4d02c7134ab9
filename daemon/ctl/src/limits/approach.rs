//! Where the arm touches the surface, in which pose, and from which direction.

use std::f64::consts::{PI, TAU};

use admittance_core::quantities::AXIS_NAMES;
use admittance_runner::config::{Config, GivenInName, GivenSignName, WrenchSection as WrenchConditioning};
use plant_sim::drives_section::DrivesSection;
use plant_sim::pose::{self, ArmPose};
use plant_sim::scenario::{
    ControllerSection, FollowsName, MotionSection, NoiseSection, Scenario, SensorSection, StartSection, SurfaceSection,
    TimingSection, WrenchSection,
};

use crate::Exit;

/// Time at rest before the motion, in s.
const SETTLE_S: f64 = 0.02;
/// Motion before the contact, in time constants of the slowest joint: the speed is then within 0.04
/// % of the command.
const APPROACH_LAGS: f64 = 8.0;
/// Motion after the contact, in s.
pub(crate) const AFTER_CONTACT_S: f64 = 0.3;
/// Longest step of the plant in s; the stiffest contact of the study changes its force by 1 N in it
/// at 0.04 m/s.
const SUBSTEP_S: f64 = 25e-6;
/// Inward normal component of an approach below which the arm slides along the surface rather than
/// touches it.
const LEAST_INWARD: f64 = 0.1;
/// Joint angles that a scenario accepts, in rad.
const LARGEST_ANGLE_RAD: f64 = 7.0;

/// An approach.
#[derive(Debug, Clone)]
pub(crate) struct Approach {
    /// The arm at contact.
    pub(crate) pose: ArmPose,
    /// The other pose of a planar arm with the same TCP, if both were searched for.
    pub(crate) other_joint_position_rad: Option<Vec<f64>>,
    /// Outward normal of the surface, of length 1.
    pub(crate) normal: [f64; 3],
    /// Direction of the motion, of length 1.
    pub(crate) direction: [f64; 3],
}

impl Approach {
    /// The approach that a configuration and the command line describe.
    ///
    /// # Errors
    /// What to give instead.
    pub(crate) fn new(
        config: &Config,
        joints: Option<&[f64]>,
        direction: Option<&[f64]>,
    ) -> Result<Self, (Exit, String)> {
        let normal = unit(config.environment.surface_normal);
        let direction = direction_of(config, normal, direction).map_err(|why| (Exit::Usage, why))?;
        let (pose, other_joint_position_rad) = match joints {
            Some(joints) => (given(config, joints).map_err(|why| (Exit::Usage, why))?, None),
            None => {
                let Elbows { taken, other } = solved(config)?;
                (taken, other.map(|other| other.joint_position_rad))
            }
        };
        // The message names whoever gave the joints: the command line or the configuration.
        let code = if joints.is_some() { Exit::Usage } else { Exit::Config };
        check(config, &pose).map_err(|why| (code, why))?;
        Ok(Self { pose, other_joint_position_rad, normal, direction })
    }

    /// ṗ0 in m/s and rad/s, per task axis.
    pub(crate) fn twist(&self, config: &Config, speed_m_s: f64) -> Vec<f64> {
        let linear = self.direction.map(|component| component * speed_m_s);
        (0..config.robot.task_axes as usize).map(|axis| linear.get(axis).copied().unwrap_or(0.0)).collect()
    }

    /// The speed in m/s at which a joint of the arm at contact is at its configured limit; infinite
    /// without limits.
    pub(crate) fn speed_at_joint_limits_m_s(&self, config: &Config) -> f64 {
        let Some(limits) = &config.limits.joint_speed_rad_s else { return f64::INFINITY };
        let speeds = self.pose.joint_velocity_rad_s(&self.twist(config, 1.0)).unwrap_or_default();
        speeds.iter().zip(limits).map(|(speed, limit)| limit / speed.abs()).fold(f64::INFINITY, f64::min)
    }

    /// Time in s that the drives take to the joint speeds of this motion; 0 where they are not limited.
    fn ramp_s(&self, config: &Config, speed_m_s: f64) -> f64 {
        let Some(accelerations) = &config.limits.joint_acceleration_rad_s2 else { return 0.0 };
        let speeds = self.pose.joint_velocity_rad_s(&self.twist(config, speed_m_s)).unwrap_or_default();
        let jerk = |joint: usize| config.limits.joint_jerk_rad_s3.as_ref().map_or(f64::INFINITY, |jerks| jerks[joint]);
        let ramp_s = |(joint, (speed, acceleration)): (usize, (&f64, &f64))| {
            speed.abs() / acceleration + (acceleration / jerk(joint)).min((speed.abs() / jerk(joint)).sqrt())
        };
        speeds.iter().zip(accelerations).enumerate().map(ramp_s).fold(0.0, f64::max)
    }

    /// Part of the speed that goes into the surface.
    pub(crate) fn inward_share(&self) -> f64 {
        -dot(self.direction, self.normal)
    }

    /// A plant for which the (checked) configuration is exactly right, touching `contact_phase` of
    /// a cycle after a sample.
    pub(crate) fn scenario(&self, config: &Config, speed_m_s: f64, contact_phase: f64) -> Scenario {
        let sampling_time_s = config.control.sampling_time_s;
        let whole_cycles = |time_s: f64| (time_s / sampling_time_s - 1e-9).ceil() * sampling_time_s;
        let slowest_s = config.robot.velocity_time_constant_s.iter().copied().fold(0.0, f64::max);
        let contact_time_s = whole_cycles(APPROACH_LAGS * slowest_s + self.ramp_s(config, speed_m_s));
        Scenario {
            name: "limits".to_owned(),
            ipc: config.ipc.clone(),
            robot: config.robot.clone(),
            rigid_body: None,
            drives: drives(config),
            timing: TimingSection {
                sampling_time_s,
                command_delay_s: config.control.command_delay_s,
                substep_s: SUBSTEP_S,
                settle_s: whole_cycles(SETTLE_S),
            },
            start: StartSection {
                joint_position_rad: self.pose.joint_position_rad.clone(),
                contact_time_s: Some(contact_time_s),
                contact_phase,
            },
            surface: Some(SurfaceSection {
                point_m: self.pose.tcp_position_m,
                normal: self.normal,
                shape: None,
                curvature_1_m: 0.0,
                // Any; it is no cylinder.
                axis: [0.0, 0.0, 1.0],
                stiffness_n_m: config.environment.normal_stiffness_n_m,
                step: None,
                hardening: None,
                hunt_crossley: None,
                damping_n_s_m: 0.0,
                maxwell_stiffness_n_m: None,
                // Any; nothing creeps.
                maxwell_relaxation_time_s: 0.01,
                friction: 0.0,
                // Any; there is no friction.
                slip_velocity_m_s: 0.001,
                plate: None,
            }),
            wrench: WrenchSection {
                time_constant_s: config.contact.wrench_time_constant_s.clone(),
                delay_s: config.contact.wrench_dead_time_s,
            },
            sensor: sensor(&config.wrench),
            noise: NoiseSection { wrench: 0.0, joint_position_rad: 0.0, joint_velocity_rad_s: 0.0, seed: 1 },
            controller: ControllerSection {
                follows: match config.redundancy.is_told() {
                    true => FollowsName::JointVelocity,
                    false => FollowsName::Twist,
                },
            },
            motion: vec![MotionSection {
                duration_s: contact_time_s + whole_cycles(AFTER_CONTACT_S),
                twist: self.twist(config, speed_m_s),
                beside_rad_s: None,
            }],
            twist: None,
            fault: Vec::new(),
            egm: None,
            realtime: config.realtime.clone(),
        }
    }
}

/// Drives that take what the configuration says.
fn drives(config: &Config) -> Option<DrivesSection> {
    let limits = &config.limits;
    Some(DrivesSection {
        joint_speed_rad_s: limits.joint_speed_rad_s.clone(),
        joint_acceleration_rad_s2: limits.joint_acceleration_rad_s2.clone()?,
        joint_jerk_rad_s3: limits.joint_jerk_rad_s3.clone(),
        interval_s: Some(config.control.sampling_time_s / f64::from(config.inputs_per_cycle())),
    })
}

/// The sensor that `[wrench]` describes.
fn sensor(told: &WrenchConditioning) -> Option<SensorSection> {
    let sensor = SensorSection {
        origin_m: told.sensor_origin_m,
        rpy_rad: told.sensor_rpy_rad,
        in_base_axes: told.given_in == GivenInName::Base,
        reports_reaction: told.sign == GivenSignName::Reaction,
        bias: told.bias,
        tool_mass_kg: told.tool_mass_kg,
        tool_center_of_gravity_m: told.tool_center_of_gravity_m,
        gravity_m_s2: told.gravity_m_s2,
        range: told.saturation,
    };
    // Without any of it the estimate is given as it is; what is out of range is not used.
    let is_plain = sensor.in_base_axes && !sensor.reports_reaction && sensor.bias == [0.0; 6];
    (!is_plain || sensor.tool_mass_kg > 0.0).then_some(sensor)
}

fn direction_of(config: &Config, normal: [f64; 3], direction: Option<&[f64]>) -> Result<[f64; 3], String> {
    let linear: Vec<usize> = config.robot.linear_axes().collect();
    let along = |axis: usize| linear.contains(&axis);
    let accepted = if config.robot.task_axes == 2 { "x,y" } else { "x,y,z" };
    let stays =
        |x: &f64, y: &f64, z: &f64| [x, y, z].iter().enumerate().all(|(axis, part)| along(axis) || **part == 0.0);
    let direction = match direction {
        None => normal.map(|component| -component),
        Some([x, y]) if config.robot.task_axes == 2 => [*x, *y, 0.0],
        Some([x, y, z]) if stays(x, y, z) => [*x, *y, *z],
        Some(other) => {
            let names: Vec<&str> = linear.iter().map(|axis| AXIS_NAMES[*axis]).collect();
            return Err(format!(
                "--direction {other:?}: accepted: {accepted}, and nothing but 0 along other axes than {}, which this arm \
                 controls",
                names.join(" ")
            ));
        }
    };
    // The arm moves along its own axes, whatever the normal.
    let direction: [f64; 3] = std::array::from_fn(|axis| if along(axis) { direction[axis] } else { 0.0 });
    let length = dot(direction, direction).sqrt();
    if !length.is_finite() || length < 1e-9 {
        return Err(format!("--direction: accepted: {accepted}, finite numbers that are not all 0"));
    }
    let direction = direction.map(|component| component / length);
    let inward = -dot(direction, normal);
    if inward < LEAST_INWARD {
        return Err(format!(
            "--direction leads along or out of the surface (inward component {inward:.3}, accepted: at least {LEAST_INWARD}); \
             the outward normal is {normal:?}"
        ));
    }
    Ok(direction)
}

/// The pose that the command line gives, moved to the contact point if the configuration has one.
fn given(config: &Config, joints: &[f64]) -> Result<ArmPose, String> {
    let count = config.robot.joint.len();
    if joints.len() != count {
        return Err(format!("--joints: {} values, accepted: {count}, one for each joint", joints.len()));
    }
    if !joints.iter().all(|angle| angle.abs() <= LARGEST_ANGLE_RAD) {
        return Err(format!("--joints {joints:?}: accepted: {LARGEST_ANGLE_RAD} rad or m at most, either way"));
    }
    let here = pose::at(&config.robot, joints).ok_or("--joints: not an arm that the plant knows")?;
    let Some(point) = config.environment.contact_point_m else { return Ok(here) };
    pose::near(&config.robot, joints, point).ok_or_else(|| {
        format!(
            "--joints {joints:?} has the TCP at {:.4?} m, and no pose near it, in the same orientation, has it at \
             environment.contact_point_m = {point:?}: give the joint position at contact",
            here.tcp_position_m
        )
    })
}

/// The poses of a planar arm at the configured contact point.
struct Elbows {
    /// The one with q2 < 0.
    taken: ArmPose,
    /// The one with the other elbow.
    other: Option<ArmPose>,
}

fn solved(config: &Config) -> Result<Elbows, (Exit, String)> {
    let joints = config.robot.joint.len();
    let ask = format!("give the joint position at contact with --joints q1,...,q{joints} (rad or m)");
    let Some(point) = config.environment.contact_point_m else {
        return Err((Exit::Usage, format!("the configuration has no environment.contact_point_m: {ask}")));
    };
    if config.robot.task_axes != 2 {
        let why = format!("the pose of an arm with {joints} joints at the contact point is not unique: {ask}");
        return Err((Exit::Usage, why));
    }
    let mut poses: Vec<ArmPose> = Vec::new();
    // Newton's method keeps to an elbow; a start for each, all around the base.
    let starts =
        (0..12).flat_map(|turn| [-2.2, -1.2, -0.4, 0.4, 1.2, 2.2].map(|q2| [f64::from(turn) * TAU / 12.0, q2]));
    for start in starts {
        let Some(mut pose) = pose::near(&config.robot, &start, point) else { continue };
        let wrapped: Vec<f64> = pose.joint_position_rad.iter().map(|angle| wrap(*angle)).collect();
        let known =
            |other: &ArmPose| other.joint_position_rad.iter().zip(&wrapped).all(|(a, b)| wrap(a - b).abs() < 1e-6);
        if !poses.iter().any(known) {
            pose.joint_position_rad = wrapped;
            poses.push(pose);
        }
    }
    let elbow_down = poses.iter().position(|pose| pose.joint_position_rad[1] < 0.0).unwrap_or(0);
    if poses.is_empty() {
        let why = format!(
            "environment.contact_point_m = {point:?} is out of the arm's reach, or only just within: move it, or {ask}"
        );
        return Err((Exit::Config, why));
    }
    Ok(Elbows { taken: poses.swap_remove(elbow_down), other: poses.pop() })
}

fn check(config: &Config, pose: &ArmPose) -> Result<(), String> {
    let (found, least) = (pose.reciprocal_condition, config.control.minimum_reciprocal_condition);
    let position = &pose.joint_position_rad;
    if found < least {
        return Err(format!(
            "the arm is singular at {position:.4?} (rad or m; reciprocal condition {found:.1e}, accepted: at least \
             control.minimum_reciprocal_condition = {least:?}): give another pose with --joints"
        ));
    }
    let limits = &config.limits;
    if let (Some(min), Some(max)) = (&limits.joint_position_min_rad, &limits.joint_position_max_rad) {
        for (joint, angle) in position.iter().enumerate() {
            if !(min[joint]..=max[joint]).contains(angle) {
                return Err(format!(
                    "joint {} would be at {angle:.4} {unit} at contact, outside limits.joint_position ({} to {} {unit}): give \
                     another pose with --joints",
                    joint + 1,
                    min[joint],
                    max[joint],
                    unit = config.robot.joint[joint].kind.kind().unit()
                ));
            }
        }
    }
    Ok(())
}

fn wrap(angle: f64) -> f64 {
    angle - TAU * ((angle + PI) / TAU).floor()
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn unit(vector: [f64; 3]) -> [f64; 3] {
    let length = dot(vector, vector).sqrt();
    vector.map(|component| component / length)
}

#[cfg(test)]
mod tests {
    use admittance_host::config::{Section, parse};

    use super::super::tests::{planar, spatial};
    use super::*;

    #[test]
    fn a_planar_arm_has_two_poses_and_takes_the_one_below() {
        let approach = Approach::new(&planar(), None, None).unwrap();
        let other = approach.other_joint_position_rad.clone().unwrap();
        assert!(approach.pose.joint_position_rad[1] < 0.0 && other[1] > 0.0);
        let tcp = approach.pose.tcp_position_m;
        assert!((tcp[0] - 1.32).abs() < 1e-9 && (tcp[1] - 0.68).abs() < 1e-9);
        let above = Approach::new(&planar(), Some(&other), None).unwrap();
        assert!(above.pose.joint_position_rad[1] > 0.0 && (above.inward_share() - 1.0).abs() < 1e-12);
    }

    /// Three joints in a plane: x, y and rz of six axes.
    #[test]
    fn an_arm_approaches_along_the_axes_that_it_controls() {
        let text = include_str!("../../../../deploy/robots/planar-three.toml");
        let config: Config = parse(text, "planar-three.toml").unwrap();
        let why = direction_of(&config, [0.0, 1.0, 0.0], Some(&[0.0, -1.0, 0.5])).unwrap_err();
        assert!(why.contains("accepted: x,y,z, and nothing but 0 along other axes than x y,"), "{why}");
        assert_eq!(direction_of(&config, [0.0, 1.0, 0.0], Some(&[0.0, -2.0, 0.0])), Ok([0.0, -1.0, 0.0]));
        let leaning = direction_of(&config, [0.0, 0.8, 0.6], None).unwrap();
        assert_eq!((leaning[0], leaning[2]), (0.0, 0.0));
    }

    #[test]
    fn what_is_missing_or_wrong_is_named() {
        let why = |config: &Config, joints: Option<&[f64]>, direction: Option<&[f64]>| {
            Approach::new(config, joints, direction).unwrap_err()
        };
        let (code, text) = why(&spatial(), None, None);
        assert!(code == Exit::Usage && text.contains("--joints q1,...,q6"), "{text}");
        let (code, text) = why(&spatial(), Some(&[0.0; 6]), None);
        assert!(code == Exit::Usage && text.contains("contact_point_m"), "{text}");
        assert!(why(&planar(), Some(&[1.0]), None).1.contains("accepted: 2"));
        assert!(why(&planar(), Some(&[f64::NAN, 1.0]), None).1.contains("--joints"));
        assert!(why(&planar(), None, Some(&[0.0, 1.0])).1.contains("out of the surface"));
        assert!(why(&planar(), None, Some(&[0.0, 0.0])).1.contains("not all 0"));
        assert!(why(&planar(), None, Some(&[0.0, -1.0, 0.5])).1.contains("accepted: x,y"));
        let mut far = planar();
        far.environment.contact_point_m = Some([3.0, 0.0, 0.0]);
        let (code, text) = why(&far, None, None);
        assert!(code == Exit::Config && text.contains("reach"), "{text}");
        let mut tight = planar();
        tight.limits.joint_position_min_rad = Some(vec![-0.1, -3.0]);
        tight.limits.joint_position_max_rad = Some(vec![0.1, 3.0]);
        assert!(why(&tight, None, None).1.contains("joint 1 would be at"));
        tight.environment.contact_point_m = None;
        assert!(why(&tight, None, None).1.contains("--joints q1,...,q2"));
        assert!(why(&tight, Some(&[0.0, 0.0]), None).1.contains("singular"));
    }

    #[test]
    fn scenarios_pass_the_checks_of_anyones_scenario() {
        let joints = [0.3, 1.2, -1.8, 2.2, 1.57, 0.3];
        for (config, joints) in [(planar(), None), (spatial(), Some(&joints[..]))] {
            let approach = Approach::new(&config, joints, None).unwrap();
            let mut errors = Vec::new();
            approach.scenario(&config, 0.3, 0.5).check("", &mut errors);
            assert!(errors.is_empty(), "{errors:?}");
        }
    }

    #[test]
    fn joint_limits_bound_the_speed() {
        let (mut config, approach) = (planar(), Approach::new(&planar(), None, None).unwrap());
        let most = approach.speed_at_joint_limits_m_s(&config);
        let turning = approach.pose.joint_velocity_rad_s(&approach.twist(&config, most)).unwrap();
        assert!((turning.iter().map(|speed| speed.abs()).fold(0.0, f64::max) - 3.0).abs() < 1e-9);
        config.limits.joint_speed_rad_s = None;
        assert_eq!(approach.speed_at_joint_limits_m_s(&config), f64::INFINITY);
        // The shipped file itself, not only the copy that the test made of it.
        let again: Config =
            parse(include_str!("../../../../deploy/demo/mpc-default.toml"), "mpc-default.toml").unwrap();
        assert_eq!(again, planar());
    }
}
