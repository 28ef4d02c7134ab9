//! Whether a recording is as it was written. Every byte of one that was ended in order is under a
//! checksum: chunks of messages, attachments and metadata have their own, the data as a whole and the
//! summary another. One that breaks off lacks the last two.

use std::collections::BTreeMap;
use std::fmt::{Display, Formatter};
use std::ops::Range;

use mcap::MAGIC;
use mcap::records::op;

use super::chunk::{Chunk, Index, is_index_of};
use super::fields::{Fields, Framed, record};
use super::{CHECKSUM, METADATA, checksum, configuration_sequence};

/// Bytes of a recording that are not as they were written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// Where.
    pub bytes: Range<usize>,
    /// What is wrong.
    pub what: &'static str,
}

impl Display for Damage {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Range { start, end } = self.bytes;
        write!(f, "damaged at byte {start}, or after it before byte {end}: {}", self.what)
    }
}

/// What is whole in a recording, and what is not.
#[derive(Debug, Default)]
pub(super) struct Contents {
    /// Bodies of the chunks.
    pub(super) chunks: Vec<Range<usize>>,
    pub(super) configurations: BTreeMap<u64, String>,
    pub(super) metadata: BTreeMap<String, String>,
    /// Where the metadata is.
    pub(super) metadata_at: Range<usize>,
    pub(super) damages: Vec<Damage>,
    /// Whether it was ended in order.
    pub(super) complete: bool,
}

/// A record that is as it was written.
enum Whole {
    Header,
    Metadata(BTreeMap<String, String>),
    /// Its name and its text.
    Attachment(String, String),
    /// Where its body is.
    Chunk(Range<usize>, Index),
    MessageIndex,
    DataEnd(u32),
}

/// Why there is none.
enum Fault {
    /// It is longer than the file, and may have been cut off there.
    BreaksOff,
    Damaged(&'static str),
}

/// Bytes of the footer, its opcode and length included; the last four are its checksum.
const FOOTER: usize = 9 + 20;

/// Reads a file from its first byte to its last.
pub(super) fn scan(bytes: &[u8]) -> Contents {
    let mut contents = Contents::default();
    let mut damage = |bytes: Range<usize>, what| contents.damages.push(Damage { bytes, what });
    if !bytes.starts_with(MAGIC) {
        damage(0..MAGIC.len(), "not the first bytes of an MCAP file");
    }
    let is_ended = bytes.ends_with(MAGIC);
    contents.complete = is_ended;
    let (mut at, mut index) = (MAGIC.len(), Index::new());
    while at < bytes.len() {
        let (whole, end) = match read(bytes, at, &index) {
            Ok(read) => read,
            Err(fault) => {
                let next = (at + 1..bytes.len()).find(|at| can_go_on(bytes, *at));
                let what = match fault {
                    Fault::Damaged(what) => what,
                    Fault::BreaksOff if next.is_none() && !is_ended => break,
                    Fault::BreaksOff => "a record is longer than what is left",
                };
                let next = next.unwrap_or(bytes.len());
                damage(at..next, what);
                at = next;
                continue;
            }
        };
        match whole {
            Whole::Header | Whole::MessageIndex => {}
            Whole::Metadata(found) => (contents.metadata, contents.metadata_at) = (found, at..end),
            Whole::Attachment(name, text) => {
                if let Some(sequence) = configuration_sequence(&name) {
                    contents.configurations.insert(sequence, text);
                }
            }
            Whole::Chunk(body, of_chunk) => {
                // No two chunks have the same messages.
                if contents.chunks.iter().any(|known| bytes[known.clone()] == bytes[body.clone()]) {
                    damage(at..end, "a chunk of messages is there twice");
                } else {
                    contents.chunks.push(body);
                }
                index = of_chunk;
            }
            Whole::DataEnd(saved) => {
                if contents.damages.is_empty() && crc32fast::hash(&bytes[..at]) != saved {
                    let what =
                        "the checksum of all before it does not match, though those of messages and configurations do";
                    contents.damages.push(Damage { bytes: 0..end, what });
                }
                let (complete, damaged) = summary(bytes, end);
                contents.complete = complete;
                contents.damages.extend(damaged.map(|bytes| Damage { bytes, what: "the summary at the end" }));
                return contents;
            }
        }
        at = end;
    }
    contents
}

/// Reads the record at byte `at`, after a chunk with this index, and where the next begins.
fn read(bytes: &[u8], at: usize, index: &Index) -> Result<(Whole, usize), Fault> {
    let Some(Framed { opcode, body, end }) = record(bytes, at) else { return Err(too_long(bytes, at)) };
    let damaged = |what| move || Fault::Damaged(what);
    let whole = match opcode {
        op::HEADER if at == MAGIC.len() => header(body).map(|()| Whole::Header).ok_or_else(damaged("the header"))?,
        op::METADATA => metadata(body).map(Whole::Metadata).ok_or_else(damaged("the metadata"))?,
        op::ATTACHMENT => attachment(body).ok_or_else(damaged("an attached configuration"))?,
        op::CHUNK => {
            let chunk = Chunk::read(body).ok_or_else(damaged("the head of a chunk of messages"))?;
            let unpacked = chunk.unpack().map_err(Fault::Damaged)?;
            let index = chunk.index(&unpacked).ok_or_else(damaged("the head of a chunk of messages"))?;
            Whole::Chunk(end - body.len()..end, index)
        }
        op::MESSAGE_INDEX => {
            is_index_of(body, index).map(|()| Whole::MessageIndex).ok_or_else(damaged("the index of a chunk"))?
        }
        op::DATA_END => {
            Fields(body).u32().filter(|_| body.len() == 4).map(Whole::DataEnd).ok_or_else(damaged("the data end"))?
        }
        _ => return Err(Fault::Damaged("a record of a kind that no recording has here")),
    };
    Ok((whole, end))
}

/// What it means that a record is longer than the file.
fn too_long(bytes: &[u8], at: usize) -> Fault {
    let mut fields = Fields(&bytes[at..]);
    let opcode = fields.take(1).map(|opcode| opcode[0]);
    let may_break_off = match (opcode, fields.length()) {
        (Some(opcode), Some(length)) => may_break_off(opcode, length, fields.0),
        _ => true,
    };
    if may_break_off {
        Fault::BreaksOff
    } else {
        Fault::Damaged("a record of a kind or a length that no recording has here")
    }
}

/// Whether a body of `length` bytes, of which only the first ones are there, agrees with itself.
fn may_break_off(opcode: u8, length: usize, beginning: &[u8]) -> bool {
    // Takes the fields that such a body begins with, and says how many bytes it has behind them.
    let behind: fn(&mut Fields<'_>) -> Option<usize> = match opcode {
        op::HEADER => |fields| {
            let (_profile, _library) = (fields.text()?, fields.text()?);
            Some(0)
        },
        op::METADATA => |fields| {
            let _name = fields.text()?;
            Some(fields.u32()? as usize)
        },
        op::ATTACHMENT => |fields| {
            let _times = (fields.u64()?, fields.u64()?);
            let (_name, _media_type) = (fields.text()?, fields.text()?);
            // And its checksum.
            Some(fields.length()?.saturating_add(size_of::<u32>()))
        },
        op::CHUNK => |fields| Chunk::read_head(fields).map(|(_head, packed)| packed),
        op::MESSAGE_INDEX => |fields| {
            let _channel = fields.u16()?;
            Some(fields.u32()? as usize)
        },
        op::DATA_END => |_| Some(size_of::<u32>()),
        _ => return false,
    };
    let mut fields = Fields(beginning);
    match behind(&mut fields) {
        // As many as the file says, which may be anything.
        Some(behind) => (beginning.len() - fields.0.len()).checked_add(behind) == Some(length),
        // What ends within the fields can't be held against anything.
        None => true,
    }
}

/// Whether something begins here that must have been written so: it has a checksum.
fn can_go_on(bytes: &[u8], at: usize) -> bool {
    let has_checksum = matches!(bytes[at], op::CHUNK | op::ATTACHMENT | op::METADATA | op::DATA_END);
    has_checksum
        && match read(bytes, at, &Index::new()) {
            Ok((Whole::Chunk(..) | Whole::Attachment(..) | Whole::Metadata(_), _)) => true,
            Ok((Whole::DataEnd(_), end)) => summary(bytes, end) == (true, None),
            _ => false,
        }
}

fn header(body: &[u8]) -> Option<()> {
    let mut fields = Fields(body);
    let (_profile, _library) = (fields.text()?, fields.text()?);
    fields.end()
}

fn metadata(body: &[u8]) -> Option<BTreeMap<String, String>> {
    let mut fields = Fields(body);
    let name = fields.text()?;
    let texts = fields.texts()?;
    fields.end()?;
    // Earlier versions wrote no checksum.
    let is_whole = texts.get(CHECKSUM).is_none_or(|saved| *saved == checksum(&texts));
    (name == METADATA && is_whole).then_some(texts)
}

fn attachment(body: &[u8]) -> Option<Whole> {
    let (content, saved) = body.split_last_chunk()?;
    if crc32fast::hash(content) != u32::from_le_bytes(*saved) {
        return None;
    }
    let mut fields = Fields(content);
    let _times = (fields.u64()?, fields.u64()?);
    let (name, _media_type) = (fields.text()?, fields.text()?);
    let length = fields.length()?;
    let text = String::from_utf8_lossy(fields.take(length)?);
    fields.end()?;
    Some(Whole::Attachment(name.to_owned(), text.into_owned()))
}

/// Whether all of the file that comes after its data is there, and which bytes of it are damaged.
fn summary(bytes: &[u8], from: usize) -> (bool, Option<Range<usize>>) {
    let damaged = || Some(from..bytes.len());
    let footer = bytes.len().checked_sub(MAGIC.len() + FOOTER).filter(|at| *at >= from);
    let saved =
        footer.and_then(|at| record(bytes, at)).filter(|footer| footer.opcode == op::FOOTER && footer.body.len() == 20);
    let is_whole = saved.is_some_and(|footer| {
        let (content, saved) = bytes[from..footer.end].split_at(footer.end - from - 4);
        crc32fast::hash(content).to_le_bytes() == *saved
    });
    match (is_whole, bytes.ends_with(MAGIC)) {
        (true, true) => (true, None),
        (false, false) => (false, None),
        (true, false) | (false, true) => (true, damaged()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chunk_that_breaks_off_has_a_length_that_its_head_agrees_with() {
        // The head of a chunk without compression that says it has so many bytes, and three of them.
        let head = [0; 2 * 8 + 8 + 4 + 4];
        let beginning = |packed: u64| [&head[..], &packed.to_le_bytes(), &[1, 2, 3]].concat();
        let head = beginning(0).len() - 3;
        assert!(may_break_off(op::CHUNK, head + 1000, &beginning(1000)));
        for (packed, length) in [(1000, head + 999), (u64::MAX, head + 1000), (u64::MAX, head - 1), (0, usize::MAX)] {
            assert!(!may_break_off(op::CHUNK, length, &beginning(packed)), "{packed} {length}");
        }
    }
}
