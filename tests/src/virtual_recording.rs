//! A recording of a run in virtual time, as `admittancectl record` would have written it.

use std::path::Path;

use admittance_runner::cycle;
use admittance_runner::virtual_time::VirtualTime;
use admittancectl::recording::RecordingWriter;
use ipc_types::{RecordKind, RecordSample};
use plant_sim::run::VirtualRun;

use crate::closed_loop::Experiment;

/// Runs to the end of the motion, and records it into `file`. The configuration in the recording is
/// `text`.
///
/// # Panics
/// When config or scenario cannot be set up, the plant refuses a command, or the file cannot be
/// written.
pub fn record(experiment: &Experiment, text: &str, file: &Path) {
    let plant = VirtualRun::new(&experiment.scenario).expect("the scenario can be set up");
    let cycle = cycle::build(&experiment.config).expect("the config describes a controller");
    let output = std::fs::File::create(file).expect("a file");
    let mut writer = RecordingWriter::new(std::io::BufWriter::new(output), "virtual", text).expect("begun");
    for (step, sequence) in VirtualTime::new(cycle, plant).run().expect("it runs").iter().zip(1..) {
        let record = RecordSample {
            sequence,
            now_ns: step.state.stamp_ns,
            boot_id: 1,
            kind: RecordKind::Sample.code(),
            wrench: step.report.wrench,
            state: step.state,
            command: step.command,
            ..RecordSample::zeroed()
        };
        writer.record(&record).expect("written");
        writer.truth(&step.truth).expect("written");
    }
    writer.finish().expect("written");
}
