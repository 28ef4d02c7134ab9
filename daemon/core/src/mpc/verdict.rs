//! The verdict: can the force bounds still be met?

use nalgebra::SVector;

use admittance_vocabulary::{Side, VerdictName};

use crate::mpc::condensation::MpcRows;
use crate::mpc::qp::{Qp, certificate_gap};

/// Standard deviations of f̂ that a margin has to allow for.
pub(super) const DEVIATIONS: f64 = 3.0;

/// Share of what is distributed normally above so many deviations.
pub(super) fn above(deviations: f64) -> f64 {
    0.5 * libm::erfc(deviations * core::f64::consts::FRAC_1_SQRT_2)
}

/// The answer to "can the force bounds be met over the horizon?", given every cycle in contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// Not computed: no axis in contact, or a law that does not predict.
    None,
    /// Yes, with the inputs found.
    Feasible {
        /// f_max minus the predicted peak of s·f_lin, in N (N·m on a rotational axis); the smallest
        /// over axes, steps, and the time before the inputs act.
        margin: f64,
        /// The axis of that peak.
        axis: usize,
        /// When, in s from the sample.
        time: f64,
    },
    /// Not for every surface of the set that is believed in: the inputs found are those for the
    /// worst of it.
    AtRisk {
        /// The share of surfaces that can't be kept below the limit.
        share: f64,
        /// Newtons by which the worst of them exceeds it.
        excess: f64,
        /// The axis whose limit that is.
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
        /// Newtons (or N·m) by which some bound must at least be violated.
        shortfall: f64,
    },
}

impl Verdict {
    /// Its name.
    pub fn name(&self) -> VerdictName {
        match self {
            Self::None => VerdictName::None,
            Self::Feasible { .. } => VerdictName::Feasible,
            Self::AtRisk { .. } => VerdictName::AtRisk,
            Self::Infeasible { .. } => VerdictName::Infeasible,
        }
    }

    /// Newtons by which some bound must at least be violated.
    pub(super) fn shortfall(&self) -> f64 {
        if let Self::Infeasible { shortfall, .. } = self { *shortfall } else { 0.0 }
    }

    /// The one of two feasible ones that leaves less.
    #[must_use]
    pub(super) fn closest(self, other: Self) -> Self {
        match (self, other) {
            (Self::Feasible { margin, .. }, Self::Feasible { margin: less, .. }) if less < margin => other,
            _ => self,
        }
    }

    /// Counts its newtons from the limit itself, where it is about one that is larger by the part
    /// `level`.
    pub(super) fn count_from<const D: usize>(&mut self, level: f64, force_limit: &SVector<f64, D>) {
        match self {
            Self::Feasible { margin, axis, .. } => *margin -= level * force_limit[*axis],
            Self::Infeasible { shortfall, axis, .. } => *shortfall += level * force_limit[*axis],
            Self::AtRisk { .. } | Self::None => {}
        }
    }

    /// Counts a margin from the limit itself, where the bound left `free` N along the normal below it.
    pub(super) fn count_free<const D: usize>(&mut self, free: f64, normal: &SVector<f64, D>) {
        if let Self::Feasible { margin, axis, .. } = self {
            *margin += free * normal[*axis].abs();
        }
    }

    /// The same where the force may be above what was predicted by something of this standard deviation,
    /// N along the normal; 0 where it can't.
    #[must_use]
    pub(super) fn unsure<const D: usize>(self, deviation: f64, normal: &SVector<f64, D>) -> Self {
        let of = |axis: usize| deviation * normal[axis].abs();
        match self {
            Self::Feasible { margin, axis, time } if of(axis) > 0.0 => {
                let sure = margin - DEVIATIONS * of(axis);
                if sure < 0.0 {
                    Self::AtRisk { share: above(margin / of(axis)), excess: -sure, axis, time }
                } else {
                    Self::Feasible { margin: sure, axis, time }
                }
            }
            Self::AtRisk { share, excess, axis, time } => {
                Self::AtRisk { share, excess: excess + DEVIATIONS * of(axis), axis, time }
            }
            Self::Feasible { .. } | Self::Infeasible { .. } | Self::None => self,
        }
    }

    /// Counts its time from `delay` s earlier.
    pub(super) fn shift(&mut self, delay: f64) {
        match self {
            Self::Feasible { time, .. } | Self::Infeasible { time, .. } => *time += delay,
            // Counted from the sample already.
            Self::AtRisk { .. } | Self::None => {}
        }
    }
}

/// The verdict on a solved problem: the smallest slack to an upper force bound under the inputs
/// `z`, where A z is `values`.
pub(super) fn margin_of<const N: usize, const D: usize, const M: usize, const C: usize>(
    rows: &MpcRows<'_, N, D, M, C>,
    qp: &Qp<'_>,
    z: &[f64],
    values: &[f64],
) -> Verdict {
    let mut best: Option<(f64, usize)> = None;
    for row in rows.force_rows() {
        let margin = qp.upper[row] - values[row];
        if best.is_none_or(|(least, _)| margin < least) {
            best = Some((margin, row));
        }
    }
    let Some((margin, (axis, time))) = best.and_then(|(margin, row)| Some((margin, rows.force_row(row)?))) else {
        return Verdict::None;
    };
    Verdict::Feasible { margin: margin - rows.off_maximum(z), axis, time }
}

/// What contradicts itself in a problem without solution.
pub(super) enum Contradiction {
    /// The force bounds, within the limits of joints and inputs.
    OfForces(Verdict),
    /// Those limits, whatever the force.
    OfLimits,
}

/// Why a problem is infeasible that the solver calls so, if its certificate `y` proves it for every
/// input within `reach` (m/s, rad/s); `None` when it does not. Of the certificate only the part of
/// the limits is left in `y`; `scratch` is at least stride long.
pub(super) fn checked_contradiction<const N: usize, const D: usize, const M: usize, const C: usize>(
    rows: &MpcRows<'_, N, D, M, C>,
    qp: &Qp<'_>,
    y: &mut [f64],
    reach: f64,
    scratch: &mut [f64],
) -> Option<Contradiction> {
    let force = rows.force_rows();
    let shortfall = certificate_gap(qp, y, reach, &|row| force.contains(&row), scratch);
    let row = rows.force_rows().max_by(|&a, &b| y[a].abs().total_cmp(&y[b].abs()));
    let side = if row.is_some_and(|row| y[row] > 0.0) { Side::Upper } else { Side::Lower };
    // Forces that have a part in it by rounding alone would be missed by any number of newtons.
    y[force].fill(0.0);
    if certificate_gap(qp, y, reach, &|_| true, scratch).is_some() {
        return Some(Contradiction::OfLimits);
    }
    let (axis, time) = rows.force_row(row?)?;
    Some(Contradiction::OfForces(Verdict::Infeasible { axis, side, time, shortfall: shortfall? }))
}
