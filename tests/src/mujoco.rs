//! The arm of a scenario in MuJoCo, under the real daemon: `python/mujoco_plant`, in lock step over
//! shared memory through the Python package. The daemon's clock is driven by the plant, so that no sample is late on a busy
//! machine, and nothing here runs in real time.

use std::path::Path;
use std::time::Duration;

use serde::Deserialize;

use crate::driven_clock::DrivenClock;
use crate::session::{LOCK_STEP, daemon_command, start, with_keys, write};
use crate::{Child, PATIENCE, PrivateIpc, binaries, python_package};

/// A run of some seconds takes some more of Python's.
const RUN_PATIENCE: Duration = Duration::from_secs(600);

/// What was true at a sample, and what the daemon answered it.
#[derive(Debug, Clone, Deserialize)]
pub struct Sample {
    /// Scenario time in s.
    pub scenario_time_s: f64,
    /// m.
    pub tcp_position: [f64; 3],
    /// rad.
    pub joint_position: Vec<f64>,
    /// N.
    pub normal_force_n: f64,
    /// Since the last sample, N.
    pub peak_normal_force_n: f64,
    /// That the robot exerts on the environment, base frame, N.
    pub force: [f64; 3],
    /// The state sample, as the schema names its fields.
    pub state: serde_json::Value,
    /// By name.
    pub mode: String,
    /// By name.
    pub stop_reason: String,
    /// Cycles in which the last plan stood in for an answer, so far.
    pub fallback_count: u64,
}

/// Runs a scenario, whose start is a joint position, to the end of its motion; control is disabled by a
/// request at `disable_at_s` of it. Needs [`crate::Need::Python`] and [`crate::Need::CToolchain`].
///
/// # Panics
/// When daemon or plant do not start or do not end well.
pub fn run(config: &str, scenario: &str, disable_at_s: Option<f64>) -> Vec<Sample> {
    let ipc = PrivateIpc::new("mujoco");
    let clock = DrivenClock::new(&ipc);
    let config = write(&ipc, "daemon.toml", &with_keys(config, &LOCK_STEP));
    let mut daemon = daemon_command(&ipc, &config);
    clock.drive(&mut daemon);
    let mut daemon = start(&ipc, &mut daemon);
    let settings = ipc.settings();
    let mut plant = python_package::command(&ipc);
    plant.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("python/mujoco_plant"));
    plant.arg(write(&ipc, "scenario.toml", scenario)).arg(clock.file());
    plant.arg("--root-path").arg(&settings.root_path);
    plant.args(["--prefix", &settings.prefix, "--instance", settings.instance.as_str()]);
    if let Some(at_s) = disable_at_s {
        plant.args(["--disable-at-s", &at_s.to_string()]);
        plant.arg("--program").arg(&binaries().admittancectl).arg("--config").arg(config);
        plant.arg("--preload").arg(clock.library());
    }
    let mut plant = Child::spawn(&mut plant);
    let status = plant.wait_for_exit(RUN_PATIENCE);
    assert!(status.success(), "{}\n{}", plant.report(), daemon.report());
    daemon.terminate();
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    plant.stdout().lines().map(|line| serde_json::from_str(line).expect("a sample")).collect()
}
