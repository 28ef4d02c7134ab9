//! The real-time thread: wait for a state sample, answer it, publish the command.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender};

use admittance_core::quantities::{Instant, Span};
use admittance_core::supervisor::Ending;
use admittance_host::arrival::ArrivalEstimate;
use admittance_host::clock::{monotonic_ns, pause, sleep_until_ns};
use admittance_host::exit::ExitCode;
use admittance_host::notifications::Notifications;
use admittance_host::realtime::{RealtimeSection, StepReport, go_real_time};
use ipc_types::services::{self, Access};
use ipc_types::{
    CommandSample, IpcSettings, Mode, Motion, Node, NodeError, Notifier, Publisher, RecordKind, RecordSample, Slot,
    StateSample, StopReason, Subscriber,
};

use crate::channel::{Order, Outcome, RealtimeEnd, Replacement, Reply, Ticket};
use crate::probe::Probe;
use admittance_runner::config::{Config, Wait};
use admittance_runner::cycle::{Cycle, CycleReport};

/// What the thread needs to begin.
pub(crate) struct RealtimeThread {
    pub(crate) settings: IpcSettings,
    pub(crate) realtime: RealtimeSection,
    pub(crate) timing: LoopTiming,
    pub(crate) cycle: Box<dyn Cycle>,
    pub(crate) channel: RealtimeEnd,
    pub(crate) boot_id: u64,
}

/// Times of the loop, in ns.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LoopTiming {
    answer_budget: u64,
    max_sample_age: u64,
    sampling_time: u64,
    wait: Wait,
    /// With [`Wait::Hybrid`]: how long to spin before and after a sample is due.
    spin: u64,
}

impl LoopTiming {
    pub(crate) fn of(config: &Config) -> Self {
        let ns = |seconds: f64| Span::from_seconds(seconds).nanoseconds();
        Self {
            answer_budget: ns(config.control.answer_budget_s),
            max_sample_age: ns(config.control.max_sample_age_s),
            sampling_time: ns(config.control.sampling_time_s),
            wait: config.control.wait,
            spin: ns(config.control.spin_s),
        }
    }
}

/// The thread's set-up: what was done, or why it cannot begin.
pub(crate) type Started = Result<Vec<StepReport>, (ExitCode, String)>;

/// Ports of the thread. They cannot move to another thread, so they are made where they are used;
/// the node goes last.
struct Ports {
    states: Subscriber<StateSample>,
    arrivals: Notifications,
    commands: Publisher<CommandSample>,
    answered: Notifier,
    _node: Node,
}

impl Ports {
    fn open(settings: &IpcSettings) -> Result<Self, (ExitCode, String)> {
        let text = |error: &dyn std::fmt::Display| (ExitCode::Unavailable, error.to_string());
        let refused = |e: NodeError| (ExitCode::of_refusal(e.is_permission()), e.to_string());
        let node = settings.node("admittanced real-time").map_err(refused)?;
        let instance = &settings.instance;
        let create = Access::OpenOrCreate;
        let state = services::state(&node, instance, create).map_err(|e| text(&e))?;
        let state_arrival = services::state_arrival(&node, instance, create).map_err(|e| text(&e))?;
        let command = services::command(&node, instance, create).map_err(|e| text(&e))?;
        let command_arrival = services::command_arrival(&node, instance, create).map_err(|e| text(&e))?;
        Ok(Self {
            states: state.subscriber().map_err(|e| text(&e))?,
            arrivals: Notifications::new(state_arrival.listener().map_err(|e| text(&e))?),
            commands: command.publisher().map_err(|e| text(&e))?,
            answered: command_arrival.notifier().map_err(|e| text(&e))?,
            _node: node,
        })
    }
}

impl RealtimeThread {
    /// The thread's body: opens the ports, becomes real-time, reports to `started`, waits until it
    /// may `go`, and answers samples until it is stopped. It ends at once where `go` has no sender.
    pub(crate) fn run(self, started: &Sender<Started>, go: &Receiver<()>, probe: impl Probe) -> ExitCode {
        // A dropped receiver means that the process is ending already.
        let tell = |outcome: Started| drop(started.send(outcome));
        let ports = match Ports::open(&self.settings) {
            Ok(ports) => ports,
            Err((code, why)) => {
                tell(Err((code, why)));
                return code;
            }
        };
        // After the ports are open: their mappings are then locked and present, or the refusal is
        // reported.
        tell(Ok(go_real_time(&self.realtime)));
        if go.recv().is_err() {
            return ExitCode::Unavailable;
        }
        let mut cycle_loop = Loop {
            ports: &ports,
            timing: self.timing,
            cycle: self.cycle,
            channel: self.channel,
            command: CommandSample { boot_id: self.boot_id, ..CommandSample::zeroed() },
            arrival: ArrivalEstimate::new(self.timing.sampling_time),
            late: 0,
            is_unnotified: false,
            stopping: false,
            probe,
        };
        match catch_unwind(AssertUnwindSafe(|| cycle_loop.run())) {
            Ok(()) => ExitCode::Ok,
            Err(_) => {
                // The panic hook has said what happened; the arm must not go on with the last
                // offset.
                let mut command = cycle_loop.command;
                hold(&mut command);
                if let Ok(slot) = ports.commands.loan_uninit() {
                    let _ = slot.write_payload(command).send();
                    let _ = ports.answered.notify();
                }
                ExitCode::Internal
            }
        }
    }
}

/// Turns a command into the last one of a failed thread.
fn hold(command: &mut CommandSample) {
    command.sequence += 1;
    command.stamp_ns = monotonic_ns();
    command.motion = Motion::Hold.code();
    command.mode = Mode::Stopped.code();
    command.stop_reason = StopReason::InternalError.code();
    command.velocity_offset = [0.0; ipc_types::TASK_AXES];
    command.joint_velocity_offset = [0.0; ipc_types::MAX_JOINTS];
    command.twist_command = [0.0; ipc_types::TASK_AXES];
    command.plan_length = 0;
}

struct Loop<'a, P> {
    ports: &'a Ports,
    timing: LoopTiming,
    cycle: Box<dyn Cycle>,
    channel: RealtimeEnd,
    /// The last command.
    command: CommandSample,
    arrival: ArrivalEstimate,
    /// Answers published after their deadline.
    late: u64,
    /// Whether the last wait ended although no notification came.
    is_unnotified: bool,
    stopping: bool,
    probe: P,
}

impl<P: Probe> Loop<'_, P> {
    fn run(&mut self) {
        // Loaning allocates: the slot for the next command is loaned in the slack after the last.
        let mut slot = self.ports.commands.loan_uninit().ok();
        let mut last_event = monotonic_ns();
        loop {
            self.channel.progress.turn();
            self.obey();
            if self.stopping && matches!(self.cycle.mode(), Mode::Idle | Mode::Stopped) {
                return;
            }
            self.probe.looking();
            let sample = self.ports.states.receive().ok().flatten();
            let received = monotonic_ns();
            // When the law first asked for the time: the time before is not the solver's.
            let mut asked = 0;
            let mut expired_at = 0;
            let report = if let Some(state) = &sample {
                let deadline = state.stamp_ns.saturating_add(self.timing.answer_budget);
                let mut questions = 0;
                let mut expired = || {
                    let now = monotonic_ns();
                    asked = if asked == 0 { now } else { asked };
                    questions += 1;
                    let is_over = now >= deadline;
                    expired_at = if is_over && expired_at == 0 { questions } else { expired_at };
                    is_over
                };
                let now = Instant::from_nanoseconds(received);
                let mut report = self.cycle.answer(state, now, &mut expired, &mut self.command);
                report.is_unnotified = std::mem::take(&mut self.is_unnotified);
                self.arrival.see(state.boot_id, state.sequence, state.stamp_ns, received);
                report
            } else {
                if received.saturating_sub(last_event) < self.timing.max_sample_age {
                    self.wait(received, last_event);
                    continue;
                }
                self.cycle.silence(Instant::from_nanoseconds(received), &mut self.command)
            };
            last_event = received;
            // Before the first sample there is nothing to answer.
            if self.command.state_sequence > 0 {
                self.publish(slot.take(), received, asked);
                slot = self.ports.commands.loan_uninit().ok();
            }
            // From here on there is time.
            let mut record = RecordSample { now_ns: received, expired_at, ..RecordSample::zeroed() };
            record.kind = if sample.is_some() { RecordKind::Sample } else { RecordKind::Silence }.code();
            if let Some(state) = &sample {
                record.state = **state;
                record.wake_up_latency_ns = received.saturating_sub(state.stamp_ns);
                record.answer_time_ns = self.command.stamp_ns.saturating_sub(state.stamp_ns);
                record.compute_time_ns = self.command.compute_time_ns;
            }
            self.channel.record(record, report, &self.command, &*self.cycle);
        }
    }

    /// Waits for the next sample, or until a silence has lasted long enough to count. It may return
    /// before either.
    fn wait(&mut self, now: u64, last_event: u64) {
        self.is_unnotified = false;
        match self.timing.wait {
            // Without a controller there is no hurry.
            Wait::Spin => {
                let silent = self.timing.max_sample_age;
                if self.arrival.next().is_some_and(|due| now < due.saturating_add(silent)) {
                    return pause();
                }
            }
            Wait::Event => {}
            // The thread spins around the instant at which the sample is due: a blocked thread
            // wakes far later.
            Wait::Hybrid => {
                let spin = self.timing.spin;
                if let Some(due) = self.arrival.next().filter(|due| now < due.saturating_add(spin)) {
                    let from = due.saturating_sub(spin);
                    self.arrival.look(now < from);
                    return if now < from { sleep_until_ns(from) } else { pause() };
                }
            }
        }
        // Notified or not: the next turn looks for a sample, and at the clock.
        let silent = self.timing.max_sample_age.saturating_sub(now - last_event);
        let brief = self.arrival.look_after(now).unwrap_or(2 * self.timing.sampling_time);
        self.arrival.look(false);
        self.is_unnotified = !self.ports.arrivals.block(silent.min(brief));
    }

    fn publish(&mut self, slot: Option<Slot<CommandSample>>, received: u64, asked: u64) {
        let Some(slot) = slot else { return };
        let now = monotonic_ns();
        let late = now > self.command.state_stamp_ns.saturating_add(self.timing.answer_budget);
        self.late += u64::from(late && self.command.state_stamp_ns > 0);
        self.command.sequence += 1;
        self.command.stamp_ns = now;
        self.command.compute_time_ns = now.saturating_sub(received);
        self.command.late_count = self.late;
        // No listener yet is no failure.
        let _ = slot.write_payload(self.command).send();
        self.probe.sent(&self.command, asked);
        let _ = self.ports.answered.notify();
    }

    fn obey(&mut self) {
        while let Ok(Ticket { number, until_ns, order }) = self.channel.orders.pop() {
            let now = monotonic_ns();
            let outcome = if now > until_ns { Outcome::Late { order } } else { self.carry_out(order, now) };
            // As many replies fit as orders: a full ring means that the service thread is gone.
            let _ = self.channel.replies.push(Reply { number, outcome });
        }
    }

    fn carry_out(&mut self, order: Order, now: u64) -> Outcome {
        let mut record = RecordSample { now_ns: now, ..RecordSample::zeroed() };
        let (mode, was_enabled) = (self.cycle.mode(), self.cycle.is_enabled());
        let outcome = match order {
            Order::Stop(ending) => {
                self.cycle.end(ending);
                self.stopping |= ending == Ending::Shutdown;
                record.kind = RecordKind::Stop.code();
                record.stop_order = ending.reason().code();
                Outcome::Stopping { mode, was_enabled }
            }
            Order::Enable => {
                let enabled = self.cycle.enable();
                record.kind = RecordKind::Enable.code();
                record.done = u32::from(enabled.is_ok());
                Outcome::Enabled(enabled.map(|changed| (mode, changed)))
            }
            Order::Reset { force } => {
                let reset = self.cycle.reset(force);
                record.kind = RecordKind::Reset.code();
                (record.forced, record.done) = (u32::from(force), u32::from(reset.is_ok()));
                Outcome::Reset(reset)
            }
            Order::Replace { mut new, kind } => {
                let refused = match kind.refused_in(mode) {
                    Some(why) => Some(why),
                    None if new.take_over(&*self.cycle) => None,
                    None => Some("the arm is another one"),
                };
                if refused.is_none() {
                    std::mem::swap(&mut self.cycle, &mut new);
                }
                let is_reload = kind == Replacement::Reload;
                record.kind = if is_reload { RecordKind::Replaced } else { RecordKind::Adjusted }.code();
                record.done = u32::from(refused.is_none());
                Outcome::Replaced { unused: new, refused }
            }
        };
        self.channel.record(record, CycleReport::default(), &self.command, &*self.cycle);
        outcome
    }
}

#[cfg(test)]
mod tests;
