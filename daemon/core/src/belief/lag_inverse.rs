//! The force behind the estimate: f̂ with the lag of its filter taken out.
//!
//! Over a window W the filter (6) leaves a = e^(−W/T_est) of f̂, and adds what it makes of the
//! force f. So
//!
//! f̄ = (f̂(t) − a f̂(t − W)) / (1 − a)
//!
//! is exactly the mean of f over the window, with weights that fade with T_est into the past. It is
//! f where f is constant, f̂ + T_est df̂/dt for a short window, and never more than the largest f
//! in the window: what is too high in f̄ is too high in f. (The inverse for a force that is a
//! straight line between samples has a pole near −1: noise would ring in it.)
//!
//! White noise of the standard deviation σ in f̂ is σ √(1 + a²) / (1 − a) in f̄: a longer window
//! has less noise, and shows less of a brief peak. Where even the longest one has more than the
//! force limit allows for, f̄ is held against that much more. A dead time of the wrench moves the
//! window into the past by as much, and changes nothing else.
//!
//! The inertia of a tool on the sensor is in f̂ by two ways of seeing its motion. The guard takes the
//! smaller f̄ of both: where q̇ is reported late, an arm that brakes hard would feign a force. So would one whose T_est is
//! another than told, by that share of the inertia: f̄ is less by what of it that may be.

use nalgebra::SVector;

use crate::intake::Accepted;
use crate::quantities::{Instant, Span};
use crate::turn::Turn;

/// So many standard deviations are not noise: white noise at 1 kHz passes four of them every 16 s,
/// five every half hour.
pub const NOISE_DEVIATIONS: f64 = 5.0;
/// Part of the force limit that the noise of f̄ may take up.
const LARGEST_NOISE: f64 = 0.25;
/// Part of a cycle by which the window may be shorter than wanted. After a stamp that is late the
/// next seems close: what f̂ did in a whole cycle would be taken for what it did in a part of one.
const JITTER: f64 = 0.1;
/// Samples that are kept.
const KEPT: usize = 32;

/// The wrench of the last window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WithoutLag<const D: usize> {
    /// f̄ in N and N·m. As long as there is no whole window: f̂.
    pub wrench: SVector<f64, D>,
    /// What of it is force by both ways of seeing the tool's motion, and whatever the filter makes of its inertia; 0 where
    /// they have other signs.
    pub certain: SVector<f64, D>,
    /// Its standard deviation over that of f̂.
    pub noise_gain: SVector<f64, D>,
    /// What noise may feign in N and N·m beyond what the window was to leave of it.
    pub noise_excess: SVector<f64, D>,
}

impl<const D: usize> WithoutLag<D> {
    /// The part of the wrench on an axis in N or N·m that may be noise, where f̂ has the standard
    /// deviation `noise`; 0 where that is not told.
    pub(crate) fn noise(&self, axis: usize, noise: f64) -> f64 {
        (NOISE_DEVIATIONS * self.noise_gain[axis] * noise).max(self.noise_excess[axis])
    }
}

/// A window of f̄ on one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseWindow {
    /// Its length in samples.
    pub samples: usize,
    /// Five standard deviations of the noise in f̄, in N or N·m.
    pub noise: f64,
    /// By how much those are more than a quarter of the force limit.
    pub excess: f64,
}

impl NoiseWindow {
    /// The shortest window in which noise of f̂ of the standard deviation `noise` takes up no more
    /// than a quarter of the force `limit` (both N, N·m), or the longest that is any use.
    /// `time_constant`: T_est in s.
    pub fn of(noise: f64, limit: f64, time_constant: f64, sampling_time: Span) -> Self {
        let most = LARGEST_NOISE * limit;
        let of = |samples: usize| {
            let (_, gain) = decay_and_gain(samples as f64 * sampling_time.seconds(), time_constant);
            let noise = NOISE_DEVIATIONS * noise * gain;
            // An ideal measurement needs no window.
            Self { samples, noise, excess: if time_constant > 0.0 { (noise - most).max(0.0) } else { 0.0 } }
        };
        // Over more than T_est f̄ is no faster than f̂.
        let is_long = |window: &Self| window.samples as f64 * sampling_time.seconds() >= time_constant;
        (1..KEPT - 1).map(of).find(|window| window.noise <= most || is_long(window)).unwrap_or_else(|| of(KEPT - 1))
    }
}

/// f̄ from f̂, with the samples that it needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LagInverse<const D: usize> {
    /// T_est per axis in s.
    time_constant: SVector<f64, D>,
    /// The window per axis: the shortest with little enough noise.
    window: [NoiseWindow; D],
    /// T_s.
    sampling_time: Span,
    /// The last samples of f̂, in a ring.
    stamps: [Instant; KEPT],
    wrenches: [Shown<D>; KEPT],
    /// Where the newest stands.
    newest: usize,
    /// How many there are.
    len: usize,
    force: WithoutLag<D>,
}

/// f̂ with the tool's inertia by q̇ as it is reported, and by the joint positions; and what of it that may feign.
type Shown<const D: usize> = [SVector<f64, D>; 3];

/// a and √(1 + a²) / (1 − a) of a window (s).
fn decay_and_gain(window: f64, time_constant: f64) -> (f64, f64) {
    let decay = if time_constant > 0.0 { libm::exp(-window / time_constant) } else { 0.0 };
    (decay, libm::sqrt(1.0 + decay * decay) / (1.0 - decay))
}

/// What both show of a force, however much of it is `feigned`: a tool whose inertia one of them misses is no force.
fn shown_by_both([one, other, feigned]: [f64; 3]) -> f64 {
    let least = if one * other < 0.0 {
        0.0
    } else if other.abs() < one.abs() {
        other
    } else {
        one
    };
    least.signum() * (least.abs() - feigned.abs()).max(0.0)
}

impl<const D: usize> LagInverse<D> {
    /// Nothing seen. `noise` is the standard deviation of f̂ per axis, `limit` the force that f̄ is
    /// to be held against (N, N·m).
    pub(super) fn new(
        time_constant: SVector<f64, D>,
        noise: &SVector<f64, D>,
        limit: &SVector<f64, D>,
        sampling_time: Span,
    ) -> Self {
        let window =
            core::array::from_fn(|axis| NoiseWindow::of(noise[axis], limit[axis], time_constant[axis], sampling_time));
        let force = WithoutLag {
            wrench: SVector::zeros(),
            certain: SVector::zeros(),
            noise_gain: SVector::repeat(1.0),
            noise_excess: SVector::zeros(),
        };
        Self {
            time_constant,
            window,
            sampling_time,
            stamps: [Instant::default(); KEPT],
            wrenches: [[SVector::zeros(); 3]; KEPT],
            newest: 0,
            len: 0,
            force,
        }
    }

    /// Takes over the samples of `old`.
    pub(super) fn take_over(&mut self, old: &Self) {
        let Self { time_constant: _, window: _, sampling_time: _, stamps, wrenches, newest, len, force } = old;
        (self.stamps, self.wrenches, self.newest, self.len) = (*stamps, *wrenches, *newest, *len);
        self.force = *force;
    }

    /// Goes over to the frame that a turn leads to. What is per direction, the window's noise, is told
    /// anew with the next sample.
    pub(super) fn turn(&mut self, turn: &Turn) {
        for wrench in self.wrenches.as_flattened_mut() {
            *wrench = turn.twist(wrench);
        }
        let WithoutLag { wrench, certain, noise_gain: _, noise_excess: _ } = &mut self.force;
        (*wrench, *certain) = (turn.twist(wrench), turn.twist(certain));
    }

    /// The wrench without the lag of f̂.
    pub(super) fn force(&self) -> &WithoutLag<D> {
        &self.force
    }

    /// Takes in a sample.
    pub(super) fn follow<const N: usize>(&mut self, sample: &Accepted<N, D>) {
        let shown = [sample.wrench, sample.wrench_by_position, sample.feigned_wrench];
        self.push(sample.stamp, &shown);
        let now = sample.stamp;
        for axis in 0..D {
            let least = self.sampling_time * (self.window[axis].samples as f64 - JITTER);
            let mut earlier = (1..self.len).map(|back| (self.newest + KEPT - back) % KEPT);
            let before = earlier.find(|before| now.since(self.stamps[*before]) >= least);
            // An ideal measurement needs no window.
            let before = before.filter(|_| self.time_constant[axis] > 0.0);
            let (means, gain, excess) = match before {
                None => (shown.map(|wrench| wrench[axis]), 1.0, 0.0),
                Some(before) => {
                    let window = now.since(self.stamps[before]).seconds();
                    let (decay, gain) = decay_and_gain(window, self.time_constant[axis]);
                    let mean = |of: usize| (shown[of][axis] - decay * self.wrenches[before][of][axis]) / (1.0 - decay);
                    ([0, 1, 2].map(mean), gain, self.window[axis].excess)
                }
            };
            (self.force.wrench[axis], self.force.certain[axis]) = (means[0], shown_by_both(means));
            self.force.noise_gain[axis] = gain;
            self.force.noise_excess[axis] = excess;
        }
    }

    fn push(&mut self, stamp: Instant, shown: &Shown<D>) {
        // After a restart of the motion controller everything begins anew.
        if self.len > 0 && stamp <= self.stamps[self.newest] {
            self.len = 0;
        }
        self.newest = (self.newest + 1) % KEPT;
        (self.stamps[self.newest], self.wrenches[self.newest]) = (stamp, *shown);
        self.len = (self.len + 1).min(KEPT);
    }
}

#[cfg(test)]
mod tests;
