//! Where the contact is: from the first samples that feel it. When f̂ passes β the TCP is already deep in the surface, by what
//! the wrench filter lags behind, so the pose at that instant is no contact point. The depth d of the TCP along the inward
//! normal is known at every sample, and its rate; what the filter (6) makes of the spring k max(0, d − d₀) is then known
//! for every d₀, and the one that explains the estimates best (least squares) is the surface's depth.

use crate::environment::Environment;
use crate::plan::nanoseconds;
use crate::robot::Kinematics;
use crate::sample::Sample;

/// Samples looked at.
const WINDOW: usize = 64;
/// Time constants of the filter looked at: what was before has faded.
const LAGS: f64 = 3.0;
/// Parts of a cycle over which the force counts as constant; the largest error is that part which holds the first touch.
const PARTS: usize = 16;
/// Most Gauss-Newton steps: the least squares are linear but for the first touch.
const STEPS: usize = 16;
/// Step in m that is none.
const SETTLED: f64 = 1e-8;
/// Part of the force at the end below which a sample counts as before the touch, to start from.
const FAINT: f64 = 0.05;

/// What one sample says along the inward normal.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Felt {
    /// ns.
    stamp: u64,
    /// −nᵀp in m.
    depth: f64,
    /// Its rate in m/s.
    speed: f64,
    /// −nᵀf̂ in N.
    pressing: f64,
}

/// The last samples, and what they say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Detection {
    felt: [Felt; WINDOW],
    len: usize,
    /// Stamp of the sample at which contact was noticed.
    noticed: Option<u64>,
    /// What the force may be off for not knowing the contact point better, in N: two standard deviations.
    uncertainty: f64,
}

impl Detection {
    /// Nothing felt.
    pub(crate) fn new() -> Self {
        let none = Felt { stamp: 0, depth: 0.0, speed: 0.0, pressing: 0.0 };
        Self { felt: [none; WINDOW], len: 0, noticed: None, uncertainty: 0.0 }
    }

    /// See [`Self`].
    pub(crate) fn uncertainty(&self) -> f64 {
        self.uncertainty
    }

    /// Takes a sample in. In contact, moves the contact point of `environment` along its normal to where the samples so far
    /// say that it is, as long as they reach back to before the contact was noticed. `lag` is T_est in s, `noise` the
    /// standard deviation of f̂ in N.
    pub(crate) fn update<const N: usize, const D: usize>(
        &mut self,
        environment: &mut Environment<D>,
        sample: &Sample<N, D>,
        kinematics: &Kinematics<N>,
        in_contact: bool,
        lag: f64,
        noise: f64,
    ) {
        self.push(Felt {
            stamp: sample.stamp,
            depth: -environment.height(&kinematics.pose.position),
            speed: -environment.outward_speed(&(kinematics.task_jacobian::<D>() * sample.joint_velocity)),
            pressing: environment.pressing_force(&sample.wrench),
        });
        if !in_contact {
            self.noticed = None;
            return;
        }
        let oldest = sample.stamp.saturating_sub(nanoseconds(LAGS * lag));
        let first = self.felt[..self.len].iter().position(|felt| felt.stamp >= oldest).unwrap_or(0);
        // One cycle at least.
        let window = &self.felt[first.min(self.len.saturating_sub(2))..self.len];
        let noticed = *self.noticed.get_or_insert(sample.stamp);
        let reaches_back = window.len() > 1 && window[0].stamp < noticed;
        if !reaches_back {
            return;
        }
        let stiffness = environment.normal_stiffness();
        let (surface, sensitivity) = surface_depth(window, lag, stiffness);
        if surface.is_finite() && sensitivity > 0.0 {
            self.uncertainty = 2.0 * noise * stiffness / sensitivity;
            environment.raise(-surface - environment.height(&environment.contact.position));
        }
    }

    fn push(&mut self, felt: Felt) {
        if self.len == WINDOW {
            self.felt.copy_within(1.., 0);
            self.len -= 1;
        }
        // Another run of the motion controller begins anew.
        if self.len > 0 && felt.stamp <= self.felt[self.len - 1].stamp {
            self.len = 0;
        }
        self.felt[self.len] = felt;
        self.len += 1;
    }
}

/// The depth d₀ of the surface that explains the estimates of `window` best, and √Σ (∂f̂/∂d₀)² in N/m.
fn surface_depth(window: &[Felt], lag: f64, stiffness: f64) -> (f64, f64) {
    // From the last sample that felt next to nothing: from there on everything touches.
    let faint = FAINT * window[window.len() - 1].pressing;
    let before = window[..window.len() - 1].iter().rposition(|felt| felt.pressing < faint).unwrap_or(0);
    let mut surface = window[before].depth;
    let mut squares = 0.0;
    for _ in 0..STEPS {
        let (mut estimate, mut sensitivity) = (window[0].pressing, 0.0);
        let mut products = 0.0;
        squares = 0.0;
        for pair in window.windows(2) {
            let duration = (pair[1].stamp - pair[0].stamp) as f64 * 1e-9;
            let decay = if lag > 0.0 { libm::exp(-duration / (lag * PARTS as f64)) } else { 0.0 };
            for part in 0..PARTS {
                let pressed = depth_between(pair, duration, (part as f64 + 0.5) / PARTS as f64) - surface;
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
fn depth_between(pair: &[Felt], duration: f64, x: f64) -> f64 {
    let (a, b) = (&pair[0], &pair[1]);
    let change = b.depth - a.depth;
    let (start, end) = (a.speed * duration - change, change - b.speed * duration);
    a.depth + x * change + x * (1.0 - x) * ((1.0 - x) * start + x * end)
}
