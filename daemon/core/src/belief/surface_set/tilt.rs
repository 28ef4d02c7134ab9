//! How far the surface may be tilted against the normal that was told.

use nalgebra::Vector3;

/// How fast a surface curves at most along the path, rad/m: a radius of 0.1 m.
const MOST_CURVED: f64 = 10.0;
/// Largest coefficient of friction.
const MOST_FRICTION: f64 = 0.5;
/// Part of the pressing force that the wrench's direction may be wrong by, beside its noise.
const DIRECTION_PART: f64 = 0.1;
/// The same in deviations of the noise.
const DIRECTION_NOISE: f64 = 5.0;

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

    /// The slopes that are possible along a `heading` (base frame, length 1), beside that of the normal
    /// as it is: those of a surface that is curved a little, and of a force that is within the cone
    /// of friction, where f̂ shows a pressing `force` and one `beside` it along the heading (N).
    pub(super) fn slopes(&self, heading: &Vector3<f64>, force: f64, beside: f64) -> (f64, f64) {
        let most = self.tolerance + MOST_CURVED * self.path;
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
