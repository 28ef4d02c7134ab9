//! One row in one situation, through real processes: until nothing disturbs it but its fault.

use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use admittance_host::clock::monotonic_ns;
use iceoryx2::prelude::{ServiceName, ZeroCopySend};
use ipc_types::{CommandSample, Instance, services};

use super::row::{Disk, Injection, Newcomer, Row, Said, Signal, Situation, Who};
use super::watch::{Seen, Watcher};
use super::{DAEMON_KEYS, SCRIPTED_S, observe, recover};
use crate::closed_loop::MPC_DEFAULT;
use crate::session::{
    PAPER_SCENARIO, TRIES, ctl_command, daemon_command, output, plant_command, start_daemon, with_keys, write,
};
use crate::{Child, Need, PATIENCE, PrivateIpc, needs};

/// When the fault comes, in s after the start of the motion: before the touch, or well after it.
pub(super) const FAULT_AT_S: [f64; 2] = [0.15, 0.45];
/// When the arm touches.
const TOUCH_AT_S: &str = "0.2";
/// Duration of the motion in free motion, at a fifth of the speed: it does not reach the surface.
pub(super) const FREE_MOTION_S: f64 = 0.7;
/// How long the arm is watched at least before the recovery.
const WATCHED: Duration = Duration::from_millis(350);
/// After which a held arm stands still: ten of the slowest joint's time constants.
const STANDSTILL_AFTER: Duration = Duration::from_millis(150);
const POLL: Duration = Duration::from_millis(1);

/// The processes of a row and what is seen of them. Fields are dropped in this order: the place last.
pub(super) struct Stage<'a> {
    pub(super) row: &'a Row,
    pub(super) situation: Situation,
    pub(super) daemon: Child,
    pub(super) plant: Child,
    pub(super) newcomer: Option<Child>,
    pub(super) watcher: Watcher,
    /// What ended daemons wrote.
    pub(super) log: String,
    /// A phase of the motion was over before its step of the recovery was taken.
    pub(super) too_late: bool,
    /// Figures of the run.
    pub(super) report: String,
    pub(super) config: PathBuf,
    pub(super) ipc: PrivateIpc,
}

/// When things happened, ns of CLOCK_MONOTONIC.
#[derive(Debug, Clone, Copy)]
pub(super) struct Instants {
    pub(super) fault: u64,
    pub(super) recovery: u64,
}

/// A run that is not what the row says.
pub(super) type Wrong = String;

/// Runs the row, again where a busy machine disturbed it; the figures are for a person.
///
/// # Panics
/// When what is seen is not what the row says.
pub fn run(row: &Row, situation: Situation) -> String {
    if row.injection.needs_root() && !needs(Need::Root) {
        return String::new();
    }
    for _ in 0..TRIES {
        let mut stage = Stage::open(row, situation);
        let Err(wrong) = stage.play() else { return std::mem::take(&mut stage.report) };
        stage.log += &stage.daemon.stderr();
        let disturbed = observe::disturbance(&stage);
        if let Some(disturbance) = disturbed {
            println!("{} in {}: disturbed by the machine ({disturbance}): {wrong}", row.name, situation.name());
            continue;
        }
        let (states, time) = {
            let seen = stage.watcher.seen();
            (observe::states(seen.commands.values()), seen.time())
        };
        let newcomer = stage.newcomer.as_mut().map_or_else(String::new, Child::report);
        let (row, situation, plant) = (row.name, situation.name(), stage.plant.report());
        panic!(
            "{row} in {situation}: {wrong}\nstates: {states:?}\ntime {time:.3} s\n{}\n{plant}\n{newcomer}",
            stage.log
        );
    }
    println!("SKIPPED: machine too busy for {} in {}: disturbed in {TRIES} runs", row.name, situation.name());
    String::new()
}

/// The daemon's file of a row.
pub(super) fn daemon_file(row: &Row) -> String {
    with_keys(MPC_DEFAULT, &[&DAEMON_KEYS[..], row.daemon].concat())
}

/// The daemon's file without what is wrong in it.
pub(super) fn sound_daemon_file() -> String {
    with_keys(MPC_DEFAULT, &DAEMON_KEYS)
}

/// The scenario of a row.
pub(super) fn scenario_file(row: &Row, situation: Situation) -> String {
    scenario(row, situation, row.scenario(situation))
}

/// The scenario without what is wrong in it.
pub(super) fn sound_scenario_file(row: &Row, situation: Situation) -> String {
    scenario(row, situation, &[])
}

fn scenario(row: &Row, situation: Situation, keys: &[(&str, &str)]) -> String {
    let line = row.timeline;
    let (motion, touch) = match situation {
        Situation::Free => {
            let speed = line.approach * 0.2;
            (
                format!(
                    "{{ duration_s = {FREE_MOTION_S:?}, twist = [0.0, {:?}] }}, {{ duration_s = 60.0, twist = [0.0, 0.0] }}",
                    -speed
                ),
                // As the scenario's guess stands: 14 cm above the surface.
                None,
            )
        }
        Situation::Contact => (
            format!(
                "{{ duration_s = {:?}, twist = [0.0, {:?}] }}, {{ duration_s = {:?}, twist = [0.016, 0.036] }}, \
                 {{ duration_s = {:?}, twist = [0.0, 0.0] }}, {{ duration_s = 60.0, twist = [0.0, -0.1] }}",
                line.press, -line.approach, line.retreat, line.rest
            ),
            Some(TOUCH_AT_S),
        ),
    };
    let motion = format!("[{motion}]");
    let fault = match row.injection {
        Injection::Scripted(kind) => {
            let at = FAULT_AT_S[usize::from(situation == Situation::Contact)];
            format!("[{{ at_s = {at:?}, duration_s = {SCRIPTED_S:?}, kind = \"{kind}\" }}]")
        }
        _ => "[]".to_owned(),
    };
    let own = [
        ("motion", motion.as_str()),
        ("fault", &fault),
        ("timing.settle_s", "0.05"),
        ("timing.command_delay_s", "0.001"),
    ];
    let mut text = with_keys(PAPER_SCENARIO, &own);
    if let Some(touch) = touch {
        text = with_keys(&text, &[("start.contact_time_s", touch)]);
    } else {
        let mut table: toml::Table = text.parse().expect("TOML");
        table["start"].as_table_mut().expect("a section").remove("contact_time_s");
        text = table.to_string();
    }
    with_keys(&text, keys)
}

impl<'a> Stage<'a> {
    fn open(row: &'a Row, situation: Situation) -> Self {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &daemon_file(row));
        let daemon = start_daemon(&ipc, &config);
        let watcher = Watcher::new(ipc.settings());
        let scenario = write(&ipc, "scenario.toml", &scenario_file(row, situation));
        let plant = Child::spawn(&mut plant_command(&ipc, &scenario));
        Self {
            row,
            situation,
            daemon,
            plant,
            newcomer: None,
            watcher,
            log: String::new(),
            too_late: false,
            report: String::new(),
            config,
            ipc,
        }
    }

    fn play(&mut self) -> Result<(), Wrong> {
        let expected = self.row.expected(self.situation);
        let from_start = self.row.injection == Injection::FromStart;
        let at = if from_start { 0.0 } else { FAULT_AT_S[usize::from(self.situation == Situation::Contact)] };
        self.wait("the fault's time", |seen| seen.time() >= at)?;
        let undisturbed = if from_start { super::row::FREE } else { self.situation.undisturbed() };
        let before = {
            let seen = self.watcher.seen();
            let stamp = seen.truths.iter().find(|truth| truth.scenario_time_s >= at).map_or(0, |truth| truth.stamp_ns);
            // What answers the samples before is under way.
            let command = seen.commands_within(stamp, stamp).next().copied();
            let truth = seen.truths.iter().rev().find(|truth| truth.scenario_time_s < at).copied();
            command.zip(truth).map(|(command, truth)| (command, truth, stamp))
        };
        let Some((command, truth, stamp)) = before else { return Err("nothing was seen before the fault".to_owned()) };
        if Said::of(&command) != Some(undisturbed) {
            return Err(format!("before the fault the command says {:?}", Said::of(&command)));
        }
        let fault = if matches!(self.row.injection, Injection::Scripted(_) | Injection::FromStart) {
            stamp
        } else {
            monotonic_ns()
        };
        self.inject()?;
        let watched = Instant::now() + WATCHED;
        // Something else ends the wait as well: it is told apart below.
        self.wait(&format!("the commands say {:?}", expected.command), |seen| {
            let found = observe::states(seen.commands_within(fault, u64::MAX));
            observe::agrees(&found, expected) || found.iter().any(|said| !expected.command.contains(said))
        })?;
        // The joints coast.
        std::thread::sleep(STANDSTILL_AFTER);
        self.await_newcomer();
        while Instant::now() < watched {
            std::thread::sleep(POLL);
        }
        let instants = Instants { fault, recovery: monotonic_ns() };
        observe::check(self, &instants, (&command, &truth))?;
        recover::recover(self)?;
        self.end(&command)
    }

    /// Asks both to end, and looks at the whole of it.
    fn end(&mut self, before: &CommandSample) -> Result<(), Wrong> {
        observe::check_counts(self, before)?;
        self.daemon.terminate();
        let code = self.daemon.wait_for_exit(PATIENCE).code();
        if code != Some(0) {
            return Err(format!("asked to end, the daemon ends with {code:?}"));
        }
        self.plant.terminate();
        let code = self.plant.wait_for_exit(PATIENCE).code();
        if code != Some(0) {
            return Err(format!("asked to end, the plant ends with {code:?}"));
        }
        observe::check_all(self)
    }

    /// Waits until `condition` holds of what is seen.
    pub(super) fn wait(&mut self, what: &str, condition: impl Fn(&Seen) -> bool) -> Result<(), Wrong> {
        let end = Instant::now() + Duration::from_secs(10);
        while !condition(&self.watcher.seen()) {
            if Instant::now() > end {
                return Err(format!("waited for: {what}"));
            }
            std::thread::sleep(POLL);
        }
        Ok(())
    }

    pub(super) fn process(&mut self, who: Who) -> &mut Child {
        match who {
            Who::Daemon => &mut self.daemon,
            Who::Plant => &mut self.plant,
            Who::Newcomer => self.newcomer.as_mut().expect("the row starts one"),
        }
    }

    /// Starts the daemon anew, in place of one that has ended.
    pub(super) fn start_daemon(&mut self) {
        self.log += &self.daemon.stderr();
        self.daemon = start_daemon(&self.ipc, &self.config);
    }

    fn inject(&mut self) -> Result<(), Wrong> {
        match self.row.injection {
            Injection::Scripted(_) | Injection::FromStart => {}
            Injection::Signal(who, Signal::Kill) => {
                self.process(who).signal(libc::SIGKILL);
                self.process(who).wait_for_exit(PATIENCE);
            }
            Injection::Signal(who, Signal::Stop) => self.process(who).signal(libc::SIGSTOP),
            Injection::Restart => {
                self.daemon.terminate();
                let code = self.daemon.wait_for_exit(PATIENCE).code();
                if code != Some(0) {
                    return Err(format!("the daemon ends with {code:?}"));
                }
                self.start_daemon();
            }
            Injection::Start(newcomer) => self.start_newcomer(newcomer)?,
            Injection::RemoveRoot => {
                std::fs::remove_dir_all(&self.ipc.settings().root_path).map_err(|error| error.to_string())?;
                self.newcomer = Some(Child::spawn(&mut ctl_command(&self.ipc, "status", &self.config)));
            }
            Injection::Record(disk) => self.record(disk)?,
            Injection::Request(words) => {
                let mut command = ctl_command(&self.ipc, words[0], &self.config);
                let (code, text) = output(command.args(&words[1..]));
                if code != Some(0) {
                    return Err(format!("{words:?} ends with {code:?}: {text}"));
                }
            }
            Injection::ReloadText(text) => {
                write(&self.ipc, "daemon.toml", text);
                self.reload()?;
            }
            Injection::ReloadKeys(keys) => {
                write(&self.ipc, "daemon.toml", &with_keys(&daemon_file(self.row), keys));
                self.reload()?;
            }
        }
        Ok(())
    }

    /// SIGHUP, and what the daemon says to it.
    pub(super) fn reload(&mut self) -> Result<(), Wrong> {
        let answers = |log: &str| log.matches("reload: ").count() + log.matches("reload refused: ").count();
        let before = answers(&self.daemon.stderr());
        self.daemon.signal(libc::SIGHUP);
        self.daemon.wait_until("an answer to SIGHUP", PATIENCE, |child| answers(&child.stderr()) > before);
        Ok(())
    }

    fn other_daemon(&self) -> Command {
        let mut command = daemon_command(&self.ipc, &self.config);
        command.args(["--instance", "other"]);
        command
    }

    fn start_newcomer(&mut self, newcomer: Newcomer) -> Result<(), Wrong> {
        let mut command = match newcomer {
            Newcomer::SameInstance => daemon_command(&self.ipc, &self.config),
            Newcomer::ForeignSize => return self.start_beside_foreign::<ShortStateSample>(),
            Newcomer::ForeignVersion => return self.start_beside_foreign::<EarlierStateSample>(),
            Newcomer::FullSharedMemory => with_mount("/dev/shm", "16m", &self.other_daemon()),
        };
        self.newcomer = Some(Child::spawn(&mut command));
        Ok(())
    }

    /// This process is the foreign one.
    fn start_beside_foreign<T: std::fmt::Debug + ZeroCopySend>(&mut self) -> Result<(), Wrong> {
        let node = self.ipc.settings().node("foreign").map_err(|error| error.to_string())?;
        let instance = Instance::new("other").map_err(|error| error.to_string())?;
        let name = ServiceName::new(&services::STATE.service_name(&instance)).map_err(|error| format!("{error:?}"))?;
        let service = node.service_builder(&name).publish_subscribe::<T>().create();
        let _service = service.map_err(|error| format!("the foreign service: {error:?}"))?;
        self.newcomer = Some(Child::spawn(&mut self.other_daemon()));
        self.await_newcomer();
        Ok(())
    }

    fn record(&mut self, disk: Disk) -> Result<(), Wrong> {
        let directory = self.ipc.directory().join("recordings");
        let mut command = ctl_command(&self.ipc, "record", &self.config);
        command.arg(directory.join("contact.mcap"));
        let mut command = match disk {
            Disk::Missing => command,
            Disk::Full => {
                std::fs::create_dir(&directory).map_err(|error| error.to_string())?;
                with_mount(&directory.to_string_lossy(), "64k", &command)
            }
        };
        self.newcomer = Some(Child::spawn(&mut command));
        Ok(())
    }

    fn await_newcomer(&mut self) {
        if let Some(newcomer) = &mut self.newcomer {
            newcomer.wait_for_exit(PATIENCE);
        }
    }
}

/// The command in a mount namespace of its own, in which a file system of this size is mounted at `place`.
fn with_mount(place: &str, size: &str, command: &Command) -> Command {
    let script = "mount -t tmpfs -o \"size=$1\" tmpfs \"$2\" && shift 2 && exec \"$@\"";
    let mut mounted = Command::new("unshare");
    mounted.args(["--mount", "--propagation", "private", "--", "sh", "-c", script, "sh", size, place]);
    mounted.arg(command.get_program()).args(command.get_args());
    mounted
}

/// The right name with another size.
#[repr(C)]
#[derive(Debug, ZeroCopySend)]
#[type_name("admittanced.StateSample.v1")]
struct ShortStateSample {
    bytes: [u64; 41],
}

/// The right size of another schema version.
#[repr(C)]
#[derive(Debug, ZeroCopySend)]
#[type_name("admittanced.StateSample.v0")]
struct EarlierStateSample {
    bytes: [u64; 42],
}
