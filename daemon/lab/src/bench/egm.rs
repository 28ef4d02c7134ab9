//! `admittance-lab bench egm`: from a robot's message to the message that answers it, with edge and daemon on one processor,
//! beside a bare UDP echo at the same pace, on the same processors and with the same priorities.

use std::ffi::OsStr;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use admittance_host::clock::{monotonic_ns, sleep_until_ns};
use admittance_host::readable::wait_until_readable;
use comfy_table::{CellAlignment, Table, presets};
use plant_sim::scenario::Scenario;
use serde_json::json;
use toml::{Table as Toml, Value};

use crate::keys::{parsed, real_time, set};

use super::jitter::figures::Durations;
use super::jitter::{DAEMON_CPU, PLANT_CPU, PRIORITY, on_processor, prepare};
use admittancectl::session::Session;
use admittancectl::{Exit, Outcome};

const DAEMON: &str = include_str!("../../../../deploy/egm/six-joint.toml");
const EDGE: &str = include_str!("../../../../deploy/egm/six-joint.egm.toml");
const SCENARIO: &str = include_str!("../../../../plant-sim/scenarios/six-joint-egm.toml");
/// The robot's cycle, ns.
const CYCLE_NS: u64 = 4_000_000;
/// What a robot's message and its answer have, bytes.
const MESSAGE: usize = 360;
const ANSWER: usize = 80;
/// Until the touch is over, s of the scenario.
const SETTLED_S: f64 = 0.9;
/// Turns that the reference and the edge take.
const BLOCKS: u32 = 4;
/// Attempts at a turn that a busy machine may spoil.
const TRIES: u32 = 3;
const POLL: Duration = Duration::from_millis(10);
const PATIENCE: Duration = Duration::from_secs(10);
/// What the issue asks for, µs.
const GOAL_P99_US: f64 = 300.0;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Needs two processors, and SCHED_FIFO for figures that mean anything. The emulated robot of plant-sim has one, edge and \
    daemon have the other. Takes a little over twice the seconds given.\n\nreference: from a datagram to its echo. answer: from a \
    robot's message to the answer to it, in contact. Both as the robot sees it, blocking until something comes.\n\n\
    Processors are kept awake meanwhile, as cyclictest does and realtime.cpu_dma_latency_us = 0 would.\n\nExit codes: 0 whatever the \
    figures are, 1 no answers, 75 machine too busy to hold contact, 77 measured without SCHED_FIFO for want of permission.\n\n\
    Examples:\n  admittance-lab bench egm\n  admittance-lab bench egm --seconds 60 --json"
)]
pub(crate) struct Args {
    /// How long the reference and the edge each run, s.
    #[arg(long, value_name = "S", default_value_t = 20, value_parser = clap::value_parser!(u32).range(4..=3600))]
    seconds: u32,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Outcome<Exit> {
    ipc_types::quiet_iceoryx2();
    if admittancectl::parallel::processors() < 2 {
        return Err((Exit::Unavailable, "bench egm needs two processors: one is the robot's".to_owned()));
    }
    let has_fifo = prepare();
    let turn_s = f64::from(args.seconds) / f64::from(BLOCKS);
    let (mut reference, mut answer) = (Durations::new(), Durations::new());
    for turn in 1..=BLOCKS {
        eprintln!("turn {turn} of {BLOCKS}: {turn_s:.1} s of reference, {turn_s:.1} s of contact");
        reference.append(&echo(turn_s)?);
        answer.append(&undisturbed(turn_s)?);
    }
    let percentiles = [reference.percentiles(), answer.percentiles()];
    if args.json {
        println!(
            "{:#}",
            json!({
                "cycles": answer.total(),
                "missed": answer.missed(),
                "fifo": has_fifo,
                "reference_us": percentiles[0],
                "answer_us": percentiles[1],
                "goal_p99_us": GOAL_P99_US,
            })
        );
    } else {
        let mut table = Table::new();
        table.load_style(presets::ASCII_MARKDOWN);
        table.set_header(["us", "p50", "p99", "p99.9", "max", "goal"]);
        let goals = [String::new(), format!("p99 {GOAL_P99_US:.0}")];
        for ((name, at), goal) in
            ["reference, UDP echo", "robot's message to its answer"].into_iter().zip(&percentiles).zip(goals)
        {
            table.add_row([&[name.to_owned()], &at.cells()[..], &[goal]].concat());
        }
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        println!(
            "{} cycles of 4 ms in contact, {} without an answer; edge and daemon on processor {DAEMON_CPU}{}\n{table}",
            answer.total(),
            answer.missed(),
            if has_fifo { "" } else { ", WITHOUT SCHED_FIFO" }
        );
    }
    if answer.count() == 0 {
        return Err((Exit::ClaimNotMet, "the edge answered nothing".to_owned()));
    }
    Ok(if has_fifo { Exit::Ok } else { Exit::NoPermission })
}

fn unavailable(error: &std::io::Error) -> (Exit, String) {
    (Exit::Unavailable, format!("a UDP socket: {error}"))
}

/// Datagrams that come back at once, one a cycle.
fn echo(turn_s: f64) -> Outcome<Durations> {
    let bound = || UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).map_err(|error| unavailable(&error));
    let (robot, edge) = (bound()?, bound()?);
    let address = edge.local_addr().map_err(|error| unavailable(&error))?;
    let is_over = AtomicBool::new(false);
    let answer = || {
        let mut buffer = [0; 2048];
        while !is_over.load(Ordering::Relaxed) {
            if wait_until_readable(&edge, CYCLE_NS)
                && let Ok((_, from)) = edge.recv_from(&mut buffer)
            {
                // What is lost is an echo that never comes.
                let _ = edge.send_to(&buffer[..ANSWER], from);
            }
        }
    };
    let ask = || {
        let (mut durations, mut buffer) = (Durations::new(), [0; 2048]);
        let mut instant = monotonic_ns() + CYCLE_NS;
        for _ in 0..(turn_s * 1e9) as u64 / CYCLE_NS {
            sleep_until_ns(instant);
            let begun = monotonic_ns();
            let _ = robot.send_to(&[0; MESSAGE], address);
            if wait_until_readable(&robot, CYCLE_NS / 2) {
                durations.add(monotonic_ns() - begun, false);
                let _ = robot.recv_from(&mut buffer);
            } else {
                durations.add_endless();
            }
            instant += CYCLE_NS;
        }
        durations
    };
    Ok(std::thread::scope(|scope| {
        scope.spawn(|| on_processor(DAEMON_CPU, answer));
        let durations = on_processor(PLANT_CPU, ask);
        is_over.store(true, Ordering::Relaxed);
        durations
    }))
}

/// A turn of contact in which the daemon did not stop the arm.
fn undisturbed(turn_s: f64) -> Outcome<Durations> {
    for _ in 0..TRIES {
        let (durations, stopped) = contact(turn_s)?;
        let Some(reason) = stopped else { return Ok(durations) };
        eprintln!("the daemon stopped the arm ({reason}): running it again");
    }
    let text =
        format!("machine too busy: the daemon stopped the arm in {TRIES} runs; try again when nothing else runs");
    Err((Exit::MachineBusy, text))
}

/// From each message of the robot in contact to its answer; and why the daemon stopped the arm, if it did.
fn contact(turn_s: f64) -> Outcome<(Durations, Option<String>)> {
    let (scenario, text) = scenario(turn_s)?;
    let mut session = Session::new(&scenario)?;
    let daemon = session.write("daemon.toml", &daemon_file()?)?;
    session.start("daemon", "role-daemon", &[OsStr::new("--config"), daemon.as_os_str()])?;
    let edge = session.write("edge.toml", &edge_file()?)?;
    let files = [OsStr::new("--config"), edge.as_os_str(), OsStr::new("--daemon-config"), daemon.as_os_str()];
    session.start("edge", "role-egm", &files)?;
    let address = awaits(&mut session)?.to_string();
    let scenario = session.write("scenario.toml", &text)?;
    let plant = [OsStr::new("--scenario"), scenario.as_os_str(), OsStr::new("--egm"), OsStr::new(&address)];
    session.start("plant", "role-plant", &plant)?;
    let (_node, truths) = session.watch(&|| false)?;
    let mut durations = Durations::new();
    loop {
        let ended = session.exit_status("plant");
        while let Ok(Some(truth)) = truths.receive() {
            if truth.scenario_time_s > SETTLED_S && truth.in_contact == 1 {
                match truth.answer_time_ns {
                    0 => durations.add_endless(),
                    // The robot's message went out when it was awake.
                    time => durations.add(time.saturating_sub(truth.lateness_ns), truth.missed == 1),
                }
            }
        }
        match ended {
            Some(status) if status.success() => break,
            Some(status) => return Err(session.failure("plant", status)),
            None => std::thread::sleep(POLL),
        }
    }
    let stopped = session.stop_reason();
    session.end("edge")?;
    session.end("daemon")?;
    Ok((durations, stopped))
}

/// Where the edge awaits its robot.
fn awaits(session: &mut Session) -> Outcome<SocketAddr> {
    let give_up = Instant::now() + PATIENCE;
    loop {
        let log = session.log("edge");
        let port = log.split(" on 127.0.0.1:").nth(1).and_then(|rest| rest.split_whitespace().next()?.parse().ok());
        if let Some(port) = port {
            return Ok(SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
        }
        if let Some(status) = session.exit_status("edge") {
            return Err(session.failure("edge", status));
        }
        if Instant::now() > give_up {
            return Err((Exit::Unavailable, format!("the edge awaits no robot: {log}")));
        }
        std::thread::sleep(POLL);
    }
}

/// What is shipped; what a busy machine does to the daemon is counted, and is not to end the run.
fn daemon_file() -> Outcome<String> {
    let mut table = parsed(DAEMON)?;
    set(&mut table, "ipc", "instance", "six-joint-egm");
    set(&mut table, "control", "max_sample_age_s", 0.1);
    set(&mut table, "control", "max_consecutive_fallbacks", 20);
    real_time(&mut table, PRIORITY, DAEMON_CPU);
    Ok(table.to_string())
}

/// On the daemon's processor, and above it: what the edge waits for is the daemon's turn.
fn edge_file() -> Outcome<String> {
    let mut table = parsed(EDGE)?;
    set(&mut table, "egm", "listen", "127.0.0.1:0");
    set(&mut table, "egm", "robot_address", "127.0.0.1");
    real_time(&mut table, PRIORITY + 1, DAEMON_CPU);
    Ok(table.to_string())
}

/// A touch, and then to and fro along the surface.
fn scenario(turn_s: f64) -> Outcome<(Scenario, String)> {
    let mut table = parsed(SCENARIO)?;
    let phase = |(duration_s, twist): (f64, [f64; 6])| {
        let mut phase = Toml::new();
        phase.insert("duration_s".to_owned(), Value::Float(duration_s));
        phase.insert("twist".to_owned(), Value::Array(twist.map(Value::Float).to_vec()));
        Value::Table(phase)
    };
    // At most 64 phases; a long turn makes slow ones.
    let length_s = (turn_s / 60.0).max(1.0);
    let along = 0.02 / length_s;
    let to_and_fro = (0..(turn_s / length_s).ceil() as u32).map(|turn| {
        let along = if turn % 2 == 0 { along } else { -along };
        (length_s, [along, along, -0.002, 0.0, 0.0, 0.0])
    });
    let touch = (SETTLED_S, [0.0, 0.0, -0.02, 0.0, 0.0, 0.0]);
    table.insert("motion".to_owned(), Value::Array([touch].into_iter().chain(to_and_fro).map(phase).collect()));
    set(&mut table, "egm", "jitter_s", 0.0);
    real_time(&mut table, PRIORITY - 5, PLANT_CPU);
    let text = table.to_string();
    let scenario =
        admittance_host::config::parse(&text, "scenario.toml").map_err(|error| (Exit::Internal, error.to_string()))?;
    Ok((scenario, text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_valid_whatever_the_length() {
        for turn_s in [1.0, 5.0, 900.0] {
            let (scenario, _) = scenario(turn_s).expect("valid");
            plant_sim::run::VirtualRun::new(&scenario).expect("a plant");
        }
        let daemon: admittance_runner::config::Config =
            admittance_host::config::parse(&daemon_file().expect("TOML"), "daemon.toml").expect("valid");
        admittance_runner::cycle::build(&daemon).expect("a controller");
        let edge: admittance_egm::config::EdgeConfig =
            admittance_host::config::parse(&edge_file().expect("TOML"), "edge.toml").expect("valid");
        assert_eq!(edge.realtime.cpu, daemon.realtime.cpu, "on one processor");
    }

    #[test]
    fn an_echo_comes_back_in_each_cycle() {
        let durations = echo(0.2).expect("sockets");
        assert_eq!(durations.total(), 50);
        assert!(durations.count() > 0);
    }
}
