//! Frames as URDF and the robot file both write them: an origin, and fixed-axis roll, pitch, yaw.

use admittance_core::robot::{Pose, rotation_from_rpy};
use nalgebra::{Matrix3, Vector3};

/// Largest angle that the robot file takes, in rad.
const LARGEST_ANGLE: f64 = 7.0;

/// A frame in another, with the angles that its rotation is from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub(super) pose: Pose,
    pub(super) rpy: [f64; 3],
}

impl Frame {
    /// The same frame.
    pub(super) fn identity() -> Self {
        Self { pose: Pose { position: Vector3::zeros(), rotation: Matrix3::identity() }, rpy: [0.0; 3] }
    }

    pub(super) fn of(pose: &urdf_rs::Pose) -> Self {
        let (position, rotation) = (Vector3::from(*pose.xyz), rotation_from_rpy(*pose.rpy));
        let rpy = if pose.rpy.iter().all(|angle| angle.abs() <= LARGEST_ANGLE) { *pose.rpy } else { rpy_of(&rotation) };
        Self { pose: Pose { position, rotation }, rpy }
    }

    /// `next`, which is given in this one. Where one of the two is the identity nothing is computed:
    /// the numbers stay those that a person knows from the URDF.
    pub(super) fn then(&self, next: &Self) -> Self {
        if *self == Self::identity() {
            return *next;
        }
        if *next == Self::identity() {
            return *self;
        }
        let position = self.pose.position + self.pose.rotation * next.pose.position;
        let rotation = self.pose.rotation * next.pose.rotation;
        Self { pose: Pose { position, rotation }, rpy: rpy_of(&rotation) }
    }
}

/// Roll, pitch and yaw of a rotation. At a pitch of a right angle roll and yaw turn about the same
/// axis: the roll is then what the yaw has left over, so that together they are right everywhere.
fn rpy_of(rotation: &Matrix3<f64>) -> [f64; 3] {
    let yaw = rotation[(1, 0)].atan2(rotation[(0, 0)]);
    let (sine, cosine) = yaw.sin_cos();
    let pitch = (-rotation[(2, 0)]).atan2(cosine * rotation[(0, 0)] + sine * rotation[(1, 0)]);
    let roll = (sine * rotation[(0, 2)] - cosine * rotation[(1, 2)])
        .atan2(cosine * rotation[(1, 1)] - sine * rotation[(0, 1)]);
    [roll, pitch, yaw]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_the_rotation_also_at_a_right_angle_of_pitch() {
        let right = std::f64::consts::FRAC_PI_2;
        let angles = [-3.1, -right, -0.4, 0.0, 1e-9, 0.7, right - 1e-11, 3.0];
        for roll in angles {
            for pitch in angles {
                for yaw in angles {
                    let rotation = rotation_from_rpy([roll, pitch, yaw]);
                    let error = (rotation_from_rpy(rpy_of(&rotation)) - rotation).amax();
                    assert!(error < 4e-15, "{roll} {pitch} {yaw}: {error}");
                }
            }
        }
    }
}
