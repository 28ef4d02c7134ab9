//! A turn of the frame that everything is expressed in: what is remembered goes along.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::quantities::on_task_axes;
use crate::robot::Pose;

/// From the vectors of one frame to those of another with the same origin.
///
/// ```
/// use admittance_core::Turn;
/// use nalgebra::{Matrix3, Vector3, Vector6};
///
/// // From the base frame to one whose x is the base frame's y.
/// let axes = Matrix3::from_columns(&[Vector3::y(), -Vector3::x(), Vector3::z()]);
/// let turn = Turn::between(&Matrix3::identity(), &axes);
/// assert_eq!(turn.vector(&Vector3::y()), Vector3::x());
/// assert_eq!(turn.twist(&Vector6::new(0.0, 2.0, 0.0, 0.0, 0.0, 3.0)), Vector6::new(2.0, 0.0, 0.0, 0.0, 0.0, 3.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn(Matrix3<f64>);

impl Turn {
    /// None: both frames are the same.
    pub fn none() -> Self {
        Self(Matrix3::identity())
    }

    /// From one frame to another, each given by its axes in the base frame, as columns.
    pub fn between(from: &Matrix3<f64>, to: &Matrix3<f64>) -> Self {
        Self(to.tr_mul(from))
    }

    /// A direction or position.
    pub fn vector(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        self.0 * vector
    }

    /// The same the other way round.
    pub fn back(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        self.0.tr_mul(vector)
    }

    /// This turn, and then another.
    #[must_use]
    pub(crate) fn then(&self, next: &Self) -> Self {
        Self(next.0 * self.0)
    }

    /// A twist or wrench at the TCP: its linear and its angular part. With two axes it lies in their
    /// plane, and stays there.
    pub fn twist<const D: usize>(&self, twist: &SVector<f64, D>) -> SVector<f64, D> {
        let half = |first: usize| Vector3::from_fn(|row, _| twist.get(first + row).copied().unwrap_or(0.0));
        on_task_axes(&self.vector(&half(0)), &self.vector(&half(3)))
    }

    /// A matrix that makes a wrench of a twist.
    pub(crate) fn matrix<const D: usize>(&self, matrix: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
        let mut half = *matrix;
        for (column, mut turned) in matrix.column_iter().zip(half.column_iter_mut()) {
            turned.copy_from(&self.twist(&column.into_owned()));
        }
        let mut whole = half;
        for (row, mut turned) in half.row_iter().zip(whole.row_iter_mut()) {
            turned.copy_from(&self.twist(&row.transpose()).transpose());
        }
        whole
    }

    /// A pose.
    pub(crate) fn pose(&self, pose: &Pose) -> Pose {
        Pose { position: self.vector(&pose.position), rotation: self.0 * pose.rotation }
    }
}
