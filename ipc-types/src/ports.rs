//! Open services and the ports that they make.

use core::mem::MaybeUninit;

use iceoryx2::port;
use iceoryx2::prelude::{BackpressureStrategy, MessagingPattern, PortFactory as _, Service as _, ServiceName, ipc};
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use iceoryx2::service::port_factory;

use crate::errors::{Classify, ClassifyPort, Kind, PortError, ServiceError};
use crate::layout::{SampleInfo, WireSample};
use crate::qos::{EventQos, PublishSubscribeQos, RequestResponseQos, ServiceSpec};
use crate::{Node, RequestSample, ResponseSample};

/// Sends samples of one type; `send` never waits.
pub type Publisher<T> = port::publisher::Publisher<ipc::Service, T, ()>;
/// Space for a sample in shared memory, loaned by a publisher.
pub type Slot<T> = SampleMutUninit<ipc::Service, MaybeUninit<T>, ()>;
/// Receives samples of one type; `receive` never waits.
pub type Subscriber<T> = port::subscriber::Subscriber<ipc::Service, T, ()>;
/// Wakes listeners.
pub type Notifier = port::notifier::Notifier<ipc::Service>;
/// Waits for notifiers.
pub type Listener = port::listener::Listener<ipc::Service>;
/// Sends requests.
pub type Client = port::client::Client<ipc::Service, RequestSample, (), ResponseSample, ()>;
/// A request that was sent: it lasts as long as this is kept, and its response comes here.
pub type PendingResponse =
    iceoryx2::pending_response::PendingResponse<ipc::Service, RequestSample, (), ResponseSample, ()>;
/// A request that was received, and where its response goes. Kept, it counts against its client's
/// requests under way: of a client that has as many kept no more are received.
pub type ActiveRequest = iceoryx2::active_request::ActiveRequest<ipc::Service, RequestSample, (), ResponseSample, ()>;
/// Receives requests and responds.
pub type Server = port::server::Server<ipc::Service, RequestSample, (), ResponseSample, ()>;

/// Samples that a publisher may hold before sending: one being written, one loaned ahead.
const PUBLISHER_LOANS: usize = 2;

/// An open publish-subscribe service.
#[derive(Debug)]
pub struct PublishSubscribe<T: WireSample> {
    pub(crate) factory: port_factory::publish_subscribe::PortFactory<ipc::Service, T, ()>,
    pub(crate) spec: &'static ServiceSpec<PublishSubscribeQos>,
}

impl<T: WireSample> PublishSubscribe<T> {
    /// Makes the service's publisher.
    ///
    /// # Errors
    /// [`PortError::Taken`] when another process publishes already; else [`PortError`].
    pub fn publisher(&self) -> Result<Publisher<T>, PortError> {
        self.factory
            .publisher_builder()
            .max_loaned_samples(PUBLISHER_LOANS)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| {
                let limit = self.spec.qos.max_publishers;
                port_failure(self.factory.name(), &e, "publishes", self.spec.writer, "publishers", limit)
            })
    }

    /// Makes a subscriber.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn subscriber(&self) -> Result<Subscriber<T>, PortError> {
        self.factory.subscriber_builder().create().map_err(|e| {
            let limit = self.spec.qos.max_subscribers;
            port_failure(self.factory.name(), &e, "reads", self.spec.reader, "subscribers", limit)
        })
    }

    /// iceoryx2's handle, for instance to count publishers.
    pub fn factory(&self) -> &port_factory::publish_subscribe::PortFactory<ipc::Service, T, ()> {
        &self.factory
    }
}

/// An open event service.
#[derive(Debug)]
pub struct Event {
    pub(crate) factory: port_factory::event::PortFactory<ipc::Service>,
    pub(crate) spec: &'static ServiceSpec<EventQos>,
}

impl Event {
    /// Makes a notifier.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn notifier(&self) -> Result<Notifier, PortError> {
        self.factory.notifier_builder().create().map_err(|e| {
            let limit = self.spec.qos.max_notifiers;
            port_failure(self.factory.name(), &e, "notifies", self.spec.writer, "notifiers", limit)
        })
    }

    /// Makes a listener.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn listener(&self) -> Result<Listener, PortError> {
        self.factory.listener_builder().create().map_err(|e| {
            let limit = self.spec.qos.max_listeners;
            port_failure(self.factory.name(), &e, "listens to", self.spec.reader, "listeners", limit)
        })
    }

    /// iceoryx2's own handle.
    pub fn factory(&self) -> &port_factory::event::PortFactory<ipc::Service> {
        &self.factory
    }
}

/// The open request service.
#[derive(Debug)]
pub struct RequestResponse {
    pub(crate) factory:
        port_factory::request_response::PortFactory<ipc::Service, RequestSample, (), ResponseSample, ()>,
    pub(crate) spec: &'static ServiceSpec<RequestResponseQos>,
}

impl RequestResponse {
    /// Makes the service's server.
    ///
    /// # Errors
    /// [`PortError::Taken`] when another process serves already; else [`PortError`].
    pub fn server(&self) -> Result<Server, PortError> {
        self.factory.server_builder().backpressure_strategy(BackpressureStrategy::DiscardData).create().map_err(|e| {
            let limit = self.spec.qos.max_servers;
            port_failure(self.factory.name(), &e, "serves", self.spec.reader, "servers", limit)
        })
    }

    /// Makes a client. It never waits for the server: give each request a deadline, and each wait
    /// for a response an end.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn client(&self) -> Result<Client, PortError> {
        self.factory.client_builder().backpressure_strategy(BackpressureStrategy::DiscardData).create().map_err(|e| {
            let limit = self.spec.qos.max_clients;
            port_failure(self.factory.name(), &e, "asks", self.spec.writer, "clients", limit)
        })
    }

    /// iceoryx2's own handle.
    pub fn factory(
        &self,
    ) -> &port_factory::request_response::PortFactory<ipc::Service, RequestSample, (), ResponseSample, ()> {
        &self.factory
    }
}

fn port_failure(
    name: &ServiceName,
    error: &impl ClassifyPort,
    role: &'static str,
    who: &'static str,
    ports: &'static str,
    limit: usize,
) -> PortError {
    let service = name.to_string();
    if error.is_too_many() && limit == 1 {
        PortError::Taken { service, role, writer: who }
    } else if error.is_too_many() {
        PortError::TooMany { service, ports, limit }
    } else if error.is_memory() {
        PortError::SharedMemory { service, cause: format!("{error:?}") }
    } else {
        PortError::Iceoryx2 { service, cause: format!("{error:?}") }
    }
}

pub(crate) fn open_failure<Q>(
    node: &Node,
    name: &ServiceName,
    spec: &ServiceSpec<Q>,
    error: &impl Classify,
) -> ServiceError {
    let service = name.to_string();
    let global = &node.config().global;
    let (root_path, prefix) = (global.root_path().to_string(), global.prefix.to_string());
    let (program, cause) = (spec.program, format!("{error:?}"));
    match error.kind() {
        Kind::NotFound => ServiceError::NotFound { service, program, root_path, prefix },
        Kind::Type => {
            ServiceError::WrongType { found: found_types(node, name), expected: types(spec.samples), service }
        }
        Kind::Qos => ServiceError::WrongQos { service, program, cause },
        Kind::Version => ServiceError::WrongIceoryx2 { service },
        Kind::Permission => ServiceError::Permission { service, root_path },
        Kind::Nodes => ServiceError::TooManyNodes { service },
        Kind::Busy | Kind::Hanging => ServiceError::Busy { service, cause },
        Kind::Damaged => ServiceError::Damaged { service, cause, root_path, prefix },
        Kind::Other => ServiceError::Iceoryx2 { service, cause },
    }
}

fn types(samples: &[SampleInfo]) -> String {
    let each: Vec<_> = samples.iter().map(|s| format!("{} ({} bytes)", s.type_name, s.size)).collect();
    each.join(" and ")
}

/// The types of a service that exists, as its files say.
fn found_types(node: &Node, name: &ServiceName) -> String {
    let details = |pattern| ipc::Service::details(name, node.config(), pattern).ok().flatten();
    if let Some(found) = details(MessagingPattern::PublishSubscribe) {
        let payload = &found.static_details.publish_subscribe().message_type_details().payload;
        return format!("{} ({} bytes)", payload.type_name(), payload.size());
    }
    if let Some(found) = details(MessagingPattern::RequestResponse) {
        let both = found.static_details.request_response();
        let (request, response) = (both.request_message_type_details(), both.response_message_type_details());
        let (request, response) = (&request.payload, &response.payload);
        return format!(
            "{} ({} bytes) and {} ({} bytes)",
            request.type_name(),
            request.size(),
            response.type_name(),
            response.size()
        );
    }
    "other types".to_owned()
}
