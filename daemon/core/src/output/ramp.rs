//! Offsets on their way at a limited rate.

use nalgebra::SVector;

/// `offset`, brought towards zero by at most `step` on every axis.
pub(super) fn towards_zero<const D: usize>(offset: &SVector<f64, D>, step: f64) -> SVector<f64, D> {
    offset.map(|offset| if offset.abs() > step { offset - step.copysign(offset) } else { 0.0 })
}

/// `from`, brought towards `to` by at most `step` on every axis.
pub(super) fn towards<const D: usize>(from: &SVector<f64, D>, to: &SVector<f64, D>, step: f64) -> SVector<f64, D> {
    from.zip_map(to, |from, to| if (to - from).abs() <= step { to } else { from + step.copysign(to - from) })
}
