//! The baseline: classic admittance control, Δṗ = −D⁻¹ f̂ (3).

use nalgebra::SVector;

/// Δṗ in m/s for the estimate `wrench` in N and the diagonal of D in N·s/m (N·m·s/rad on rotational
/// axes); zero on axes that are not admittance controlled.
pub(super) fn velocity_offset<const D: usize>(
    damping: &SVector<f64, D>,
    admittance: &[bool; D],
    wrench: &SVector<f64, D>,
) -> SVector<f64, D> {
    SVector::from_fn(|axis, _| if admittance[axis] { -wrench[axis] / damping[axis] } else { 0.0 })
}
