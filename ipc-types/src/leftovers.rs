//! What programs that were killed leave behind. iceoryx2 clears up after a node that it finds dead;
//! what a program had only begun to make when it was killed it does not know of: a service that
//! hangs half made, for whoever opens it, and files that nobody removes.
//!
//! So every program of ours locks the root directory while it makes a node or a service. Whoever has
//! the lock knows that nobody of ours is making anything; of a foreign program that is, its node
//! tells. What hangs then was left by the dead, and where no node lives at all, everything was.

use std::fs::{File, Metadata};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::NodeState;
use iceoryx2::prelude::{CallbackProgression, MessagingPattern, ServiceName, ipc};
use iceoryx2::service::Service;
use iceoryx2::service::internal::ServiceInternal as _;
use iceoryx2::service::service_hash::ServiceHash;

use crate::errors::{Classify, Kind};
use crate::place::{effective_user, open_root};
use crate::removal::{SHARED_MEMORY, carries, shared_memory_files};
use crate::{IpcSettings, Node};

/// How often, and how long in between, a lock is tried for: its holder may have been stopped.
const TRIES: usize = 1000;
const BETWEEN: Duration = Duration::from_millis(2);
/// iceoryx2's mode of memory and nodes that are being made, and for how long a foreign node may be.
const BEING_MADE: u32 = 0o200;
const LONGEST: Duration = Duration::from_millis(500);
/// Its mode of the file of a service that is being written.
const BEING_WRITTEN: u32 = 0o600;

/// The root directory, locked: nobody else of ours makes or clears anything meanwhile.
pub(crate) struct Alone {
    _root: File,
}

/// Waits for whoever is making something, a moment at most: that one may have been stopped.
pub(crate) fn alone(root: File) -> Option<Alone> {
    alone_after(root, TRIES)
}

fn alone_after(root: File, tries: usize) -> Option<Alone> {
    for turn in 0..tries {
        if turn > 0 {
            std::thread::sleep(BETWEEN);
        }
        if root.try_lock().is_ok() {
            return Some(Alone { _root: root });
        }
    }
    None
}

/// Opens or creates a service by `make`. One that somebody had only begun to make, or to remove, when
/// he was killed is removed before.
pub(crate) fn make_service<T, E: Classify>(
    node: &Node,
    name: &ServiceName,
    pattern: MessagingPattern,
    make: impl Fn() -> Result<T, E>,
) -> Result<T, E> {
    let alone = open_root(&node.settings().root_path, false).ok().and_then(alone);
    remove_half_made_memory(&node.settings().prefix);
    let mend = |hangs: bool| alone.is_some() && remove_half_made(node, name, pattern, hangs);
    mend(false);
    let made = make();
    let hangs = made.as_ref().is_err_and(|error| error.kind() == Kind::Hanging);
    if hangs && mend(true) { make() } else { made }
}

/// Removes a service that is half made, or `hangs`, if no living node is at it. Whether it did.
fn remove_half_made(node: &Node, name: &ServiceName, pattern: MessagingPattern, hangs: bool) -> bool {
    let settings = node.settings();
    let hash = ServiceHash::new::<<ipc::Service as Service>::ServiceNameHasher>(name, pattern);
    let file = settings.root_path.join("services").join(format!("{}{hash}.service", settings.prefix));
    let Ok(found) = std::fs::symlink_metadata(&file) else { return false };
    let is_unwritten = found.mode() & 0o777 == BEING_WRITTEN;
    let lacks_memory = || {
        let details = ipc::Service::details(name, node.config(), pattern);
        details.is_ok_and(|details| details.is_some_and(|details| details.dynamic_details.is_none()))
    };
    if !(is_unwritten || hangs || lacks_memory()) || is_at_it(node, &hash) {
        return false;
    }
    if is_unwritten {
        return std::fs::remove_file(&file).is_ok();
    }
    // SAFETY: nobody uses a service that hangs, since nobody could open it; and nobody who lives is
    // making it.
    unsafe { ipc::Service::__internal_force_remove_service(name, node.config(), pattern) }.is_ok()
}

/// Whether a living node, but for this one, has or makes the service: it marks itself so before.
fn is_at_it(node: &Node, hash: &ServiceHash) -> bool {
    let tag = format!("{}{hash}.service_tag", node.settings().prefix);
    let mut is_at_it = false;
    let listed = iceoryx2::node::Node::<ipc::Service>::list(node.config(), |other| {
        let id = other.node_id();
        let directory = node.settings().root_path.join("nodes").join(id.value().to_string());
        is_at_it |= id != node.id() && !matches!(other, NodeState::Dead(_)) && directory.join(&tag).exists();
        CallbackProgression::Continue
    });
    is_at_it || listed.is_err()
}

/// Removes everything that is left of a place where no node lives, unless somebody makes something
/// there: when a node has gone. An orderly end leaves nothing behind.
pub(crate) fn clear_if_deserted(settings: &IpcSettings, config: &Config) {
    let root = open_root(&settings.root_path, false).ok();
    let Some(_alone) = root.and_then(|root| alone_after(root, 1)) else { return };
    clear_deserted(settings, config);
}

/// The same for who is alone already. Whether no node lives there.
pub(crate) fn clear_deserted(settings: &IpcSettings, config: &Config) -> bool {
    clear_if(settings, || is_deserted(settings, config))
}

fn clear_if(settings: &IpcSettings, is_deserted: impl FnOnce() -> bool) -> bool {
    // Listed before the place is judged: what a foreign program makes from then on was not left by the dead.
    let (files, directories) = (left(settings), node_directories(settings));
    let is_deserted = is_deserted();
    if is_deserted {
        // What cannot be removed is met again, and named, by who is in need of it.
        files.iter().filter(|path| is_own(path)).for_each(|path| drop(std::fs::remove_file(path)));
        directories.iter().for_each(|path| drop(std::fs::remove_dir(path)));
    }
    is_deserted
}

/// Whether this user made it: a stranger's file is never removed, but named by who meets it, even by
/// root, who could.
fn is_own(path: &Path) -> bool {
    std::fs::symlink_metadata(path).is_ok_and(|found| found.uid() == effective_user())
}

fn is_deserted(settings: &IpcSettings, config: &Config) -> bool {
    let is_being_made = |found: &Metadata| {
        let age = found.modified().ok().and_then(|time| time.elapsed().ok());
        found.mode() & 0o777 == BEING_MADE && age.is_none_or(|age| age < LONGEST)
    };
    let mut nodes = list(&settings.root_path.join("nodes")).into_iter();
    if nodes.any(|path| std::fs::symlink_metadata(path).is_ok_and(|found| is_being_made(&found))) {
        return false;
    }
    let mut lives = false;
    let listed = iceoryx2::node::Node::<ipc::Service>::list(config, |node| {
        lives |= matches!(node, NodeState::Alive(_) | NodeState::Inaccessible(_));
        if lives { CallbackProgression::Stop } else { CallbackProgression::Continue }
    });
    !lives && listed.is_ok() && !is_mapped(&settings.prefix)
}

/// Removes shared memory that was being made by one who was killed: iceoryx2 waits for it for ever, when
/// it clears up after a dead node. Who makes it has it open.
pub(crate) fn remove_half_made_memory(prefix: &str) {
    let files = shared_memory_files(prefix).unwrap_or_default();
    let is_half_made = |path: &PathBuf| {
        let is_being_made = |found: Metadata| found.mode() & 0o777 == BEING_MADE;
        is_own(path) && std::fs::symlink_metadata(path).is_ok_and(is_being_made) && !is_open(path)
    };
    // What cannot be removed is met again, and named.
    files.iter().filter(|path| is_half_made(path)).for_each(|path| drop(std::fs::remove_file(path)));
}

/// Whether a process has this file open, or in its memory.
fn is_open(path: &Path) -> bool {
    let name = path.as_os_str().as_bytes();
    list(Path::new("/proc")).iter().any(|process| {
        let links = list(&process.join("fd"));
        links.iter().any(|link| std::fs::read_link(link).is_ok_and(|file| file == path)) || maps(process, name)
    })
}

/// Whether a process has a file in memory whose path begins like this.
fn maps(process: &Path, path: &[u8]) -> bool {
    std::fs::read(process.join("maps")).is_ok_and(|maps| maps.windows(path.len()).any(|part| part == path))
}

/// Whether somebody has shared memory of this prefix: a node of another root path may.
fn is_mapped(prefix: &str) -> bool {
    let files = format!("{SHARED_MEMORY}/{prefix}");
    // Of other users nobody may map it.
    list(Path::new("/proc")).iter().any(|process| maps(process, files.as_bytes()))
}

/// Every file of this prefix.
fn left(settings: &IpcSettings) -> Vec<PathBuf> {
    let (root, prefix) = (&settings.root_path, settings.prefix.as_str());
    let mut left = shared_memory_files(prefix).unwrap_or_default();
    for directory in [root.clone(), root.join("nodes"), root.join("services")] {
        left.extend(list(&directory).into_iter().filter(|path| carries(path, prefix)));
    }
    for directory in node_directories(settings) {
        let is_ours =
            |path: &PathBuf| path.file_name().is_some_and(|name| name.as_bytes().starts_with(prefix.as_bytes()));
        left.extend(list(&directory).into_iter().filter(is_ours));
    }
    left
}

/// Directories of nodes, which have no prefix: their files have.
fn node_directories(settings: &IpcSettings) -> Vec<PathBuf> {
    let is_node = |path: &PathBuf| {
        path.file_name().is_some_and(|name| name.as_bytes().iter().all(u8::is_ascii_digit)) && path.is_dir()
    };
    list(&settings.root_path.join("nodes")).into_iter().filter(is_node).collect()
}

fn list(directory: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(directory).into_iter().flatten().flatten().map(|entry| entry.path()).collect()
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::DirBuilderExt as _;

    use iceoryx2::prelude::{NodeBuilder, SignalHandlingMode};

    use super::*;
    use crate::Instance;

    /// A tunnel did not start while somebody looked for what it carries: the place was found deserted, and what the tunnel made
    /// from then on was removed.
    #[test]
    fn what_a_foreign_program_makes_meanwhile_stays() {
        let prefix = format!("left{}_", std::process::id());
        let directory = PathBuf::from(format!("/tmp/{prefix}"));
        std::fs::DirBuilder::new().mode(0o700).create(&directory).expect("/tmp can be written");
        let instance = Instance::new("r1").expect("a name");
        let settings = IpcSettings { root_path: directory.join("ipc"), prefix, instance };
        drop(settings.node("before").expect("a node"));
        let config = settings.config().expect("a sound place");
        let foreign = NodeBuilder::new().config(&config).signal_handling_mode(SignalHandlingMode::Disabled);
        let mut made = None;
        let cleared = clear_if(&settings, || {
            made = Some(foreign.create::<ipc::Service>().expect("nobody else is there"));
            true
        });
        let files = left(&settings);
        assert!(cleared && files.iter().any(|file| file.starts_with(SHARED_MEMORY)), "{files:?}");
        assert!(!node_directories(&settings).is_empty() && !is_deserted(&settings, &config), "{files:?}");
        drop(made);
        crate::remove_all(&settings).expect("all of it can be removed");
        std::fs::remove_dir(&directory).expect("nothing is left in it");
    }
}
