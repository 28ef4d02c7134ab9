//! What is sent: random bytes, messages with some bytes changed, and messages with some fields changed, so that what comes behind
//! the decoding is reached too.

use admittance_egm::reading::{Leads, Reading};
use egm_messages::{EgmRobot, JointUnit, Message};
use rand::{Rng, RngExt as _};

use crate::hostile::spoil::STRANGE;

/// Who sends it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sender {
    /// The robot's own address and port.
    Robot,
    /// Another port of its address.
    OtherPort,
    /// Another address.
    OtherAddress,
}

pub(super) struct Datagram {
    pub(super) bytes: Vec<u8>,
    pub(super) sender: Sender,
    /// Whether the edge may take it for its robot's and act on something in it that is not so.
    pub(super) may_move: bool,
}

const LONGEST: usize = 6000;
/// Units of the joints of the arm that is attacked.
const UNITS: [JointUnit; 6] = [JointUnit::Degree; 6];

/// Anything, made from the message that the robot sends in this cycle.
pub(super) fn draw(random: &mut impl Rng, robots: &EgmRobot) -> Datagram {
    let sender = [Sender::Robot, Sender::Robot, Sender::OtherPort, Sender::OtherAddress][random.random_range(0..4)];
    let bytes = match random.random_range(0..4) {
        0 => (0..random.random_range(0..LONGEST)).map(|_| random.random()).collect(),
        1 => with_bytes(random, robots.encode_to_vec()),
        _ => with_fields(random, robots.clone()).encode_to_vec(),
    };
    let may_move = sender == Sender::Robot && says_something_else(&bytes, robots);
    Datagram { bytes, sender, may_move }
}

/// Anything on which no edge may move its robot.
pub(super) fn draw_harmless(random: &mut impl Rng, robots: &EgmRobot) -> Datagram {
    loop {
        let datagram = draw(random, robots);
        if !datagram.may_move {
            return datagram;
        }
    }
}

/// Whether it can be read, and another position, path, force or torque is in it than the robot's.
fn says_something_else(bytes: &[u8], robots: &EgmRobot) -> bool {
    let read = |message: &EgmRobot| Reading::of(message, &UNITS, Leads::PlannedPath).ok();
    let (Ok(message), Some(known)) = (EgmRobot::decode(bytes), read(robots)) else { return false };
    read(&message).is_some_and(|reading| {
        reading.position != known.position
            || reading.reference != known.reference
            || reading.wrench != known.wrench
            || reading.torque != known.torque
    })
}

fn with_bytes(random: &mut impl Rng, mut message: Vec<u8>) -> Vec<u8> {
    for _ in 0..random.random_range(1..=4) {
        let at = random.random_range(0..message.len());
        match random.random_range(0..4) {
            0 => message[at] = random.random(),
            1 => message[at] ^= 1 << random.random_range(0..8),
            2 => message.truncate(at.max(1)),
            _ => message.insert(at, random.random()),
        }
    }
    message
}

fn number(random: &mut impl Rng) -> f64 {
    match random.random_range(0..3) {
        0 => STRANGE[random.random_range(0..STRANGE.len())],
        1 => f64::from_bits(random.random()),
        _ => random.random_range(-200.0..200.0),
    }
}

fn some<T>(of: &mut Option<T>) -> Option<&mut T> {
    of.as_mut()
}

fn with_fields(random: &mut impl Rng, mut message: EgmRobot) -> EgmRobot {
    for _ in 0..random.random_range(1..=3) {
        change(random, &mut message);
    }
    message
}

/// Another value in one field.
fn change(random: &mut impl Rng, message: &mut EgmRobot) {
    let feedback = some(&mut message.feed_back);
    match random.random_range(0..17) {
        0 => message.header = None,
        1 => {
            if let Some(header) = &mut message.header {
                let near = header.seqno.unwrap_or(0).wrapping_add(random.random_range(0..12)).wrapping_sub(6);
                header.seqno = [Some(near), Some(random.random()), None][random.random_range(0..3)];
            }
        }
        2 => {
            if let Some(header) = &mut message.header {
                header.mtype =
                    [None, Some(random.random_range(-1..6)), Some(random.random())][random.random_range(0..3)];
            }
        }
        3 => {
            if let Some(clock) = feedback.and_then(|feedback| some(&mut feedback.time)) {
                let near = clock.usec.wrapping_add(random.random_range(0..40_000)).wrapping_sub(20_000);
                clock.usec = if random.random_bool(0.7) { near } else { random.random() };
                clock.sec = if random.random_bool(0.8) { clock.sec } else { random.random() };
            }
        }
        4 => {
            if let Some(feedback) = feedback {
                feedback.time = None;
            }
        }
        5 => message.feed_back = None,
        6 => message.planned = None,
        7 => message.motor_state = None,
        8 => {
            if let Some(motors) = &mut message.motor_state {
                motors.state = random.random_range(-1..5);
            }
        }
        9 => {
            if let Some(guidance) = &mut message.mci_state {
                guidance.state = random.random_range(-1..6);
            }
        }
        10 => {
            if let Some(program) = &mut message.rapid_exec_state {
                program.state = random.random_range(-1..5);
            }
        }
        11 => {
            if let Some(force) = &mut message.measured_force {
                force.fc_active = [None, Some(false), Some(true)][random.random_range(0..3)];
            }
        }
        12 => {
            if let Some(force) = &mut message.measured_force {
                spoil(random, &mut force.force);
            }
        }
        13 => {
            if let Some(joints) = feedback.and_then(|feedback| some(&mut feedback.joints)) {
                spoil(random, &mut joints.joints);
            }
        }
        14 => {
            if let Some(feedback) = feedback {
                let axes = (0..random.random_range(0..40)).map(|_| number(random)).collect();
                feedback.external_joints = Some(egm_messages::EgmJoints { joints: axes });
            }
        }
        15 => {
            if let Some(torques) = &mut message.torque_ref {
                spoil(random, &mut torques.joints);
            }
        }
        _ => {
            if let Some(joints) = some(&mut message.planned).and_then(|planned| some(&mut planned.joints)) {
                spoil(random, &mut joints.joints);
            }
        }
    }
}

/// A list with another value, one more or one less.
fn spoil(random: &mut impl Rng, values: &mut Vec<f64>) {
    let at = random.random_range(0..=values.len());
    match random.random_range(0..8) {
        0 => values.truncate(at),
        1 => values.insert(at, number(random)),
        // A little: what a robot could do.
        2..=4 => {
            if let Some(value) = values.get_mut(at) {
                *value += random.random_range(-0.3..0.3);
            }
        }
        _ => {
            if let Some(value) = values.get_mut(at) {
                *value = number(random);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hostile::egm::robot::Robot;
    use rand::SeedableRng as _;

    #[test]
    fn much_of_it_reaches_what_is_behind_the_decoding() {
        let robot = Robot::new(([127, 0, 0, 1], 9).into(), &[1.0; 6]).expect("a socket").message();
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let drawn: Vec<Datagram> = (0..4000).map(|_| draw(&mut random, &robot)).collect();
        let share = |is_it: &dyn Fn(&Datagram) -> bool| drawn.iter().filter(|one| is_it(one)).count() as f64 / 4000.0;
        let decoded = share(&|one| EgmRobot::decode(&one.bytes[..]).is_ok());
        let read = share(&|one| {
            EgmRobot::decode(&one.bytes[..]).is_ok_and(|sent| Reading::of(&sent, &UNITS, Leads::PlannedPath).is_ok())
        });
        let moving = share(&|one| one.may_move);
        println!("decoded {decoded}, read {read}, may move {moving}");
        assert!(decoded > 0.5 && read > 0.2 && moving > 0.05, "decoded {decoded}, read {read}, may move {moving}");
        let harmless = (0..4000).map(|_| draw_harmless(&mut random, &robot));
        let of_robot = harmless.filter(|one| !one.may_move && one.sender == Sender::Robot).count();
        assert!(of_robot > 1000, "{of_robot} from the robot's own address");
    }
}
