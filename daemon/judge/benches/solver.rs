//! `cargo bench -p admittance-judge`: every problem file, and sequences of the default profile's own shape (uneven steps, force
//! rows inside steps, speed, position and rate rows), each with at least 10,000 warm and cold solves beside Clarabel in the
//! same run. No benchmark harness: what counts are percentiles over sequences that depend on one another, and a ratio.

use std::error::Error;
use std::path::PathBuf;

use admittance_judge::bench::{Figures, bench, bench_sequence};
use admittance_judge::default_profile::{planar, spatial};
use admittance_judge::problem_file::ProblemFile;

const SEED: u64 = 1;

fn print(f: &Figures) {
    println!(
        "{:<22} warm {:>8.2} {:>8.2} {:>8.2}   cold {:>8.2} {:>8.2}   Clarabel {:>8.1}   ratio {:>6.1}   iterations {:>3}",
        f.file,
        f.warm_us.p50,
        f.warm_us.p99,
        f.warm_us.p999,
        f.cold_us.p50,
        f.cold_us.p99,
        f.clarabel_us.p50,
        f.ratio,
        f.iterations_max
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("µs, condensation included: warm p50 p99 p99.9, cold p50 p99, Clarabel p50 in its best form and setting");
    let directory = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("problems");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&directory)?.map(|entry| Ok(entry?.path())).collect::<Result<_, std::io::Error>>()?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "bin"));
    files.sort();
    for path in files {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        print(&bench(&name, &ProblemFile::read(&path)?));
    }
    print(&bench_sequence("default, 2 axes, 4 ms", &planar(0.004, SEED)?, &[]));
    print(&bench_sequence("default, 2 axes, 1 ms", &planar(0.001, SEED)?, &[]));
    print(&bench_sequence("default, 6 j, 1 axis", &spatial::<1>(SEED)?, &[]));
    print(&bench_sequence("default, 6 j, 3 axes", &spatial::<3>(SEED)?, &[]));
    print(&bench_sequence("default, 6 j, 6 axes", &spatial::<6>(SEED)?, &[]));
    Ok(())
}
