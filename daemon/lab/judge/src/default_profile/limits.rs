//! Limits of speed, position and rate that an approach meets.

use admittance_core::robot::Interval;
use nalgebra::SVector;

use crate::sequence::{Problem, Sequence};

/// Range of each joint to either side of its start, rad: no approach gets that far.
const JOINT_ROOM: f64 = 0.2;
/// Limit of joint speeds, rad/s, that no approach meets.
const JOINT_SPEED: f64 = 10.0;
/// Least limit of joint speeds, relative to the fastest commanded one: the approach itself is never
/// in its way.
const LEAST_SPEED: f64 = 1.02;
/// Largest limit of joint speeds, and of the speed into the surface, relative to the fastest one that
/// is planned without a limit.
const MOST_SPEED: f64 = 0.85;
/// Problems of the approach without limits that go beyond the limits.
const BEYOND: usize = 16;
/// Limit of the speed into the surface, m/s, that no approach meets.
const INWARD_SPEED: f64 = 10.0;
/// Largest limit of the offset's rate: m/s² and rad/s².
const RATE: f64 = 60.0;

/// The value that [`BEYOND`] of the values exceed (there is one per problem), and the largest of
/// them.
fn reached(mut values: Vec<f64>) -> (f64, f64) {
    values.sort_by(|a, b| b.total_cmp(a));
    (values[BEYOND], values[0])
}

/// Limits that depend on the approach.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits<const N: usize> {
    /// Of the offset's rate on every axis, m/s² and rad/s².
    pub(super) rate: f64,
    /// Of the offset's speed into the surface, m/s.
    pub(super) inward_speed: f64,
    /// Of every joint's speed, rad/s.
    pub(super) speed: f64,
    /// Of the joints' positions, rad.
    pub(super) position: Interval<N>,
}

impl<const N: usize> Limits<N> {
    /// So wide that no approach reaches them.
    pub(super) fn wide(start: &SVector<f64, N>) -> Self {
        let room = SVector::repeat(JOINT_ROOM);
        let position = Interval { lower: start - room, upper: start + room };
        Self { rate: RATE, inward_speed: INWARD_SPEED, speed: JOINT_SPEED, position }
    }

    /// Limits that an approach reaches, from its motion without limits: speed and rate when it
    /// retreats at the impact, the position of one joint when it slides.
    pub(super) fn met_by<const M: usize>(
        free: &Sequence<N, M>,
        start: &SVector<f64, N>,
        normal: &SVector<f64, N>,
    ) -> Self {
        let mut limits = Self::wide(start);
        let (mut commanded, mut speeds, mut rates, mut inwards) = (0.0_f64, Vec::new(), Vec::new(), Vec::new());
        for problem in &free.problems {
            let known = &problem.known_reference[0];
            let (mut speed, mut rate, mut inward) = (0.0_f64, 0.0_f64, 0.0_f64);
            let (mut before, mut since) = (problem.previous_input, free.horizon.steps()[0].duration);
            for (inputs, step) in problem.solution.chunks_exact(M).zip(free.horizon.steps()) {
                let input = SVector::from_fn(|axis, _| if axis < M { inputs[axis] } else { 0.0 });
                speed = speed.max((known + problem.model.jacobian_inverse * input).amax());
                rate = rate.max((input - before).amax() / since);
                inward = inward.max(-normal.dot(&input));
                (before, since) = (input, step.duration);
            }
            commanded = commanded.max(known.amax());
            speeds.push(speed);
            rates.push(rate);
            inwards.push(inward);
        }
        limits.rate = reached(rates).0;
        limits.inward_speed = MOST_SPEED * reached(inwards).1;
        let (beyond, most) = reached(speeds);
        limits.speed = beyond.min(MOST_SPEED * most).max(LEAST_SPEED * commanded);
        // One joint, one side: where the inputs have most to hold back.
        let mut most_held = 0.0;
        for (joint, sign) in (0..N).flat_map(|joint| [(joint, 1.0), (joint, -1.0)]) {
            let away = |problem: &Problem<N>| sign * (problem.initial.joint_position[joint] - start[joint]);
            let (beyond, most) = reached(free.problems.iter().map(away).collect());
            let inverse = &free.problems[0].model.jacobian_inverse;
            let held = (most - beyond) * (0..M).map(|axis| inverse[(joint, axis)].abs()).fold(0.0, f64::max);
            if held > most_held && beyond > 0.0 {
                most_held = held;
                limits.position = Self::wide(start).position;
                let bounds = if sign > 0.0 { &mut limits.position.upper } else { &mut limits.position.lower };
                bounds[joint] = start[joint] + sign * beyond;
            }
        }
        limits
    }
}
