//! What changes the whole process, each in a process of its own: this test binary starts itself
//! again in a role.

use std::fs;
use std::os::linux::fs::MetadataExt;
use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};
use std::time::Duration;

use admittance_host::logging::{self, FILTER_VARIABLE};
use admittance_host::realtime::{self, RealtimeSection, StepOutcome};

const ROLE: &str = "ADMITTANCE_HOST_TEST_ROLE";

/// This binary in a role; its stdout is the role's.
fn in_role(role: &str) -> Command {
    let mut command = Command::new(std::env::current_exe().expect("a test binary has a path"));
    command.args(["--exact", "role", "--nocapture"]).env(ROLE, role).env_remove(FILTER_VARIABLE);
    command.env_remove("JOURNAL_STREAM");
    command
}

/// Does nothing unless this process was started by [`in_role`].
#[test]
fn role() {
    match std::env::var(ROLE).as_deref() {
        Ok("log") => {
            match logging::init() {
                Ok(()) => tracing::info!(force_n = 12, "touched"),
                Err(why) => eprintln!("REFUSED {why}"),
            }
            tracing::debug!("details");
            assert!(logging::init().is_err(), "a second start is an error, not a panic");
        }
        Ok("real-time") => real_time_role(),
        Ok("parent") => {
            let mut command = Command::new("sleep");
            command.arg("600").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
            // SAFETY: `die_with_parent` makes one system call and allocates nothing.
            unsafe { command.pre_exec(realtime::die_with_parent) };
            #[allow(clippy::zombie_processes, reason = "the kernel is to end the child when this process ends")]
            let child = command.spawn().expect("sleep starts");
            println!("CHILD {}", child.id());
        }
        _ => {}
    }
}

/// The log of one run, with stderr in a file.
fn log_of(name: &str, change: impl FnOnce(&mut Command, &fs::Metadata)) -> String {
    let path = std::env::temp_dir().join(format!("admittance-host-{name}-{}.log", std::process::id()));
    let file = fs::File::create(&path).expect("the temporary directory is writable");
    let mut command = in_role("log");
    change(&mut command, &file.metadata().expect("an open file has metadata"));
    let status = command.stdout(Stdio::null()).stderr(file).status().expect("this binary starts");
    let text = fs::read_to_string(&path).expect("the log is text");
    fs::remove_file(&path).expect("the log can be removed");
    assert!(status.success(), "{text}");
    text
}

#[test]
fn text_goes_to_stderr_without_colours_and_at_level_info() {
    let text = log_of("plain", |_, _| {});
    assert!(text.contains("INFO touched force_n=12"), "{text}");
    assert!(!text.contains("details") && !text.contains('\x1b'), "{text}");
}

#[test]
fn the_filter_comes_from_the_environment() {
    let text = log_of("debug", |command, _| _ = command.env(FILTER_VARIABLE, "debug"));
    assert!(text.contains("DEBUG details"), "{text}");
    let text = log_of("malformed", |command, _| _ = command.env(FILTER_VARIABLE, "info=loud=1"));
    assert!(text.contains("REFUSED ADMITTANCE_LOG = \"info=loud=1\": "), "{text}");
    assert!(text.contains("accepted: "), "{text}");
}

#[test]
fn the_journal_is_used_only_when_it_is_stderr() {
    let journal = |meta: &fs::Metadata, inode: u64| format!("{}:{}", meta.st_dev(), meta.st_ino() + inode);
    let text = log_of("other", |command, meta| _ = command.env("JOURNAL_STREAM", journal(meta, 1)));
    assert!(text.contains("INFO touched"), "{text}");
    // Where no journal runs, the attempt fails in words.
    let text = log_of("journal", |command, meta| _ = command.env("JOURNAL_STREAM", journal(meta, 0)));
    assert!(text.is_empty() || text.starts_with("REFUSED the journal cannot be reached: "), "{text}");
}

/// Asks for everything; each step is done, as the kernel confirms, or refused with what to change.
fn real_time_role() {
    // SAFETY: takes nothing, returns a number.
    let cpu = unsafe { libc::sched_getcpu() };
    let cpu = u32::try_from(cpu).expect("a thread runs somewhere");
    let section = RealtimeSection {
        lock_memory: true,
        priority: 3,
        cpu: Some(cpu),
        cpu_dma_latency_us: Some(100),
        require_realtime: false,
    };
    let reports = realtime::go_real_time(&section);
    assert_eq!(reports.len(), 6, "{reports:?}");

    for report in reports {
        let is = |name: &str| report.step.contains(name);
        match &report.outcome {
            StepOutcome::NotRequested => panic!("{report:?}"),
            StepOutcome::Done if is("lock memory") => {
                let status = fs::read_to_string("/proc/self/status").expect("proc is mounted");
                let locked = status.lines().find(|line| line.starts_with("VmLck:")).expect("VmLck");
                assert!(!locked.contains(" 0 kB"), "{locked}");
            }
            StepOutcome::Done if is("timer slack") => {
                // SAFETY: takes no further argument.
                let slack_ns = unsafe { libc::prctl(libc::PR_GET_TIMERSLACK) };
                // Newer kernels set it to 0 when a thread becomes SCHED_FIFO.
                assert!(matches!(slack_ns, 0 | 1), "{slack_ns}");
            }
            StepOutcome::Done if is("SCHED_FIFO priority 3") => {
                // SAFETY: 0 is the calling thread.
                assert_eq!(unsafe { libc::sched_getscheduler(0) }, libc::SCHED_FIFO);
            }
            StepOutcome::Done if is("run on processor") => {
                let status = fs::read_to_string("/proc/thread-self/status").expect("proc is mounted");
                let list = status.lines().find(|line| line.starts_with("Cpus_allowed_list:")).expect("the list");
                assert_eq!(list.split_whitespace().last(), Some(cpu.to_string().as_str()));
            }
            // The open file is tested where it is opened; a prefaulted stack leaves no trace to
            // check.
            StepOutcome::Done if is("wake-up latency") || is("stack") => {}
            StepOutcome::Done => panic!("an unknown step: {report:?}"),
            StepOutcome::Refused(why) if is("lock memory") => assert!(why.contains("LimitMEMLOCK"), "{why}"),
            StepOutcome::Refused(why) if is("SCHED_FIFO") => assert!(why.contains("CAP_SYS_NICE"), "{why}"),
            StepOutcome::Refused(why) if is("wake-up latency") => assert!(why.contains("cpu_dma_latency"), "{why}"),
            StepOutcome::Refused(why) => panic!("nobody needs a permission for {}: {why}", report.step),
        }
    }
}

#[test]
fn every_real_time_step_is_done_or_refused_in_words() {
    let output = in_role("real-time").output().expect("this binary starts");
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
}

#[test]
fn a_child_dies_with_its_parent() {
    let output = in_role("parent").output().expect("this binary starts");
    let text = String::from_utf8_lossy(&output.stdout);
    let pid = text.split("CHILD ").nth(1).and_then(|rest| rest.split_whitespace().next()).expect("a pid");
    let pid: libc::pid_t = pid.parse().expect("a number");
    // Its parent has ended. Its adoptive parent reaps it: a zombie counts as ended.
    let is_alive = || {
        fs::read_to_string(format!("/proc/{pid}/stat"))
            .is_ok_and(|stat| !matches!(stat.rsplit(") ").next().map(|rest| &rest[..1]), Some("Z" | "X")))
    };
    let died = (0..3000).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        !is_alive()
    });
    if !died {
        // SAFETY: `pid` is the child of the role that this test started, and it still runs.
        unsafe { libc::kill(pid, libc::SIGKILL) };
    }
    assert!(died, "the child outlives its parent");
}
