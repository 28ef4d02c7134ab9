//! Recordings: the inputs and outputs of the daemon's law, in MCAP (<https://mcap.dev>) with JSON
//! messages whose schemas are in the file, so that Foxglove, PlotJuggler and any MCAP library open
//! it.
//!
//! One record of the daemon is up to three messages with its sequence: on `/state`, on `/command`,
//! and last on `/cycle` all else. Every number comes back to the bit. Log times are CLOCK_MONOTONIC
//! stamps moved to the calendar by one offset, which is in the metadata.

mod reader;
mod writer;

pub use reader::{Item, Recording};
pub use writer::RecordingWriter;

/// State samples.
const STATE: &str = "/state";
/// Commands.
const COMMAND: &str = "/command";
/// All else of a record.
const CYCLE: &str = "/cycle";
/// What only the simulated plant knows.
const TRUTH: &str = "/truth";
/// Fields of a record that have channels of their own.
const STATE_FIELD: &str = "state";
const COMMAND_FIELD: &str = "command";
/// Name of the metadata record.
const METADATA: &str = "admittanced";
/// Start of the name of an attachment with a configuration; the sequence of the record from which
/// on it holds follows.
const CONFIGURATION: &str = "configuration-";

/// Metadata: the version of [`RecordSample`](ipc_types::RecordSample).
const RECORD_VERSION: &str = "record_version";
/// The present one. Version 1 had no such key, and recorded only the contact point of the belief;
/// version 2 recorded neither the tool's acceleration nor the joints' motion as the law sees it,
/// nor the wrench without the lag of its estimate and how often that was too large.
pub(crate) const PRESENT_RECORD_VERSION: u32 = 3;

/// Name of the attachment with the configuration that holds from this record on.
fn configuration_name(sequence: u64) -> String {
    format!("{CONFIGURATION}{sequence}.toml")
}

/// The record of [`configuration_name`].
fn configuration_sequence(name: &str) -> Option<u64> {
    name.strip_prefix(CONFIGURATION)?.strip_suffix(".toml")?.parse().ok()
}

#[cfg(test)]
mod tests {
    use ipc_types::{CommandSample, RecordKind, RecordSample, StateSample, TruthSample};

    use super::*;

    /// A record that differs from others in every part.
    fn record(sequence: u64) -> RecordSample {
        let mut state = StateSample { sequence, stamp_ns: 5_000 + sequence, ..StateSample::zeroed() };
        state.wrench = [0.1 + 0.2, -0.0, f64::NAN, f64::INFINITY, 5e-324, -1.0 / 3.0];
        let command = CommandSample { state_sequence: sequence, verdict_margin: 1e-17, ..CommandSample::zeroed() };
        RecordSample {
            sequence,
            boot_id: u64::MAX,
            now_ns: 6_000 + sequence,
            kind: RecordKind::Sample.code(),
            state,
            command,
            ..RecordSample::zeroed()
        }
    }

    fn written(finish: bool) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut writer = RecordingWriter::new(&mut bytes, "planar", "a = 1").expect("memory takes all");
        for sequence in 1..=3 {
            writer.record(&record(sequence)).expect("memory takes all");
        }
        writer.truth(&TruthSample { sequence: 9, ..TruthSample::zeroed() }).expect("memory takes all");
        writer.flush().expect("memory takes all");
        if finish {
            writer.configuration(3, "b = 2").expect("memory takes all");
            writer.finish().expect("memory takes all");
        } else {
            std::mem::forget(writer);
        }
        bytes
    }

    fn read(bytes: Vec<u8>) -> (Vec<RecordSample>, usize, bool) {
        let recording = Recording::from_bytes(bytes, "test.mcap").expect("a recording");
        let (mut records, mut truths) = (Vec::new(), 0);
        let mut items = recording.items();
        for item in items.by_ref() {
            match item.expect("readable") {
                Item::Record(record) => records.push(*record),
                Item::Truth(_) => truths += 1,
            }
        }
        (records, truths, items.is_complete())
    }

    #[test]
    fn what_is_written_is_read_to_the_bit() {
        use ipc_types::layout::WireType as _;
        let bytes = written(true);
        let (records, truths, complete) = read(bytes.clone());
        assert!(records.iter().zip(1..).all(|(found, sequence)| found.same_bits(&record(sequence))), "{records:?}");
        assert_eq!((records.len(), truths, complete), (3, 1, true));
        let recording = Recording::from_bytes(bytes, "test.mcap").expect("a recording");
        let texts: Vec<_> = recording.configurations().iter().map(|(at, text)| (*at, text.as_str())).collect();
        assert_eq!(texts, [(0, "a = 1"), (3, "b = 2")]);
        assert_eq!(recording.metadata()["instance"], "planar");
    }

    #[test]
    fn a_file_that_breaks_off_is_read_up_to_there() {
        let (records, _, complete) = read(written(false));
        assert_eq!((records.len(), complete), (3, false));
        let mut torn = written(true);
        torn.truncate(torn.len() / 2);
        let (records, _, complete) = read(torn);
        assert!(records.len() <= 3 && !complete);
        let Err((code, text)) = Recording::from_bytes(b"no recording".to_vec(), "x.mcap") else { panic!("accepted") };
        assert!(code == crate::Exit::DataError && text.contains("x.mcap"), "{text}");
    }
}
