//! Records of an MCAP file and their fields, every length held against what is there.

use std::collections::BTreeMap;

/// Opcode and length.
const FRAME: usize = 1 + 8;

/// A record: its opcode, its body, and where the next one begins.
pub(super) struct Framed<'a> {
    pub(super) opcode: u8,
    pub(super) body: &'a [u8],
    pub(super) end: usize,
}

/// The record that begins at byte `at`; `None` if it is longer than what is left.
pub(super) fn record(bytes: &[u8], at: usize) -> Option<Framed<'_>> {
    let mut fields = Fields(bytes.get(at..)?);
    let opcode = *fields.take(1)?.first()?;
    let length = fields.length()?;
    let body = fields.take(length)?;
    Some(Framed { opcode, body, end: at + FRAME + length })
}

/// What is left of a record's body.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn take(&mut self, length: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(self.take(2)?.try_into().ok()?))
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.take(8)?.try_into().ok()?))
    }

    /// A length of 64 bits.
    pub(super) fn length(&mut self) -> Option<usize> {
        self.u64()?.try_into().ok()
    }

    pub(super) fn text(&mut self) -> Option<&'a str> {
        let length = self.u32()?;
        std::str::from_utf8(self.take(length as usize)?).ok()
    }

    pub(super) fn texts(&mut self) -> Option<BTreeMap<String, String>> {
        let length = self.u32()?;
        let (mut pairs, mut texts) = (Fields(self.take(length as usize)?), BTreeMap::new());
        while !pairs.is_empty() {
            texts.insert(pairs.text()?.to_owned(), pairs.text()?.to_owned());
        }
        Some(texts)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// `Some` when nothing is left.
    pub(super) fn end(self) -> Option<()> {
        self.is_empty().then_some(())
    }
}
