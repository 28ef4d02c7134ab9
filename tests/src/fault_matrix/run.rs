//! One row in one situation, with real processes: repeated until only its fault disturbs it.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use admittance_host::clock::monotonic_ns;
use ipc_types::CommandSample;

use super::files::{daemon_file, scenario_file};
use super::leader::Leader;
use super::row::{Injection, Row, Said, Situation, Who};
use super::watch::{Seen, Watcher};
use super::{observe, recover};
use crate::c_controller::TruthRelay;
use crate::machine::{note, undisturbed};
use crate::session::{start_daemon, write};
use crate::{Child, Need, PATIENCE, PrivateIpc, needs};

/// When the fault comes, in s after the start of the motion: before the touch, or well after it.
pub(super) const FAULT_AT_S: [f64; 2] = [0.15, 0.45];
/// Duration of the motion in free motion, at a fifth of the speed: it does not reach the surface.
pub(super) const FREE_MOTION_S: f64 = 0.7;
/// How long the arm is watched at least before the recovery.
const WATCHED: Duration = Duration::from_millis(350);
/// After which a held arm stands still: ten of the slowest joint's time constants.
const STANDSTILL_AFTER: Duration = Duration::from_millis(150);
const POLL: Duration = Duration::from_millis(1);

/// The processes of a row and what is seen of them. Fields are dropped in this order: the place
/// last.
pub(super) struct Stage<'a> {
    pub(super) row: &'a Row,
    pub(super) situation: Situation,
    pub(super) daemon: Child,
    pub(super) plant: Child,
    pub(super) newcomer: Option<Child>,
    pub(super) watcher: Watcher,
    pub(super) leader: Leader,
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

/// How a run differs from its row.
pub(super) type Wrong = String;

/// Runs the row, again where a busy machine disturbed it; the figures are for a person.
///
/// # Panics
/// When what is seen is not what the row says.
pub fn run(row: &Row, situation: Situation) -> String {
    run_led_by(row, situation, |_| Leader::PlantSim)
}

/// The same with a motion controller in C.
///
/// # Panics
/// As [`run`].
pub fn run_in_c(row: &Row, situation: Situation) -> String {
    if !needs(Need::CToolchain) {
        return String::new();
    }
    run_led_by(row, situation, |ipc| Leader::C(TruthRelay::new(ipc)))
}

fn run_led_by(row: &Row, situation: Situation, leader: impl Fn(&PrivateIpc) -> Leader) -> String {
    if row.injection.needs_root() && !needs(Need::Root) {
        return String::new();
    }
    let report = undisturbed(|| {
        let mut stage = Stage::open(row, situation, &leader);
        let Err(wrong) = stage.play() else { return std::mem::take(&mut stage.report) };
        stage.log += &stage.daemon.stderr();
        if let Some(disturbance) = observe::disturbance(&stage) {
            note(disturbance);
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
    });
    report.unwrap_or_default()
}

impl<'a> Stage<'a> {
    fn open(row: &'a Row, situation: Situation, leader: impl Fn(&PrivateIpc) -> Leader) -> Self {
        let ipc = PrivateIpc::new("planar");
        let leader = leader(&ipc);
        let config = write(&ipc, "daemon.toml", &daemon_file(row));
        let daemon = start_daemon(&ipc, &config);
        let watcher = Watcher::new(ipc.settings());
        let scenario = write(&ipc, "scenario.toml", &scenario_file(row, situation));
        let plant = leader.start(&ipc, &scenario);
        Self {
            row,
            situation,
            daemon,
            plant,
            newcomer: None,
            watcher,
            leader,
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
        let Some((command, truth, stamp)) = before else {
            // Who watches has no priority, and may have opened its ports too late: nothing is known of such a run.
            if !self.watcher.seen().truths.iter().any(|truth| truth.scenario_time_s < at) {
                note("the plant was seen too late".to_owned());
            }
            return Err("nothing was seen before the fault".to_owned());
        };
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
        // Other commands end the wait as well: they are told apart below.
        self.wait(&format!("the commands say {:?}", expected.command), |seen| {
            let found = observe::states(seen.commands_within(fault, u64::MAX));
            observe::agrees(&found, expected) || found.iter().any(|said| !expected.command.contains(said))
        })?;
        // The joints coast.
        std::thread::sleep(STANDSTILL_AFTER);
        self.await_newcomer();
        // The pressing may have ended while a slow machine started it.
        let is_over = self.situation == Situation::Contact && self.watcher.seen().time() >= self.row.timeline.press;
        self.too_late |= self.newcomer.is_some() && is_over;
        while Instant::now() < watched {
            std::thread::sleep(POLL);
        }
        let instants = Instants { fault, recovery: monotonic_ns() };
        observe::check(self, &instants, (&command, &truth))?;
        recover::recover(self)?;
        self.end(&command)
    }

    /// Asks both to end, and checks the whole run.
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

    /// Sends SIGHUP and waits for the daemon's answer.
    pub(super) fn reload(&mut self) -> Result<(), Wrong> {
        let answers = |log: &str| log.matches("reload: ").count() + log.matches("reload refused: ").count();
        let before = answers(&self.daemon.stderr());
        self.daemon.signal(libc::SIGHUP);
        self.daemon.wait_until("an answer to SIGHUP", PATIENCE, |child| answers(&child.stderr()) > before);
        Ok(())
    }

    pub(super) fn await_newcomer(&mut self) {
        if let Some(newcomer) = &mut self.newcomer {
            newcomer.wait_for_exit(PATIENCE);
        }
    }
}
