//! Who is the motion controller of a row: plant-sim, or a program in C by the C client.

use std::path::Path;

use plant_sim::faults::FaultKind;

use super::row::{Injection, Row, Situation, Who};
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
/// client does both, and it follows twists; and what plant-sim itself says or does about its files and its machine is not the C program's.
pub fn is_for_c(row: &Row) -> bool {
    let is_not_its_own = matches!(
        row.injection,
        Injection::Scripted(
            FaultKind::Unnotified | FaultKind::SequenceJump | FaultKind::Overrun | FaultKind::NotFollowing
        )
    );
    let mut expected = Situation::ALL.iter().flat_map(|situation| &row.expected(*situation).log);
    let is_told_by_the_plant = expected.any(|line| line.by == Who::Plant);
    !is_not_its_own && !is_told_by_the_plant
}
