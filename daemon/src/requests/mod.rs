//! Requests with their deadlines, and the answers with the daemon's state. Nothing here touches the
//! real-time thread except through its orders.

mod change;
mod control;
mod reload;

use admittance_host::clock::monotonic_ns;
use ipc_types::{RequestKind, RequestSample, ResponseSample, ResponseStatus};

use crate::channel::{CycleRecord, OrderError};
use crate::log;
use crate::service_thread::ServiceThread;
use admittance_runner::settings::Settings;

/// How long an order may wait for the real-time thread, which looks at its orders once per cycle,
/// and without samples once per `max_sample_age_s`.
pub(crate) const ORDER_PATIENCE_NS: u64 = 1_500_000_000;

/// Why a request was not carried out.
#[derive(Debug)]
pub(crate) enum Refusal {
    /// The reason, and what would be accepted.
    Refused(String),
    /// Its time was up first.
    Expired(String),
}

impl Refusal {
    pub(crate) fn text(&self) -> &str {
        match self {
            Self::Refused(text) | Self::Expired(text) => text,
        }
    }
}

impl From<OrderError> for Refusal {
    fn from(error: OrderError) -> Self {
        match error {
            OrderError::Ending => Self::Refused(error.to_string()),
            OrderError::Late => Self::Expired(error.to_string()),
        }
    }
}

impl From<String> for Refusal {
    fn from(text: String) -> Self {
        Self::Refused(text)
    }
}

/// What was changed from what to what, or why it was not.
pub(crate) type Answered = Result<String, Refusal>;

impl ServiceThread {
    /// Answers the requests that have come.
    pub(crate) fn serve_requests(&mut self) {
        while let Ok(Some(request)) = self.server.receive() {
            let wanted: RequestSample = *request;
            let response = self.answer(&wanted);
            if let Err(error) = request.send_copy(response) {
                tracing::warn!("a client did not take its response: {error:?}");
            }
        }
    }

    fn answer(&mut self, request: &RequestSample) -> ResponseSample {
        let now = monotonic_ns();
        let until = request.deadline_ns.min(now + ORDER_PATIENCE_NS);
        let Some(kind) = RequestKind::from_code(request.kind) else {
            let known: Vec<String> = RequestKind::ALL.iter().map(|kind| format!("{} ({kind})", kind.code())).collect();
            let text = format!("request kind {} is not known; accepted: {}", request.kind, known.join(", "));
            return self.response(request.id, ResponseStatus::Unknown, &text);
        };
        let answered = if now > request.deadline_ns {
            Err(Refusal::Expired("the request came after its deadline; nothing was done".to_owned()))
        } else {
            match kind {
                RequestKind::Status => Ok(log::status_sentence(self.last.as_ref())),
                RequestKind::Reset => self.reset(request.force == 1, until),
                RequestKind::Enable => self.enable(until),
                RequestKind::Disable => self.disable(until),
                RequestKind::Tare => self.tare(until),
                RequestKind::SetForceLimit => self.set_force_limit(request, until),
                RequestKind::SetEnvironment => self.set_environment(request, until),
                RequestKind::SetLaw => self.set_law(request, until),
                RequestKind::Reload => self.reload(until),
            }
        };
        let (status, text) = match answered {
            Ok(text) => (ResponseStatus::Done, text),
            Err(Refusal::Refused(why)) => (ResponseStatus::Refused, format!("{} refused: {why}", verb(kind))),
            Err(Refusal::Expired(why)) => (ResponseStatus::Expired, format!("{} refused: {why}", verb(kind))),
        };
        if kind != RequestKind::Status {
            match status {
                ResponseStatus::Done => tracing::info!(request = kind.name(), "request: {text}"),
                _ => tracing::warn!(request = kind.name(), "request: {text}"),
            }
        }
        self.read_records();
        self.response(request.id, status, &text)
    }

    fn response(&self, id: u64, status: ResponseStatus, text: &str) -> ResponseSample {
        let mut response = ResponseSample { id, status: status.code(), ..ResponseSample::zeroed() };
        response.uptime_ns = monotonic_ns().saturating_sub(self.started);
        response.cycles = self.diagnostics.cycles();
        response.joint_count = self.config.robot.joint.len() as u32;
        let settings = Settings::of(&self.config);
        response.law = settings.law.law().code();
        response.enabled = u32::from(self.enabled);
        response.force_limit = settings.force_limit;
        response.wrench_bias = settings.bias;
        response.normal_stiffness_n_m = settings.normal_stiffness;
        response.surface_normal = settings.surface_normal;
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
            response.contact_point = sample.contact_point;
        }
        response.set_text(text);
        response
    }
}

/// What a person calls it.
fn verb(kind: RequestKind) -> &'static str {
    match kind {
        RequestKind::Status => "status",
        RequestKind::Reset => "reset",
        RequestKind::Enable => "enable",
        RequestKind::Disable => "disable",
        RequestKind::Tare => "tare",
        RequestKind::SetForceLimit => "set-force-limit",
        RequestKind::SetEnvironment => "set-environment",
        RequestKind::SetLaw => "set-law",
        RequestKind::Reload => "reload",
    }
}
