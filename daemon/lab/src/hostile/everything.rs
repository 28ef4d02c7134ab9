//! Everything at once against one daemon: spoilt samples, any requests, a flood of them, mutated
//! configurations, kills, other daemons, strangers' files, recorders that die.

use std::ffi::OsStr;
use std::os::unix::fs::chown;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ipc_types::{Client, Node, effective_user};
use rand::{Rng, RngExt as _};

use super::arena::{Arena, Findings, PATIENCE, POLL};
use super::cell::Cell;
use super::configurations::validated;
use super::controller::Controller;
use super::mutate::Mutations;
use super::requests::{Askers, permit};
use super::spoil::{Manner, Spoiler};
use super::watch::Watch;
use super::{Count, Counts};
use crate::answers::Bounds;
use admittancectl::recording::{Item, Recording};
use admittancectl::{Exit, Outcome};

/// How long a round lasts, s, and how long until there has to be control again in between.
const ROUND_S: std::ops::Range<f64> = 15.0..40.0;
const STORM_S: f64 = 4.0;
/// Of another user: nobody.
const STRANGER: u32 = 65_534;
/// Requests a second of the flood.
const FLOOD_HZ: &str = "3000";

/// One round.
pub(super) fn case(
    random: &mut rand_chacha::ChaCha8Rng,
    daemon: Option<&Path>,
    findings: &mut Findings,
) -> Outcome<Counts> {
    let mut cell = Cell::draw(random)?;
    let limits = permit(&mut cell)?;
    let mut arena = Arena::new(&cell.text, daemon)?;
    let mut round = Round { kills: random.random_bool(0.5), ..Round::default() };
    let counts = round.run(&cell, limits, &mut arena, random, findings);
    if let Err(why) = &counts {
        findings.note(why.clone());
    }
    arena.end(findings);
    Ok(counts.unwrap_or_default())
}

/// What goes on in a round.
#[derive(Debug, Default)]
struct Round {
    /// Whether processes are killed: memory is compared in rounds without.
    kills: bool,
    killed: u64,
    reloads: u64,
    starts: u64,
    recordings: u64,
}

/// What a round talks to the daemon with: it does not outlive the daemon.
struct Ends {
    client: Client,
    askers: Askers,
}

impl Ends {
    fn open(arena: &Arena, node: &Node, limits: &[(f64, f64)]) -> Result<Self, String> {
        Ok(Self { client: arena.client(node)?, askers: Askers::new(arena, node, limits.to_vec())? })
    }
}

impl Round {
    fn run(
        &mut self,
        cell: &Cell,
        limits: Vec<(f64, f64)>,
        arena: &mut Arena,
        random: &mut impl Rng,
        findings: &mut Findings,
    ) -> Result<Counts, String> {
        let text = |(_, why): (Exit, String)| why;
        let node = arena.node("hostile everything").map_err(text)?;
        let settings = arena.session.settings().clone();
        let bounds = Bounds::of(&cell.config).without_normal();
        let mut watch = Watch::new(&node, &settings.instance, &cell.config, bounds.clone())?;
        let mut controller = Controller::open(&node, &settings, &cell.air)?;
        let mut ends = Ends::open(arena, &node, &limits)?;
        let mutations = Mutations::of(&cell.text);
        controller.calm(&cell.air, &ends.client, &mut watch, findings)?;
        self.start_recorder(arena)?;
        let flooded = arena.config_path.with_file_name("flooded.toml");
        std::fs::write(&flooded, &cell.text).map_err(|error| error.to_string())?;
        let flood = [OsStr::new("--config"), flooded.as_os_str(), OsStr::new("--clients"), OsStr::new("4")];
        let flood = [&flood[..], &["--rate-hz", FLOOD_HZ, "--seconds", "3600"].map(OsStr::new)].concat();
        let end = Instant::now() + Duration::from_secs_f64(random.random_range(ROUND_S));
        let (mut asked, mut done) = (0, 0);
        while Instant::now() < end && findings.0.is_empty() {
            arena.session.start("flood", "flood", &flood).map_err(text)?;
            let storm = Instant::now() + Duration::from_secs_f64(STORM_S);
            let mut spoiler = Spoiler::new(Manner::draw(random));
            let (mut turn, mut allowed) = (0u32, bounds.clone());
            while Instant::now() < storm {
                turn += 1;
                if controller.is_finished() || turn % 500 == 1 {
                    controller.restart(&cell.touch(random).map_err(text)?)?;
                    spoiler = Spoiler::new(Manner::draw(random));
                }
                controller.cycle(|sample| spoiler.spoil(random, sample));
                watch.look(findings);
                ends.askers.ask(random);
                ends.askers.hear(PATIENCE, findings);
                if random.random_ratio(1, 300) {
                    self.happen(cell, (&mut allowed, &mut ends.askers), &mutations, &mut watch, arena, random)?;
                }
                if self.kills && random.random_ratio(1, 1500) {
                    (asked, done) = (asked + ends.askers.asked, done + ends.askers.done);
                    self.kill(cell, arena)?;
                    // Whoever asked the daemon that was killed is not answered.
                    ends = Ends::open(arena, &node, &limits)?;
                }
            }
            arena.is_alive()?;
            arena.kill("flood");
            std::fs::write(&arena.config_path, &cell.text).map_err(|error| error.to_string())?;
            controller.restart(&cell.air)?;
            controller.restore(&ends.client, &mut watch, findings)?;
            let calm = controller.calm(&cell.air, &ends.client, &mut watch, findings);
            arena.is_alive()?;
            calm?;
            watch.allow(&cell.config, bounds.clone());
            if !self.kills {
                arena.look_at_holdings(findings);
            }
        }
        self.end_recorder(arena, findings)?;
        let (asked, done) = (asked + ends.askers.asked, done + ends.askers.done);
        Ok(Counts::from([
            (Count::Rounds, 1),
            (Count::Samples, controller.published),
            (Count::Records, watch.seen),
            (Count::Refused, watch.refused),
            (Count::Requests, asked),
            (Count::Done, done),
            (Count::Kills, self.killed),
            (Count::Reloads, self.reloads),
            (Count::Starts, self.starts),
            (Count::Recordings, self.recordings),
        ]))
    }

    /// Something else happens.
    fn happen(
        &mut self,
        cell: &Cell,
        (allowed, askers): (&mut Bounds, &mut Askers),
        mutations: &Mutations,
        watch: &mut Watch,
        arena: &mut Arena,
        random: &mut impl Rng,
    ) -> Result<(), String> {
        let failed = |error: std::io::Error| error.to_string();
        match random.random_range(0..4) {
            0 | 1 => {
                self.reloads += 1;
                std::fs::write(&arena.config_path, mutations.draw(random)).map_err(failed)?;
                if let Ok(config) = validated(&arena.config_path) {
                    // It may be refused, or an earlier one: then that one goes on.
                    *allowed = allowed.clone().or(&Bounds::of(&config)).without_normal();
                    watch.allow(&config, allowed.clone());
                    askers.allow(&config);
                }
                arena.signal("daemon", libc::SIGHUP);
            }
            2 => {
                std::fs::write(&arena.config_path, &cell.text).map_err(failed)?;
                self.second_daemon(arena)?;
            }
            _ => {
                // A running daemon is none the wiser.
                if let Some(file) = stranger(&arena.session.settings().prefix)? {
                    std::fs::remove_file(file).map_err(failed)?;
                }
            }
        }
        Ok(())
    }

    /// A second daemon of the instance ends at once, and says who holds it.
    fn second_daemon(&mut self, arena: &mut Arena) -> Result<(), String> {
        self.starts += 1;
        arena.start_another("second", &[], &[]).map_err(|(_, why)| why)?;
        let log = ended(arena, "second", Exit::Unavailable)?;
        if log.contains("is held by process") { Ok(()) } else { Err(format!("a second daemon says: {log}")) }
    }

    /// Kills the daemon and starts another one; before that, one that a stranger's file is in the
    /// way of.
    fn kill(&mut self, cell: &Cell, arena: &mut Arena) -> Result<(), String> {
        let text = |(_, why): (Exit, String)| why;
        let failed = |error: std::io::Error| error.to_string();
        self.killed += 1;
        std::fs::write(&arena.config_path, &cell.text).map_err(failed)?;
        arena.is_alive()?;
        arena.kill("daemon");
        if self.killed.is_multiple_of(2)
            && let Some(file) = stranger(&arena.session.settings().prefix)?
        {
            arena.start_daemon().map_err(text)?;
            let log = ended(arena, "daemon", Exit::NoPermission);
            std::fs::remove_file(&file).map_err(failed)?;
            let log = log?;
            if !log.contains(&file.display().to_string()) {
                return Err(format!("with a stranger's file a daemon says: {log}"));
            }
        }
        arena.start_daemon().map_err(text)?;
        arena.await_service()
    }

    fn start_recorder(&mut self, arena: &mut Arena) -> Result<(), String> {
        self.recordings += 1;
        let (file, config) = (recording(arena), arena.config_path.clone());
        let arguments = [file.as_os_str(), OsStr::new("--overwrite"), OsStr::new("--config"), config.as_os_str()];
        arena.session.start("recorder", "role-recorder", &arguments).map_err(|(_, why)| why)?;
        let give_up = Instant::now() + PATIENCE;
        while !arena.session.log("recorder").contains("recording admittanced/") {
            if Instant::now() > give_up {
                return Err(format!("the recorder does not begin: {}", arena.session.log("recorder")));
            }
            std::thread::sleep(POLL);
        }
        Ok(())
    }

    /// Kills the recorder: what it has written is sound. Where the daemon was killed it may have
    /// ended by itself, since for too long nobody gave it anything.
    fn end_recorder(&self, arena: &mut Arena, findings: &mut Findings) -> Result<(), String> {
        arena.kill("recorder");
        let file = recording(arena);
        let recording = Recording::open(&file).and_then(Recording::refuse_damage).map_err(|(_, why)| why)?;
        let mut records = 0u64;
        for item in recording.items() {
            let item = item.map_err(|(_, why)| why)?;
            records += u64::from(matches!(item, Item::Record(_)));
        }
        if records == 0 {
            findings.note("nothing was recorded");
        }
        std::fs::remove_file(file).map_err(|error| error.to_string())
    }
}

fn recording(arena: &Arena) -> PathBuf {
    arena.config_path.with_file_name("recording.mcap")
}

/// A file in shared memory with our prefix that belongs to another user; only root can play that.
pub(crate) fn stranger(prefix: &str) -> Result<Option<PathBuf>, String> {
    if effective_user() != 0 {
        return Ok(None);
    }
    let name = format!("{prefix}{}_x", "0123456789".repeat(4));
    let file = PathBuf::from("/dev/shm").join(name);
    let made = std::fs::write(&file, "x").and_then(|()| chown(&file, Some(STRANGER), Some(STRANGER)));
    made.map_err(|error| format!("{}: {error}", file.display()))?;
    Ok(Some(file))
}

/// Waits for a process to end with this code: its log.
fn ended(arena: &mut Arena, name: &'static str, code: Exit) -> Result<String, String> {
    let give_up = Instant::now() + PATIENCE;
    loop {
        if let Some(status) = arena.session.exit_status(name) {
            let log = arena.session.log(name);
            arena.kill(name);
            let is_it = status.code().and_then(Exit::from_code) == Some(code);
            return if is_it { Ok(log) } else { Err(format!("{name} ended with {status}: {log}")) };
        }
        if Instant::now() > give_up {
            return Err(format!("{name} does not end"));
        }
        std::thread::sleep(POLL);
    }
}
