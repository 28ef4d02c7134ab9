//! What a daemon and its recorder would keep of a plant in virtual time.

use std::io::Write;

use admittance_runner::config::Config;
use admittance_runner::cycle::{self, Cycle};
use admittance_runner::virtual_time::VirtualTime;
use ipc_types::{CommandSample, RecordKind, RecordSample, TruthSample, VirtualPlant};
use plant_sim::run::{SINGULAR, VirtualRun};
use plant_sim::scenario::Scenario;
use plant_sim::summary::Summary;

use crate::recording::{RecordingWriter, cause};
use crate::{Exit, Outcome};

/// Of the daemon that there is none of.
const BOOT_ID: u64 = 1;

/// A run in virtual time, record by record.
pub struct VirtualRecords<P> {
    run: VirtualTime<P>,
    recorded: u64,
}

impl<P: VirtualPlant> VirtualRecords<P> {
    /// Of a controller against a plant.
    pub fn new(cycle: Box<dyn Cycle>, plant: P) -> Self {
        Self { run: VirtualTime::new(cycle, plant), recorded: 0 }
    }

    /// The record of the next cycle, and what was true at its sample; `None` at the end. `is_over` says
    /// whether time is up when the law asks for the n-th time about that record.
    ///
    /// # Errors
    /// As [`VirtualTime::step`].
    pub fn next(&mut self, is_over: impl Fn(u64, u64) -> bool) -> Result<Option<(RecordSample, TruthSample)>, String> {
        let sequence = self.recorded + 1;
        let Some(step) = self.run.step_in_time(|asked| is_over(sequence, asked))? else { return Ok(None) };
        self.recorded = sequence;
        let now_ns = step.state.stamp_ns;
        let mut record = RecordSample {
            sequence,
            now_ns,
            boot_id: BOOT_ID,
            expired_at: step.expired_at,
            kind: RecordKind::Sample.code(),
            state: step.state,
            // An answer takes no time.
            command: CommandSample { boot_id: BOOT_ID, stamp_ns: now_ns, ..step.command },
            ..RecordSample::zeroed()
        };
        step.report.write(&mut record);
        self.run.cycle.write(&mut record);
        Ok(Some((record, step.truth)))
    }
}

/// What became of a run.
#[derive(Debug, Clone)]
pub struct Ended {
    /// What was true in it.
    pub summary: Summary,
    /// The last answer.
    pub command: CommandSample,
}

/// Runs a scenario to the end of its motion and records it, with `text` as its configuration.
///
/// # Errors
/// 78 when configuration or scenario cannot be set up, 65 when the run breaks off, 74 when writing fails.
/// What was written until then is a whole recording, unless writing failed.
pub fn record(config: &Config, text: &str, scenario: &Scenario, output: impl Write) -> Outcome<Ended> {
    let refused = |why: String| (Exit::Config, why);
    let instance = config.ipc.settings(None, None, None).map_err(refused)?.instance;
    let plant = VirtualRun::new(scenario).map_err(|error| refused(error.to_string()))?;
    let mut records = VirtualRecords::new(cycle::build(config).map_err(refused)?, plant);
    let failed = |error| (Exit::IoError, cause(error));
    let mut writer = RecordingWriter::new(output, instance.as_str(), text).map_err(failed)?;
    let mut ended = Ended { summary: Summary::of_scenario(scenario), command: CommandSample::zeroed() };
    let end = loop {
        match records.next(|_, _| false) {
            Ok(Some((record, truth))) => {
                writer.record(&record).and_then(|()| writer.truth(&truth)).map_err(failed)?;
                ended.summary.add(&truth);
                ended.command = record.command;
            }
            Ok(None) => break Ok(ended),
            Err(why) => break Err((Exit::DataError, why)),
        }
        if records.run.plant().met_singularity() {
            break Err((Exit::DataError, SINGULAR.to_owned()));
        }
    };
    writer.finish().map_err(failed)?;
    end
}
