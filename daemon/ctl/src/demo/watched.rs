//! One run of a controller, watched from before the motion to its end.

use std::ffi::OsStr;
use std::time::Duration;

use ipc_types::TruthSample;
use plant_sim::scenario::Scenario;

use super::Controller;
use crate::Exit;
use crate::session::Session;

/// Time between two reads of the truth: far below what its buffer holds.
const POLL: Duration = Duration::from_millis(10);

/// Runs one controller and returns every truth sample from before the motion to its end.
pub(super) fn run(
    controller: Controller,
    scenario: &Scenario,
    scenario_text: &str,
    interrupted: &dyn Fn() -> bool,
    mut progress: impl FnMut(f64),
) -> Result<Vec<TruthSample>, (Exit, String)> {
    let mut session = Session::new(scenario)?;
    let config = session.write("daemon.toml", controller.config)?;
    let scenario_file = session.write("scenario.toml", scenario_text)?;
    session.start("daemon", "role-daemon", &[OsStr::new("--config"), config.as_os_str()])?;
    session.start("plant", "role-plant", &[OsStr::new("--scenario"), scenario_file.as_os_str()])?;
    let (_node, truths) = session.watch(interrupted)?;

    let mut series: Vec<TruthSample> = Vec::new();
    loop {
        let ended = session.exit_status("plant");
        while let Ok(Some(truth)) = truths.receive() {
            if series.last().is_some_and(|last| truth.sequence != last.sequence + 1) {
                return Err((
                    Exit::MachineBusy,
                    "the demo was too slow to read the plant's truth; try again".to_owned(),
                ));
            }
            progress(truth.scenario_time_s);
            series.push(*truth);
        }
        if interrupted() {
            return Err((Exit::ClaimNotMet, "interrupted; nothing is claimed".to_owned()));
        }
        match ended {
            Some(status) if status.success() => break,
            Some(status) => return Err(session.failure("plant", status)),
            None => {}
        }
        if let Some(status) = session.exit_status("daemon") {
            return Err(session.failure("daemon", status));
        }
        std::thread::sleep(POLL);
    }
    session.end("daemon")?;
    match series.first() {
        Some(first) if first.scenario_time_s < 0.0 => Ok(series),
        _ => Err((Exit::MachineBusy, "the motion began before the demo could watch it; try again".to_owned())),
    }
}
