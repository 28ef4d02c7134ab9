//! How the faults of the matrix are brought about.

use std::fmt;

use plant_sim::faults::FaultKind;

use super::row::{Key, Who};

/// How a fault is brought about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Injection {
    /// plant-sim spoils its samples, for [`super::SCRIPTED_S`].
    Scripted(FaultKind),
    /// A signal that kills or stops the process.
    Signal(Who, Signal),
    /// The daemon is ended in order and started anew.
    Restart,
    /// Another program is started.
    Start(Newcomer),
    /// `ipc.root_path` is removed with all that is in it.
    RemoveRoot,
    /// `admittancectl record` into a place that does not take it.
    Record(Disk),
    /// `admittancectl replay` of a recording of which one bit has flipped.
    ReplayDamaged,
    /// The daemon's file is replaced by this text, and the daemon told to read it again.
    ReloadText(&'static str),
    /// The same with keys changed.
    ReloadKeys(&'static [Key]),
    /// A request that the daemon carries out: words after `admittancectl`.
    Request(&'static [&'static str]),
    /// It is there from the start: in the keys of the row.
    FromStart,
}

/// A signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// SIGKILL.
    Kill,
    /// SIGSTOP, and SIGCONT where the recovery says so.
    Stop,
}

/// What is started beside the running pair: mostly a daemon that cannot start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Newcomer {
    /// For the instance that the running one serves.
    SameInstance,
    /// For an instance whose state service a foreign process has created, with samples of another
    /// size.
    ForeignSize,
    /// The same with another schema version.
    ForeignVersion,
    /// For another instance, where /dev/shm has too little room.
    FullSharedMemory,
    /// For another instance, with too few file descriptors.
    FewDescriptors,
    /// No daemon: `admittance-lab flood`.
    Flood,
}

/// A place for a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Disk {
    /// The directory does not exist.
    Missing,
    /// A file system that is soon full.
    Full,
}

impl Injection {
    /// Whether it needs mounts of its own.
    pub fn needs_root(self) -> bool {
        matches!(self, Self::Start(Newcomer::FullSharedMemory) | Self::Record(Disk::Full))
    }
}

impl fmt::Display for Injection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scripted(kind) => {
                write!(f, "plant-sim's fault `{kind}` for {} s", super::SCRIPTED_S)
            }
            Self::Signal(who, Signal::Kill) => write!(f, "SIGKILL to {who}"),
            Self::Signal(who, Signal::Stop) => write!(f, "SIGSTOP to {who}"),
            Self::Restart => f.write_str("SIGTERM to the daemon; once it has ended, another one is started"),
            Self::Start(Newcomer::SameInstance) => f.write_str("a second `admittanced` with the same configuration"),
            Self::Start(Newcomer::ForeignSize) => f.write_str(
                "a process creates the state service of another instance with samples of 400 bytes; then `admittanced` \
                 is started for that instance, beside the running one",
            ),
            Self::Start(Newcomer::ForeignVersion) => f.write_str(
                "a process creates the state service of another instance with `admittanced.StateSample.v1`; then \
                 `admittanced` is started for that instance, beside the running one",
            ),
            Self::Start(Newcomer::FullSharedMemory) => f.write_str(
                "`admittanced` is started for another instance in a mount namespace whose /dev/shm has 16 MiB, beside the \
                 running one",
            ),
            Self::Start(Newcomer::FewDescriptors) => f.write_str(
                "`admittanced` is started for another instance with 16 file descriptors (`ulimit -n 16`), beside the running one",
            ),
            Self::Start(Newcomer::Flood) => f.write_str("`admittance-lab flood` for half a second"),
            Self::RemoveRoot => f.write_str("`rm -r` of `ipc.root_path`"),
            Self::Record(Disk::Missing) => f.write_str("`admittancectl record` into a directory that does not exist"),
            Self::Record(Disk::Full) => f.write_str("`admittancectl record` onto a file system of 64 KiB"),
            Self::ReplayDamaged => {
                f.write_str("one bit of the messages in a recording is flipped; then `admittancectl replay` of it")
            }
            Self::ReloadText(text) => {
                write!(f, "the configuration is replaced by `{}`; SIGHUP to the daemon", text.replace('\n', " ⏎ "))
            }
            Self::ReloadKeys(keys) => write!(f, "{}; SIGHUP to the daemon", keys_sentence(keys)),
            Self::Request(words) => write!(f, "`admittancectl {}`", words.join(" ")),
            Self::FromStart => f.write_str("from the start"),
        }
    }
}

/// `a = 1`, `b = 2`.
pub(super) fn keys_sentence(keys: &[Key]) -> String {
    keys.iter().map(|(key, value)| format!("`{key} = {value}`")).collect::<Vec<_>>().join(", ")
}
