//! The directions that don't give way are position-controlled as well as the drives can: how far the tool leaves its
//! line beside the direction that gives way, and what of that the contact adds.

use admittance_runner::config::FrameName;
use end_to_end::closed_loop::{Experiment, Run};
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::straight_line::{off_the_line, sideways_offset};
use super::turned_world::{turned, vector};

/// Name, configuration, scenario, and frames of each arm; roll, pitch and yaw of "rpy".
type Cell = (&'static str, &'static str, &'static str, &'static [FrameName], [f64; 3]);
const CELLS: [Cell; 3] = [
    (
        "six joints",
        include_str!("../../../deploy/robots/six-joint.toml"),
        include_str!("../../../plant-sim/scenarios/six-joint.toml"),
        &[FrameName::Surface, FrameName::Tool, FrameName::Rpy],
        [0.1, -0.15, 0.8],
    ),
    (
        "seven joints",
        include_str!("../../../deploy/robots/seven-joint.toml"),
        include_str!("../../../plant-sim/scenarios/seven-joint.toml"),
        &[FrameName::Surface, FrameName::Tool, FrameName::Rpy],
        [0.1, -0.15, 0.8],
    ),
    (
        "SCARA",
        include_str!("../../../deploy/robots/scara.toml"),
        include_str!("../../../plant-sim/scenarios/scara.toml"),
        &[FrameName::Base, FrameName::Rpy, FrameName::Tool],
        [0.0, 0.0, 0.8],
    ),
];
const SPEED_M_S: f64 = 0.01;
/// Deviation of what is position-controlled, m and rad.
const MOST: f64 = 1e-6;
/// The approach is over, and the touch.
const MOTION_S: f64 = 0.6;

/// One direction of a frame gives way, z; the arm comes down along it.
struct Touch {
    experiment: Experiment,
    inward: Vector3<f64>,
}

fn touch(cell: &Cell, frame: FrameName) -> Touch {
    let (_, config, scenario, _, rpy) = cell;
    let mut experiment = Experiment::new(config, scenario, 0.001);
    experiment.config.task.frame = frame;
    experiment.config.contact.admittance_axes = (0..6).map(|axis| axis == 2).collect();
    let normal = vector(&experiment.config.environment.surface_normal);
    let z = match frame {
        FrameName::Base | FrameName::Surface => Vector3::z(),
        FrameName::Rpy => {
            experiment.config.task.rpy_rad = *rpy;
            Rotation3::from_euler_angles(rpy[0], rpy[1], rpy[2]) * Vector3::z()
        }
        FrameName::Tool => {
            let mut free = experiment.clone().with_motion(&[(0.001, &[0.0; 6])]);
            free.scenario.start.contact_time_s = None;
            Rotation3::new(vector(&free.run().instants[0].truth.tcp_rotation)) * Vector3::z()
        }
    };
    let inward = if z.dot(&normal) < 0.0 { z } else { -z };
    let twist = turned(
        &Matrix3::identity(),
        &[inward.x * SPEED_M_S, inward.y * SPEED_M_S, inward.z * SPEED_M_S, 0.0, 0.0, 0.0],
    );
    Touch { experiment: experiment.with_motion(&[(MOTION_S, &twist)]), inward }
}

/// Every twist that the contact had, commanded in the air.
fn in_the_air(touch: &Touch, run: &Run) -> Experiment {
    let absolute: Vec<[f64; 6]> = run
        .instants
        .iter()
        .filter(|at| at.time() >= 0.0 && at.time() < MOTION_S)
        .map(|at| std::array::from_fn(|axis| at.state.twist_reference[axis] + at.command.velocity_offset[axis]))
        .collect();
    let phases: Vec<(f64, &[f64])> = absolute.iter().map(|twist| (0.001, &twist[..])).collect();
    let mut air = touch.experiment.clone().with_motion(&phases);
    air.scenario.surface = None;
    air.scenario.start.contact_time_s = None;
    air.scenario.start.joint_position_rad =
        run.instants[0].truth.joint_position[..air.scenario.robot.joint.len()].to_vec();
    air
}

/// Of joints that are alike the way is a line. Of the shipped ones, each with a lag of its own, it is none whenever the
/// speed changes, in the air as well: nothing of that comes from the contact.
#[test]
fn what_is_position_controlled_is_as_the_drives_are() {
    for cell in &CELLS {
        for frame in cell.3 {
            let what = format!("{} in {frame}", cell.0);
            let mut alike = touch(cell, *frame);
            alike.experiment.config.robot.velocity_time_constant_s.fill(0.01);
            alike.experiment.scenario.robot.velocity_time_constant_s.fill(0.01);
            let run = alike.experiment.run();
            assert!(run.touched() && run.stop_reason().is_none() && run.losses() == 0, "{what}");
            let (way, turn) = off_the_line(&run, &alike.inward);
            assert!(way < MOST && turn < MOST, "{what}, joints alike: {way:.1e} m, {turn:.1e} rad");

            let shipped = touch(cell, *frame);
            let run = shipped.experiment.run();
            assert!(run.touched() && run.stop_reason().is_none() && run.losses() == 0, "{what}");
            // The tool tilts a little, and its frame with it.
            let asked = sideways_offset(&run, |at| match frame {
                FrameName::Tool => Rotation3::new(vector(&at.truth.tcp_rotation)) * Vector3::z(),
                FrameName::Base | FrameName::Rpy | FrameName::Surface => shipped.inward,
            });
            assert!(asked < 1e-9, "{what}: an offset of {asked} beside the direction that gives way");
            let (uneven, uneven_turn) = off_the_line(&run, &shipped.inward);
            let air = in_the_air(&shipped, &run).run();
            assert!(!air.touched(), "{what}");
            let apart = run
                .instants
                .iter()
                .zip(&air.instants)
                .map(|(touch, air)| (vector(&touch.truth.tcp_position) - vector(&air.truth.tcp_position)).norm());
            let added = apart.fold(0.0, f64::max);
            println!(
                "{what}: joints alike off the line by {way:.1e} m, {turn:.1e} rad; as shipped {uneven:.1e} m, {uneven_turn:.1e} \
                 rad, of which the contact adds {added:.1e} m"
            );
            assert!(added < MOST, "{what}: the contact adds {added} m");
        }
    }
}
