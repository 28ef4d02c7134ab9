//! A child process that never outlives its test, and its output.

use std::fmt::Write as _;
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::terminal::{Terminal, take_terminal};

/// How long a test waits for something that must happen before it fails.
pub const PATIENCE: Duration = Duration::from_secs(60);

const POLL: Duration = Duration::from_millis(2);
/// Lines of each stream in a failure's message.
const LAST_LINES: usize = 60;

/// A running or ended program. Dropped, it is killed and reaped; when the test fails, its output is
/// printed then.
#[derive(Debug)]
pub struct Child {
    name: String,
    process: std::process::Child,
    stdout: Captured,
    stderr: Captured,
    status: Option<ExitStatus>,
}

impl Child {
    /// Starts the program with an empty stdin and its output captured. The kernel kills it when the
    /// thread that called this ends, so that it dies with its test however that ends: keep it on
    /// that thread.
    ///
    /// # Panics
    /// When the program does not start.
    #[track_caller]
    pub fn spawn(command: &mut Command) -> Self {
        let name = command.get_program().to_string_lossy().rsplit('/').next().unwrap_or_default().to_owned();
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let parent = std::process::id();
        // SAFETY: between fork and exec only async-signal-safe calls are made and nothing is
        // allocated.
        unsafe { command.pre_exec(move || hear_signals().and_then(|()| die_with(parent))) };
        let mut process = command.spawn().unwrap_or_else(|error| panic!("{command:?} does not start: {error}"));
        let stdout = Captured::of(process.stdout.take().expect("stdout is piped"));
        let stderr = Captured::of(process.stderr.take().expect("stderr is piped"));
        Self { name, process, stdout, stderr, status: None }
    }

    /// Starts the program on a terminal of its own: what it writes there is its stdout, and it has
    /// no stderr apart. Else as [`Self::spawn`].
    ///
    /// # Panics
    /// When the program does not start.
    #[track_caller]
    pub fn spawn_on_terminal(command: &mut Command) -> (Self, Terminal) {
        let name = command.get_program().to_string_lossy().rsplit('/').next().unwrap_or_default().to_owned();
        let (terminal, slave) = Terminal::open();
        let end = || Stdio::from(slave.try_clone().expect("a descriptor is left"));
        command.stdin(end()).stdout(end()).stderr(end()).env("TERM", "xterm-256color");
        let parent = std::process::id();
        // SAFETY: between fork and exec only async-signal-safe calls are made and nothing is
        // allocated.
        unsafe {
            command.pre_exec(move || hear_signals().and_then(|()| die_with(parent)).and_then(|()| take_terminal()))
        };
        let process = command.spawn().unwrap_or_else(|error| panic!("{command:?} does not start: {error}"));
        // The command keeps ends of the terminal: as long as they are open its output does not end.
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let stdout = Captured::of(terminal.output());
        (Self { name, process, stdout, stderr: Captured::of(std::io::empty()), status: None }, terminal)
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Its output on stdout so far.
    pub fn stdout(&self) -> String {
        self.stdout.text()
    }

    /// Its output on stderr so far.
    pub fn stderr(&self) -> String {
        self.stderr.text()
    }

    /// How it ended; `None` while it runs.
    pub fn exit_status(&mut self) -> Option<ExitStatus> {
        if self.status.is_none() {
            self.status = self.process.try_wait().expect("it is a child of this process");
        }
        self.status
    }

    /// Sends SIGTERM.
    pub fn terminate(&mut self) {
        self.signal(libc::SIGTERM);
    }

    /// Sends a signal, such as `libc::SIGSTOP`. Nothing happens when it has ended.
    pub fn signal(&mut self, signal: i32) {
        if self.exit_status().is_none() {
            // SAFETY: kill touches no memory of this process. The id is still the child's: it has
            // not been reaped.
            unsafe { libc::kill(self.id().cast_signed(), signal) };
        }
    }

    /// Waits for it to end by itself; all its output is there afterwards.
    ///
    /// # Panics
    /// When it still runs after `timeout`, with its output.
    #[track_caller]
    pub fn wait_for_exit(&mut self, timeout: Duration) -> ExitStatus {
        let end = Instant::now() + timeout;
        loop {
            if let Some(status) = self.exit_status() {
                self.collect_output();
                return status;
            }
            assert!(Instant::now() < end, "still running after {timeout:?}: {}", self.report());
            std::thread::sleep(POLL);
        }
    }

    /// Waits until `condition` holds; `what` completes the sentence "waited for ...".
    ///
    /// # Panics
    /// When it does not within `timeout`, or the program ends before, with its output.
    #[track_caller]
    pub fn wait_until(&mut self, what: &str, timeout: Duration, mut condition: impl FnMut(&Self) -> bool) {
        let end = Instant::now() + timeout;
        loop {
            let ended = self.exit_status().is_some();
            if ended {
                self.collect_output();
            }
            if condition(self) {
                return;
            }
            assert!(!ended, "waited for {what}, but it ended: {}", self.report());
            assert!(Instant::now() < end, "waited {timeout:?} for {what}: {}", self.report());
            std::thread::sleep(POLL);
        }
    }

    /// Name, process id, state and the last lines of both streams.
    pub fn report(&mut self) -> String {
        let state = self.exit_status().map_or_else(|| "running".to_owned(), |status| status.to_string());
        let mut report = format!("{} (process {}): {state}\n", self.name, self.id());
        for (stream, text) in [("stdout", self.stdout()), ("stderr", self.stderr())] {
            let lines: Vec<&str> = text.lines().collect();
            let left_out = lines.len().saturating_sub(LAST_LINES);
            // Writing to a string does not fail.
            let _ = writeln!(report, "--- {stream}, {} lines, first {left_out} left out", lines.len());
            for line in &lines[left_out..] {
                let _ = writeln!(report, "{line}");
            }
        }
        report
    }

    /// The last output of an ended program may still be in the pipes. If a grandchild keeps them
    /// open it is not waited for.
    fn collect_output(&self) {
        let end = Instant::now() + Duration::from_secs(5);
        while !(self.stdout.is_complete() && self.stderr.is_complete()) && Instant::now() < end {
            std::thread::sleep(POLL);
        }
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        if self.exit_status().is_none() {
            if std::thread::panicking() {
                eprintln!("{}", self.report());
            }
            // It may have ended in the meantime: then there is nothing to kill.
            let _ = self.process.kill();
            let _ = self.process.wait();
        } else if std::thread::panicking() {
            eprintln!("{}", self.report());
        }
    }
}

/// Waits until `condition` holds; `what` completes the sentence "waited for ...".
///
/// # Panics
/// When it does not within `timeout`.
#[track_caller]
pub fn wait_until(what: &str, timeout: Duration, mut condition: impl FnMut() -> bool) {
    let end = Instant::now() + timeout;
    while !condition() {
        assert!(Instant::now() < end, "waited {timeout:?} for {what}");
        std::thread::sleep(POLL);
    }
}

/// In the child, before exec: no signal that a person sends is ignored any more. A test run that was
/// started in the background, or by nohup, ignores some, and a program inherits that.
fn hear_signals() -> std::io::Result<()> {
    for signal in [libc::SIGHUP, libc::SIGINT, libc::SIGQUIT] {
        // SAFETY: signal takes two numbers; no handler is installed.
        if unsafe { libc::signal(signal, libc::SIG_DFL) } == libc::SIG_ERR {
            return Err(std::io::Error::last_os_error());
        }
    }
    Ok(())
}

/// In the child, before exec: asks for SIGKILL when its parent dies, and ends if that has happened
/// already.
fn die_with(parent: u32) -> std::io::Result<()> {
    // SAFETY: prctl with PR_SET_PDEATHSIG takes a signal by value and touches no memory.
    if unsafe { libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) } != 0 {
        return Err(std::io::Error::last_os_error());
    }
    // SAFETY: getppid takes nothing and cannot fail.
    if unsafe { libc::getppid() }.cast_unsigned() != parent {
        return Err(std::io::Error::from_raw_os_error(libc::ESRCH));
    }
    Ok(())
}

/// A stream that a thread reads to its end, so that a full pipe never stops the program.
#[derive(Debug)]
struct Captured {
    bytes: Arc<Mutex<Vec<u8>>>,
    reader: JoinHandle<()>,
}

impl Captured {
    fn of(mut stream: impl Read + Send + 'static) -> Self {
        let bytes = Arc::new(Mutex::new(Vec::new()));
        let sink = Arc::clone(&bytes);
        let reader = std::thread::spawn(move || {
            let mut chunk = [0; 8192];
            while let Ok(length @ 1..) = stream.read(&mut chunk) {
                sink.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(&chunk[..length]);
            }
        });
        Self { bytes, reader }
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.bytes.lock().unwrap_or_else(PoisonError::into_inner)).into_owned()
    }

    fn is_complete(&self) -> bool {
        self.reader.is_finished()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;
    use std::path::Path;

    fn shell(script: &str) -> Child {
        Child::spawn(Command::new("sh").args(["-c", script]))
    }

    fn message(failure: Box<dyn std::any::Any + Send>) -> String {
        *failure.downcast::<String>().expect("the failure has a message")
    }

    #[test]
    fn a_signal_that_the_test_run_ignores_is_heard() {
        for signal in [libc::SIGHUP, libc::SIGINT, libc::SIGQUIT] {
            // SAFETY: no handler is installed, and no other test here sends itself one of these.
            unsafe { libc::signal(signal, libc::SIG_IGN) };
            let (mut child, _terminal) = Child::spawn_on_terminal(Command::new("sleep").arg("1000"));
            for child in [&mut child, &mut Child::spawn(Command::new("sleep").arg("1000"))] {
                child.signal(signal);
                assert_eq!(child.wait_for_exit(PATIENCE).signal(), Some(signal));
            }
        }
    }

    #[test]
    fn output_and_status_are_complete_after_the_end() {
        // More than a pipe holds.
        let mut child = shell("for i in $(seq 20000); do echo line $i; done; echo oops >&2; exit 78");
        assert_eq!(child.wait_for_exit(PATIENCE).code(), Some(78));
        assert_eq!(child.stdout().lines().count(), 20000);
        assert_eq!(child.stderr(), "oops\n");
    }

    #[test]
    fn a_signal_can_be_handled() {
        let mut child = shell("trap 'echo got it; exit 3' TERM; echo ready; while :; do sleep 0.01; done");
        child.wait_until("the trap", PATIENCE, |child| child.stdout().contains("ready"));
        child.terminate();
        assert_eq!(child.wait_for_exit(PATIENCE).code(), Some(3));
        assert!(child.stdout().ends_with("got it\n"));
        child.terminate();
    }

    #[test]
    fn dropped_it_is_gone() {
        let child = shell("trap '' TERM; sleep 1000");
        let directory = format!("/proc/{}", child.id());
        assert!(Path::new(&directory).exists());
        drop(child);
        assert!(!Path::new(&directory).exists(), "reaped, so that not even a zombie is left");
    }

    #[test]
    fn it_dies_with_the_thread_that_started_it() {
        let starter = std::thread::spawn(|| std::mem::ManuallyDrop::new(shell("exec sleep 1000")));
        let mut child = starter.join().expect("the shell starts");
        child.wait_for_exit(PATIENCE);
        assert_eq!(
            std::os::unix::process::ExitStatusExt::signal(&child.exit_status().expect("ended")),
            Some(libc::SIGKILL)
        );
    }

    #[test]
    fn failures_show_state_and_output() {
        let failure = std::panic::catch_unwind(|| {
            let mut child = shell("echo some hint >&2; exit 5");
            child.wait_until("a miracle", PATIENCE, |_| false);
        });
        let text = message(failure.expect_err("it ended before"));
        assert!(text.starts_with("waited for a miracle, but it ended: sh (process "), "{text}");
        assert!(text.contains("exit status: 5") && text.contains("some hint"), "{text}");

        let failure = std::panic::catch_unwind(|| {
            let mut child = shell("echo busy; sleep 1000");
            child.wait_until("the word", PATIENCE, |child| child.stdout().contains("busy"));
            child.wait_for_exit(Duration::from_millis(20))
        });
        let text = message(failure.expect_err("it hangs"));
        assert!(text.starts_with("still running after 20ms") && text.contains("busy"), "{text}");

        let failure = std::panic::catch_unwind(|| wait_until("rain", Duration::from_millis(5), || false));
        assert_eq!(message(failure.expect_err("it never rains")), "waited 5ms for rain");
    }
}
