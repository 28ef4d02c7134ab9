//! Which of its task axes an arm controls: any subset of x y z rx ry rz of the base frame.

use nalgebra::{SMatrix, SVector};

/// The axes that the task is on. On any other the rows of J and the columns of J⁻¹ are zero: nothing
/// is commanded there, and a wrench there is not the law's.
///
/// ```
/// use admittance_core::robot::TaskAxes;
/// use nalgebra::Vector6;
///
/// // A planar arm of three joints: x, y and rz.
/// let axes = TaskAxes::of([0, 1, 5]).expect("axes are from 0 to 5");
/// assert!(axes.has(5) && !axes.has(2));
/// assert_eq!(axes.kept(&Vector6::repeat(1.0)), Vector6::new(1.0, 1.0, 0.0, 0.0, 0.0, 1.0));
/// assert_eq!(TaskAxes::of([6]), None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaskAxes {
    mask: u8,
}

impl TaskAxes {
    /// All that an arm has.
    pub const ALL: Self = Self { mask: 0b11_1111 };

    /// These; `None` when one is none.
    pub fn of(axes: impl IntoIterator<Item = usize>) -> Option<Self> {
        axes.into_iter().try_fold(Self { mask: 0 }, |so_far, axis| {
            let mask = u8::try_from(1_u32.checked_shl(u32::try_from(axis).ok()?)?).ok()?;
            (mask & Self::ALL.mask != 0).then_some(Self { mask: so_far.mask | mask })
        })
    }

    /// Whether an axis is one of them.
    pub const fn has(self, axis: usize) -> bool {
        self.mask >> axis & 1 != 0
    }

    /// A wrench or twist without its components on other axes.
    pub fn kept<const D: usize>(self, vector: &SVector<f64, D>) -> SVector<f64, D> {
        SVector::from_fn(|axis, _| if self.has(axis) { vector[axis] } else { 0.0 })
    }

    /// What J J⁻¹ is: the identity on these axes.
    pub(super) fn identity<const D: usize>(self) -> SMatrix<f64, D, D> {
        SMatrix::from_fn(|row, column| if row == column && self.has(row) { 1.0 } else { 0.0 })
    }
}
