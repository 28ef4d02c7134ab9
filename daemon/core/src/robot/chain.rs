//! A serial chain of N revolute joints, described by data in the manner of URDF.

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Unit, UnitQuaternion, Vector3};

use crate::quantities::on_task_axes;

/// One revolute joint: where it sits on its parent link and what it turns about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    /// Origin of the joint frame in the parent's frame, in m.
    pub origin: Vector3<f64>,
    /// Orientation of the joint frame in the parent's frame at q = 0.
    pub rotation: Matrix3<f64>,
    /// Axis of rotation in the joint frame; made a unit vector by [`Chain::new`]. Positive q turns
    /// right-handed about it.
    pub axis: Vector3<f64>,
}

impl Joint {
    /// Turn by q in rad about its axis, of length 1.
    pub(super) fn turn(&self, q: f64) -> Matrix3<f64> {
        Rotation3::from_axis_angle(&Unit::new_unchecked(self.axis), q).into_inner()
    }
}

/// Position and orientation of a frame in the base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Position in m.
    pub position: Vector3<f64>,
    /// Orientation: its columns are the frame's axes in the base frame.
    pub rotation: Matrix3<f64>,
}

impl Pose {
    /// The first D components of Ψ(self) − Ψ(reference): position difference in m, then the
    /// rotation vector in rad that turns `reference` into `self`, in the base frame.
    pub fn difference<const D: usize>(&self, reference: &Self) -> SVector<f64, D> {
        let translation = self.position - reference.position;
        let turn = Rotation3::from_matrix_unchecked(self.rotation * reference.rotation.transpose());
        let rotation = UnitQuaternion::from_rotation_matrix(&turn).scaled_axis();
        on_task_axes(&translation, &rotation)
    }
}

/// Pose of the TCP and geometric Jacobian at one joint position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematics<const N: usize> {
    /// Ψ(q): pose of the TCP in the base frame.
    pub pose: Pose,
    /// J(q), 6×N: rows x y z in m/rad, then rx ry rz in rad/rad, in the base frame, at the TCP.
    pub jacobian: SMatrix<f64, 6, N>,
}

impl<const N: usize> Kinematics<N> {
    /// The D task rows of the Jacobian, D×N.
    pub fn task_jacobian<const D: usize>(&self) -> SMatrix<f64, D, N> {
        SMatrix::from_fn(|axis, joint| self.jacobian[(axis, joint)])
    }
}

/// A serial chain of N revolute joints with a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chain<const N: usize> {
    joints: [Joint; N],
    tool: Pose,
}

/// Why a description is not a serial chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChainError {
    /// A joint's axis has no direction: its length is zero or not finite.
    Axis {
        /// Index of the joint, from 0.
        joint: usize,
    },
    /// An origin or rotation of this joint (or of the tool, `None`) is not finite or not a
    /// rotation.
    Frame {
        /// Index of the joint, from 0; `None` is the tool.
        joint: Option<usize>,
    },
}

impl core::fmt::Display for ChainError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Axis { joint } => write!(f, "joint {joint}: the axis must be a finite vector of length above zero"),
            Self::Frame { joint: Some(joint) } => write!(f, "joint {joint}: origin and rotation must be finite"),
            Self::Frame { joint: None } => write!(f, "tool: origin and rotation must be finite"),
        }
    }
}

impl core::error::Error for ChainError {}

/// Rotation from fixed-axis roll, pitch, yaw in rad (URDF's `rpy`): R = Rz(yaw) Ry(pitch) Rx(roll).
pub fn rotation_from_rpy(rpy: [f64; 3]) -> Matrix3<f64> {
    Rotation3::from_euler_angles(rpy[0], rpy[1], rpy[2]).into_inner()
}

fn is_frame(origin: &Vector3<f64>, rotation: &Matrix3<f64>) -> bool {
    let error = rotation * rotation.transpose() - Matrix3::identity();
    origin.iter().all(|value| value.is_finite()) && error.norm() < 1e-9 && rotation.determinant() > 0.0
}

impl<const N: usize> Chain<N> {
    /// A chain from its joints, base first, and the pose of the TCP in the last link's frame.
    ///
    /// # Errors
    /// [`ChainError`] when an axis has no direction or a frame is not finite.
    pub fn new(mut joints: [Joint; N], tool: Pose) -> Result<Self, ChainError> {
        for (index, joint) in joints.iter_mut().enumerate() {
            if !is_frame(&joint.origin, &joint.rotation) {
                return Err(ChainError::Frame { joint: Some(index) });
            }
            let length = joint.axis.norm();
            if !(length.is_finite() && length > 1e-12) {
                return Err(ChainError::Axis { joint: index });
            }
            joint.axis /= length;
        }
        if !is_frame(&tool.position, &tool.rotation) {
            return Err(ChainError::Frame { joint: None });
        }
        Ok(Self { joints, tool })
    }

    /// The joints, base first, their axes of length 1.
    pub fn joints(&self) -> &[Joint; N] {
        &self.joints
    }

    /// Pose of the TCP in the last link's frame.
    pub fn tool(&self) -> &Pose {
        &self.tool
    }

    /// Ψ(q) and J(q) at the joint position q in rad.
    pub fn kinematics(&self, q: &SVector<f64, N>) -> Kinematics<N> {
        let mut rotation = Matrix3::identity();
        let mut position = Vector3::zeros();
        let mut axes = [Vector3::zeros(); N];
        let mut origins = [Vector3::zeros(); N];
        for (index, joint) in self.joints.iter().enumerate() {
            position += rotation * joint.origin;
            rotation *= joint.rotation;
            axes[index] = rotation * joint.axis;
            origins[index] = position;
            rotation *= joint.turn(q[index]);
        }
        position += rotation * self.tool.position;
        rotation *= self.tool.rotation;
        let mut jacobian = SMatrix::zeros();
        for (joint, (axis, origin)) in axes.iter().zip(&origins).enumerate() {
            let linear = axis.cross(&(position - origin));
            for row in 0..3 {
                jacobian[(row, joint)] = linear[row];
                jacobian[(row + 3, joint)] = axis[row];
            }
        }
        Kinematics { pose: Pose { position, rotation }, jacobian }
    }
}
