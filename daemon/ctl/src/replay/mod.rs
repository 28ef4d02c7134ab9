//! `admittancectl replay`: the daemon's law over the recorded samples again, and its answers
//! against the recorded ones, bit by bit.

mod counts;
mod defaults;
mod difference;
mod event;
mod session;

use std::path::PathBuf;

use admittance_host::config;
use admittance_runner::config::Config;

use crate::Exit;
use crate::recording::{Item, Source};
use defaults::Defaults;
use session::{RUN_IN, Session};

#[derive(Debug, clap::Args)]
#[command(
    after_help = "A recording that begins after the daemon did is compared from the first 128 cycles in a row in free motion on, which \
    bring a fresh controller to the same state; after a gap in the records likewise.\n\nExit codes: 0 bit-identical, 1 a cycle \
    differs, 64 usage, 65 no recording, a damaged one, or nothing in it can be compared, 66 no such file, 78 configuration.\n\nExamples:\n  \
    admittancectl replay contact.mcap\n  admittancectl replay contact.mcap --config cell-changed.toml"
)]
pub(crate) struct Args {
    #[command(flatten)]
    source: Source,
    /// Replay with this configuration in place of the recorded one: the first cycle that differs
    /// then shows what it changes.
    #[arg(long)]
    config: Option<PathBuf>,
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    let recording = args.source.open()?;
    let file = args.source.file.display();
    let text =
        match &args.config {
            Some(path) => std::fs::read_to_string(path)
                .map_err(|error| (Exit::NoInput, format!("{}: {error}", path.display())))?,
            None => recording.configurations().get(&0).cloned().ok_or_else(|| {
                (Exit::DataError, format!("{}: no configuration in it: give one with --config", file))
            })?,
        };
    let name = args.config.as_ref().map_or("the recorded configuration".into(), |path| path.display().to_string());
    let mut config: Config = config::parse(&text, &name).map_err(|error| (Exit::Config, error.to_string()))?;
    if args.config.is_none() {
        Defaults::of(recording.record_version()).complete(&mut config);
    }
    let mut session = Session::new(config, recording.configurations(), recording.record_version())?;
    let version = recording.metadata().get("version").map_or("unknown", String::as_str);
    if version != env!("CARGO_PKG_VERSION") {
        println!("recorded with version {version}, replayed with {}", env!("CARGO_PKG_VERSION"));
    }
    let mut items = recording.items();
    for item in items.by_ref() {
        let Item::Record(record) = item? else { continue };
        if let Some(difference) = session.take(&record)? {
            println!(
                "cycle {} (record {}, {:.6} s after the first) differs; {} cycles before it are bit-identical",
                record.command.sequence,
                record.sequence,
                session.seconds(&record),
                session.compared()
            );
            println!("{difference}");
            return Ok(Exit::ClaimNotMet);
        }
    }
    session.remarks().iter().for_each(|remark| println!("{remark}"));
    if !items.is_complete() {
        println!("the recording breaks off: its recorder was killed, or the disk was full");
    }
    if session.compared() == 0 {
        return Err((
            Exit::DataError,
            format!(
                "{}: no cycle can be compared: the recording has neither the daemon's first records nor {RUN_IN} cycles in a row \
                 in free motion to find the controller's state from",
                file
            ),
        ));
    }
    println!("{} cycles, bit-identical", session.compared());
    Ok(Exit::Ok)
}
