//! Roles in which this program starts itself as other processes:
//! [`Session`](crate::session::Session) runs a daemon and a plant without knowing where those
//! programs are installed.

use std::ffi::OsString;

use clap::Subcommand;

use crate::{Exit, Outcome, record};

/// A hidden subcommand.
#[derive(Debug, Subcommand)]
pub enum Role {
    /// The daemon itself, in this process.
    #[command(hide = true, disable_help_flag = true)]
    RoleDaemon {
        /// The daemon's arguments.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<OsString>,
    },
    /// The plant itself, in this process.
    #[command(hide = true, disable_help_flag = true)]
    RolePlant {
        /// The plant's arguments.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<OsString>,
    },
    /// The recorder.
    #[command(hide = true)]
    RoleRecorder(record::Args),
}

/// Plays a role.
///
/// # Errors
/// What the recorder could not do; daemon and plant say so themselves.
pub fn run(role: Role) -> Outcome<Exit> {
    match role {
        Role::RoleDaemon { arguments } => Ok(admittanced::main_with_args(arguments.into_iter())),
        Role::RolePlant { arguments } => Ok(plant_sim::main_with_args(arguments.into_iter())),
        Role::RoleRecorder(args) => record::run(&args),
    }
}
