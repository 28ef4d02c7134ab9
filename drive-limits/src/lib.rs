//! What drives allow of a stream of joint velocity references: each joint's speed, the change from one
//! reference to the next over the time between them (acceleration), and the change of that (jerk).
//!
//! Daemon and motion controller share this: the daemon plans within the limits, and a controller that
//! is left alone, or whose own command jumps, ramps within them.
//!
//! ```
//! use admittance_drive_limits::{DriveLimits, Reference};
//!
//! let limits = DriveLimits { speed: [2.62, 5.26], acceleration: [10.0; 2], jerk: [5000.0; 2] };
//! // An arm in motion is told to stand still, 1000 times a second.
//! let mut reference = Reference::steady([0.5, -0.2]);
//! let mut ticks = 0;
//! while reference != Reference::steady([0.0; 2]) {
//!     reference = limits.follow(&reference, 0.001, &[0.0; 2]);
//!     ticks += 1;
//! }
//! // 0.5 rad/s at 10 rad/s², and a tick or two at each end for the jerk.
//! assert_eq!(ticks, 52);
//! ```
#![no_std]
#![forbid(unsafe_code)]

/// Part of a limit by which rounding may put a reference beyond it.
const ROUNDING: f64 = 1e-9;

/// The limits of N joints; infinite where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveLimits<const N: usize> {
    /// Largest |r| in rad/s or m/s.
    pub speed: [f64; N],
    /// Largest |r_k − r_{k−1}| / h in rad/s² or m/s², where h is the time between the two.
    pub acceleration: [f64; N],
    /// Largest change of that over h, in rad/s³ or m/s³.
    pub jerk: [f64; N],
}

/// A streamed reference, and how it has just changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reference<const N: usize> {
    /// r in rad/s or m/s.
    pub velocity: [f64; N],
    /// Its change from the one before over the time between them, in rad/s² or m/s².
    pub acceleration: [f64; N],
}

impl<const N: usize> Reference<N> {
    /// One that does not change.
    pub fn steady(velocity: [f64; N]) -> Self {
        Self { velocity, acceleration: [0.0; N] }
    }

    /// The one after it: `velocity`, streamed `since` s later.
    #[must_use]
    pub fn then(&self, velocity: [f64; N], since: f64) -> Self {
        Self { velocity, acceleration: core::array::from_fn(|joint| (velocity[joint] - self.velocity[joint]) / since) }
    }
}

impl<const N: usize> DriveLimits<N> {
    /// Nothing is limited.
    pub const NONE: Self =
        Self { speed: [f64::INFINITY; N], acceleration: [f64::INFINITY; N], jerk: [f64::INFINITY; N] };

    /// Whether `velocity` may be streamed `since` s after `before`, and leaves a way to stay within the limits.
    pub fn allow(&self, before: &Reference<N>, since: f64, velocity: &[f64; N]) -> bool {
        (0..N).all(|joint| {
            let acceleration = (velocity[joint] - before.velocity[joint]) / since;
            let most = self.acceleration[joint];
            let change = self.jerk[joint] * since;
            // Rounding of a velocity counts 1/h times in its change, and once more in the change of that.
            let rounding = ROUNDING * before.velocity[joint].abs().max(velocity[joint].abs()) / since;
            // What it goes on to until its acceleration has faded.
            let extreme = velocity[joint] + way_until_steady(acceleration, change, since);
            acceleration.abs() <= most * (1.0 + ROUNDING) + rounding
                && (acceleration - before.acceleration[joint]).abs() <= change * (1.0 + ROUNDING) + 2.0 * rounding
                && extreme.abs().max(velocity[joint].abs()) <= self.speed[joint] * (1.0 + ROUNDING)
        })
    }

    /// The reference `since` s after `before` where every acceleration fades: in proportion, so that the arm keeps
    /// its direction, unless that would carry a joint past its part of `target`; then each as fast as its jerk allows.
    /// It is always allowed.
    pub fn coasting(&self, before: &Reference<N>, since: f64, target: &[f64; N]) -> [f64; N] {
        let change = |joint: usize| self.jerk[joint] * since;
        let fading = |joint: usize| change(joint) / before.acceleration[joint].abs().max(f64::MIN_POSITIVE);
        let left = 1.0 - (0..N).map(fading).fold(1.0, f64::min);
        let together = before.acceleration.map(|acceleration| acceleration * left);
        let passes = |joint: usize| {
            let acceleration = together[joint];
            let velocity = before.velocity[joint] + acceleration * since;
            let beyond = velocity + way_until_steady(acceleration, change(joint), since) - target[joint];
            let rounding = ROUNDING * velocity.abs().max(target[joint].abs());
            acceleration != 0.0 && libm::copysign(1.0, acceleration) * beyond > rounding
        };
        let alone = |joint: usize| {
            let acceleration = before.acceleration[joint];
            acceleration - acceleration.clamp(-change(joint), change(joint))
        };
        let each = (0..N).any(passes);
        core::array::from_fn(|joint| before.velocity[joint] + if each { alone(joint) } else { together[joint] } * since)
    }

    /// The same direction, no joint faster than its limit.
    pub fn within_speed(&self, velocity: &[f64; N]) -> [f64; N] {
        let share = |joint: usize| self.speed[joint] / velocity[joint].abs().max(f64::MIN_POSITIVE);
        let share = (0..N).map(share).fold(1.0, f64::min);
        // What is at its limit but for rounding is left alone: the same again must be the same.
        if share < 1.0 - ROUNDING { velocity.map(|velocity| velocity * share) } else { *velocity }
    }

    /// The largest part of the way from `coasting` to `target` that may be gone `since` s after `before`, so
    /// that every joint can come to a steady `target` without passing it.
    pub fn share(&self, before: &Reference<N>, since: f64, coasting: &[f64; N], target: &[f64; N]) -> f64 {
        let share = |joint: usize| {
            let way = target[joint] - coasting[joint];
            let (direction, change) = (libm::copysign(1.0, way), self.jerk[joint] * since);
            let left = direction * (target[joint] - before.velocity[joint]);
            let most = self.acceleration[joint]
                .min(direction * before.acceleration[joint] + change)
                .min(most_towards(left, change, since));
            let reached = direction * before.velocity[joint] + most * since;
            // NaN only where there is no way to go.
            ((reached - direction * coasting[joint]) / way.abs()).max(0.0)
        };
        (0..N).filter(|joint| target[*joint] != coasting[*joint]).map(share).fold(1.0, f64::min)
    }

    /// What is streamed `since` s after `before` where `wanted` is: that itself if it is allowed, else
    /// as much of the way there as every joint allows, so that the arm keeps its direction.
    #[must_use]
    pub fn follow(&self, before: &Reference<N>, since: f64, wanted: &[f64; N]) -> Reference<N> {
        let target = self.within_speed(wanted);
        if self.allow(before, since, &target) {
            return before.then(target, since);
        }
        let coasting = self.coasting(before, since, &target);
        let share = self.share(before, since, &coasting, &target);
        let gone = |joint: usize| coasting[joint] + share * (target[joint] - coasting[joint]);
        before.then(core::array::from_fn(gone), since)
    }
}

/// What a reference still gains in rad/s while its acceleration fades by `change` at each tick of `since` s.
fn way_until_steady(acceleration: f64, change: f64, since: f64) -> f64 {
    let size = acceleration.abs();
    if size <= change {
        return 0.0;
    }
    let ticks = libm::floor(size / change);
    libm::copysign(since * (ticks * size - change * ticks * (ticks + 1.0) / 2.0), acceleration)
}

/// The largest acceleration towards a target `left` rad/s away from which the reference comes to a steady target
/// without passing it: h Σ (a − i change) = left over the ticks until that has faded.
fn most_towards(left: f64, change: f64, since: f64) -> f64 {
    let way = left / since;
    if way <= change {
        return way;
    }
    // Of a = m change the sum is change m (m + 1) / 2.
    let ticks = libm::ceil((libm::sqrt(1.0 + 8.0 * way / change) - 1.0) / 2.0);
    way / ticks + change * (ticks - 1.0) / 2.0
}
