//! What both real-time programs need from the machine: clock, scheduling, processor check, logging,
//! strict configuration and exit codes.

pub mod arrival;
pub mod clock;
pub mod config;
pub mod cpu;
pub mod exit;
pub mod ipc_section;
pub mod logging;
pub mod notifications;
pub mod output;
pub mod readable;
pub mod realtime;
pub mod robot_description;
pub mod time_limit;
pub mod twist_section;
