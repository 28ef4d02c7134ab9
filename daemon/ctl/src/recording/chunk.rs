//! A chunk of messages: its checksum, and what must agree with its messages.

use std::collections::BTreeMap;
use std::io::Read;

use mcap::records::op;

use super::fields::{Fields, record};

/// lz4 makes no more of a byte than this.
const MOST_PER_BYTE: usize = 256;

/// A chunk whose lengths agree with each other.
pub(super) struct Chunk<'a> {
    times: [u64; 2],
    size: usize,
    checksum: u32,
    compression: &'a str,
    data: &'a [u8],
}

/// By channel, the log time of each message and where it begins in the unpacked chunk.
pub(super) type Index = BTreeMap<u16, Vec<(u64, u64)>>;

/// A message.
pub(super) struct Message<'a> {
    pub(super) channel: u16,
    pub(super) sequence: u32,
    log_time: u64,
    pub(super) data: &'a [u8],
}

impl<'a> Message<'a> {
    pub(super) fn read(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let (channel, sequence, log_time) = (fields.u16()?, fields.u32()?, fields.u64()?);
        let _publish_time = fields.u64()?;
        Some(Self { channel, sequence, log_time, data: fields.0 })
    }
}

/// A channel's id and its topic.
pub(super) fn channel(body: &[u8]) -> Option<(u16, &str)> {
    let mut fields = Fields(body);
    let (id, _schema) = (fields.u16()?, fields.u16()?);
    Some((id, fields.text()?))
}

impl<'a> Chunk<'a> {
    pub(super) fn read(body: &'a [u8]) -> Option<Self> {
        let (mut chunk, packed) = Self::read_head(&mut Fields(body))?;
        chunk.data = chunk.data.get(..packed).filter(|data| data.len() == chunk.data.len())?;
        Some(chunk)
    }

    /// A chunk with all bytes behind its head, and how many of them it says it has.
    pub(super) fn read_head(fields: &mut Fields<'a>) -> Option<(Self, usize)> {
        let times = [fields.u64()?, fields.u64()?];
        let (size, checksum) = (fields.length()?, fields.u32()?);
        let compression = fields.text()?;
        let packed = fields.length()?;
        Some((Self { times, size, checksum, compression, data: fields.0 }, packed))
    }

    /// Its records, unpacked.
    ///
    /// # Errors
    /// What is not as it was written.
    pub(super) fn unpack(&self) -> Result<Vec<u8>, &'static str> {
        const UNREADABLE: &str = "the messages of a chunk cannot be unpacked";
        if self.size > self.data.len().saturating_mul(MOST_PER_BYTE) {
            return Err("a chunk says it has more messages than it can hold");
        }
        let mut unpacked = Vec::new();
        match self.compression {
            "" => unpacked.extend_from_slice(self.data),
            "lz4" => {
                let decoder = lz4::Decoder::new(self.data).map_err(|_| UNREADABLE)?;
                // One more shows that there is more.
                decoder.take(self.size as u64 + 1).read_to_end(&mut unpacked).map_err(|_| UNREADABLE)?;
            }
            _ => return Err("a chunk is compressed in an unknown way"),
        }
        if unpacked.len() != self.size || crc32fast::hash(&unpacked) != self.checksum {
            return Err("the checksum of a chunk of messages does not match");
        }
        Ok(unpacked)
    }

    /// The index of its messages; `None` when they don't agree with its head.
    pub(super) fn index(&self, unpacked: &[u8]) -> Option<Index> {
        let (mut index, mut at, mut times) = (Index::new(), 0, None::<[u64; 2]>);
        while at < unpacked.len() {
            let found = record(unpacked, at)?;
            if found.opcode == op::MESSAGE {
                let message = Message::read(found.body)?;
                index.entry(message.channel).or_default().push((message.log_time, at as u64));
                let [first, last] = times.unwrap_or([message.log_time; 2]);
                times = Some([first.min(message.log_time), last.max(message.log_time)]);
            }
            at = found.end;
        }
        (times.unwrap_or_default() == self.times).then_some(index)
    }
}

/// Whether a record of the file is the index of a channel of the chunk before it.
pub(super) fn is_index_of(body: &[u8], index: &Index) -> Option<()> {
    let mut fields = Fields(body);
    let entries = index.get(&fields.u16()?)?;
    let length = fields.u32()? as usize;
    let mut found = Fields(fields.take(length)?);
    for expected in entries {
        if (found.u64()?, found.u64()?) != *expected {
            return None;
        }
    }
    found.end()?;
    fields.end()
}
