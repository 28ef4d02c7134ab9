//! Random contacts. A case's numbers depend on the seed and its index alone, whatever runs beside
//! it.

mod any_arm;
mod arms;
mod drives;
mod planar;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::arm::Arm;
use super::task::{LEAST_NORMAL_COMPONENT, Task, inward_m_s};

pub(crate) use any_arm::AnyArm;
pub(crate) use arms::{ArmName, Arms};
pub(crate) use drives::Drives;

/// Sampling times T_s in s.
pub(crate) const SAMPLING_TIMES_S: [f64; 5] = [0.004, 0.002, 0.001, 0.0005, 0.00025];
/// Activation threshold β of every axis, in N.
pub(crate) const ACTIVATION_THRESHOLD_N: f64 = 5.0;
/// Motion before the contact, in s: eight of the largest T_V, and whole samples of every T_s.
pub(crate) const APPROACH_S: f64 = 0.2;
/// Motion after the contact, in s.
pub(crate) const AFTER_CONTACT_S: f64 = 0.3;
/// What a stop may take beyond that on drives that refuse jumps: stopping.stop_timeout_s, and a little.
pub(crate) const LONGEST_STOP_S: f64 = 1.1;
/// Share of the joint speed limit that the commanded approach may take.
const APPROACH_SHARE: f64 = 0.9;
/// Stiffness in N/m.
pub(crate) const SOFTEST_N_M: f64 = 1e4;
const HARDEST_N_M: f64 = 1e6;
const MOST_TRIES: u32 = 100_000;
const PATH_STEPS: u32 = 20;

/// One contact: arm, surface, limits, timing.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Draw {
    /// Number of the case.
    pub(crate) index: u64,
    /// Commanded speed in m/s.
    pub(crate) speed_m_s: f64,
    /// Where to: a unit vector.
    pub(crate) approach: [f64; 3],
    /// What turn is commanded beside it, rad/s.
    pub(crate) turn_rad_s: [f64; 3],
    /// By how much the normal leans from against the motion, in rad.
    pub(crate) angle_rad: f64,
    /// Where it leans to: a unit vector, perpendicular to the motion.
    pub(crate) lean: [f64; 3],
    /// Stiffness along the normal in N/m.
    pub(crate) stiffness_n_m: f64,
    /// Directions, and how much they may press.
    pub(crate) task: Task,
    /// f_min per axis in N; 0 on an axis that has no lower bound.
    pub(crate) minimum_force: Vec<f64>,
    /// Release threshold per axis in N.
    pub(crate) release_threshold: Vec<f64>,
    /// The arm.
    pub(crate) arm: Arm,
    /// Joint position at contact in rad or m.
    pub(crate) contact_position: Vec<f64>,
    /// T_V per joint in s.
    pub(crate) velocity_time_constant_s: Vec<f64>,
    /// T_est of all axes in s; 0 is an ideal sensor.
    pub(crate) wrench_time_constant_s: f64,
    /// Limit of each joint's speed references in rad/s or m/s.
    pub(crate) joint_speed_limit: Vec<f64>,
    /// What the drives allow; `None` is any reference.
    pub(crate) drives: Option<Drives>,
    /// T_s in s.
    pub(crate) sampling_time_s: f64,
    /// Cycles from a sample to the instant at which its command acts.
    pub(crate) delay_cycles: u32,
    /// Instant of contact within a sample, as a share of T_s.
    pub(crate) contact_phase: f64,
}

/// Reciprocal condition of the Jacobian: at contact at least, and anywhere on the commanded path.
struct Conditions {
    at_contact: f64,
    on_path: f64,
}

impl Draw {
    /// All forces on a plane are one normal force: the lower bounds must leave room below the upper
    /// ones, and an axis must not be released while it is at its lower bound.
    fn fit_lower_bounds(&mut self) {
        let most = 0.5 * self.normal_force_limit_n();
        let seen = self.task.seen(&self.arm, &self.contact_position, self.normal(), self.normal());
        for (axis, minimum) in self.minimum_force.iter_mut().enumerate() {
            let component = seen.get(axis).map_or(0.0, |component| component.abs());
            let is_bounded = component >= LEAST_NORMAL_COMPONENT && self.task.gives_way[axis];
            *minimum = if is_bounded { minimum.min(most * component) } else { 0.0 };
            if *minimum > 0.0 {
                self.release_threshold[axis] = self.release_threshold[axis].min(0.6 * *minimum);
            }
        }
    }

    /// Outward normal of the surface.
    pub(crate) fn normal(&self) -> [f64; 3] {
        let (sine, cosine) = (self.angle_rad.sin(), self.angle_rad.cos());
        std::array::from_fn(|axis| sine * self.lean[axis] - cosine * self.approach[axis])
    }

    /// Normal force in N at which the first axis is at its limit, at contact.
    pub(crate) fn normal_force_limit_n(&self) -> f64 {
        self.task.normal_force_limit_n(&self.arm, &self.contact_position, self.normal())
    }

    /// ṗ0 in m/s and rad/s.
    pub(crate) fn twist(&self) -> Vec<f64> {
        let linear = self.approach.map(|part| self.speed_m_s * part);
        linear.into_iter().chain(self.turn_rad_s).take(self.arm.task_axes()).collect()
    }

    /// One number for each task axis: of x y z, and of rx ry rz where the arm has them.
    pub(crate) fn of_axes(&self, linear: f64, turning: f64) -> Vec<f64> {
        (0..self.arm.task_axes()).map(|axis| if axis < 3 { linear } else { turning }).collect()
    }

    /// Where the TCP first touches, in m.
    pub(crate) fn contact_point_m(&self) -> [f64; 3] {
        self.arm.tcp(&self.contact_position)
    }

    /// Command delay in s.
    pub(crate) fn delay_s(&self) -> f64 {
        f64::from(self.delay_cycles) * self.sampling_time_s
    }

    /// A pose away from singularity, and so the path on which the command takes the arm there and
    /// on; `after_share` of the joint speed limits are to be enough after the contact.
    fn is_reachable(&self, conditions: &Conditions, after_share: f64) -> bool {
        let (normal, twist) = (self.normal(), self.twist());
        let inward = -inward_m_s(&twist, normal);
        let out = self.task.way_out(&self.arm, &self.contact_position, normal);
        let along: Vec<f64> = twist
            .iter()
            .enumerate()
            .map(|(axis, speed)| out.get(axis).map_or(*speed, |out| speed - inward * out))
            .collect();
        let back: Vec<f64> = twist.iter().map(|speed| -speed).collect();
        self.arm.reciprocal_condition(&self.contact_position, &self.task.controlled) >= conditions.at_contact
            && self.path_is_clear(conditions, &back, APPROACH_S, APPROACH_SHARE)
            && self.path_is_clear(conditions, &twist, AFTER_CONTACT_S, after_share)
            && self.path_is_clear(conditions, &along, AFTER_CONTACT_S, after_share)
    }

    /// Follows a straight line from the contact, by the midpoint rule.
    fn path_is_clear(&self, conditions: &Conditions, twist: &[f64], duration_s: f64, most_share: f64) -> bool {
        let h = duration_s / f64::from(PATH_STEPS);
        let controlled = &self.task.controlled;
        let mut q = self.contact_position.clone();
        let ahead = |q: &[f64], time: f64, speed: &[f64]| -> Vec<f64> {
            q.iter().zip(speed).map(|(q, speed)| q + time * speed).collect()
        };
        for _ in 0..=PATH_STEPS {
            let first = self.arm.joint_velocity(&q, controlled, twist);
            let within = first
                .iter()
                .zip(&self.joint_speed_limit)
                .all(|(speed, limit)| speed.is_finite() && speed.abs() <= limit * most_share);
            if !within || self.arm.reciprocal_condition(&q, controlled) < conditions.on_path {
                return false;
            }
            let middle = ahead(&q, 0.5 * h, &first);
            q = ahead(&q, h, &self.arm.joint_velocity(&middle, controlled, twist));
        }
        true
    }

    /// About the lowest normal force in N that a contact at this speed peaks at: a ramp until the
    /// estimate shows it, then full speed outward through one lag.
    fn estimated_peak_n(&self) -> f64 {
        let (normal, twist) = (self.normal(), self.twist());
        let inward = inward_m_s(&twist, normal);
        let (outward, each) = self.task.outward(&self.arm, &self.contact_position, normal, &self.joint_speed_limit);
        let (_, largest) = self.task.giving_part(&self.arm, &self.contact_position, normal);
        let to_threshold = ACTIVATION_THRESHOLD_N / (self.stiffness_n_m * inward * largest);
        // f̂ of a ramp is about t²/(2 T_est) of it at first, and the ramp itself less T_est in the
        // end.
        let seen =
            to_threshold + (2.0 * self.wrench_time_constant_s * to_threshold).sqrt().min(self.wrench_time_constant_s);
        let waiting = seen + 0.5 * self.sampling_time_s + self.delay_s();
        let lags = self.velocity_time_constant_s.iter().zip(&each).map(|(lag, part)| lag * part);
        let lag = lags.sum::<f64>() / each.iter().sum::<f64>();
        let braking = lag * (inward - outward * (inward / outward).ln_1p());
        self.stiffness_n_m * (inward * waiting + braking)
    }
}

fn log_uniform(generator: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    (low.ln() + (high / low).ln() * generator.random::<f64>()).exp()
}

fn uniform(generator: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * generator.random::<f64>()
}
