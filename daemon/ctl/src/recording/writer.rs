//! Writing a recording.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Write;
use std::time::{SystemTime, UNIX_EPOCH};

use admittance_host::clock::monotonic_ns;
use ipc_types::layout::{WireSample, WireType as _};
use ipc_types::{CommandSample, RecordKind, RecordSample, SCHEMA_VERSION, StateSample, TruthSample, json_schema};
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
use serde_json::Value;

use super::{
    CHECKSUM, COMMAND_FIELD, METADATA, PRESENT_RECORD_VERSION, RECORD_VERSION, STATE_FIELD, TOPICS, checksum,
    configuration_name,
};

/// Bytes of a chunk before compression at which it ends by itself, when it has not been flushed
/// before.
const CHUNK_BYTES: u64 = 8 << 20;

/// A recording being written. What was flushed stays readable, whatever happens to the process.
pub struct RecordingWriter<W: Write> {
    writer: Writer<NoSeek<W>>,
    state: u16,
    command: u16,
    cycle: u16,
    truth: u16,
    /// From CLOCK_MONOTONIC to the time since 1970 in ns, once and for all: later steps of the
    /// calendar clock do not matter.
    calendar_offset: u64,
}

impl<W: Write> RecordingWriter<W> {
    /// Begins a recording of a daemon with this configuration.
    pub fn new(output: W, instance: &str, configuration: &str) -> Result<Self, McapError> {
        let options = WriteOptions::new()
            .compression(Some(Compression::Lz4))
            .chunk_size(Some(CHUNK_BYTES))
            .profile("")
            .library(concat!("admittancectl ", env!("CARGO_PKG_VERSION")))
            // A chunk then reaches the file as a whole or not at all.
            .disable_seeking(true);
        let mut writer = options.create(NoSeek::new(output))?;
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_nanos() as u64);
        let calendar_offset = since_1970.saturating_sub(monotonic_ns());
        let metadata = [
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("schema_version", SCHEMA_VERSION.to_string()),
            (RECORD_VERSION, PRESENT_RECORD_VERSION.to_string()),
            ("instance", instance.to_owned()),
            ("calendar_offset_ns", calendar_offset.to_string()),
        ];
        let mut metadata: BTreeMap<_, _> = metadata.map(|(key, value)| (key.to_owned(), value)).into();
        metadata.insert(CHECKSUM.to_owned(), checksum(&metadata));
        writer.write_metadata(&Metadata { name: METADATA.to_owned(), metadata })?;
        let mut channel = |topic: &str, name: &str, schema: &Value| {
            let schema = writer.add_schema(name, "jsonschema", schema.to_string().as_bytes())?;
            writer.add_channel(schema, topic, "json", &BTreeMap::new())
        };
        let mut cycle = json_schema(&RecordSample::INFO);
        if let Some(properties) = cycle["properties"].as_object_mut() {
            properties.retain(|name, _| ![STATE_FIELD, COMMAND_FIELD].contains(&name.as_str()));
        }
        if let Some(required) = cycle["required"].as_array_mut() {
            required.retain(|name| name != STATE_FIELD && name != COMMAND_FIELD);
        }
        let [state, command, of_cycle, truth] = TOPICS;
        let mut recording = Self {
            state: channel(state, StateSample::INFO.name, &json_schema(&StateSample::INFO))?,
            command: channel(command, CommandSample::INFO.name, &json_schema(&CommandSample::INFO))?,
            cycle: channel(of_cycle, RecordSample::INFO.name, &cycle)?,
            truth: channel(truth, TruthSample::INFO.name, &json_schema(&TruthSample::INFO))?,
            calendar_offset,
            writer,
        };
        recording.configuration(0, configuration)?;
        recording.flush()?;
        Ok(recording)
    }

    /// Attaches the configuration that holds from this record on; 0 is from the first.
    pub fn configuration(&mut self, sequence: u64, text: &str) -> Result<(), McapError> {
        let now = self.calendar_offset + monotonic_ns();
        self.writer.attach(&Attachment {
            log_time: now,
            create_time: now,
            name: configuration_name(sequence),
            media_type: "application/toml".to_owned(),
            data: Cow::Borrowed(text.as_bytes()),
        })
    }

    /// Adds a record.
    pub fn record(&mut self, record: &RecordSample) -> Result<(), McapError> {
        // Viewers order messages by this time, so all of a record have the same.
        let (sequence, at) = (record.sequence, record.now_ns);
        if record.kind == RecordKind::Sample.code() {
            self.message(self.state, sequence, at, record.state.stamp_ns, &record.state.to_json())?;
        }
        if record.command.state_sequence > 0 {
            self.message(self.command, sequence, at, record.command.stamp_ns, &record.command.to_json())?;
        }
        self.rest(record)
    }

    /// The same with the end of a chunk before its last message.
    #[cfg(test)]
    pub(super) fn record_in_two_chunks(&mut self, record: &RecordSample) -> Result<(), McapError> {
        let (sequence, at) = (record.sequence, record.now_ns);
        self.message(self.state, sequence, at, record.state.stamp_ns, &record.state.to_json())?;
        self.message(self.command, sequence, at, record.command.stamp_ns, &record.command.to_json())?;
        self.flush()?;
        self.rest(record)
    }

    /// Adds what is on no channel of its own.
    fn rest(&mut self, record: &RecordSample) -> Result<(), McapError> {
        let (sequence, at) = (record.sequence, record.now_ns);
        // Not of the whole record, which would be turned into JSON twice.
        let rest = RecordSample { state: StateSample::zeroed(), command: CommandSample::zeroed(), ..*record };
        let mut rest = rest.to_json();
        if let Some(object) = rest.as_object_mut() {
            object.remove(STATE_FIELD);
            object.remove(COMMAND_FIELD);
        }
        self.message(self.cycle, sequence, at, at, &rest)
    }

    /// Adds what was true in the plant.
    pub fn truth(&mut self, truth: &TruthSample) -> Result<(), McapError> {
        self.message(self.truth, truth.sequence, truth.stamp_ns, truth.stamp_ns, &truth.to_json())
    }

    fn message(
        &mut self,
        channel_id: u16,
        sequence: u64,
        at: u64,
        published: u64,
        json: &Value,
    ) -> Result<(), McapError> {
        let header = MessageHeader {
            channel_id,
            // Its low half is all that MCAP has room for; the whole is in the message.
            sequence: sequence as u32,
            log_time: self.calendar_offset.saturating_add(at),
            publish_time: self.calendar_offset.saturating_add(published),
        };
        self.writer.write_to_known_channel(&header, json.to_string().as_bytes())
    }

    /// Ends the chunk and hands it to the system: what was added so far survives the process.
    pub fn flush(&mut self) -> Result<(), McapError> {
        self.writer.flush()
    }

    /// Ends the recording with its index.
    pub fn finish(mut self) -> Result<(), McapError> {
        self.writer.finish()?;
        Ok(self.writer.into_inner().into_inner().flush()?)
    }
}
