//! What may be requested between cycles.

use admittance_vocabulary::ModeName;

use super::permission::Permission;
use super::{Cause, Ending, Mode, Supervisor};
use crate::belief::Belief;
use crate::intake::{Accepted, band};
use crate::quantities::{AXIS_NAMES, Instant, wrench_unit};

/// Why a reset is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ResetRefused {
    /// There is nothing to reset.
    NotStopped(ModeName),
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
            Self::NotStopped(mode) => write!(f, "nothing to reset: the mode is {mode}, not Stopped"),
            Self::Disabled => {
                f.write_str("control is disabled: enable it first, or reset without force, which leads to Idle")
            }
            Self::NoSample => f.write_str("no valid state sample: the force is not known"),
            Self::ReferenceInward { speed } => write!(
                f,
                "the commanded twist still moves into the surface at {speed:.4} m/s: command standstill or retreat"
            ),
            Self::ForceAboveRelease { axis, force, release } => {
                let (name, unit) = (AXIS_NAMES[*axis], wrench_unit(*axis));
                write!(
                    f,
                    "the wrench on {name} is {force:.2} {unit}, above the release threshold {release:.2} {unit}: \
                     retreat first"
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
            Self::InContact { axis, force, activation } => {
                let (name, unit) = (AXIS_NAMES[*axis], wrench_unit(*axis));
                write!(
                    f,
                    "the wrench on {name} is {force:.2} {unit}, above the activation threshold {activation:.2} \
                     {unit}: move the arm away first"
                )
            }
        }
    }
}

impl<const D: usize> Supervisor<D> {
    /// Ends control: in free motion the offset ramps to zero, in contact the arm stops at a low
    /// force. It lasts until [`Self::enable`]; a shutdown cannot be taken back.
    pub(crate) fn withdraw(&mut self, ending: Ending) {
        self.still_holds = self.holds();
        if self.permission != Permission::Withdrawn(Ending::Shutdown) {
            self.permission = Permission::Withdrawn(ending);
        }
    }

    /// Whether control may begin or go on.
    pub(crate) fn is_enabled(&self) -> bool {
        self.permission == Permission::Given
    }

    /// Lets control begin with the next sample that allows it. A stop that is latched, or under
    /// way, remains. Returns whether that changed anything.
    ///
    /// # Errors
    /// [`EnableRefused`] with the reason.
    pub(crate) fn enable<const N: usize>(
        &mut self,
        last: Option<&Accepted<N, D>>,
        belief: &Belief<D>,
    ) -> Result<bool, EnableRefused> {
        if self.permission == Permission::Withdrawn(Ending::Shutdown) {
            return Err(EnableRefused::Ending);
        }
        if let (Mode::Idle(_), Some(last)) = (&self.mode, last)
            && let Some(axis) = belief.felt(last).first()
        {
            let activation = self.settings.thresholds.beyond(&last.unsure()).activation[axis];
            let force = last.wrench[axis];
            return Err(EnableRefused::InContact { axis, force, activation });
        }
        let was_enabled = self.is_enabled();
        self.permission = Permission::Given;
        Ok(!was_enabled)
    }

    /// Leaves Stopped; disabled control stays disabled. Without `force`, ṗ0 must not point inward
    /// and every force must be below release.
    ///
    /// # Errors
    /// [`ResetRefused`] with the reason.
    pub(crate) fn reset<const N: usize>(
        &mut self,
        force: bool,
        last: Option<&Accepted<N, D>>,
        belief: &Belief<D>,
    ) -> Result<(), ResetRefused> {
        if !matches!(self.mode, Mode::Stopped(_)) {
            return Err(ResetRefused::NotStopped(self.mode.name()));
        }
        if force && !self.is_enabled() {
            return Err(ResetRefused::Disabled);
        }
        if !force {
            self.check_at_rest(last.ok_or(ResetRefused::NoSample)?, belief)?;
        }
        self.apply(if force { Cause::ForcedReset } else { Cause::Reset }, Instant::default());
        Ok(())
    }

    /// Whether nothing presses, and ṗ0 does not push.
    fn check_at_rest<const N: usize>(&self, last: &Accepted<N, D>, belief: &Belief<D>) -> Result<(), ResetRefused> {
        if belief.surface().is_pushed_by(&last.twist_reference) {
            let speed = -belief.surface().outward_speed(&last.twist_reference);
            return Err(ResetRefused::ReferenceInward { speed });
        }
        let thresholds = &self.settings.thresholds;
        // An arm at rest in the air may feel what its wrench is off by.
        let least = |axis: usize| thresholds.release[axis].max(band(&last.wrench_covariance, axis));
        let is_above = |axis: &usize| thresholds.admittance[*axis] && last.wrench[*axis].abs() >= least(*axis);
        match (0..D).find(is_above) {
            Some(axis) => {
                let (force, release) = (last.wrench[axis], least(axis));
                Err(ResetRefused::ForceAboveRelease { axis, force, release })
            }
            None => Ok(()),
        }
    }
}
