//! Recordings of earlier answers of the program (tests/recordings/README.md): it gives the same
//! answers now, bit by bit.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use admittancectl::recording::{Item, Recording};
use end_to_end::binaries;
use end_to_end::session::output;
use ipc_types::{Mode, RecordKind, StopReason};

/// Made with the solver that the daemon no longer has.
const WITH_CLARABEL: [&str; 2] = ["default-clarabel-10ms-infeasible", "default-clarabel-expired-exhausted"];

/// Where the solver has been mended since: the cycles before the first that differs, and by how
/// much at most (m/s, rad/s, N). A row of its working set was missed there by more than the 1e-10
/// of its scale that the solver promises; it is now met.
const MENDED: [(&str, u64, f64); 1] = [("seven-joint-infeasible-forced-reset", 22, 1e-8)];

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings")
}

/// Name and number of cycles of each recording, as the README's table has them.
fn recordings() -> Vec<(String, u64)> {
    let readme = std::fs::read_to_string(directory().join("README.md")).expect("the README is there");
    let rows = readme.lines().filter_map(|line| line.strip_prefix("| `"));
    rows.map(|row| {
        let (name, rest) = row.split_once("` | ").expect("a name in the first column");
        let cycles = rest.split(' ').next().and_then(|number| number.parse().ok());
        (name.to_owned(), cycles.expect("a number in the second column"))
    })
    .collect()
}

fn path(name: &str) -> PathBuf {
    directory().join(name).with_extension("mcap")
}

#[test]
fn every_file_is_in_the_table() {
    let entries = std::fs::read_dir(directory()).expect("the directory is there");
    let paths = entries.map(|entry| entry.expect("readable").path());
    let found: BTreeSet<PathBuf> = paths.filter(|path| path.extension().is_some_and(|end| end == "mcap")).collect();
    let listed: BTreeSet<PathBuf> = recordings().iter().map(|(name, _)| path(name)).collect();
    assert_eq!(found, listed);
}

#[test]
fn every_recording_is_replayed_to_the_same_bits() {
    let mut failures = Vec::new();
    let is_excepted = |name: &str| WITH_CLARABEL.contains(&name) || MENDED.iter().any(|(mended, ..)| *mended == name);
    for (name, cycles) in recordings().iter().filter(|(name, _)| !is_excepted(name)) {
        let (code, text) = output(Command::new(&binaries().admittancectl).arg("replay").arg(path(name)));
        if code != Some(0) || !text.contains(&format!("\n{cycles} cycles, bit-identical")) {
            failures.push(format!("{name}: exit {code:?}: {text}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn where_the_solver_was_mended_the_answers_are_close() {
    for (name, same, most) in MENDED {
        let (code, text) = output(Command::new(&binaries().admittancectl).arg("replay").arg(path(name)));
        assert_eq!(code, Some(1), "{name}: {text}");
        assert!(text.contains(&format!("{same} cycles before it are bit-identical")), "{name}: {text}");
        let differences = text.lines().filter(|line| line.starts_with("| command.")).map(|line| {
            let last = line.trim_end_matches(['|', ' ']).rsplit(' ').next().expect("four columns");
            last.parse::<f64>().unwrap_or_else(|_| panic!("no difference in {line}"))
        });
        let worst = differences.fold(0.0, |worst: f64, difference| worst.max(difference.abs()));
        assert!(worst > 0.0 && worst < most, "{name}: {worst:e}");
    }
}

#[test]
fn a_recording_with_a_key_that_is_gone_says_so() {
    for name in WITH_CLARABEL {
        let (code, text) = output(Command::new(&binaries().admittancectl).arg("replay").arg(path(name)));
        let expected = "mpc.solver = \"clarabel\": this key is gone: there is one solver";
        assert_eq!((code, text.contains(expected)), (Some(78), true), "{name}: {text}");
    }
}

#[test]
fn every_mode_and_every_stop_reason_of_the_law_is_in_them() {
    let (mut modes, mut reasons) = (BTreeSet::new(), BTreeSet::new());
    for (name, _) in recordings() {
        let recording = Recording::open(&path(&name)).expect("a recording");
        for item in recording.items() {
            if let Ok(Item::Record(record)) = item
                && record.kind == RecordKind::Sample.code()
            {
                modes.insert(record.command.mode);
                reasons.insert(record.command.stop_reason);
            }
        }
    }
    assert_eq!(modes, Mode::ALL.iter().map(|mode| mode.code()).collect());
    // After a panic no law is left to record.
    let by_the_law = StopReason::ALL.iter().filter(|reason| **reason != StopReason::InternalError);
    let expected: BTreeSet<u32> = by_the_law.map(|reason| reason.code()).chain([StopReason::NONE]).collect();
    assert_eq!(reasons, expected);
}
