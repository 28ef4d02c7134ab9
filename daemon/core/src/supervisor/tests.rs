//! The modes and what changes them: every pair, tests of this stage alone.

use std::fmt::Write as _;
use std::path::Path;

use admittance_vocabulary::{ModeName, StopReason};

use super::{Cause, ContactMemory, Mode, OnContactLost, OnInfeasible, Policy, Stop, Stopping, Supervisor, decide};
use crate::common;
use crate::quantities::Instant;

const FIRST: Stop = Stop { reason: StopReason::Infeasible, singular: None };
const BEGUN: Instant = Instant::from_nanoseconds(5);
const NOW: Instant = Instant::from_nanoseconds(7);

fn policies() -> impl Iterator<Item = Policy> {
    [OnInfeasible::Halt, OnInfeasible::MinimumForceStop].into_iter().flat_map(|on_infeasible| {
        [OnContactLost::Continue, OnContactLost::Stop]
            .into_iter()
            .map(move |on_contact_lost| Policy { on_infeasible, on_contact_lost })
    })
}

/// A mode of that name, with data.
fn mode(name: ModeName) -> Mode<2> {
    match name {
        ModeName::Idle => Mode::Idle(None),
        ModeName::Free => Mode::Free { pull: None, bounced: None },
        ModeName::Contact => {
            let mut memory = ContactMemory::new(None, BEGUN);
            memory.unsolved = 2;
            Mode::Contact(memory)
        }
        ModeName::Stopping => Mode::Stopping(Stopping { stop: FIRST, since: BEGUN, unsolved: 1 }),
        ModeName::Stopped => Mode::Stopped(FIRST),
    }
}

fn supervisor(name: ModeName, policy: Policy) -> Supervisor<2> {
    let mut supervisor = Supervisor::new(common::parameters().supervisor());
    supervisor.settings.policy = policy;
    supervisor.mode = mode(name);
    supervisor
}

#[test]
fn every_cause_in_every_mode_leads_where_the_rules_say() {
    use ModeName::{Contact, Free, Idle, Stopped, Stopping};
    for policy in policies() {
        for (&from, &cause) in ModeName::ALL.iter().flat_map(|from| Cause::ALL.iter().map(move |cause| (from, cause))) {
            let next = decide(from, cause, policy);
            let what = format!("{cause} in {from} leads to {next}");
            // A stop is latched: it ends in Stopped, and that by a person alone.
            assert!(from != Stopping || matches!(next, Stopping | Stopped), "{what}");
            let is_reset = matches!(cause, Cause::Reset | Cause::ForcedReset);
            assert_eq!(from == Stopped && next != Stopped, from == Stopped && is_reset, "{what}");
            // A pressing arm is never released: contact ends with a release or a stop.
            let is_release = matches!(cause, Cause::Release | Cause::ContactLost);
            assert!(from != Contact || next != Idle, "{what}");
            assert!(from != Contact || next != Free || is_release, "{what}");
            // Contact begins in free motion, and control with a valid sample without force.
            assert!(next != Contact || from == Contact || (from, cause) == (Free, Cause::Touch), "{what}");
            assert!(from != Idle || next != Free || cause == Cause::Ready, "{what}");
            // A stop that begins says why.
            let begins = matches!(next, Stopping | Stopped) && !matches!(from, Stopping | Stopped);
            assert!(!begins || cause.reason().is_some(), "{what}");
            // Without drives the arm cannot brake, and where J has no inverse it cannot be steered.
            let is_lost = matches!(cause, Cause::DrivesDisabled | Cause::Singular);
            assert!(!is_lost || !matches!(from, Contact | Stopping) || next == Stopped, "{what}");
        }
    }
}

#[test]
fn the_policy_decides_two_pairs_and_no_other() {
    let mut decided = Vec::new();
    for &from in ModeName::ALL {
        for &cause in Cause::ALL {
            let first = decide(from, cause, policies().next().expect("four"));
            if policies().any(|policy| decide(from, cause, policy) != first) {
                decided.push((from, cause));
            }
        }
    }
    assert_eq!(decided, [(ModeName::Contact, Cause::ContactLost), (ModeName::Contact, Cause::Infeasible)]);
}

#[test]
fn the_stage_goes_where_decide_says_and_keeps_the_first_reason() {
    for policy in policies() {
        for (&from, &cause) in ModeName::ALL.iter().flat_map(|from| Cause::ALL.iter().map(move |cause| (from, cause))) {
            let mut supervisor = supervisor(from, policy);
            supervisor.apply(cause, NOW);
            let what = format!("{cause} in {from}");
            assert_eq!(supervisor.mode.name(), decide(from, cause, policy), "{what}");
            match (mode(from), supervisor.mode) {
                (before, after) if before.name() == after.name() => match (before, after) {
                    (Mode::Idle(_), Mode::Idle(reason)) => assert_eq!(reason, cause.reason(), "{what}"),
                    _ => assert_eq!(after, before, "{what}: the data of a mode that stays"),
                },
                (Mode::Stopping(_), after) => assert_eq!(after, Mode::Stopped(FIRST), "{what}"),
                (before, Mode::Stopping(stopping)) => {
                    let unsolved = if let Mode::Contact(memory) = before { memory.unsolved } else { 0 };
                    let stop = Stop { reason: cause.reason().expect("a stop has one"), singular: None };
                    let expected = Stopping { stop, since: NOW, unsolved };
                    assert_eq!(stopping, expected, "{what}");
                }
                (_, after @ (Mode::Idle(_) | Mode::Stopped(_))) => {
                    assert_eq!(
                        after.stop_reason(),
                        if cause == Cause::Reset { None } else { cause.reason() },
                        "{what}"
                    );
                }
                (_, after) => assert_eq!(after.stop_reason(), None, "{what}"),
            }
        }
    }
}

/// The table of `docs/architecture.md`: what each cause leads to in each mode.
fn table() -> String {
    let by_default = Policy { on_infeasible: OnInfeasible::MinimumForceStop, on_contact_lost: OnContactLost::Continue };
    let otherwise = Policy { on_infeasible: OnInfeasible::Halt, on_contact_lost: OnContactLost::Stop };
    let mut table = String::from("| cause |");
    for mode in ModeName::ALL {
        write!(table, " in {mode} |").expect("a string takes all");
    }
    table += " what it is |\n|---|---|---|---|---|---|---|\n";
    for &cause in Cause::ALL {
        write!(table, "| {cause} |").expect("a string takes all");
        for &mode in ModeName::ALL {
            let cell = match (decide(mode, cause, by_default), decide(mode, cause, otherwise)) {
                (next, other) if next != other => format!("{next} or {other}, as configured"),
                (next, _) if next == mode => String::new(),
                (next, _) => next.to_string(),
            };
            write!(table, " {cell} |").expect("a string takes all");
        }
        writeln!(table, " {} |", cause.meaning()).expect("a string takes all");
    }
    table
}

#[test]
fn the_table_in_the_docs_is_that_of_decide() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/architecture.md");
    let page = std::fs::read_to_string(&path).expect("docs/architecture.md is there");
    let (begin, end) = ("<!-- modes: printed by a test -->\n", "<!-- end of modes -->");
    let (before, rest) = page.split_once(begin).expect("the table's begin is marked");
    let (found, after) = rest.split_once(end).expect("the table's end is marked");
    let expected = table();
    if std::env::var_os("ADMITTANCE_WRITE_DOCS").is_some() {
        std::fs::write(&path, format!("{before}{begin}{expected}{end}{after}")).expect("docs can be written");
    } else {
        assert_eq!(found, expected, "ADMITTANCE_WRITE_DOCS=1 cargo test --release -p admittance-core writes it");
    }
}
