//! The directory where processes meet, and whose it is. Who can write there, or above it, can lead
//! a program that runs as root to any file: so nothing in it is used before that is ruled out.

use std::fs::{DirBuilder, File, Metadata, OpenOptions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// What `ipc.root_path` may be instead of a path: [`users_root_path`].
pub const USERS_ROOT_PATH: &str = "user";

const GROUP_OR_OTHERS_WRITE: u32 = 0o022;
const STICKY: u32 = 0o1000;

/// Why a place is not used. Every message names path and owner, and what is accepted.
#[derive(Debug, thiserror::Error)]
pub enum PlaceError {
    /// Nobody has made it yet.
    #[error("{} (ipc.root_path) is not there: is admittanced running, with this root path?", path.display())]
    Absent {
        /// The root path.
        path: PathBuf,
    },
    /// Something that belongs to somebody else.
    #[error(
        "{} belongs to {}, and this program runs as {}: {remedy}",
        path.display(), user_name(*owner), user_name(effective_user()), remedy = remedy.replace("USER", &user_name(*owner))
    )]
    Owner {
        /// The file or directory.
        path: PathBuf,
        /// Its user id.
        owner: u32,
        /// What helps.
        remedy: &'static str,
    },
    /// Others may write it.
    #[error(
        "{} can be written by others than {} (mode {mode:04o}): accepted is a directory or file that its owner alone \
         can write (chmod go-w)",
        path.display(), user_name(effective_user())
    )]
    Writable {
        /// The file or directory.
        path: PathBuf,
        /// Its permissions.
        mode: u32,
    },
    /// Its name could be taken by anyone.
    #[error(
        "{} (ipc.root_path) is directly in {}, where everyone may take its name: accepted is a directory below one \
         that {} alone can write, such as /run/admittanced, or root_path = \"{USERS_ROOT_PATH}\"",
        path.display(), directory.display(), user_name(effective_user())
    )]
    Public {
        /// The root path.
        path: PathBuf,
        /// The directory that is open to all.
        directory: PathBuf,
    },
    /// Not the kind of file that it has to be.
    #[error("{} is not {accepted}: remove it", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// What is accepted.
        accepted: &'static str,
    },
    /// The system refused.
    #[error("{} cannot be used: {source}; is ipc.root_path writable?", path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

impl PlaceError {
    /// Whether another user, or other rights, are what is missing.
    pub fn is_permission(&self) -> bool {
        match self {
            Self::Owner { .. } | Self::Writable { .. } | Self::Public { .. } => true,
            Self::Io { source, .. } => source.kind() == ErrorKind::PermissionDenied,
            Self::Absent { .. } | Self::Kind { .. } => false,
        }
    }
}

/// The user whom this process acts as.
pub fn effective_user() -> u32 {
    // SAFETY: geteuid takes nothing, cannot fail and touches no memory.
    unsafe { libc::geteuid() }
}

/// "root", or "user 65534" for one without a name here.
pub fn user_name(id: u32) -> String {
    let users = std::fs::read_to_string("/etc/passwd").unwrap_or_default();
    let named = users.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(id)).then(|| name.to_owned())
    });
    named.unwrap_or_else(|| format!("user {id}"))
}

/// The root path for rehearsals by hand, in a directory that whoever runs this program alone can
/// write: /run/admittanced-root for root, /run/user/ID/admittanced for others, and below
/// ~/.cache where there is no such directory. The environment counts as little as possible, so that
/// two terminals agree.
pub fn users_root_path() -> PathBuf {
    let user = effective_user();
    if user == 0 {
        return PathBuf::from("/run/admittanced-root");
    }
    let runtime = PathBuf::from(format!("/run/user/{user}"));
    let is_own = std::fs::symlink_metadata(&runtime).is_ok_and(|found| found.is_dir() && found.uid() == user);
    if is_own {
        return runtime.join("admittanced");
    }
    PathBuf::from(std::env::var_os("HOME").unwrap_or_default()).join(".cache/admittanced")
}

/// Opens the root directory after a look at whose it is; makes it, with mode 0750, where it is not
/// there and `make` says so.
///
/// # Errors
/// [`PlaceError`].
pub fn open_root(root_path: &Path, make: bool) -> Result<File, PlaceError> {
    check_above(root_path)?;
    let failed = |source| PlaceError::Io { path: root_path.to_owned(), source };
    if make {
        DirBuilder::new().recursive(true).mode(0o750).create(root_path).map_err(failed)?;
    }
    let mut options = OpenOptions::new();
    options.read(true).custom_flags(libc::O_DIRECTORY | libc::O_NOFOLLOW | libc::O_NONBLOCK);
    let directory = options.open(root_path).map_err(|source| match source.kind() {
        ErrorKind::NotFound => PlaceError::Absent { path: root_path.to_owned() },
        // A link too: O_NOFOLLOW.
        ErrorKind::NotADirectory => PlaceError::Kind { path: root_path.to_owned(), accepted: "a directory" },
        // A directory that may not even be listed says most by its owner.
        ErrorKind::PermissionDenied => match std::fs::symlink_metadata(root_path) {
            Ok(found) => own(root_path, &found, ROOT_REMEDY).err().unwrap_or_else(|| failed(source)),
            Err(_) => failed(source),
        },
        _ => failed(source),
    })?;
    own(root_path, &directory.metadata().map_err(failed)?, ROOT_REMEDY)?;
    Ok(directory)
}

const ROOT_REMEDY: &str = "run it as that user (runuser -u USER), or give another ipc.root_path";

/// Opens a file in the root directory to read and write, made where it is not there: a plain file
/// that nobody else can write, under no other name. A link is not followed.
///
/// # Errors
/// [`PlaceError`].
pub fn open_file(root_path: &Path, name: &str) -> Result<File, PlaceError> {
    open_root(root_path, true)?;
    let path = root_path.join(name);
    let failed = |source: io::Error| PlaceError::Io { path: path.clone(), source };
    let accepted = "a plain file with one name";
    let mut options = OpenOptions::new();
    options.create(true).truncate(false).read(true).write(true).mode(0o640);
    // A pipe must not hold the program up.
    options.custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK);
    let file = options.open(&path).map_err(|source| match source.raw_os_error() {
        Some(libc::ELOOP) => PlaceError::Kind { path: path.clone(), accepted },
        _ => failed(source),
    })?;
    let found = file.metadata().map_err(failed)?;
    own(&path, &found, "remove it")?;
    if !found.is_file() || found.nlink() != 1 {
        return Err(PlaceError::Kind { path, accepted });
    }
    Ok(file)
}

/// That it is this user's, and that nobody else may write it.
fn own(path: &Path, found: &Metadata, remedy: &'static str) -> Result<(), PlaceError> {
    if found.uid() != effective_user() {
        return Err(PlaceError::Owner { path: path.to_owned(), owner: found.uid(), remedy });
    }
    let mode = found.mode() & 0o7777;
    if mode & GROUP_OR_OTHERS_WRITE != 0 {
        return Err(PlaceError::Writable { path: path.to_owned(), mode });
    }
    Ok(())
}

/// That nobody but root and this user can exchange what is above the root path: as it is written,
/// and where links lead.
fn check_above(root_path: &Path) -> Result<(), PlaceError> {
    check_components(root_path)?;
    let Some((parent, name)) = root_path.parent().zip(root_path.file_name()) else { return Ok(()) };
    match parent.canonicalize() {
        Ok(real) if real != parent => check_components(&real.join(name)),
        // What is not there yet is made by this user.
        _ => Ok(()),
    }
}

fn check_components(root_path: &Path) -> Result<(), PlaceError> {
    let user = effective_user();
    let above: Vec<&Path> = root_path.ancestors().skip(1).collect();
    let mut open_to_all: Option<&Path> = None;
    for directory in above.into_iter().rev() {
        let found = match std::fs::symlink_metadata(directory) {
            Ok(found) => found,
            // It will be made below the one before.
            Err(error) if error.kind() == ErrorKind::NotFound => break,
            Err(source) => return Err(PlaceError::Io { path: directory.to_owned(), source }),
        };
        if ![0, user].contains(&found.uid()) {
            return Err(PlaceError::Owner { path: directory.to_owned(), owner: found.uid(), remedy: ROOT_REMEDY });
        }
        if !found.is_dir() && !found.is_symlink() {
            return Err(PlaceError::Kind { path: directory.to_owned(), accepted: "a directory" });
        }
        let mode = found.mode() & 0o7777;
        // Whose a link is decides where it leads; its permissions say nothing.
        open_to_all = None;
        if !found.is_symlink() && mode & GROUP_OR_OTHERS_WRITE != 0 {
            if mode & STICKY == 0 {
                return Err(PlaceError::Writable { path: directory.to_owned(), mode });
            }
            // The next one down cannot be exchanged if it is there and not somebody else's.
            open_to_all = Some(directory);
        }
    }
    match open_to_all {
        Some(directory) => Err(PlaceError::Public { path: root_path.to_owned(), directory: directory.to_owned() }),
        None => Ok(()),
    }
}
