//! The file that a recording goes into.

use std::fs::File;
use std::io;
use std::path::Path;

use mcap::McapError;

use crate::{Exit, Outcome};

/// Creates it.
///
/// # Errors
/// 73, with what to do where that is known.
pub(crate) fn create(path: &Path, overwrite: bool) -> Outcome<File> {
    let file = if overwrite { File::create(path) } else { File::create_new(path) };
    file.map_err(|error| {
        let hint = match error.kind() {
            io::ErrorKind::AlreadyExists => ": choose another name, or give --overwrite",
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                ": choose a place that this user may write to, as the service's user may to /var/lib/admittanced"
            }
            _ => "",
        };
        (Exit::CantCreate, format!("{}: {error}{hint}", path.display()))
    })
}

/// Why writing failed, without what the library adds.
pub(crate) fn cause(error: McapError) -> String {
    match error {
        McapError::Io(cause) => cause.to_string(),
        other => other.to_string(),
    }
}
