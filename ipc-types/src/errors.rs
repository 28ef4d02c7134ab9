//! Why a service cannot be opened or a port cannot be made: iceoryx2's many codes, sorted by what a
//! person can do about them.

use iceoryx2::port::listener::ListenerCreateError;
use iceoryx2::port::notifier::NotifierCreateError;
use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::subscriber::SubscriberCreateError;
use iceoryx2::service::builder::event::{EventCreateError, EventOpenError, EventOpenOrCreateError};
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError, PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError,
};
use iceoryx2::service::builder::request_response::{
    RequestResponseCreateError, RequestResponseOpenError, RequestResponseOpenOrCreateError,
};
use iceoryx2::service::port_factory::client::ClientCreateError;
use iceoryx2::service::port_factory::server::ServerCreateError;

/// Why a service could not be opened or created.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ServiceError {
    /// The service does not exist: its program does not run, or runs with another instance, root
    /// path or prefix.
    #[error(
        "no service {service} in {root_path} with prefix \"{prefix}\": is {program} running with this instance, root \
         path \
         and prefix?"
    )]
    NotFound {
        /// Service name.
        service: String,
        /// The program that creates it.
        program: &'static str,
        /// Root path that was searched.
        root_path: String,
        /// Prefix that was searched.
        prefix: String,
    },
    /// The service exists with other sample types: another version, or a foreign program.
    #[error(
        "service {service} carries {found}, this program speaks {expected}: use programs of the same admittanced \
         version, \
         or end the one that created it"
    )]
    WrongType {
        /// Service name.
        service: String,
        /// Type names and sizes of the existing service.
        found: String,
        /// Type names and sizes of this contract.
        expected: String,
    },
    /// The service exists with another messaging pattern, or with too small a buffer or port count.
    #[error(
        "service {service} exists with another quality of service ({cause}): end the program that created it, and let \
         {program} or a client that follows the schema create it"
    )]
    WrongQos {
        /// Service name.
        service: String,
        /// The program that should create it.
        program: &'static str,
        /// What iceoryx2 said.
        cause: String,
    },
    /// The service was created by another release of iceoryx2.
    #[error(
        "service {service} was created by another iceoryx2 release: this program needs a peer that uses iceoryx2 0.10"
    )]
    WrongIceoryx2 {
        /// Service name.
        service: String,
    },
    /// Its files belong to another user.
    #[error(
        "no permission for service {service} in {root_path} or /dev/shm: run all programs of an instance as the same \
         user"
    )]
    Permission {
        /// Service name.
        service: String,
        /// Root path.
        root_path: String,
    },
    /// The number of nodes that the quality of service allows is reached.
    #[error(
        "service {service} is open in as many nodes as it allows: end a reader (admittancectl, recorder) and try again"
    )]
    TooManyNodes {
        /// Service name.
        service: String,
    },
    /// It is being created or removed right now.
    #[error("service {service} is being created or removed by another process ({cause}): try again")]
    Busy {
        /// Service name.
        service: String,
        /// What iceoryx2 said.
        cause: String,
    },
    /// Its files are damaged, or its creator died half-way.
    #[error(
        "service {service} is damaged ({cause}): end all programs of this instance, then remove {root_path} and \
         /dev/shm/{prefix}*"
    )]
    Damaged {
        /// Service name.
        service: String,
        /// What iceoryx2 said.
        cause: String,
        /// Root path.
        root_path: String,
        /// Prefix.
        prefix: String,
    },
    /// Anything else that iceoryx2 or the system refused.
    #[error("service {service} cannot be opened: iceoryx2 says {cause}. Is /dev/shm writable and not full?")]
    Iceoryx2 {
        /// Service name.
        service: String,
        /// What iceoryx2 said.
        cause: String,
    },
}

/// Why a port of an open service could not be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PortError {
    /// The one publisher, or the one server, is taken.
    #[error(
        "another process already {role} {service}: only one {writer} per instance; end the other one or choose \
         another instance"
    )]
    Taken {
        /// Service name.
        service: String,
        /// `publishes` or `serves`.
        role: &'static str,
        /// Who it should be.
        writer: &'static str,
    },
    /// As many ports of this kind as the quality of service allows exist.
    #[error("service {service} already has {limit} {ports}, all that it allows: end one of them and try again")]
    TooMany {
        /// Service name.
        service: String,
        /// Kind of the port, plural.
        ports: &'static str,
        /// Most at the same time.
        limit: usize,
    },
    /// The shared memory of the port could not be made.
    #[error("no shared memory for a port of {service} ({cause}): is /dev/shm writable and not full?")]
    SharedMemory {
        /// Service name.
        service: String,
        /// What iceoryx2 said.
        cause: String,
    },
    /// Anything else that iceoryx2 refused.
    #[error("a port of {service} cannot be made: iceoryx2 says {cause}")]
    Iceoryx2 {
        /// Service name.
        service: String,
        /// What iceoryx2 said.
        cause: String,
    },
}

/// The kind of failure behind an iceoryx2 service builder's code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    NotFound,
    Type,
    Qos,
    Version,
    Permission,
    Nodes,
    Busy,
    /// Somebody has begun to make it, or to remove it, and does not go on.
    Hanging,
    Damaged,
    Other,
}

/// Sorts an iceoryx2 code.
pub(crate) trait Classify: core::fmt::Debug {
    fn kind(&self) -> Kind;
}

macro_rules! classify {
    ($error:ident { $($kind:ident: $($code:ident)|+;)+ }) => {
        impl Classify for $error {
            fn kind(&self) -> Kind {
                match self {
                    $( $( Self::$code )|+ => Kind::$kind, )+
                    _ => Kind::Other,
                }
            }
        }
    };
}

macro_rules! classify_either {
    ($error:ident: $open:ident, $create:ident) => {
        impl Classify for $error {
            fn kind(&self) -> Kind {
                match self {
                    Self::$open(open) => open.kind(),
                    Self::$create(create) => create.kind(),
                    Self::SystemInFlux => Kind::Busy,
                }
            }
        }
    };
}

classify!(PublishSubscribeOpenError {
    NotFound: DoesNotExist;
    Type: IncompatibleTypes;
    Qos: IncompatibleMessagingPattern | IncompatibleAttributes | DoesNotSupportRequestedMinBufferSize
        | DoesNotSupportRequestedMinHistorySize | DoesNotSupportRequestedMinSubscriberBorrowedSamples
        | DoesNotSupportRequestedAmountOfPublishers | DoesNotSupportRequestedAmountOfSubscribers
        | DoesNotSupportRequestedAmountOfNodes | IncompatibleOverflowBehavior;
    Version: VersionMismatch;
    Permission: InsufficientPermissions;
    Nodes: ExceedsMaxNumberOfNodes;
    Busy: Interrupt;
    Hanging: HangsInCreation | IsMarkedForDestruction;
    Damaged: ServiceInCorruptedState;
});
classify!(PublishSubscribeCreateError {
    Permission: InsufficientPermissions;
    Busy: AlreadyExists | IsBeingCreatedByAnotherInstance | Interrupt;
    Hanging: HangsInCreation;
    Damaged: ServiceInCorruptedState;
});
classify!(EventOpenError {
    NotFound: DoesNotExist;
    Qos: IncompatibleMessagingPattern | IncompatibleAttributes | IncompatibleDeadline | IncompatibleNotifierCreatedEvent
        | IncompatibleNotifierDroppedEvent | IncompatibleNotifierDeadEvent | DoesNotSupportRequestedAmountOfNotifiers
        | DoesNotSupportRequestedAmountOfListeners | DoesNotSupportRequestedMaxEventId
        | DoesNotSupportRequestedAmountOfNodes;
    Version: VersionMismatch;
    Permission: InsufficientPermissions;
    Nodes: ExceedsMaxNumberOfNodes;
    Busy: Interrupt;
    Hanging: HangsInCreation | IsMarkedForDestruction;
    Damaged: ServiceInCorruptedState;
});
classify!(EventCreateError {
    Permission: InsufficientPermissions;
    Busy: AlreadyExists | IsBeingCreatedByAnotherInstance | Interrupt;
    Damaged: ServiceInCorruptedState;
});
classify!(RequestResponseOpenError {
    NotFound: DoesNotExist;
    Type: IncompatibleRequestOrResponseType;
    Qos: IncompatibleMessagingPattern | IncompatibleAttributes | DoesNotSupportRequestedAmountOfClientRequestLoans
        | DoesNotSupportRequestedAmountOfActiveRequestsPerClient | DoesNotSupportRequestedResponseBufferSize
        | DoesNotSupportRequestedAmountOfServers | DoesNotSupportRequestedAmountOfClients
        | DoesNotSupportRequestedAmountOfNodes
        | DoesNotSupportRequestedAmountOfBorrowedResponsesPerPendingResponse | IncompatibleOverflowBehaviorForRequests
        | IncompatibleOverflowBehaviorForResponses | IncompatibleBehaviorForFireAndForgetRequests;
    Version: VersionMismatch;
    Permission: InsufficientPermissions;
    Nodes: ExceedsMaxNumberOfNodes;
    Busy: Interrupt;
    Hanging: HangsInCreation | IsMarkedForDestruction;
    Damaged: ServiceInCorruptedState;
});
classify!(RequestResponseCreateError {
    Permission: InsufficientPermissions;
    Busy: AlreadyExists | IsBeingCreatedByAnotherInstance | Interrupt;
    Hanging: HangsInCreation;
    Damaged: ServiceInCorruptedState;
});
classify_either!(PublishSubscribeOpenOrCreateError: PublishSubscribeOpenError, PublishSubscribeCreateError);
classify_either!(EventOpenOrCreateError: EventOpenError, EventCreateError);
classify_either!(RequestResponseOpenOrCreateError: RequestResponseOpenError, RequestResponseCreateError);

/// The kind of failure behind an iceoryx2 port builder's code.
pub(crate) trait ClassifyPort: core::fmt::Debug {
    /// The number of ports that the service allows is reached.
    fn is_too_many(&self) -> bool;
    /// The port's shared memory could not be made.
    fn is_memory(&self) -> bool;
}

macro_rules! classify_port {
    ($($error:ident: $too_many:ident $(, $memory:ident)?;)+) => {
        $(
            impl ClassifyPort for $error {
                fn is_too_many(&self) -> bool {
                    matches!(self, Self::$too_many)
                }

                fn is_memory(&self) -> bool {
                    false $(|| matches!(self, Self::$memory))?
                }
            }
        )+
    };
}

classify_port! {
    PublisherCreateError: ExceedsMaxSupportedPublishers, UnableToCreateDataSegment;
    SubscriberCreateError: ExceedsMaxSupportedSubscribers;
    NotifierCreateError: ExceedsMaxSupportedNotifiers;
    ListenerCreateError: ExceedsMaxSupportedListeners, ResourceCreationFailed;
    ClientCreateError: ExceedsMaxSupportedClients, UnableToCreateDataSegment;
    ServerCreateError: ExceedsMaxSupportedServers, UnableToCreateDataSegment;
}
