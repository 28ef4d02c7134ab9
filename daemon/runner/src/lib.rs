//! Between the wire and the law: the configuration, samples to and from the law's types, one cycle
//! on wire samples, and virtual time. No ports and no clock, so that the daemon, tools, tests and
//! studies drive the same code.
//!
//! ```
//! use admittance_core::quantities::Instant;
//! use admittance_runner::config::Config;
//! use admittance_runner::cycle;
//! use ipc_types::{CommandSample, Mode, StateSample};
//!
//! let text = include_str!("../../../deploy/demo/mpc-default.toml");
//! let config: Config = admittance_host::config::parse(text, "mpc-default.toml").unwrap();
//! let mut cycle = cycle::build(&config).unwrap();
//! // The paper's arm at rest in the air.
//! let mut state = StateSample { sequence: 1, stamp_ns: 5, boot_id: 7, ..StateSample::zeroed() };
//! state.joint_count = 2;
//! (state.wrench_valid, state.drives_enabled) = (1, 1);
//! (state.joint_position[0], state.joint_position[1]) = (1.3, -1.4);
//! let mut command = CommandSample::zeroed();
//! let report = cycle.answer(&state, Instant::from_nanoseconds(5), &mut || false, &mut command);
//! assert_eq!((report.fault, command.mode), (None, Mode::Free.code()));
//! ```

pub mod config;
pub mod cycle;
pub mod parameters;
pub mod settings;
pub mod task_frame;
pub mod virtual_time;
mod wire;
