//! `admittancectl enable`, `disable`, `reset`, `tare` and `reload`.

use ipc_types::{RequestKind, RequestSample};

use super::{request, tell};
use crate::Exit;
use crate::target::Target;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Refused, with exit code 1, while an axis is in contact.\n\nExample:\n  admittancectl enable --instance cell-3"
)]
pub(crate) struct EnableArgs {
    #[command(flatten)]
    target: Target,
}

#[derive(Debug, clap::Args)]
#[command(
    after_help = "In free motion the velocity offset ramps to zero and the daemon is Idle until it is enabled. In contact the arm \
    stops at a low force; enable and reset then lead back.\n\nExample:\n  admittancectl disable --instance cell-3"
)]
pub(crate) struct DisableArgs {
    #[command(flatten)]
    target: Target,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  admittancectl reset --instance cell-3")]
pub(crate) struct ResetArgs {
    #[command(flatten)]
    target: Target,
    /// Reset although the commanded motion points into the surface or the force is above the
    /// release threshold. Control resumes at once, in contact.
    #[arg(long)]
    force: bool,
}

#[derive(Debug, clap::Args)]
#[command(
    after_help = "In free motion, with the tool at rest and touching nothing: the mean of the last 200 wrenches, the tool's weight apart, \
    becomes the bias, within requests.tare_bias_max of the configuration. It lasts until a reload or a restart: put it into \
    wrench.bias to keep it.\n\nExample:\n  admittancectl tare --instance cell-3"
)]
pub(crate) struct TareArgs {
    #[command(flatten)]
    target: Target,
}

#[derive(Debug, clap::Args)]
#[command(
    after_help = "As SIGHUP does; not in contact. The file then holds: values that requests have changed, a tared bias among them, \
    go back to the file's.\n\nExample:\n  admittancectl reload --instance cell-3"
)]
pub(crate) struct ReloadArgs {
    #[command(flatten)]
    target: Target,
}

pub(crate) fn enable(args: &EnableArgs) -> Result<Exit, (Exit, String)> {
    tell(&args.target, request(RequestKind::Enable))
}

pub(crate) fn disable(args: &DisableArgs) -> Result<Exit, (Exit, String)> {
    tell(&args.target, request(RequestKind::Disable))
}

pub(crate) fn reset(args: &ResetArgs) -> Result<Exit, (Exit, String)> {
    if args.force {
        eprintln!("forced: control resumes at once, whatever the force and the commanded motion are");
    }
    tell(&args.target, RequestSample { force: u32::from(args.force), ..request(RequestKind::Reset) })
}

pub(crate) fn tare(args: &TareArgs) -> Result<Exit, (Exit, String)> {
    tell(&args.target, request(RequestKind::Tare))
}

pub(crate) fn reload(args: &ReloadArgs) -> Result<Exit, (Exit, String)> {
    tell(&args.target, request(RequestKind::Reload))
}
