//! The arm between samples: the joints by their loops, held to what was measured at each sample.

use nalgebra::{Matrix3, SVector, Vector3};

use super::arm::{Arm, Joints};
use super::joint_loop::{Loop, Moving};
use super::reference::References;
use super::track::Track;

/// Longest step between two instants, s.
const STEP_S: f64 = 0.0005;

/// The arm at an instant.
pub(super) struct Instant {
    pub(super) time_s: f64,
    /// The sample at this instant, if it is one.
    pub(super) sample: Option<usize>,
    pub(super) rotation: Matrix3<f64>,
    pub(super) position: Vector3<f64>,
    /// Velocity of the TCP, m/s and rad/s.
    pub(super) linear: Vector3<f64>,
    pub(super) angular: Vector3<f64>,
}

/// The arm at the samples of a range of a track, and often enough between them.
pub(super) fn way(
    arm: &dyn Arm,
    track: &Track,
    references: &References,
    loops: &[Loop],
    samples: std::ops::Range<usize>,
) -> Vec<Instant> {
    let mut instants: Vec<(f64, usize, f64)> = Vec::new();
    for sample in samples.clone() {
        instants.push((track.time_s[sample], sample, 0.0));
        if sample + 1 < samples.end {
            let length_s = track.time_s[sample + 1] - track.time_s[sample];
            let pieces = (length_s / STEP_S - 1e-6).ceil().max(1.0) as usize;
            let between = (1..pieces).map(|piece| piece as f64 / pieces as f64);
            instants.extend(between.map(|share| (track.time_s[sample] + share * length_s, sample, share)));
        }
    }
    let first = samples.start;
    // From the track's beginning: how the arm got here is part of how it moves.
    let before = &track.time_s[..first];
    let at_s: Vec<f64> = before.iter().copied().chain(instants.iter().map(|(at_s, ..)| *at_s)).collect();
    let moved: Vec<Vec<Moving>> = loops
        .iter()
        .enumerate()
        .map(|(joint, model)| {
            let start = Moving::beginning(track.position[0][joint], track.velocity[0][joint]);
            model.follow(references, joint, &at_s, start).split_off(first)
        })
        .collect();
    let index: Vec<usize> = (0..instants.len()).filter(|at| instants[*at].2 == 0.0).collect();
    let off = |joint: usize, sample: usize| {
        index.get(sample - first).map_or(0.0, |at| track.position[sample][joint] - moved[joint][*at].position)
    };
    let at = |number: usize, (time_s, sample, share): (f64, usize, f64)| {
        let mut position: Joints = [0.0; 8];
        let mut velocity = SVector::<f64, 8>::zeros();
        for (joint, moved) in moved.iter().enumerate() {
            let (here, next) = (off(joint, sample), off(joint, (sample + 1).min(samples.end - 1)));
            position[joint] = moved[number].position + here + share * (next - here);
            velocity[joint] = moved[number].velocity;
        }
        let placed = arm.at(&position);
        let twist = placed.jacobian * velocity;
        Instant {
            time_s,
            sample: (share == 0.0).then_some(sample),
            rotation: placed.rotation,
            position: placed.position,
            linear: twist.fixed_rows::<3>(0).into_owned(),
            angular: twist.fixed_rows::<3>(3).into_owned(),
        }
    };
    instants.into_iter().enumerate().map(|(number, instant)| at(number, instant)).collect()
}
