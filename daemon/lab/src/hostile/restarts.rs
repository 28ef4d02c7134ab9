//! SIGKILL of daemon and controller at any instant, also while they start: the next one has to work.

use std::ffi::OsStr;
use std::path::Path;
use std::time::{Duration, Instant};

use ipc_types::{Mode, Node, RequestKind};
use rand::{Rng, RngExt as _};

use super::arena::{Arena, Findings, PATIENCE, POLL, in_arena};
use super::cell::Cell;
use super::{Count, Counts};
use admittancectl::request::request;
use admittancectl::{Exit, Outcome};

/// Kills of one case.
pub(super) const PER_CASE: u64 = 20;
/// After how many ms a kill comes: most within the start, which takes some 40.
const UNTIL_KILL_MS: [std::ops::Range<f64>; 3] = [0.0..10.0, 0.0..60.0, 0.0..200.0];

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
    arena.session.write("scenario.toml", &cell.air_text).map_err(text)?;
    start_plant(arena)?;
    let mut kills = 0;
    while kills < PER_CASE && findings.0.is_empty() {
        kills += 1;
        let range = UNTIL_KILL_MS[random.random_range(0..UNTIL_KILL_MS.len())].clone();
        std::thread::sleep(Duration::from_secs_f64(random.random_range(range) * 1e-3));
        for name in ["daemon", "plant"] {
            has_not_ended(arena, name)?;
        }
        let (daemon, plant) = [(true, false), (true, false), (false, true), (true, true)][random.random_range(0..4)];
        if daemon {
            arena.kill("daemon");
        }
        if plant {
            arena.kill("plant");
        }
        std::thread::sleep(Duration::from_secs_f64(random.random_range(0.0..0.02)));
        let mut order = [("daemon", daemon), ("plant", plant)];
        if random.random_bool(0.5) {
            order.reverse();
        }
        for (name, _) in order.into_iter().filter(|(_, is_killed)| *is_killed) {
            if name == "plant" { start_plant(arena)? } else { arena.start_daemon().map_err(text)? }
        }
        // Or the next kill comes while they start.
        if random.random_bool(0.6) {
            await_control(arena)?;
        }
    }
    await_control(arena)?;
    Ok(Counts::from([(Count::Kills, kills)]))
}

fn start_plant(arena: &mut Arena) -> Result<(), String> {
    let scenario = arena.config_path.with_file_name("scenario.toml");
    // Its controller's patience: a daemon that is killed again and again may be long in coming.
    let arguments =
        [OsStr::new("--scenario"), scenario.as_os_str(), OsStr::new("--controller-timeout"), OsStr::new("60")];
    arena.session.start("plant", "role-plant", &arguments).map_err(|(_, why)| why)
}

/// Nobody but this attack ends a process.
fn has_not_ended(arena: &mut Arena, name: &str) -> Result<(), String> {
    match arena.session.exit_status(name) {
        Some(status) => Err(arena.session.failure(name, status).1),
        None => Ok(()),
    }
}

/// Waits until the daemon answers samples of this plant in Free.
fn await_control(arena: &mut Arena) -> Result<(), String> {
    arena.await_service()?;
    let node: Node = arena.node("hostile").map_err(|(_, why)| why)?;
    let give_up = Instant::now() + PATIENCE;
    let mut before = None;
    loop {
        for name in ["daemon", "plant"] {
            has_not_ended(arena, name)?;
        }
        let answer = arena.ask(&node, request(RequestKind::Status))?;
        let mode = Mode::from_code(answer.mode);
        let goes_on = before.replace(answer.cycles).is_some_and(|before| answer.cycles > before);
        if goes_on && mode == Some(Mode::Free) {
            return arena.is_alive();
        }
        if mode == Some(Mode::Stopped) {
            arena.ask(&node, request(RequestKind::Reset))?;
        }
        if Instant::now() > give_up {
            return Err(format!("no control after a restart: {}, {} cycles", answer.text(), answer.cycles));
        }
        std::thread::sleep(4 * POLL);
    }
}
