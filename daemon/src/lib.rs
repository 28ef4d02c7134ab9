//! The shell.
pub mod clarabel_solver;
pub mod config;
pub mod cycle;
pub mod parameters;
mod wire;
