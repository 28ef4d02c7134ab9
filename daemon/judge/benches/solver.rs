//! `cargo bench -p admittance-judge`: every problem file, and sequences of the default profile's own shape (uneven steps, force
//! rows inside steps, speed, position and rate rows).
//!
//! First a table: percentiles of at least 10,000 warm and cold solves each, with Clarabel taking turns, so that what else the
//! machine does meets both. Then Criterion, on whole sequences, since warm-started problems depend on one another: what has
//! changed since the last run.

use std::error::Error;
use std::path::PathBuf;
use std::time::Duration;

use admittance_judge::bench::{Figures, Opponent, Setting, bench_sequence};
use admittance_judge::default_profile::{planar, spatial};
use admittance_judge::problem_file::{ProblemFile, Task};
use admittance_judge::sequence::{Runner, Sequence, Start};
use criterion::{Criterion, SamplingMode, Throughput};

const SEED: u64 = 1;

fn print(f: &Figures) {
    println!(
        "{:<22} warm {:>8.2} {:>8.2} {:>8.2}   cold {:>8.2} {:>8.2}   Clarabel {:>8.1}   ratio {:>6.1}   iterations {:>3}   {}",
        f.file,
        f.warm_us.p50,
        f.warm_us.p99,
        f.warm_us.p999,
        f.cold_us.p50,
        f.cold_us.p99,
        f.clarabel_us.p50,
        f.ratio,
        f.iterations_max,
        f.clarabel_form.map_or_else(String::new, |setting| format!("{setting:?}"))
    );
}

/// The table's line of a sequence, and the setting of Clarabel that was fastest.
struct Line<'a>(&'a str);

impl Task for Line<'_> {
    type Output = Option<Setting>;

    fn run<const N: usize, const M: usize>(self, sequence: &Sequence<N, M>) -> Option<Setting> {
        let figures = bench_sequence(self.0, sequence);
        print(&figures);
        figures.clarabel_form
    }
}

/// Criterion on a sequence.
struct Group<'a> {
    criterion: &'a mut Criterion,
    name: &'a str,
    /// Of Clarabel.
    setting: Setting,
}

impl Task for Group<'_> {
    type Output = ();

    fn run<const N: usize, const M: usize>(self, sequence: &Sequence<N, M>) {
        let mut group = self.criterion.benchmark_group(self.name);
        group.throughput(Throughput::Elements(sequence.problems.len() as u64)).sampling_mode(SamplingMode::Flat);
        let mut runner = Runner::new(sequence);
        for (name, start) in [("warm", Start::Warm), ("cold", Start::Cold)] {
            group.bench_function(name, |bencher| {
                bencher.iter(|| {
                    runner.reset();
                    let solve =
                        |index| runner.solve(sequence, index, start, |outcome, _, _, _, _| outcome.iterations());
                    (0..sequence.problems.len()).map(solve).sum::<u32>()
                });
            });
        }
        if let Some(mut opponent) = Opponent::new(sequence, self.setting) {
            // It takes up to a second each: as few as Criterion accepts.
            group.sample_size(10);
            group.bench_function("clarabel", |bencher| bencher.iter(|| opponent.solve_all()));
        }
        group.finish();
    }
}

/// A problem file, or a sequence of the default profile.
enum Source {
    File(ProblemFile),
    Planar(Sequence<2, 2>),
    OneAxis(Sequence<6, 1>),
    ThreeAxes(Sequence<6, 3>),
    SixAxes(Sequence<6, 6>),
}

impl Source {
    fn run<T: Task>(&self, task: T) -> T::Output {
        match self {
            Self::File(file) => file.run(task),
            Self::Planar(sequence) => task.run(sequence),
            Self::OneAxis(sequence) => task.run(sequence),
            Self::ThreeAxes(sequence) => task.run(sequence),
            Self::SixAxes(sequence) => task.run(sequence),
        }
    }
}

fn sources() -> Result<Vec<(String, Source)>, Box<dyn Error>> {
    let directory = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("problems");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&directory)?.map(|entry| Ok(entry?.path())).collect::<Result<_, std::io::Error>>()?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "bin"));
    files.sort();
    let mut sources = Vec::new();
    for path in files {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        sources.push((name.into_owned(), Source::File(ProblemFile::read(&path)?)));
    }
    for (name, sequence) in [
        ("default, 2 axes, 4 ms", Source::Planar(planar(0.004, SEED)?)),
        ("default, 2 axes, 1 ms", Source::Planar(planar(0.001, SEED)?)),
        ("default, 6 j, 1 axis", Source::OneAxis(spatial(SEED)?)),
        ("default, 6 j, 3 axes", Source::ThreeAxes(spatial(SEED)?)),
        ("default, 6 j, 6 axes", Source::SixAxes(spatial(SEED)?)),
    ] {
        sources.push((name.to_owned(), sequence));
    }
    Ok(sources)
}

/// Whether times are wanted: tests run this too, and then it must be quick.
fn is_timed() -> bool {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |name: &str| arguments.iter().any(|argument| argument == name);
    has("--bench") && !["--test", "--list", "--help", "-h"].into_iter().any(has)
}

fn main() -> Result<(), Box<dyn Error>> {
    let sources = sources()?;
    let mut settings = vec![None; sources.len()];
    if is_timed() {
        println!(
            "µs, condensation included: warm p50 p99 p99.9, cold p50 p99, Clarabel p50 in its best form and setting"
        );
        for ((name, source), setting) in sources.iter().zip(&mut settings) {
            *setting = source.run(Line(name));
        }
    }
    let mut criterion = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
        .without_plots()
        .configure_from_args();
    for ((name, source), setting) in sources.iter().zip(settings) {
        let setting = setting.unwrap_or(Setting::SparseEquilibrated);
        source.run(Group { criterion: &mut criterion, name, setting });
    }
    criterion.final_summary();
    Ok(())
}
