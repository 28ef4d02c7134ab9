//! One session of the robot: which of its messages count, and what a state sample says of them. No socket and no clock:
//! the time of arrival is an argument.

use ipc_types::MAX_JOINTS;

use crate::reading::{Reading, RobotTime};
use crate::robot_clock::RobotClock;

/// Messages that are only listened to at the start: what the clocks differ by must be known before stamps count.
pub const LISTENED: u32 = 50;
/// Cycles without a message after which speeds are no longer taken from the difference: the next one begins anew.
const LONGEST_GAP: u64 = 5;
/// By so much a message may be late, ns: what is later is of a clock that was set, or of another time.
const LATEST_NS: u64 = 100_000_000;
/// By how much faster than its limit a joint may seem to move: measured positions are not exact.
const MARGIN: f64 = 1.5;

/// What is measured and led to, with the speeds of both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// CLOCK_MONOTONIC at the measurement, ns.
    pub stamp_ns: u64,
    /// Cycles since the last message that counted of which none came.
    pub missed: u64,
    /// The message.
    pub reading: Reading,
    /// q̇, rad/s or m/s: the mean since the message before.
    pub velocity: [f64; MAX_JOINTS],
    /// q̇0 in the same way, and as two messages in a row have it: of each joint the slower, or 0 where they do not agree which
    /// way. One message with a changed value leads nowhere.
    pub reference_velocity: [f64; MAX_JOINTS],
}

/// Why a sound message does not count.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// It was there before, or a later one was.
    #[error("message {got} comes after message {newest}: a duplicate, or out of order")]
    Old {
        /// Its number.
        got: u32,
        /// The newest number.
        newest: u32,
    },
    /// The robot's clock does not go on.
    #[error("the robot's clock stands or goes back at message {sequence}")]
    Clock {
        /// The message.
        sequence: u32,
    },
    /// It comes much later or earlier than its clock says.
    #[error("message {sequence} is {late_ms} ms late by the robot's clock: accepted: at most 100 ms, either way")]
    Late {
        /// The message.
        sequence: u32,
        /// By how much.
        late_ms: i64,
    },
    /// No joint moves like that.
    #[error("joint {joint} goes at {speed} rad/s or m/s in {list} of message {sequence}: accepted: at most {accepted}")]
    TooFast {
        /// The message.
        sequence: u32,
        /// In which list.
        list: &'static str,
        /// Which, from 0.
        joint: usize,
        /// How fast.
        speed: f64,
        /// What is accepted.
        accepted: f64,
    },
}

/// The messages of one session.
#[derive(Debug, Clone)]
pub struct Session {
    sampling_time_ns: u64,
    /// The fastest that each joint moves, rad/s or m/s.
    speed_limit: [f64; MAX_JOINTS],
    last: Option<Last>,
    listened: u32,
    /// Time on the robot's clock from the last message that counted to the first after it in which a joint jumps, ns.
    doubted_ns: Option<u64>,
}

#[derive(Debug, Clone, Copy)]
struct Last {
    reading: Reading,
    /// On the robot's clock, ns, without wraps.
    robot_ns: u64,
    stamp_ns: u64,
    clock: RobotClock,
    /// q̇0 as this message alone has it, rad/s or m/s.
    led: [f64; MAX_JOINTS],
}

impl Session {
    /// A session that has not begun, of an arm whose joints move at most so fast (rad/s or m/s).
    pub fn new(sampling_time_ns: u64, speed_limit: [f64; MAX_JOINTS]) -> Self {
        Self { sampling_time_ns, speed_limit, last: None, listened: 0, doubted_ns: None }
    }

    /// Takes a message that arrived at `arrival_ns`. `None`: it counts, but is no sample yet.
    ///
    /// # Errors
    /// [`Refusal`]: it is as if it had not come.
    pub fn take(&mut self, reading: &Reading, arrival_ns: u64) -> Result<Option<Measured>, Refusal> {
        let Some(last) = self.last else {
            let robot_ns = match reading.time {
                RobotTime::FeedBack(ns) => ns,
                RobotTime::Header(ms) => u64::from(ms) * 1_000_000,
            };
            let clock = RobotClock::new(robot_ns, arrival_ns);
            self.last = Some(Last { reading: *reading, robot_ns, stamp_ns: arrival_ns, clock, led: [0.0; MAX_JOINTS] });
            return Ok(None);
        };
        let (sequence, newest) = (reading.sequence, last.reading.sequence);
        // Numbers wrap: what is less than half of them ahead is newer.
        if sequence.wrapping_sub(newest).cast_signed() <= 0 {
            return Err(Refusal::Old { got: sequence, newest });
        }
        let elapsed_ns = elapsed(&last.reading.time, &reading.time).ok_or(Refusal::Clock { sequence })?;
        let robot_ns = last.robot_ns.wrapping_add(elapsed_ns);
        let late_ns = last.clock.lateness(robot_ns, arrival_ns);
        if late_ns.unsigned_abs() > LATEST_NS {
            return Err(Refusal::Late { sequence, late_ms: late_ns / 1_000_000 });
        }
        let speeds = self.speeds("feedBack.joints", reading, &last, elapsed_ns, |reading| &reading.position);
        let both = speeds.and_then(|velocity| {
            let led = self.speeds("planned.joints", reading, &last, elapsed_ns, |reading| &reading.reference)?;
            Ok((velocity, led))
        });
        let (velocity, led) = both.inspect_err(|_| {
            self.doubted_ns.get_or_insert(elapsed_ns);
        })?;
        self.doubted_ns = None;

        let mut clock = last.clock;
        let stamp_ns = if self.listened < LISTENED {
            clock.listen(robot_ns, arrival_ns);
            self.listened += 1;
            None
        } else {
            Some(clock.stamp(robot_ns, arrival_ns, elapsed_ns)).filter(|stamp_ns| *stamp_ns > last.stamp_ns)
        };
        self.last = Some(Last { reading: *reading, robot_ns, stamp_ns: stamp_ns.unwrap_or(last.stamp_ns), clock, led });
        let is_gap = elapsed_ns > LONGEST_GAP * self.sampling_time_ns;
        Ok(stamp_ns.filter(|_| !is_gap).map(|stamp_ns| Measured {
            stamp_ns,
            missed: ((elapsed_ns + self.sampling_time_ns / 2) / self.sampling_time_ns).saturating_sub(1),
            reading: *reading,
            velocity,
            reference_velocity: std::array::from_fn(|joint| agreed(last.led[joint], led[joint])),
        }))
    }

    fn speeds(
        &self,
        list: &'static str,
        reading: &Reading,
        last: &Last,
        elapsed_ns: u64,
        joints: fn(&Reading) -> &[f64; MAX_JOINTS],
    ) -> Result<[f64; MAX_JOINTS], Refusal> {
        let (now, before) = (joints(reading), joints(&last.reading));
        let over = |ns: u64| {
            let seconds = ns as f64 * 1e-9;
            std::array::from_fn::<f64, MAX_JOINTS, _>(|joint| (now[joint] - before[joint]) / seconds)
        };
        // A jump is not believed by and by, because time passes in which a joint might have gone so far: who says one again and
        // again is heard in another session.
        let believed_ns = self.doubted_ns.map_or(elapsed_ns, |ns| elapsed_ns.min(ns + self.sampling_time_ns));
        for (joint, (speed, limit)) in over(believed_ns).iter().zip(&self.speed_limit).enumerate() {
            let (speed, accepted) = (speed.abs(), MARGIN * limit);
            if speed > accepted {
                return Err(Refusal::TooFast { sequence: reading.sequence, list, joint, speed, accepted });
            }
        }
        Ok(over(elapsed_ns))
    }
}

/// The slower of two speeds; 0 where they go opposite ways.
fn agreed(one: f64, other: f64) -> f64 {
    if one * other <= 0.0 { 0.0 } else { one.signum() * one.abs().min(other.abs()) }
}

/// Time in ns from one instant of the robot's clock to a later one; `None` where it is not later, or not of the same clock.
fn elapsed(from: &RobotTime, to: &RobotTime) -> Option<u64> {
    match (from, to) {
        (RobotTime::FeedBack(from), RobotTime::FeedBack(to)) => to.checked_sub(*from).filter(|ns| *ns > 0),
        (RobotTime::Header(from), RobotTime::Header(to)) => {
            let ms = to.wrapping_sub(*from).cast_signed();
            (ms > 0).then(|| u64::from(ms.unsigned_abs()) * 1_000_000)
        }
        (RobotTime::FeedBack(_), RobotTime::Header(_)) | (RobotTime::Header(_), RobotTime::FeedBack(_)) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reading::Leads;
    use crate::reading::tests::{UNITS, message};

    const CYCLE_NS: u64 = 4_000_000;
    const START_NS: u64 = 5_000_000_000;

    fn session() -> Session {
        Session::new(CYCLE_NS, [3.0; MAX_JOINTS])
    }

    /// A message that arrives when it was measured; the joints turn at 1 and the reference at 2 degrees per cycle.
    fn reading(cycle: u32) -> (Reading, u64) {
        let degrees = f64::from(cycle) * 0.1;
        let sent = message(cycle, u64::from(cycle) * 4000, degrees, 2.0 * degrees);
        (Reading::of(&sent, &UNITS, Leads::PlannedPath).expect("sound"), START_NS + u64::from(cycle) * CYCLE_NS)
    }

    fn take(session: &mut Session, cycle: u32) -> Result<Option<Measured>, Refusal> {
        let (reading, arrival_ns) = reading(cycle);
        session.take(&reading, arrival_ns)
    }

    fn begun() -> Session {
        let mut session = session();
        for cycle in 1..=LISTENED + 1 {
            assert_eq!(take(&mut session, cycle), Ok(None), "cycle {cycle}");
        }
        session
    }

    #[test]
    fn speeds_are_differences_on_the_robots_clock() {
        let mut session = begun();
        let cycle = LISTENED + 2;
        let (reading, arrival_ns) = reading(cycle);
        // On the way for 3 ms: the stamp is when it was measured, and the speed does not know.
        let measured = session.take(&reading, arrival_ns + 3_000_000).expect("sound").expect("a sample");
        assert!(measured.stamp_ns.abs_diff(arrival_ns) <= 1000, "{measured:?}");
        let expected = 0.1_f64.to_radians() / 0.004;
        assert!((measured.velocity[3] - expected).abs() < 1e-9, "{measured:?}");
        assert!((measured.reference_velocity[3] - 2.0 * expected).abs() < 1e-9, "{measured:?}");
        assert_eq!(measured.velocity[6..], [0.0; 2]);
    }

    #[test]
    fn what_is_old_does_not_count_and_changes_nothing() {
        let mut session = begun();
        let newest = LISTENED + 1;
        let (next, arrival_ns) = reading(newest + 1);
        for got in [newest, newest - 1, 1, newest.wrapping_sub(1 << 31)] {
            let old = Reading { sequence: got, ..next };
            assert_eq!(session.take(&old, arrival_ns), Err(Refusal::Old { got, newest }), "{got}");
        }
        let after = take(&mut session, newest + 1).expect("sound").expect("a sample");
        assert!((after.velocity[0] - 0.1_f64.to_radians() / 0.004).abs() < 1e-9);
    }

    #[test]
    fn a_lost_message_leaves_the_mean_and_a_gap_nothing() {
        let mut session = begun();
        let measured = take(&mut session, LISTENED + 4).expect("sound").expect("a sample");
        assert_eq!(measured.missed, 2);
        assert!((measured.velocity[0] - 0.1_f64.to_radians() / 0.004).abs() < 1e-9);
        assert_eq!(take(&mut session, LISTENED + 20), Ok(None));
        assert!(take(&mut session, LISTENED + 21).expect("sound").is_some());
    }

    #[test]
    fn one_message_with_a_changed_reference_leads_nowhere() {
        let mut session = begun();
        let led = 0.2_f64.to_radians() / 0.004;
        for cycle in LISTENED + 2..LISTENED + 8 {
            let (mut changed, arrival_ns) = reading(cycle);
            if cycle == LISTENED + 4 {
                changed.reference[2] += 0.01;
            }
            let measured = session.take(&changed, arrival_ns).expect("sound").expect("a sample");
            let speeds = measured.reference_velocity;
            assert!((0.0..led + 1e-9).contains(&speeds[2]), "cycle {cycle}: {speeds:?}, led at {led}");
            assert!((speeds[0] - led).abs() < 1e-9, "the others go on: {speeds:?}");
        }
    }

    #[test]
    fn what_no_robot_does_is_refused() {
        let mut session = begun();
        let (sound, arrival_ns) = reading(LISTENED + 2);
        let mut jumped = sound;
        jumped.position[4] += 0.05;
        assert!(matches!(session.take(&jumped, arrival_ns), Err(Refusal::TooFast { joint: 4, .. })));
        let mut led = sound;
        led.reference[1] -= 0.05;
        assert!(matches!(session.take(&led, arrival_ns), Err(Refusal::TooFast { list: "planned.joints", .. })));
        let stands = Reading { time: RobotTime::FeedBack(0), ..sound };
        assert!(matches!(session.take(&stands, arrival_ns), Err(Refusal::Clock { .. })));
        let other = Reading { time: RobotTime::Header(0), ..sound };
        assert!(matches!(session.take(&other, arrival_ns), Err(Refusal::Clock { .. })));
        assert!(matches!(session.take(&sound, arrival_ns + 200_000_000), Err(Refusal::Late { late_ms: 200, .. })));
        // Half of all times away, which is later than it is early by nothing: the one time whose magnitude has no i64.
        let opposite = arrival_ns.wrapping_sub(START_NS).wrapping_add(1 << 63);
        let far = Reading { time: RobotTime::FeedBack(opposite), ..sound };
        assert!(matches!(session.take(&far, arrival_ns), Err(Refusal::Late { .. })));
        assert!(session.take(&sound, arrival_ns).expect("none of that has left a trace").is_some());
    }

    #[test]
    fn a_jump_is_not_believed_because_time_passes() {
        let mut session = begun();
        for cycle in LISTENED + 2..LISTENED + 200 {
            let (mut jumped, arrival_ns) = reading(cycle);
            jumped.position[4] += 0.05;
            let refused = session.take(&jumped, arrival_ns);
            assert!(matches!(refused, Err(Refusal::TooFast { .. })), "cycle {cycle}: {refused:?}");
        }
        // Two of them, and the arm goes on as before, at two thirds of its limit.
        let mut session = begun();
        for cycle in LISTENED + 2..LISTENED + 10 {
            let (mut sound, arrival_ns) = reading(cycle);
            sound.position[0] = 2.0 * 0.004 * f64::from(cycle - LISTENED - 1) + reading(LISTENED + 1).0.position[0];
            let is_jump = (LISTENED + 4..LISTENED + 6).contains(&cycle);
            sound.position[4] += if is_jump { 0.05 } else { 0.0 };
            assert_eq!(session.take(&sound, arrival_ns).is_err(), is_jump, "cycle {cycle}");
        }
    }

    #[test]
    fn the_headers_clock_and_the_numbers_wrap() {
        assert_eq!(elapsed(&RobotTime::Header(u32::MAX), &RobotTime::Header(3)), Some(4_000_000));
        assert_eq!(elapsed(&RobotTime::Header(3), &RobotTime::Header(u32::MAX)), None);
        let mut session = session();
        let numbered = |sequence| Reading { sequence, ..reading(1).0 };
        assert_eq!(session.take(&numbered(u32::MAX), START_NS), Ok(None));
        let next = Reading { sequence: 0, ..reading(2).0 };
        assert_eq!(session.take(&next, START_NS + CYCLE_NS), Ok(None));
    }
}
