//! How the joints really move: q̇ is reported late by some controllers, q̈ by none. Both follow
//! from the references that the joints were given, corrected by what is reported.

use nalgebra::SVector;

use crate::intake::Accepted;
use crate::mpc::Discretization;
use crate::output::UnderWay;
use crate::quantities::Span;
use crate::redundancy::NullMotion;
use crate::robot::{Chain, VelocityLoops};
use crate::turn::Turn;

/// Longest time between two samples over which the loops are run along. Of the references in
/// between as many are known as commands are kept: over a longer gap the first part counts as
/// without an offset, and what that leaves wrong in q̈ fades with exp(−2ζω t). Beyond this no joint
/// counts as accelerated.
const LONGEST: Span = Span::from_nanoseconds(100_000_000);

/// q̇ and q̈ of the joints at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointMotion<const N: usize> {
    /// q̇ in rad/s.
    pub velocity: SVector<f64, N>,
    /// q̈ in rad/s²; 0 of loops of first order.
    pub acceleration: SVector<f64, N>,
}

/// An observer of the joints' motion.
///
/// It runs the speed loops under the references that the joints were given. What the reported q̇
/// then shows beyond the predicted one is taken for q̇, whose error so fades with the lag of the
/// report; that of q̈ fades with exp(−2ζω t).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct JointObserver<const N: usize, const D: usize> {
    loops: VelocityLoops<N>,
    motion: JointMotion<N>,
    /// The sample that this motion is of.
    last: Option<Accepted<N, D>>,
    /// Whether the motion of the first sample is known before it comes.
    is_resumed: bool,
}

impl<const N: usize, const D: usize> JointObserver<N, D> {
    /// Has seen nothing.
    pub(crate) fn new(loops: VelocityLoops<N>) -> Self {
        let motion = JointMotion { velocity: SVector::zeros(), acceleration: SVector::zeros() };
        Self { loops, motion, last: None, is_resumed: false }
    }

    /// Goes on from a recorded motion, which is that of the first sample to come.
    #[must_use]
    pub(crate) fn resuming(self, motion: &JointMotion<N>) -> Self {
        Self { motion: *motion, is_resumed: true, ..self }
    }

    /// Takes over the state of `old`, with these loops.
    pub(crate) fn take_over(&mut self, old: &Self) {
        let Self { loops: _, motion, last, is_resumed } = *old;
        (self.motion, self.last, self.is_resumed) = (motion, last, is_resumed);
    }

    /// Goes over to the frame that a turn leads to; `chain` is the arm in it.
    pub(crate) fn turn(&mut self, chain: &Chain<N>, turn: &Turn) {
        if let Some(last) = &mut self.last {
            last.turn(chain, turn);
        }
    }

    /// The motion at the last sample.
    pub(crate) fn motion(&self) -> &JointMotion<N> {
        &self.motion
    }

    /// The motion at `sample`, by the commands `under_way` since the sample before,
    /// and what was told `beside` them.
    pub(crate) fn follow(
        &mut self,
        sample: &Accepted<N, D>,
        under_way: &UnderWay<D>,
        beside: &NullMotion<N>,
    ) -> JointMotion<N> {
        let reported = JointMotion { velocity: sample.joint_velocity, acceleration: SVector::zeros() };
        self.motion = match &self.last {
            _ if !self.loops.needs_estimate() => reported,
            None if self.is_resumed => self.motion,
            Some(last) if !sample.arrival.is_new_run && sample.stamp.since(last.stamp) <= LONGEST => {
                self.predict(last, sample, under_way, beside).unwrap_or(reported)
            }
            _ => reported,
        };
        self.last = self.loops.needs_estimate().then_some(*sample);
        self.motion
    }

    /// From the last sample on; `None` where J had no inverse.
    fn predict(
        &self,
        last: &Accepted<N, D>,
        sample: &Accepted<N, D>,
        under_way: &UnderWay<D>,
        beside: &NullMotion<N>,
    ) -> Option<JointMotion<N>> {
        let loops = &self.loops;
        let inverse = last.posture.inverse(0.0).ok()?;
        let reference = |offset: Option<SVector<f64, D>>| {
            offset.map_or_else(SVector::zeros, |offset| inverse.joint_velocity(&(last.twist_reference + offset)))
        };
        let (mut velocity, mut acceleration) = (self.motion.velocity, self.motion.acceleration);
        let mut shown = last.joint_velocity;
        let lag = loops.report_lag;
        let (dead_times, by_lag) = (loops.dead_times(), SVector::<f64, 1>::new(lag));
        for stretch in under_way.between(last.stamp, sample.stamp, dead_times) {
            let r = stretch.references(beside, dead_times, reference);
            let step = Discretization::Zoh.without_dead_time(stretch.duration, loops, &by_lag);
            if lag > 0.0 {
                // The filter of q̇ is the derivative of that of q: what q has done beyond it, over
                // the lag.
                let beyond = |moved: &SVector<f64, N>, filtered: SVector<f64, N>| (moved - filtered) / lag;
                let column = |from: usize| step.wrench_by[from].column(0).into_owned();
                shown = shown * step.wrench_decay[0]
                    + beyond(&step.position_by[0], column(0)).component_mul(&velocity)
                    + beyond(&step.position_by[1], column(1)).component_mul(&acceleration)
                    + beyond(&step.position_by_reference, step.wrench_by_reference.column(0).into_owned())
                        .component_mul(&r);
            }
            let next = |to: usize| {
                let by = &step.carried_by[to];
                by[0].component_mul(&velocity)
                    + by[1].component_mul(&acceleration)
                    + step.carried_by_reference[to].component_mul(&r)
            };
            (velocity, acceleration) = (next(0), next(1));
        }
        let expected = if lag > 0.0 { shown } else { velocity };
        velocity += sample.joint_velocity - expected;
        Some(JointMotion { velocity, acceleration })
    }
}
