//! The EGM edge's unit: ready when its ports exist, real time as configured, UDP through its sandbox, restarted when it hangs.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use egm_messages::{EgmSensor, Message};
use end_to_end::egm_robot::standing;
use end_to_end::session::with_keys;
use end_to_end::{Need, PATIENCE, Systemd, needs, undisturbed, wait_until};

use crate::units::*;

const EDGE: &str = "admittance-egm@robot.service";
const OF_DAEMON: &str = include_str!("../../../deploy/egm/six-joint.toml");
const OF_EDGE: &str = include_str!("../../../deploy/egm/six-joint.egm.toml");
const CYCLE: Duration = Duration::from_millis(4);

/// A robot that stands, and what it is answered.
struct Robot {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    end: AtomicBool,
    answers: AtomicU64,
    /// Answers that were not six zeros.
    others: AtomicU64,
}

impl Robot {
    fn at(edge: SocketAddr) -> Self {
        let shared = Arc::<Shared>::default();
        let of_thread = Arc::clone(&shared);
        Self { shared, thread: Some(std::thread::spawn(move || of_thread.stand(edge))) }
    }

    /// Waits for so many more answers.
    fn wait_for_answers(&self, more: u64) {
        let goal = self.shared.answers.load(Ordering::Relaxed) + more;
        wait_until("answers of the edge", PATIENCE, || self.shared.answers.load(Ordering::Relaxed) >= goal);
    }
}

impl Shared {
    fn stand(&self, edge: SocketAddr) {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port is free");
        socket.set_nonblocking(true).expect("a socket");
        let (begun, mut buffer) = (Instant::now(), [0; 2048]);
        for cycle in 1_u32.. {
            if self.end.load(Ordering::Relaxed) {
                return;
            }
            // An edge that is not there hears nothing.
            let _ = socket.send_to(&standing(cycle).encode_to_vec(), edge);
            std::thread::sleep((begun + CYCLE * cycle).saturating_duration_since(Instant::now()));
            while let Ok(length) = socket.recv(&mut buffer) {
                let answer = EgmSensor::decode(&buffer[..length]).expect("an EgmSensor message");
                let speeds = answer.speed_ref.and_then(|speeds| speeds.joints).expect("joint speeds").joints;
                self.others.fetch_add(u64::from(speeds != [0.0; 6]), Ordering::Relaxed);
                self.answers.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        self.shared.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // One that failed has said so.
            let _ = thread.join();
        }
    }
}

/// Everything installed, with an arm beside an ABB robot, and where its edge awaits the robot.
fn installed_with_edge() -> (Systemd, SocketAddr) {
    let patient = [("control.answer_budget_s", "0.0028"), ("control.max_sample_age_s", "0.1")];
    let systemd = installed(&with_keys(OF_DAEMON, &patient), &in_the_air());
    let port = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|socket| socket.local_addr()).expect("free").port();
    let listen = format!("\"127.0.0.1:{port}\"");
    let keys = [("egm.listen", listen.as_str()), ("egm.robot_address", "\"127.0.0.1\"")];
    systemd.write("/etc/admittanced/robot.egm.toml", &with_keys(OF_EDGE, &keys));
    (systemd, SocketAddr::from((Ipv4Addr::LOCALHOST, port)))
}

#[test]
fn the_edge_is_ready_real_time_and_reached_through_its_sandbox_and_restarted_when_it_hangs() {
    undisturbed(|| {
        if !needs(Need::Systemd) {
            return;
        }
        let (systemd, address) = installed_with_edge();
        // One whose READY is not heard runs, and is not active.
        let deaf = "/run/systemd/system/admittance-egm@robot.service.d/deaf.conf";
        let silent = "/usr/bin/env -u NOTIFY_SOCKET /usr/local/bin/admittance-egm --config /etc/admittanced/%i.egm.toml \
                      --daemon-config /etc/admittanced/%i.toml --instance %i";
        systemd.write(deaf, &format!("[Service]\nExecStart=\nExecStart={silent}\n"));
        systemd.run(&format!("systemctl daemon-reload && systemctl start --no-block {EDGE}"));
        systemd.wait_for_entry(&format!("-u {EDGE} --grep='awaits 127.0.0.1 on'"));
        assert_eq!(systemd.property(EDGE, "ActiveState"), "activating");
        systemd.run(&format!("systemctl stop {EDGE}; rm {deaf}; systemctl daemon-reload"));

        // It wants the daemon, which comes with it.
        systemd.run(&format!("systemctl start {EDGE}"));
        assert_eq!([EDGE, DAEMON].map(|unit| systemd.property(unit, "ActiveState")), ["active", "active"]);
        let threads = threads(&systemd, EDGE);
        let is_real_time = |thread: &&(String, u32, u32, String)| {
            (thread.1, thread.2, thread.3.as_str()) == (libc::SCHED_FIFO.cast_unsigned(), 86, "1")
        };
        assert_eq!(threads.iter().filter(is_real_time).count(), 1, "as [realtime] has it: {threads:?}");
        let main = systemd.property(EDGE, "MainPID");
        let locked = systemd.run(&format!("grep VmLck /proc/{main}/status"));
        assert!(!locked.contains(" 0 kB"), "{locked}");

        // The robot's messages come in, the daemon gets its samples, and answers go out.
        let robot = Robot::at(address);
        robot.wait_for_answers(100);
        entry_of_this_process(&systemd, "MODE=Free");
        assert_eq!(status(&systemd)["mode"], "Free");

        // One that hangs is restarted, and finds its robot again.
        systemd.signal(EDGE, libc::SIGSTOP);
        wait_for_restart(&systemd, EDGE, 1);
        systemd.wait_for_entry("_PID=1 --grep='admittance-egm@robot.service: Watchdog timeout'");
        robot.wait_for_answers(100);
        wait_until("control again", PATIENCE, || status(&systemd)["mode"] == "Free");
        // One that is killed too.
        systemd.signal(EDGE, libc::SIGKILL);
        wait_for_restart(&systemd, EDGE, 2);
        robot.wait_for_answers(100);

        // An edge without a daemon goes on answering: zeros.
        systemd.run(&format!("systemctl stop {DAEMON}"));
        robot.wait_for_answers(50);
        assert_eq!(systemd.property(EDGE, "ActiveState"), "active");
        systemd.run(&format!("systemctl stop {EDGE}"));
        for unit in [EDGE, DAEMON] {
            assert_ended_well(&systemd, unit);
        }
        assert_eq!(robot.shared.others.load(Ordering::Relaxed), 0, "a robot that stands is told to stand");
        assert_shared_memory_is_free(&systemd);
    });
}

/// A sandbox of its own: what it needs of the network and no more, below the exposure of the daemon plus that.
#[test]
fn the_edge_s_exposure_is_the_daemon_s_and_its_network() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = Systemd::boot();
    systemd.run("deploy/install.sh");
    let exposure = |unit: &str| -> f64 {
        let said = systemd.run(&format!("systemd-analyze security --offline=true --threshold=20 {unit}"));
        let last = said.lines().last().unwrap_or_default().to_owned();
        println!("{last}");
        let level = last.split(": ").nth(1).and_then(|rest| rest.split_whitespace().next()).expect("a level");
        level.parse().unwrap_or_else(|_| panic!("{last}"))
    };
    let (daemon, edge) = (exposure(DAEMON), exposure(EDGE));
    assert!(edge > daemon && edge <= 2.0, "daemon {daemon}, edge {edge}");
}
