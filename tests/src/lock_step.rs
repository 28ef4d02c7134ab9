//! The real daemon and the real plant-sim in lock step: both run by a clock that stands still until
//! the next sample is due, and is set when the last one has been answered. No answer is late,
//! however busy the machine is; the same files give the same run.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use admittance_core::quantities::Span;
use admittance_host::config::parse;
use ipc_types::services::{self, Access};
use ipc_types::{CommandSample, StateSample, TruthSample};
use plant_sim::scenario::Scenario;

use crate::driven_clock::{DrivenClock, Hands};
use crate::session::{LOCK_STEP, ctl_command, daemon_command, output, plant_command, start, with_keys, write};
use crate::{Child, PATIENCE, PrivateIpc};

/// From plant-sim's start to its first sample, ns.
const FIRST_NS: u64 = 10_000_000;
/// It may take so long to look at the clock.
const STARTING: Duration = Duration::from_millis(500);
/// Between two looks for what comes next.
const LOOK: Duration = Duration::from_micros(20);

/// A sample, its answer, and what was true then.
#[derive(Debug, Clone)]
pub struct Moment {
    /// The sample.
    pub state: StateSample,
    /// The answer.
    pub command: CommandSample,
    /// With the peaks since the sample before.
    pub truth: TruthSample,
}

/// A daemon by a clock of its own.
#[derive(Debug)]
pub struct LockStep {
    /// The daemon.
    pub daemon: Child,
    config: PathBuf,
    clock: DrivenClock,
    ipc: PrivateIpc,
}

impl LockStep {
    /// Starts a daemon with this configuration, but for what a clock that stands still asks for.
    ///
    /// # Panics
    /// When it does not start.
    pub fn new(config: &str) -> Self {
        let ipc = PrivateIpc::new("lock-step");
        let clock = DrivenClock::new(&ipc);
        let config = write(&ipc, "daemon.toml", &with_keys(config, &LOCK_STEP));
        let mut daemon = daemon_command(&ipc, &config);
        clock.drive(&mut daemon);
        Self { daemon: start(&ipc, &mut daemon), config, clock, ipc }
    }

    /// Where files of the test may be.
    pub fn directory(&self) -> &Path {
        self.ipc.directory()
    }

    /// A command line of admittancectl about this daemon, by its clock: what it asks is not overdue.
    pub fn ctl(&self, words: &[&str]) -> Command {
        let mut command = ctl_command(&self.ipc, words[0], &self.config);
        self.clock.drive(command.args(&words[1..]));
        command
    }

    /// What admittancectl says to this.
    ///
    /// # Panics
    /// When it fails.
    pub fn ask(&self, words: &[&str]) -> String {
        let (code, text) = output(&mut self.ctl(words));
        assert_eq!(code, Some(0), "{words:?}: {text}");
        text
    }

    /// Runs plant-sim with this scenario to the end of its motion, and then until it has left the surface; `each`
    /// sees every moment of the motion, while the clock stands.
    ///
    /// # Panics
    /// When plant-sim does not start or does not end well, or a sample is not answered.
    pub fn run(&mut self, scenario: &str, mut each: impl FnMut(&Self, &Moment)) -> Vec<Moment> {
        let parsed: Scenario = parse(scenario, "scenario.toml").expect("the scenario is valid");
        let period = Span::from_seconds(parsed.timing.sampling_time_s).nanoseconds();
        let end_s: f64 = parsed.motion.iter().map(|motion| motion.duration_s).sum();
        let settings = self.ipc.settings();
        let node = settings.node("lock step").expect("a node");
        let open = "the daemon has made it";
        let states = services::state(&node, &settings.instance, Access::Open).expect(open);
        let commands = services::command(&node, &settings.instance, Access::Open).expect(open);
        let (states, commands) =
            (states.subscriber().expect("a subscriber"), commands.subscriber().expect("a subscriber"));

        let mut hands = Hands::take(&self.clock);
        // It spins while the clock stands: not before everything else.
        let scenario = with_keys(scenario, &[("realtime.priority", "0"), ("realtime.lock_memory", "false")]);
        let mut plant = plant_command(&self.ipc, &write(&self.ipc, "scenario.toml", &scenario));
        self.clock.drive(&mut plant);
        let mut plant = Child::spawn(&mut plant);
        let mut truths = None;
        plant.wait_until("the plant publishes its truth", PATIENCE, |_| {
            let service = services::truth(&node, &settings.instance, Access::Open);
            truths = service.ok().and_then(|service| service.subscriber().ok());
            truths.is_some()
        });
        let truths = truths.expect("just opened");
        let mut moments = Vec::new();
        loop {
            let since = Instant::now();
            let mut set = None;
            let truth = loop {
                if let Some(truth) = truths.receive().expect("the truth can be read") {
                    break Some(*truth);
                }
                if plant.exit_status().is_some() {
                    break None;
                }
                // Its first sample is due so long after an instant at which the clock stood, whichever it was.
                if moments.is_empty() && set.is_none_or(|set: Instant| set.elapsed() > STARTING) {
                    hands.set(hands.now_ns() + FIRST_NS);
                    set = Some(Instant::now());
                }
                assert!(since.elapsed() < PATIENCE, "no answer: {}\n{}", plant.report(), self.daemon.report());
                std::thread::sleep(LOOK);
            };
            let Some(truth) = truth else { break };
            let state = states.receive().expect("samples can be read").map(|state| *state);
            let command = commands.receive().expect("commands can be read").map(|command| *command);
            let (state, command) = (state.expect("a truth has a sample"), command.expect("each has an answer"));
            assert_eq!((state.stamp_ns, command.state_sequence), (truth.stamp_ns, state.sequence));
            let moment = Moment { state, command, truth };
            if truth.scenario_time_s <= end_s {
                each(self, &moment);
                moments.push(moment);
            }
            hands.set(hands.now_ns().max(truth.stamp_ns + period));
        }
        let status = plant.wait_for_exit(PATIENCE);
        assert!(status.success(), "{}", plant.report());
        moments
    }
}
