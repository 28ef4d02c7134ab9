//! The units under a real systemd: how it starts, watches, restarts and stops them. Installation is
//! in `tests/install.rs`.

mod egm;
mod flood;
mod root;
mod signals;
mod strangers;
mod units;

use end_to_end::{Need, PATIENCE, Systemd, certain, needs, undisturbed, wait_until};
use units::*;

#[test]
fn starts_in_order_and_with_what_the_units_promise() {
    undisturbed(|| {
        if !needs(Need::Systemd) {
            return;
        }
        let systemd = installed(&config(&[("realtime.cpu_dma_latency_us", "1000")]), &in_the_air());
        // As the udev rule does it: there is no udev in here, and the machine's device must not be
        // touched.
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
        let threads = threads(&systemd, DAEMON);
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
    });
}

#[test]
fn in_free_motion_it_is_restarted_after_a_kill_and_a_hang_and_stops_clean() {
    undisturbed(|| {
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
        wait_for_restart(&systemd, DAEMON, 4);
        systemd.wait_for_entry("_PID=1 --grep='Watchdog timeout'");
        entry_of_this_process(&systemd, "MODE=Free");
        assert_eq!(systemd.property(PLANT, "MainPID"), plant, "the plant runs on");

        systemd.run(&format!("systemctl stop {DAEMON}"));
        assert_ended_well(&systemd, DAEMON);
        assert_eq!(systemd.property(PLANT, "ActiveState"), "active");
        systemd.run(&format!("systemctl stop {PLANT}"));
        assert_ended_well(&systemd, PLANT);
        assert_shared_memory_is_free(&systemd);
    });
}

#[test]
fn in_contact_a_restart_is_a_stop_and_a_stop_is_clean() {
    undisturbed(|| {
        if !needs(Need::Systemd) {
            return;
        }
        let systemd = installed(&config(&[]), &scenario(PRESS));
        press(&systemd);
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

        press(&systemd);
        let process = systemd.property(DAEMON, "MainPID");
        systemd.run(&format!("systemctl stop {DAEMON}"));
        assert_ended_well(&systemd, DAEMON);
        systemd.run(&format!("systemctl stop {PLANT}"));
        assert_ended_well(&systemd, PLANT);
        assert_shared_memory_is_free(&systemd);
        let log = systemd.journal(&format!("-u {DAEMON} _PID={process}"));
        let last = log.iter().rfind(|entry| !entry["MODE"].is_null()).expect("it was in contact");
        assert_eq!((&last["MODE"], &last["STOP_REASON"]), (&"Stopped".into(), &"Shutdown".into()), "{last}");
    });
}

/// Checks the plant's truth: once held, the arm stayed held at a low force until the recording
/// ended.
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
    let hold = serde_json::Value::from("Hold");
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
    undisturbed(|| {
        if !needs(Need::Systemd) {
            return;
        }
        let systemd = installed(&config(&[]), &in_the_air());
        // A wrong configuration: reported once, then given up.
        systemd.write("/etc/admittanced/robot.toml", &config(&[("control.sampling_time_s", "5.0")]));
        assert_eq!(systemd.try_run(&format!("systemctl start {DAEMON}")).0, Some(1));
        wait_for_state(&systemd, DAEMON, "failed");
        assert_eq!((systemd.property(DAEMON, "ExecMainStatus"), systemd.number(DAEMON, "NRestarts")), ("78".into(), 0));
        let entry = systemd.wait_for_entry(&format!("-u {DAEMON} --grep='control.sampling_time_s = 5'"));
        certain(|| assert_eq!(entry["PRIORITY"], "3", "{entry}"));

        // None at all.
        systemd.run("systemctl reset-failed");
        assert_eq!(systemd.try_run("systemctl start admittanced@nobody").0, Some(1));
        wait_for_state(&systemd, "admittanced@nobody", "failed");
        let end = ["ExecMainStatus", "NRestarts"].map(|name| systemd.property("admittanced@nobody", name));
        assert_eq!(end, ["66", "0"]);
        let entry = systemd.wait_for_entry("-u admittanced@nobody --grep=nobody.toml");
        certain(|| assert_eq!(entry["PRIORITY"], "3", "{entry}"));

        // A valid one that cannot be used: the root path of a rehearsal by hand, where the service
        // may not write. Another program could hold it, so it is retried, but not for ever.
        systemd.run("systemctl reset-failed");
        systemd.write("/etc/admittanced/robot.toml", &config(&[("ipc.root_path", "\"/var/admittanced\"")]));
        assert_eq!(systemd.try_run(&format!("systemctl start {DAEMON}")).0, Some(1));
        wait_for_state(&systemd, DAEMON, "failed");
        let limit = systemd.number(DAEMON, "StartLimitBurst");
        wait_until("the start limit", PATIENCE, || systemd.number(DAEMON, "NRestarts") == limit);
        wait_for_state(&systemd, DAEMON, "failed");
        systemd.wait_for_entry(&format!("-u {DAEMON} --grep='Start request repeated too quickly'"));
        assert_eq!(systemd.property(DAEMON, "ExecMainStatus"), "69");
        let refused = systemd.journal(&format!("-u {DAEMON} --grep='ipc.root_path writable'"));
        assert_eq!(refused.len() as u64, limit);
        certain(|| assert!(refused.iter().all(|entry| entry["PRIORITY"] == "3"), "{refused:?}"));

        // A right that it does not have.
        systemd.run("systemctl reset-failed");
        let unknown = [("realtime.cpu", "1023"), ("realtime.require_realtime", "true")];
        systemd.write("/etc/admittanced/robot.toml", &config(&unknown));
        assert_eq!(systemd.try_run(&format!("systemctl start {DAEMON}")).0, Some(1));
        let entry = systemd.wait_for_entry(&format!("-u {DAEMON} --grep='realtime.cpu must be'"));
        wait_for_state(&systemd, DAEMON, "failed");
        assert_eq!(systemd.property(DAEMON, "ExecMainStatus"), "77");
        certain(|| assert_eq!(entry["PRIORITY"], "3", "{entry}"));
    });
}

#[test]
fn a_reload_is_taken_or_refused_and_the_unit_stays_active() {
    undisturbed(|| {
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
    });
}
