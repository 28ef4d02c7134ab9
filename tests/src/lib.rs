//! What the end-to-end tests share: the shipped binaries, a private place in shared memory,
//! children that never outlive their test, and what a test needs beyond the Rust toolchain.
//!
//! Declare the [`PrivateIpc`] before the [`Child`]ren that use it: values are dropped in reverse
//! order, and files must not be removed under a running program. Timeouts only end a test that
//! hangs; no test asserts how fast something is.

mod answers;
mod binaries;
pub mod c_controller;
mod child;
pub mod closed_loop;
pub mod drive_judge;
mod driven_clock;
pub mod egm_robot;
pub mod fault_matrix;
mod fresh;
pub mod lock_step;
mod machine;
pub mod motor_torque;
pub mod mujoco;
pub mod namespaces;
mod needs;
pub mod page;
mod private_ipc;
pub mod python_package;
pub mod session;
mod stepped_clock;
mod strace;
mod systemd;
mod terminal;

pub use answers::Answers;
pub use binaries::{Binaries, binaries};
pub use child::{Child, PATIENCE, wait_until};
pub use driven_clock::DrivenClock;
pub use fresh::{fresh, share};
pub use machine::{certain, undisturbed, was_away_within};
pub use needs::{ICEORYX2_PYTHON_VERSION, MCAP_PYTHON_VERSION, MUJOCO_PYTHON_VERSION, Need, needs, python, tunnel};
pub use private_ipc::PrivateIpc;
pub use stepped_clock::SteppedClock;
pub use strace::Strace;
pub use systemd::Systemd;
pub use terminal::{Terminal, screen, take_terminal};
