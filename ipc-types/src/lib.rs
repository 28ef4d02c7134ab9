//! The wire contract of admittanced: what travels through shared memory between the motion
//! controller, the daemon and its tools, under which service names, and with which quality of
//! service.
//!
//! - [`StateSample`], [`CommandSample`], [`TruthSample`], [`RequestSample`], [`ResponseSample`],
//!   [`RecordSample`],
//!   [`DiagnosticsSample`], [`TwistSample`]: fixed-size samples.
//! - [`services`]: one function per service.
//! - [`IpcSettings`]: root path, prefix and instance, from which nodes are made.
//! - [`schema`]: the contract as JSON and as a C header, for clients in other languages.
//!
//! Every type name ends in the version of its sample. iceoryx2 compares type name, size and
//! alignment when a service is opened, but not the order of the fields: a changed layout needs a
//! new version.

#[macro_use]
mod macros;

mod enums;
mod errors;
mod instance;
mod leftovers;
mod node_counter;
mod place;
mod ports;
mod removal;
mod samples;
mod settings;
mod virtual_plant;

pub mod c_header;
pub mod layout;
pub mod qos;
pub mod resources;
pub mod schema;
pub mod services;

pub use c_header::c_header;
pub use enums::{
    ENUMS, Fault, Law, Mode, Motion, RecordKind, RequestKind, ResponseStatus, Side, Source, StopReason, TaskAxis,
    TwistFrame, Verdict,
};
pub use errors::{PortError, ServiceError};
pub use instance::{Instance, InstanceError, MAX_INSTANCE_LENGTH};
pub use layout::WireSample;
pub use place::{PlaceError, USERS_ROOT_PATH, effective_user, open_file, open_root, user_name, users_root_path};
pub use ports::{
    ActiveRequest, Client, Event, Listener, Notifier, PendingResponse, PublishSubscribe, Publisher, RequestResponse,
    Server, Slot, Subscriber,
};
pub use removal::{RemoveError, remove_all, shared_memory_files};
pub use samples::{
    CommandSample, DiagnosticsSample, RecordSample, RequestSample, ResponseSample, SAMPLES, StateSample, TruthSample,
    TwistSample,
};
pub use schema::{json_schema, schema_json};
pub use services::Access;
pub use settings::{
    DEFAULT_PREFIX, DEFAULT_ROOT_PATH, IpcSettings, MAX_PREFIX_LENGTH, Node, NodeError, SettingsError, quiet_iceoryx2,
};
pub use virtual_plant::VirtualPlant;

/// Version of what is common to all services: their names, their quality of service, and the codes.
/// A sample's layout has a version of its own, in its type name.
pub const SCHEMA_VERSION: u32 = 1;
/// Joints that a sample can hold.
pub const MAX_JOINTS: usize = 8;
/// Task axes of a Cartesian array: x y z rx ry rz.
pub const TASK_AXES: usize = 6;
/// Plan steps that a command can hold.
pub const MAX_PLAN: usize = 32;
/// Quantiles of a time in the diagnostics: p50, p99, p99.9 and the maximum.
pub const QUANTILES: usize = 4;
/// Values that a request can hold.
pub const REQUEST_VALUES: usize = 8;
/// Bytes of text in a response.
pub const TEXT_LENGTH: usize = 1024;
