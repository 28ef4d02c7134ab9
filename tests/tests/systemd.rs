//! The units under a real systemd: what it starts, watches, restarts and stops. Installation is in `tests/install.rs`.

use std::os::unix::fs::PermissionsExt;

use admittance_host::clock::monotonic_ns;
use end_to_end::session::{PAPER_SCENARIO, PATIENT, TRIES, with_keys};
use end_to_end::{Need, PATIENCE, Systemd, needs, wait_until};

const PLANAR: &str = include_str!("../../deploy/robots/planar.toml");
const DAEMON: &str = "admittanced@robot.service";
const PLANT: &str = "plant-sim@robot.service";
const STATUS: &str = "runuser -u admittanced -- admittancectl status --json --instance robot";

/// A machine that is busy for some cycles must not end the contact that a test is about.
const UNHURRIED: [(&str, &str); 3] = [
    ("control.command_delay_s", "0.001"),
    ("control.max_sample_age_s", "0.5"),
    ("environment.normal_stiffness_n_m", "1e4"),
];

/// The shipped configuration of the planar arm, with what these tests need.
fn config(changes: &[(&str, &str)]) -> String {
    with_keys(PLANAR, &[&PATIENT[..], &UNHURRIED, changes].concat())
}

/// The paper's scene for a minute, on a softer surface: this `twist` in m/s throughout.
fn scenario(twist: &str) -> String {
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
const PRESS: &str = "[0.0, -0.02]";

/// A systemd in which everything is installed as a user does it, with this configuration and scenario of instance robot.
fn installed(config: &str, scenario: &str) -> Systemd {
    let systemd = Systemd::boot();
    systemd.run("deploy/install.sh");
    systemd.write("/etc/admittanced/robot.toml", config);
    systemd.write("/etc/admittanced/robot.scenario.toml", scenario);
    systemd
}

/// A scenario that stays in the air.
fn in_the_air() -> String {
    // Away from the surface, and so slowly that a minute of it stays in reach; where it starts does not matter.
    let text = with_keys(&scenario("[0.0, 0.001]"), &[]);
    let mut table: toml::Table = text.parse().expect("TOML");
    table["start"].as_table_mut().expect("a section").remove("contact_time_s");
    table.remove("surface");
    table.to_string()
}

/// What the daemon's process that systemd has now logged first with these fields.
fn entry_of_this_process(systemd: &Systemd, fields: &str) -> serde_json::Value {
    let process = systemd.property(DAEMON, "MainPID");
    systemd.wait_for_entry(&format!("-u {DAEMON} _PID={process} {fields}"))
}

fn microseconds(entry: &serde_json::Value) -> u64 {
    entry["__MONOTONIC_TIMESTAMP"].as_str().and_then(|text| text.parse().ok()).expect("every entry has one")
}

fn wait_for_state(systemd: &Systemd, unit: &str, state: &str) {
    wait_until(&format!("{unit} {state}"), PATIENCE, || systemd.property(unit, "ActiveState") == state);
}

/// Waits until systemd has restarted the daemon so many times and it is ready again.
fn wait_for_restart(systemd: &Systemd, count: u64) {
    wait_until("a restart", PATIENCE, || {
        systemd.number(DAEMON, "NRestarts") == count && systemd.property(DAEMON, "ActiveState") == "active"
    });
}

/// Kills the daemon; the first answer of the next one as the log has it, and how many ms it took until then.
fn kill_and_wait_for_answer(systemd: &Systemd, restarts: u64) -> (serde_json::Value, f64) {
    let killed_us = monotonic_ns() / 1000;
    systemd.signal(DAEMON, libc::SIGKILL);
    wait_for_restart(systemd, restarts);
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

/// Starts both units until the arm presses on the surface; false when the machine is too busy for it.
fn press(systemd: &Systemd) -> bool {
    for _ in 0..TRIES {
        systemd.run(&format!("systemctl stop {DAEMON} {PLANT}; systemctl reset-failed; systemctl start {PLANT}"));
        let mut mode = String::new();
        wait_until("contact", PATIENCE, || {
            let status = status(systemd);
            mode = status["mode"].as_str().unwrap_or_default().to_owned();
            // Above the activation threshold by some: a restart is to find it in contact.
            let is_pressing = status["wrench"][1].as_f64().is_some_and(|force| force.abs() > 8.0);
            mode == "Stopped" || mode == "Contact" && is_pressing
        });
        if mode == "Contact" {
            return true;
        }
    }
    println!("SKIPPED: machine too busy: no contact was kept in {TRIES} runs");
    false
}

fn status(systemd: &Systemd) -> serde_json::Value {
    let (_, text) = systemd.try_run(STATUS);
    // Until it answers, there is an error to read instead.
    serde_json::from_str(&text).unwrap_or_default()
}

fn assert_ended_well(systemd: &Systemd, unit: &str) {
    let state = ["ActiveState", "Result", "ExecMainStatus"].map(|name| systemd.property(unit, name));
    assert_eq!(state, ["inactive", "success", "0"], "{unit}");
}

/// Name and mode of each file in shared memory.
fn shared_memory(systemd: &Systemd) -> Vec<(String, u32)> {
    let entries = std::fs::read_dir(systemd.path("/dev/shm")).expect("it is mounted").flatten();
    let files = entries.map(|entry| {
        let mode = entry.metadata().expect("it is there").permissions().mode() & 0o777;
        (entry.file_name().to_string_lossy().into_owned(), mode)
    });
    files.collect()
}

/// What is left when both sides have stopped: nothing but iceoryx2's counter of nodes, 16 bytes that all instances share.
fn assert_shared_memory_is_free(systemd: &Systemd) {
    let files = shared_memory(systemd);
    assert!(files.iter().all(|(name, _)| name.ends_with(".global_mgmt")) && files.len() <= 1, "{files:?}");
}

/// Policy, real-time priority and processors of each thread of the daemon, by name.
fn threads(systemd: &Systemd) -> Vec<(String, u32, u32, String)> {
    let tasks = systemd.path(&format!("/proc/{}/task", systemd.property(DAEMON, "MainPID")));
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

#[test]
fn starts_in_order_and_with_what_the_units_promise() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = installed(&config(&[("realtime.cpu_dma_latency_us", "1000")]), &in_the_air());
    // As the udev rule has it: there is no udev in here, and the machine's own device is not to be touched.
    systemd.run(
        "mknod /run/latency c $(stat -c '0x%t 0x%T' /dev/cpu_dma_latency) && chgrp admittanced /run/latency && \
         chmod 0660 /run/latency && mount --bind /run/latency /dev/cpu_dma_latency",
    );

    // A daemon whose READY is not heard runs, but is not active, and the plant waits for it.
    let deaf = "/run/systemd/system/admittanced@robot.service.d/deaf.conf";
    let silent = "/usr/bin/env -u NOTIFY_SOCKET /usr/local/bin/admittanced --config /etc/admittanced/%i.toml";
    systemd.write(deaf, &format!("[Service]\nExecStart=\nExecStart={silent}\n"));
    systemd.run(&format!("systemctl daemon-reload && systemctl start --no-block {PLANT}"));
    systemd.wait_for_entry(&format!("-u {DAEMON} --grep=SCHED_FIFO"));
    let states = [DAEMON, PLANT].map(|unit| systemd.property(unit, "ActiveState"));
    assert_eq!(states, ["activating", "inactive"]);
    systemd.run(&format!("systemctl stop {PLANT} {DAEMON}; rm {deaf}; systemctl daemon-reload"));

    systemd.run(&format!("systemctl start {PLANT}"));
    let ready = systemd.number(DAEMON, "ActiveEnterTimestampMonotonic");
    let plant = systemd.number(PLANT, "ExecMainStartTimestampMonotonic");
    assert!(0 < ready && ready <= plant, "ready at {ready}, plant started at {plant} us");

    entry_of_this_process(&systemd, "MODE=Free");
    let threads = threads(&systemd);
    let fifo = libc::SCHED_FIFO.cast_unsigned();
    // The real-time thread has what [realtime] says, the other what the unit says.
    let real_time = threads.iter().find(|thread| thread.0 == "real-time").expect("it is named");
    assert_eq!((real_time.1, real_time.2, real_time.3.as_str()), (fifo, 85, "1"), "{threads:?}");
    let other = threads.iter().find(|thread| thread.0 == "admittanced").expect("it is named");
    assert_eq!((other.1, other.2, other.3.as_str()), (fifo, 1, "0"), "{threads:?}");
    for step in ["lock memory: done", "limit wake-up latency to 1000 us: done", "on processor 1: done"] {
        entry_of_this_process(&systemd, &format!("--grep='real time: .*{step}'"));
    }
    let open: Vec<_> = shared_memory(&systemd).into_iter().filter(|(_, mode)| mode & 0o077 != 0).collect();
    assert!(open.is_empty(), "other users have rights: {open:?}");
    let main = systemd.property(DAEMON, "MainPID");
    let locked = systemd.run(&format!("grep VmLck /proc/{main}/status"));
    assert!(!locked.contains(" 0 kB"), "{locked}");
}

#[test]
fn in_free_motion_it_is_restarted_after_a_kill_and_a_hang_and_stops_clean() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = installed(&config(&[]), &in_the_air());
    systemd.run(&format!("systemctl start {PLANT}"));
    entry_of_this_process(&systemd, "MODE=Free");
    let plant = systemd.property(PLANT, "MainPID");

    for restarts in 1..=3 {
        let (first, milliseconds) = kill_and_wait_for_answer(&systemd, restarts);
        println!("free motion: {milliseconds:.0} ms from SIGKILL to the first answer in the log");
        assert_eq!(first["STOP_REASON"], "None", "{first}");
        entry_of_this_process(&systemd, "MODE=Free");
    }

    systemd.signal(DAEMON, libc::SIGSTOP);
    wait_for_restart(&systemd, 4);
    systemd.wait_for_entry("_PID=1 --grep='Watchdog timeout'");
    entry_of_this_process(&systemd, "MODE=Free");
    assert_eq!(systemd.property(PLANT, "MainPID"), plant, "the plant runs on");

    systemd.run(&format!("systemctl stop {DAEMON}"));
    assert_ended_well(&systemd, DAEMON);
    assert_eq!(systemd.property(PLANT, "ActiveState"), "active");
    systemd.run(&format!("systemctl stop {PLANT}"));
    assert_ended_well(&systemd, PLANT);
    assert_shared_memory_is_free(&systemd);
}

#[test]
fn in_contact_a_restart_is_a_stop_and_a_stop_is_clean() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = installed(&config(&[]), &scenario(PRESS));
    if !press(&systemd) {
        return;
    }
    let plant = systemd.property(PLANT, "MainPID");
    let record = "systemd-run --quiet --uid=admittanced --unit=recorder \
                  /usr/local/bin/admittancectl record /tmp/contact.mcap --instance robot";
    systemd.run(record);
    systemd.wait_for_entry("-u recorder --grep='recording admittanced/robot'");

    let (first, milliseconds) = kill_and_wait_for_answer(&systemd, 1);
    println!("in contact: {milliseconds:.0} ms from SIGKILL to the first answer in the log");
    assert_eq!((&first["MODE"], &first["STOP_REASON"]), (&"Stopped".into(), &"StartedInContact".into()), "{first}");
    assert_eq!(systemd.property(PLANT, "MainPID"), plant, "the plant runs on");
    let status = status(&systemd);
    assert_eq!((&status["mode"], &status["motion"]), (&"Stopped".into(), &"Hold".into()), "{status}");
    systemd.run("systemctl stop recorder");
    held_all_along(&systemd);

    for _ in 0..TRIES {
        if !press(&systemd) {
            return;
        }
        let process = systemd.property(DAEMON, "MainPID");
        systemd.run(&format!("systemctl stop {DAEMON}"));
        assert_ended_well(&systemd, DAEMON);
        systemd.run(&format!("systemctl stop {PLANT}"));
        assert_ended_well(&systemd, PLANT);
        assert_shared_memory_is_free(&systemd);
        let log = systemd.journal(&format!("-u {DAEMON} _PID={process}"));
        let told = log.iter().position(|entry| entry["MESSAGE"].as_str().is_some_and(|text| text.contains("SIGTERM")));
        let last = log.iter().rposition(|entry| !entry["MODE"].is_null()).expect("it was in contact");
        assert_eq!(log[last]["MODE"], "Stopped", "{}", log[last]);
        if log[last]["STOP_REASON"] == "Shutdown" {
            return;
        }
        assert!(Some(last) < told, "{}", log[last]);
        println!("the machine was too busy: {}", log[last]["MESSAGE"]);
    }
    println!("SKIPPED: machine too busy: no contact was kept in {TRIES} runs");
}

/// What the plant says of the true motion: once held, it stayed held at a low force until the recording ended.
fn held_all_along(systemd: &Systemd) {
    let bytes = std::fs::read(systemd.path("/tmp/contact.mcap")).expect("the recording is there");
    let messages = mcap::MessageStream::new(&bytes).expect("an MCAP file").map(|message| message.expect("sound"));
    let truths: Vec<serde_json::Value> = messages
        .filter(|message| message.channel.topic == "/truth")
        .map(|message| serde_json::from_slice(&message.data).expect("JSON"))
        .collect();
    let force = |truth: &serde_json::Value| truth["peak_normal_force_n"].as_f64().expect("a number");
    let peak = truths.iter().map(force).fold(0.0, f64::max);
    assert!(peak <= 200.0, "peak {peak} N");
    let hold = serde_json::Value::from(ipc_types::Motion::Hold.code());
    let held = truths.iter().position(|truth| truth["motion"] == hold).expect("it was stopped in between");
    assert!(held > 0, "it was moving before");
    assert!(truths[held..].iter().all(|truth| truth["motion"] == hold), "it moved on");
    let last = truths.last().expect("at least that one");
    assert_eq!(last["in_contact"], 1, "{last}");
    let fastest = last["tcp_twist"].as_array().expect("a list").iter().filter_map(serde_json::Value::as_f64);
    assert!(fastest.fold(0.0, |most: f64, speed| most.max(speed.abs())) < 1e-4, "{last}");
}

#[test]
fn what_a_restart_cannot_mend_is_given_up() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = installed(&config(&[]), &in_the_air());
    // A configuration that is wrong: said once, and over.
    systemd.write("/etc/admittanced/robot.toml", &config(&[("control.sampling_time_s", "5.0")]));
    assert_eq!(systemd.try_run(&format!("systemctl start {DAEMON}")).0, Some(1));
    wait_for_state(&systemd, DAEMON, "failed");
    assert_eq!((systemd.property(DAEMON, "ExecMainStatus"), systemd.number(DAEMON, "NRestarts")), ("78".into(), 0));
    systemd.wait_for_entry(&format!("-u {DAEMON} --grep='control.sampling_time_s = 5'"));

    // None at all.
    systemd.run("systemctl reset-failed");
    assert_eq!(systemd.try_run("systemctl start admittanced@nobody").0, Some(1));
    wait_for_state(&systemd, "admittanced@nobody", "failed");
    let end = ["ExecMainStatus", "NRestarts"].map(|name| systemd.property("admittanced@nobody", name));
    assert_eq!(end, ["66", "0"]);

    // One that is right, but cannot be had: the root path of a rehearsal by hand, where the service may not write. Another
    // program could hold it, so it is tried again, and not for ever.
    systemd.run("systemctl reset-failed");
    systemd.write("/etc/admittanced/robot.toml", &config(&[("ipc.root_path", "\"/var/admittanced\"")]));
    assert_eq!(systemd.try_run(&format!("systemctl start {DAEMON}")).0, Some(1));
    wait_for_state(&systemd, DAEMON, "failed");
    let limit = systemd.number(DAEMON, "StartLimitBurst");
    wait_until("the start limit", PATIENCE, || systemd.number(DAEMON, "NRestarts") == limit);
    wait_for_state(&systemd, DAEMON, "failed");
    systemd.wait_for_entry(&format!("-u {DAEMON} --grep='Start request repeated too quickly'"));
    assert_eq!(systemd.property(DAEMON, "ExecMainStatus"), "69");
    assert_eq!(systemd.journal(&format!("-u {DAEMON} --grep='ipc.root_path writable'")).len() as u64, limit);
}

#[test]
fn a_reload_is_taken_or_refused_and_the_unit_stays_active() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = installed(&config(&[]), &in_the_air());
    systemd.run(&format!("systemctl start {PLANT}"));
    entry_of_this_process(&systemd, "MODE=Free");
    let process = systemd.property(DAEMON, "MainPID");
    let reloads = [
        (config(&[("contact.force_limit", "[150.0, 150.0]")]), "reload: the new configuration is in force"),
        ("this is not TOML".to_owned(), "reload refused: "),
    ];
    for (text, expected) in reloads {
        systemd.write("/etc/admittanced/robot.toml", &text);
        systemd.run(&format!("systemctl reload {DAEMON}"));
        entry_of_this_process(&systemd, &format!("--grep='{expected}'"));
        wait_for_state(&systemd, DAEMON, "active");
    }
    assert_eq!(systemd.property(DAEMON, "MainPID"), process, "the same process throughout");
    assert_eq!(systemd.number(DAEMON, "NRestarts"), 0);
}
