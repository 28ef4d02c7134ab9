//! Random bytes and mutated messages to admittance-egm, from its robot's address and from others. A robot that stands is not to
//! be moved by what is no message of its own; what could be one may move it, within its limits, and not for long.

mod draw;
mod robot;

use std::ffi::OsStr;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::path::Path;
use std::time::{Duration, Instant};

use admittance_egm::config::EdgeConfig;
use ipc_types::{Mode, Node, RequestKind, RequestSample};
use rand::{Rng, RngExt as _};

use super::arena::{Arena, Findings, PATIENCE, POLL, in_arena, parsed};
use super::{Count, Counts};
use crate::keys::{self, set};
use admittancectl::request::request;
use admittancectl::{Exit, Outcome};
use draw::{Datagram, Sender, draw, draw_harmless};
use robot::{CYCLE, Robot, SPEED};

const DAEMON: &str = include_str!("../../../../../deploy/egm/six-joint.toml");
const EDGE: &str = include_str!("../../../../../deploy/egm/six-joint.egm.toml");
/// Datagrams of a case at most: a minute of a thousand a second.
pub(super) const PER_CASE: u64 = 60_000;
/// Of a cycle: 1000 a second.
const PER_CYCLE: u64 = 4;
/// Datagrams until there has to be control again.
const EPISODE: std::ops::Range<u64> = 500..6000;
/// How long something that could be the robot's own message may move the arm, after it: the daemon's last plan, its retreat,
/// and what it does about an arm of which it hears strange things.
const MAY_MOVE: Duration = Duration::from_millis(500);
/// Cycles without motion in a row after which an arm is calm.
const CALM: u32 = 50;
/// Cycles in which the robot turns its joint, and within which the edge has to follow it.
const LED: u32 = 250;

/// One case of this many datagrams. `edge`: the program to attack in place of this program's own.
pub(super) fn case(
    random: &mut rand_chacha::ChaCha8Rng,
    datagrams: u64,
    (daemon, edge): (Option<&Path>, Option<&Path>),
    findings: &mut Findings,
) -> Outcome<Counts> {
    let config = daemon_file()?;
    parsed(&config)?;
    in_arena(&config, daemon, findings, |arena, findings| attack(arena, edge, datagrams, random, findings))
}

fn daemon_file() -> Outcome<String> {
    let mut table = keys::parsed(DAEMON)?;
    // What a busy machine needs.
    for (key, value) in [("answer_budget_s", 0.0028), ("max_sample_age_s", 0.1)] {
        set(&mut table, "control", key, value);
    }
    ordinary_with_locked_memory(&mut table);
    set(&mut table, "ipc", "instance", "planar");
    Ok(table.to_string())
}

/// Memory that is not locked becomes the process's own bit by bit as it is first used, and seems to grow.
fn ordinary_with_locked_memory(table: &mut toml::Table) {
    set(table, "realtime", "lock_memory", true);
    set(table, "realtime", "priority", 0);
}

fn edge_file() -> Result<(String, EdgeConfig), String> {
    let mut table: toml::Table = EDGE.parse().map_err(|error: toml::de::Error| error.to_string())?;
    set(&mut table, "egm", "listen", "127.0.0.1:0");
    set(&mut table, "egm", "robot_address", "127.0.0.1");
    ordinary_with_locked_memory(&mut table);
    let text = table.to_string();
    let config = admittance_host::config::parse(&text, "edge.toml").map_err(|error| error.to_string())?;
    Ok((text, config))
}

/// Starts the edge, and says where it awaits its robot.
fn start_edge(arena: &mut Arena, program: Option<&Path>, file: &str) -> Result<SocketAddr, String> {
    let text = |(_, why): (Exit, String)| why;
    let file = arena.session.write("edge.toml", file).map_err(text)?;
    let daemon = arena.config_path.clone();
    let arguments =
        [OsStr::new("--config"), file.as_os_str(), OsStr::new("--daemon-config"), daemon.as_os_str()].to_vec();
    match program {
        Some(program) => arena.session.start_program("edge", program, &arguments, &[]).map_err(text)?,
        None => arena.session.start("edge", "role-egm", &arguments).map_err(text)?,
    }
    let give_up = Instant::now() + PATIENCE;
    loop {
        let log = arena.session.log("edge");
        let port = log.split(" on 127.0.0.1:").nth(1).and_then(|rest| rest.split_whitespace().next()?.parse().ok());
        if let Some(port) = port {
            return Ok(SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
        }
        arena.is_running("edge")?;
        if Instant::now() > give_up {
            return Err(format!("the edge awaits no robot: {log}"));
        }
        std::thread::sleep(POLL);
    }
}

/// Sockets of others, which the robot's is not.
struct Strangers([UdpSocket; 2]);

impl Strangers {
    fn of(edge: SocketAddr) -> Result<Self, String> {
        let of = |address: Ipv4Addr| {
            let socket = UdpSocket::bind((address, 0))?;
            socket.connect(edge)?;
            Ok::<_, std::io::Error>(socket)
        };
        let failed = |error: std::io::Error| format!("a stranger's socket: {error}");
        Ok(Self([of(Ipv4Addr::LOCALHOST).map_err(failed)?, of(Ipv4Addr::new(127, 0, 0, 2)).map_err(failed)?]))
    }

    fn send(&self, robot: &Robot, datagram: &Datagram) {
        let socket = match datagram.sender {
            Sender::Robot => &robot.socket,
            Sender::OtherPort => &self.0[0],
            Sender::OtherAddress => &self.0[1],
        };
        // What the kernel has no room for is lost.
        let _ = socket.send(&datagram.bytes);
    }
}

fn attack(
    arena: &mut Arena,
    edge: Option<&Path>,
    datagrams: u64,
    random: &mut impl Rng,
    findings: &mut Findings,
) -> Result<Counts, String> {
    let node = arena.node("hostile robot").map_err(|(_, why)| why)?;
    let (file, config) = edge_file()?;
    let address = start_edge(arena, edge, &file)?;
    let strangers = Strangers::of(address)?;
    let mut robot = Robot::new(address, &config.egm.joint_speed_limit_deg_s)?;
    calm(&mut robot, arena, &node, findings)?;
    follow(&mut robot, findings)?;
    let (mut sent, mut believable, mut episodes) = (0, 0, 0);
    let mut first_kib = None;
    while sent < datagrams && findings.0.is_empty() {
        episodes += 1;
        // In every second one there is nothing on which a robot may be moved.
        let is_strict = episodes % 2 == 1;
        let end = (sent + random.random_range(EPISODE)).min(datagrams);
        let mut moved_by: Option<Instant> = None;
        while sent < end {
            sent += PER_CYCLE;
            let speeds = robot.turn(false, findings, |robot| {
                for _ in 0..PER_CYCLE {
                    let known = robot.message();
                    let datagram = if is_strict { draw_harmless(random, &known) } else { draw(random, &known) };
                    if datagram.may_move {
                        (moved_by, believable) = (Some(Instant::now()), believable + 1);
                    }
                    strangers.send(robot, &datagram);
                }
            });
            let may_move = moved_by.is_some_and(|at| at.elapsed() < MAY_MOVE);
            if let Some(speed) = speeds.into_iter().find(|speed| *speed > 0.0 && !may_move) {
                findings.note(format!(
                    "a robot that stands is told {speed} degrees/s, after nothing that could be its own"
                ));
            }
        }
        arena.is_alive()?;
        arena.is_running("edge")?;
        calm(&mut robot, arena, &node, findings)?;
        follow(&mut robot, findings)?;
        let kib = arena.look_at_holdings_of("edge", findings);
        arena.look_at_holdings(findings);
        first_kib = first_kib.or(kib);
        if sent >= datagrams
            && let (Some(first), Some(last)) = (first_kib, kib)
        {
            println!("the edge's VmRSS: {first} KiB after the first episode, {last} KiB after the last");
        }
    }
    Ok(Counts::from([
        (Count::Datagrams, sent),
        (Count::Believable, believable),
        (Count::Episodes, episodes),
        (Count::Answers, robot.answers),
    ]))
}

/// Sound messages until the daemon is in control, and the arm stands.
fn calm(robot: &mut Robot, arena: &mut Arena, node: &Node, findings: &mut Findings) -> Result<(), String> {
    let give_up = Instant::now() + PATIENCE;
    let mut calm = 0;
    loop {
        let speeds = robot.turn(false, findings, |_| {});
        calm = if !speeds.is_empty() && speeds.iter().all(|speed| *speed == 0.0) { calm + 1 } else { 0 };
        if calm > 0 && calm % CALM == 0 {
            let status = arena.ask(node, request(RequestKind::Status))?;
            if Mode::from_code(status.mode) == Some(Mode::Free) {
                return Ok(());
            }
            // Where it was stopped meanwhile.
            arena.ask(node, RequestSample { force: 1, ..request(RequestKind::Reset) })?;
        }
        arena.is_alive()?;
        arena.is_running("edge")?;
        if Instant::now() > give_up {
            return Err(format!(
                "no control again: {} answers, the edge says: {}",
                robot.answers,
                arena.session.log("edge")
            ));
        }
    }
}

/// The edge still does what it is there for: where the robot's program leads it is guided to.
fn follow(robot: &mut Robot, findings: &mut Findings) -> Result<(), String> {
    let is_led = |speeds: &[f64]| speeds.iter().any(|speed| (speed / SPEED - 1.0).abs() < 0.1);
    let follows = (0..LED).any(|_| is_led(&robot.turn(true, findings, |_| {})));
    // Until its standstill has come back to it.
    for _ in 0..5 {
        robot.turn(false, findings, |_| {});
    }
    if follows {
        Ok(())
    } else {
        Err(format!("the edge does not follow a robot that is led: within {:?}", CYCLE * LED))
    }
}
