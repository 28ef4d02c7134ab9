//! The motion controller's side of admittanced: its ports, and the rules for when a command acts.
//!
//! A controller publishes a state sample per cycle, takes the command that answers it, and lets it
//! act at the sample's stamp plus the agreed delay:
//!
//! ```
//! use admittance_client::{Applied, Playback, Reception};
//! use ipc_types::{CommandSample, Motion};
//!
//! let (delay_ns, sampling_time_ns) = (250_000, 4_000_000);
//! let mut playback = Playback::new(2, delay_ns, sampling_time_ns);
//! playback.begin_sample(1, 1_000);
//! let mut command = CommandSample { sequence: 1, joint_count: 2, ..CommandSample::zeroed() };
//! (command.state_sequence, command.state_stamp_ns) = (1, 1_000);
//! command.valid_until_ns = 16_000_000;
//! command.velocity_offset[1] = 0.05;
//! assert_eq!(playback.receive(&command, 200_000), Ok(Reception::InTime));
//! playback.apply_due(251_000);
//! assert_eq!(playback.applied(251_000), Applied::Offset(command.velocity_offset));
//! // Nothing newer has come: when the command is no longer valid, the joints hold.
//! assert_eq!(playback.applied(16_000_000), Applied::Hold);
//! ```

mod controller;
mod lead;
mod led;
mod limits;
mod playback;
mod ports;
mod rejection;
mod stream;

pub use admittance_drive_limits::DriveLimits;
pub use controller::{Arm, Controller, ControllerError};
pub use lead::{Lead, LeadLimits, LeadRefusal, Rotation};
pub use led::Led;
pub use limits::{LimitError, Limits};
pub use playback::{Applied, Playback, Reception};
pub use ports::{OpenError, Ports, Slot};
pub use rejection::Rejection;
pub use stream::{Drives, Stream};
