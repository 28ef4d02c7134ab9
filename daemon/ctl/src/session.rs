//! Daemon and plant as child processes, with a root directory and a prefix of their own. Whatever
//! happens, they leave nothing behind.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use admittance_host::realtime::die_with_parent;
use ipc_types::services::{self, Access};
use ipc_types::{IpcSettings, Node, Subscriber, TruthSample};
use plant_sim::scenario::Scenario;
use tempfile::TempDir;

use crate::Exit;

/// How long the processes may take to open their services, and to end.
const PATIENCE: Duration = Duration::from_secs(10);

/// Processes in a place of their own.
pub struct Session {
    directory: TempDir,
    settings: IpcSettings,
    children: Vec<(&'static str, Child)>,
}

impl Session {
    /// A place of their own for the processes of this scenario.
    pub fn new(scenario: &Scenario) -> Result<Self, (Exit, String)> {
        let unavailable = |error: std::io::Error| (Exit::Unavailable, format!("no private directory in /tmp: {error}"));
        // Sockets are limited to 108 bytes: a short path, whatever TMPDIR says.
        let directory = tempfile::Builder::new().prefix("adm").tempdir_in("/tmp").map_err(unavailable)?;
        let prefix = format!("adm{:x}_", std::process::id());
        let settings = scenario
            .ipc
            .settings(None, Some(directory.path().join("ipc")), Some(prefix))
            .map_err(|why| (Exit::Internal, why))?;
        Ok(Self { directory, settings, children: Vec::new() })
    }

    /// Where the processes meet.
    pub fn settings(&self) -> &IpcSettings {
        &self.settings
    }

    /// Writes a file that goes with the session.
    pub fn write(&self, name: &str, text: &str) -> Result<PathBuf, (Exit, String)> {
        let path = self.directory.path().join(name);
        std::fs::write(&path, text).map_err(|error| (Exit::Unavailable, format!("{}: {error}", path.display())))?;
        Ok(path)
    }

    fn log_path(&self, name: &str) -> PathBuf {
        self.directory.path().join(format!("{name}.log"))
    }

    /// Starts this program in a hidden role, in the session's place.
    pub fn start(&mut self, name: &'static str, role: &str, arguments: &[&OsStr]) -> Result<(), (Exit, String)> {
        self.start_with(name, role, arguments, &[])
    }

    /// The same with these variables in its environment.
    pub fn start_with(
        &mut self,
        name: &'static str,
        role: &str,
        arguments: &[&OsStr],
        environment: &[(&str, OsString)],
    ) -> Result<(), (Exit, String)> {
        let this = std::env::current_exe().map_err(|error| not_started(name, &error))?;
        self.start_program(name, &this, &[&[OsStr::new(role)], arguments].concat(), environment)
    }

    /// Starts another program in the session's place.
    pub fn start_program(
        &mut self,
        name: &'static str,
        program: &Path,
        arguments: &[&OsStr],
        environment: &[(&str, OsString)],
    ) -> Result<(), (Exit, String)> {
        let failed = |error: std::io::Error| not_started(name, &error);
        let log = File::create(self.log_path(name)).map_err(failed)?;
        let mut command = Command::new(program);
        command.args(arguments);
        command.arg("--root-path").arg(&self.settings.root_path).args(["--prefix", &self.settings.prefix]);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        command.envs(environment.iter().map(|(name, value)| (name, value)));
        // Ctrl-C reaches the demo alone, which then ends both in order.
        command.process_group(0);
        // SAFETY: between fork and exec only prctl is called, which is async-signal-safe.
        unsafe { command.pre_exec(die_with_parent) };
        self.children.push((name, command.spawn().map_err(failed)?));
        Ok(())
    }

    /// What a process has logged since it was started.
    pub fn log(&self, name: &str) -> String {
        std::fs::read_to_string(self.log_path(name)).unwrap_or_default()
    }

    /// Subscribes to the truth as soon as the plant has opened it.
    pub fn watch(&mut self, interrupted: &dyn Fn() -> bool) -> Result<(Node, Subscriber<TruthSample>), (Exit, String)> {
        let node = self.settings.node("admittancectl demo").map_err(|error| (Exit::Unavailable, error.to_string()))?;
        let give_up = Instant::now() + PATIENCE;
        loop {
            let opened = services::truth(&node, &self.settings.instance, Access::Open);
            match opened {
                Ok(service) => {
                    let subscriber = service.subscriber().map_err(|error| (Exit::Unavailable, error.to_string()))?;
                    return Ok((node, subscriber));
                }
                Err(error) if Instant::now() > give_up => return Err((Exit::Unavailable, error.to_string())),
                Err(_) => {}
            }
            for name in ["daemon", "plant"] {
                if let Some(status) = self.exit_status(name) {
                    return Err(self.failure(name, status));
                }
            }
            if interrupted() {
                return Err((Exit::ClaimNotMet, "interrupted; nothing is claimed".to_owned()));
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// A process by its name.
    pub fn child(&mut self, name: &str) -> Option<&mut Child> {
        self.children.iter_mut().find(|(known, _)| *known == name).map(|(_, child)| child)
    }

    /// Kills a process if it still runs, and forgets it: another of its name may be started.
    pub fn forget(&mut self, name: &str) {
        let is_it = |(known, _): &(&'static str, Child)| *known == name;
        while let Some(index) = self.children.iter().position(is_it) {
            let (_, mut child) = self.children.swap_remove(index);
            // It may have ended in the meantime: then there is nothing to kill.
            let _ = child.kill();
            let _ = child.wait();
        }
    }

    /// How a process ended; `None` while it runs.
    pub fn exit_status(&mut self, name: &str) -> Option<ExitStatus> {
        self.child(name)?.try_wait().ok().flatten()
    }

    /// Ends a process by SIGTERM and expects it to end well.
    pub fn end(&mut self, name: &'static str) -> Result<(), (Exit, String)> {
        if let Some(child) = self.child(name) {
            terminate(child);
            let status = wait(child, PATIENCE);
            match status {
                Some(status) if status.success() => {}
                Some(status) => return Err(self.failure(name, status)),
                None => return Err((Exit::Internal, format!("the {name} process did not end after SIGTERM"))),
            }
        }
        Ok(())
    }

    /// Why the daemon stopped the arm, as its log has it.
    pub fn stop_reason(&self) -> Option<String> {
        let log = self.log("daemon");
        let line = log.lines().find_map(|line| line.split_once("Stopped: "))?;
        Some(line.1.to_owned())
    }

    /// What a process that ended badly says, with its exit code.
    pub fn failure(&self, name: &str, status: ExitStatus) -> (Exit, String) {
        let code = status.code().and_then(Exit::from_code).filter(|code| *code != Exit::Ok).unwrap_or(Exit::Internal);
        (code, format!("the {name} process ended with {status}:\n{}", tail(&self.log_path(name))))
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        for (_, child) in &mut self.children {
            terminate(child);
        }
        for (_, child) in &mut self.children {
            if wait(child, Duration::from_secs(3)).is_none() {
                // It may have ended in the meantime: then there is nothing to kill.
                let _ = child.kill();
                let _ = child.wait();
            }
        }
        if let Err(error) = ipc_types::remove_all(&self.settings) {
            eprintln!("admittancectl: shared memory of the demo was not removed: {error}");
        }
    }
}

fn not_started(name: &str, error: &std::io::Error) -> (Exit, String) {
    (Exit::Unavailable, format!("the {name} process cannot be started: {error}"))
}

fn terminate(child: &mut Child) {
    if let Ok(None) = child.try_wait() {
        // SAFETY: kill takes numbers; the child is not reaped yet, so that its id is still its own.
        unsafe { libc::kill(child.id() as libc::pid_t, libc::SIGTERM) };
    }
}

fn wait(child: &mut Child, patience: Duration) -> Option<ExitStatus> {
    let give_up = Instant::now() + patience;
    loop {
        if let Ok(Some(status)) = child.try_wait() {
            return Some(status);
        }
        if Instant::now() > give_up {
            return None;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The last lines of a log.
fn tail(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(12)..].join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_left_of_a_session() {
        let scenario: Scenario = admittance_host::config::parse(crate::demo::SCENARIO, "paper.toml").expect("valid");
        let mut session = Session::new(&scenario).expect("/tmp is writable");
        let directory = session.directory.path().to_owned();
        let node = session.settings.node("test").expect("a node");
        let sleeper = Command::new("sleep").arg("1000").spawn().expect("sleep exists");
        let id = sleeper.id();
        session.children.push(("sleeper", sleeper));
        assert!(directory.join("ipc").exists());
        drop(node);
        let prefix = session.settings.prefix.clone();
        drop(session);
        assert!(!directory.exists());
        assert!(!Path::new(&format!("/proc/{id}")).exists(), "the child is still there");
        assert!(ipc_types::shared_memory_files(&prefix).expect("/dev/shm is readable").is_empty());
    }
}
