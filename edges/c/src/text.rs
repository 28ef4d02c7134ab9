//! Texts of a fixed size: what went wrong is said without the heap.

use std::ffi::{CStr, c_char};
use std::fmt::{self, Display, Write};

const SIZE: usize = 512;

/// A text that ends in a zero byte; what is too long is cut.
#[derive(Debug)]
pub(crate) struct Text {
    bytes: [u8; SIZE],
    length: usize,
}

impl Default for Text {
    fn default() -> Self {
        Self { bytes: [0; SIZE], length: 0 }
    }
}

impl Text {
    pub(crate) fn set(&mut self, why: &dyn Display) {
        self.length = 0;
        // Full is no failure.
        let _ = write!(self, "{why}");
        self.bytes[self.length] = 0;
    }

    pub(crate) fn as_ptr(&self) -> *const c_char {
        CStr::from_bytes_until_nul(&self.bytes).unwrap_or_default().as_ptr()
    }
}

impl Write for Text {
    fn write_str(&mut self, part: &str) -> fmt::Result {
        let taken = boundary(part, SIZE - 1 - self.length);
        self.bytes[self.length..self.length + taken].copy_from_slice(&part.as_bytes()[..taken]);
        self.length += taken;
        if taken == part.len() { Ok(()) } else { Err(fmt::Error) }
    }
}

/// The last end of a character within the first `most` bytes.
fn boundary(text: &str, most: usize) -> usize {
    (0..=most.min(text.len())).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0)
}

/// Copies a text to where a caller wants it, cut at a character, with a zero byte at its end.
///
/// # Safety
/// `room` points to `size` bytes, or is NULL.
pub(crate) unsafe fn copy(text: &str, room: *mut c_char, size: usize) {
    if room.is_null() || size == 0 {
        return;
    }
    let taken = boundary(text, size - 1);
    // SAFETY: taken is below size, and the caller gives that many bytes, which are no part of `text`.
    unsafe {
        room.copy_from_nonoverlapping(text.as_ptr().cast(), taken);
        room.add(taken).write(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(text: &Text) -> String {
        CStr::from_bytes_until_nul(&text.bytes).expect("it ends").to_str().expect("whole characters").to_owned()
    }

    #[test]
    fn what_is_too_long_is_cut_at_a_character() {
        let mut text = Text::default();
        text.set(&"é".repeat(400));
        assert_eq!(shown(&text).len(), 510);
        text.set(&"short");
        assert_eq!(shown(&text), "short");
        let mut room = [1 as c_char; 6];
        // SAFETY: the room has six bytes.
        unsafe { copy("ab\u{e9}\u{e9}", room.as_mut_ptr(), room.len()) };
        assert_eq!(room.map(|byte| byte as u8), [b'a', b'b', 0xc3, 0xa9, 0, 1]);
    }
}
