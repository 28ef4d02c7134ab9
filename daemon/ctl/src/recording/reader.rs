//! Reading a recording, also one that breaks off or is damaged.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use ipc_types::layout::WireType as _;
use ipc_types::{CommandSample, RecordKind, RecordSample, StateSample, TruthSample};
use mcap::records::op;
use serde_json::Value;

use super::chunk::{Chunk, Message, channel};
use super::fields::record;
use super::scan::{Contents, Damage, scan};
use super::{COMMAND, COMMAND_FIELD, CYCLE, PRESENT_RECORD_VERSION, RECORD_VERSION, STATE, STATE_FIELD, TOPICS, TRUTH};
use crate::Exit;

/// A recording.
pub struct Recording {
    name: String,
    bytes: Vec<u8>,
    contents: Contents,
    record_version: u32,
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
    /// 66 when it cannot be read, 65 when it is no recording, or a damaged one.
    pub fn open(path: &Path) -> Result<Self, (Exit, String)> {
        let recording = Self::recover(path)?;
        recording.refuse_damage()
    }

    /// Reads a file of which some bytes may not be as they were written; see [`Self::damages`].
    ///
    /// # Errors
    /// 66 when it cannot be read, 65 when it is no recording.
    pub fn recover(path: &Path) -> Result<Self, (Exit, String)> {
        let unreadable = |why: String| (Exit::NoInput, format!("{}: {why}", path.display()));
        let is_file = std::fs::metadata(path).map_err(|error| unreadable(error.to_string()))?.is_file();
        if !is_file {
            return Err(unreadable("not a regular file".to_owned()));
        }
        let mut bytes = Vec::new();
        let read = File::open(path).and_then(|mut file| file.read_to_end(&mut bytes));
        read.map_err(|error| unreadable(error.to_string()))?;
        Self::from_bytes(bytes, &path.display().to_string())
    }

    /// A recording from memory, damaged or not; `name` is for messages.
    ///
    /// # Errors
    /// 65 when it is no recording.
    pub fn from_bytes(bytes: Vec<u8>, name: &str) -> Result<Self, (Exit, String)> {
        let foreign =
            |why: &str| (Exit::DataError, format!("{name}: {why}; accepted: what admittancectl record wrote"));
        let contents = scan(&bytes);
        if contents.metadata.is_empty() && contents.configurations.is_empty() {
            let is_mcap = bytes.starts_with(mcap::MAGIC);
            return Err(foreign(&match contents.damages.first() {
                _ if !is_mcap => "not an MCAP file".to_owned(),
                None => "an MCAP file of another program".to_owned(),
                Some(first) => {
                    format!("an MCAP file of another program, or nothing is left that says what it is: {first}")
                }
            }));
        }
        let mut recording = Self { name: name.to_owned(), bytes, contents, record_version: PRESENT_RECORD_VERSION };
        recording.find_record_version();
        Ok(recording)
    }

    /// The same when nothing of it is damaged.
    ///
    /// # Errors
    /// 65, with the first damage.
    pub fn refuse_damage(self) -> Result<Self, (Exit, String)> {
        let [first, more @ ..] = self.damages() else { return Ok(self) };
        let more = if more.is_empty() { String::new() } else { format!(", and so are {} more parts", more.len()) };
        let text = format!("{}: {first}{more}; --recover goes on with what is whole", self.name);
        Err((Exit::DataError, text))
    }

    /// What is not as it was written, and is therefore left out.
    pub fn damages(&self) -> &[Damage] {
        &self.contents.damages
    }

    /// Configuration texts by the sequence of the record from which on they hold; 0 is from the
    /// first.
    pub fn configurations(&self) -> &BTreeMap<u64, String> {
        &self.contents.configurations
    }

    /// Version, schema version, instance, and the offset of log times.
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.contents.metadata
    }

    /// The version of its records; fields that were added later are zero.
    pub fn record_version(&self) -> u32 {
        self.record_version
    }

    /// The version that the metadata tells, held against the first record: metadata of earlier
    /// versions have no checksum.
    fn find_record_version(&mut self) {
        let told = self.metadata().get(RECORD_VERSION).map_or(Some(1), |version| version.parse().ok());
        let shown = self.items().first_cycle().map(|(cycle, command)| version_of(&cycle, command.as_ref()));
        self.record_version = match (told, shown) {
            // A later version's record has what the present one has, and more.
            (Some(told), Some(PRESENT_RECORD_VERSION)) if told > PRESENT_RECORD_VERSION => told,
            (told, Some(shown)) => {
                if told != Some(shown) && !self.metadata().is_empty() {
                    let bytes = self.contents.metadata_at.clone();
                    let what = "the metadata: the version of the records is not theirs";
                    self.contents.damages.push(Damage { bytes, what });
                }
                shown
            }
            (told, None) => told.unwrap_or(PRESENT_RECORD_VERSION),
        };
    }

    #[cfg(test)]
    pub(super) fn contents_of_chunks(&self) -> Vec<std::ops::Range<usize>> {
        self.contents.chunks.clone()
    }

    /// Everything in it, in order. A file that breaks off simply ends.
    pub fn items(&self) -> Items<'_> {
        Items {
            recording: self,
            chunks: self.contents.chunks.iter(),
            chunk_end: 0,
            unpacked: Vec::new(),
            at: 0,
            topics: TOPICS.into_iter().map(str::to_owned).zip(1..).map(|(topic, id)| (id, topic)).collect(),
            state: None,
            command: None,
            messages: 0,
            last: None,
            is_cut: false,
        }
    }
}

/// A state sample with the present names of its fields: what is `plays_plan` now was `reserved`,
/// and zero. Torques there were none.
fn with_present_names(mut state: Value) -> Value {
    if let (Some(object), Value::Object(zeroed)) = (state.as_object_mut(), StateSample::zeroed().to_json()) {
        if !object.contains_key("plays_plan")
            && let Some(reserved) = object.remove("reserved")
        {
            object.insert("plays_plan".to_owned(), reserved);
        }
        for name in ["joint_torque", "torque_valid", "follows_joint_velocity", "joint_velocity_reference"] {
            object.entry(name).or_insert_with(|| zeroed[name].clone());
        }
    }
    state
}

/// A command with the present names of its fields: what joints follow that leave their resolution to the
/// daemon, none did; the share at risk was not said.
fn of_present_names(mut command: Value) -> Value {
    if let (Some(object), Value::Object(zeroed)) = (command.as_object_mut(), CommandSample::zeroed().to_json()) {
        for name in ["joint_per_twist", "verdict_share"] {
            object.entry(name).or_insert_with(|| zeroed[name].clone());
        }
    }
    command
}

/// The version of records whose messages on /cycle look like this, and those on /command, if there are any.
fn version_of(cycle: &Value, command: Option<&Value>) -> u32 {
    let has = |field: &str| cycle.get(field).is_some();
    match () {
        () if has("wrench_deviation") && command.is_none_or(|command| command.get("verdict_share").is_some()) => 8,
        () if has("wrench_deviation") => 7,
        () if has("believed_normal") => 6,
        () if has("believed_stiffness_n_m") => 5,
        () if has("wrench_without_lag") => {
            if cycle["kind"].is_string() {
                4
            } else {
                3
            }
        }
        () if has("belief_uncertainty_n") => 2,
        () => 1,
    }
}

/// See [`Recording::items`].
pub struct Items<'a> {
    recording: &'a Recording,
    /// Those that are left.
    chunks: std::slice::Iter<'a, std::ops::Range<usize>>,
    /// Where the chunk under way ends in the file; its records, and where the next one begins.
    chunk_end: usize,
    unpacked: Vec<u8>,
    at: usize,
    topics: HashMap<u16, String>,
    /// Messages of the record under way, with their sequence.
    state: Option<(u32, StateSample)>,
    command: Option<(u32, CommandSample)>,
    messages: u64,
    /// Sequence of the last record.
    last: Option<u32>,
    /// Whether part of the next record may be among what is damaged.
    is_cut: bool,
}

/// A message on one of the channels.
struct Found {
    topic: String,
    sequence: u32,
    value: Value,
}

impl Items<'_> {
    /// Whether the recording was ended in order.
    pub fn is_complete(&self) -> bool {
        self.recording.contents.complete
    }

    /// The first message on /cycle, and the first on /command where there is one.
    fn first_cycle(mut self) -> Option<(Value, Option<Value>)> {
        let (mut cycle, mut command) = (None, None);
        while let Some(Ok(Found { topic, value, .. })) = self.message() {
            match topic.as_str() {
                CYCLE if cycle.is_none() => cycle = Some(value),
                COMMAND if command.is_none() => command = Some(value),
                _ => {}
            }
            if cycle.is_some() && command.is_some() {
                break;
            }
        }
        cycle.map(|cycle| (cycle, command))
    }

    fn next_chunk(&mut self) -> Option<()> {
        let Recording { bytes, contents, .. } = self.recording;
        let (before, body) = (self.chunk_end, self.chunks.next()?);
        let is_between = |damage: &Damage| before <= damage.bytes.start && damage.bytes.end <= body.start;
        self.is_cut |= contents.damages.iter().any(is_between);
        // Each has been unpacked before.
        self.unpacked = Chunk::read(&bytes[body.clone()])?.unpack().ok()?;
        (self.at, self.chunk_end) = (0, body.end);
        Some(())
    }

    /// The next message that is ours.
    fn message(&mut self) -> Option<Result<Found, String>> {
        loop {
            let Some(found) = record(&self.unpacked, self.at) else {
                self.next_chunk()?;
                continue;
            };
            self.at = found.end;
            if found.opcode == op::CHANNEL
                && let Some((id, topic)) = channel(found.body)
            {
                self.topics.insert(id, topic.to_owned());
            }
            if found.opcode == op::MESSAGE
                && let Some(Message { channel, sequence, data, .. }) = Message::read(found.body)
            {
                self.messages += 1;
                let topic = self.topics.get(&channel).filter(|topic| TOPICS.contains(&topic.as_str()));
                let Some(topic) = topic.cloned() else { continue };
                let value = serde_json::from_slice(data).map_err(|error| format!("on {topic}: {error}"));
                return Some(value.map(|value| Found { topic, sequence, value }));
            }
        }
    }

    /// Takes in a message; a record is complete with its last one.
    fn take(&mut self, Found { topic, sequence, value }: Found) -> Result<Option<Item>, String> {
        let foreign = || format!("on {topic}: a field is missing, or of another type");
        match topic.as_str() {
            STATE => {
                let value = with_present_names(value);
                self.state = Some((sequence, StateSample::from_json(&value).ok_or_else(foreign)?));
            }
            COMMAND => {
                let value = of_present_names(value);
                self.command = Some((sequence, CommandSample::from_json(&value).ok_or_else(foreign)?));
            }
            TRUTH => return Ok(Some(Item::Truth(Box::new(TruthSample::from_json(&value).ok_or_else(foreign)?)))),
            _ => {
                let mut value = value;
                let object = value.as_object_mut().ok_or_else(foreign)?;
                object.insert(STATE_FIELD.to_owned(), StateSample::zeroed().to_json());
                object.insert(COMMAND_FIELD.to_owned(), CommandSample::zeroed().to_json());
                if self.recording.record_version < PRESENT_RECORD_VERSION
                    && let Value::Object(zeroed) = RecordSample::zeroed().to_json()
                {
                    zeroed.into_iter().for_each(|(name, value)| {
                        object.entry(name).or_insert(value);
                    });
                }
                let mut record = Box::new(RecordSample::from_json(&value).ok_or_else(foreign)?);
                let state = self.state.take().filter(|(of, _)| *of == sequence).map(|(_, state)| state);
                let command = self.command.take().filter(|(of, _)| *of == sequence).map(|(_, command)| command);
                let follows = self.last.replace(sequence).is_some_and(|last| last.wrapping_add(1) == sequence);
                let is_sample = record.kind == RecordKind::Sample.code();
                let is_part = (is_sample && state.is_none()) || (!follows && state.is_none() && command.is_none());
                if std::mem::take(&mut self.is_cut) && is_part {
                    return Ok(None);
                }
                record.state = state.unwrap_or(record.state);
                record.command = command.unwrap_or(record.command);
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
            match self.message()?.and_then(|found| self.take(found)) {
                Ok(Some(item)) => return Some(Ok(item)),
                Ok(None) => {}
                Err(why) => {
                    (self.chunks, self.unpacked) = ([].iter(), Vec::new());
                    let text = format!("{}: message {} {why}", self.recording.name, self.messages);
                    return Some(Err((Exit::DataError, text)));
                }
            }
        }
    }
}
