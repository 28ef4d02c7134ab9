//! Checks of a solver's answer that need no trust in the solver.

use super::Qp;

/// How far an answer is from satisfying the Karush-Kuhn-Tucker conditions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KktResidual {
    /// ‖Hz + g + Aᵀy‖∞ relative to the largest of its three parts (and 1).
    pub stationarity: f64,
    /// Largest violation of a bound, in the row's unit (N).
    pub violation: f64,
    /// Largest |y_i · slack_i| relative to the largest part of the gradient (and 1).
    pub complementarity: f64,
}

impl KktResidual {
    /// Whether all three are finite and within bounds: `tolerance` for the relative ones, `violation` in N.
    pub fn is_within(&self, tolerance: f64, violation: f64) -> bool {
        // Written so that NaN fails.
        self.stationarity <= tolerance && self.violation <= violation && self.complementarity <= tolerance
    }
}

/// Slack of a row towards the bound that its multiplier belongs to.
fn pushed_slack(value: f64, lower: f64, upper: f64, multiplier: f64) -> f64 {
    if multiplier >= 0.0 { upper - value } else { value - lower }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The residual of `z` with the multipliers `y`. O(n² + rows·n).
pub fn kkt_residual(qp: &Qp<'_>, z: &[f64], y: &[f64]) -> KktResidual {
    let n = qp.variables;
    let (mut worst, mut scale, mut finite) = (0.0_f64, 1.0_f64, true);
    for i in 0..n {
        let curvature = dot(&qp.hessian[i * n..(i + 1) * n], z);
        let pushed: f64 = (0..qp.rows).map(|row| qp.matrix[row * n + i] * y[row]).sum();
        let sum = curvature + qp.gradient[i] + pushed;
        // f64::max forgets NaN.
        finite &= sum.is_finite();
        worst = worst.max(sum.abs());
        scale = scale.max(curvature.abs()).max(qp.gradient[i].abs()).max(pushed.abs());
    }
    let (mut violation, mut product) = (0.0_f64, 0.0_f64);
    for (row, &multiplier) in y[..qp.rows].iter().enumerate() {
        let (value, lower, upper) = (dot(qp.row(row), z), qp.lower[row], qp.upper[row]);
        violation = violation.max(value - upper).max(lower - value);
        if multiplier != 0.0 {
            product = product.max((multiplier * pushed_slack(value, lower, upper, multiplier)).abs());
        }
    }
    let stationarity = if finite { worst / scale } else { f64::NAN };
    KktResidual { stationarity, violation, complementarity: product / scale }
}

/// What a certificate of infeasibility proves: the least common violation t, in the rows' unit (N), that any z with
/// |z_i| ≤ `reach` must suffer somewhere; `None` when it proves nothing (t ≤ 0).
///
/// For any z, Σ y_i (A z)_i ≤ Σ y⁺ (upper + t) − Σ y⁻ (lower − t), so t ≥ (−Σ y⁺ upper + Σ y⁻ lower − ‖Aᵀy‖₁ reach) / ‖y‖₁.
pub fn certificate_gap(qp: &Qp<'_>, y: &[f64], reach: f64) -> Option<f64> {
    let n = qp.variables;
    let total: f64 = y[..qp.rows].iter().map(|y| y.abs()).sum();
    let mut gap = 0.0;
    for (row, &multiplier) in y[..qp.rows].iter().enumerate() {
        if multiplier > 0.0 {
            gap -= multiplier * qp.upper[row];
        } else if multiplier < 0.0 {
            gap -= multiplier * qp.lower[row];
        }
    }
    for i in 0..n {
        let residual: f64 = (0..qp.rows).map(|row| qp.matrix[row * n + i] * y[row]).sum();
        gap -= residual.abs() * reach;
    }
    let least = gap / total;
    (least > 0.0 && least.is_finite()).then_some(least)
}
