//! Two machines on one: network namespaces with a cable between them, of which the far one has shared memory and a clock of its
//! own as well.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::child::{Child, PATIENCE};

/// By so much the far machine's CLOCK_MONOTONIC is ahead, s.
const CLOCK_AHEAD_S: u32 = 100_000;

/// One end of the cable, as long as it lives.
#[derive(Debug)]
pub struct Machine {
    /// It does nothing: the namespaces are its.
    holder: Child,
    /// The process in the namespaces.
    id: u32,
    /// What begins each command there: into which namespaces, and where it runs.
    entered: &'static [&'static str],
}

/// Two machines with a cable: 192.168.7.1 and, with memory and clock of its own, 192.168.7.2.
///
/// # Panics
/// When the system lacks something of that: see `Need::Tunnel`.
pub fn two_machines() -> (Machine, Machine) {
    let robots = Machine::with(&["--net"], &["--net", "--"], "true");
    let clock = CLOCK_AHEAD_S.to_string();
    let far = Machine::with(
        &["--net", "--mount", "--time", "--monotonic", &clock],
        // Another machine does not take time on the processor of the daemon, which is 1 in the shipped files.
        &["--net", "--mount", "--time", "--", "taskset", "--cpu-list", "0"],
        "mount -t tmpfs tmpfs /dev/shm",
    );
    let (one, other) = (robots.id.to_string(), far.id.to_string());
    let cable = ["link", "add", "cable", "netns", &one, "type", "veth", "peer", "name", "cable", "netns", &other];
    run(Command::new("ip").args(cable));
    for (machine, address) in [(&robots, "192.168.7.1/24"), (&far, "192.168.7.2/24")] {
        run(machine.command(Path::new("ip")).args(["address", "add", address, "dev", "cable"]));
        for device in ["lo", "cable"] {
            run(machine.command(Path::new("ip")).args(["link", "set", device, "up"]));
        }
    }
    (robots, far)
}

impl Machine {
    fn with(unshared: &[&str], entered: &'static [&'static str], first: &str) -> Self {
        let mut command = Command::new("unshare");
        command.args(unshared).args(["--fork", "--kill-child", "sh", "-c"]);
        command.arg(format!("{first} && echo ready && exec sleep 1000000"));
        let mut holder = Child::spawn(&mut command);
        holder.wait_until("the namespaces are there", PATIENCE, |holder| holder.stdout().contains("ready"));
        let children = format!("/proc/{0}/task/{0}/children", holder.id());
        let children = std::fs::read_to_string(children).expect("the holder runs");
        let id = children.split_whitespace().next().and_then(|id| id.parse().ok()).expect("it has a child");
        Self { holder, id, entered }
    }

    /// A program that runs there.
    pub fn command(&self, program: &Path) -> Command {
        let mut command = Command::new("nsenter");
        command.args(["--target", &self.id.to_string()]).args(self.entered).arg(program);
        command
    }

    /// Whether it is still there.
    pub fn is_up(&mut self) -> bool {
        self.holder.exit_status().is_none()
    }
}

fn run(command: &mut Command) {
    let output = command.stdin(Stdio::null()).output().expect("the program starts");
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
}
