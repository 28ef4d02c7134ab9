//! The way out of the surface that a motion controller takes before it leaves: whoever comes next
//! finds an arm that presses on nothing.

use admittance_client::Applied;
use ipc_types::TASK_AXES;
use nalgebra::SVector;

use super::Plant;
use crate::seconds;

/// Speed out of the surface in m/s.
const SPEED_M_S: f64 = 0.05;
/// Gap in m at which the arm is clear of the surface.
const CLEAR_M: f64 = 0.005;
/// How long the motion is commanded as any other, offsets included. A daemon that still has the arm
/// then holds it down, holds it, or is gone.
const COMMANDED_S: f64 = 0.6;
/// How long the arm is then moved without the daemon's offset, as by a person who jogs it.
const JOGGED_S: f64 = 1.0;
/// At rest after that: the wrench estimate falls, and the daemon sees an arm that is free.
const REST_S: f64 = 0.2;

/// How far a retreat is, in samples since each part of it began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Retreat {
    /// From the next sample on: the present one has told of another motion.
    Next,
    /// Out of the surface, the daemon's offset added.
    Commanded(i64),
    /// Out of the surface without it.
    Jogged(i64),
    /// At rest.
    Resting {
        /// Samples.
        since: i64,
        /// Whether the daemon's offset was left out before.
        was_jogged: bool,
    },
    /// Over.
    Over {
        /// Whether the daemon's offset was left out.
        was_jogged: bool,
    },
}

/// How a retreat ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Retreated {
    /// From the tool to the surface in m; negative is inside.
    pub gap_m: f64,
    /// Whether the tool is clear of the surface.
    pub is_clear: bool,
    /// Whether it took leaving the daemon's offset out.
    pub was_jogged: bool,
}

impl<const N: usize, const D: usize> Plant<N, D> {
    /// Ends the motion and begins to move the tool out of the surface, along its normal, unless it
    /// is clear of it.
    pub fn begin_retreat(&mut self) {
        let is_there = self.parameters.surface.is_some() && !self.is_clear();
        self.retreat = Some(if is_there { Retreat::Next } else { Retreat::Over { was_jogged: false } });
    }

    /// How the retreat ended; `None` before.
    pub fn retreated(&self) -> Option<Retreated> {
        let Some(Retreat::Over { was_jogged }) = self.retreat else { return None };
        Some(Retreated { gap_m: -self.contact.penetration, is_clear: self.is_clear(), was_jogged })
    }

    /// Takes the retreat one sample further.
    pub(super) fn go_on_retreating(&mut self) {
        let Some(retreat) = self.retreat else { return };
        let lasts = |part_s: f64, samples: i64| samples as f64 * seconds(self.parameters.sampling_time_ns) < part_s;
        let is_away = self.is_clear() || self.singular;
        self.retreat = Some(match retreat {
            Retreat::Next => {
                // A motion begins where the arm is, not where the one before it would have led.
                self.position_reference = self.joints.position;
                Retreat::Commanded(0)
            }
            Retreat::Commanded(_) if is_away => Retreat::Resting { since: 0, was_jogged: false },
            Retreat::Commanded(since) if lasts(COMMANDED_S, since) => Retreat::Commanded(since + 1),
            Retreat::Commanded(_) => Retreat::Jogged(0),
            Retreat::Jogged(since) if !is_away && lasts(JOGGED_S, since) => Retreat::Jogged(since + 1),
            Retreat::Jogged(_) => Retreat::Resting { since: 0, was_jogged: true },
            Retreat::Resting { since, was_jogged } if lasts(REST_S, since) => {
                Retreat::Resting { since: since + 1, was_jogged }
            }
            Retreat::Resting { was_jogged, .. } | Retreat::Over { was_jogged } => Retreat::Over { was_jogged },
        });
    }

    /// ṗ0 of the motion or of whoever leads or, once it has begun, of the retreat, m/s and rad/s.
    pub(super) fn commanded_twist(&self) -> SVector<f64, D> {
        match (self.retreat, &self.parameters.surface) {
            (None | Some(Retreat::Next), _) => match self.lead {
                None => self.parameters.motion.twist(self.index),
                Some([now, _]) if (0..self.parameters.motion.samples()).contains(&self.index) => now,
                Some(_) => SVector::zeros(),
            },
            (Some(Retreat::Commanded(_) | Retreat::Jogged(_)), Some(surface)) => {
                let out = surface.normal_at(&self.kinematics.pose.position, self.time_s()) * SPEED_M_S;
                SVector::from_fn(|axis, _| if axis < 3 { out[axis] } else { 0.0 })
            }
            _ => SVector::zeros(),
        }
    }

    /// Whether the motion is commanded, and no retreat.
    pub(super) fn is_commanded(&self) -> bool {
        matches!(self.retreat, None | Some(Retreat::Next))
    }

    /// Whether the arm is moved without what the daemon says.
    pub(super) fn is_jogged(&self) -> bool {
        matches!(
            self.retreat,
            Some(Retreat::Jogged(_) | Retreat::Resting { was_jogged: true, .. } | Retreat::Over { was_jogged: true })
        )
    }

    /// What is added to ṗ0 at this instant.
    pub(super) fn applied(&self) -> Applied {
        if self.is_jogged() { Applied::Offset([0.0; TASK_AXES]) } else { self.playback.applied(self.now_ns) }
    }

    fn is_clear(&self) -> bool {
        !self.contact.touches && self.contact.penetration <= -CLEAR_M
    }
}
