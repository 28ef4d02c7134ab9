//! Recordings: the inputs and outputs of the daemon's law, in MCAP (<https://mcap.dev>) with JSON
//! messages whose schemas are in the file, so that Foxglove, PlotJuggler and any MCAP library open
//! it.
//!
//! One record of the daemon is up to three messages with its sequence: on `/state`, on `/command`,
//! and last on `/cycle` all else. Every number comes back to the bit. Log times are CLOCK_MONOTONIC
//! stamps moved to the calendar by one offset, which is in the metadata.
//!
//! A recording is read only as it was written: what has checksums is held to them first, and what is
//! damaged is left out where that is asked for.

mod chunk;
mod fields;
mod file;
mod reader;
mod scan;
mod source;
#[cfg(test)]
mod tests;
mod writer;

use std::collections::BTreeMap;

pub(crate) use file::{cause, create};
pub use reader::{Item, Items, Recording};
pub use scan::Damage;
pub(crate) use source::Source;
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
/// version 2 recorded neither the tool's acceleration nor the joints' motion as the law sees it, nor
/// the wrench without the lag of its estimate and how often that was too large; up to version 3
/// modes, reasons and the like were codes, not names; up to version 4 the stiffness that is believed
/// in was not recorded, up to version 5 not the normal, up to version 6 not how sure the wrench is, and up to
/// version 7 not the share of the command's verdict.
pub(crate) const PRESENT_RECORD_VERSION: u32 = 8;
/// Metadata: the checksum of the other entries. A file that breaks off has none of its data.
const CHECKSUM: &str = "crc32";

/// The channels in the order in which they are written first: their ids count from 1.
const TOPICS: [&str; 4] = [STATE, COMMAND, CYCLE, TRUTH];

/// The entry [`CHECKSUM`] for metadata, whether or not it is there already.
fn checksum(metadata: &BTreeMap<String, String>) -> String {
    let mut hasher = crc32fast::Hasher::new();
    for (key, value) in metadata.iter().filter(|(key, _)| *key != CHECKSUM) {
        hasher.update(format!("{key}\0{value}\0").as_bytes());
    }
    format!("{:08x}", hasher.finalize())
}

/// Name of the attachment with the configuration that holds from this record on.
fn configuration_name(sequence: u64) -> String {
    format!("{CONFIGURATION}{sequence}.toml")
}

/// The record of [`configuration_name`].
fn configuration_sequence(name: &str) -> Option<u64> {
    name.strip_prefix(CONFIGURATION)?.strip_suffix(".toml")?.parse().ok()
}
