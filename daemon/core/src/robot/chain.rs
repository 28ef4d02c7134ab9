//! A serial chain of N joints, revolute or prismatic, described by data in the manner of URDF.

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Unit, UnitQuaternion, Vector3};

use super::{InverseJacobian, Resolution, Singular, TaskAxes, resolved_inverse};
use crate::quantities::on_task_axes;
use crate::turn::Turn;

/// How a joint moves along its axis: its position q is in rad or in m, and so are velocity,
/// acceleration, limits and rows of the Jacobian in units of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum JointKind {
    /// Turns about it: q in rad, right-handed.
    #[default]
    Revolute,
    /// Slides along it: q in m.
    Prismatic,
}

impl JointKind {
    /// Unit of q.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Revolute => "rad",
            Self::Prismatic => "m",
        }
    }
}

/// One joint: where it sits on its parent link, and what it turns about or slides along.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    /// Origin of the joint frame in the parent's frame, in m.
    pub origin: Vector3<f64>,
    /// Orientation of the joint frame in the parent's frame at q = 0.
    pub rotation: Matrix3<f64>,
    /// Axis in the joint frame; made a unit vector by [`Chain::new`]. Positive q turns right-handed
    /// about it, or slides along it.
    pub axis: Vector3<f64>,
    /// Which of the two.
    pub kind: JointKind,
}

impl Joint {
    /// Where q takes the link, in the joint frame; its axis is of length 1.
    pub(super) fn moved(&self, q: f64) -> Moved {
        match self.kind {
            JointKind::Revolute => {
                Moved::Turned(Rotation3::from_axis_angle(&Unit::new_unchecked(self.axis), q).into_inner())
            }
            JointKind::Prismatic => Moved::Slid(self.axis * q),
        }
    }
}

/// What a joint does to its link: the other part of the movement is none.
pub(super) enum Moved {
    /// By this rotation.
    Turned(Matrix3<f64>),
    /// By this way in m.
    Slid(Vector3<f64>),
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
    /// J(q), 6×N: rows x y z in m, then rx ry rz in rad, each per rad or m of its joint, in the base
    /// frame, at the TCP.
    pub jacobian: SMatrix<f64, 6, N>,
    /// The axes of the task.
    pub axes: TaskAxes,
    /// Which joint velocity a twist stands for.
    pub resolution: Resolution<N>,
}

impl<const N: usize> Kinematics<N> {
    /// The D task rows of the Jacobian, D×N; zero on axes that are none of the task.
    pub fn task_jacobian<const D: usize>(&self) -> SMatrix<f64, D, N> {
        SMatrix::from_fn(|axis, joint| if self.axes.has(axis) { self.jacobian[(axis, joint)] } else { 0.0 })
    }

    /// The inverse of that; see [`resolved_inverse`].
    ///
    /// # Errors
    /// [`Singular`] with the reciprocal condition number found.
    pub fn inverse<const D: usize>(&self, least: f64) -> Result<InverseJacobian<N, D>, Singular> {
        resolved_inverse(&self.task_jacobian(), self.axes, &self.resolution, least)
    }
}

/// A serial chain of N joints with a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chain<const N: usize> {
    joints: [Joint; N],
    tool: Pose,
    axes: TaskAxes,
    resolution: Resolution<N>,
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
        Ok(Self { joints, tool, axes: TaskAxes::ALL, resolution: Resolution::LEAST_NORM })
    }

    /// The same with a task on these axes only.
    #[must_use]
    pub fn with_axes(self, axes: TaskAxes) -> Self {
        Self { axes, ..self }
    }

    /// The same with another joint velocity for a twist than that of least norm.
    #[must_use]
    pub fn with_resolution(self, resolution: Resolution<N>) -> Self {
        Self { resolution, ..self }
    }

    /// The same arm in the base frame that a turn leads to: pose, Jacobian and task axes are in that
    /// one.
    #[must_use]
    pub(crate) fn seen_from(mut self, turn: &Turn) -> Self {
        if let Some(first) = self.joints.first_mut() {
            let Pose { position, rotation } = turn.pose(&Pose { position: first.origin, rotation: first.rotation });
            (first.origin, first.rotation) = (position, rotation);
        }
        self
    }

    /// The axes of the task: all, unless it was told.
    pub fn axes(&self) -> TaskAxes {
        self.axes
    }

    /// Which joint velocity a twist stands for: that of least norm, unless it was told.
    pub fn resolution(&self) -> &Resolution<N> {
        &self.resolution
    }

    /// The joints, base first, their axes of length 1.
    pub fn joints(&self) -> &[Joint; N] {
        &self.joints
    }

    /// Pose of the TCP in the last link's frame.
    pub fn tool(&self) -> &Pose {
        &self.tool
    }

    /// Ψ(q) and J(q) at the joint position q in rad or m.
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
            match joint.moved(q[index]) {
                Moved::Turned(turn) => rotation *= turn,
                Moved::Slid(way) => position += rotation * way,
            }
        }
        position += rotation * self.tool.position;
        rotation *= self.tool.rotation;
        let mut jacobian = SMatrix::zeros();
        for (index, joint) in self.joints.iter().enumerate() {
            let axis = axes[index];
            let (linear, angular) = match joint.kind {
                JointKind::Revolute => (axis.cross(&(position - origins[index])), axis),
                JointKind::Prismatic => (axis, Vector3::zeros()),
            };
            for row in 0..3 {
                jacobian[(row, index)] = linear[row];
                jacobian[(row + 3, index)] = angular[row];
            }
        }
        Kinematics { pose: Pose { position, rotation }, jacobian, axes: self.axes, resolution: self.resolution }
    }
}
