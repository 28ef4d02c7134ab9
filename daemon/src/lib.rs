//! The daemon beside a motion controller: one robot, one real-time thread.
//!
//! The data path: `realtime_thread` receives a state sample → [`cycle`] turns it into the core's, steps the core, and turns
//! the outcome into a command (`wire`) → `realtime_thread` publishes it, and a record to `service_thread` through `channel`.

mod args;
mod arrival;
mod channel;
pub mod clarabel_solver;
pub mod config;
pub mod cycle;
mod diagnostics;
mod instance_lock;
mod log;
mod notifications;
mod notify;
pub mod parameters;
#[doc(hidden)]
pub mod probe;
mod realtime_thread;
mod requests;
mod service_thread;
pub mod settings;
mod solver;
mod start;
mod tare;
mod wire;

pub use start::main_with_args;
