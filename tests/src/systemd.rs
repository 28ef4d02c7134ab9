//! A systemd of the test's own, booted apart from the machine's: see `tests/systemd/boot.sh`.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::{Child, PATIENCE, binaries, wait_until};

/// Where a user's working copy is in there, built.
const REPOSITORY: &str = "/srv/repository";
const PATH: &str = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin";
/// Lines of the journal that a failing test shows.
const LAST_LINES: u32 = 80;

/// A running systemd. Dropped, also by a failing test, it is killed with all that it started, and
/// its cgroup removed.
#[derive(Debug)]
pub struct Systemd {
    // Dropped in this order: a cgroup can be removed when its processes have gone.
    boot: Child,
    /// Process id of the service manager, as seen from outside.
    manager: u32,
    cgroup: Cgroup,
    _alone: MutexGuard<'static, ()>,
}

/// One at a time: the shipped files pin real-time programs to processors, and two plants that spin
/// on one starve whoever else is pinned there.
static ALONE: Mutex<()> = Mutex::new(());

impl Systemd {
    /// Boots it; nothing of this project is installed in there yet.
    ///
    /// # Panics
    /// When it does not come up. Ask [`needs`](crate::needs) first.
    pub fn boot() -> Self {
        // A test that failed has left nothing behind.
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let cgroup = Cgroup::new();
        let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
        let programs = binaries().admittanced.parent().expect("a program is in a directory");
        let mut command = Command::new("sh");
        command.arg(tests.join("systemd/boot.sh")).arg(&cgroup.0).arg(tests.join("..")).arg(programs);
        let mut boot = Child::spawn(&mut command);
        let mut manager = None;
        boot.wait_until("systemd", PATIENCE, |boot| {
            manager = child_of(boot.id());
            // Before, it is still the shell that prepares its place.
            manager.is_some_and(|id| comm(id).is_some_and(|name| name.trim() == "systemd"))
        });
        let systemd = Self { boot, manager: manager.expect("just found"), cgroup, _alone: alone };
        wait_until("basic.target", PATIENCE, || systemd.try_run("systemctl is-active booted.target").0 == Some(0));
        systemd
    }

    /// Runs a shell command in there, in a working copy of this repository: its exit code, and what
    /// it wrote.
    ///
    /// # Panics
    /// When nsenter does not start.
    pub fn try_run(&self, command: &str) -> (Option<i32>, String) {
        let output = Command::new("nsenter")
            .args(["--target", &self.manager.to_string(), "--all", "sh", "-c"])
            .arg(format!("cd {REPOSITORY} && {{ {command}\n}}"))
            // Like the login shell of somebody, not like this test: cargo's variables mean nothing
            // in there.
            .env_clear()
            .env("PATH", PATH)
            .stdin(Stdio::null())
            .output()
            .expect("needs(Systemd) has seen nsenter");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout) + &text(&output.stderr))
    }

    /// Runs a shell command like [`Self::try_run`], which has to succeed, and returns what it
    /// wrote.
    ///
    /// # Panics
    /// When it fails.
    #[track_caller]
    pub fn run(&self, command: &str) -> String {
        let (code, text) = self.try_run(command);
        assert_eq!(code, Some(0), "{command}: {text}");
        text
    }

    /// From outside, where a path in there is.
    pub fn path(&self, inside: &str) -> PathBuf {
        PathBuf::from(format!("/proc/{}/root{inside}", self.manager))
    }

    /// Writes a file in there, directories included.
    ///
    /// # Panics
    /// When it cannot be written.
    pub fn write(&self, inside: &str, text: &str) {
        let path = self.path(inside);
        std::fs::create_dir_all(path.parent().expect("a file is in a directory")).expect("made");
        std::fs::write(&path, text).unwrap_or_else(|error| panic!("{inside}: {error}"));
    }

    /// A property of a unit, as `systemctl show` has it.
    ///
    /// # Panics
    /// When systemctl fails.
    #[track_caller]
    pub fn property(&self, unit: &str, name: &str) -> String {
        self.run(&format!("systemctl show --property {name} --value {unit}")).trim().to_owned()
    }

    /// A property that is a number.
    ///
    /// # Panics
    /// When it is none.
    #[track_caller]
    pub fn number(&self, unit: &str, name: &str) -> u64 {
        let text = self.property(unit, name);
        text.parse().unwrap_or_else(|_| panic!("{unit} {name}: {text}"))
    }

    /// From outside, the file that lists the processes of a unit that runs; there is none while it
    /// does not.
    ///
    /// # Panics
    /// When systemctl fails.
    #[track_caller]
    pub fn processes_of(&self, unit: &str) -> PathBuf {
        let group = self.property(unit, "ControlGroup");
        self.cgroup.0.join(group.trim_start_matches('/')).join("cgroup.procs")
    }

    /// Sends a signal, such as `libc::SIGKILL`, to the process of a unit that has one.
    ///
    /// # Panics
    /// When it has none.
    #[track_caller]
    pub fn signal(&self, unit: &str, signal: i32) {
        let processes = self.processes_of(unit);
        let text = std::fs::read_to_string(&processes).unwrap_or_else(|error| panic!("{unit}: {error}"));
        let process = text.trim().parse().unwrap_or_else(|_| panic!("{unit}: not one process: {text:?}"));
        // SAFETY: kill touches no memory of this process; the id is that of a process of a unit in
        // there.
        assert_eq!(unsafe { libc::kill(process, signal) }, 0, "{unit}: {}", std::io::Error::last_os_error());
    }

    /// Entries of the journal that match, such as `-u UNIT MODE=Free`, oldest first.
    ///
    /// # Panics
    /// When journalctl fails.
    #[track_caller]
    pub fn journal(&self, matches: &str) -> Vec<serde_json::Value> {
        let (_, text) = self.try_run(&format!("journalctl --quiet --output json {matches}"));
        text.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|_| panic!("{matches}: {line}"))).collect()
    }

    /// Waits until the journal has an entry that matches, and returns the first.
    ///
    /// # Panics
    /// When it has none in time.
    #[track_caller]
    pub fn wait_for_entry(&self, matches: &str) -> serde_json::Value {
        let mut found = Vec::new();
        wait_until(matches, PATIENCE, || {
            found = self.journal(matches);
            !found.is_empty()
        });
        found.swap_remove(0)
    }
}

impl Drop for Systemd {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let (_, text) = self.try_run(&format!("journalctl --no-pager -o short-monotonic -n {LAST_LINES}"));
            eprintln!("--- journal, at most {LAST_LINES} lines\n{text}{}", self.boot.report());
        }
    }
}

/// Where the second version of the cgroup file system is mounted.
///
/// # Errors
/// That it is not.
pub(crate) fn cgroup_root() -> Result<PathBuf, String> {
    let mounts = std::fs::read_to_string("/proc/self/mounts").map_err(|error| error.to_string())?;
    let fields = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let mut cgroup2 = mounts.lines().map(fields).filter(|fields| fields.get(2).is_some_and(|kind| kind == "cgroup2"));
    cgroup2.next().map(|fields| PathBuf::from(&fields[1])).ok_or_else(|| "no cgroup2 file system is mounted".to_owned())
}

/// A cgroup, removed on drop.
#[derive(Debug)]
struct Cgroup(PathBuf);

impl Cgroup {
    fn new() -> Self {
        let root = cgroup_root().expect("needs(Systemd) has seen it");
        let directory =
            tempfile::Builder::new().prefix("admittanced-test-").tempdir_in(root).expect("root may make one");
        // Removed by the drop below: what is in it are no files.
        Self(directory.keep())
    }
}

impl Drop for Cgroup {
    fn drop(&mut self) {
        let is_empty = || {
            let events = std::fs::read_to_string(self.0.join("cgroup.events")).unwrap_or_default();
            !events.contains("populated 1")
        };
        let mut tries = 0;
        while !is_empty() && tries < 500 {
            std::thread::sleep(Duration::from_millis(10));
            tries += 1;
        }
        remove_directories(&self.0);
        if self.0.exists() {
            eprintln!("{}: not removed", self.0.display());
        }
    }
}

/// Removes a directory that holds directories alone, whatever files the kernel shows in them.
fn remove_directories(directory: &Path) {
    for entry in std::fs::read_dir(directory).into_iter().flatten().flatten() {
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            remove_directories(&entry.path());
        }
    }
    // What is left is reported above.
    let _ = std::fs::remove_dir(directory);
}

/// The only child of a process with one thread.
fn child_of(process: u32) -> Option<u32> {
    std::fs::read_to_string(format!("/proc/{process}/task/{process}/children")).ok()?.trim().parse().ok()
}

fn comm(process: u32) -> Option<String> {
    std::fs::read_to_string(format!("/proc/{process}/comm")).ok()
}
