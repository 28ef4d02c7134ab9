//! Recordings of earlier answers of the program (tests/recordings/README.md): it gives the same
//! answers now, bit by bit, up to the cycle from which the law has been changed on purpose.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use admittancectl::recording::{Item, Recording};
use end_to_end::binaries;
use end_to_end::session::output;
use ipc_types::{Mode, RecordKind, StopReason};

/// Made with the solver that the daemon no longer has.
const WITH_CLARABEL: [&str; 2] = ["default-clarabel-10ms-infeasible", "default-clarabel-expired-exhausted"];

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings")
}

/// A row of the README's table.
struct Row {
    name: String,
    cycles: u64,
    /// Cycles from the first on that are answered as they were then.
    same: u64,
}

fn recordings() -> Vec<Row> {
    let readme = std::fs::read_to_string(directory().join("README.md")).expect("the README is there");
    let rows = readme.lines().filter_map(|line| line.strip_prefix("| `"));
    rows.map(|row| {
        let (name, rest) = row.split_once("` | ").expect("a name in the first column");
        let mut columns = rest.split(" | ");
        let mut number = || columns.next().and_then(|number| number.parse().ok()).expect("a number");
        Row { name: name.to_owned(), cycles: number(), same: number() }
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
    let listed: BTreeSet<PathBuf> = recordings().iter().map(|row| path(&row.name)).collect();
    assert_eq!(found, listed);
}

#[test]
fn every_recording_is_replayed_to_the_same_bits() {
    let mut failures = Vec::new();
    for Row { name, cycles, same } in recordings().iter().filter(|row| !WITH_CLARABEL.contains(&row.name.as_str())) {
        let (code, text) = output(Command::new(&binaries().admittancectl).arg("replay").arg(path(name)));
        let (expected, phrase) = if same == cycles {
            (Some(0), format!("\n{cycles} cycles, bit-identical"))
        } else {
            (Some(1), format!("; {same} cycles before it are bit-identical"))
        };
        if code != expected || !text.contains(&phrase) {
            failures.push(format!("{name}: not {phrase:?}, but exit {code:?}: {text}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
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
    for Row { name, .. } in recordings() {
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
