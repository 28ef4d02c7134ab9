//! Arithmetic on one number per joint or axis, in the form that becomes vector instructions.

use nalgebra::SVector;

use crate::model::Step;

/// The numbers of a vector.
pub(super) fn array<const K: usize>(vector: &SVector<f64, K>) -> &[f64; K] {
    &vector.data.0[0]
}

/// Σ_i factors_i · rows_i.
#[inline(always)]
pub(super) fn combine<const K: usize, const R: usize>(rows: &[[f64; K]; R], factors: &[f64; R]) -> [f64; K] {
    let mut sum = [0.0; K];
    for i in 0..R {
        for k in 0..K {
            sum[k] += factors[i] * rows[i][k];
        }
    }
    sum
}

/// q and q̇ at the start of a step, or their sensitivities on the way back.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joints<const N: usize> {
    pub position: [f64; N],
    pub velocity: [f64; N],
}

impl<const N: usize> Joints<N> {
    pub(super) const ZERO: Self = Self { position: [0.0; N], velocity: [0.0; N] };

    /// q after a stretch: q + a q̇ + b r.
    #[inline(always)]
    pub(super) fn position_after(&self, a: &SVector<f64, N>, b: &SVector<f64, N>, reference: &[f64; N]) -> [f64; N] {
        let (a, b) = (array(a), array(b));
        core::array::from_fn(|i| self.position[i] + a[i] * self.velocity[i] + b[i] * reference[i])
    }

    /// One step forward under a joint velocity reference.
    #[inline(always)]
    pub(super) fn advance<const D: usize>(&mut self, step: &Step<N, D>, reference: &[f64; N]) {
        self.position = self.position_after(&step.position_by_velocity, &step.position_by_reference, reference);
        let (decay, by_reference) = (array(&step.velocity_decay), array(&step.velocity_by_reference));
        for i in 0..N {
            self.velocity[i] = decay[i] * self.velocity[i] + by_reference[i] * reference[i];
        }
    }

    /// Of sensitivities: one step back. Gives that to the reference during the step.
    #[inline(always)]
    pub(super) fn back<const D: usize>(&mut self, step: &Step<N, D>) -> [f64; N] {
        let (a, b) = (array(&step.position_by_velocity), array(&step.position_by_reference));
        let (c, d) = (array(&step.velocity_decay), array(&step.velocity_by_reference));
        let reference = core::array::from_fn(|i| b[i] * self.position[i] + d[i] * self.velocity[i]);
        for i in 0..N {
            self.velocity[i] = a[i] * self.position[i] + c[i] * self.velocity[i];
        }
        reference
    }

    /// Of sensitivities: adds one to q at a point of the step at whose start they stand. Gives that to the reference.
    #[inline(always)]
    pub(super) fn seed(&mut self, a: &SVector<f64, N>, b: &SVector<f64, N>, position: &[f64; N]) -> [f64; N] {
        let (a, b) = (array(a), array(b));
        for i in 0..N {
            self.position[i] += position[i];
            self.velocity[i] += a[i] * position[i];
        }
        core::array::from_fn(|i| b[i] * position[i])
    }
}
