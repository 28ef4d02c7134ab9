//! `docs/faults.md`, from the table.

use std::fmt::Write as _;

use super::injection::keys_sentence;
use super::row::{Expectation, Force, Row, Situation, Who};
use super::{DAEMON_KEYS, rows};

const HEAD: &str = "\
# What goes wrong, and what happens then

This page is written from the table that the tests run (`tests/src/fault_matrix`): every row, in free motion and in contact,
through real processes that a third one watches. Do not edit it: `ADMITTANCE_WRITE_DOCS=1 cargo test --release --test
fault_matrix docs_page` writes it anew.

The states of the command are *mode, motion, stop reason*, one after the other, from the last one before the fault to the
recovery; no others occur. In every row and at every time in contact: no offset is silently replaced by zero, the arm is held
only in mode Stopped, and no value of a command is not finite. After every recovery the test sees control again as before the
fault. Programs that a row does not let end go on, and end with 0 when they are asked to.
";

/// The page.
pub fn page() -> String {
    let mut page = HEAD.to_owned();
    // Writing to a string does not fail.
    let _ = write!(
        page,
        "\nThe daemon runs the default profile (`deploy/demo/mpc-default.toml`) with {}.\n",
        keys_sentence(&DAEMON_KEYS)
    );
    page += "\nThe true force, from the plant's truth, is above none of these bounds (normal force, computed in the tests):\n\n";
    for force in Force::ALL {
        let _ = writeln!(page, "- *{force}*: {}.", force.reason());
    }
    let _ = write!(page, "\n| fault | in free motion | in contact |\n|---|---|---|\n");
    for row in rows() {
        let last = |expected: &Expectation| expected.command.last().map_or_else(String::new, ToString::to_string);
        let _ = writeln!(page, "| [{}](#{}) | {} | {} |", row.name, row.name, last(&row.free), last(&row.contact));
    }
    for row in rows() {
        let _ = write!(page, "\n{}", section(&row));
    }
    page
}

/// The text of a cell of the page.
type Cell = fn(&Expectation) -> String;

fn section(row: &Row) -> String {
    let mut text = format!("## {}\n\n{}\n\nBrought about by: {}", row.name, row.fault, row.injection);
    for (which, keys) in [
        ("daemon's file", row.daemon),
        ("scenario (free motion)", row.scenario[0]),
        ("scenario (contact)", row.scenario[1]),
    ] {
        if !keys.is_empty() {
            let _ = write!(text, "; {which}: {}", keys_sentence(keys));
        }
    }
    text += ".\n\n| | in free motion | in contact |\n|---|---|---|\n";
    let cells: [(&str, Cell); 7] = [
        ("robot", |e| [e.note, &e.robot.to_string()].join(" ").trim().to_owned()),
        ("command", |e| e.command.iter().map(|said| format!("*{said}*")).collect::<Vec<_>>().join(" → ")),
        ("counted", |e| or_nothing(e.counted.iter().map(|counter| format!("`{}`", counter.name())).collect())),
        ("log", |e| {
            let by = |who| if who == Who::Daemon { "" } else { "newcomer: " };
            or_nothing(e.log.iter().map(|line| format!("{}\"{}\"", by(line.by), line.text)).collect())
        }),
        ("exit", |e| or(e.ends.iter().map(ToString::to_string).collect(), "everything goes on")),
        ("true force", |e| e.force.to_string()),
        ("recovery", |e| or(e.recovery.iter().map(ToString::to_string).collect(), "none needed")),
    ];
    for (name, cell) in cells {
        let [free, contact] = Situation::ALL.map(|situation| cell(row.expected(situation)).replace('|', "\\|"));
        let _ = writeln!(text, "| {name} | {free} | {contact} |");
    }
    text
}

fn or(items: Vec<String>, otherwise: &str) -> String {
    if items.is_empty() { otherwise.to_owned() } else { items.join("; ") }
}

fn or_nothing(items: Vec<String>) -> String {
    or(items, "nothing")
}
