//! Who is the motion controller of a row: plant-sim, or a program in C by the C client.

use std::path::Path;

use plant_sim::faults::FaultKind;

use super::row::{Injection, Row};
use crate::c_controller::{TruthRelay, controller_command};
use crate::session::plant_command;
use crate::{Child, PrivateIpc};

/// The motion controller of a run.
#[derive(Debug)]
pub(super) enum Leader {
    PlantSim,
    C(TruthRelay),
}

impl Leader {
    pub(super) fn start(&self, ipc: &PrivateIpc, scenario: &Path) -> Child {
        Child::spawn(&mut match self {
            Self::PlantSim => plant_command(ipc, scenario),
            Self::C(relay) => controller_command(ipc, scenario, relay),
        })
    }
}

/// Whether a controller in C can bring the row about. It cannot leave the notification out or skip numbers, since its
/// client does both, it paces them itself, and it follows twists.
pub fn is_for_c(row: &Row) -> bool {
    !matches!(
        row.injection,
        Injection::Scripted(
            FaultKind::Unnotified | FaultKind::SequenceJump | FaultKind::Overrun | FaultKind::NotFollowing
        )
    )
}
