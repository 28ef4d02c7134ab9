//! One run of a controller, watched from before the motion to its end.

use std::ffi::OsStr;
use std::time::Duration;

use ipc_types::services::{self, Access};
use ipc_types::{RecordKind, RecordSample, TruthSample};

use super::{Controller, Experiment};
use crate::Exit;
use crate::report::Changes;
use crate::session::Session;

/// Time between two reads of the truth: far below what its buffer holds.
const POLL: Duration = Duration::from_millis(10);

/// Above what rounding adds to the time of a sample, in s, and below a cycle.
const ROUNDING_S: f64 = 1e-6;

/// When a record was made: that of a sample at its stamp.
fn seen_ns(record: &RecordSample) -> u64 {
    if record.kind == RecordKind::Sample.code() { record.state.stamp_ns } else { record.now_ns }
}

/// Runs one controller and returns every truth sample from before the motion to its end, and what the
/// daemon's mode and verdict were meanwhile.
pub(super) fn run(
    controller: Controller,
    experiment: &Experiment,
    interrupted: &dyn Fn() -> bool,
    mut progress: impl FnMut(f64),
) -> Result<(Vec<TruthSample>, Changes), (Exit, String)> {
    let scenario = &experiment.scenario;
    let mut session = Session::new(scenario)?;
    let config = session.write("daemon.toml", &experiment.config(&controller))?;
    let scenario_file = session.write("scenario.toml", &experiment.scenario_text())?;
    session.start("daemon", "role-daemon", &[OsStr::new("--config"), config.as_os_str()])?;
    session.start("plant", "role-plant", &[OsStr::new("--scenario"), scenario_file.as_os_str()])?;
    let (node, truths) = session.watch(interrupted)?;
    let instance = session.settings().instance.clone();
    let (mut records, mut recorded) = (None, Vec::new());

    let mut series: Vec<TruthSample> = Vec::new();
    loop {
        let ended = session.exit_status("plant");
        if records.is_none() {
            let service = services::record(&node, &instance, Access::Open).ok();
            records = service.and_then(|service| service.subscriber().ok());
        }
        while let Some(record) = records.as_ref().and_then(|records| records.receive().ok().flatten()) {
            recorded.push(Box::new(*record));
        }
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
    if series.first().is_none_or(|first| first.scenario_time_s >= 0.0) {
        return Err((Exit::MachineBusy, "the motion began before the demo could watch it; try again".to_owned()));
    }
    // What follows the motion is the plant's retreat from the surface.
    let end_s = scenario.motion.iter().map(|phase| phase.duration_s).sum::<f64>() + ROUNDING_S;
    series.retain(|truth| truth.scenario_time_s <= end_s);
    let changes = changes(&series, &recorded, end_s);
    Ok((series, changes))
}

/// Modes and verdicts that the daemon told up to this time of the scenario in s.
fn changes(series: &[TruthSample], recorded: &[Box<RecordSample>], end_s: f64) -> Changes {
    let mut changes = Changes::default();
    // Not by the first sample: until the daemon answers, the time of the scenario stands still.
    let Some(last) = series.last() else { return changes };
    for record in recorded {
        let after_ns = seen_ns(record) as f64 - last.stamp_ns as f64;
        let time_s = last.scenario_time_s + after_ns * 1e-9;
        if time_s <= end_s {
            changes.add(record, time_s);
        }
    }
    changes
}

#[cfg(test)]
mod tests {
    use ipc_types::{CommandSample, Mode, StateSample};

    use super::*;

    #[test]
    fn modes_are_told_in_the_time_of_the_scenario() {
        let truth = |scenario_time_s, stamp_ns| TruthSample { scenario_time_s, stamp_ns, ..TruthSample::zeroed() };
        // The plant waits for the daemon's first answer.
        let series = [truth(-0.5, 1_000_000_000), truth(-0.5, 1_200_000_000), truth(0.0, 1_700_000_000)];
        let state = StateSample { stamp_ns: 1_800_000_000, ..StateSample::zeroed() };
        let command = CommandSample { state_sequence: 1, mode: Mode::Contact.code(), ..CommandSample::zeroed() };
        let record = RecordSample { kind: RecordKind::Sample.code(), state, command, ..RecordSample::zeroed() };
        let at = |end_s| changes(&series, &[Box::new(record)], end_s).end_s();
        assert!(at(2.0).is_some_and(|time_s| (time_s - 0.1).abs() < 1e-9), "{:?}", at(2.0));
        assert_eq!(at(0.05), None, "after the end");
    }
}
