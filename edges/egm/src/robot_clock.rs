//! The robot's clock against this host's CLOCK_MONOTONIC. A message says when it was measured; when it arrives it has been
//! on the way for a time that differs from message to message. The quickest of them say how the clocks differ.

/// How fast the robot's clock may seem to run away, parts per million: crystals are off by 100 at most.
const DRIFT_PPM: u64 = 200;
/// How fast a quicker message is believed, parts per million: much faster than the drift, so that the quickest few count, and
/// slowly enough for stamps to stay even to a hundredth.
const CATCH_UP_PPM: u64 = 10_000;

/// How this host's clock differs from the robot's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RobotClock {
    /// What is added to the robot's time, ns; it may be negative, and wraps then.
    difference: u64,
}

impl RobotClock {
    /// From the first message: measured at `robot_ns` of the robot's clock, here at `arrival_ns`.
    pub fn new(robot_ns: u64, arrival_ns: u64) -> Self {
        Self { difference: arrival_ns.wrapping_sub(robot_ns) }
    }

    /// While nothing depends on the stamps: the quickest message counts at once.
    pub fn listen(&mut self, robot_ns: u64, arrival_ns: u64) {
        if self.lateness(robot_ns, arrival_ns) < 0 {
            *self = Self::new(robot_ns, arrival_ns);
        }
    }

    /// Follows the robot's clock by as much as `elapsed_ns` since the last message let it drift, and gives the instant at
    /// which this message was measured. It is never after its arrival.
    #[must_use]
    pub fn stamp(&mut self, robot_ns: u64, arrival_ns: u64, elapsed_ns: u64) -> u64 {
        let share = |ppm: u64| elapsed_ns.saturating_mul(ppm) / 1_000_000;
        let late = self.lateness(robot_ns, arrival_ns);
        if late < 0 {
            self.difference = self.difference.wrapping_sub(late.unsigned_abs().min(share(CATCH_UP_PPM)));
        } else {
            self.difference = self.difference.wrapping_add(late.unsigned_abs().min(share(DRIFT_PPM)));
        }
        robot_ns.wrapping_add(self.difference).min(arrival_ns)
    }

    /// By how much later than the quickest a message came, ns.
    pub fn lateness(&self, robot_ns: u64, arrival_ns: u64) -> i64 {
        arrival_ns.wrapping_sub(robot_ns).wrapping_sub(self.difference).cast_signed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE_NS: u64 = 4_000_000;
    const LISTENED: u64 = crate::session::LISTENED as u64;

    /// Cycles of a robot whose clock is off by `ppm`: the stamps and the instants at which it really measured. Each
    /// message is `delay_ns` on the way.
    fn stamps(ppm: i64, delay_ns: impl Fn(u64) -> u64) -> Vec<(u64, u64)> {
        let mut clock = None;
        let stamps = (1..25_000_u64).map(|cycle| {
            let true_ns = 1_000_000_000 + cycle * CYCLE_NS;
            let robot_ns = (77_000_000_000_i64 + (cycle * CYCLE_NS) as i64 * (1_000_000 + ppm) / 1_000_000) as u64;
            let arrival_ns = true_ns + delay_ns(cycle);
            let clock = clock.get_or_insert_with(|| RobotClock::new(robot_ns, arrival_ns));
            if cycle <= LISTENED {
                clock.listen(robot_ns, arrival_ns);
            }
            (clock.stamp(robot_ns, arrival_ns, CYCLE_NS), true_ns)
        });
        stamps.collect()
    }

    #[test]
    fn it_follows_a_clock_that_drifts_by_100_ppm_through_jitter() {
        for ppm in [-100, 0, 100] {
            // Some come at once, some 2 ms later, in no order.
            let stamps = stamps(ppm, |cycle| 100_000 + cycle * 7_919 % 2_000_000);
            for pair in stamps[LISTENED as usize..].windows(2) {
                let spacing = pair[1].0 - pair[0].0;
                // What the daemon takes for even.
                assert!(spacing.abs_diff(CYCLE_NS) <= CYCLE_NS / 10, "{ppm} ppm: {spacing} ns from stamp to stamp");
            }
            for (stamp, true_ns) in &stamps[500..] {
                assert!(stamp.abs_diff(*true_ns) < 1_500_000, "{ppm} ppm: stamped {stamp}, measured at {true_ns}");
            }
        }
    }

    #[test]
    fn one_message_that_is_late_moves_nothing() {
        let stamps = stamps(0, |cycle| if cycle == 100 { 50_000_000 } else { 0 });
        let moved = stamps.iter().map(|(stamp, true_ns)| stamp.abs_diff(*true_ns)).max();
        assert!(moved <= Some(1000), "{moved:?}");
    }

    #[test]
    fn listening_takes_the_quickest() {
        let mut clock = RobotClock::new(1_000, 9_000);
        clock.listen(2_000, 7_000);
        clock.listen(3_000, 12_000);
        assert_eq!(clock.lateness(4_000, 9_000), 0);
    }
}
