//! Quality of service as data: the one place that both the service functions and the schema read.

use crate::layout::SampleInfo;

/// Quality of service of a publish-subscribe service. Names are iceoryx2's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct PublishSubscribeQos {
    /// Publishers at the same time.
    pub max_publishers: usize,
    /// Subscribers at the same time.
    pub max_subscribers: usize,
    /// Nodes that have the service open at the same time.
    pub max_nodes: usize,
    /// Samples that wait for a subscriber.
    pub subscriber_max_buffer_size: usize,
    /// Samples that a subscriber may hold at the same time.
    pub subscriber_max_borrowed_samples: usize,
    /// Old samples that a late subscriber receives.
    pub history_size: usize,
    /// A full buffer drops its oldest sample; the publisher never waits.
    pub enable_safe_overflow: bool,
}

/// Quality of service of an event service. Names are iceoryx2's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct EventQos {
    /// Notifiers at the same time.
    pub max_notifiers: usize,
    /// Listeners at the same time.
    pub max_listeners: usize,
    /// Nodes that have the service open at the same time.
    pub max_nodes: usize,
    /// Largest event id; every notification here has id 0.
    pub event_id_max_value: usize,
}

/// Quality of service of a request-response service. Names are iceoryx2's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct RequestResponseQos {
    /// Servers at the same time.
    pub max_servers: usize,
    /// Clients at the same time.
    pub max_clients: usize,
    /// Nodes that have the service open at the same time.
    pub max_nodes: usize,
    /// Requests of one client under way at the same time.
    pub max_active_requests_per_client: usize,
    /// Requests that a client may prepare at the same time.
    pub max_loaned_requests: usize,
    /// Responses that wait for a client, per request.
    pub max_response_buffer_size: usize,
    /// Responses that a client may hold at the same time, per request.
    pub max_borrowed_responses_per_pending_response: usize,
    /// A full request buffer drops its oldest request; the client never waits for a stopped server.
    pub enable_safe_overflow_for_requests: bool,
    /// A full response buffer drops its oldest response; the server never waits for a stopped
    /// client.
    pub enable_safe_overflow_for_responses: bool,
    /// Whether a request is served although its client no longer waits for the response.
    pub enable_fire_and_forget_requests: bool,
}

/// One service of the contract.
#[derive(Debug, Clone, Copy)]
pub struct ServiceSpec<Q> {
    /// Last part of the service name `admittanced/INSTANCE/NAME`.
    pub name: &'static str,
    /// What the service carries and when.
    pub meaning: &'static str,
    /// Who makes the service.
    pub creator: &'static str,
    /// The program to ask for when the service is not there.
    pub program: &'static str,
    /// Who publishes, notifies or requests.
    pub writer: &'static str,
    /// Who subscribes, listens or serves.
    pub reader: &'static str,
    /// Sample types: one for publish-subscribe, request and response for request-response, none for
    /// events.
    pub samples: &'static [SampleInfo],
    /// Quality of service.
    pub qos: Q,
}

impl<Q> ServiceSpec<Q> {
    /// The service's name of an instance: `admittanced/INSTANCE/NAME`.
    pub fn service_name(&self, instance: &crate::Instance) -> String {
        format!("admittanced/{instance}/{}", self.name)
    }

    /// The pattern of the service's name, with `{instance}` in place of the instance.
    pub fn name_pattern(&self) -> String {
        format!("admittanced/{{instance}}/{}", self.name)
    }
}
