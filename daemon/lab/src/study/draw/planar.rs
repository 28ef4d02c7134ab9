//! The contacts of the study without `--arms`: two joints in a plane, and both directions of the base
//! frame give way.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::arm::{Arm, PlanarTwo};
use super::super::controller;
use super::super::task::{Frame, Task};
use super::{Conditions, Draw, HARDEST_N_M, MOST_TRIES, SAMPLING_TIMES_S, SOFTEST_N_M, log_uniform};

const CONDITIONS: Conditions = Conditions { at_contact: 0.1, on_path: 0.05 };

/// What two joints in a plane are asked for, with this f_max in N.
pub(super) fn both_directions(force_limit_n: f64) -> Task {
    Task { frame: Frame::Base, controlled: vec![0, 1], gives_way: vec![true; 2], force_limit: vec![force_limit_n; 2] }
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
            let draw = candidate(&mut generator, index, stiffness_n_m, near_the_boundary);
            // The plant looks for the start from which the lagging arm touches at the instant asked
            // for, not always with success.
            let is_good =
                |draw: &Self| draw.is_reachable(&CONDITIONS, f64::INFINITY) && controller::can_be_set_up(draw);
            if let Some(draw) = draw.filter(is_good) {
                return Ok(draw);
            }
        }
        Err(format!("case {index} of seed {seed}: no acceptable pose in {MOST_TRIES} tries"))
    }

    /// Two links of 1 m, the elbow below zero, that come down with this speed on the plane of
    /// docs/design.md, with joint speeds limited to 3 rad/s.
    pub(crate) fn of_the_paper(sampling_time_s: f64, speed_m_s: f64, contact_phase: f64) -> Self {
        // The TCP at (1.32, 0.68) m.
        let (x, y) = (1.32_f64, 0.68_f64);
        let half = (x.hypot(y) / 2.0).acos();
        Self {
            index: 0,
            speed_m_s,
            approach: [0.0, -1.0, 0.0],
            turn_rad_s: [0.0; 3],
            angle_rad: 25f64.to_radians(),
            lean: [1.0, 0.0, 0.0],
            stiffness_n_m: 1e5,
            task: both_directions(200.0),
            minimum_force: vec![6.0; 2],
            release_threshold: vec![3.0; 2],
            arm: Arm::PlanarTwo(PlanarTwo { links_m: [1.0, 1.0] }),
            contact_position: vec![y.atan2(x) + half, -2.0 * half],
            velocity_time_constant_s: vec![0.015, 0.010],
            wrench_time_constant_s: 0.020,
            joint_speed_limit: vec![3.0; 2],
            drives: None,
            sampling_time_s,
            delay_cycles: 0,
            contact_phase,
        }
    }
}

fn candidate(generator: &mut ChaCha8Rng, index: u64, stiffness_n_m: f64, near_the_boundary: bool) -> Option<Draw> {
    let mut uniform = |low: f64, high: f64| low + (high - low) * generator.random::<f64>();
    let elbow = if uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
    let mut draw = Draw {
        index,
        speed_m_s: uniform(0.05, 1.2),
        approach: [0.0, -1.0, 0.0],
        turn_rad_s: [0.0; 3],
        angle_rad: uniform(0.0, 60.0).to_radians(),
        lean: [1.0, 0.0, 0.0],
        stiffness_n_m,
        task: both_directions(uniform(50.0, 400.0)),
        minimum_force: vec![uniform(4.0, 12.0); 2],
        release_threshold: vec![3.0; 2],
        arm: Arm::PlanarTwo(PlanarTwo { links_m: [uniform(0.3, 1.2), uniform(0.3, 1.2)] }),
        contact_position: vec![
            uniform(-std::f64::consts::PI, std::f64::consts::PI),
            elbow * uniform(0.2, std::f64::consts::PI - 0.2),
        ],
        velocity_time_constant_s: vec![uniform(0.005, 0.025), uniform(0.005, 0.025)],
        // An ideal sensor now and then.
        wrench_time_constant_s: uniform(-0.003, 0.030).max(0.0),
        joint_speed_limit: vec![uniform(1.5, 6.0); 2],
        drives: None,
        sampling_time_s: SAMPLING_TIMES_S[(uniform(0.0, 5.0) as usize).min(4)],
        delay_cycles: u32::from(uniform(0.0, 1.0) < 0.5),
        contact_phase: uniform(0.0, 1.0),
    };
    if near_the_boundary {
        draw.speed_m_s = log_uniform(generator, 0.05, 1.2);
        let normal = draw.normal();
        let force = draw.estimated_peak_n() * normal[0].max(normal[1]);
        let force_limit_n = force * log_uniform(generator, 0.5, 2.0);
        if !(50.0..=400.0).contains(&force_limit_n) {
            return None;
        }
        draw.task = both_directions(force_limit_n);
    }
    draw.fit_lower_bounds();
    Some(draw)
}

#[cfg(test)]
mod tests {
    use super::super::ACTIVATION_THRESHOLD_N;
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
            assert!((0.05..=1.2).contains(&draw.speed_m_s) && (50.0..=400.0).contains(&draw.task.force_limit[0]));
            assert!((1e4..=1e6).contains(&draw.stiffness_n_m) && (0.0..=0.030).contains(&draw.wrench_time_constant_s));
            for (axis, component) in draw.normal().into_iter().take(2).enumerate() {
                let (minimum, release) = (draw.minimum_force[axis], draw.release_threshold[axis]);
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
