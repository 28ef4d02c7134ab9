//! The services of the contract: one table of names and quality of service, and one function per
//! service that applies it.

use iceoryx2::prelude::{MessagingPattern, ServiceName};

use crate::errors::ServiceError;
use crate::layout::WireSample;
use crate::leftovers::make_service;
use crate::ports::{Event, PublishSubscribe, RequestResponse, open_failure};
use crate::qos::{EventQos, PublishSubscribeQos, RequestResponseQos, ServiceSpec};
use crate::{
    CommandSample, DiagnosticsSample, Instance, Node, RecordSample, RequestSample, ResponseSample, StateSample,
    TruthSample, TwistSample,
};

/// How a service is reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Create it when it is not there: the daemon, the motion controller, and plant-sim for its
    /// truth.
    OpenOrCreate,
    /// Only open it: for all others, so that a reader never decides the quality of service.
    Open,
}

const MAX_NODES: usize = 20;
const CONTROLLER: &str = "the motion controller (plant-sim in a simulation)";

/// One writer, readers that want the newest sample only.
const NEWEST: PublishSubscribeQos = PublishSubscribeQos {
    max_publishers: 1,
    max_subscribers: 8,
    max_nodes: MAX_NODES,
    subscriber_max_buffer_size: 1,
    subscriber_max_borrowed_samples: 2,
    history_size: 0,
    enable_safe_overflow: true,
};

/// Several notifiers are allowed, because the place of a killed one is freed only when its node is
/// cleaned up.
const ARRIVAL: EventQos = EventQos { max_notifiers: 4, max_listeners: 8, max_nodes: MAX_NODES, event_id_max_value: 0 };

/// State samples.
pub const STATE: ServiceSpec<PublishSubscribeQos> = ServiceSpec {
    name: "state",
    meaning: "One state sample per cycle of the motion controller.",
    creator: "whoever of admittanced and the motion controller starts first",
    program: "admittanced",
    writer: CONTROLLER,
    reader: "admittanced; tools",
    samples: &[StateSample::INFO],
    qos: NEWEST,
};

/// Wake-up for a new state sample.
pub const STATE_ARRIVAL: ServiceSpec<EventQos> = ServiceSpec {
    name: "state-arrival",
    meaning: "Notified with event id 0 after each state sample was published.",
    creator: "whoever of admittanced and the motion controller starts first",
    program: "admittanced",
    writer: CONTROLLER,
    reader: "admittanced",
    samples: &[],
    qos: ARRIVAL,
};

/// Command samples.
pub const COMMAND: ServiceSpec<PublishSubscribeQos> = ServiceSpec {
    name: "command",
    meaning: "One command sample per state sample, and one per max_sample_age_s of silence.",
    creator: "whoever of admittanced and the motion controller starts first",
    program: "admittanced",
    writer: "admittanced",
    reader: "the motion controller (plant-sim in a simulation); tools",
    samples: &[CommandSample::INFO],
    qos: NEWEST,
};

/// Wake-up for a new command sample.
pub const COMMAND_ARRIVAL: ServiceSpec<EventQos> = ServiceSpec {
    name: "command-arrival",
    meaning: "Notified with event id 0 after each command sample was published.",
    creator: "whoever of admittanced and the motion controller starts first",
    program: "admittanced",
    writer: "admittanced",
    reader: "the motion controller (plant-sim in a simulation)",
    samples: &[],
    qos: ARRIVAL,
};

/// Truth samples of the simulated plant.
pub const TRUTH: ServiceSpec<PublishSubscribeQos> = ServiceSpec {
    name: "truth",
    meaning: "One truth sample per cycle of plant-sim; readers may fall behind by the buffer size without loss.",
    creator: "plant-sim",
    program: "plant-sim",
    writer: "plant-sim",
    reader: "tools",
    samples: &[TruthSample::INFO],
    qos: PublishSubscribeQos { subscriber_max_buffer_size: 1024, ..NEWEST },
};

/// Records of the daemon's cycles.
pub const RECORD: ServiceSpec<PublishSubscribeQos> = ServiceSpec {
    name: "record",
    meaning: "One record per cycle and per order of admittanced; readers may fall behind by the buffer size, and see a \
              gap in the records' sequence after that.",
    creator: "admittanced",
    program: "admittanced",
    writer: "admittanced (service thread)",
    reader: "tools",
    samples: &[RecordSample::INFO],
    // Every sample that may wait takes space in shared memory, read or not: hence the few
    // subscribers.
    qos: PublishSubscribeQos { max_subscribers: 2, subscriber_max_buffer_size: 4096, ..NEWEST },
};

/// How the daemon is doing.
pub const DIAGNOSTICS: ServiceSpec<PublishSubscribeQos> = ServiceSpec {
    name: "diagnostics",
    meaning: "State, counters and latencies of admittanced, a few times a second.",
    creator: "admittanced",
    program: "admittanced",
    writer: "admittanced (service thread)",
    reader: "tools",
    samples: &[DiagnosticsSample::INFO],
    qos: NEWEST,
};

/// Records as `admittancectl relay` hands them on, in a place of its own. What carries them from there to another machine
/// wants a publisher beside the one that it reads.
pub const RELAYED_RECORD: ServiceSpec<PublishSubscribeQos> = ServiceSpec {
    program: "admittancectl relay",
    writer: "admittancectl relay",
    qos: PublishSubscribeQos { max_publishers: 2, max_subscribers: RECORD.qos.max_subscribers + 1, ..RECORD.qos },
    ..RECORD
};

/// Diagnostics as `admittancectl relay` hands them on.
pub const RELAYED_DIAGNOSTICS: ServiceSpec<PublishSubscribeQos> = ServiceSpec {
    program: "admittancectl relay",
    writer: "admittancectl relay",
    qos: PublishSubscribeQos { max_publishers: 2, ..DIAGNOSTICS.qos },
    ..DIAGNOSTICS
};

/// Where other programs lead the arm.
pub const TWIST: ServiceSpec<PublishSubscribeQos> = ServiceSpec {
    name: "twist",
    meaning: "Where a program leads the TCP, for a motion controller that takes its commanded motion from here; one program at a \
              time.",
    creator: "a motion controller that takes twists",
    program: "a motion controller that takes twists (admittance-egm or plant-sim with a [twist] section)",
    writer: "a program that leads, such as admittancectl move",
    reader: "a motion controller that takes twists",
    samples: &[TwistSample::INFO],
    qos: NEWEST,
};

/// Requests to the daemon.
pub const REQUEST: ServiceSpec<RequestResponseQos> = ServiceSpec {
    name: "request",
    meaning: "What an operator asks of the daemon, see RequestKind; one response per request. A client gives up by its own clock: a stopped server \
              answers nothing.",
    creator: "admittanced",
    program: "admittanced",
    writer: "a client such as admittancectl",
    reader: "admittanced (service thread)",
    samples: &[RequestSample::INFO, ResponseSample::INFO],
    qos: RequestResponseQos {
        max_servers: 1,
        // More than the tools of a cell: those that ask without end leave room for others.
        max_clients: 16,
        max_nodes: MAX_NODES,
        max_active_requests_per_client: 2,
        max_loaned_requests: 1,
        max_response_buffer_size: 1,
        max_borrowed_responses_per_pending_response: 1,
        enable_safe_overflow_for_requests: true,
        enable_safe_overflow_for_responses: true,
        // A request whose client gave up is dropped unseen, so that a server that was stopped does
        // not act on it later.
        enable_fire_and_forget_requests: false,
    },
};

/// State samples: `admittanced/INSTANCE/state`.
///
/// # Errors
/// [`ServiceError`].
pub fn state(node: &Node, instance: &Instance, access: Access) -> Result<PublishSubscribe<StateSample>, ServiceError> {
    publish_subscribe(node, instance, access, &STATE)
}

/// Wake-up for state samples: `admittanced/INSTANCE/state-arrival`.
///
/// # Errors
/// [`ServiceError`].
pub fn state_arrival(node: &Node, instance: &Instance, access: Access) -> Result<Event, ServiceError> {
    event(node, instance, access, &STATE_ARRIVAL)
}

/// Command samples: `admittanced/INSTANCE/command`.
///
/// # Errors
/// [`ServiceError`].
pub fn command(
    node: &Node,
    instance: &Instance,
    access: Access,
) -> Result<PublishSubscribe<CommandSample>, ServiceError> {
    publish_subscribe(node, instance, access, &COMMAND)
}

/// Wake-up for command samples: `admittanced/INSTANCE/command-arrival`.
///
/// # Errors
/// [`ServiceError`].
pub fn command_arrival(node: &Node, instance: &Instance, access: Access) -> Result<Event, ServiceError> {
    event(node, instance, access, &COMMAND_ARRIVAL)
}

/// Truth samples of the simulated plant: `admittanced/INSTANCE/truth`.
///
/// # Errors
/// [`ServiceError`].
pub fn truth(node: &Node, instance: &Instance, access: Access) -> Result<PublishSubscribe<TruthSample>, ServiceError> {
    publish_subscribe(node, instance, access, &TRUTH)
}

/// Records of the daemon's cycles: `admittanced/INSTANCE/record`.
///
/// # Errors
/// [`ServiceError`].
pub fn record(
    node: &Node,
    instance: &Instance,
    access: Access,
) -> Result<PublishSubscribe<RecordSample>, ServiceError> {
    publish_subscribe(node, instance, access, &RECORD)
}

/// How the daemon is doing: `admittanced/INSTANCE/diagnostics`.
///
/// # Errors
/// [`ServiceError`].
pub fn diagnostics(
    node: &Node,
    instance: &Instance,
    access: Access,
) -> Result<PublishSubscribe<DiagnosticsSample>, ServiceError> {
    publish_subscribe(node, instance, access, &DIAGNOSTICS)
}

/// Records that are handed on: `admittanced/INSTANCE/record` of another place.
///
/// # Errors
/// [`ServiceError`].
pub fn relayed_record(node: &Node, instance: &Instance) -> Result<PublishSubscribe<RecordSample>, ServiceError> {
    publish_subscribe(node, instance, Access::OpenOrCreate, &RELAYED_RECORD)
}

/// Diagnostics that are handed on: `admittanced/INSTANCE/diagnostics` of another place.
///
/// # Errors
/// [`ServiceError`].
pub fn relayed_diagnostics(
    node: &Node,
    instance: &Instance,
) -> Result<PublishSubscribe<DiagnosticsSample>, ServiceError> {
    publish_subscribe(node, instance, Access::OpenOrCreate, &RELAYED_DIAGNOSTICS)
}

/// Where other programs lead the arm: `admittanced/INSTANCE/twist`.
///
/// # Errors
/// [`ServiceError`].
pub fn twist(node: &Node, instance: &Instance, access: Access) -> Result<PublishSubscribe<TwistSample>, ServiceError> {
    publish_subscribe(node, instance, access, &TWIST)
}

/// Requests to the daemon: `admittanced/INSTANCE/request`.
///
/// # Errors
/// [`ServiceError`].
pub fn request(node: &Node, instance: &Instance, access: Access) -> Result<RequestResponse, ServiceError> {
    let (name, spec) = (service_name(&REQUEST, instance), &REQUEST);
    let qos = &spec.qos;
    let builder = || {
        node.service_builder(&name)
            .request_response::<RequestSample, ResponseSample>()
            .max_servers(qos.max_servers)
            .max_clients(qos.max_clients)
            .max_nodes(qos.max_nodes)
            .max_active_requests_per_client(qos.max_active_requests_per_client)
            .max_loaned_requests(qos.max_loaned_requests)
            .max_response_buffer_size(qos.max_response_buffer_size)
            .max_borrowed_responses_per_pending_response(qos.max_borrowed_responses_per_pending_response)
            .enable_safe_overflow_for_requests(qos.enable_safe_overflow_for_requests)
            .enable_safe_overflow_for_responses(qos.enable_safe_overflow_for_responses)
            .enable_fire_and_forget_requests(qos.enable_fire_and_forget_requests)
    };
    let factory = match access {
        Access::OpenOrCreate => {
            make_service(node, &name, MessagingPattern::RequestResponse, || builder().open_or_create())
                .map_err(|e| open_failure(node, &name, spec, &e))
        }
        Access::Open => builder().open().map_err(|e| open_failure(node, &name, spec, &e)),
    }?;
    Ok(RequestResponse { factory, spec })
}

fn publish_subscribe<T: WireSample>(
    node: &Node,
    instance: &Instance,
    access: Access,
    spec: &'static ServiceSpec<PublishSubscribeQos>,
) -> Result<PublishSubscribe<T>, ServiceError> {
    let name = service_name(spec, instance);
    let qos = &spec.qos;
    let builder = || {
        node.service_builder(&name)
            .publish_subscribe::<T>()
            .max_publishers(qos.max_publishers)
            .max_subscribers(qos.max_subscribers)
            .max_nodes(qos.max_nodes)
            .subscriber_max_buffer_size(qos.subscriber_max_buffer_size)
            .subscriber_max_borrowed_samples(qos.subscriber_max_borrowed_samples)
            .history_size(qos.history_size)
            .enable_safe_overflow(qos.enable_safe_overflow)
    };
    let factory = match access {
        Access::OpenOrCreate => {
            make_service(node, &name, MessagingPattern::PublishSubscribe, || builder().open_or_create())
                .map_err(|e| open_failure(node, &name, spec, &e))
        }
        Access::Open => builder().open().map_err(|e| open_failure(node, &name, spec, &e)),
    }?;
    Ok(PublishSubscribe { factory, spec })
}

fn event(
    node: &Node,
    instance: &Instance,
    access: Access,
    spec: &'static ServiceSpec<EventQos>,
) -> Result<Event, ServiceError> {
    let name = service_name(spec, instance);
    let qos = &spec.qos;
    let builder = || {
        node.service_builder(&name)
            .event()
            .max_notifiers(qos.max_notifiers)
            .max_listeners(qos.max_listeners)
            .max_nodes(qos.max_nodes)
            .event_id_max_value(qos.event_id_max_value)
    };
    let factory = match access {
        Access::OpenOrCreate => make_service(node, &name, MessagingPattern::Event, || builder().open_or_create())
            .map_err(|e| open_failure(node, &name, spec, &e)),
        Access::Open => builder().open().map_err(|e| open_failure(node, &name, spec, &e)),
    }?;
    Ok(Event { factory, spec })
}

fn service_name<Q>(spec: &ServiceSpec<Q>, instance: &Instance) -> ServiceName {
    ServiceName::new(&spec.service_name(instance))
        .expect("an instance name has at most 32 characters of a-z, 0-9, _ and -: the service name is short and plain")
}
