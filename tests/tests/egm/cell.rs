//! Daemon and edge of one robot as processes, and the emulated robot that is run against them.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::Command;

use end_to_end::session::{ctl_command, drive_plant_by, plant_command, start_daemon, wait_for_log, with_keys, write};
use end_to_end::{Child, PrivateIpc, binaries};
use ipc_types::TruthSample;

pub(crate) const DAEMON: &str = include_str!("../../../deploy/egm/six-joint.toml");
pub(crate) const EDGE: &str = include_str!("../../../deploy/egm/six-joint.egm.toml");
pub(crate) const SCENARIO: &str = include_str!("../../../plant-sim/scenarios/six-joint-egm.toml");
/// f_max in N, and what the linear model may miss of it.
pub(crate) const MOST: f64 = 150.0 + 0.5;

/// What the programs are told.
#[derive(Debug, Clone)]
pub(crate) struct Files {
    pub(crate) daemon: String,
    pub(crate) edge: String,
    pub(crate) scenario: String,
}

impl Files {
    /// What is shipped, on this host, with what a machine needs that is busy with other tests.
    pub(crate) fn shipped() -> Self {
        let daemon = [
            ("control.answer_budget_s", "0.0028"),
            ("control.max_sample_age_s", "0.1"),
            ("realtime.lock_memory", "false"),
            ("realtime.priority", "0"),
        ];
        let edge = [
            ("egm.listen", "\"127.0.0.1:0\""),
            ("egm.robot_address", "\"127.0.0.1\""),
            ("realtime.lock_memory", "false"),
            ("realtime.priority", "0"),
        ];
        Self { daemon: with_keys(DAEMON, &daemon), edge: with_keys(EDGE, &edge), scenario: SCENARIO.to_owned() }
    }

    /// The same with a daemon that bears more cycles without its answer than are shipped.
    pub(crate) fn patient() -> Self {
        let mut files = Self::shipped();
        files.daemon = with_keys(&files.daemon, &[("control.max_consecutive_fallbacks", "20")]);
        files
    }

    /// With the priorities and the age of a sample that are shipped: other programs do not hold these up. Who has no
    /// right to them runs as ever.
    pub(crate) fn real_time(mut self) -> Self {
        for (file, priority) in [(&mut self.daemon, "85"), (&mut self.edge, "86"), (&mut self.scenario, "80")] {
            *file = with_keys(file, &[("realtime.priority", priority)]);
        }
        let shipped: toml::Table = DAEMON.parse().expect("the shipped file is TOML");
        let age_s = shipped["control"]["max_sample_age_s"].to_string();
        self.daemon = with_keys(&self.daemon, &[("control.max_sample_age_s", &age_s)]);
        self.scenario = with_keys(&self.scenario, &[("realtime.cpu", "0")]);
        self
    }
}

/// Daemon and edge of one robot.
pub(crate) struct Cell {
    pub(crate) ipc: PrivateIpc,
    pub(crate) edge: Child,
    pub(crate) daemon: Child,
    /// Where the edge awaits the robot.
    pub(crate) port: u16,
    scenario: String,
    daemon_file: PathBuf,
}

impl Cell {
    pub(crate) fn start() -> Self {
        Self::of(&Files::patient())
    }

    pub(crate) fn of(files: &Files) -> Self {
        Self::with_edge(files, &mut Command::new(&binaries().admittance_egm))
    }

    /// With another program in the edge's place, which takes the same arguments.
    pub(crate) fn with_edge(files: &Files, edge: &mut Command) -> Self {
        let ipc = PrivateIpc::new("egm");
        let daemon_file = write(&ipc, "daemon.toml", &files.daemon);
        tell_edge(edge, &ipc, &write(&ipc, "edge.toml", &files.edge), &daemon_file);
        let daemon = start_daemon(&ipc, &daemon_file);
        let mut edge = Child::spawn(edge);
        wait_for_log(&mut edge, "awaits 127.0.0.1 on 127.0.0.1:");
        let log = edge.stderr();
        let port =
            log.split("on 127.0.0.1:").nth(1).and_then(|rest| rest.split([',', ' ', '\n']).next()).expect("a port");
        let port = port.parse().expect("a port is a number");
        Self { port, ipc, edge, daemon, scenario: files.scenario.clone(), daemon_file }
    }

    /// Starts another daemon once the last one has ended.
    pub(crate) fn start_another_daemon(&mut self) {
        self.daemon = start_daemon(&self.ipc, &self.daemon_file);
    }

    /// A command of admittancectl to this daemon.
    pub(crate) fn ctl(&self, command: &str) -> Command {
        ctl_command(&self.ipc, command, &self.daemon_file)
    }

    /// The emulated robot, whose messages go to `edge`.
    pub(crate) fn plant(&self, changes: &[(&str, &str)], edge: SocketAddr) -> Command {
        let scenario = write(&self.ipc, "scenario.toml", &with_keys(&self.scenario, changes));
        let mut command = plant_command(&self.ipc, &scenario);
        command.args(["--egm", &edge.to_string()]);
        command
    }

    /// Where the edge awaits the robot.
    pub(crate) fn address(&self) -> SocketAddr {
        SocketAddr::from(([127, 0, 0, 1], self.port))
    }

    /// Runs the emulated robot to its end; `each` sees every truth. What it said comes as well.
    pub(crate) fn run(
        &mut self,
        changes: &[(&str, &str)],
        each: impl FnMut(&mut Self, &mut Child, &TruthSample),
    ) -> (Vec<TruthSample>, String) {
        let address = self.address();
        self.run_by(changes, address, each)
    }

    /// The same where the robot's messages go to `edge`.
    pub(crate) fn run_by(
        &mut self,
        changes: &[(&str, &str)],
        edge: SocketAddr,
        mut each: impl FnMut(&mut Self, &mut Child, &TruthSample),
    ) -> (Vec<TruthSample>, String) {
        let mut plant = Child::spawn(&mut self.plant(changes, edge));
        let ipc = self.ipc.settings().clone();
        let truths = drive_plant_by(&ipc, &mut plant, |plant, truth| each(self, plant, truth));
        (truths, plant.stderr())
    }
}

/// The arguments of an edge between these files in this place.
pub(crate) fn tell_edge(command: &mut Command, ipc: &PrivateIpc, edge: &std::path::Path, daemon: &std::path::Path) {
    let settings = ipc.settings();
    command.arg("--config").arg(edge).arg("--daemon-config").arg(daemon);
    command.arg("--root-path").arg(&settings.root_path);
    command.args(["--prefix", &settings.prefix, "--instance", settings.instance.as_str()]);
}

/// Speed of the fastest joint, rad/s.
pub(crate) fn fastest(truth: &TruthSample) -> f64 {
    truth.joint_velocity.iter().fold(0.0, |most, speed| speed.abs().max(most))
}

/// Largest true normal force, N.
pub(crate) fn peak(truths: &[TruthSample]) -> f64 {
    truths.iter().map(|truth| truth.peak_normal_force_n).fold(0.0, f64::max)
}
