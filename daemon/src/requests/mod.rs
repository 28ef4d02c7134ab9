//! Requests with their deadlines, and the answers with the daemon's state. Nothing here touches the
//! real-time thread except through its orders.
//!
//! However much is asked, a turn of the service thread does a bounded part of it and waits for
//! nothing: it takes in what each client may have under way, answers what it can say by itself,
//! and begins one request that needs more. That one is concluded in a later turn, when the
//! real-time thread has replied.

mod change;
mod control;
mod reload;
mod response;
mod turns;

use admittance_host::clock::monotonic_ns;
use iceoryx2::identifiers::UniqueClientId;
use ipc_types::{ActiveRequest, RequestKind, RequestSample, ResponseStatus, Server, services};

use crate::channel::{Order, OrderError, Outcome};
use crate::log;
use crate::service_thread::ServiceThread;
use turns::Turns;

/// How long an order may wait for the real-time thread, which looks at its orders once per cycle,
/// and without samples once per two cycles.
const ORDER_PATIENCE_NS: u64 = 1_500_000_000;
/// How much later than the order's deadline its reply may come: the real-time thread reads the
/// clock itself.
const GRACE_NS: u64 = 500_000_000;
/// Requests that may be under way at the same time.
const MOST: usize = services::REQUEST.qos.max_clients * services::REQUEST.qos.max_active_requests_per_client;

/// Why a request was not carried out.
#[derive(Debug)]
pub(crate) enum Refusal {
    /// The reason, and what would be accepted.
    Refused(String),
    /// Its time was up first.
    Expired(String),
}

impl Refusal {
    fn text(&self) -> &str {
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
type Answered = Result<String, Refusal>;

/// What answers a request once the real-time thread has replied.
type Conclusion = Box<dyn FnOnce(&mut ServiceThread, Outcome) -> Answered>;

/// How a request goes on.
enum Step {
    /// It is done.
    Done(String),
    /// The real-time thread has to do something.
    Order(Order, Conclusion),
}

impl Step {
    fn order(order: Order, conclusion: impl FnOnce(&mut ServiceThread, Outcome) -> Answered + 'static) -> Self {
        Self::Order(order, Box::new(conclusion))
    }
}

/// A request that was begun, its next step, or why there is none.
type Begun = Result<Step, Refusal>;

/// Who wants something.
enum Asker {
    /// A client, of one kind.
    Client { request: ActiveRequest, kind: RequestKind },
    /// Somebody who sent SIGHUP.
    Signal,
}

/// What waits for the real-time thread.
struct Underway {
    asker: Asker,
    /// Of the order.
    number: u64,
    /// When the reply is no longer waited for, ns of CLOCK_MONOTONIC.
    give_up_ns: u64,
    conclusion: Conclusion,
}

/// Requests that wait, and the one that is under way.
pub(crate) struct Requests {
    waiting: Vec<ActiveRequest>,
    turns: Turns<UniqueClientId>,
    underway: Option<Underway>,
    /// SIGHUP came, and is not acted on yet.
    reload_asked: bool,
}

impl Requests {
    pub(crate) fn new() -> Self {
        let turns = Turns::new(services::REQUEST.qos.max_clients);
        Self { waiting: Vec::with_capacity(MOST), turns, underway: None, reload_asked: false }
    }

    /// Whether there is something to go on with soon.
    pub(crate) fn are_pending(&self) -> bool {
        self.reload_asked || self.underway.is_some() || !self.waiting.is_empty()
    }

    /// Asks for a reload, as SIGHUP does. False when one was asked for already.
    pub(crate) fn ask_for_reload(&mut self) -> bool {
        !std::mem::replace(&mut self.reload_asked, true)
    }

    /// Takes in what has come. iceoryx2 passes over clients of whom as many are held as they may
    /// have under way: so none keeps another's from being seen.
    fn take_in(&mut self, server: &Server) {
        // A client that has given up wants no answer.
        self.waiting.retain(ActiveRequest::is_connected);
        while self.waiting.len() < MOST {
            match server.receive() {
                Ok(Some(request)) => self.waiting.push(request),
                // Or all clients that ask have as many held as they may.
                Ok(None) | Err(_) => return,
            }
        }
    }

    /// The next that can be served now; `all` of them, or those that can be answered at once.
    fn next(&mut self, now: u64, all: bool) -> Option<ActiveRequest> {
        let is_servable = |request: &ActiveRequest| all || is_brief(request, now);
        let servable: Vec<usize> = (0..self.waiting.len()).filter(|index| is_servable(&self.waiting[*index])).collect();
        let next = servable[self.turns.next(servable.iter().map(|index| self.waiting[*index].origin()))?];
        let request = self.waiting.remove(next);
        self.turns.serve(request.origin());
        Some(request)
    }
}

/// Whether a request is answered without work and without the real-time thread.
fn is_brief(request: &RequestSample, now: u64) -> bool {
    let kind = RequestKind::from_code(request.kind);
    now > request.deadline_ns || kind.is_none_or(|kind| kind == RequestKind::Status)
}

impl ServiceThread {
    /// Goes on with the requests: a bounded part of them, without waiting.
    pub(crate) fn serve_requests(&mut self) {
        self.conclude();
        self.requests.take_in(&self.server);
        let mut may_begin = self.requests.underway.is_none();
        if may_begin && std::mem::take(&mut self.requests.reload_asked) {
            may_begin = false;
            let begun = self.reload();
            self.go_on(Asker::Signal, begun, monotonic_ns() + ORDER_PATIENCE_NS);
        }
        for _ in 0..self.requests.waiting.len() {
            let now = monotonic_ns();
            let Some(request) = self.requests.next(now, may_begin) else { return };
            may_begin &= is_brief(&request, now);
            self.begin(request, now);
        }
    }

    /// Answers what is left, since the real-time thread has ended.
    pub(crate) fn dismiss_requests(&mut self) {
        self.conclude();
        if let Some(Underway { asker, .. }) = self.requests.underway.take() {
            self.finish(asker, Err(OrderError::Ending.into()));
        }
        let now = monotonic_ns();
        while let Some(request) = self.requests.next(now, true) {
            if let Some(kind) = RequestKind::from_code(request.kind) {
                self.finish(Asker::Client { request, kind }, Err(OrderError::Ending.into()));
            }
        }
    }

    fn begin(&mut self, request: ActiveRequest, now: u64) {
        let wanted: RequestSample = *request;
        let Some(kind) = RequestKind::from_code(wanted.kind) else {
            let known: Vec<String> = RequestKind::ALL.iter().map(|kind| format!("{} ({kind})", kind.code())).collect();
            let text = format!("request kind {} is not known; accepted: {}", wanted.kind, known.join(", "));
            return self.respond(request, ResponseStatus::Unknown, &text);
        };
        let begun = if now > wanted.deadline_ns {
            Err(Refusal::Expired("the request came after its deadline; nothing was done".to_owned()))
        } else {
            match kind {
                RequestKind::Status => Ok(Step::Done(log::status_sentence(self.last.as_ref()))),
                RequestKind::Reset => Ok(self.reset(wanted.force == 1)),
                RequestKind::Enable => Ok(Self::enable()),
                RequestKind::Disable => Ok(Self::disable()),
                RequestKind::Tare => self.tare(),
                RequestKind::SetForceLimit => self.set_force_limit(&wanted),
                RequestKind::SetEnvironment => self.set_environment(&wanted),
                RequestKind::SetLaw => self.set_law(&wanted),
                RequestKind::Reload => self.reload(),
            }
        };
        self.go_on(Asker::Client { request, kind }, begun, wanted.deadline_ns.min(now + ORDER_PATIENCE_NS));
    }

    /// Takes a request's next step; an order is carried out until `until` (ns) or not at all.
    fn go_on(&mut self, asker: Asker, begun: Begun, until: u64) {
        let (order, conclusion) = match begun {
            Ok(Step::Order(order, conclusion)) => (order, conclusion),
            Ok(Step::Done(text)) => return self.finish(asker, Ok(text)),
            Err(refusal) => return self.finish(asker, Err(refusal)),
        };
        match self.channel.give(order, until) {
            Ok(number) => {
                let give_up_ns = until.saturating_add(GRACE_NS);
                self.requests.underway = Some(Underway { asker, number, give_up_ns, conclusion });
            }
            Err(error) => self.finish(asker, Err(error.into())),
        }
    }

    /// Concludes what the real-time thread has replied to, or has not for too long.
    fn conclude(&mut self) {
        let Some(underway) = &self.requests.underway else { return };
        let outcome = match self.channel.outcome_of(underway.number) {
            Some(outcome) => outcome,
            None if monotonic_ns() > underway.give_up_ns => Err(OrderError::Late),
            None => return,
        };
        if let Some(Underway { asker, conclusion, .. }) = self.requests.underway.take() {
            let answered = outcome.map_err(Refusal::from).and_then(|outcome| conclusion(self, outcome));
            self.finish(asker, answered);
        }
    }

    fn finish(&mut self, asker: Asker, answered: Answered) {
        match asker {
            Asker::Signal => {
                match answered {
                    Ok(what) => tracing::info!("reload: {what}"),
                    Err(why) => tracing::error!("reload refused: {}", why.text()),
                }
                self.notify.ready();
            }
            Asker::Client { request, kind } => {
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
                self.respond(request, status, &text);
            }
        }
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
