//! What it costs that a frame which turns with the tool stands still over the horizon.

use std::ops::AddAssign as _;

use admittance_core::robot::Chain;
use admittance_runner::config::{Config, FrameName};
use end_to_end::closed_loop::{Experiment, Instant, Run};
use ipc_types::Mode;
use nalgebra::{Rotation3, SVector, Vector3};

use super::turned_world::vector;

const CONFIG: &str = include_str!("../../../deploy/robots/six-joint.toml");
const SCENARIO: &str = include_str!("../../../plant-sim/scenarios/six-joint.toml");
const JOINTS: usize = 6;
/// The tool turns so fast about its x, rad/s.
const RATE: f64 = 1.0;
/// Step of the joints in s, and the parts of the horizon that are looked at.
const STEP_S: f64 = 1e-4;
const HORIZONS_S: [f64; 4] = [0.001, 0.005, 0.02, 0.045];

/// At this lean in rad when it touches, the tool turns about its own x while it presses along the base frame's z.
fn rolling(lean: f64) -> Experiment {
    let mut experiment = Experiment::new(CONFIG, SCENARIO, 0.001);
    experiment.config.task.frame = FrameName::Tool;
    experiment.config.contact.admittance_axes = vec![false, false, true, false, false, false];
    let mut free = experiment.clone().with_motion(&[(0.001, &[0.0; 6])]);
    free.scenario.start.contact_time_s = None;
    let about = Rotation3::new(vector(&free.run().instants[0].truth.tcp_rotation)) * Vector3::x() * RATE;
    // The pose of the start is the one in which it touches: it is that lean, and not the start's, which is asked for.
    experiment.with_motion(&[(0.2 + lean / RATE, &[0.0, 0.0, -0.05, about.x, about.y, about.z]), (0.001, &[0.0; 6])])
}

/// Force in N at the end of each horizon after a cycle, where the planned offsets are played as they are, and where
/// they turn with the tool.
fn played(
    config: &Config,
    normal: &Vector3<f64>,
    stiffness: f64,
    at: &Instant,
) -> Option<[[f64; 2]; HORIZONS_S.len()]> {
    let chain: Chain<JOINTS> = config.robot.chain()?;
    let lags = &config.robot.velocity_time_constant_s;
    let joints = |values: &[f64]| SVector::<f64, JOINTS>::from_fn(|joint, _| values[joint]);
    let commanded = SVector::<f64, 6>::from_fn(|axis, _| at.state.twist_reference[axis]);
    let began = chain.kinematics(&joints(&at.truth.joint_position)).pose;
    let depth_here = at.truth.normal_force_n / stiffness;
    let mut forces = [[0.0; 2]; HORIZONS_S.len()];
    for (turns, column) in [(false, 0), (true, 1)] {
        let mut q = joints(&at.truth.joint_position);
        let mut speed = joints(&at.truth.joint_velocity);
        let (mut time, mut next) = (0.0, 0);
        let mut plan = at.plan();
        let (mut offset, mut until) = plan.next()?;
        while next < HORIZONS_S.len() {
            let kinematics = chain.kinematics(&q);
            let turned = kinematics.pose.rotation * began.rotation.transpose();
            let linear = vector(&offset[..3]);
            let linear = if turns { turned * linear } else { linear };
            let mut twist = commanded;
            twist.fixed_rows_mut::<3>(0).add_assign(&linear);
            let reference = kinematics.inverse::<6>(1e-4).ok()?.joint_velocity(&twist);
            for joint in 0..JOINTS {
                let left = (-STEP_S / lags[joint]).exp();
                let way = reference[joint] * STEP_S + (speed[joint] - reference[joint]) * lags[joint] * (1.0 - left);
                q[joint] += way;
                speed[joint] = reference[joint] + (speed[joint] - reference[joint]) * left;
            }
            time += STEP_S;
            if time >= until - 0.5 * STEP_S {
                // The last one lasts.
                if let Some((value, length)) = plan.next() {
                    (offset, until) = (value, until + length);
                } else {
                    until = f64::INFINITY;
                }
            }
            if time >= HORIZONS_S[next] - 0.5 * STEP_S {
                let way = chain.kinematics(&q).pose.position - began.position;
                forces[next][column] = (stiffness * (depth_here - normal.dot(&way))).max(0.0);
                next += 1;
            }
        }
    }
    Some(forces)
}

fn in_contact(run: &Run) -> impl Iterator<Item = &Instant> {
    run.instants.iter().filter(|at| at.is_in(Mode::Contact) && at.command.plan_length > 1)
}

/// Both ways of playing a plan share everything but the turn of the direction: their difference is what the frozen
/// frame makes the prediction err by, and nothing else.
#[test]
fn a_frozen_frame_costs_little_within_the_horizon() {
    for lean in [0.1, 0.35, 0.7] {
        let experiment = rolling(lean);
        let run = experiment.run();
        assert!(run.touched() && run.stop_reason().is_none(), "{lean} rad");
        let surface = experiment.scenario.surface.as_ref().expect("a surface");
        let (normal, stiffness) = (vector(&surface.normal), surface.stiffness_n_m);
        let mut worst = [0.0_f64; HORIZONS_S.len()];
        for at in in_contact(&run) {
            let forces = played(&experiment.config, &normal, stiffness, at).expect("a regular pose");
            for (worst, [frozen, turning]) in worst.iter_mut().zip(forces) {
                *worst = worst.max((frozen - turning).abs());
            }
        }
        println!(
            "{RATE} rad/s, up to {lean} rad of lean: a frozen direction errs by {:.4}, {:.3}, {:.2} and {:.2} N after 1, 5, 20 and 45 ms",
            worst[0], worst[1], worst[2], worst[3]
        );
        // A direction that is followed every cycle is never older than one.
        assert!(worst[0] < 0.05, "{lean} rad: {} N after a cycle", worst[0]);
    }
}
