//! The shipped programs as processes of a test: files with changed keys, a daemon, a plant, the
//! plant's truth.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use ipc_types::services::{self, Access};
use ipc_types::{IpcSettings, TruthSample};

use crate::{Child, PATIENCE, PrivateIpc, binaries};

/// The paper's scenario.
pub const PAPER_SCENARIO: &str = include_str!("../../plant-sim/scenarios/paper.toml");
/// The paper's MPC.
pub const MPC_PAPER: &str = include_str!("../../deploy/demo/mpc-paper.toml");

/// A key that makes the paper's contact infeasible as soon as both axes are in it: on the plane,
/// f_x = f_y tan 25°, and 100 N in x are more than the 200 N allowed in y.
pub const CONTRADICTION: (&str, &str) = ("contact.minimum_force", "[100.0, 0.1]");

/// Keys that let the daemon bear a machine that is busy for some cycles, in tests that are not
/// about that.
pub const PATIENT: [(&str, &str); 3] = [
    ("control.max_sample_age_s", "0.1"),
    ("control.answer_budget_s", "0.0035"),
    ("control.max_consecutive_fallbacks", "20"),
];

/// Keys of a daemon that runs by a clock that stands still: it blocks until it is woken.
pub const LOCK_STEP: [(&str, &str); 3] =
    [("control.wait", "\"event\""), ("realtime.priority", "0"), ("realtime.lock_memory", "false")];

/// A TOML text with keys changed or added, each given as "section.key" and a TOML value.
///
/// # Panics
/// When the text, a path or a value is not what it should be.
pub fn with_keys(text: &str, changes: &[(&str, &str)]) -> String {
    let mut table: toml::Table = text.parse().expect("the shipped file is TOML");
    for (path, value) in changes {
        let parsed: toml::Table = format!("value = {value}").parse().expect("the test gives a TOML value");
        let (sections, key) = path.rsplit_once('.').unwrap_or(("", path));
        let mut section = &mut table;
        for name in sections.split('.').filter(|name| !name.is_empty()) {
            section = section.get_mut(name).and_then(toml::Value::as_table_mut).expect("the section exists");
        }
        section.insert((*key).to_owned(), parsed["value"].clone());
    }
    table.to_string()
}

/// Writes a file of the test's own.
///
/// # Panics
/// When it cannot be written.
pub fn write(ipc: &PrivateIpc, name: &str, text: &str) -> PathBuf {
    let path = ipc.directory().join(name);
    std::fs::write(&path, text).expect("the private directory can be written");
    path
}

fn place(command: &mut Command, ipc: &PrivateIpc) {
    let settings = ipc.settings();
    command.arg("--root-path").arg(&settings.root_path);
    command.args(["--prefix", &settings.prefix, "--instance", settings.instance.as_str()]);
}

/// A command line of admittanced for this configuration.
pub fn daemon_command(ipc: &PrivateIpc, config: &Path) -> Command {
    let mut command = Command::new(&binaries().admittanced);
    command.arg("--config").arg(config);
    place(&mut command, ipc);
    command
}

/// A running daemon that serves requests.
///
/// # Panics
/// When it does not start.
pub fn start_daemon(ipc: &PrivateIpc, config: &Path) -> Child {
    start(ipc, &mut daemon_command(ipc, config))
}

/// Starts a daemon by its command line, and waits until it serves requests.
///
/// # Panics
/// When it does not start.
pub fn start(ipc: &PrivateIpc, command: &mut Command) -> Child {
    let mut daemon = Child::spawn(command);
    let node = ipc.settings().node("test").expect("a node");
    daemon.wait_until("the daemon serves requests", PATIENCE, |_| {
        services::request(&node, &ipc.settings().instance, Access::Open).is_ok()
    });
    daemon
}

/// A command line of plant-sim for this scenario.
pub fn plant_command(ipc: &PrivateIpc, scenario: &Path) -> Command {
    let mut command = Command::new(&binaries().plant_sim);
    command.arg("--scenario").arg(scenario);
    place(&mut command, ipc);
    command
}

/// Exit code and output of a program.
///
/// # Panics
/// When it does not start.
pub fn output(command: &mut Command) -> (Option<i32>, String) {
    let Output { status, stdout, stderr } = command.output().expect("the program starts");
    (status.code(), format!("{}{}", String::from_utf8_lossy(&stdout), String::from_utf8_lossy(&stderr)))
}

/// A command line of admittancectl about this daemon.
pub fn ctl_command(ipc: &PrivateIpc, subcommand: &str, config: &Path) -> Command {
    let mut command = Command::new(&binaries().admittancectl);
    command.arg(subcommand).arg("--config").arg(config);
    place(&mut command, ipc);
    command
}

/// Runs a plant to its end while `each` sees every truth sample.
///
/// # Panics
/// When the plant does not start or does not end well.
pub fn run_plant(ipc: &PrivateIpc, scenario: &Path, mut each: impl FnMut(&TruthSample)) -> Vec<TruthSample> {
    drive_plant(ipc, scenario, |_, truth| each(truth))
}

/// Runs a plant to its end like [`run_plant`]; `each` may do something to it as well.
///
/// # Panics
/// As [`run_plant`].
pub fn drive_plant(ipc: &PrivateIpc, scenario: &Path, each: impl FnMut(&mut Child, &TruthSample)) -> Vec<TruthSample> {
    drive_plant_by(ipc.settings(), &mut Child::spawn(&mut plant_command(ipc, scenario)), each)
}

/// Sees a plant that was just started to its end like [`drive_plant`].
///
/// # Panics
/// As [`run_plant`].
pub fn drive_plant_by(
    settings: &IpcSettings,
    plant: &mut Child,
    mut each: impl FnMut(&mut Child, &TruthSample),
) -> Vec<TruthSample> {
    let node = settings.node("test").expect("a node");
    let mut service = None;
    plant.wait_until("the plant publishes its truth", PATIENCE, |_| {
        service = services::truth(&node, &settings.instance, Access::Open).ok();
        service.is_some()
    });
    let truths = service.expect("just opened").subscriber().expect("a subscriber");
    let mut series = Vec::new();
    loop {
        let ended = plant.exit_status();
        while let Ok(Some(truth)) = truths.receive() {
            each(plant, &truth);
            series.push(*truth);
        }
        if let Some(status) = ended {
            assert!(status.success(), "{}", plant.report());
            let missed = series.iter().filter(|truth: &&TruthSample| truth.missed == 1 && truth.scenario_time_s >= 0.0);
            let missed = missed.count();
            if missed > 0 {
                crate::machine::note(format!("{missed} commands were missed"));
            }
            return series;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The truths up to this time of the scenario in s, such as the end of its motion: what comes after
/// it is the plant's retreat from the surface.
pub fn until(truths: &[TruthSample], time_s: f64) -> &[TruthSample] {
    &truths[..truths.partition_point(|truth| truth.scenario_time_s <= time_s + 1e-6)]
}

/// Waits until the log of a child contains `text`.
///
/// # Panics
/// When it does not in time.
pub fn wait_for_log(child: &mut Child, text: &str) {
    child.wait_until(text, PATIENCE, |child| child.stderr().contains(text));
}
