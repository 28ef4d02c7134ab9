//! Reading a file that somebody named: a regular one of bounded size, so that a pipe, a device or
//! a wrong path neither holds the program up nor fills its memory.

use std::fs::OpenOptions;
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

/// Largest file that is read, in bytes.
pub const LARGEST_FILE: u64 = 1 << 20;

/// The text of a regular file of [`LARGEST_FILE`] at most.
///
/// # Errors
/// What the system says, or what the file is instead.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_bytes(path, LARGEST_FILE)?)
        .map_err(|_| io::Error::new(ErrorKind::InvalidData, "it is not UTF-8 text; accepted: TOML"))
}

/// What is in a regular file of so many bytes at most.
///
/// # Errors
/// What the system says, or what the file is instead.
pub fn read_bytes(path: &Path, largest: u64) -> io::Result<Vec<u8>> {
    // Without waiting for the other end of a pipe.
    let file = OpenOptions::new().read(true).custom_flags(libc::O_NONBLOCK).open(path)?;
    let found = file.metadata()?;
    let refused = |what: String| {
        Err(io::Error::other(format!("{what}; accepted: a regular file of up to {} MiB", largest >> 20)))
    };
    let kind = found.file_type();
    if !kind.is_file() {
        let what = match () {
            () if kind.is_dir() => "a directory",
            () if kind.is_fifo() => "a pipe",
            () if kind.is_socket() => "a socket",
            () => "a device",
        };
        return refused(format!("it is {what}"));
    }
    let too_large = || refused(format!("it has more than {largest} bytes"));
    if found.len() > largest {
        return too_large();
    }
    let mut bytes = Vec::new();
    // A file may grow meanwhile, and some say that they are empty.
    file.take(largest + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > largest {
        return too_large();
    }
    Ok(bytes)
}
