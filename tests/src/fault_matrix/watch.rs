//! An independent observer: sees commands, records and the plant's truth in shared memory, and
//! nothing else.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use ipc_types::services::{self, Access};
use ipc_types::{CommandSample, IpcSettings, TruthSample};

use super::row::Said;

/// Time between two reads: well below a cycle.
const POLL: Duration = Duration::from_micros(500);

/// All that was seen, in order.
#[derive(Debug, Default)]
pub(super) struct Seen {
    /// The plant's truth.
    pub(super) truths: Vec<TruthSample>,
    /// Every command by its stamp (ns) and boot id: those that were read in time, and those that
    /// records tell of.
    pub(super) commands: BTreeMap<(u64, u64), CommandSample>,
}

impl Seen {
    /// The newest command.
    pub(super) fn command(&self) -> Option<&CommandSample> {
        self.commands.values().next_back()
    }

    /// What the newest command says.
    pub(super) fn said(&self) -> Option<Said> {
        self.command().and_then(Said::of)
    }

    /// The newest truth.
    pub(super) fn truth(&self) -> Option<&TruthSample> {
        self.truths.last()
    }

    /// Scenario time in s.
    pub(super) fn time(&self) -> f64 {
        self.truth().map_or(f64::NEG_INFINITY, |truth| truth.scenario_time_s)
    }

    /// The commands from the last one before `from` (ns) up to `until`.
    pub(super) fn commands_within(&self, from: u64, until: u64) -> impl Iterator<Item = &CommandSample> {
        let before = self.commands.range(..(from, 0)).next_back();
        before.into_iter().chain(self.commands.range((from, 0)..(until, 0))).map(|(_, command)| command)
    }

    /// The truths of samples stamped in `from..until` (ns).
    pub(super) fn truths_within(&self, from: u64, until: u64) -> impl Iterator<Item = &TruthSample> {
        self.truths.iter().filter(move |truth| (from..until).contains(&truth.stamp_ns))
    }
}

/// Threads that watch until this is dropped: one, and another one for each time that the services
/// were made anew.
#[derive(Debug)]
pub(super) struct Watcher {
    seen: Arc<Mutex<Seen>>,
    end: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Watcher {
    /// Watches the services of this place, also those that do not exist yet.
    pub(super) fn new(settings: &IpcSettings) -> Self {
        let mut watcher = Self { seen: Arc::default(), end: Arc::default(), threads: Vec::new() };
        watcher.watch_anew(settings);
        watcher
    }

    /// Gives up all ports, so that nothing of this process keeps the services; what was seen stays.
    pub(super) fn rest(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // A watcher that failed has said so.
            let _ = thread.join();
        }
        self.end = Arc::default();
    }

    /// Watches the services that are at this place from now on.
    pub(super) fn watch_anew(&mut self, settings: &IpcSettings) {
        let (seen, end, settings) = (Arc::clone(&self.seen), Arc::clone(&self.end), settings.clone());
        self.threads.push(std::thread::spawn(move || watch(&settings, &seen, &end)));
    }

    /// What was seen up to now.
    pub(super) fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Watcher {
    fn drop(&mut self) {
        self.rest();
    }
}

fn watch(settings: &IpcSettings, seen: &Mutex<Seen>, end: &AtomicBool) {
    let node = settings.node("watcher").expect("a node");
    let instance = &settings.instance;
    let (mut commands, mut records, mut truths) = (None, None, None);
    while !end.load(Ordering::Relaxed) {
        if commands.is_none() {
            commands = services::command(&node, instance, Access::Open).ok().and_then(|s| s.subscriber().ok());
        }
        if records.is_none() {
            records = services::record(&node, instance, Access::Open).ok().and_then(|s| s.subscriber().ok());
        }
        if truths.is_none() {
            truths = services::truth(&node, instance, Access::Open).ok().and_then(|s| s.subscriber().ok());
        }
        let keep = |command: CommandSample| {
            if command.sequence > 0 {
                let mut seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
                seen.commands.insert((command.stamp_ns, command.boot_id), command);
            }
        };
        while let Some(command) = commands.as_ref().and_then(|port| port.receive().ok().flatten()) {
            keep(*command);
        }
        while let Some(record) = records.as_ref().and_then(|port| port.receive().ok().flatten()) {
            keep(record.command);
        }
        while let Some(truth) = truths.as_ref().and_then(|port| port.receive().ok().flatten()) {
            seen.lock().unwrap_or_else(PoisonError::into_inner).truths.push(*truth);
        }
        std::thread::sleep(POLL);
    }
}
