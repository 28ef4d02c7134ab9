//! One, two or five directions give way, in the base frame, in one on the surface and in the tool's, on arms of four to
//! eight joints: the force is kept, and every other direction stays where it was commanded.

use admittance_runner::config::FrameName;
use admittance_runner::task_frame::TaskFrame;
use end_to_end::closed_loop::{Experiment, Run};
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::turned_world::vector;

/// Name, configuration, scenario and the directions that it controls.
type Arm = (&'static str, &'static str, &'static str, [bool; 6]);
const ALL: [bool; 6] = [true; 6];
const ARMS: [Arm; 6] = [
    (
        "six joints",
        include_str!("../../../deploy/robots/six-joint.toml"),
        include_str!("../../../plant-sim/scenarios/six-joint.toml"),
        ALL,
    ),
    (
        "seven joints",
        include_str!("../../../deploy/robots/seven-joint.toml"),
        include_str!("../../../plant-sim/scenarios/seven-joint.toml"),
        ALL,
    ),
    (
        "six joints on a rail",
        include_str!("../../../deploy/robots/rail.toml"),
        include_str!("../../../plant-sim/scenarios/rail.toml"),
        ALL,
    ),
    (
        "eight joints",
        include_str!("../../../deploy/robots/eight-joint.toml"),
        include_str!("../../../plant-sim/scenarios/eight-joint.toml"),
        ALL,
    ),
    (
        "five joints",
        include_str!("../../../deploy/robots/five-joint.toml"),
        include_str!("../../../plant-sim/scenarios/five-joint.toml"),
        [true, true, true, false, true, true],
    ),
    (
        "SCARA",
        include_str!("../../../deploy/robots/scara.toml"),
        include_str!("../../../plant-sim/scenarios/scara.toml"),
        [true, true, true, false, false, true],
    ),
];
/// What gives way: one direction, two, and five.
const GIVES_WAY: [[bool; 6]; 4] = [
    [false, false, true, false, false, false],
    [false, true, true, false, false, false],
    [true, true, true, false, true, true],
    [false, true, true, true, true, true],
];
const SPEED_M_S: f64 = 0.01;
const MOTION_S: f64 = 0.8;
/// f_min on every linear direction that feels the surface, N, and what of the normal that is.
const LEAST: f64 = 6.0;
const FELT: f64 = 0.1;
/// f_max on every linear direction in N, and what the linear model may miss of it.
const MOST: f64 = 150.0 + 0.5;
/// Deviation of what is position-controlled, m and rad.
const KEPT: f64 = 1e-6;

/// The arm comes down along the z of a frame, whose joints are alike: where they are not, the way beside it bends
/// whenever the speed changes, in the air as well (`task_frame_sideways`).
fn touch(arm: &Arm, frame: FrameName, gives_way: [bool; 6]) -> (Experiment, Matrix3<f64>) {
    let mut experiment = Experiment::new(arm.1, arm.2, 0.001);
    let Experiment { config, scenario } = &mut experiment;
    config.robot.velocity_time_constant_s.fill(0.01);
    scenario.robot.velocity_time_constant_s.fill(0.01);
    config.task.frame = frame;
    config.contact.admittance_axes = gives_way.to_vec();
    let mut free = experiment.clone().with_motion(&[(0.001, &[0.0; 6])]);
    free.scenario.start.contact_time_s = None;
    let tool = Rotation3::new(vector(&free.run().instants[0].truth.tcp_rotation)).into_inner();
    let axes = match frame {
        FrameName::Tool => tool,
        FrameName::Base | FrameName::Rpy | FrameName::Surface => {
            TaskFrame::of(&experiment.config).axes().copied().unwrap_or_else(Matrix3::identity)
        }
    };
    let z = axes.column(2).into_owned();
    let inward = if z.dot(&vector(&experiment.config.environment.surface_normal)) < 0.0 { z } else { -z };
    let twist = [inward.x * SPEED_M_S, inward.y * SPEED_M_S, inward.z * SPEED_M_S, 0.0, 0.0, 0.0];
    (experiment.with_motion(&[(MOTION_S, &twist)]), axes)
}

/// Largest deviation in m and rad of the controlled directions that do not give way.
fn deviation(run: &Run, axes: &Matrix3<f64>, kept: impl Fn(usize) -> bool) -> (f64, f64) {
    let start = &run.instants[0].truth;
    let attitude = |at: &[f64; 3]| Rotation3::new(vector(at));
    run.instants.iter().fold((0.0, 0.0), |(way, turn), at| {
        let moved = axes.tr_mul(&(vector(&at.truth.tcp_position) - vector(&start.tcp_position)));
        let turned = attitude(&at.truth.tcp_rotation) * attitude(&start.tcp_rotation).inverse();
        let turned = axes.tr_mul(&turned.scaled_axis());
        let worst = |values: Vector3<f64>, first: usize, before: f64| {
            (0..3).filter(|axis| kept(first + axis)).map(|axis| values[axis].abs()).fold(before, f64::max)
        };
        (worst(moved, 0, way), worst(turned, 3, turn))
    })
}

#[test]
fn what_gives_way_keeps_the_force_and_nothing_else_moves() {
    let mut failures = Vec::new();
    for arm in &ARMS {
        let (name, .., controlled) = arm;
        for frame in [FrameName::Base, FrameName::Surface, FrameName::Tool] {
            // Five joints turn their tool about the arm's own axes alone.
            if *name == "five joints" && frame != FrameName::Base {
                continue;
            }
            for gives_way in GIVES_WAY {
                let gives_way = std::array::from_fn(|axis| gives_way[axis] && controlled[axis]);
                let (experiment, axes) = touch(arm, frame, gives_way);
                let run = experiment.run();
                let normal = axes.tr_mul(&vector(&experiment.config.environment.surface_normal)).normalize();
                let felt = (0..3).filter(|axis| gives_way[*axis] && normal[*axis].abs() >= FELT);
                let least = felt.map(|axis| LEAST / normal[axis].abs()).fold(0.0, f64::max);
                let (way, turn) = deviation(&run, &axes, |axis| controlled[axis] && !gives_way[axis]);
                let (peak, settled) = (run.peak_normal(), run.settled_normal());
                let what = format!("{name} in {frame}, {gives_way:?}");
                println!(
                    "{what}: peak {peak:.1} N, settled {settled:.2} N of {least:.2}, the others off by {way:.1e} m and {turn:.1e} rad"
                );
                let ended = (run.stop_reason(), run.infeasible(), run.losses());
                if !run.touched() || ended != (None, 0, 0) || peak > MOST || (settled - least).abs() > 1.0 {
                    failures.push(format!("{what}: {ended:?}, peak {peak} N, settled {settled} N of {least}"));
                }
                if way > KEPT || turn > KEPT {
                    failures.push(format!("{what}: off by {way:.1e} m and {turn:.1e} rad"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
