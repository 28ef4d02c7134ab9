//! The contacts of `--arms`: random arms, which take turns, in random frames and directions.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::arm::{Arm, Kind};
use super::super::controller;
use super::super::task::{Frame, Task};
use super::arms::{ArmName, direction};
use super::{Conditions, Draw, HARDEST_N_M, MOST_TRIES, SAMPLING_TIMES_S, SOFTEST_N_M, log_uniform, uniform};

/// With 1 rad/s at 0.3 m counted as 1 m/s.
const CONDITIONS: Conditions = Conditions { at_contact: 0.05, on_path: 0.025 };
/// What of the normal the directions that give way have between them, and one of them, at least.
const LEAST_GIVING: f64 = 0.5;
const LEAST_OF_ONE: f64 = 0.3;
/// The commanded turn of the tool, rad/s.
const FASTEST_TURN_RAD_S: f64 = 1.0;
/// Limits of one direction over those of another, at most.
const LIMIT_RATIO: f64 = 2.0;
/// Torques in N m, of which a plane gives none about the TCP.
const TORQUE_LIMIT_N_M: f64 = 20.0;
const TORQUE_RELEASE_N_M: f64 = 0.5;

/// A contact of some arm.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AnyArm {
    /// Whose.
    pub(crate) name: ArmName,
    /// The contact.
    pub(crate) draw: Draw,
}

impl AnyArm {
    /// The case with this index: arms take turns.
    ///
    /// # Errors
    /// A sentence when no acceptable pose is found.
    pub(crate) fn new(seed: u64, index: u64) -> Result<Self, String> {
        Self::of(HARDEST_N_M, true, seed, index)
    }

    /// The same among surfaces of at most `hardest_n_m` that have to be found, which is done in directions of the base
    /// frame.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(crate) fn up_to(hardest_n_m: f64, seed: u64, index: u64) -> Result<Self, String> {
        Self::of(hardest_n_m, false, seed, index)
    }

    fn of(hardest_n_m: f64, in_any_frame: bool, seed: u64, index: u64) -> Result<Self, String> {
        let arms = ArmName::ALL.len() as u64;
        let name = ArmName::ALL[(index % arms) as usize];
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(index);
        // As without --arms: kept over all tries, and every second case of an arm near the boundary.
        let stiffness_n_m = log_uniform(&mut generator, SOFTEST_N_M, hardest_n_m);
        let near_the_boundary = (index / arms) % 2 == 1;
        for _ in 0..MOST_TRIES {
            let draw = candidate(&mut generator, (index, name), in_any_frame, stiffness_n_m, near_the_boundary);
            let most_share = |draw: &Draw| if draw.task.is_free(&draw.arm) { f64::INFINITY } else { 1.0 };
            let is_good =
                |draw: &Draw| draw.is_reachable(&CONDITIONS, most_share(draw)) && controller::can_be_set_up(draw);
            if let Some(draw) = draw.filter(is_good) {
                return Ok(Self { name, draw });
            }
        }
        Err(format!("case {index} of seed {seed}, {name}: no acceptable pose in {MOST_TRIES} tries"))
    }

    /// The index of the so-many-th case of some arms.
    pub(crate) fn index_of(arms: &[ArmName], case: u64) -> u64 {
        let of_arm = arms[(case % arms.len() as u64) as usize];
        let place = ArmName::ALL.into_iter().position(|arm| arm == of_arm).unwrap_or_default();
        case / arms.len() as u64 * ArmName::ALL.len() as u64 + place as u64
    }
}

fn candidate(
    generator: &mut ChaCha8Rng,
    (index, name): (u64, ArmName),
    in_any_frame: bool,
    stiffness_n_m: f64,
    near_the_boundary: bool,
) -> Option<Draw> {
    let arm = name.arm(generator);
    let (approach, lean) = motion(name, generator);
    let task = task(name, &arm, in_any_frame, generator);
    let turn_rad_s = turn(&task, generator);
    let linear = arm.task_axes().min(3);
    let kinds: Vec<Kind> = match &arm {
        Arm::PlanarTwo(_) => vec![Kind::Turns; 2],
        Arm::Chain(chain) => chain.joints.iter().map(|joint| joint.kind).collect(),
    };
    let mut of_each = |turns: (f64, f64), slides: (f64, f64)| -> Vec<f64> {
        let within = |kind: &Kind| if *kind == Kind::Turns { turns } else { slides };
        kinds.iter().map(|kind| uniform(generator, within(kind).0, within(kind).1)).collect()
    };
    let contact_position = of_each((-PI, PI), (-0.5, 0.5));
    let joint_speed_limit = of_each((1.5, 6.0), (0.5, 3.0));
    let velocity_time_constant_s = of_each((0.005, 0.025), (0.005, 0.025));
    let mut within = |low: f64, high: f64| uniform(generator, low, high);
    let torques = arm.task_axes() - linear;
    let of_axes = |force: f64, torque: f64| [vec![force; linear], vec![torque; torques]].concat();
    let mut draw = Draw {
        index,
        speed_m_s: within(0.05, 1.2),
        approach,
        turn_rad_s,
        angle_rad: within(0.0, 60.0).to_radians(),
        lean,
        stiffness_n_m,
        minimum_force: of_axes(within(4.0, 12.0), 0.0),
        release_threshold: of_axes(3.0, TORQUE_RELEASE_N_M),
        task,
        arm,
        contact_position,
        velocity_time_constant_s,
        wrench_time_constant_s: within(-0.003, 0.030).max(0.0),
        joint_speed_limit,
        drives: None,
        sampling_time_s: SAMPLING_TIMES_S[(within(0.0, 5.0) as usize).min(4)],
        delay_cycles: u32::from(within(0.0, 1.0) < 0.5),
        contact_phase: within(0.0, 1.0),
    };
    let (giving, of_one) = draw.task.giving_part(&draw.arm, &draw.contact_position, draw.normal());
    if giving < LEAST_GIVING || of_one < LEAST_OF_ONE {
        return None;
    }
    let mut limit_n = uniform(generator, 50.0, 400.0);
    if near_the_boundary {
        draw.speed_m_s = log_uniform(generator, 0.05, 1.2);
        limit_n = draw.estimated_peak_n() * of_one * log_uniform(generator, 0.5, 2.0);
        if !(50.0..=400.0).contains(&limit_n) {
            return None;
        }
    }
    draw.task.force_limit = (0..draw.arm.task_axes())
        .map(|axis| if axis < 3 { limit_n * uniform(generator, 1.0, LIMIT_RATIO) } else { TORQUE_LIMIT_N_M })
        .collect();
    draw.fit_lower_bounds();
    Some(draw)
}

/// Where the arm goes, and where the normal leans to: perpendicular to it.
fn motion(name: ArmName, generator: &mut ChaCha8Rng) -> ([f64; 3], [f64; 3]) {
    if name.is_planar() {
        let (sine, cosine) = uniform(generator, -PI, PI).sin_cos();
        return ([cosine, sine, 0.0], [-sine, cosine, 0.0]);
    }
    let (approach, other) = (Vector3::from(direction(generator)), Vector3::from(direction(generator)));
    (approach.into(), approach.cross(&other).normalize().into())
}

/// Frame and directions; limits come later.
fn task(name: ArmName, arm: &Arm, in_any_frame: bool, generator: &mut ChaCha8Rng) -> Task {
    let mut one_in = |count: u32| generator.random_range(0..count) == 0;
    let mut controlled = name.controls().to_vec();
    // The arm controls some turns of the tool, and others not: then only the base frame will do.
    let drops = controlled.len() >= 5 && one_in(4);
    if drops {
        controlled.retain(|axis| *axis < 3 || one_in(2));
    }
    let turns = controlled.iter().filter(|axis| **axis >= 3).count();
    let must_be_base = !in_any_frame || name.may_tilt() && turns > 0 && turns < 3;
    // All directions give way, or the linear ones, or any.
    let which = generator.random_range(0..3);
    let gives_way = (0..arm.task_axes()).map(|axis| match which {
        0 => true,
        1 => axis < 3,
        _ => generator.random::<f64>() < 0.5,
    });
    let gives_way: Vec<bool> = gives_way.collect();
    let frame = match generator.random_range(0..4) {
        _ if must_be_base => Frame::Base,
        0 => Frame::Base,
        1 if name.may_tilt() => Frame::Surface,
        2 => Frame::Tool,
        _ => {
            let mut within = |most: f64| uniform(generator, -most, most);
            let tilt = if name.may_tilt() { [within(PI), within(FRAC_PI_2)] } else { [0.0; 2] };
            Frame::Rpy([tilt[0], tilt[1], within(PI)])
        }
    };
    let gives_way =
        gives_way.into_iter().enumerate().map(|(axis, gives)| gives && controlled.contains(&axis)).collect();
    Task { frame, controlled, gives_way, force_limit: Vec::new() }
}

/// In one case of four the tool turns on the way, about axes that the arm controls.
fn turn(task: &Task, generator: &mut ChaCha8Rng) -> [f64; 3] {
    let (turns, speed) = (generator.random_range(0..4) == 0, uniform(generator, 0.0, FASTEST_TURN_RAD_S));
    let about = direction(generator);
    let has = |axis: usize| turns && task.controlled.contains(&(axis + 3));
    std::array::from_fn(|axis| if has(axis) { speed * about[axis] } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::super::super::controller::{Profile, Variant};
    use super::*;

    #[test]
    fn arms_take_turns_and_an_index_means_the_same_case() {
        assert_eq!(AnyArm::index_of(&ArmName::ALL, 17), 17);
        assert_eq!(AnyArm::index_of(&[ArmName::Scara, ArmName::Eight], 0), 2);
        assert_eq!(AnyArm::index_of(&[ArmName::Scara, ArmName::Eight], 3), 17);
        for index in 0..18 {
            let case = AnyArm::new(7, index).unwrap();
            assert_eq!(case.name, ArmName::ALL[index as usize % 9]);
            assert_eq!(case, AnyArm::new(7, index).unwrap());
            assert_ne!(case.draw.speed_m_s, AnyArm::new(8, index).unwrap().draw.speed_m_s);
        }
    }

    #[test]
    fn every_draw_is_an_acceptable_configuration_and_scenario() {
        let draws: Vec<Draw> = (0..180).map(|index| AnyArm::new(5, index).unwrap().draw).collect();
        for draw in &draws {
            controller::scenario(draw).unwrap();
            let config = controller::controller(draw, Profile::Default, Variant::Nominal);
            admittance_runner::cycle::build(&config.unwrap_or_else(|why| panic!("{draw:#?}: {why}"))).unwrap();
        }
        // Frames and directions of all kinds come up.
        let some = |test: &dyn Fn(&Draw) -> bool| draws.iter().filter(|draw| test(draw)).count() > 8;
        assert!(some(&|draw| draw.task.frame == Frame::Base) && some(&|draw| draw.task.frame == Frame::Tool));
        assert!(
            some(&|draw| draw.task.frame == Frame::Surface) && some(&|draw| matches!(draw.task.frame, Frame::Rpy(_)))
        );
        assert!(some(&|draw| draw.task.is_free(&draw.arm)) && some(&|draw| draw.turn_rad_s != [0.0; 3]));
        // One direction alone seldom has enough of the normal.
        let giving = |count: usize| {
            draws.iter().filter(|draw| draw.task.gives_way.iter().filter(|gives| **gives).count() == count).count()
        };
        assert!(giving(1) > 2 && (2..=6).all(|count| giving(count) > 4), "{:?}", [1, 2, 3, 4, 5, 6].map(giving));
        assert!(some(&|draw| draw.task.controlled.len() < draw.arm.joints()));
    }
}
