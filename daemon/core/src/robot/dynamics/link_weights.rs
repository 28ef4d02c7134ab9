//! What each link's weight alone asks of the joints.

use nalgebra::{SMatrix, Vector3};

use super::at::DynamicsAt;
use super::spatial::{Force, Motion};

impl<const N: usize> DynamicsAt<'_, N> {
    /// Column l is the torque in N m (N where a joint slides) that holds link l: the columns add up to G. A link that weighs a
    /// hundredth more asks for a hundredth of its column more.
    pub fn link_weights(&self) -> SMatrix<f64, N, N> {
        let mut weights = SMatrix::zeros();
        let mut upward = Motion { linear: -self.arm.gravity, angular: Vector3::zeros() };
        for link in 0..N {
            upward = self.placements[link].body_has(&upward);
            let mut held: Force = &self.arm.links[link] * &upward;
            for joint in (0..=link).rev() {
                weights[(joint, link)] = self.along(joint, &held);
                held = self.placements[joint].parent_has(&held);
            }
        }
        weights
    }
}
