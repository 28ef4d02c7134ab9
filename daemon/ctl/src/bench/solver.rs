//! `admittancectl bench solver`: how fast this machine solves.

use std::path::PathBuf;

use admittance_judge::bench::{Figures, bench};
use admittance_judge::problem_file::{ProblemFile, ProblemFileError};
use comfy_table::Table;

use crate::Exit;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  admittancectl bench solver daemon/judge/problems/*.bin\n  \
    admittancectl bench solver daemon/judge/problems/d6c3_h20.bin --json\n\nThe format of the files is described in \
    daemon/judge/src/problem_file.rs. Times in µs, condensation included; ratio: median of Clarabel in its faster form over the \
    warm median.")]
pub(crate) struct Args {
    /// Files of problems with their exact solutions.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    // All files are read before the first is timed: a typing error shows at once.
    let mut files = Vec::new();
    for path in &args.files {
        let file = ProblemFile::read(path).map_err(|error| {
            let code = match error {
                ProblemFileError::Read(_) => Exit::NoInput,
                ProblemFileError::Format { .. } => Exit::DataError,
            };
            (code, format!("{}: {error}", path.display()))
        })?;
        files.push((path.display().to_string(), file));
    }
    let figures: Vec<Figures> = files.iter().map(|(name, file)| bench(name, file)).collect();
    if args.json {
        let json = serde_json::to_string_pretty(&figures).map_err(|error| (Exit::Internal, error.to_string()))?;
        println!("{json}");
    } else {
        println!("{}", table(&figures));
    }
    Ok(Exit::Ok)
}

fn table(figures: &[Figures]) -> Table {
    let mut table = Table::new();
    table.set_header([
        "file",
        "problems",
        "deviation",
        "warm p50, p99, p999 (µs)",
        "cold p50, p99 (µs)",
        "Clarabel p50 (µs)",
        "ratio",
        "iterations",
    ]);
    for f in figures {
        table.add_row([
            f.file.clone(),
            f.problems.to_string(),
            format!("{:.1e}", f.max_deviation),
            format!("{:.2}, {:.2}, {:.2}", f.warm_us.p50, f.warm_us.p99, f.warm_us.p999),
            format!("{:.2}, {:.2}", f.cold_us.p50, f.cold_us.p99),
            format!("{:.1}", f.clarabel_us.p50),
            format!("{:.1}", f.ratio),
            f.iterations_max.to_string(),
        ]);
    }
    table
}
