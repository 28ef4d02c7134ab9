//! The service thread: signals, [requests](crate::requests), log, records and diagnostics,
//! watchdog. Runs as the process was started, its own node; it never touches the real-time thread
//! except through the rings.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::time::Duration;

use admittance_core::supervisor::Ending;
use admittance_host::clock::monotonic_ns;
use admittance_host::logging;
use ipc_types::services::{self, Access};
use ipc_types::{Instance, Node, Publisher, RecordKind, RecordSample, Server};
use signal_hook::consts::{SIGHUP, SIGTERM};
use signal_hook::iterator::Signals;

use crate::channel::{CycleRecord, Order, RECORDS, ServiceEnd};
use crate::diagnostics::Diagnostics;
use crate::requests::Requests;
use crate::tare::FreeSamples;
use crate::{log, notify};
use admittance_runner::config::Config;

/// How often the thread wakes up.
const TURN: Duration = Duration::from_millis(5);
/// The same while a request waits to be gone on with.
const BRIEF_TURN: Duration = Duration::from_millis(1);

/// The thread's state.
pub(crate) struct ServiceThread {
    pub(crate) server: Server,
    records: Publisher<RecordSample>,
    pub(crate) diagnostics: Diagnostics,
    _node: Node,
    signals: Signals,
    pub(crate) channel: ServiceEnd,
    pub(crate) config_path: PathBuf,
    /// As the file had it when it was last read.
    pub(crate) file: Config,
    /// As it is in force: the file, and what requests have changed since.
    pub(crate) config: Config,
    pub(crate) last: Option<CycleRecord>,
    /// Whether control is enabled.
    pub(crate) enabled: bool,
    /// What a tare looks at.
    pub(crate) free: FreeSamples,
    pub(crate) started: u64,
    pub(crate) requests: Requests,
    log: log::CycleLog,
    pub(crate) notify: notify::Notify,
}

impl ServiceThread {
    /// Opens the thread's services. `signals` have been caught since the program began.
    pub(crate) fn open(
        node: Node,
        instance: &Instance,
        channel: ServiceEnd,
        config_path: PathBuf,
        config: Config,
        signals: Signals,
    ) -> Result<Self, String> {
        let create = Access::OpenOrCreate;
        let record = services::record(&node, instance, create).map_err(|error| error.to_string())?;
        let records = record.publisher().map_err(|error| error.to_string())?;
        let started = monotonic_ns();
        let diagnostics = Diagnostics::open(&node, instance, &config, started)?;
        // The last service to open: a client that finds it will find the others too.
        let service = services::request(&node, instance, create).map_err(|error| error.to_string())?;
        let server = service.server().map_err(|error| error.to_string())?;
        Ok(Self {
            server,
            records,
            diagnostics,
            _node: node,
            signals,
            channel,
            config_path,
            file: config.clone(),
            enabled: config.control.start_enabled,
            config,
            last: None,
            free: FreeSamples::default(),
            started,
            requests: Requests::new(),
            log: log::CycleLog::default(),
            notify: notify::Notify::new(),
        })
    }

    /// Serves until `ended` answers true. A turn waits for nothing, and what it does is bounded: so
    /// signals and watchdog are never far.
    fn run(&mut self, mut ended: impl FnMut() -> bool) {
        self.notify.ready();
        while !ended() {
            self.take_signals();
            self.notify.watchdog(self.channel.progress.turns());
            self.read_records();
            self.serve_requests();
            self.diagnostics.publish(self.last.as_ref().map(|last| &last.sample), self.channel.progress.dropped());
            logging::tell_withheld();
            std::thread::sleep(if self.requests.are_pending() { BRIEF_TURN } else { TURN });
        }
        self.read_records();
        self.log.flush_now(self.channel.progress.dropped(), &self.config);
        self.dismiss_requests();
        logging::tell_all_withheld();
        self.notify.stopping();
    }

    /// Serves until `ended` answers true, or this thread panics, which would be a bug: control then ends as at SIGTERM, in place of
    /// leaving the arm to whatever it was doing. False then, and the real-time thread has still to end; systemd's watchdog hears of
    /// it no more, and gives it its three seconds.
    pub(crate) fn run_or_stop(&mut self, ended: impl FnMut() -> bool) -> bool {
        let has_run = catch_unwind(AssertUnwindSafe(|| self.run(ended))).is_ok();
        if !has_run {
            // Nothing else of this thread is used any more.
            let _ = self.channel.give(Order::Stop(Ending::Shutdown), u64::MAX);
        }
        has_run
    }

    fn take_signals(&mut self) {
        let pending: Vec<i32> = self.signals.pending().collect();
        for signal in pending {
            if signal == SIGHUP {
                if self.requests.ask_for_reload() {
                    self.notify.reloading();
                }
            } else {
                let name = if signal == SIGTERM { "SIGTERM" } else { "SIGINT" };
                tracing::info!("{name}: ending control; in contact the arm stops at a low force first");
                // A full ring holds a stop already: nothing is lost.
                let _ = self.channel.give(Order::Stop(Ending::Shutdown), u64::MAX);
                self.enabled = false;
            }
        }
    }

    pub(crate) fn read_records(&mut self) {
        // As many as wait at most: the next turn has the next ones.
        for _ in 0..RECORDS {
            let Ok(record) = self.channel.records.pop() else { break };
            // A slow reader sees a gap in the sequence; publishing never waits.
            if let Err(error) = self.records.send_copy(record.sample) {
                tracing::debug!("a record was not published: {error:?}");
            }
            self.diagnostics.heard_of(record.sample.boot_id);
            let is_cycle =
                [RecordKind::Sample, RecordKind::Silence].map(RecordKind::code).contains(&record.sample.kind);
            // Before the first sample there is nothing to report. One without a number is not answered,
            // and reported.
            let is_sample = record.sample.kind == RecordKind::Sample.code();
            if is_sample || (is_cycle && record.sample.command.state_sequence > 0) {
                self.diagnostics.cycle(&record);
                self.free.cycle(&record.sample);
                self.log.cycle(&record, &self.config);
                self.last = Some(record);
            }
        }
        self.log.flush(self.channel.progress.dropped(), &self.config);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::channel;

    #[test]
    fn a_panic_ends_control_as_a_signal_does() {
        let name = format!("panic{}", std::process::id());
        let text = include_str!("../../deploy/demo/mpc-paper.toml");
        let config: Config = admittance_host::config::parse(text, "mpc-paper.toml").expect("valid");
        let root = Some(ipc_types::users_root_path().join(&name));
        let settings = config.ipc.settings(None, root, Some(format!("{name}_"))).expect("a place of its own");
        let node = settings.node("test").expect("a node");
        let (mut realtime, service) = channel();
        let signals = Signals::new([SIGHUP]).expect("signals can be caught");
        let path = PathBuf::from("mpc-paper.toml");
        let mut thread =
            ServiceThread::open(node, &settings.instance, service, path, config, signals).expect("services");
        let mut turns = 0;
        let has_run = thread.run_or_stop(|| {
            turns += 1;
            assert!(turns < 3, "a bug");
            false
        });
        assert!(!has_run);
        let ticket = realtime.orders.pop().expect("an order");
        assert!(matches!(ticket.order, Order::Stop(Ending::Shutdown)) && ticket.until_ns == u64::MAX);
        // Ended in good order it orders nothing.
        assert!(thread.run_or_stop(|| true) && realtime.orders.pop().is_err());
        drop(thread);
        ipc_types::remove_all(&settings).expect("removed");
    }
}
