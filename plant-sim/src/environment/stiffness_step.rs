//! A surface that is stiffer, or softer, from a line on: a seam, an edge of a rib behind a sheet.

use nalgebra::Vector3;

/// A step in stiffness. It changes the force along the normal alone: nothing pushes sideways at it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StiffnessStep {
    /// Unit vector along which the stiffness changes.
    pub direction: Vector3<f64>,
    /// Where it is half done, in m along the direction from the surface's point.
    pub at: f64,
    /// Length in m over which it changes, in a straight line; 0 is a jump.
    pub width: f64,
    /// Stiffness behind it, N/m.
    pub stiffness: f64,
}

impl StiffnessStep {
    /// Stiffness in N/m at a place, from the surface's point, of a surface that has `before` (N/m) ahead
    /// of the step.
    pub(super) fn stiffness_at(&self, before: f64, place: &Vector3<f64>) -> f64 {
        let beyond = self.direction.dot(place) - self.at;
        let share =
            if self.width > 0.0 { (beyond / self.width + 0.5).clamp(0.0, 1.0) } else { f64::from(beyond > 0.0) };
        before + (self.stiffness - before) * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_where_it_says_and_as_wide() {
        let step = StiffnessStep { direction: Vector3::x(), at: 0.05, width: 0.004, stiffness: 5e5 };
        let at = |step: &StiffnessStep, x: f64| step.stiffness_at(1e5, &Vector3::new(x, 0.7, -0.001));
        // A quarter of the way at 1 mm before the middle of 4 mm: 1e5 + 0.25 · 4e5.
        for (x, expected) in [(0.0, 1e5), (0.048, 1e5), (0.049, 2e5), (0.05, 3e5), (0.052, 5e5), (1.0, 5e5)] {
            assert!((at(&step, x) - expected).abs() < 1e-3, "{} at {x}", at(&step, x));
        }
        let jump = StiffnessStep { width: 0.0, ..step };
        assert_eq!((at(&jump, 0.04999), at(&jump, 0.05001)), (1e5, 5e5));
    }
}
