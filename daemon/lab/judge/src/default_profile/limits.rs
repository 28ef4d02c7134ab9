//! Limits of speed, position and rate that an approach meets.

use admittance_core::robot::Interval;
use nalgebra::SVector;

use crate::sequence::{Problem, Sequence};

/// Range of each joint to either side of its start, rad: no approach gets that far.
const JOINT_ROOM: f64 = 0.2;
/// Limit of joint speeds, rad/s, that no approach meets.
const JOINT_SPEED: f64 = 10.0;
/// Least limit of a joint's speed, relative to the fastest commanded one: the approach itself is
/// never in its way.
const LEAST_SPEED: f64 = 1.02;
/// Limit of the speed into the surface, relative to the fastest one that is planned without a
/// limit.
const MOST_INWARD: f64 = 0.4;
/// Largest limit of joint speeds, relative to the fastest one that is planned without a limit.
const MOST_SPEED: f64 = 0.85;
/// Problems of the approach without limits that go beyond the limits.
const BEYOND: usize = 16;
/// The same of where a joint comes to rest, which its row sees long before.
const BEYOND_AT_REST: usize = 4;
/// Limit of the speed into the surface, m/s, that no approach meets.
const INWARD_SPEED: f64 = 10.0;
/// Largest limit of the offset's rate: m/s² and rad/s².
const RATE: f64 = 60.0;

/// The value that `beyond` of the values exceed (there is one per problem), and the largest of
/// them.
fn reached(mut values: Vec<f64>, beyond: usize) -> (f64, f64) {
    values.sort_by(|a, b| b.total_cmp(a));
    (values[beyond], values[0])
}

/// Limits that depend on the approach.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits<const N: usize> {
    /// Of the offset's rate on every axis, m/s² and rad/s².
    pub(super) rate: f64,
    /// Of the offset's speed into the surface, m/s.
    pub(super) inward_speed: f64,
    /// Of every joint's speed, either way, rad/s.
    pub(super) speed: Interval<N>,
    /// Of where the joints would come to rest, rad.
    pub(super) position: Interval<N>,
}

impl<const N: usize> Limits<N> {
    /// So wide that no approach reaches them.
    pub(super) fn wide(start: &SVector<f64, N>) -> Self {
        let room = SVector::repeat(JOINT_ROOM);
        let speed = Interval { lower: SVector::repeat(-JOINT_SPEED), upper: SVector::repeat(JOINT_SPEED) };
        let position = Interval { lower: start - room, upper: start + room };
        Self { rate: RATE, inward_speed: INWARD_SPEED, speed, position }
    }

    /// Limits that an approach reaches, from its motion without limits: speed and rate when it
    /// retreats at the impact, the position of one joint when it slides.
    pub(super) fn met_by<const M: usize>(
        free: &Sequence<N, M>,
        start: &SVector<f64, N>,
        normal: &SVector<f64, N>,
    ) -> Self {
        let mut limits = Self::wide(start);
        // Both ways: an arm retreats the other way.
        let mut commanded = [SVector::<f64, N>::zeros(); 2];
        let (mut speeds, mut rates, mut inwards) = (Vec::new(), Vec::new(), Vec::new());
        for problem in &free.problems {
            let known = problem.known_reference[0] + problem.drift;
            let (mut speed, mut rate, mut inward) = ([SVector::<f64, N>::zeros(); 2], 0.0_f64, 0.0_f64);
            let (mut before, mut since) = (problem.previous_input, free.horizon.steps()[0].duration);
            for (inputs, step) in problem.solution.chunks_exact(M).zip(free.horizon.steps()) {
                let input = SVector::from_fn(|axis, _| if axis < M { inputs[axis] } else { 0.0 });
                let reference = known + problem.model.jacobian_inverse * input;
                speed = [speed[0].sup(&-reference), speed[1].sup(&reference)];
                rate = rate.max((input - before).amax() / since);
                inward = inward.max(-normal.dot(&input));
                (before, since) = (input, step.duration);
            }
            commanded = [commanded[0].sup(&-known), commanded[1].sup(&known)];
            speeds.push(speed);
            rates.push(rate);
            inwards.push(inward);
        }
        limits.rate = reached(rates, BEYOND).0;
        limits.inward_speed = MOST_INWARD * reached(inwards, BEYOND).1;
        let speed = |way: usize, joint: usize| {
            let (beyond, most) = reached(speeds.iter().map(|speed| speed[way][joint]).collect(), BEYOND);
            beyond.min(MOST_SPEED * most).max(LEAST_SPEED * commanded[way][joint])
        };
        limits.speed = Interval {
            lower: SVector::from_fn(|joint, _| -speed(0, joint)),
            upper: SVector::from_fn(|joint, _| speed(1, joint)),
        };
        // One joint, one side: where the inputs have most to hold back.
        let mut most_held = 0.0;
        for (joint, sign) in (0..N).flat_map(|joint| [(joint, 1.0), (joint, -1.0)]) {
            let lag = free.horizon.until_rest()[0][joint];
            let away = |Problem { initial: x, .. }: &Problem<N>| {
                sign * (x.joint_position[joint] + lag * x.joint_velocity[joint] - start[joint])
            };
            // At the impact the joints are fast, and the other limits shall be met there.
            let sliding = &free.problems[free.problems.len() / 2..];
            let (beyond, most) = reached(sliding.iter().map(away).collect(), BEYOND_AT_REST);
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
