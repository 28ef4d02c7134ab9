//! One daemon per instance: an flock on ROOT/INSTANCE.lock, which holds the owner's process id.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, Write};

use admittance_host::exit::ExitCode;
use ipc_types::{IpcSettings, PlaceError};

/// Holds the lock until dropped; the file stays, since removing a locked file would let two daemons
/// in.
#[derive(Debug)]
pub(crate) struct InstanceLock {
    _file: File,
}

fn place_refused(error: &PlaceError) -> (ExitCode, String) {
    (ExitCode::of_refusal(error.is_permission()), format!("the lock of the instance cannot be taken: {error}"))
}

/// Takes the lock.
pub(crate) fn take(settings: &IpcSettings) -> Result<InstanceLock, (ExitCode, String)> {
    let name = format!("{}.lock", settings.instance);
    let path = settings.root_path.join(&name);
    let refused = |source: std::io::Error| place_refused(&PlaceError::Io { path: path.clone(), source });
    let mut file = ipc_types::open_file(&settings.root_path, &name).map_err(|error| place_refused(&error))?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let mut owner = String::new();
            // An owner between taking the lock and writing its id leaves the file empty: say what
            // is known.
            let _ = file.read_to_string(&mut owner);
            let owner = if owner.trim().is_empty() {
                "another process".to_owned()
            } else {
                format!("process {}", owner.trim())
            };
            return Err((
                ExitCode::Unavailable,
                format!(
                    "instance {} is held by {owner} (lock {}): stop that admittanced first, or give another --instance",
                    settings.instance,
                    path.display()
                ),
            ));
        }
        Err(TryLockError::Error(error)) => return Err(refused(error)),
    }
    file.set_len(0)
        .and_then(|()| file.rewind())
        .and_then(|()| writeln!(file, "{}", std::process::id()))
        .map_err(refused)?;
    Ok(InstanceLock { _file: file })
}
