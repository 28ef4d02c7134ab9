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
    /// A forced reset leads straight back to control, which is disabled.
    Disabled,
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
            Self::Disabled => {
                f.write_str("control is disabled: enable it first, or reset without force, which leads to Idle")
            }
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

/// Why enabling is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EnableRefused {
    /// Control is ending for good.
    Ending,
    /// An axis is in contact: control begins in free motion only.
    InContact {
        /// Task axis.
        axis: usize,
        /// f̂ in N or N·m.
        force: f64,
        /// The activation threshold.
        activation: f64,
    },
}

impl core::fmt::Display for EnableRefused {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Ending => f.write_str("control is ending: the daemon shuts down"),
            Self::InContact { axis, force, activation } => write!(
                f,
                "the force on axis {axis} is {force:.2} N, above the activation threshold {activation:.2} N: move the arm \
                 away first"
            ),
        }
    }
}

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Controller<N, D, S, B> {
    /// Asks for the end of control: in free motion the offset ramps to zero, in contact the arm stops at a low force. It
    /// lasts until [`Self::enable`].
    pub fn request_stop(&mut self, reason: StopReason) {
        self.enabled = false;
        // Nothing takes back the end of the daemon.
        if self.requested != Some(StopReason::Shutdown) {
            self.requested = Some(reason);
        }
    }

    /// Whether control may begin or go on.
    pub fn is_enabled(&self) -> bool {
        self.enabled
    }

    /// Lets control begin with the next sample that allows it. A stop that is latched, or under way, stays one. Whether that
    /// changed anything.
    ///
    /// # Errors
    /// [`EnableRefused`] with what stands against it.
    pub fn enable(&mut self) -> Result<bool, EnableRefused> {
        if self.requested == Some(StopReason::Shutdown) {
            return Err(EnableRefused::Ending);
        }
        if let Some(last) = self.last.as_ref().filter(|_| self.mode == Mode::Idle) {
            let thresholds = &self.parameters.thresholds;
            let touched = Contact::none().update(thresholds, None, &last.wrench);
            if let Some(axis) = (0..D).find(|axis| touched.sign(*axis).is_some()) {
                let (force, activation) = (last.wrench[axis], thresholds.activation[axis]);
                return Err(EnableRefused::InContact { axis, force, activation });
            }
        }
        let was_enabled = core::mem::replace(&mut self.enabled, true);
        self.requested = None;
        Ok(!was_enabled)
    }

    /// Leaves Stopped; what was disabled stays so. Unless `force`d, ṗ0 must not point inward and every force must be below release.
    ///
    /// # Errors
    /// [`ResetRefused`] with what stands against it.
    pub fn reset(&mut self, force: bool) -> Result<(), ResetRefused> {
        if self.mode != Mode::Stopped {
            return Err(ResetRefused::NotStopped(self.mode));
        }
        if force && !self.enabled {
            return Err(ResetRefused::Disabled);
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
        (self.stop_reason, self.unsolved) = (None, 0);
        (self.planned, self.singular) = (false, None);
        Ok(())
    }
}
