//! The null space of J (remark 1): what the joints of a redundant arm may do without moving the task.

use nalgebra::{SMatrix, SVector};

use super::inverse::weighted_inverse;
use super::{Interval, Resolution, TaskAxes};

/// Times that every joint is looked at: each pass brings the joints nearer to where all are within
/// their bounds, the first is exact where one alone is beyond.
const PASSES: usize = 8;
/// Part of what a joint could move by itself that its null-space motion must be: below it the joint
/// belongs to the task, and asking it to move would throw the others about.
const LEAST_PART: f64 = 1e-3;

/// Joint velocities without effect on the task, as they are least in the norm of a resolution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NullSpace<const N: usize> {
    /// P = I − J⁻¹J.
    projector: SMatrix<f64, N, N>,
    /// P W⁻¹, symmetric: how all joints move when one of them is pushed.
    pushed: SMatrix<f64, N, N>,
    /// W⁻¹.
    mobility: SVector<f64, N>,
}

impl<const N: usize> NullSpace<N> {
    /// That of the task Jacobian J; `None` where it has no inverse. Never that of a damped one, which
    /// would move the task.
    pub fn of<const D: usize>(
        jacobian: &SMatrix<f64, D, N>,
        axes: TaskAxes,
        resolution: &Resolution<N>,
    ) -> Option<Self> {
        let inverse = weighted_inverse(jacobian, axes, resolution, 0.0).ok()?;
        let projector: SMatrix<f64, N, N> = SMatrix::identity() - inverse.matrix * jacobian;
        let mobility = resolution.mobility();
        let pushed = SMatrix::from_fn(|row, joint| projector[(row, joint)] * mobility[joint]);
        Some(Self { projector, pushed, mobility })
    }

    /// The part of a joint velocity (rad/s or m/s) that leaves the task where it is.
    pub fn project(&self, joint_velocity: &SVector<f64, N>) -> SVector<f64, N> {
        self.projector * joint_velocity
    }

    /// What has to be added to a joint velocity to bring every joint within its bounds, in rad/s or m/s,
    /// without effect on the task: as far as that is possible. Of joints that contradict one
    /// another the one nearest the tool is kept.
    pub fn brought_within(&self, joint_velocity: &SVector<f64, N>, bounds: &Interval<N>) -> SVector<f64, N> {
        let mut change = SVector::<f64, N>::zeros();
        for _ in 0..PASSES {
            // A projection onto one half-space after the other: continuous in everything that it starts from.
            for joint in 0..N {
                let speed: f64 = joint_velocity[joint] + change[joint];
                let beyond = speed - bounds.lower[joint].max(speed.min(bounds.upper[joint]));
                let own = self.pushed[(joint, joint)];
                if beyond != 0.0 && own > LEAST_PART * self.mobility[joint] {
                    change -= self.pushed.column(joint) * (beyond / own);
                }
            }
        }
        change
    }
}
