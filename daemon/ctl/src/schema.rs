//! `admittancectl schema`: the shared-memory contract, from the types themselves.

use crate::Exit;

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  admittancectl schema --json > admittanced-schema.json")]
pub(crate) struct Args {
    /// Every service, type, field and enum as JSON (the default).
    #[arg(long)]
    json: bool,
    /// The types as a C header.
    #[arg(long, conflicts_with = "json")]
    c_header: bool,
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    if args.c_header {
        print!("{}", ipc_types::c_header());
    } else {
        println!("{}", ipc_types::schema_json());
    }
    Ok(Exit::Ok)
}
