//! How far the surface may be tilted against the normal that was told.

use nalgebra::Vector3;

use super::Tuning;
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
const SLOWEST: f64 = 0.01;
/// The path over which the tilt across it is averaged, m.
const AVERAGED: f64 = 0.005;

/// The tilt since the touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tilt {
    /// The normal is the told one and this, base frame.
    pub of_normal: Vector3<f64>,
    /// Length of the path along the surface since then, m.
    pub path: f64,
}

impl Tilt {
    /// None.
    pub(super) fn none() -> Self {
        Self { of_normal: Vector3::zeros(), path: 0.0 }
    }

    /// The tilt across the path (base frame) that the direction of the force shows, where f̂ shows a
    /// pressing `force` and one `beside` it (N): friction drags along the `heading` that f̂ shows, and
    /// what is not along it is a tilt. The path itself says nothing of it, so no curve excuses more
    /// than the tolerance: a wrench with a bias would else turn the normal away.
    pub(super) fn across(
        &self,
        heading: &Vector3<f64>,
        way: &Way,
        (force, beside): (f64, &Vector3<f64>),
        tuning: &Tuning,
    ) -> Vector3<f64> {
        let (path, time) = (way.along(), way.duration());
        if path < SLOWEST * time || force < DIRECTION_NOISE * tuning.noise {
            return Vector3::zeros();
        }
        let across = |vector: &Vector3<f64>| vector - heading * heading.dot(vector);
        let tilt = across(beside) * (-(path / AVERAGED).min(1.0) / force.max(f64::MIN_POSITIVE));
        let (before, after) = (across(&self.of_normal).norm(), across(&(self.of_normal + tilt)).norm());
        if after <= before.max(tuning.tolerance) { tilt } else { Vector3::zeros() }
    }

    /// The slopes that are possible along a `heading` (base frame, length 1), beside that of the normal
    /// as it is: those of a surface that is curved a little, and of a force that is within the cone
    /// of friction, where f̂ shows a pressing `force` and one `beside` it along the heading (N).
    pub(super) fn slopes(&self, heading: &Vector3<f64>, force: f64, beside: f64, tuning: &Tuning) -> (f64, f64) {
        let most = tuning.tolerance + MOST_CURVED * self.path;
        let along = self.of_normal.dot(heading);
        let reach = libm::sqrt((most * most - self.of_normal.norm_squared() + along * along).max(0.0));
        let (least, most) = (-along - reach, -along + reach);
        // Along a slope s more the force beside is s times the pressing one more.
        let cone = MOST_FRICTION + DIRECTION_PART + DIRECTION_NOISE * tuning.noise / force.max(f64::MIN_POSITIVE);
        if force <= 0.0 {
            return (least, most);
        }
        let shown = beside / force;
        let (lower, upper) = (least.max(-cone - shown), most.min(cone - shown));
        if lower <= upper { (lower, upper) } else { (least, most) }
    }
}
