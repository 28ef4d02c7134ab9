//! `admittance-lab bench solver`: how fast this machine solves.

use std::path::PathBuf;

use admittance_judge::bench::{Figures, bench};
use admittance_judge::default_profile::{GenerationError, planar, spatial};
use admittance_judge::problem_file::{ProblemFile, ProblemFileError, Task};
use admittance_judge::sequence::Sequence;
use comfy_table::Table;

use admittancectl::Exit;

/// Of the contacts that the built-in sequences come from.
const SEED: u64 = 1;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  admittance-lab bench solver\n  \
    admittance-lab bench solver daemon/lab/judge/problems/d6c3_h20.bin --json\n\nThe format of the files is described in \
    daemon/lab/judge/src/problem_file.rs. Times in µs, condensation included; ratio: median of Clarabel in its faster form \
    over the warm median.")]
pub(crate) struct Args {
    /// Files of problems with their exact solutions; without any, contacts of the default profile
    /// on two and on six joints.
    files: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Times a sequence.
struct Bench<'a>(&'a str);

impl Task for Bench<'_> {
    type Output = Figures;

    fn run<const N: usize, const M: usize>(self, sequence: &Sequence<N, M>) -> Figures {
        bench(self.0, sequence)
    }
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    let figures = if args.files.is_empty() { of_default_profile() } else { of_files(&args.files) }?;
    if args.json {
        let json = serde_json::to_string_pretty(&figures).map_err(|error| (Exit::Internal, error.to_string()))?;
        println!("{json}");
    } else {
        println!("{}", table(&figures));
    }
    Ok(Exit::Ok)
}

fn of_files(paths: &[PathBuf]) -> Result<Vec<Figures>, (Exit, String)> {
    // All files are read before the first is timed: a typing error shows at once.
    let mut files = Vec::new();
    for path in paths {
        let file = ProblemFile::read(path).map_err(|error| {
            let code = match error {
                ProblemFileError::Read(_) => Exit::NoInput,
                ProblemFileError::Format { .. } => Exit::DataError,
            };
            (code, format!("{}: {error}", path.display()))
        })?;
        files.push((path.display().to_string(), file));
    }
    Ok(files.iter().map(|(name, file)| file.run(Bench(name))).collect())
}

fn of_default_profile() -> Result<Vec<Figures>, (Exit, String)> {
    let internal = |error: GenerationError| (Exit::Internal, error.to_string());
    let slow: Sequence<2, 2> = planar(0.004, SEED).map_err(internal)?;
    let fast: Sequence<2, 2> = planar(0.001, SEED).map_err(internal)?;
    let one_axis: Sequence<6, 1> = spatial(SEED).map_err(internal)?;
    let three_axes: Sequence<6, 3> = spatial(SEED).map_err(internal)?;
    let six_axes: Sequence<6, 6> = spatial(SEED).map_err(internal)?;
    Ok(vec![
        Bench("2 joints, 2 axes, 4 ms").run(&slow),
        Bench("2 joints, 2 axes, 1 ms").run(&fast),
        Bench("6 joints, 1 axis").run(&one_axis),
        Bench("6 joints, 3 axes").run(&three_axes),
        Bench("6 joints, 6 axes").run(&six_axes),
    ])
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
