//! A ṗ0 that is too fast for the joints.
//!
//! Where the motion controller asks for more than the joints may turn, on axes that have no offset,
//! the limits of joint speed, offset and speed into the surface can contradict one another,
//! whatever the force is. The arm turns that fast all the same, with or without an answer. So the
//! force is kept, and no joint is asked for more than ṗ0 itself asks of it.
//!
//! Limits of joint position are not widened: an arm that ṗ0 drives beyond one is stopped.

use nalgebra::{SMatrix, SVector};

use super::condensation::Prediction;

/// Part of a joint's speed that its limit is wider, for rounding.
const ROOM: f64 = 1e-3;

impl<const N: usize, const D: usize> Prediction<'_, N, D> {
    /// Widens the limits of joint speed so that the inputs may be as near to zero as their own
    /// limits allow, and where their rate is limited may go there. Returns whether there are such
    /// limits.
    pub(super) fn let_joints_follow(&mut self, jacobian_inverse: &SMatrix<f64, N, D>) -> bool {
        let is_at_once = self.constraints.rate.is_none();
        let Some(speed) = &mut self.constraints.joint_speed else { return false };
        let (mut lower, mut upper) = (SVector::zeros(), SVector::zeros());
        for &axis in self.inputs.as_slice() {
            let offset = self.constraints.offset.as_ref();
            let target = offset.map_or(0.0, |offset| 0.0_f64.max(offset.lower[axis]).min(offset.upper[axis]));
            let before = if is_at_once { target } else { self.previous_input[axis] };
            // Each axis on its way by itself.
            let column = jacobian_inverse.column(axis);
            let (one_end, other_end) = (column * before, column * target);
            lower += one_end.inf(&other_end);
            upper += one_end.sup(&other_end);
        }
        for known in self.known_reference {
            // What bounds the joints is the reference itself, without the drift of the turning arm.
            let known = known + self.drift;
            speed.lower = speed.lower.inf(&((known + lower) * (1.0 + ROOM)));
            speed.upper = speed.upper.sup(&((known + upper) * (1.0 + ROOM)));
        }
        true
    }
}
