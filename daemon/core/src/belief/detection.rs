//! Where the contact point is, from the first samples that feel it.
//!
//! When f̂ exceeds β the TCP is already deep in the surface, because the wrench filter lags behind;
//! so the pose at that instant is not the contact point. The depth d of the TCP along the inward
//! normal is known at every sample, and its rate. What the filter (6) makes of the spring k max(0,
//! d − d₀) is then known for every d₀; the one that explains the estimates best (least squares) is
//! the depth of the surface.

use nalgebra::SVector;

use super::Way;
use crate::intake::Accepted;
use crate::quantities::{Instant, Span};
use crate::surface::Surface;

/// Samples looked at.
const WINDOW: usize = 64;
/// Time constants of the filter looked at: what was before has faded.
const LAGS: f64 = 3.0;
/// Parts of a cycle over which the force counts as constant; the largest error is that of the part
/// with the first touch.
const PARTS: usize = 16;
/// Most Gauss-Newton steps: the least squares are linear but for the first touch.
const STEPS: usize = 16;
/// A step below this, in m, has settled.
const SETTLED: f64 = 1e-8;
/// Part of the last force below which a sample counts as before the touch, to start from.
const FAINT: f64 = 0.05;

/// One sample, seen along the inward normal.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Observation {
    stamp: Instant,
    /// −nᵀp in m.
    depth: f64,
    /// Its rate in m/s.
    speed: f64,
    /// −nᵀf̂ in N.
    pressing: f64,
    /// The depth in m in the middle of each part of the time since the sample before.
    parts: [f64; PARTS],
}

/// The last samples, and what follows from them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Detection {
    observations: [Observation; WINDOW],
    len: usize,
    /// The sample at which contact was noticed.
    noticed: Option<Instant>,
    /// By how much the force may be wrong because the contact point is uncertain, in N: two
    /// standard deviations.
    uncertainty: f64,
}

impl Detection {
    /// Nothing observed.
    pub(super) fn new() -> Self {
        let none =
            Observation { stamp: Instant::default(), depth: 0.0, speed: 0.0, pressing: 0.0, parts: [0.0; PARTS] };
        Self { observations: [none; WINDOW], len: 0, noticed: None, uncertainty: 0.0 }
    }

    /// Nothing observed yet; the contact point is known with this uncertainty.
    pub(super) fn with_uncertainty(uncertainty: f64) -> Self {
        Self { uncertainty, ..Self::new() }
    }

    /// Two standard deviations of the force, in N, that come from the uncertain contact point.
    pub(super) fn uncertainty(&self) -> f64 {
        self.uncertainty
    }

    /// Takes in a sample. `joint_velocity` is q̇ at it as it is believed to be, in rad/s or m/s; `way` the
    /// way since the sample before, where it is known better than by its ends.
    pub(super) fn observe<const N: usize, const D: usize>(
        &mut self,
        surface: &Surface<D>,
        sample: &Accepted<N, D>,
        joint_velocity: &SVector<f64, N>,
        way: Option<&Way>,
    ) {
        let posture = &sample.posture;
        let seen = Observation {
            stamp: sample.stamp,
            depth: -surface.height(&posture.pose().position),
            speed: -surface.outward_speed(&(posture.jacobian() * joint_velocity)),
            pressing: surface.pressing_force(&sample.wrench),
            parts: [0.0; PARTS],
        };
        self.push(seen, way);
    }

    /// In contact, moves the contact point of `surface` along its normal to where the samples say it is,
    /// as long as they reach back to before the contact was noticed. `lag` is T_est in s, `noise` the
    /// standard deviation of f̂ in N.
    pub(super) fn locate<const D: usize>(&mut self, surface: &mut Surface<D>, in_contact: bool, lag: f64, noise: f64) {
        if !in_contact {
            self.noticed = None;
            return;
        }
        let Some(Observation { stamp: now, .. }) = self.observations[..self.len].last().copied() else { return };
        let oldest = now - Span::from_seconds(LAGS * lag);
        let observations = &self.observations[..self.len];
        let first = observations.iter().position(|seen| seen.stamp >= oldest).unwrap_or(0);
        // One cycle at least.
        let window = &observations[first.min(self.len.saturating_sub(2))..];
        let noticed = *self.noticed.get_or_insert(now);
        let reaches_back = window.len() > 1 && window[0].stamp < noticed;
        if !reaches_back {
            return;
        }
        let stiffness = surface.normal_stiffness();
        let (depth, sensitivity) = surface_depth(window, lag, stiffness);
        if depth.is_finite() && sensitivity > 0.0 {
            self.uncertainty = 2.0 * noise * stiffness / sensitivity;
            surface.raise(-depth - surface.height(&surface.contact.position));
        }
    }

    /// The force of `surface`'s spring at the sample before the last, in N; negative above it.
    pub(super) fn spring_before<const D: usize>(&self, surface: &Surface<D>) -> f64 {
        let before = &self.observations[self.len.saturating_sub(2)];
        surface.normal_stiffness() * (before.depth + surface.height(&surface.contact.position))
    }

    fn push(&mut self, mut seen: Observation, way: Option<&Way>) {
        if self.len == WINDOW {
            self.observations.copy_within(1.., 0);
            self.len -= 1;
        }
        // After a restart of the motion controller everything begins anew.
        if self.len > 0 && seen.stamp <= self.observations[self.len - 1].stamp {
            self.len = 0;
        }
        if self.len > 0 {
            let last = &self.observations[self.len - 1];
            let middle = |part: usize| (part as f64 + 0.5) / PARTS as f64;
            seen.parts = match way {
                Some(way) => core::array::from_fn(|part| way.depth_at(middle(part) * way.duration())),
                None => core::array::from_fn(|part| depth_between(last, &seen, middle(part))),
            };
        }
        self.observations[self.len] = seen;
        self.len += 1;
    }
}

/// The depth d₀ of the surface that explains the estimates of `window` best, and √Σ (∂f̂/∂d₀)² in
/// N/m.
fn surface_depth(window: &[Observation], lag: f64, stiffness: f64) -> (f64, f64) {
    // From the last sample with almost no force: from there on everything touches.
    let faint = FAINT * window[window.len() - 1].pressing;
    let before = window[..window.len() - 1].iter().rposition(|seen| seen.pressing < faint).unwrap_or(0);
    let mut surface = window[before].depth;
    let mut squares = 0.0;
    for _ in 0..STEPS {
        let (mut estimate, mut sensitivity) = (window[0].pressing, 0.0);
        let mut products = 0.0;
        squares = 0.0;
        for pair in window.windows(2) {
            let duration = pair[1].stamp.since(pair[0].stamp).seconds();
            let decay = if lag > 0.0 { libm::exp(-duration / (lag * PARTS as f64)) } else { 0.0 };
            for depth in &pair[1].parts {
                let pressed = depth - surface;
                let touches = if pressed > 0.0 { 1.0 } else { 0.0 };
                estimate = decay * estimate + (1.0 - decay) * stiffness * pressed * touches;
                sensitivity = decay * sensitivity + (1.0 - decay) * stiffness * touches;
            }
            if lag <= 0.0 {
                let pressed = pair[1].depth - surface;
                let touches = if pressed > 0.0 { 1.0 } else { 0.0 };
                (estimate, sensitivity) = (stiffness * pressed * touches, stiffness * touches);
            }
            products += sensitivity * (pair[1].pressing - estimate);
            squares += sensitivity * sensitivity;
        }
        if squares <= 0.0 {
            break;
        }
        let step = products / squares;
        surface -= step;
        if step.abs() < SETTLED {
            break;
        }
    }
    (surface, libm::sqrt(squares))
}

/// The depth at a part of the time between two samples: the cubic with their depths and rates.
fn depth_between(a: &Observation, b: &Observation, x: f64) -> f64 {
    let duration = b.stamp.since(a.stamp).seconds();
    let change = b.depth - a.depth;
    let (start, end) = (a.speed * duration - change, change - b.speed * duration);
    a.depth + x * change + x * (1.0 - x) * ((1.0 - x) * start + x * end)
}
