//! Between admittanced and an ABB robot. The robot sends a UDP message each cycle, and keeps the last speed that it was told
//! until its CommTimeout: so this edge answers every cycle, with zeros when nothing better is known.
//!
//! The data path: `link` receives → [`reading`] checks and converts → [`session`] numbers, speeds, stamps → [`lead`] says where
//! the arm is led → `edge` publishes the state sample and takes the answer by the rules of `admittance-client` → [`fade`], for
//! an answer that is missing → [`guide`] → `link` sends.

mod args;
pub mod arm;
pub mod config;
mod edge;
pub mod fade;
pub mod guide;
pub mod lead;
mod leader;
mod link;
mod notify;
pub mod reading;
pub mod robot_clock;
pub mod session;
mod start;

pub use args::Args;
pub use start::{main_with_args, main_with_arm};
