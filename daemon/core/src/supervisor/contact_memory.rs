//! What is remembered of a contact from cycle to cycle.

use nalgebra::SVector;

use crate::belief::Contact;

/// Speed in m/s at which the arm may follow a surface that falls away, or that came to it.
const FOLLOWING: f64 = 0.01;

/// The memory of one contact, from the first axis that joins until the last one leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactMemory<const D: usize> {
    /// Axes on which f̂ has reached f_min since they joined.
    reached: [bool; D],
    /// Largest s·f_lin on each axis, N.
    deepest: [f64; D],
    /// Largest speed of ṗ0 into the surface, m/s.
    approach: f64,
    /// Cycles in a row in which the force was not the predicted one.
    pub(super) mismatches: u32,
    /// Cycles in a row without a solution.
    pub(super) unsolved: u32,
}

impl<const D: usize> ContactMemory<D> {
    /// Of a contact that begins.
    pub(super) fn new() -> Self {
        Self { reached: [false; D], deepest: [0.0; D], approach: 0.0, mismatches: 0, unsolved: 0 }
    }

    /// Records which axes have reached f_min (N, N·m). An axis that was released starts anew when
    /// it joins again.
    pub(super) fn follow(&mut self, contact: &Contact<D>, wrench: &SVector<f64, D>, minimum_force: &SVector<f64, D>) {
        for (axis, reached) in self.reached.iter_mut().enumerate() {
            *reached = match contact.sign(axis) {
                Some(sign) => *reached || sign * wrench[axis] >= minimum_force[axis],
                None => false,
            };
        }
    }

    /// The largest speed into the surface that may be commanded, in m/s, now that ṗ0 moves out of
    /// it at `outward_speed`: what the approach had.
    pub(super) fn inward_speed(&mut self, outward_speed: f64) -> f64 {
        self.approach = self.approach.max(-outward_speed);
        self.approach.max(FOLLOWING)
    }

    /// Whether any axis has reached f_min.
    pub(super) fn has_reached(&self) -> bool {
        self.reached.contains(&true)
    }

    /// The lower bound of the force on an axis whose spring presses with `force` now, in N; −∞
    /// where none holds.
    ///
    /// f̂ lags behind; on the way to f_min the force that the spring has already reached is kept. A
    /// lost force is regained as the cost decides: under a hard bound it would return at full
    /// speed, and bounce.
    pub(super) fn lower_bound(&mut self, axis: usize, force: f64, minimum_force: f64) -> f64 {
        let deepest = &mut self.deepest[axis];
        *deepest = if force > 0.0 { deepest.max(force) } else { 0.0 };
        if *deepest > 0.0 { minimum_force.min(*deepest) } else { f64::NEG_INFINITY }
    }
}
