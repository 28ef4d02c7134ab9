//! One daemon per instance: an flock on ROOT/INSTANCE.lock, which holds the owner's process id.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};

use admittance_host::exit::ExitCode;
use ipc_types::IpcSettings;

/// Holds the lock until dropped; the file stays, since removing a locked file would let two daemons
/// in.
#[derive(Debug)]
pub(crate) struct InstanceLock {
    _file: File,
}

/// Takes the lock.
pub(crate) fn take(settings: &IpcSettings) -> Result<InstanceLock, (ExitCode, String)> {
    let path = settings.root_path.join(format!("{}.lock", settings.instance));
    let refused = |error: std::io::Error| {
        let code = match error.kind() {
            std::io::ErrorKind::PermissionDenied => ExitCode::NoPermission,
            _ => ExitCode::Unavailable,
        };
        (code, format!("the lock {} cannot be taken: {error}; is ipc.root_path writable?", path.display()))
    };
    std::fs::create_dir_all(&settings.root_path).map_err(refused)?;
    let mut file =
        OpenOptions::new().create(true).truncate(false).read(true).write(true).open(&path).map_err(refused)?;
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
