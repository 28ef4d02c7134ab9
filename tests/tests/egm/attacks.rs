//! What a robot's messages become that are spoilt or sent by somebody else.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use egm_messages::{EgmSensor, Message};
use end_to_end::certain;
use end_to_end::egm_robot::standing;

use crate::cell::{Cell, fastest};

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
