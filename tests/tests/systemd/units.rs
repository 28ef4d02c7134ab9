//! The daemon's and the plant's unit, installed, started and observed.

use std::os::unix::fs::PermissionsExt;

use admittance_host::clock::monotonic_ns;
use end_to_end::session::{PAPER_SCENARIO, PATIENT, with_keys};
use end_to_end::{PATIENCE, Systemd, wait_until};

const PLANAR: &str = include_str!("../../../deploy/robots/planar.toml");
pub(crate) const DAEMON: &str = "admittanced@robot.service";
pub(crate) const PLANT: &str = "plant-sim@robot.service";
const STATUS: &str = "runuser -u admittanced -- admittancectl status --json --instance robot";

/// A machine that is busy for some cycles must not end the contact that a test is about.
const UNHURRIED: [(&str, &str); 3] = [
    ("control.command_delay_s", "0.001"),
    ("control.max_sample_age_s", "0.5"),
    ("environment.normal_stiffness_n_m", "1e4"),
];

/// The shipped configuration of the planar arm, with what these tests need.
pub(crate) fn config(changes: &[(&str, &str)]) -> String {
    with_keys(PLANAR, &[&PATIENT[..], &UNHURRIED, changes].concat())
}

/// The paper's scene for a minute, on a softer surface: this `twist` in m/s throughout.
pub(crate) fn scenario(twist: &str) -> String {
    let motion = format!("[{{ duration_s = 60.0, twist = {twist} }}]");
    let changes = [
        ("motion", motion.as_str()),
        ("timing.command_delay_s", "0.001"),
        ("start.contact_time_s", "0.4"),
        ("surface.stiffness_n_m", "1e4"),
    ];
    with_keys(PAPER_SCENARIO, &changes)
}

/// Down to the surface, and along it.
pub(crate) const PRESS: &str = "[0.0, -0.02]";

/// A systemd in which everything is installed as a user does it, with this configuration and
/// scenario of instance robot.
pub(crate) fn installed(config: &str, scenario: &str) -> Systemd {
    let systemd = Systemd::boot();
    systemd.run("deploy/install.sh");
    systemd.write("/etc/admittanced/robot.toml", config);
    systemd.write("/etc/admittanced/robot.scenario.toml", scenario);
    systemd
}

/// A scenario that stays in the air.
pub(crate) fn in_the_air() -> String {
    // Away from the surface, and so slowly that a minute of it stays in reach; where it starts does
    // not matter.
    let text = with_keys(&scenario("[0.0, 0.001]"), &[]);
    let mut table: toml::Table = text.parse().expect("TOML");
    table["start"].as_table_mut().expect("a section").remove("contact_time_s");
    table.remove("surface");
    table.to_string()
}

/// The first log entry with these fields of the daemon's present process.
pub(crate) fn entry_of_this_process(systemd: &Systemd, fields: &str) -> serde_json::Value {
    let process = systemd.property(DAEMON, "MainPID");
    systemd.wait_for_entry(&format!("-u {DAEMON} _PID={process} {fields}"))
}

fn microseconds(entry: &serde_json::Value) -> u64 {
    entry["__MONOTONIC_TIMESTAMP"].as_str().and_then(|text| text.parse().ok()).expect("every entry has one")
}

pub(crate) fn wait_for_state(systemd: &Systemd, unit: &str, state: &str) {
    wait_until(&format!("{unit} {state}"), PATIENCE, || systemd.property(unit, "ActiveState") == state);
}

/// Waits until systemd has restarted a unit `count` times and it is ready again.
pub(crate) fn wait_for_restart(systemd: &Systemd, unit: &str, count: u64) {
    wait_until("a restart", PATIENCE, || {
        systemd.number(unit, "NRestarts") == count && systemd.property(unit, "ActiveState") == "active"
    });
}

/// Kills the daemon; the first answer of the next one as the log has it, and how many ms it took
/// until then.
pub(crate) fn kill_and_wait_for_answer(systemd: &Systemd, restarts: u64) -> (serde_json::Value, f64) {
    let killed_us = monotonic_ns() / 1000;
    systemd.signal(DAEMON, libc::SIGKILL);
    wait_for_restart(systemd, DAEMON, restarts);
    let process = systemd.property(DAEMON, "MainPID");
    let mut answers = Vec::new();
    wait_until("an answer of the new process", PATIENCE, || {
        answers = systemd.journal(&format!("-u {DAEMON} _PID={process}"));
        answers.retain(|entry| !entry["MODE"].is_null());
        !answers.is_empty()
    });
    let first = answers.swap_remove(0);
    let milliseconds = microseconds(&first).saturating_sub(killed_us) as f64 * 1e-3;
    (first, milliseconds)
}

/// Starts both units and waits until the arm presses on the surface.
pub(crate) fn press(systemd: &Systemd) {
    systemd.run(&format!("systemctl stop {DAEMON} {PLANT}; systemctl reset-failed; systemctl start {PLANT}"));
    let mut status = serde_json::Value::Null;
    wait_until("contact", PATIENCE, || {
        status = self::status(systemd);
        // Well above the activation threshold: a restart must find it in contact.
        let is_pressing = status["wrench"][1].as_f64().is_some_and(|force| force.abs() > 8.0);
        status["mode"] == "Stopped" || status["mode"] == "Contact" && is_pressing
    });
    assert_eq!(status["mode"], "Contact", "{status}");
}

pub(crate) fn status(systemd: &Systemd) -> serde_json::Value {
    let (_, text) = systemd.try_run(STATUS);
    // Until it answers, the output is an error message.
    serde_json::from_str(&text).unwrap_or_default()
}

pub(crate) fn assert_ended_well(systemd: &Systemd, unit: &str) {
    let state = ["ActiveState", "Result", "ExecMainStatus"].map(|name| systemd.property(unit, name));
    assert_eq!(state, ["inactive", "success", "0"], "{unit}");
}

/// Name and mode of each file in shared memory.
pub(crate) fn shared_memory(systemd: &Systemd) -> Vec<(String, u32)> {
    let entries = std::fs::read_dir(systemd.path("/dev/shm")).expect("it is mounted").flatten();
    let files = entries.map(|entry| {
        let mode = entry.metadata().expect("it is there").permissions().mode() & 0o777;
        (entry.file_name().to_string_lossy().into_owned(), mode)
    });
    files.collect()
}

/// When both sides have stopped nothing is left.
pub(crate) fn assert_shared_memory_is_free(systemd: &Systemd) {
    let files = shared_memory(systemd);
    assert!(files.is_empty(), "{files:?}");
}

/// Policy, real-time priority and processors of each thread of a unit, by name.
pub(crate) fn threads(systemd: &Systemd, unit: &str) -> Vec<(String, u32, u32, String)> {
    let tasks = systemd.path(&format!("/proc/{}/task", systemd.property(unit, "MainPID")));
    let tasks = std::fs::read_dir(tasks).expect("it runs").flatten();
    let read = |path: std::path::PathBuf| std::fs::read_to_string(path).expect("it runs");
    tasks
        .map(|task| {
            let stat = read(task.path().join("stat"));
            // Fields 40 and 41 of proc(5), counted from after the name, which ends field 2.
            let fields: Vec<&str> = stat.rsplit(')').next().expect("a name").split_whitespace().collect();
            let status = read(task.path().join("status"));
            let line = |key: &str| {
                let line = status.lines().find_map(|line| line.strip_prefix(key)).expect("every kernel has it");
                line.trim().to_owned()
            };
            let number = |index: usize| fields[index].parse().expect("a number");
            (line("Name:"), number(38), number(37), line("Cpus_allowed_list:"))
        })
        .collect()
}
