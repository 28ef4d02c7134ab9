//! The service thread: signals, requests, log, records and diagnostics, watchdog. Normal priority, its own node; it never
//! touches the real-time thread but through the rings.

use std::path::PathBuf;
use std::time::Duration;

use admittance_core::mode::StopReason;
use admittance_host::clock::monotonic_ns;
use admittance_host::config;
use ipc_types::services::{self, Access};
use ipc_types::{
    Instance, Node, Publisher, RecordKind, RecordSample, RequestKind, RequestSample, ResponseSample, ResponseStatus,
    Server,
};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::channel::{CycleRecord, Order, Reply, ServiceEnd};
use crate::config::Config;
use crate::diagnostics::Diagnostics;
use crate::{cycle, log, notify};

/// How often the thread looks after everything.
const TURN: Duration = Duration::from_millis(5);
/// How long a reset may take on the real-time thread's side: it looks at its orders once per cycle.
const ORDER_PATIENCE_NS: u64 = 1_500_000_000;

/// The thread's state.
pub(crate) struct ServiceThread {
    server: Server,
    records: Publisher<RecordSample>,
    diagnostics: Diagnostics,
    _node: Node,
    signals: Signals,
    channel: ServiceEnd,
    config_path: PathBuf,
    config: Config,
    last: Option<CycleRecord>,
    started: u64,
    log: log::CycleLog,
    notify: notify::Notify,
}

impl ServiceThread {
    /// Opens the thread's services and takes over the signals.
    pub(crate) fn open(
        node: Node,
        instance: &Instance,
        channel: ServiceEnd,
        config_path: PathBuf,
        config: Config,
    ) -> Result<Self, String> {
        let create = Access::OpenOrCreate;
        let record = services::record(&node, instance, create).map_err(|error| error.to_string())?;
        let records = record.publisher().map_err(|error| error.to_string())?;
        let started = monotonic_ns();
        let diagnostics = Diagnostics::open(&node, instance, &config, started)?;
        // The last one: who finds it, finds all.
        let service = services::request(&node, instance, create).map_err(|error| error.to_string())?;
        let server = service.server().map_err(|error| error.to_string())?;
        let signals = Signals::new([SIGTERM, SIGINT, SIGHUP]).map_err(|error| format!("signal handlers: {error}"))?;
        Ok(Self {
            server,
            records,
            diagnostics,
            _node: node,
            signals,
            channel,
            config_path,
            config,
            last: None,
            started,
            log: log::CycleLog::default(),
            notify: notify::Notify::new(),
        })
    }

    /// Serves until `ended` answers true.
    pub(crate) fn run(&mut self, mut ended: impl FnMut() -> bool) {
        self.notify.ready();
        while !ended() {
            self.take_signals();
            self.read_records();
            self.serve_requests();
            self.diagnostics.publish(self.last.as_ref().map(|last| &last.sample), self.channel.progress.dropped());
            self.notify.watchdog(self.channel.progress.turns());
            std::thread::sleep(TURN);
        }
        self.read_records();
        self.notify.stopping();
    }

    fn take_signals(&mut self) {
        let pending: Vec<i32> = self.signals.pending().collect();
        for signal in pending {
            if signal == SIGHUP {
                self.notify.reloading();
                match self.reload() {
                    Ok(what) => tracing::info!("reload: {what}"),
                    Err(why) => tracing::error!("reload refused: {why}"),
                }
                self.notify.ready();
            } else {
                let name = if signal == SIGTERM { "SIGTERM" } else { "SIGINT" };
                tracing::info!("{name}: ending control; in contact the arm stops at a low force first");
                // A full ring holds a stop already: nothing is lost.
                let _ = self.channel.orders.push(Order::Stop(StopReason::Shutdown));
            }
        }
    }

    fn read_records(&mut self) {
        while let Ok(record) = self.channel.records.pop() {
            // Who does not read fast enough sees a gap in the sequence; publishing never waits.
            if let Err(error) = self.records.send_copy(record.sample) {
                tracing::debug!("a record was not published: {error:?}");
            }
            self.diagnostics.heard_of(record.sample.boot_id);
            let is_cycle =
                [RecordKind::Sample, RecordKind::Silence].map(RecordKind::code).contains(&record.sample.kind);
            // Before the first sample there is nothing to tell.
            if is_cycle && record.sample.command.state_sequence > 0 {
                self.diagnostics.cycle(&record.sample);
                self.log.cycle(&record);
                self.last = Some(record);
            }
        }
        self.log.flush(self.channel.progress.dropped());
    }

    fn serve_requests(&mut self) {
        while let Ok(Some(request)) = self.server.receive() {
            let wanted: RequestSample = *request;
            let response = self.answer(&wanted);
            if let Err(error) = request.send_copy(response) {
                tracing::warn!("a client did not take its response: {error:?}");
            }
        }
    }

    fn answer(&mut self, request: &RequestSample) -> ResponseSample {
        let kind = RequestKind::from_code(request.kind);
        let (status, text) = if monotonic_ns() > request.deadline_ns {
            (ResponseStatus::Expired, "the request came after its deadline; nothing was done".to_owned())
        } else {
            match kind {
                Some(RequestKind::Status) => (ResponseStatus::Done, log::status_sentence(self.last.as_ref())),
                Some(RequestKind::Reset) => self.reset(request),
                None => {
                    let text = format!("request kind {} is not known; accepted: 1 (status), 2 (reset)", request.kind);
                    (ResponseStatus::Unknown, text)
                }
            }
        };
        self.read_records();
        self.response(request.id, status, &text)
    }

    fn reset(&mut self, request: &RequestSample) -> (ResponseStatus, String) {
        let force = request.force == 1;
        let was = log::state_of(self.last.as_ref());
        if self.channel.orders.push(Order::Reset { force }).is_err() {
            return (ResponseStatus::Refused, "the real-time thread does not take orders: it is ending".to_owned());
        }
        let give_up = monotonic_ns() + ORDER_PATIENCE_NS;
        while monotonic_ns() < give_up {
            if let Ok(Reply::Reset(outcome)) = self.channel.replies.pop() {
                let how = if force { " (forced)" } else { "" };
                return match outcome {
                    Ok(()) => {
                        tracing::info!("reset{how} from {was}");
                        let now = if force { "Free" } else { "Idle, Free with the next valid sample" };
                        (ResponseStatus::Done, format!("reset{how}: from {was} to {now}"))
                    }
                    Err(refused) => (ResponseStatus::Refused, format!("reset refused: {refused}")),
                };
            }
            std::thread::sleep(Duration::from_micros(200));
        }
        (ResponseStatus::Refused, "the real-time thread did not answer in time".to_owned())
    }

    fn response(&self, id: u64, status: ResponseStatus, text: &str) -> ResponseSample {
        let mut response = ResponseSample { id, status: status.code(), ..ResponseSample::zeroed() };
        response.uptime_ns = monotonic_ns().saturating_sub(self.started);
        response.cycles = self.diagnostics.cycles();
        response.joint_count = self.config.robot.joint.len() as u32;
        if let Some(CycleRecord { sample, .. }) = &self.last {
            let last = &sample.command;
            response.state_sequence = last.state_sequence;
            response.command_sequence = last.sequence;
            response.fallback_count = last.fallback_count;
            response.late_count = last.late_count;
            response.missed_count = last.missed_count;
            response.rejected_count = last.rejected_count;
            response.compute_time_ns = last.compute_time_ns;
            response.mode = last.mode;
            response.motion = last.motion;
            response.stop_reason = last.stop_reason;
            response.active_axes = last.active_axes;
            response.verdict = last.verdict;
            response.verdict_margin = last.verdict_margin;
            response.verdict_time_s = last.verdict_time_s;
            response.wrench = self.diagnostics.wrench();
            response.velocity_offset = last.velocity_offset;
        }
        response.set_text(text);
        response
    }

    /// Reads the configuration again and hands a new controller over, if only what may change at run time has changed.
    fn reload(&mut self) -> Result<String, String> {
        let new: Config = config::load(&self.config_path).map_err(|error| error.to_string())?;
        if new == self.config {
            return Ok("nothing has changed".to_owned());
        }
        let fixed = [
            ("ipc", new.ipc == self.config.ipc),
            ("robot", new.robot == self.config.robot),
            ("control", new.control == self.config.control),
            ("realtime", new.realtime == self.config.realtime),
        ];
        let changed: Vec<&str> = fixed.iter().filter(|(_, same)| !same).map(|(section, _)| *section).collect();
        if !changed.is_empty() {
            return Err(format!(
                "[{}] cannot change at run time: restart for that; contact, environment, mpc, damping, limits and stopping can",
                changed.join("], [")
            ));
        }
        let controller = cycle::build(&new)?;
        self.channel.orders.push(Order::Replace(controller)).map_err(|_| "the real-time thread is ending")?;
        let give_up = monotonic_ns() + ORDER_PATIENCE_NS;
        while monotonic_ns() < give_up {
            if let Ok(Reply::Replaced { unused, refused }) = self.channel.replies.pop() {
                drop(unused);
                return match refused {
                    Some(why) => Err(format!("{why}; the old configuration stays in force")),
                    None => {
                        self.diagnostics.configure(&new);
                        self.config = new;
                        Ok("the new configuration is in force".to_owned())
                    }
                };
            }
            std::thread::sleep(Duration::from_micros(200));
        }
        Err("the real-time thread did not answer in time".to_owned())
    }
}
