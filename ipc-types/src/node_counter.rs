//! iceoryx2's counter of node ids: one file of each prefix in shared memory, 16 bytes that every
//! new node opens. iceoryx2 makes it writable for everyone, and waits for ever for one that is
//! empty. So it is made here, before iceoryx2 looks for it, for this user alone; one that was open
//! to others or is damaged is exchanged, and somebody else's is an error.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use crate::place::{PlaceError, effective_user};
use crate::removal::{SHARED_MEMORY, shared_memory_files};

/// The file's name after the prefix, in iceoryx2 0.10.0.
const NAME: &str = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";
/// The version that iceoryx2 expects in its first eight bytes: major << 32 | minor << 16 | patch.
const VERSION: u64 = 10 << 16;
const LENGTH: u64 = 16;
/// How often somebody else may be in between.
const TRIES: usize = 100;
const FOREIGN: &str =
    "all programs of an instance run as one user; let root remove what is not theirs, or give another ipc.prefix";

/// Where the counter of this prefix is.
fn path(prefix: &str) -> PathBuf {
    Path::new(SHARED_MEMORY).join(format!("{prefix}{NAME}"))
}

/// Sees to it that the counter is there, sound and closed to others.
///
/// # Errors
/// [`PlaceError`] names the file and whose it is.
pub(crate) fn secure(prefix: &str) -> Result<(), PlaceError> {
    let path = path(prefix);
    let failed = |source: io::Error| PlaceError::Io { path: path.clone(), source };
    for _ in 0..TRIES {
        match std::fs::symlink_metadata(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => match make(&path) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                made => return made.map_err(failed),
            },
            Err(error) => return Err(failed(error)),
            Ok(found) if found.uid() != effective_user() => {
                return Err(PlaceError::Owner { path, owner: found.uid(), remedy: FOREIGN });
            }
            Ok(found) if is_sound(&path, &found) => return Ok(()),
            // Nobody keeps it open: a node looks once, and another counter does as well.
            Ok(_) => match std::fs::remove_file(&path) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed(error)),
                _ => {}
            },
        }
    }
    Err(failed(io::Error::other("it is exchanged all the time by another program of this user")))
}

/// An error for the first file with this prefix that is not this user's.
pub(crate) fn foreign_files(prefix: &str) -> Result<(), PlaceError> {
    let shared_memory = || Path::new(SHARED_MEMORY).to_owned();
    let files = shared_memory_files(prefix)
        .map_err(|error| PlaceError::Io { path: shared_memory(), source: io::Error::other(error.to_string()) })?;
    for path in files {
        // One that is gone meanwhile hurts nobody.
        let Ok(found) = std::fs::symlink_metadata(&path) else { continue };
        if found.uid() != effective_user() {
            return Err(PlaceError::Owner { path, owner: found.uid(), remedy: FOREIGN });
        }
    }
    Ok(())
}

/// Whether nobody else can have opened it, and iceoryx2 will not wait for it.
fn is_sound(path: &Path, found: &Metadata) -> bool {
    let is_closed = found.is_file() && found.nlink() == 1 && found.mode() & 0o777 == 0o600;
    let version = || {
        let mut bytes = [0; 8];
        let read = File::open(path).and_then(|mut file| file.read_exact(&mut bytes));
        read.is_ok().then_some(u64::from_le_bytes(bytes))
    };
    is_closed && found.len() == LENGTH && version() == Some(VERSION)
}

/// A counter at zero. It comes under its name when it is complete, and only if nobody was faster.
fn make(path: &Path) -> io::Result<()> {
    let mut bytes = [0; LENGTH as usize];
    bytes[..8].copy_from_slice(&VERSION.to_le_bytes());
    let mut options = OpenOptions::new();
    options.write(true).mode(0o600).custom_flags(libc::O_TMPFILE);
    let mut file = options.open(SHARED_MEMORY)?;
    file.write_all(&bytes)?;
    let nameless = zero_terminated(format!("/proc/self/fd/{}", file.as_raw_fd()).as_bytes())?;
    let name = zero_terminated(path.as_os_str().as_bytes())?;
    // SAFETY: both paths end in a zero byte and outlive the call, which only reads them.
    let linked = unsafe {
        libc::linkat(libc::AT_FDCWD, nameless.as_ptr(), libc::AT_FDCWD, name.as_ptr(), libc::AT_SYMLINK_FOLLOW)
    };
    if linked == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

fn zero_terminated(path: &[u8]) -> io::Result<std::ffi::CString> {
    std::ffi::CString::new(path).map_err(io::Error::other)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What iceoryx2 makes by itself decides name, length and version.
    #[test]
    fn it_is_the_file_that_iceoryx2_makes() {
        use iceoryx2::prelude::{FileName, NodeBuilder, SemanticString, ipc};
        let prefix = format!("c{}_", std::process::id());
        let directory = std::env::temp_dir().join(&prefix);
        let mut config = iceoryx2::config::Config::default();
        let root = iceoryx2::prelude::Path::new(directory.as_os_str().as_bytes()).unwrap();
        config.global.set_root_path(&root);
        config.global.prefix = FileName::new(prefix.as_bytes()).unwrap();
        drop(NodeBuilder::new().config(&config).create::<ipc::Service>().unwrap());
        let theirs = std::fs::read(path(&prefix)).expect("under this name");
        std::fs::remove_file(path(&prefix)).unwrap();
        make(&path(&prefix)).unwrap();
        let ours = std::fs::read(path(&prefix)).unwrap();
        assert!(make(&path(&prefix)).is_err_and(|error| error.kind() == ErrorKind::AlreadyExists));
        std::fs::remove_file(path(&prefix)).unwrap();
        std::fs::remove_dir_all(directory).unwrap();
        assert_eq!(theirs.len(), ours.len());
        assert_eq!(theirs[..8], ours[..8], "the version");
    }
}
