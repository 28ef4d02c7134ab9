//! admittance-egm between the daemon and a robot controller that is emulated (`plant-sim --egm`), or spoken for by a Python
//! package that was written elsewhere: real processes over UDP.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use egm_messages::{
    EgmClock, EgmFeedBack, EgmHeader, EgmJoints, EgmMciState, EgmMeasuredForce, EgmMotorState, EgmPlanned,
    EgmRapidCtrlExecState, EgmRobot, EgmSensor, Message,
};
use end_to_end::session::{drive_plant_by, output, plant_command, start_daemon, wait_for_log, with_keys, write};
use end_to_end::{Child, Need, PATIENCE, PrivateIpc, binaries, certain, needs, python, undisturbed};
use ipc_types::TruthSample;
use plant_sim::faults::FaultKind;

const DAEMON: &str = include_str!("../../deploy/egm/six-joint.toml");
const EDGE: &str = include_str!("../../deploy/egm/six-joint.egm.toml");
const SCENARIO: &str = include_str!("../../plant-sim/scenarios/six-joint-egm.toml");
/// f_max in N, and what the linear model may miss of it.
const MOST: f64 = 150.0 + 0.5;
/// As the scenario has it, s.
const COMM_TIMEOUT_S: f64 = 0.5;
/// Speed of a joint in rad/s below which it stands: what its lag leaves after some time.
const STANDS: f64 = 1e-4;

/// Daemon and edge of one robot.
struct Cell {
    ipc: PrivateIpc,
    edge: Child,
    daemon: Child,
    port: u16,
}

impl Cell {
    fn start() -> Self {
        let ipc = PrivateIpc::new("egm");
        // Tests are not built for release, and not alone: what a busy machine needs.
        let daemon = with_keys(
            DAEMON,
            &[
                ("control.answer_budget_s", "0.0028"),
                ("control.max_sample_age_s", "0.1"),
                ("control.max_consecutive_fallbacks", "20"),
                ("realtime.lock_memory", "false"),
                ("realtime.priority", "0"),
            ],
        );
        let edge = with_keys(
            EDGE,
            &[
                ("egm.listen", "\"127.0.0.1:0\""),
                ("egm.robot_address", "\"127.0.0.1\""),
                ("realtime.lock_memory", "false"),
                ("realtime.priority", "0"),
            ],
        );
        let daemon = write(&ipc, "daemon.toml", &daemon);
        let edge = edge_command(&ipc, &write(&ipc, "edge.toml", &edge), &daemon);
        let daemon = start_daemon(&ipc, &daemon);
        let mut edge = Child::spawn(&mut { edge });
        wait_for_log(&mut edge, "awaits 127.0.0.1 on 127.0.0.1:");
        let log = edge.stderr();
        let port = log.split("on 127.0.0.1:").nth(1).and_then(|rest| rest.split_whitespace().next()).expect("a port");
        Self { port: port.parse().expect("a port is a number"), ipc, edge, daemon }
    }

    fn plant(&self, changes: &[(&str, &str)]) -> Command {
        let scenario = write(&self.ipc, "scenario.toml", &with_keys(SCENARIO, changes));
        let mut command = plant_command(&self.ipc, &scenario);
        command.args(["--egm", &format!("127.0.0.1:{}", self.port)]);
        command
    }

    /// Runs the emulated robot to its end; `each` sees every truth. What it said comes as well.
    fn run(
        &mut self,
        changes: &[(&str, &str)],
        mut each: impl FnMut(&mut Self, &mut Child, &TruthSample),
    ) -> (Vec<TruthSample>, String) {
        let mut plant = Child::spawn(&mut self.plant(changes));
        let ipc = self.ipc.settings().clone();
        let truths = drive_plant_by(&ipc, &mut plant, |plant, truth| each(self, plant, truth));
        (truths, plant.stderr())
    }
}

fn edge_command(ipc: &PrivateIpc, edge: &std::path::Path, daemon: &std::path::Path) -> Command {
    let settings = ipc.settings();
    let mut command = Command::new(&binaries().admittance_egm);
    command.arg("--config").arg(edge).arg("--daemon-config").arg(daemon);
    command.arg("--root-path").arg(&settings.root_path);
    command.args(["--prefix", &settings.prefix, "--instance", settings.instance.as_str()]);
    command
}

fn fastest(truth: &TruthSample) -> f64 {
    truth.joint_velocity.iter().fold(0.0, |most, speed| speed.abs().max(most))
}

fn peak(truths: &[TruthSample]) -> f64 {
    truths.iter().map(|truth| truth.peak_normal_force_n).fold(0.0, f64::max)
}

/// From `stamp_ns` on the joints stand before CommTimeout could have stopped them, and stay so.
fn stands_before_comm_timeout(truths: &[TruthSample], stamp_ns: u64) {
    let after: Vec<&TruthSample> = truths.iter().filter(|truth| truth.stamp_ns > stamp_ns).collect();
    let late = after.partition_point(|truth| (truth.stamp_ns - stamp_ns) as f64 * 1e-9 < 0.8 * COMM_TIMEOUT_S);
    assert!(after.len() > late + 10, "the run ended too early: {} of {}", late, after.len());
    let fastest = after[late..].iter().map(|truth| fastest(truth)).fold(0.0, f64::max);
    assert!(fastest < STANDS, "the joints still move at {fastest} rad/s");
}

#[test]
fn it_touches_slides_and_lifts_off_over_a_network_that_is_not_perfect() {
    for network in [
        &[][..],
        &[("egm.lost", "0.01"), ("egm.duplicated", "0.02"), ("egm.reordered", "0.02"), ("egm.jitter_s", "0.001")][..],
    ] {
        undisturbed(|| {
            let mut cell = Cell::start();
            let (truths, said) = cell.run(network, |_, _, _| {});
            let touched = truths.iter().filter(|truth| truth.in_contact == 1).count();
            let losses = truths.last().map_or(0, |truth| truth.contact_losses);
            println!("peak {:.1} N, {touched} cycles of contact, {losses} losses: {said}", peak(&truths));
            assert!(peak(&truths) <= MOST, "peak {} N", peak(&truths));
            assert!(touched > 150 && losses == 1, "{touched} cycles of contact, {losses} losses: one is the lift-off");
            assert!(!said.contains("CommTimeout"), "{said}");
            cell.edge.terminate();
            assert_eq!(cell.edge.wait_for_exit(PATIENCE).code(), Some(0), "{}", cell.edge.report());
        });
    }
}

/// What the fault matrix does to a controller on shared memory, here to the robot's messages.
#[test]
fn every_fault_in_contact_keeps_the_limit_and_leaves_comm_timeout_alone() {
    for kind in FaultKind::ALL {
        let fault = format!("[{{ at_s = 0.8, duration_s = 0.3, kind = \"{kind}\" }}]");
        let changes = [("fault", fault.as_str()), ("timing.settle_s", "0.5")];
        undisturbed(|| {
            let mut cell = Cell::start();
            let (truths, said) = cell.run(&changes, |_, _, _| {});
            println!("{kind}: peak {:.1} N", peak(&truths));
            assert!(truths.iter().any(|truth| truth.in_contact == 1), "{kind}: no contact");
            assert!(peak(&truths) <= MOST, "{kind}: peak {} N", peak(&truths));
            assert!(!said.contains("CommTimeout"), "{kind}: {said}");
            assert!(cell.edge.exit_status().is_none() && !cell.edge.stderr().contains("panicked"), "{kind}");
        });
    }
}

/// Kills or ends something when contact has lasted for 50 cycles, and says when, and what was.
fn in_contact(end: impl Fn(&mut Cell)) -> (Cell, Vec<TruthSample>, String, u64) {
    let mut cell = Cell::start();
    let (mut contact, mut ended_ns) = (0, 0);
    let (truths, said) = cell.run(&[], |cell, _, truth| {
        contact += u32::from(truth.in_contact == 1);
        if contact == 50 && ended_ns == 0 {
            end(cell);
            ended_ns = admittance_host::clock::monotonic_ns();
        }
    });
    assert!(ended_ns > 0, "there was no contact");
    (cell, truths, said, ended_ns)
}

#[test]
fn a_daemon_that_is_killed_in_contact_leaves_an_arm_that_stands_before_comm_timeout() {
    undisturbed(|| {
        let (mut cell, truths, said, killed_ns) = in_contact(|cell| cell.daemon.signal(libc::SIGKILL));
        stands_before_comm_timeout(&truths, killed_ns);
        assert!(peak(&truths) <= MOST, "peak {} N", peak(&truths));
        assert!(!said.contains("CommTimeout") && cell.edge.exit_status().is_none(), "{said}");
    });
}

#[test]
fn an_edge_that_is_asked_to_end_in_contact_leaves_an_arm_that_stands() {
    undisturbed(|| {
        let (mut cell, truths, said, asked_ns) = in_contact(|cell| cell.edge.terminate());
        stands_before_comm_timeout(&truths, asked_ns);
        assert_eq!(cell.edge.wait_for_exit(PATIENCE).code(), Some(0), "{}", cell.edge.report());
        assert!(peak(&truths) <= MOST && said.contains("CommTimeout"), "peak {} N: {said}", peak(&truths));
    });
}

/// What the two tests above would not notice otherwise: the emulated robot does go on by itself.
#[test]
fn a_robot_whose_edge_is_killed_keeps_its_last_speed_until_comm_timeout() {
    undisturbed(|| {
        let mut cell = Cell::start();
        let mut killed_ns = 0;
        let free = [("surface.point_m", "[-0.48934, -0.33388, -0.9]"), ("egm.comm_timeout_s", "0.3")];
        // Touching is not what this is about.
        let (truths, said) =
            cell.run(&[&free[1..], &[("surface.stiffness_n_m", "100.0")]].concat(), |cell, _, truth| {
                if truth.scenario_time_s > 0.2 && killed_ns == 0 {
                    cell.edge.signal(libc::SIGKILL);
                    killed_ns = admittance_host::clock::monotonic_ns();
                }
            });
        let at = |seconds: f64| {
            let after_ns = killed_ns + (seconds * 1e9) as u64;
            truths.iter().find(|truth| truth.stamp_ns > after_ns).map(fastest).expect("the run goes on")
        };
        assert!(at(0.2) > 0.01 && (at(0.2) - at(0.1)).abs() < 1e-3, "{} and {} rad/s", at(0.1), at(0.2));
        assert!(at(0.6) < STANDS && said.contains("CommTimeout"), "{} rad/s: {said}", at(0.6));
    });
}

/// Numbers that look like chance, the same each time.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    fn bytes(&mut self, most: usize) -> Vec<u8> {
        (0..self.below(most)).map(|_| self.next() as u8).collect()
    }
}

/// A robot that stands.
fn standing(cycle: u32) -> EgmRobot {
    let joints = || Some(EgmJoints { joints: vec![17.0, 68.0, -103.0, 126.0, 90.0, 17.0] });
    let microseconds = u64::from(cycle) * 4000;
    let time = Some(EgmClock { sec: microseconds / 1_000_000, usec: microseconds % 1_000_000 });
    EgmRobot {
        header: Some(EgmHeader { seqno: Some(cycle), tm: Some(4u32.wrapping_mul(cycle)), mtype: Some(2) }),
        feed_back: Some(EgmFeedBack { joints: joints(), time, ..EgmFeedBack::default() }),
        planned: Some(EgmPlanned { joints: joints(), ..EgmPlanned::default() }),
        motor_state: Some(EgmMotorState { state: 1 }),
        mci_state: Some(EgmMciState { state: 3 }),
        rapid_exec_state: Some(EgmRapidCtrlExecState { state: 2 }),
        measured_force: Some(EgmMeasuredForce { fc_active: Some(true), force: vec![0.0; 6] }),
        ..EgmRobot::default()
    }
}

/// Random bytes, or a message with some bytes changed, cut off or put in.
fn attack(chance: &mut Chance, cycle: u32) -> Vec<u8> {
    if chance.below(2) == 0 {
        return chance.bytes(6000);
    }
    let mut message = standing(cycle.wrapping_add(chance.below(9) as u32).wrapping_sub(4)).encode_to_vec();
    for _ in 0..=chance.below(4) {
        let at = chance.below(message.len());
        match chance.below(3) {
            0 => message[at] = chance.next() as u8,
            1 => message.truncate(at.max(1)),
            _ => message.insert(at, chance.next() as u8),
        }
    }
    message
}

#[test]
fn what_others_send_neither_ends_the_edge_nor_moves_the_robot() {
    let mut cell = Cell::start();
    let edge = SocketAddr::from((Ipv4Addr::LOCALHOST, cell.port));
    let (go, stop) = (AtomicBool::new(false), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let attacker = scope.spawn(|| {
            let (mut chance, mut sent) = (Chance(0x9E37_79B9_7F4A_7C15), 0_u32);
            // The robot's own address, and another one.
            let ends =
                [Ipv4Addr::LOCALHOST, Ipv4Addr::new(127, 0, 0, 2)].map(|ip| UdpSocket::bind((ip, 0)).expect("bound"));
            while !go.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(1));
            }
            while !stop.load(Ordering::Relaxed) {
                let _ = ends[chance.below(2)].send_to(&attack(&mut chance, sent), edge);
                sent += 1;
                std::thread::sleep(Duration::from_micros(500));
            }
            sent
        });
        // It stands for a second, then for three more, and then it is over.
        let still =
            [("motion", "[{ duration_s = 3.0, twist = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0] }]"), ("timing.settle_s", "1.0")];
        let still = [&still[..], &[("start", "{ joint_position_rad = [0.3, 1.2, -1.8, 2.2, 1.57, 0.3] }")]].concat();
        // From when the session has begun: it belongs to whoever began it.
        let (truths, said) = cell.run(&still, |_, _, truth| go.store(truth.scenario_time_s > -0.9, Ordering::Relaxed));
        go.store(true, Ordering::Relaxed);
        stop.store(true, Ordering::Relaxed);
        let sent = attacker.join().expect("it ends");
        let fastest = truths.iter().map(fastest).fold(0.0, f64::max);
        println!("{sent} datagrams; fastest {fastest} rad/s: {said}");
        certain(|| assert!(sent > 1000 && fastest == 0.0, "{sent} datagrams, {fastest} rad/s"));
    });
    assert!(cell.edge.exit_status().is_none(), "{}", cell.edge.report());
    assert!(!cell.edge.stderr().contains("panicked"), "{}", cell.edge.report());
}

/// A changed bit in a robot's own message may look like a force: no answer may be faster than the limit, and none moves once
/// the messages are sound again.
#[test]
fn what_a_robot_sends_in_pieces_ends_in_zeros() {
    let mut cell = Cell::start();
    let robot = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("bound");
    robot.connect((Ipv4Addr::LOCALHOST, cell.port)).expect("an address");
    robot.set_nonblocking(true).expect("a socket");
    let (mut chance, mut last, mut answers) = (Chance(0x0123_4567_89AB_CDEF), Vec::new(), 0_u32);
    let begun = Instant::now();
    for cycle in 1..1200_u32 {
        if cycle < 900 {
            for _ in 0..4 {
                let _ = robot.send(&attack(&mut chance, cycle));
            }
        }
        robot.send(&standing(cycle).encode_to_vec()).expect("the edge is there");
        let mut buffer = [0; 4096];
        while let Ok(length) = robot.recv(&mut buffer) {
            let answer = EgmSensor::decode(&buffer[..length]).expect("an EgmSensor message");
            last = answer.speed_ref.and_then(|speeds| speeds.joints).expect("joint speeds").joints;
            assert_eq!(last.len(), 6);
            assert!(last.iter().all(|speed| speed.abs() <= 190.0 + 1e-9), "{last:?}");
            answers += 1;
        }
        let next = begun + Duration::from_millis(4) * cycle;
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    println!("{answers} answers, the last {last:?}");
    assert!(answers > 300 && last.iter().all(|speed| *speed == 0.0), "{answers} answers, the last {last:?}");
    assert!(cell.edge.exit_status().is_none() && !cell.edge.stderr().contains("panicked"), "{}", cell.edge.report());
}

#[test]
fn abb_robot_egm_drives_the_emulated_robot_and_reads_the_edge() {
    if !needs(Need::AbbRobotEgm) {
        return;
    }
    let python = python().expect("the need is met");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/python/abb_robot_egm.py");
    let cell = Cell::start();
    let json = |command: &mut Command| -> serde_json::Value {
        let (code, text) = output(command);
        assert_eq!(code, Some(0), "{text}");
        let line = text.lines().find(|line| line.starts_with('{')).unwrap_or_else(|| panic!("no result: {text}"));
        serde_json::from_str(line).expect("JSON")
    };
    // A surface would be in its way, and the arm's own motion plays no part.
    let changes = [("surface.stiffness_n_m", "100.0"), ("timing.settle_s", "20.0"), ("egm.jitter_s", "0.0")];
    let plant = cell.plant(&changes);
    let plant_arguments = plant.get_args().take_while(|argument| *argument != "--egm");
    let mut sensor = Command::new(&python);
    sensor.arg(script).arg("sensor").arg(plant.get_program()).args(plant_arguments);
    let session = json(&mut sensor);
    assert_eq!((&session["cycles"], &session["planned"], &session["force"]), (&1000.into(), &6.into(), &6.into()));
    assert_eq!((&session["motors_on"], &session["rapid_running"]), (&true.into(), &true.into()), "{session}");
    for (speed, expected) in
        session["speed"].as_array().into_iter().flatten().zip(session["expected"].as_array().into_iter().flatten())
    {
        let (speed, expected) = (speed.as_f64().expect("a number"), expected.as_f64().expect("a number"));
        assert!((speed - expected).abs() < 0.01 * expected.abs(), "{session}");
    }

    let mut robot = Command::new(&python);
    robot.arg(script).arg("robot").arg(cell.port.to_string());
    let answers = json(&mut robot);
    assert_eq!((&answers["answers"], &answers["type"]), (&200.into(), &"MSGTYPE_CORRECTION".into()), "{answers}");
    assert_eq!((&answers["joints"], &answers["external"]), (&vec![0.0; 6].into(), &vec![0.0; 2].into()), "{answers}");
    assert_eq!(answers["has_position"], false);
}

#[test]
fn files_are_checked_and_what_is_wrong_is_named() {
    let ipc = PrivateIpc::new("egm");
    let check = |edge: &str, daemon: &str| {
        let (edge, daemon) = (write(&ipc, "edge.toml", edge), write(&ipc, "daemon.toml", daemon));
        output(edge_command(&ipc, &edge, &daemon).arg("--check"))
    };
    assert_eq!(check(EDGE, DAEMON), (Some(0), "valid: 0.0.0.0:6510 for 192.168.125.1\n".to_owned()));
    let wrong = [
        (with_keys(EDGE, &[("egm.robot_address", "\"robot\"")]), DAEMON.to_owned(), "egm.robot_address = \"robot\""),
        (
            with_keys(EDGE, &[("egm.joint_speed_limit_deg_s", "[9.0, 9.0]")]),
            DAEMON.to_owned(),
            "has 2 values: accepted: 6",
        ),
        (
            EDGE.to_owned(),
            with_keys(DAEMON, &[("control.command_delay_s", "0.001")]),
            "control.command_delay_s = 0.001",
        ),
    ];
    for (edge, daemon, expected) in wrong {
        let (code, text) = check(&edge, &daemon);
        assert_eq!(code, Some(78), "{text}");
        assert!(text.contains(expected) && text.contains("accepted"), "{text}");
    }
    let missing = std::path::Path::new("/no/such/file");
    assert_eq!(output(&mut edge_command(&ipc, missing, missing)).0, Some(66));
    assert_eq!(output(Command::new(&binaries().admittance_egm).arg("--confg")).0, Some(64));
}
