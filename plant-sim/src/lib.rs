//! The emulated motion controller and robot: joint speed loops (4), contact (19)-(21), wrench
//! estimate (6).
//!
//! The data path: [`scenario`] → [`setup`] → [`plant`] ([`motion`] and the client's playback give
//! the joint reference, [`joints`] follow it: [`joint_loop`] or [`rigid_body`]; [`environment`] pushes back,
//! [`wrench_estimate`], [`noise`], [`wrench_sensor`] and [`faults`] make the sample) → [`run`] in
//! virtual time, or `shell` in real time; `egm` in real time as a robot that is guided over UDP.

mod args;
pub mod drives_section;
mod egm;
pub mod egm_section;
pub mod environment;
pub mod faults;
pub mod joint_loop;
pub mod joints;
pub mod maxwell;
pub mod motion;
pub mod noise;
pub mod plant;
pub mod pose;
pub mod rigid_body;
pub mod run;
pub mod scenario;
pub mod setup;
mod shell;
pub mod summary;
pub mod tool_inertia;
pub mod wrench_estimate;
pub mod wrench_sensor;

use admittance_core::quantities::Span;

pub use args::Args;
pub use shell::main_with_args;

fn seconds(duration_ns: u64) -> f64 {
    Span::from_nanoseconds(duration_ns).seconds()
}
