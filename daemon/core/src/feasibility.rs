//! The verdict: can the force bounds still be met?

use crate::condensation::Prediction;
use crate::qp::{Qp, certificate_gap};

/// Which bound of s·f_lin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// f_max.
    Upper,
    /// f_min.
    Lower,
}

/// The answer to "can the force bounds be met over the horizon?", given every cycle in contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// Not asked: no axis in contact, or a law that does not predict.
    None,
    /// Yes, with the inputs found.
    Feasible {
        /// f_max minus the predicted peak of s·f_lin, in N (N·m on a rotational axis); the smallest over axes and steps.
        margin: f64,
        /// The axis of that peak.
        axis: usize,
        /// When, in s from the sample.
        time: f64,
    },
    /// No input meets all bounds.
    Infeasible {
        /// The axis of the row that weighs most in the proof.
        axis: usize,
        /// The bound of that row.
        side: Side,
        /// Its time in s from the sample.
        time: f64,
        /// Newtons (or N·m) by which some bound must be violated, at the least.
        shortfall: f64,
    },
}

fn end_of_step(steps: &[f64], k: usize) -> f64 {
    steps[..k].iter().sum()
}

/// The verdict on a solved problem: the smallest slack to an upper bound under the inputs `z`.
pub fn margin_of<const N: usize, const D: usize>(prediction: &Prediction<'_, N, D>, qp: &Qp<'_>, z: &[f64]) -> Verdict {
    let mut best = (f64::INFINITY, 0);
    for row in 0..qp.rows {
        let value: f64 = qp.row(row).iter().zip(z).map(|(a, z)| a * z).sum();
        let margin = qp.upper[row] - value;
        if margin < best.0 {
            best = (margin, row);
        }
    }
    if qp.rows == 0 {
        return Verdict::None;
    }
    let (bound, k) = prediction.bounds.row(best.1);
    Verdict::Feasible { margin: best.0, axis: bound.axis, time: end_of_step(prediction.steps, k) }
}

/// The verdict on a problem that the solver calls infeasible, if its certificate `y` proves it for every input within
/// `reach` (m/s, rad/s); `None` when it does not.
pub fn checked_infeasible<const N: usize, const D: usize>(
    prediction: &Prediction<'_, N, D>,
    qp: &Qp<'_>,
    y: &[f64],
    reach: f64,
) -> Option<Verdict> {
    let shortfall = certificate_gap(qp, y, reach)?;
    let row = (0..qp.rows).max_by(|&a, &b| y[a].abs().total_cmp(&y[b].abs()))?;
    let (bound, k) = prediction.bounds.row(row);
    let side = if y[row] > 0.0 { Side::Upper } else { Side::Lower };
    Some(Verdict::Infeasible { axis: bound.axis, side, time: end_of_step(prediction.steps, k), shortfall })
}
