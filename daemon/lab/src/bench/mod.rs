//! `admittance-lab bench`: how fast this machine is, at what the daemon needs of it.

mod egm;
mod jitter;
mod solver;

use admittancectl::Exit;

pub(crate) use jitter::observed::{self, Args as ObservedArgs};

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  admittance-lab bench solver daemon/lab/judge/problems/d2_h5.bin\n  admittance-lab bench jitter --rate-hz 1000\n  \
    admittance-lab bench egm"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Solve the MPC problems of some files over and over, beside Clarabel in the same run.
    Solver(solver::Args),
    /// Time plant, daemon and plant again in real time, beside a loop that does nothing, in the
    /// same run.
    Jitter(jitter::Args),
    /// Time robot, EGM edge, daemon and back in real time, beside a UDP echo in the same run.
    Egm(egm::Args),
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    match &args.what {
        What::Solver(args) => solver::run(args),
        What::Jitter(args) => jitter::run(args),
        What::Egm(args) => egm::run(args),
    }
}
