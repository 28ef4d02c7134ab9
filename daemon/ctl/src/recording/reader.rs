//! Reading a recording, also one that breaks off.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use ipc_types::layout::WireType as _;
use ipc_types::{CommandSample, RecordSample, StateSample, TruthSample};
use mcap::McapError;
use mcap::read::{ChunkFlattener, LinearReader, Options};
use mcap::records::Record;
use serde_json::Value;

use super::{
    COMMAND, COMMAND_FIELD, CYCLE, METADATA, PRESENT_RECORD_VERSION, RECORD_VERSION, STATE, STATE_FIELD, TRUTH,
    configuration_sequence,
};
use crate::Exit;

/// A recording.
pub struct Recording {
    name: String,
    bytes: Vec<u8>,
    configurations: BTreeMap<u64, String>,
    metadata: BTreeMap<String, String>,
}

/// What a recording holds, in the order in which it was written.
pub enum Item {
    /// A record of the daemon.
    Record(Box<RecordSample>),
    /// What was true in the simulated plant.
    Truth(Box<TruthSample>),
}

impl Recording {
    /// Reads a file.
    ///
    /// # Errors
    /// 66 when it cannot be read, 65 when it is no recording.
    pub fn open(path: &Path) -> Result<Self, (Exit, String)> {
        let bytes = std::fs::read(path).map_err(|error| (Exit::NoInput, format!("{}: {error}", path.display())))?;
        Self::from_bytes(bytes, &path.display().to_string())
    }

    /// A recording from memory; `name` is for messages.
    pub(super) fn from_bytes(bytes: Vec<u8>, name: &str) -> Result<Self, (Exit, String)> {
        let malformed =
            |why: String| (Exit::DataError, format!("{name}: {why}; accepted: what admittancectl record wrote"));
        if !bytes.starts_with(mcap::MAGIC) {
            return Err(malformed("not an MCAP file".to_owned()));
        }
        let (mut configurations, mut metadata) = (BTreeMap::new(), BTreeMap::new());
        // A chunk that is not complete ends the file; what comes before it counts.
        let records = LinearReader::new_with_options(&bytes, Options::IgnoreEndMagic.into())
            .map_err(|error| malformed(error.to_string()))?;
        for record in records.map_while(Result::ok) {
            match record {
                Record::Metadata(found) if found.name == METADATA => metadata = found.metadata,
                Record::Attachment { header, data, .. } => {
                    if let Some(sequence) = configuration_sequence(&header.name) {
                        configurations.insert(sequence, String::from_utf8_lossy(&data).into_owned());
                    }
                }
                _ => {}
            }
        }
        if metadata.is_empty() {
            return Err(malformed("an MCAP file of another program".to_owned()));
        }
        Ok(Self { name: name.to_owned(), bytes, configurations, metadata })
    }

    /// Configuration texts by the sequence of the record from which on they hold; 0 is from the
    /// first.
    pub fn configurations(&self) -> &BTreeMap<u64, String> {
        &self.configurations
    }

    /// Version, schema version, instance, and the offset of log times.
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// The version of its records; fields that were added later are zero.
    pub fn record_version(&self) -> u32 {
        self.metadata.get(RECORD_VERSION).map_or(1, |version| version.parse().unwrap_or(PRESENT_RECORD_VERSION))
    }

    /// Everything in it, in order. A file that breaks off simply ends.
    pub fn items(&self) -> Items<'_> {
        let records = ChunkFlattener::new_with_options(&self.bytes, Options::IgnoreEndMagic.into()).ok();
        Items {
            name: &self.name,
            is_complete_record: self.record_version() >= PRESENT_RECORD_VERSION,
            records,
            topics: HashMap::new(),
            state: None,
            command: None,
            complete: false,
            messages: 0,
        }
    }
}

/// See [`Recording::items`].
pub struct Items<'a> {
    name: &'a str,
    /// Whether records have all fields of today's.
    is_complete_record: bool,
    records: Option<ChunkFlattener<'a>>,
    topics: HashMap<u16, String>,
    /// Messages of the record under way, with their sequence.
    state: Option<(u32, StateSample)>,
    command: Option<(u32, CommandSample)>,
    complete: bool,
    messages: u64,
}

impl Items<'_> {
    /// After the last item: whether the recording was ended in order.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// Takes in a message; a record is complete with its last one.
    fn message(&mut self, channel: u16, sequence: u32, data: &[u8]) -> Result<Option<Item>, String> {
        self.messages += 1;
        let topic = self.topics.get(&channel).map_or("", String::as_str);
        if ![STATE, COMMAND, CYCLE, TRUTH].contains(&topic) {
            return Ok(None);
        }
        let value: Value = serde_json::from_slice(data).map_err(|error| format!("on {topic}: {error}"))?;
        let foreign = || format!("on {topic}: a field is missing, or of another type");
        match topic {
            STATE => self.state = Some((sequence, StateSample::from_json(&value).ok_or_else(foreign)?)),
            COMMAND => self.command = Some((sequence, CommandSample::from_json(&value).ok_or_else(foreign)?)),
            TRUTH => return Ok(Some(Item::Truth(Box::new(TruthSample::from_json(&value).ok_or_else(foreign)?)))),
            _ => {
                let mut value = value;
                let object = value.as_object_mut().ok_or_else(foreign)?;
                object.insert(STATE_FIELD.to_owned(), StateSample::zeroed().to_json());
                object.insert(COMMAND_FIELD.to_owned(), CommandSample::zeroed().to_json());
                if !self.is_complete_record
                    && let Value::Object(zeroed) = RecordSample::zeroed().to_json()
                {
                    zeroed.into_iter().for_each(|(name, value)| {
                        object.entry(name).or_insert(value);
                    });
                }
                let mut record = Box::new(RecordSample::from_json(&value).ok_or_else(foreign)?);
                let is_its = |of: u32| of == sequence;
                record.state = self.state.take().filter(|(of, _)| is_its(*of)).map_or(record.state, |(_, state)| state);
                record.command =
                    self.command.take().filter(|(of, _)| is_its(*of)).map_or(record.command, |(_, command)| command);
                return Ok(Some(Item::Record(record)));
            }
        }
        Ok(None)
    }
}

impl Iterator for Items<'_> {
    type Item = Result<Item, (Exit, String)>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.records.as_mut()?.next() {
                Some(Ok(Record::Channel(channel))) => {
                    self.topics.insert(channel.id, channel.topic);
                }
                Some(Ok(Record::Message { header, data })) => {
                    match self.message(header.channel_id, header.sequence, &data) {
                        Ok(None) => {}
                        Ok(Some(item)) => return Some(Ok(item)),
                        Err(why) => {
                            self.records = None;
                            return Some(Err((
                                Exit::DataError,
                                format!("{}: message {} {why}", self.name, self.messages),
                            )));
                        }
                    }
                }
                Some(Ok(Record::Footer(_))) => self.complete = true,
                Some(Ok(_)) => {}
                // Its recorder was killed, or the disk was full.
                Some(Err(McapError::UnexpectedEof | McapError::UnexpectedEoc)) | None => {
                    self.records = None;
                    return None;
                }
                Some(Err(error)) => {
                    self.records = None;
                    return Some(Err((Exit::DataError, format!("{}: {error}", self.name))));
                }
            }
        }
    }
}
