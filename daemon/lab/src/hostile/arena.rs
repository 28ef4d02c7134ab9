//! Where attacks take place: a daemon as a process of its own, in a place of its own, and what must
//! hold of it however it is attacked.

use std::collections::HashMap;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use admittance_runner::config::Config;
use ipc_types::services::{self, Access};
use ipc_types::{Client, Node, RequestKind, RequestSample, ResponseSample};

use super::Counts;
use super::feeds::Feeds;
use admittancectl::demo::SCENARIO;
use admittancectl::session::Session;
use admittancectl::{Exit, Outcome, request};

/// How long anything may take that has to happen, on a machine that is busy with other things.
pub(crate) const PATIENCE: Duration = Duration::from_secs(30);
/// Between two looks at something that is awaited.
pub(crate) const POLL: Duration = Duration::from_millis(2);
/// How long after the last end somebody else comes.
const NEXT_ONE: Duration = Duration::from_secs(1);
/// Tolerance for the kernel's accounting of memory, KiB.
const SLACK_KIB: u64 = 2048;
/// Descriptors that may come and go.
const SLACK_DESCRIPTORS: usize = 4;
/// Findings that are kept of one case: more of the same say nothing more.
const MOST: usize = 8;
/// Lines that are kept of one: of a broken file there may be a hundred errors.
const MOST_LINES: usize = 20;

/// What was found in one case.
#[derive(Debug, Default)]
pub(crate) struct Findings(pub(crate) Vec<String>);

impl Findings {
    pub(crate) fn note(&mut self, what: impl Into<String>) {
        if self.0.len() < MOST {
            let what: String = what.into();
            let lines: Vec<&str> = what.lines().take(MOST_LINES).collect();
            self.0.push(lines.join("\n"));
        }
    }

    /// Notes what failed.
    pub(crate) fn take<T>(&mut self, result: Result<T, String>) -> Option<T> {
        result.map_err(|why| self.note(why)).ok()
    }
}

/// What a process holds of the machine.
#[derive(Debug, Clone, Copy)]
struct Holdings {
    resident_kib: u64,
    descriptors: usize,
}

/// A daemon under attack.
pub(crate) struct Arena {
    pub(crate) session: Session,
    pub(crate) feeds: Feeds,
    pub(crate) config_path: PathBuf,
    /// The program to attack; without one, this program's own daemon.
    program: Option<PathBuf>,
    /// What each program held when it was looked at first.
    holdings: HashMap<&'static str, Holdings>,
}

/// Attacks a daemon that was started with this configuration; what cannot be done is a finding.
pub(super) fn in_arena(
    configuration: &str,
    daemon: Option<&Path>,
    findings: &mut Findings,
    attack: impl FnOnce(&mut Arena, &mut Findings) -> Result<Counts, String>,
) -> Outcome<Counts> {
    let mut arena = Arena::new(configuration, daemon)?;
    let counts = attack(&mut arena, findings);
    if let Err(why) = &counts {
        findings.note(why.clone());
    }
    arena.end(findings);
    Ok(counts.unwrap_or_default())
}

impl Arena {
    /// A daemon with this configuration, which serves: `program`, or this program's own.
    pub(crate) fn new(config: &str, program: Option<&Path>) -> Outcome<Self> {
        let scenario = admittance_host::config::parse(SCENARIO, "paper.toml");
        let session = Session::new(&scenario.map_err(|error| (Exit::Internal, error.to_string()))?)?;
        let config_path = session.write("daemon.toml", config)?;
        let feeds = Feeds::listen(&config_path.with_file_name("notify")).map_err(|why| (Exit::Unavailable, why))?;
        let program = program.map(Path::to_owned);
        let mut arena = Self { session, feeds, config_path, program, holdings: HashMap::new() };
        arena.start_daemon()?;
        arena.await_service().map_err(|why| (Exit::Unavailable, why))?;
        Ok(arena)
    }

    /// Starts the daemon, which another one must not hold up.
    pub(crate) fn start_daemon(&mut self) -> Outcome<()> {
        self.holdings.remove("daemon");
        let environment = self.feeds.environment();
        self.start_another("daemon", &[], &environment)
    }

    /// Starts a daemon under another name, with the same file.
    pub(crate) fn start_another(
        &mut self,
        name: &'static str,
        more: &[&OsStr],
        environment: &[(&str, OsString)],
    ) -> Outcome<()> {
        let arguments = [&[OsStr::new("--config"), self.config_path.as_os_str()], more].concat();
        match &self.program {
            Some(program) => self.session.start_program(name, program, &arguments, environment),
            None => self.session.start_with(name, "role-daemon", &arguments, environment),
        }
    }

    /// SIGKILL; a case that looks at its log has to do so before.
    pub(crate) fn kill(&mut self, name: &str) {
        if name == "daemon" {
            self.feeds.forget();
        }
        self.session.forget(name);
    }

    pub(crate) fn signal(&mut self, name: &str, signal: i32) {
        if let Some(child) = self.session.child(name) {
            // SAFETY: kill takes numbers; the child is not reaped, so that its id is still its own.
            unsafe { libc::kill(child.id() as libc::pid_t, signal) };
        }
    }

    /// A node of the case's own.
    pub(crate) fn node(&self, name: &str) -> Outcome<Node> {
        self.session.settings().node(name).map_err(|error| (Exit::Unavailable, error.to_string()))
    }

    /// A client of the daemon's.
    pub(crate) fn client(&self, node: &Node) -> Result<Client, String> {
        let service = services::request(node, &self.session.settings().instance, Access::Open);
        service.map_err(|error| error.to_string())?.client().map_err(|error| error.to_string())
    }

    /// Asks, and waits for the answer.
    pub(crate) fn ask(&self, node: &Node, request: RequestSample) -> Result<ResponseSample, String> {
        request::ask(node, self.session.settings(), request).map_err(|(_, why)| why)
    }

    /// Waits until the daemon answers requests.
    pub(crate) fn await_service(&mut self) -> Result<(), String> {
        let node = self.node("hostile").map_err(|(_, why)| why)?;
        let give_up = Instant::now() + PATIENCE;
        loop {
            // Where nobody serves there is nothing to wait for.
            let is_open = services::request(&node, &self.session.settings().instance, Access::Open).is_ok();
            let answer = if is_open {
                self.ask(&node, request::request(RequestKind::Status)).map(drop)
            } else {
                Err("there is no service".to_owned())
            };
            let Err(why) = answer else { return Ok(()) };
            self.is_alive()?;
            if Instant::now() > give_up {
                return Err(format!("the daemon serves nobody: {why}"));
            }
            std::thread::sleep(POLL);
        }
    }

    /// Why the daemon does not run as it should.
    pub(crate) fn is_alive(&mut self) -> Result<(), String> {
        self.is_running("daemon")
    }

    /// Whether a program still runs, and has not panicked; else why.
    pub(crate) fn is_running(&mut self, name: &str) -> Result<(), String> {
        if let Some(status) = self.session.exit_status(name) {
            return Err(self.session.failure(name, status).1);
        }
        let log = self.session.log(name);
        match log.lines().find(|line| line.contains("panicked") || line.contains("the real-time thread failed")) {
            Some(line) => Err(format!("the {name}: {line}")),
            None => Ok(()),
        }
    }

    /// Looks whether the daemon holds more than when it was looked at first.
    pub(crate) fn look_at_holdings(&mut self, findings: &mut Findings) {
        self.look_at_holdings_of("daemon", findings);
    }

    /// The same for any program: how much memory it holds, KiB.
    pub(crate) fn look_at_holdings_of(&mut self, name: &'static str, findings: &mut Findings) -> Option<u64> {
        let now = self.session.child(name).and_then(|child| holdings(child.id()))?;
        let first = *self.holdings.entry(name).or_insert(now);
        if now.resident_kib > first.resident_kib + SLACK_KIB {
            findings.note(format!("memory of the {name}: {} KiB, {} KiB before", now.resident_kib, first.resident_kib));
        }
        if now.descriptors > first.descriptors + SLACK_DESCRIPTORS {
            findings.note(format!("descriptors of the {name}: {}, {} before", now.descriptors, first.descriptors));
        }
        Some(now.resident_kib)
    }

    /// Ends everything in order. What is left then, and what came too late meanwhile, is noted. All
    /// ports of the case have to be dropped before.
    pub(crate) fn end(mut self, findings: &mut Findings) {
        findings.take(self.is_alive());
        // A flood has no end of its own.
        self.kill("flood");
        for name in ["recorder", "plant", "edge", "daemon"] {
            findings.take(self.session.end(name).map_err(|(_, why)| why));
        }
        self.feeds.end().into_iter().for_each(|why| findings.note(why));
        let left = || ipc_types::shared_memory_files(&self.session.settings().prefix);
        // What was killed while it made a node is not known to be dead at once: the next one who comes
        // clears it up.
        if left().is_ok_and(|files| !files.is_empty()) {
            std::thread::sleep(NEXT_ONE);
            findings.take(self.node("hostile").map(drop).map_err(|(_, why)| why));
        }
        match left() {
            Ok(files) if files.is_empty() => {}
            Ok(files) => findings.note(format!("left in shared memory: {} files, {:?} first", files.len(), files[0])),
            Err(error) => findings.note(error.to_string()),
        }
    }
}

/// A text as a checked configuration.
pub(crate) fn parsed(text: &str) -> Outcome<Config> {
    admittance_host::config::parse(text, "daemon.toml").map_err(|error| (Exit::Internal, error.to_string()))
}

fn holdings(process: u32) -> Option<Holdings> {
    let directory = Path::new("/proc").join(process.to_string());
    let status = std::fs::read_to_string(directory.join("status")).ok()?;
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.split_whitespace().next()?.parse().ok());
    let descriptors = std::fs::read_dir(directory.join("fd")).ok()?.count();
    Some(Holdings { resident_kib: resident?, descriptors })
}
