//! The way of the tool into the surface from one sample to the next: what the joints did under the
//! references that they were given, bent to where they were measured.

use nalgebra::SVector;

use super::joint_motion::JointMotion;
use super::way::{Piece, Way};
use crate::intake::Accepted;
use crate::mpc::Discretization;
use crate::output::UnderWay;
use crate::quantities::Span;
use crate::redundancy::NullMotion;
use crate::robot::{Chain, VelocityLoops};
use crate::surface::Surface;
use crate::turn::Turn;

/// Longest time between two samples over which the way is known.
const LONGEST: Span = Span::from_nanoseconds(100_000_000);
/// Length of a piece of the way, s, and most pieces of it that nothing else divides.
const PIECE: f64 = 0.0005;
const PIECES: f64 = 16.0;

/// Follows the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct WayObserver<const N: usize, const D: usize> {
    loops: VelocityLoops<N>,
    last: Option<(Accepted<N, D>, JointMotion<N>)>,
}

impl<const N: usize, const D: usize> WayObserver<N, D> {
    /// Has seen nothing.
    pub(crate) fn new(loops: VelocityLoops<N>) -> Self {
        Self { loops, last: None }
    }

    /// Takes over the state of `old`, with these loops; where it did not follow the way, what this one
    /// last saw is too old.
    pub(crate) fn take_over(&mut self, old: Option<&Self>) {
        self.last = old.and_then(|old| old.last);
    }

    /// Goes over to the frame that a turn leads to; `chain` is the arm in it.
    pub(crate) fn turn(&mut self, chain: &Chain<N>, turn: &Turn) {
        if let Some((last, _)) = &mut self.last {
            last.turn(chain, turn);
        }
    }

    /// The way to `sample`, at which the joints have this motion, by the commands `under_way` since
    /// the sample before and what was told `beside` them; `None` where that is not known. Of the `surface` only the normal counts.
    pub(crate) fn follow(
        &mut self,
        sample: &Accepted<N, D>,
        motion: &JointMotion<N>,
        (under_way, beside): (&UnderWay<D>, &NullMotion<N>),
        surface: &Surface<D>,
    ) -> Option<Way> {
        let last = self.last.as_ref().filter(|(last, _)| {
            !sample.arrival.is_new_run && sample.stamp > last.stamp && sample.stamp.since(last.stamp) <= LONGEST
        });
        let way =
            last.and_then(|(last, before)| self.way((last, before), (sample, motion), (under_way, beside), surface));
        self.last = Some((*sample, *motion));
        way
    }

    fn way(
        &self,
        (last, before): (&Accepted<N, D>, &JointMotion<N>),
        (sample, motion): (&Accepted<N, D>, &JointMotion<N>),
        (under_way, beside): (&UnderWay<D>, &NullMotion<N>),
        surface: &Surface<D>,
    ) -> Option<Way> {
        let loops = &self.loops;
        let depth_at = |sample: &Accepted<N, D>| -surface.height(&sample.posture.pose().position);
        let inverse = last.posture.inverse(0.0).ok()?;
        let reference = |offset: Option<SVector<f64, D>>| {
            offset.map_or_else(SVector::zeros, |offset| inverse.joint_velocity(&(last.twist_reference + offset)))
        };
        // −nᵀJ, frozen: what it misses is bent in at the end.
        let lever = -last.posture.jacobian().tr_mul(&surface.normal);
        let start = depth_at(last);
        let (mut velocity, mut acceleration) = (before.velocity, before.acceleration);
        let (mut depth, mut way) = (start, Way::new());
        let longest = PIECE.max(sample.stamp.since(last.stamp).seconds() / PIECES);
        let dead_times = loops.dead_times();
        for stretch in under_way.between(last.stamp, sample.stamp, dead_times) {
            let r = stretch.references(beside, dead_times, reference);
            let pieces = libm::ceil(stretch.duration / longest - 1e-6).max(1.0);
            let duration = stretch.duration / pieces;
            let step = Discretization::Zoh.without_dead_time(duration, loops, &SVector::<f64, 0>::zeros());
            for _ in 0..pieces as usize {
                let moved = step.position_by[0].component_mul(&velocity)
                    + step.position_by[1].component_mul(&acceleration)
                    + step.position_by_reference.component_mul(&r);
                let next = |to: usize| {
                    let by = &step.carried_by[to];
                    by[0].component_mul(&velocity)
                        + by[1].component_mul(&acceleration)
                        + step.carried_by_reference[to].component_mul(&r)
                };
                let (end_velocity, end_acceleration) = (next(0), next(1));
                let end = depth + lever.dot(&moved);
                // The cubic with these depths and rates at both ends.
                let (rate, end_rate) = (lever.dot(&velocity), lever.dot(&end_velocity));
                let middle = 0.5 * (depth + end) + 0.125 * duration * (rate - end_rate);
                way.push(Piece { duration, depth: [depth, middle, end] });
                (velocity, acceleration, depth) = (end_velocity, end_acceleration, end);
            }
        }
        let wanted = -surface.outward_speed(&(sample.posture.jacobian() * motion.velocity));
        way.bend(depth_at(sample), lever.dot(&velocity), wanted);
        let moved = sample.posture.pose().position - last.posture.pose().position;
        way.beside = moved + surface.normal_direction() * (depth_at(sample) - start);
        Some(way)
    }
}
