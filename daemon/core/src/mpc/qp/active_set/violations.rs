//! Which rows are violated, and the order in which they are added.

use wide::f64x4;

use super::Run;
use crate::mpc::qp::RowState;
use crate::mpc::qp::lanes::{LANES, groups, groups_mut, largest_magnitude};

impl Run<'_, '_> {
    /// The largest violation times weight at z; 0 where all rows are met. The values become those
    /// at z.
    pub(super) fn worst_violation(&mut self, z: &[f64]) -> f64 {
        let qp = self.qp;
        qp.rows.values(z, self.values);
        let bounds = groups(qp.lower).iter().zip(groups(qp.upper)).zip(groups(qp.weight));
        let mut worst = f64x4::ZERO;
        for (value, ((lower, upper), weight)) in groups(self.values).iter().zip(bounds) {
            let value = f64x4::new(*value);
            let outside = (value - f64x4::new(*upper)).fast_max(f64x4::new(*lower) - value);
            worst = (outside * f64x4::new(*weight)).fast_max(worst);
        }
        worst.to_array().into_iter().fold(0.0, f64::max)
    }

    /// The values become the violations times weight, with the sign of their side.
    pub(super) fn list_violations(&mut self) {
        let qp = self.qp;
        let bounds = groups(qp.lower).iter().zip(groups(qp.upper)).zip(groups(qp.weight));
        for (value, ((lower, upper), weight)) in groups_mut(self.values).iter_mut().zip(bounds) {
            let here = f64x4::new(*value);
            let above = (here - f64x4::new(*upper)).fast_max(f64x4::ZERO);
            let below = (f64x4::new(*lower) - here).fast_max(f64x4::ZERO);
            *value = (f64x4::new(*weight) * (above - below)).to_array();
        }
    }

    /// Takes the largest violation of at least `least` (above zero) from the list, the first of
    /// equals.
    pub(super) fn next_violated(&mut self, least: f64) -> Option<(usize, RowState)> {
        let values = groups(self.values);
        let worst = largest_magnitude(self.values);
        if worst < least {
            return None;
        }
        let is_worst = |group: &[f64; LANES]| f64x4::new(*group).abs().simd_eq(f64x4::splat(worst)).any();
        let group = values.iter().position(is_worst)?;
        let row = group * LANES + values[group].iter().position(|value| value.abs() == worst)?;
        let side = if self.values[row] > 0.0 { RowState::Upper } else { RowState::Lower };
        self.values[row] = 0.0;
        Some((row, side))
    }
}
