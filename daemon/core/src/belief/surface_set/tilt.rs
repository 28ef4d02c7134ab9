//! How far the surface may be tilted against the normal that was told.

use nalgebra::Vector3;

use crate::belief::way::Way;

/// How fast a surface curves at most along the path, rad/m: a radius of 0.1 m.
const MOST_CURVED: f64 = 10.0;
/// Largest coefficient of friction.
const MOST_FRICTION: f64 = 0.5;
/// Part of the pressing force that the wrench's direction may be wrong by, beside its noise.
const DIRECTION_PART: f64 = 0.1;
/// The same in deviations of the noise.
const DIRECTION_NOISE: f64 = 5.0;
/// Slowest slide whose friction has a direction, m/s.
const SLIDING: f64 = 0.01;
/// The path over which the tilt across it is averaged, m.
const AVERAGED: f64 = 0.005;

/// The tilt since the touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tilt {
    /// The normal is the told one and this, base frame.
    pub of_normal: Vector3<f64>,
    /// Length of the path along the surface since then, m.
    pub path: f64,
    /// By how much the told normal may be wrong, as a slope.
    pub tolerance: f64,
    /// Standard deviation of f̂, N.
    pub noise: f64,
}

impl Tilt {
    /// None, for a normal that is told with a tolerance (as a slope).
    pub(super) fn none(tolerance: f64, noise: f64) -> Self {
        Self { of_normal: Vector3::zeros(), path: 0.0, tolerance, noise }
    }

    /// How far the normal has turned at most, as a slope.
    fn most(&self) -> f64 {
        self.tolerance + MOST_CURVED * self.path
    }

    /// The tilt across the path (base frame) that the direction of the force shows, where f̂ shows a
    /// pressing `force` and one `beside` it (N): friction is along the path, and what is not is a
    /// tilt. The path itself says nothing of it.
    pub(super) fn across(
        &self,
        heading: &Vector3<f64>,
        way: &Way,
        (force, beside): (f64, &Vector3<f64>),
    ) -> Vector3<f64> {
        let (path, time) = (way.along(), way.duration());
        if path < SLIDING * time || force < DIRECTION_NOISE * self.noise {
            return Vector3::zeros();
        }
        let across = beside - heading * heading.dot(beside);
        let tilt = across * (-(path / AVERAGED).min(1.0) / force.max(f64::MIN_POSITIVE));
        if (self.of_normal + tilt).norm() <= self.most() { tilt } else { Vector3::zeros() }
    }

    /// The slopes that are possible along a `heading` (base frame, length 1), beside that of the normal
    /// as it is: those of a surface that is curved a little, and of a force that is within the cone
    /// of friction, where f̂ shows a pressing `force` and one `beside` it along the heading (N).
    pub(super) fn slopes(&self, heading: &Vector3<f64>, force: f64, beside: f64) -> (f64, f64) {
        let most = self.most();
        let along = self.of_normal.dot(heading);
        let reach = libm::sqrt((most * most - self.of_normal.norm_squared() + along * along).max(0.0));
        let (least, most) = (-along - reach, -along + reach);
        // Along a slope s more the force beside is s times the pressing one more.
        let cone = MOST_FRICTION + DIRECTION_PART + DIRECTION_NOISE * self.noise / force.max(f64::MIN_POSITIVE);
        if force <= 0.0 {
            return (least, most);
        }
        let shown = beside / force;
        let (lower, upper) = (least.max(-cone - shown), most.min(cone - shown));
        if lower <= upper { (lower, upper) } else { (least, most) }
    }
}
