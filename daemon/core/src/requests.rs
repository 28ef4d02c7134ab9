//! What a person or the shell may ask of a controller between cycles.

use nalgebra::SVector;

use crate::contact::Contact;
use crate::controller::Controller;
use crate::mode::{Mode, StopReason, Transition};
use crate::plan::Plan;
use crate::qp::QpSolver;
use crate::stopping;

/// Why a reset is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ResetRefused {
    /// There is nothing to reset.
    NotStopped(Mode),
    /// No valid sample yet: the force is not known.
    NoSample,
    /// ṗ0 points into the surface.
    ReferenceInward {
        /// Speed into the surface in m/s.
        speed: f64,
    },
    /// The force is above the release threshold.
    ForceAboveRelease {
        /// Task axis.
        axis: usize,
        /// f̂ in N or N·m.
        force: f64,
        /// The threshold.
        release: f64,
    },
}

impl core::fmt::Display for ResetRefused {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotStopped(mode) => write!(f, "nothing to reset: the mode is {mode:?}, not Stopped"),
            Self::NoSample => f.write_str("no valid state sample: the force is not known"),
            Self::ReferenceInward { speed } => {
                write!(
                    f,
                    "the commanded twist still moves into the surface at {speed:.4} m/s: command standstill or retreat"
                )
            }
            Self::ForceAboveRelease { axis, force, release } => {
                write!(
                    f,
                    "the force on axis {axis} is {force:.2} N, above the release threshold {release:.2} N: retreat first"
                )
            }
        }
    }
}

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Controller<N, D, S, B> {
    /// Asks for the end of control: in free motion the offset ramps to zero, in contact the arm stops at a low force.
    pub fn request_stop(&mut self, reason: StopReason) {
        self.enabled = false;
        self.requested = Some(reason);
    }

    /// Leaves Stopped. Unless `force`d, ṗ0 must not point inward and every force must be below release.
    ///
    /// # Errors
    /// [`ResetRefused`] with what stands against it.
    pub fn reset(&mut self, force: bool) -> Result<(), ResetRefused> {
        if self.mode != Mode::Stopped {
            return Err(ResetRefused::NotStopped(self.mode));
        }
        if !force {
            let last = self.last.as_ref().ok_or(ResetRefused::NoSample)?;
            if stopping::is_inward(&self.parameters, &last.twist_reference) {
                let speed = -self.parameters.environment.outward_speed(&last.twist_reference);
                return Err(ResetRefused::ReferenceInward { speed });
            }
            let thresholds = &self.parameters.thresholds;
            let above =
                |axis: &usize| thresholds.admittance[*axis] && last.wrench[*axis].abs() >= thresholds.release[*axis];
            if let Some(axis) = (0..D).find(above) {
                let (force, release) = (last.wrench[axis], thresholds.release[axis]);
                return Err(ResetRefused::ForceAboveRelease { axis, force, release });
            }
        }
        self.mode = self.mode.after(if force { Transition::ForcedReset } else { Transition::Reset });
        (self.contact, self.offset, self.plan) = (Contact::none(), SVector::zeros(), Plan::empty());
        (self.stop_reason, self.requested, self.enabled, self.unsolved) = (None, None, true, 0);
        (self.planned, self.singular) = (false, None);
        Ok(())
    }
}
