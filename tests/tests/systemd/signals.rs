//! Signals that come while the daemon starts, however early. Until the program has set up its
//! handlers, which is the first thing it does, a signal kills the process that systemd made, and
//! the unit says what follows; from then on the program acts on it in order.

use std::path::Path;
use std::time::{Duration, Instant};

use end_to_end::{Need, PATIENCE, Systemd, needs, wait_until};

use crate::units::*;

/// When a signal is sent.
#[derive(Debug, Clone, Copy)]
enum When {
    /// As soon as the process runs the program, which has not begun by then.
    AtExec,
    /// As soon as it catches the signal.
    AtOnce,
    /// This long after systemd made the process.
    After(Duration),
}

/// A daemon that is starting.
struct Starting {
    /// Its process, as this machine numbers it.
    process: i32,
    /// Its process, as the systemd that started it does.
    own_id: String,
    /// Whether it catches the signal by now.
    catches: bool,
}

/// Starts the daemon and waits until it is time.
fn started(systemd: &Systemd, processes: &Path, signal: i32, when: When) -> Starting {
    systemd.run(&format!("systemctl reset-failed; systemctl start --no-block {DAEMON}"));
    let mut process = None;
    wait_until("a process", PATIENCE, || {
        let text = std::fs::read_to_string(processes).unwrap_or_default();
        process = text.lines().next().and_then(|line| line.parse::<i32>().ok());
        process.is_some()
    });
    let process = process.expect("just found");
    let made = Instant::now();
    loop {
        let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
        let value = |name: &str| status.lines().find_map(|line| line.strip_prefix(name)).map(str::trim);
        let caught = value("SigCgt:").and_then(|bits| u64::from_str_radix(bits, 16).ok());
        let catches = caught.is_some_and(|bits| bits & 1 << (signal - 1) != 0);
        let is_due = match when {
            When::AtExec => status.starts_with("Name:\tadmittanced"),
            When::AtOnce => catches,
            When::After(delay) => made.elapsed() >= delay,
        };
        if is_due || made.elapsed() > PATIENCE {
            let own_id = value("NSpid:").and_then(|ids| ids.split_whitespace().last()).unwrap_or_default();
            return Starting { process, own_id: own_id.to_owned(), catches };
        }
        std::hint::spin_loop();
    }
}

/// Starts the daemon and sends its process a signal.
fn signal_at(systemd: &Systemd, processes: &Path, signal: i32, when: When) -> Starting {
    let starting = started(systemd, processes, signal, when);
    // SAFETY: kill touches no memory of this process; the id is that of the unit's process, which
    // systemd has made just now.
    unsafe { libc::kill(starting.process, signal) };
    starting
}

/// When the signals are sent: all over the start, and where it matters most several times.
fn times() -> impl Iterator<Item = When> {
    let later = (0..=44).step_by(4).map(|milliseconds| When::After(Duration::from_millis(milliseconds)));
    [When::AtExec, When::AtOnce].into_iter().cycle().take(8).chain(later)
}

#[test]
fn a_signal_while_it_starts_is_acted_on() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = installed(&config(&[]), &in_the_air());
    systemd.run(&format!("systemctl start {DAEMON}"));
    let processes = systemd.processes_of(DAEMON);
    systemd.run(&format!("systemctl stop {DAEMON}"));

    for when in times() {
        let caught = signal_at(&systemd, &processes, libc::SIGHUP, when).catches;
        wait_for_state(&systemd, DAEMON, "active");
        let restarts = systemd.number(DAEMON, "NRestarts");
        assert!(restarts <= u64::from(!caught), "{when:?}: {restarts} restarts");
        if caught {
            entry_of_this_process(&systemd, "--grep='reload: nothing has changed'");
        }
        systemd.run(&format!("systemctl stop {DAEMON}"));
        assert_ended_well(&systemd, DAEMON);
    }
    let mut earlier = 0;
    for when in times() {
        let Starting { own_id, catches, .. } = signal_at(&systemd, &processes, libc::SIGTERM, when);
        earlier += usize::from(!catches);
        let state = || systemd.property(DAEMON, "ActiveState");
        wait_until("the end", PATIENCE, || ["inactive", "failed"].contains(&state().as_str()));
        assert_eq!(systemd.number(DAEMON, "NRestarts"), 0, "{when:?}: who asks it to end is heard");
        // What it does not catch yet when that is looked at it may catch when it comes.
        if catches || state() == "inactive" {
            assert_ended_well(&systemd, DAEMON);
            systemd.wait_for_entry(&format!("-u {DAEMON} _PID={own_id} --grep='SIGTERM: ending control'"));
        } else {
            // Whoever waits for the start must not be told that it runs.
            let found = ["ActiveState", "Result"].map(|name| systemd.property(DAEMON, name));
            assert_eq!(found, ["failed", "protocol"], "{when:?}");
        }
    }
    println!("SIGTERM came {earlier} times before it was caught");
    for when in times() {
        started(&systemd, &processes, libc::SIGTERM, when);
        systemd.run(&format!("systemctl stop {DAEMON}"));
        let found = ["ActiveState", "Result"].map(|name| systemd.property(DAEMON, name));
        assert_eq!(found, ["inactive", "success"], "{when:?}: systemd itself was asked");
    }
}
