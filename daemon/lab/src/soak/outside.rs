//! Attacks from outside during a touch that kill nothing: requests, clients, files, processes that
//! have no place. Nobody is to notice.

use std::ffi::{CString, OsStr};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use ipc_types::services::{self, Access};
use ipc_types::{Client, CommandSample, Node, Notifier, PendingResponse, PortError, Subscriber};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::injection::Touch;
use super::touch::second_is_refused;
use crate::hostile::configurations::validated;
use crate::hostile::everything::stranger;
use crate::hostile::mutate::Mutations;
use crate::hostile::requests::draw;
use admittancectl::session::Session;
use admittancectl::{Exit, Outcome};

/// What is asked, notified or signalled in one turn.
const PER_TURN: usize = 20;

/// The kinds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outside {
    /// `admittance-lab flood`.
    RequestFlood,
    /// Requests with anything in them.
    AnyRequests,
    /// Requests whose client no longer wants the answer.
    RequestsGivenUp,
    /// Clients until there is no room for another one.
    TooManyClients,
    /// Readers of commands until there is no room for another one.
    TooManyReaders,
    /// A second plant of the instance.
    SecondPlant,
    /// A second recorder, killed.
    SecondRecorder,
    /// The configuration file is a mutated one that is refused, and SIGHUP.
    ConfigurationMutated,
    /// The configuration file is a pipe, and SIGHUP.
    ConfigurationPipe,
    /// There is no configuration file, and SIGHUP.
    ConfigurationGone,
    /// The configuration file is too large, and SIGHUP.
    ConfigurationLarge,
    /// SIGHUP again and again.
    ReloadStorm,
    /// A file of another user in shared memory.
    StrangersFile,
    /// Shared memory that was being made by one who was killed, and a node that comes and goes.
    HalfMadeMemory,
    /// Notifications without samples.
    Notifications,
}

impl Outside {
    pub(crate) const ALL: [Self; 15] = [
        Self::RequestFlood,
        Self::AnyRequests,
        Self::RequestsGivenUp,
        Self::TooManyClients,
        Self::TooManyReaders,
        Self::SecondPlant,
        Self::SecondRecorder,
        Self::ConfigurationMutated,
        Self::ConfigurationPipe,
        Self::ConfigurationGone,
        Self::ConfigurationLarge,
        Self::ReloadStorm,
        Self::StrangersFile,
        Self::HalfMadeMemory,
        Self::Notifications,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::RequestFlood => "request_flood",
            Self::AnyRequests => "any_requests",
            Self::RequestsGivenUp => "requests_given_up",
            Self::TooManyClients => "too_many_clients",
            Self::TooManyReaders => "too_many_readers",
            Self::SecondPlant => "second_plant",
            Self::SecondRecorder => "second_recorder",
            Self::ConfigurationMutated => "configuration_mutated",
            Self::ConfigurationPipe => "configuration_pipe",
            Self::ConfigurationGone => "configuration_gone",
            Self::ConfigurationLarge => "configuration_large",
            Self::ReloadStorm => "reload_storm",
            Self::StrangersFile => "strangers_file",
            Self::HalfMadeMemory => "half_made_memory",
            Self::Notifications => "notifications",
        }
    }
}

/// An attack that is under way. The node goes last.
pub(crate) struct Held {
    kind: Outside,
    random: ChaCha8Rng,
    file: Option<PathBuf>,
    pending: Vec<PendingResponse>,
    clients: Vec<Client>,
    readers: Vec<Subscriber<CommandSample>>,
    notifier: Option<Notifier>,
    node: Node,
}

fn unavailable(error: impl std::fmt::Display) -> (Exit, String) {
    (Exit::Unavailable, error.to_string())
}

impl Held {
    pub(crate) fn begin(kind: Outside, touch: &Touch, config: &Path, session: &mut Session) -> Outcome<Self> {
        let node = session.settings().node("soak attack").map_err(unavailable)?;
        let random = ChaCha8Rng::seed_from_u64(touch.at_s.to_bits());
        let (pending, clients, readers) = (Vec::new(), Vec::new(), Vec::new());
        let mut held = Self { kind, random, file: None, pending, clients, readers, notifier: None, node };
        held.open(config, session)?;
        Ok(held)
    }

    fn open(&mut self, config: &Path, session: &mut Session) -> Outcome<()> {
        let failed = |error: std::io::Error| (Exit::Internal, format!("{}: {error}", config.display()));
        let instance = session.settings().instance.clone();
        let configured = [OsStr::new("--config"), config.as_os_str()];
        match self.kind {
            Outside::RequestFlood => {
                let flood = ["--rate-hz", "5000", "--seconds", "3600"].map(OsStr::new);
                session.start("attack", "flood", &[&configured[..], &flood].concat())?;
            }
            Outside::AnyRequests | Outside::RequestsGivenUp => self.clients.push(self.client(session)?),
            Outside::TooManyClients => loop {
                let service = services::request(&self.node, &instance, Access::Open).map_err(unavailable)?;
                match service.client() {
                    Ok(client) => self.clients.push(client),
                    Err(PortError::TooMany { .. }) => break,
                    Err(other) => return Err(unavailable(other)),
                }
            },
            Outside::TooManyReaders => loop {
                let service = services::command(&self.node, &instance, Access::Open).map_err(unavailable)?;
                match service.subscriber() {
                    Ok(reader) => self.readers.push(reader),
                    Err(PortError::TooMany { .. }) => break,
                    Err(other) => return Err(unavailable(other)),
                }
            },
            Outside::SecondPlant => {
                let scenario = config.with_file_name("scenario.toml");
                session.start("second", "role-plant", &[OsStr::new("--scenario"), scenario.as_os_str()])?;
            }
            Outside::SecondRecorder => {
                let file = config.with_file_name("second.mcap");
                let recorder = [file.as_os_str(), OsStr::new("--overwrite")];
                session.start("attack", "role-recorder", &[&recorder[..], &configured].concat())?;
                self.file = Some(file);
            }
            Outside::ConfigurationMutated => {
                let all = Mutations::of(&std::fs::read_to_string(config).map_err(failed)?);
                std::fs::write(config, all.draw(&mut self.random)).map_err(failed)?;
                while validated(config).is_ok() {
                    std::fs::write(config, all.draw(&mut self.random)).map_err(failed)?;
                }
                hang_up(session);
            }
            Outside::ConfigurationPipe => {
                std::fs::remove_file(config).map_err(failed)?;
                let path = CString::new(config.as_os_str().as_bytes()).map_err(unavailable)?;
                // SAFETY: mkfifo reads the path, which ends with zero.
                if unsafe { libc::mkfifo(path.as_ptr(), 0o600) } != 0 {
                    return Err(failed(std::io::Error::last_os_error()));
                }
                hang_up(session);
            }
            Outside::ConfigurationGone => {
                std::fs::remove_file(config).map_err(failed)?;
                hang_up(session);
            }
            Outside::ConfigurationLarge => {
                std::fs::write(config, "#".repeat(2 << 20)).map_err(failed)?;
                hang_up(session);
            }
            Outside::ReloadStorm => hang_up(session),
            Outside::StrangersFile => self.file = stranger(&session.settings().prefix).map_err(unavailable)?,
            Outside::HalfMadeMemory => {
                let name = format!("{}{}_1.dynamic", session.settings().prefix, "0123456789".repeat(4));
                let mut options = std::fs::OpenOptions::new();
                options.create_new(true).write(true).mode(0o200);
                options.open(Path::new("/dev/shm").join(name)).map_err(failed)?;
                drop(session.settings().node("soak guest").map_err(unavailable)?);
            }
            Outside::Notifications => {
                let service = services::state_arrival(&self.node, &instance, Access::Open).map_err(unavailable)?;
                self.notifier = Some(service.notifier().map_err(unavailable)?);
            }
        }
        Ok(())
    }

    fn client(&self, session: &Session) -> Outcome<Client> {
        let service = services::request(&self.node, &session.settings().instance, Access::Open).map_err(unavailable)?;
        service.client().map_err(unavailable)
    }

    /// Goes on with it. Whether it may end.
    pub(crate) fn go_on(&mut self, session: &mut Session) -> Outcome<bool> {
        for _ in 0..PER_TURN {
            match self.kind {
                Outside::AnyRequests | Outside::RequestsGivenUp => {
                    let is_wanted = self.kind == Outside::AnyRequests;
                    for client in &self.clients {
                        // With as many under way as a client may have there is none.
                        let sent = client.send_copy(draw(&mut self.random)).ok();
                        self.pending.extend(sent.filter(|_| is_wanted));
                    }
                    self.pending.retain(|pending| !matches!(pending.receive(), Ok(Some(_))));
                }
                Outside::ReloadStorm => hang_up(session),
                Outside::Notifications => {
                    if let Some(notifier) = &self.notifier {
                        // Nobody who listens is no failure.
                        let _ = notifier.notify();
                    }
                }
                _ => {}
            }
        }
        if self.kind == Outside::SecondPlant { second_is_refused(session) } else { Ok(true) }
    }

    /// Ends it.
    pub(crate) fn end(self, session: &mut Session) -> Outcome<()> {
        session.forget("attack");
        match &self.file {
            // A recorder that is killed early has not made it yet.
            Some(file) if file.exists() => std::fs::remove_file(file).map_err(unavailable),
            _ => Ok(()),
        }
    }
}

fn hang_up(session: &mut Session) {
    if let Some(child) = session.child("daemon") {
        // SAFETY: kill takes numbers; the child is not reaped, so that its id is still its own.
        unsafe { libc::kill(child.id().cast_signed(), libc::SIGHUP) };
    }
}
