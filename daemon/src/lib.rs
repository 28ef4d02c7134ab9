//! The daemon beside a motion controller: one robot, one real-time thread.
//!
//! The data path: `realtime_thread` receives a state sample → the runner's cycle steps the law →
//! `realtime_thread` publishes the command, and gives a record to `service_thread` through
//! `channel`.

mod args;
mod channel;
mod diagnostics;
mod instance_lock;
mod likeliest_stiffness;
mod log;
mod notify;
#[doc(hidden)]
pub mod probe;
mod realtime_thread;
mod requests;
mod service_thread;
mod start;
mod tare;

pub use args::Args;
pub use start::main_with_args;
