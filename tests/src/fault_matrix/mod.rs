//! The fault matrix: what goes wrong, and what robot, command, log and exit codes then do, in free
//! motion and in contact. One table, [`rows`], from which the tests run real processes ([`run`])
//! and `docs/faults.md` is written ([`page`]).

mod expectation;
mod files;
mod force;
mod inject;
mod injection;
mod leader;
mod observe;
mod page;
mod process_rows;
mod recover;
pub mod row;
mod run;
mod said;
mod sample_rows;
mod setup_rows;
mod watch;

pub use leader::is_for_c;
pub use page::page;
pub use run::{run, run_in_c};

use row::{Expectation, FREE, Force, Injection, Key, Line, Robot, Row, Said, Timeline, Who};

/// Duration of a scripted fault in s: longer than the bridge by the last plan and the retreat after
/// it.
pub const SCRIPTED_S: f64 = 0.4;

/// Keys of the daemon of every row, beside the default profile: it bears a machine that is busy for
/// some cycles.
pub const DAEMON_KEYS: [Key; 5] = [
    ("control.command_delay_s", "0.001"),
    ("control.answer_budget_s", "0.0035"),
    ("control.max_sample_age_s", "0.05"),
    ("control.max_consecutive_fallbacks", "20"),
    // Two pairs share the processors: one that spins keeps the other from its samples.
    ("control.spin_s", "0.00005"),
];

const TIMELINE: Timeline = Timeline { approach: 0.25, press: 0.9, retreat: 0.3, rest: 0.6 };
/// For faults in which processes are started meanwhile.
const LONG: Timeline = Timeline { press: 1.4, retreat: 0.8, rest: 1.2, ..TIMELINE };

impl Expectation {
    /// Nothing happens.
    fn undisturbed(said: Said) -> Self {
        Self {
            note: "",
            robot: Robot::GoesOn,
            command: vec![said],
            counted: Vec::new(),
            log: Vec::new(),
            ends: Vec::new(),
            force: if said == FREE { Force::None } else { Force::Limit },
            recovery: Vec::new(),
        }
    }
}

fn row(name: &'static str, free: Expectation, contact: Expectation) -> Row {
    Row {
        name,
        fault: "",
        injection: Injection::FromStart,
        daemon: &[],
        scenario: [&[], &[]],
        timeline: TIMELINE,
        free,
        contact,
    }
}

fn lines(by: Who, texts: &[&str]) -> Vec<Line> {
    texts.iter().map(|text| Line { by, text: (*text).to_owned() }).collect()
}

fn by_daemon(texts: &[&str]) -> Vec<Line> {
    lines(Who::Daemon, texts)
}

fn by_newcomer(texts: &[&str]) -> Vec<Line> {
    lines(Who::Newcomer, texts)
}

/// Every row.
pub fn rows() -> Vec<Row> {
    [sample_rows::rows(), process_rows::rows(), setup_rows::rows()].concat()
}
