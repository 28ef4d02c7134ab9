//! Random contacts. A case's numbers depend on the seed and its index alone, whatever runs beside
//! it.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::arm::{Arm, dot};
use super::controller;

/// Sampling times T_s in s.
pub(crate) const SAMPLING_TIMES_S: [f64; 5] = [0.004, 0.002, 0.001, 0.0005, 0.00025];
/// Activation threshold β of every axis, in N.
pub(crate) const ACTIVATION_THRESHOLD_N: f64 = 5.0;
/// Motion before the contact, in s: eight of the largest T_V, and whole samples of every T_s.
pub(crate) const APPROACH_S: f64 = 0.2;
/// Motion after the contact, in s.
pub(crate) const AFTER_CONTACT_S: f64 = 0.3;
/// Normal components below this have no lower bound (docs/design.md, "Two profiles").
const LEAST_NORMAL_COMPONENT: f64 = 0.1;
/// Reciprocal condition of the Jacobian: at contact at least, and anywhere on the commanded path.
const CONDITION_AT_CONTACT: f64 = 0.1;
const CONDITION_ON_PATH: f64 = 0.05;
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
    /// Commanded speed in m/s, along −y.
    pub(crate) speed_m_s: f64,
    /// By how much the surface falls toward +x, in rad.
    pub(crate) angle_rad: f64,
    /// Stiffness along the normal in N/m.
    pub(crate) stiffness_n_m: f64,
    /// f_max of both axes in N.
    pub(crate) force_limit_n: f64,
    /// f_min per axis in N; 0 on an axis that has no lower bound.
    pub(crate) minimum_force_n: [f64; 2],
    /// Release threshold per axis in N.
    pub(crate) release_threshold_n: [f64; 2],
    /// The arm.
    pub(crate) arm: Arm,
    /// Joint position at contact in rad.
    pub(crate) contact_position_rad: [f64; 2],
    /// T_V per joint in s.
    pub(crate) velocity_time_constant_s: [f64; 2],
    /// T_est of both axes in s; 0 is an ideal sensor.
    pub(crate) wrench_time_constant_s: f64,
    /// Limit of both joints' speed references in rad/s.
    pub(crate) joint_speed_limit_rad_s: f64,
    /// T_s in s.
    pub(crate) sampling_time_s: f64,
    /// Cycles from a sample to the instant at which its command acts.
    pub(crate) delay_cycles: u32,
    /// Instant of contact within a sample, as a share of T_s.
    pub(crate) contact_phase: f64,
}

impl Draw {
    /// The case with this index.
    ///
    /// # Errors
    /// A sentence when no acceptable pose is found, which the ranges make all but impossible.
    pub(crate) fn new(seed: u64, index: u64) -> Result<Self, String> {
        Self::up_to(HARDEST_N_M, seed, index)
    }

    /// The same among surfaces of at most `hardest_n_m`.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(crate) fn up_to(hardest_n_m: f64, seed: u64, index: u64) -> Result<Self, String> {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(index);
        // Kept over all tries, so that rejected poses do not distort its distribution.
        let stiffness_n_m = log_uniform(&mut generator, SOFTEST_N_M, hardest_n_m);
        // Evenly drawn speeds and limits are mostly far from what is attainable, at high stiffness
        // above all; every second case is drawn near that boundary.
        let near_the_boundary = index % 2 == 1;
        for _ in 0..MOST_TRIES {
            let draw = Self::candidate(&mut generator, index, stiffness_n_m, near_the_boundary);
            // The plant looks for the start from which the lagging arm touches at the instant asked
            // for, not always with success.
            if let Some(draw) = draw.filter(|draw| draw.is_reachable() && controller::can_be_set_up(draw)) {
                return Ok(draw);
            }
        }
        Err(format!("case {index} of seed {seed}: no acceptable pose in {MOST_TRIES} tries"))
    }

    fn candidate(generator: &mut ChaCha8Rng, index: u64, stiffness_n_m: f64, near_the_boundary: bool) -> Option<Self> {
        let mut uniform = |low: f64, high: f64| low + (high - low) * generator.random::<f64>();
        let elbow = if uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        let mut draw = Self {
            index,
            speed_m_s: uniform(0.05, 1.2),
            angle_rad: uniform(0.0, 60.0).to_radians(),
            stiffness_n_m,
            force_limit_n: uniform(50.0, 400.0),
            minimum_force_n: [uniform(4.0, 12.0); 2],
            release_threshold_n: [3.0; 2],
            arm: Arm { links_m: [uniform(0.3, 1.2), uniform(0.3, 1.2)] },
            contact_position_rad: [
                uniform(-std::f64::consts::PI, std::f64::consts::PI),
                elbow * uniform(0.2, std::f64::consts::PI - 0.2),
            ],
            velocity_time_constant_s: [uniform(0.005, 0.025), uniform(0.005, 0.025)],
            // An ideal sensor now and then.
            wrench_time_constant_s: uniform(-0.003, 0.030).max(0.0),
            joint_speed_limit_rad_s: uniform(1.5, 6.0),
            sampling_time_s: SAMPLING_TIMES_S[(uniform(0.0, 5.0) as usize).min(4)],
            delay_cycles: u32::from(uniform(0.0, 1.0) < 0.5),
            contact_phase: uniform(0.0, 1.0),
        };
        if near_the_boundary {
            draw.speed_m_s = log_uniform(generator, 0.05, 1.2);
            let force = draw.estimated_peak_n() * draw.largest_normal_component();
            draw.force_limit_n = force * log_uniform(generator, 0.5, 2.0);
            if !(50.0..=400.0).contains(&draw.force_limit_n) {
                return None;
            }
        }
        draw.fit_lower_bounds();
        Some(draw)
    }

    /// All forces on a plane are one normal force: the lower bounds must leave room below the upper
    /// ones, and an axis must not be released while it is at its lower bound.
    fn fit_lower_bounds(&mut self) {
        let most = 0.5 * self.normal_force_limit_n();
        for (axis, component) in self.normal().into_iter().enumerate() {
            let minimum = &mut self.minimum_force_n[axis];
            *minimum = if component < LEAST_NORMAL_COMPONENT { 0.0 } else { minimum.min(most * component) };
            if *minimum > 0.0 {
                self.release_threshold_n[axis] = self.release_threshold_n[axis].min(0.6 * *minimum);
            }
        }
    }

    /// Outward normal of the surface.
    pub(crate) fn normal(&self) -> [f64; 2] {
        [self.angle_rad.sin(), self.angle_rad.cos()]
    }

    fn largest_normal_component(&self) -> f64 {
        self.normal()[0].max(self.normal()[1])
    }

    /// Normal force in N at which the first axis is at its limit.
    pub(crate) fn normal_force_limit_n(&self) -> f64 {
        self.force_limit_n / self.largest_normal_component()
    }

    /// ṗ0 in m/s.
    pub(crate) fn twist_m_s(&self) -> [f64; 2] {
        [0.0, -self.speed_m_s]
    }

    /// Where the TCP first touches, in m.
    pub(crate) fn contact_point_m(&self) -> [f64; 2] {
        self.arm.tcp(self.contact_position_rad)
    }

    /// Command delay in s.
    pub(crate) fn delay_s(&self) -> f64 {
        f64::from(self.delay_cycles) * self.sampling_time_s
    }

    /// A pose away from singularity, and so the path on which the command takes the arm there and
    /// on.
    fn is_reachable(&self) -> bool {
        let normal = self.normal();
        let inward = dot(self.twist_m_s(), normal);
        let along: [f64; 2] = std::array::from_fn(|axis| self.twist_m_s()[axis] - inward * normal[axis]);
        let back = self.twist_m_s().map(|speed| -speed);
        self.arm.reciprocal_condition(self.contact_position_rad) >= CONDITION_AT_CONTACT
            && self.path_is_clear(back, APPROACH_S, self.joint_speed_limit_rad_s * APPROACH_SHARE)
            && self.path_is_clear(self.twist_m_s(), AFTER_CONTACT_S, f64::INFINITY)
            && self.path_is_clear(along, AFTER_CONTACT_S, f64::INFINITY)
    }

    /// Follows a straight line from the contact, by the midpoint rule.
    fn path_is_clear(&self, twist: [f64; 2], duration_s: f64, most_joint_speed: f64) -> bool {
        let h = duration_s / f64::from(PATH_STEPS);
        let mut q = self.contact_position_rad;
        for _ in 0..=PATH_STEPS {
            let first = self.arm.joint_velocity(q, twist);
            let within = first.iter().all(|speed| speed.is_finite() && speed.abs() <= most_joint_speed);
            if !within || self.arm.reciprocal_condition(q) < CONDITION_ON_PATH {
                return false;
            }
            let middle = std::array::from_fn(|joint| q[joint] + 0.5 * h * first[joint]);
            let second = self.arm.joint_velocity(middle, twist);
            q = std::array::from_fn(|joint| q[joint] + h * second[joint]);
        }
        true
    }

    /// About the lowest normal force in N that a contact at this speed peaks at: a ramp until the
    /// estimate shows it, then full speed outward through one lag.
    fn estimated_peak_n(&self) -> f64 {
        let normal = self.normal();
        let inward = -dot(self.twist_m_s(), normal);
        let lever = self.arm.lever_m(self.contact_position_rad, normal);
        let outward = self.joint_speed_limit_rad_s * (lever[0].abs() + lever[1].abs());
        let to_threshold = ACTIVATION_THRESHOLD_N / (self.stiffness_n_m * inward * self.largest_normal_component());
        // f̂ of a ramp is about t²/(2 T_est) of it at first, and the ramp itself less T_est in the
        // end.
        let seen =
            to_threshold + (2.0 * self.wrench_time_constant_s * to_threshold).sqrt().min(self.wrench_time_constant_s);
        let waiting = seen + 0.5 * self.sampling_time_s + self.delay_s();
        let [first, second] = self.velocity_time_constant_s;
        let lag = (first * lever[0].abs() + second * lever[1].abs()) / (lever[0].abs() + lever[1].abs());
        let braking = lag * (inward - outward * (inward / outward).ln_1p());
        self.stiffness_n_m * (inward * waiting + braking)
    }
}

fn log_uniform(generator: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    (low.ln() + (high / low).ln() * generator.random::<f64>()).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_depends_on_seed_and_index_alone() {
        let (a, b) = (Draw::new(7, 12).unwrap(), Draw::new(7, 12).unwrap());
        assert_eq!(a, b);
        assert_ne!(a.speed_m_s, Draw::new(8, 12).unwrap().speed_m_s);
        assert_ne!(a.speed_m_s, Draw::new(7, 14).unwrap().speed_m_s);
    }

    #[test]
    fn draws_stay_in_their_ranges_and_fill_them() {
        let draws: Vec<Draw> = (0..2000).map(|index| Draw::new(3, index).unwrap()).collect();
        for draw in &draws {
            assert!((0.05..=1.2).contains(&draw.speed_m_s) && (50.0..=400.0).contains(&draw.force_limit_n));
            assert!((1e4..=1e6).contains(&draw.stiffness_n_m) && (0.0..=0.030).contains(&draw.wrench_time_constant_s));
            for (axis, component) in draw.normal().into_iter().enumerate() {
                let (minimum, release) = (draw.minimum_force_n[axis], draw.release_threshold_n[axis]);
                assert!(minimum == 0.0 || release < minimum && release <= ACTIVATION_THRESHOLD_N);
                assert!(minimum <= draw.normal_force_limit_n() * component);
            }
        }
        let share = |test: &dyn Fn(&Draw) -> bool| draws.iter().filter(|draw| test(draw)).count() as f64 / 2000.0;
        assert!((share(&|draw| draw.stiffness_n_m < 1e5) - 0.5).abs() < 0.05);
        assert!((share(&|draw| draw.delay_cycles == 1) - 0.5).abs() < 0.1);
        assert!(share(&|draw| draw.wrench_time_constant_s == 0.0) > 0.04);
        for sampling_time in SAMPLING_TIMES_S {
            assert!(share(&|draw| draw.sampling_time_s == sampling_time) > 0.1, "{sampling_time}");
        }
    }
}
