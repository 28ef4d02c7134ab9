//! The force behind the estimate: f̂ with the lag of its filter taken out.
//!
//! Over a window W the filter (6) leaves a = e^(−W/T_est) of f̂, and adds what it makes of the force
//! f. So
//!
//! f̄ = (f̂(t) − a f̂(t − W)) / (1 − a)
//!
//! is exactly the mean of f over the window, with weights that fade with T_est into the past. It is f
//! where f is constant, f̂ + T_est df̂/dt for a short window, and never more than the largest f in the
//! window: what is too high in f̄ is too high in f. (The inverse for a force that is a straight line
//! between samples has a pole near −1: noise would ring in it.)
//!
//! White noise of the standard deviation σ in f̂ is σ √(1 + a²) / (1 − a) in f̄: a longer window has
//! less noise, and shows less of a brief peak. A dead time of the wrench moves the window into the past
//! by as much, and changes nothing else.

use nalgebra::SVector;

use crate::intake::Accepted;
use crate::quantities::{Instant, Span};

/// So many standard deviations are not noise: white noise at 1 kHz passes four of them every 16 s, five
/// every half hour.
pub const NOISE_DEVIATIONS: f64 = 5.0;
/// Part of the force limit that the noise of f̄ may take up.
const LARGEST_NOISE: f64 = 0.25;
/// Part of a cycle by which the window may be shorter than wanted. After a stamp that is late the next
/// seems close: what f̂ did in a whole cycle would be taken for what it did in a part of one.
const JITTER: f64 = 0.1;
/// Samples that are kept.
const KEPT: usize = 32;

/// The wrench of the last window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WithoutLag<const D: usize> {
    /// f̄ in N and N·m. As long as there is no whole window: f̂.
    pub wrench: SVector<f64, D>,
    /// Its standard deviation over that of f̂.
    pub noise_gain: SVector<f64, D>,
}

/// f̄ from f̂, with the samples that it needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LagInverse<const D: usize> {
    /// T_est per axis in s.
    time_constant: SVector<f64, D>,
    /// The window per axis in samples: the shortest with little enough noise.
    window: [usize; D],
    /// T_s.
    sampling_time: Span,
    /// The last samples of f̂, oldest first.
    stamps: [Instant; KEPT],
    wrenches: [SVector<f64, D>; KEPT],
    len: usize,
    force: WithoutLag<D>,
}

/// a and √(1 + a²) / (1 − a) of a window (s).
fn decay_and_gain(window: f64, time_constant: f64) -> (f64, f64) {
    let decay = if time_constant > 0.0 { libm::exp(-window / time_constant) } else { 0.0 };
    (decay, libm::sqrt(1.0 + decay * decay) / (1.0 - decay))
}

impl<const D: usize> LagInverse<D> {
    /// Nothing seen. `noise` is the standard deviation of f̂ per axis, `limit` the force that f̄ is to be
    /// held against (N, N·m).
    pub(super) fn new(
        time_constant: SVector<f64, D>,
        noise: &SVector<f64, D>,
        limit: &SVector<f64, D>,
        sampling_time: Span,
    ) -> Self {
        let window = core::array::from_fn(|axis| {
            let most = LARGEST_NOISE * limit[axis];
            let is_quiet = |samples: &usize| {
                let window = *samples as f64 * sampling_time.seconds();
                let (_, gain) = decay_and_gain(window, time_constant[axis]);
                // Over more than T_est f̄ is no faster than f̂.
                NOISE_DEVIATIONS * noise[axis] * gain <= most || window >= time_constant[axis]
            };
            (1..KEPT - 1).find(is_quiet).unwrap_or(KEPT - 1)
        });
        let force = WithoutLag { wrench: SVector::zeros(), noise_gain: SVector::repeat(1.0) };
        Self {
            time_constant,
            window,
            sampling_time,
            stamps: [Instant::default(); KEPT],
            wrenches: [SVector::zeros(); KEPT],
            len: 0,
            force,
        }
    }

    /// Takes over the samples of `old`.
    pub(super) fn take_over(&mut self, old: &Self) {
        let Self { time_constant: _, window: _, sampling_time: _, stamps, wrenches, len, force } = old;
        (self.stamps, self.wrenches, self.len, self.force) = (*stamps, *wrenches, *len, *force);
    }

    /// The wrench without the lag of f̂.
    pub(super) fn force(&self) -> &WithoutLag<D> {
        &self.force
    }

    /// Takes in a sample.
    pub(super) fn follow<const N: usize>(&mut self, sample: &Accepted<N, D>) {
        self.push(sample.stamp, &sample.wrench);
        let (now, last) = (sample.stamp, self.len - 1);
        for axis in 0..D {
            let least = self.sampling_time * (self.window[axis] as f64 - JITTER);
            let measured = sample.wrench[axis];
            let before = (0..last).rev().find(|before| now.since(self.stamps[*before]) >= least);
            // An ideal measurement needs no window.
            let before = before.filter(|_| self.time_constant[axis] > 0.0);
            (self.force.wrench[axis], self.force.noise_gain[axis]) = match before {
                None => (measured, 1.0),
                Some(before) => {
                    let window = now.since(self.stamps[before]).seconds();
                    let (decay, gain) = decay_and_gain(window, self.time_constant[axis]);
                    ((measured - decay * self.wrenches[before][axis]) / (1.0 - decay), gain)
                }
            };
        }
    }

    fn push(&mut self, stamp: Instant, wrench: &SVector<f64, D>) {
        if self.len == KEPT {
            self.stamps.copy_within(1.., 0);
            self.wrenches.copy_within(1.., 0);
            self.len -= 1;
        }
        // After a restart of the motion controller everything begins anew.
        if self.len > 0 && stamp <= self.stamps[self.len - 1] {
            self.len = 0;
        }
        (self.stamps[self.len], self.wrenches[self.len]) = (stamp, *wrench);
        self.len += 1;
    }
}

#[cfg(test)]
mod tests;
