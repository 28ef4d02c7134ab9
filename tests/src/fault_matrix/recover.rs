//! The steps of a recovery, taken.

use ipc_types::Motion;

use super::files::{sound_daemon_file, sound_scenario_file};
use super::row::{Injection, Said, Situation, Step, Who};
use super::run::{FAULT_AT_S, FREE_MOTION_S, Stage, Wrong};
use crate::PATIENCE;
use crate::session::{ctl_command, write};

/// Commands in a row after which control counts as back.
const COMMANDS: usize = 10;

/// Takes the row's recovery steps, and waits until control is back.
pub(super) fn recover(stage: &mut Stage<'_>) -> Result<(), Wrong> {
    for step in stage.row.expected(stage.situation).recovery.clone() {
        take(stage, step).map_err(|wrong| format!("recovery, {step}: {wrong}"))?;
    }
    let (undisturbed, since) = (stage.situation.undisturbed(), admittance_host::clock::monotonic_ns());
    stage.wait(&format!("control again: {undisturbed}"), |seen| {
        let commands = seen.commands.range((since, 0)..).rev().take(COMMANDS);
        let goes_on = seen.truth().is_some_and(|truth| truth.motion == Motion::Offset.code());
        goes_on && commands.filter(|(_, command)| Said::of(command) == Some(undisturbed)).count() == COMMANDS
    })
}

fn take(stage: &mut Stage<'_>, step: Step) -> Result<(), Wrong> {
    let line = stage.row.timeline;
    let phases = [line.press, line.press + line.retreat, line.press + line.retreat + line.rest];
    match step {
        Step::FaultEnds => {
            let end = FAULT_AT_S[usize::from(stage.situation == Situation::Contact)] + super::SCRIPTED_S;
            stage.wait("the end of the fault", |seen| seen.time() >= end)
        }
        Step::Continue(who) => {
            stage.process(who).signal(libc::SIGCONT);
            Ok(())
        }
        Step::Start(Who::Plant) => start_plant(stage),
        Step::Start(_) => {
            if stage.row.injection == Injection::RemoveRoot {
                // As for the others: a process that keeps the old services open removes the new
                // ones' files when it ends.
                stage.watcher.rest();
                stage.start_daemon();
                stage.watcher.watch_anew(stage.ipc.settings());
            } else {
                stage.start_daemon();
            }
            Ok(())
        }
        Step::End(who) => {
            stage.process(who).terminate();
            stage.process(who).wait_for_exit(PATIENCE);
            Ok(())
        }
        Step::RestartPlant => {
            take(stage, Step::End(Who::Plant))?;
            take(stage, Step::Start(Who::Plant))
        }
        Step::CorrectFile => {
            write(&stage.ipc, "daemon.toml", &sound_daemon_file());
            Ok(())
        }
        Step::Reload => stage.reload(),
        Step::See(said) => stage.wait("the command", |seen| seen.said() == Some(said)),
        Step::Retreat => {
            stage.wait("the motion out of the surface ends", |seen| seen.time() >= phases[1])?;
            stage.too_late = stage.watcher.seen().time() >= phases[2];
            let is_free = stage.watcher.seen().truth().is_some_and(|truth| truth.in_contact == 0);
            if is_free { Ok(()) } else { Err("the arm has not left the surface".to_owned()) }
        }
        Step::Stand => stage.wait("the motion ends", |seen| seen.time() > FREE_MOTION_S),
        Step::Reset => {
            let output = ctl_command(&stage.ipc, "reset", &stage.config).output().map_err(|error| error.to_string())?;
            let said =
                format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
            if output.status.success() {
                return Ok(());
            }
            stage.too_late = stage.situation == Situation::Contact && stage.watcher.seen().time() >= phases[2];
            Err(format!("{}: {said}", output.status))
        }
    }
}

/// Starts the motion controller anew, at the start of a sound motion.
fn start_plant(stage: &mut Stage<'_>) -> Result<(), Wrong> {
    let scenario = write(&stage.ipc, "scenario.toml", &sound_scenario_file(stage.row, stage.situation));
    let boot = stage.watcher.seen().truth().map_or(0, |truth| truth.boot_id);
    stage.plant = stage.leader.start(&stage.ipc, &scenario);
    // Times of the motion are those of the new one from here on.
    stage.wait("the new motion controller", |seen| seen.truth().is_some_and(|truth| truth.boot_id != boot))
}
