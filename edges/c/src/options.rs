//! What a motion controller is opened with, and why it is refused.

use std::ffi::{CStr, c_char};
use std::time::{SystemTime, UNIX_EPOCH};

use admittance_client::{Arm, Controller, ControllerError, Limits, OpenError};
use ipc_types::{Instance, InstanceError, IpcSettings, MAX_JOINTS, NodeError, ServiceError, TASK_AXES};

use crate::status::Status;

/// The version of the interface: calls, and layout of what they are given. It grows when an old program could not go on.
pub const ABI_VERSION: u32 = 1;

/// What a motion controller is opened with. Everything has to be set; nothing has a default.
#[derive(Debug)]
#[repr(C)]
pub struct Options {
    /// ADMITTANCE_CLIENT_ABI_VERSION, as it was when the program was built.
    pub abi_version: u32,
    /// Joints, 1 to 8.
    pub joint_count: u32,
    /// `ipc.root_path` of the daemon: an absolute path, such as "/run/admittanced".
    pub root_path: *const c_char,
    /// `ipc.prefix` of the daemon.
    pub prefix: *const c_char,
    /// `ipc.instance` of the daemon.
    pub instance: *const c_char,
    /// Name of this controller for tools.
    pub name: *const c_char,
    /// Time from sample to sample in ns.
    pub sampling_time_ns: u64,
    /// When the answer to a sample acts, in ns after its stamp: `control.command_delay_s` of the daemon.
    pub command_delay_ns: u64,
    /// The controller's own limits: the largest magnitude of a velocity offset that it accepts on each axis, m/s and
    /// rad/s, x y z rx ry rz. Above 0; INFINITY for none. Less than the daemon's `[limits]` would refuse its stops.
    pub velocity_offset_limit: [f64; TASK_AXES],
    /// The same for each joint of its joint-space image, rad/s or m/s. Above 0; INFINITY for none.
    pub joint_velocity_offset_limit: [f64; MAX_JOINTS],
}

/// Why nothing was opened.
#[derive(Debug)]
pub(crate) enum Refused {
    Null,
    AbiVersion(u32),
    Text { option: &'static str },
    Instance(InstanceError),
    Controller(ControllerError),
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Null => f.write_str("options = NULL: accepted: options"),
            Self::AbiVersion(version) => {
                write!(f, "abi_version = {version}: accepted: {ABI_VERSION}, which is that of this library")
            }
            Self::Text { option } => write!(f, "{option}: accepted: a text in UTF-8, not NULL"),
            Self::Instance(error) => error.fmt(f),
            Self::Controller(error) => error.fmt(f),
        }
    }
}

impl Refused {
    pub(crate) fn status(&self) -> Status {
        match self {
            Self::Controller(ControllerError::Open(error)) if error.is_permission() => Status::Permission,
            Self::Controller(ControllerError::Open(OpenError::Service(error))) => match error {
                ServiceError::WrongType { .. } | ServiceError::WrongQos { .. } => Status::Schema,
                _ => Status::Unavailable,
            },
            Self::Controller(ControllerError::Open(OpenError::Node(NodeError::Settings(_)))) => Status::InvalidArgument,
            Self::Controller(ControllerError::Open(_)) => Status::Unavailable,
            _ => Status::InvalidArgument,
        }
    }
}

impl Options {
    /// Opens a controller of a new boot.
    ///
    /// # Safety
    /// Each text is NULL or ends in a zero byte.
    pub(crate) unsafe fn open(&self) -> Result<Controller, Refused> {
        if self.abi_version != ABI_VERSION {
            return Err(Refused::AbiVersion(self.abi_version));
        }
        let texts =
            [("root_path", self.root_path), ("prefix", self.prefix), ("instance", self.instance), ("name", self.name)];
        // SAFETY: as the caller promises.
        let [root_path, prefix, instance, name] = texts.map(|(option, text)| unsafe { read(option, text) });
        let instance = Instance::new(instance?).map_err(Refused::Instance)?;
        let settings = IpcSettings { root_path: root_path?.into(), prefix: prefix?.to_owned(), instance };
        let arm = Arm {
            joint_count: self.joint_count as usize,
            sampling_time_ns: self.sampling_time_ns,
            command_delay_ns: self.command_delay_ns,
            limits: Limits {
                velocity_offset: self.velocity_offset_limit,
                joint_velocity_offset: self.joint_velocity_offset_limit,
            },
        };
        Controller::open(&settings, name?, &arm, new_boot_id()).map_err(Refused::Controller)
    }
}

/// # Safety
/// `text` is NULL or ends in a zero byte.
unsafe fn read<'a>(option: &'static str, text: *const c_char) -> Result<&'a str, Refused> {
    if text.is_null() {
        return Err(Refused::Text { option });
    }
    // SAFETY: as the caller promises.
    unsafe { CStr::from_ptr(text) }.to_str().map_err(|_| Refused::Text { option })
}

/// Another one at each start, and never 0.
fn new_boot_id() -> u64 {
    let now_ns = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64);
    (now_ns ^ u64::from(std::process::id()) << 32) | 1
}
