//! The third process of the soak: it sees shared memory and nothing else, joins before any motion,
//! and notes what must never be seen. Whether a fault explains it is decided elsewhere.

use std::collections::VecDeque;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ipc_types::services::{self, Access};
use ipc_types::{CommandSample, IpcSettings, Node, Subscriber, TruthSample, Verdict};
use serde::{Deserialize, Serialize};

use crate::answers::{Bounds, Invariant, Sequence};
use admittancectl::{Exit, validate};

/// Time between two reads: far below a cycle of the soak.
const POLL: Duration = Duration::from_micros(500);
/// Part of the force limit by which the force may be above it: what a verdict tolerates itself,
/// twice.
const TOLERANCE: f64 = 0.005;

/// Feasible answers that are remembered: those of a quarter of a second.
const REMEMBERED: usize = 64;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[arg(long)]
    config: PathBuf,
    #[arg(long)]
    root_path: PathBuf,
    #[arg(long)]
    prefix: String,
    /// Where findings go, as JSON lines.
    #[arg(long)]
    out: PathBuf,
}

/// What was seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub(crate) enum Finding {
    /// Everything is subscribed to.
    Ready,
    /// An invariant is broken.
    Broken {
        /// The invariant.
        invariant: Invariant,
        /// When, ns of CLOCK_MONOTONIC.
        stamp_ns: u64,
        /// What was seen, in words.
        what: String,
    },
    /// A busy machine kept plant or daemon from working in time.
    Disturbed {
        /// When, ns of CLOCK_MONOTONIC.
        stamp_ns: u64,
    },
    /// How much was looked at.
    Done {
        /// Commands.
        commands: u64,
        /// Truth samples.
        truths: u64,
    },
}

/// What is known between samples.
struct Observer<W> {
    out: W,
    /// Force limit of x and y, N.
    limit: Vec<f64>,
    /// What is checked of every command.
    bounds: Bounds,
    /// By how much the plant may be late itself, ns.
    patience: u64,
    commands: Sequence,
    truths: Sequence,
    /// Samples whose answers had a feasible verdict, the last ones.
    feasible: VecDeque<u64>,
    /// Missed commands of the plant so far.
    missed: u64,
    seen: (u64, u64),
}

impl<W: Write> Observer<W> {
    fn note(&mut self, finding: &Finding) {
        // Without a reader the soak has ended.
        let line = serde_json::to_string(finding).unwrap_or_default();
        let _ = writeln!(self.out, "{line}").and_then(|()| self.out.flush());
    }

    fn broken(&mut self, invariant: Invariant, stamp_ns: u64, what: String) {
        self.note(&Finding::Broken { invariant, stamp_ns, what });
    }

    fn command(&mut self, command: &CommandSample) {
        self.seen.0 += 1;
        let now = command.stamp_ns;
        if let Some(why) = self.commands.check(command.boot_id, command.sequence) {
            self.broken(Invariant::SequenceGrows, now, format!("command {why}"));
        }
        for (invariant, what) in self.bounds.flaws(command) {
            self.broken(invariant, now, what);
        }
        if command.verdict == Verdict::Feasible.code() {
            self.feasible.push_back(command.state_sequence);
            if self.feasible.len() > REMEMBERED {
                self.feasible.pop_front();
            }
        }
    }

    fn truth(&mut self, truth: &TruthSample) {
        self.seen.1 += 1;
        if truth.boot_id != self.truths.boot_id {
            self.feasible.clear();
        }
        if let Some(why) = self.truths.check(truth.boot_id, truth.sequence) {
            self.broken(Invariant::SequenceGrows, truth.stamp_ns, format!("truth {why}"));
        }
        // Before the first command there is nobody who could answer.
        let missed = std::mem::replace(&mut self.missed, truth.missed_commands);
        if (truth.missed_commands > missed && truth.scenario_time_s > 0.0) || truth.lateness_ns > self.patience {
            self.note(&Finding::Disturbed { stamp_ns: truth.stamp_ns });
        }
        // The peak since the previous sample was predicted in the answer to that sample.
        let is_feasible = self.feasible.contains(&(truth.sequence.saturating_sub(1)));
        for axis in 0..self.limit.len() {
            let (force, limit) = (truth.peak_wrench[axis].abs(), self.limit[axis]);
            if is_feasible && force > limit * (1.0 + TOLERANCE) {
                let what = format!("{force:.1} N on axis {axis} after a feasible verdict, limit {limit:.1} N");
                self.broken(Invariant::ForceBelowLimit, truth.stamp_ns, what);
            }
        }
    }
}

/// Subscribers; made before there is a plant or a daemon, so that no writer ever waits for them.
struct Ports {
    commands: Subscriber<CommandSample>,
    truths: Subscriber<TruthSample>,
    _node: Node,
}

impl Ports {
    fn open(settings: &IpcSettings) -> Result<Self, String> {
        let text = |error: &dyn std::fmt::Display| error.to_string();
        let node = settings.node("soak observer").map_err(|e| text(&e))?;
        // The first process to come creates a service: here the observer.
        let command = services::command(&node, &settings.instance, Access::OpenOrCreate).map_err(|e| text(&e))?;
        let truth = services::truth(&node, &settings.instance, Access::OpenOrCreate).map_err(|e| text(&e))?;
        let commands = command.subscriber().map_err(|e| text(&e))?;
        let truths = truth.subscriber().map_err(|e| text(&e))?;
        Ok(Self { commands, truths, _node: node })
    }
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    ipc_types::quiet_iceoryx2();
    let config = validate::load(&args.config)?;
    let settings = config
        .ipc
        .settings(None, Some(args.root_path.clone()), Some(args.prefix.clone()))
        .map_err(|why| (Exit::Config, why))?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(|error| (Exit::Unavailable, format!("signal handlers: {error}")))?;
    }
    let ports = Ports::open(&settings).map_err(|why| (Exit::Unavailable, why))?;
    let out = std::fs::File::create(&args.out)
        .map_err(|error| (Exit::Unavailable, format!("{}: {error}", args.out.display())))?;
    let mut observer = Observer {
        out,
        limit: config.contact.force_limit.clone(),
        bounds: Bounds::of(&config),
        patience: (config.control.sampling_time_s * 0.5e9) as u64,
        commands: Sequence::default(),
        truths: Sequence::default(),
        feasible: VecDeque::new(),
        missed: 0,
        seen: (0, 0),
    };
    observer.note(&Finding::Ready);
    while !stop.load(Ordering::Relaxed) {
        while let Ok(Some(command)) = ports.commands.receive() {
            observer.command(&command);
        }
        while let Ok(Some(truth)) = ports.truths.receive() {
            observer.truth(&truth);
        }
        std::thread::sleep(POLL);
    }
    let (commands, truths) = observer.seen;
    observer.note(&Finding::Done { commands, truths });
    Ok(Exit::Ok)
}

#[cfg(test)]
mod tests {
    use admittancectl::demo::CONTROLLERS;
    use ipc_types::{Mode, Motion, StopReason};

    use super::*;

    fn observer() -> Observer<Vec<u8>> {
        Observer {
            out: Vec::new(),
            limit: vec![200.0, 200.0],
            bounds: Bounds::of(&admittance_host::config::parse(CONTROLLERS[3].config, "daemon.toml").expect("shipped")),
            patience: 1_000_000,
            commands: Sequence::default(),
            truths: Sequence::default(),
            feasible: VecDeque::new(),
            missed: 0,
            seen: (0, 0),
        }
    }

    fn found(observer: &Observer<Vec<u8>>) -> Vec<Invariant> {
        let text = String::from_utf8(observer.out.clone()).expect("UTF-8");
        let broken = |line: &str| match serde_json::from_str(line).expect("a finding") {
            Finding::Broken { invariant, .. } => Some(invariant),
            _ => None,
        };
        text.lines().filter_map(broken).collect()
    }

    #[test]
    fn each_invariant_can_be_broken() {
        let mut observer = observer();
        let fine = CommandSample {
            boot_id: 1,
            sequence: 1,
            joint_count: 2,
            mode: Mode::Stopped.code(),
            motion: Motion::Hold.code(),
            stop_reason: StopReason::Infeasible.code(),
            ..CommandSample::zeroed()
        };
        observer.command(&fine);
        assert!(found(&observer).is_empty());
        observer.command(&CommandSample {
            sequence: 2,
            motion: Motion::Offset.code(),
            twist_command: [0.0, -0.1, 0.0, 0.0, 0.0, 0.0],
            ..fine
        });
        observer.command(&CommandSample { sequence: 2, ..fine });
        observer.command(&CommandSample { sequence: 3, stop_reason: StopReason::NONE, ..fine });
        let truth = TruthSample { boot_id: 5, sequence: 6, ..TruthSample::zeroed() };
        observer.truth(&truth);
        observer.command(&CommandSample {
            sequence: 4,
            mode: Mode::Contact.code(),
            verdict: Verdict::Feasible.code(),
            state_sequence: 6,
            ..fine
        });
        observer.truth(&TruthSample { sequence: 7, peak_wrench: [0.0, 202.0, 0.0, 0.0, 0.0, 0.0], ..truth });
        observer.command(&CommandSample { boot_id: 2, ..fine });
        observer.command(&CommandSample { boot_id: 1, sequence: 9, ..fine });
        let expected = [
            Invariant::StoppedHolds,
            Invariant::SequenceGrows,
            Invariant::StopIsReported,
            Invariant::ForceBelowLimit,
            Invariant::SequenceGrows,
        ];
        assert_eq!(found(&observer), expected);
    }
}
