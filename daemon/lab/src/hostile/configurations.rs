//! Mutated configurations: what validate says, what a running daemon makes of them, and one that
//! starts.

use std::ffi::OsStr;
use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::Instant;

use admittance_runner::config::Config;
use ipc_types::services::{self, Access};
use ipc_types::{Client, Instance, Node, RequestKind, ResponseStatus};
use rand::{Rng, RngExt as _};

use super::arena::{Arena, Findings, PATIENCE, POLL, in_arena};
use super::cell::Cell;
use super::controller::Controller;
use super::mutate::Mutations;
use super::watch::Watch;
use super::{Count, Counts};
use crate::answers::Bounds;
use admittancectl::{Exit, Outcome, consequences, validate};

/// Configurations of one case.
pub(super) const PER_CASE: u64 = 500;
/// Of how many one is given to a daemon that starts, and of how many that are refused one to the
/// running daemon as well.
const STARTED: u32 = 50;
const REFUSED_TWICE: u32 = 5;
/// Of how many accepted ones the consequences are worked out.
const THOUGHT_THROUGH: u32 = 200;
/// Longest text of errors, in bytes.
const LONGEST: usize = 64 << 10;

/// What validate says of a file; a panic is an error of its own.
pub(crate) fn validated(path: &Path) -> Result<Config, (Exit, String)> {
    catch_unwind(AssertUnwindSafe(|| validate::load(path)))
        .unwrap_or_else(|_| Err((Exit::Internal, "validate panicked".to_owned())))
}

/// What is wrong with an error's text.
fn flaw(code: Exit, text: &str) -> Option<&'static str> {
    match () {
        () if code == Exit::Internal => Some("a failure of its own"),
        () if text.len() > LONGEST => Some("too long"),
        () if text.chars().any(|letter| letter.is_control() && letter != '\n') => Some("control characters"),
        () if !text.lines().all(|line| line.contains(".toml")) => Some("lines that do not name the file"),
        () if !text.lines().all(|line| line.contains("accepted") || line.ends_with(" more errors")) => {
            Some("nothing that would be accepted")
        }
        () => None,
    }
}

/// One case.
pub(super) fn case(
    random: &mut rand_chacha::ChaCha8Rng,
    daemon: Option<&Path>,
    findings: &mut Findings,
) -> Outcome<Counts> {
    let cell = Cell::draw(random)?;
    in_arena(&cell.text, daemon, findings, |arena, findings| attack(&cell, arena, random, findings))
}

fn attack(cell: &Cell, arena: &mut Arena, random: &mut impl Rng, findings: &mut Findings) -> Result<Counts, String> {
    let text = |(_, why): (Exit, String)| why;
    let node = arena.node("hostile configurations").map_err(text)?;
    let settings = arena.session.settings().clone();
    let client = arena.client(&node)?;
    let bounds = Bounds::of(&cell.config);
    let mut watch = Watch::new(&node, &settings.instance, &cell.config, bounds.clone())?;
    let mut controller = Controller::open(&node, &settings, &cell.air)?;
    controller.calm(&cell.air, &client, &mut watch, findings)?;
    arena.look_at_holdings(findings);
    let all = Mutations::of(&cell.text);
    let (mut drawn, mut valid, mut starts, mut reloads) = (0, 0, 0, 0);
    // A reload that is refused leaves what an earlier one brought.
    let mut in_force = bounds.clone();
    for _ in 0..PER_CASE {
        drawn += 1;
        let bytes = all.draw(random);
        let failed = |error: std::io::Error| error.to_string();
        std::fs::write(&arena.config_path, &bytes).map_err(failed)?;
        let begun = Instant::now();
        let validated = validated(&arena.config_path);
        if begun.elapsed() > PATIENCE {
            findings.note(format!("validate took {:.0} s", begun.elapsed().as_secs_f64()));
        }
        if let Err((code, why)) = &validated
            && let Some(flaw) = flaw(*code, why)
        {
            findings.note(format!("{flaw}: {why}"));
        }
        if let Ok(config) = &validated {
            valid += 1;
            watch.allow(config, in_force.clone().or(&Bounds::of(config)));
            if random.random_ratio(1, THOUGHT_THROUGH) {
                findings
                    .take(catch_unwind(|| consequences::lines(config)).map_err(|_| "validate -v panicked".to_owned()));
            }
        }
        if validated.is_ok() || random.random_ratio(1, REFUSED_TWICE) {
            reloads += 1;
            let verdict = validated.as_ref().map(drop).map_err(|(_, why)| why.clone());
            let done = reload(&verdict, &client, &mut controller, &mut watch, findings);
            if let (Some(true), Ok(config)) = (findings.take(done), &validated) {
                in_force = Bounds::of(config);
            }
        }
        if random.random_ratio(1, STARTED) {
            starts += 1;
            let verdict = validated.map(drop);
            findings.take(start(arena, &node, &verdict));
        }
        if !findings.0.is_empty() {
            // What has been found is seen again with this file.
            findings.note(format!("the file is {}", kept(&bytes).map_err(failed)?.display()));
            break;
        }
    }
    arena.is_alive()?;
    watch.allow(&cell.config, in_force.or(&bounds));
    std::fs::write(&arena.config_path, &cell.text).map_err(|error| error.to_string())?;
    controller.restore(&client, &mut watch, findings)?;
    controller.calm(&cell.air, &client, &mut watch, findings)?;
    arena.look_at_holdings(findings);
    Ok(Counts::from([
        (Count::Configurations, drawn),
        (Count::Valid, valid),
        (Count::Starts, starts),
        (Count::Reloads, reloads),
    ]))
}

/// Keeps a file for a person to look at: as whoever runs this, in a directory that others write to.
fn kept(bytes: &[u8]) -> std::io::Result<PathBuf> {
    let mut file = tempfile::Builder::new().prefix("hostile-").suffix(".toml").tempfile()?;
    file.write_all(bytes)?;
    Ok(file.keep().map_err(|error| error.error)?.1)
}

/// Lets the running daemon read the file: it has to say what validate says. Whether it holds now.
fn reload(
    validated: &Result<(), String>,
    client: &Client,
    controller: &mut Controller,
    watch: &mut Watch,
    findings: &mut Findings,
) -> Result<bool, String> {
    let answer = controller.ask(client, RequestKind::Reload, || watch.look(findings))?;
    let text = answer.text();
    let is_done = answer.status == ResponseStatus::Done.code();
    match validated {
        Err(why) if is_done => Err(format!("a reload of what validate refuses: {text} ({why})")),
        // The answer is cut where it does not fit.
        Err(why) => {
            let said = text.strip_prefix("reload refused: ").unwrap_or(&text);
            let is_same = why.starts_with(said.get(..said.len().min(200)).unwrap_or(said));
            if is_same { Ok(false) } else { Err(format!("validate: {why}\nreload: {text}")) }
        }
        // What may not change at run time, or not now, is said.
        Ok(()) if is_done || text.contains("cannot change at run time") || text.contains("accepted") => Ok(is_done),
        Ok(()) => Err(format!("a reload of what validate accepts: {text}")),
    }
}

/// Starts another daemon with the file: it runs, or says what validate says.
fn start(arena: &mut Arena, node: &Node, validated: &Result<(), (Exit, String)>) -> Result<(), String> {
    let text = |(_, why): (Exit, String)| why;
    let name = Instance::new("newcomer").map_err(|error| error.to_string())?;
    arena.start_another("newcomer", &["--instance", "newcomer"].map(OsStr::new), &[]).map_err(text)?;
    let give_up = Instant::now() + PATIENCE;
    let ended = loop {
        if let Some(status) = arena.session.exit_status("newcomer") {
            break Some(status);
        }
        if services::request(node, &name, Access::Open).is_ok() {
            break None;
        }
        if Instant::now() > give_up {
            return Err("a daemon neither starts nor ends".to_owned());
        }
        std::thread::sleep(POLL);
    };
    let log = arena.session.log("newcomer");
    if log.contains("panicked") {
        return Err(log);
    }
    let outcome = match (ended, validated) {
        (None, Ok(())) => arena.session.end("newcomer").map_err(text),
        (None, Err((_, why))) => Err(format!("a daemon starts with what validate refuses: {why}")),
        // Of what validate accepts the machine may still lack something.
        (Some(status), Ok(())) => match status.code().and_then(Exit::from_code) {
            Some(Exit::NoPermission | Exit::Unavailable) if !log.is_empty() => Ok(()),
            _ => Err(format!("a daemon ends with {status} where validate accepts:\n{log}")),
        },
        (Some(status), Err((code, why))) => {
            let is_same = why.lines().next().is_some_and(|line| log.contains(line));
            if status.code().and_then(Exit::from_code) == Some(*code) && is_same {
                Ok(())
            } else {
                Err(format!("a daemon ends with {status}, validate with {code:?}: {log}\nvalidate: {why}"))
            }
        }
    };
    arena.session.forget("newcomer");
    outcome
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_that_do_not_help_are_found() {
        assert_eq!(flaw(Exit::Config, "a.toml:3: x.y = 1: accepted: 0"), None);
        assert_eq!(flaw(Exit::Config, "a.toml:3: x.y = 1: no"), Some("nothing that would be accepted"));
        assert_eq!(flaw(Exit::Config, "a.toml: accepted: 0\nno"), Some("lines that do not name the file"));
        let two = "a.toml:3: x.y = 1: accepted: 0\na.toml:4: ";
        assert_eq!(flaw(Exit::Config, &format!("{two}x.z = 1: no")), Some("nothing that would be accepted"));
        assert_eq!(flaw(Exit::Config, &format!("{two}7 more errors")), None);
        assert_eq!(flaw(Exit::Config, "a.toml: accepted: \u{1b}"), Some("control characters"));
        assert_eq!(flaw(Exit::Internal, "a.toml: accepted"), Some("a failure of its own"));
    }
}
