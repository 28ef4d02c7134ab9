//! The fault matrix: one test per row and situation, named after both, and again with a motion controller in C; and the page that is written
//! from the same table.
//!
//! `cargo test --release --test fault_matrix nan_` runs some; `ADMITTANCE_WRITE_DOCS=1` writes
//! `docs/faults.md`.

use std::path::Path;
use std::process::ExitCode;

use end_to_end::fault_matrix::row::{Row, Situation};
use end_to_end::fault_matrix::{is_for_c, page, rows, run, run_in_c};
use libtest_mimic::{Arguments, Failed, Trial};

/// Rows at a time: each is three real-time programs.
const THREADS: usize = 2;
/// Rows that a controller in C cannot bring about.
const NOT_FOR_C: [&str; 4] = ["controller_pauses", "samples_unnotified", "sequence_jump", "not_following"];

fn main() -> ExitCode {
    let mut arguments = Arguments::from_args();
    arguments.test_threads.get_or_insert(THREADS);
    let mut trials = vec![
        Trial::test("docs_page_is_up_to_date", docs_page),
        Trial::test("names_are_unique", names),
        Trial::test("few_rows_are_not_for_c", few_rows_are_not_for_c),
    ];
    for row in rows() {
        trials.extend(Situation::ALL.map(|situation| trial("", run, &row, situation, arguments.nocapture)));
        if is_for_c(&row) {
            let in_c = |situation| trial("in_c::", run_in_c, &row, situation, arguments.nocapture);
            trials.extend(Situation::ALL.map(in_c));
        }
    }
    libtest_mimic::run(&arguments, trials).exit_code()
}

fn trial(group: &str, run: fn(&Row, Situation) -> String, row: &Row, situation: Situation, is_told: bool) -> Trial {
    let (name, row) = (format!("{group}{}::{}", row.name, situation.name()), row.clone());
    Trial::test(name, move || {
        let report = run(&row, situation);
        if is_told {
            println!("{report}");
        }
        Ok(())
    })
}

fn docs_page() -> Result<(), Failed> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/faults.md");
    let expected = page();
    if std::env::var_os("ADMITTANCE_WRITE_DOCS").is_some() {
        std::fs::write(&path, &expected)?;
    }
    if std::fs::read_to_string(&path)? != expected {
        return Err("docs/faults.md is not what the table says: run with ADMITTANCE_WRITE_DOCS=1".into());
    }
    Ok(())
}

fn names() -> Result<(), Failed> {
    let mut names: Vec<&str> = rows().iter().map(|row| row.name).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    if names.len() == count { Ok(()) } else { Err("two rows have one name".into()) }
}

/// What a controller in C is not run through is a matter of choice: it is not to become more unseen.
fn few_rows_are_not_for_c() -> Result<(), Failed> {
    let left_out: Vec<&str> = rows().iter().filter(|row| !is_for_c(row)).map(|row| row.name).collect();
    if left_out == NOT_FOR_C { Ok(()) } else { Err(format!("not for C: {left_out:?}").into()) }
}
