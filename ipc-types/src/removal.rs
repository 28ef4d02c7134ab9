//! Removal of everything that a private root path and prefix left behind, for the demo and for
//! tests.

use std::io;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use crate::settings::{DEFAULT_PREFIX, DEFAULT_ROOT_PATH};
use crate::{IpcSettings, SettingsError};

/// Where iceoryx2 keeps shared memory on Linux.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";
/// What iceoryx2 makes in its root path beside files that carry the prefix.
const ROOT_ENTRIES: [&str; 2] = ["nodes", "services"];

/// Why nothing, or not everything, was removed.
#[derive(Debug, thiserror::Error)]
pub enum RemoveError {
    /// The settings themselves are not accepted.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The prefix is iceoryx2's default: other programs' files have it too.
    #[error("prefix \"{prefix}\" may belong to other programs: only files of a private prefix are removed")]
    SharedPrefix {
        /// The prefix.
        prefix: String,
    },
    /// The root path is iceoryx2's own or a directory of the system.
    #[error("{} may belong to other programs: only a private root path is removed", root_path.display())]
    SharedRootPath {
        /// The root path.
        root_path: PathBuf,
    },
    /// The root path contains something that iceoryx2 did not make with this prefix. Nothing was
    /// removed.
    #[error(
        "{} holds {}, which does not belong to iceoryx2 with this prefix: nothing was removed",
        root_path.display(),
        entry.display()
    )]
    ForeignEntry {
        /// The root path.
        root_path: PathBuf,
        /// The first entry at fault.
        entry: PathBuf,
    },
    /// The system refused.
    #[error("{} cannot be removed: {source}", path.display())]
    Io {
        /// The path.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// Removes the private root directory with its sockets, discovery files and `*.lock` files, and
/// every file in `/dev/shm` that iceoryx2 made with the private prefix. Call it when all programs
/// that used them have ended: under a running one it splits the system silently. Nothing there is
/// no error.
///
/// # Errors
/// [`RemoveError`]; refused before anything is removed when the prefix or the root path may be
/// someone else's.
pub fn remove_all(settings: &IpcSettings) -> Result<(), RemoveError> {
    if settings.prefix.is_empty() || settings.prefix == DEFAULT_PREFIX {
        return Err(RemoveError::SharedPrefix { prefix: settings.prefix.clone() });
    }
    settings.validate()?;
    let root_path = settings.root_path.as_path();
    // Component-wise, so that "/tmp/iceoryx2/" is found as well.
    if root_path == Path::new(DEFAULT_ROOT_PATH) {
        return Err(RemoveError::SharedRootPath { root_path: root_path.to_path_buf() });
    }
    let entries = root_entries(root_path)?;
    if let Some(entry) = entries.iter().find(|entry| !is_ours(entry, &settings.prefix)) {
        return Err(RemoveError::ForeignEntry { root_path: root_path.to_path_buf(), entry: entry.clone() });
    }
    for entry in shared_memory_files(&settings.prefix)? {
        ignore_missing(&entry, std::fs::remove_file(&entry))?;
    }
    ignore_missing(root_path, std::fs::remove_dir_all(root_path))
}

/// The files in `/dev/shm` that iceoryx2 made with this prefix: what programs with it use or left
/// behind.
///
/// # Errors
/// [`RemoveError::Io`] when `/dev/shm` cannot be read.
pub fn shared_memory_files(prefix: &str) -> Result<Vec<PathBuf>, RemoveError> {
    let entries = list(Path::new(SHARED_MEMORY))?;
    Ok(entries.into_iter().filter(|path| carries(path, prefix)).collect())
}

fn root_entries(root_path: &Path) -> Result<Vec<PathBuf>, RemoveError> {
    match list(root_path) {
        Err(RemoveError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        entries => entries,
    }
}

fn list(directory: &Path) -> Result<Vec<PathBuf>, RemoveError> {
    let failed = |source| RemoveError::Io { path: directory.to_path_buf(), source };
    std::fs::read_dir(directory).map_err(failed)?.map(|entry| Ok(entry.map_err(failed)?.path())).collect()
}

fn is_ours(entry: &Path, prefix: &str) -> bool {
    let name = entry.file_name().unwrap_or_default();
    ROOT_ENTRIES.iter().any(|own| name == *own)
        || carries(entry, prefix)
        || entry.extension().is_some_and(|e| e == "lock")
}

/// iceoryx2 names: the prefix and a decimal id up to the first dot (root path), or the prefix, 40
/// hexadecimal digits and `_` (`/dev/shm`) or a dot (services). This strict because the prefix "a" must not match the
/// files of the prefix "a_b".
pub(crate) fn carries(entry: &Path, prefix: &str) -> bool {
    let name = entry.file_name().unwrap_or_default().as_bytes();
    let Some(rest) = name.strip_prefix(prefix.as_bytes()) else { return false };
    let digits = |all: &[u8], accepted: fn(&u8) -> bool| !all.is_empty() && all.iter().all(accepted);
    let id = rest.split(|&b| b == b'.').next().unwrap_or_default();
    let hash = rest.get(..40).unwrap_or_default();
    digits(id, u8::is_ascii_digit) || (digits(hash, u8::is_ascii_hexdigit) && matches!(rest.get(40), Some(b'_' | b'.')))
}

fn ignore_missing(path: &Path, result: io::Result<()>) -> Result<(), RemoveError> {
    match result {
        Err(source) if source.kind() != io::ErrorKind::NotFound => {
            Err(RemoveError::Io { path: path.to_path_buf(), source })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_this_prefix_are_ours() {
        let hash = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5";
        let ours = [format!("a_{hash}_12.data"), "a_316912994698988058820952986528.event".into()];
        let foreign = [format!("a_b_{hash}_12.data"), format!("a_ab{hash}_12.data"), "a_notes.txt".into(), "a_".into()];
        assert!(ours.iter().all(|name| carries(Path::new(name), "a_")));
        for name in foreign {
            assert!(!carries(Path::new(&name), "a_"), "{name}");
        }
    }
}
