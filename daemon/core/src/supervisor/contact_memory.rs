//! What is remembered of a contact from cycle to cycle.

use nalgebra::SVector;

use crate::belief::{Belief, Contact};
use crate::intake::Accepted;
use crate::quantities::{Instant, Span};
use crate::surface::{STANDSTILL, Surface};

/// Speed in m/s at which the arm may follow a surface that falls away, or that came to it.
const FOLLOWING: f64 = 0.01;
/// Part of the speed of its approach at which the arm moves in once the impact is over.
const RETURN: f64 = 0.25;
/// For so long the arm is slow: in free motion after it bounced off, since then the surface is not
/// there any more; and in contact once the impact is over, since then it has settled.
const RETURN_FOR: Span = Span::from_nanoseconds(500_000_000);
/// An arm that has not moved in for so long was halted, though it never moved out again.
const RESTING: Span = Span::from_nanoseconds(20_000_000);

/// The way back to a surface that the tool has bounced off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Return {
    /// Largest speed into the surface, m/s.
    speed: f64,
    /// When it is given up.
    end: Instant,
}

impl Return {
    /// The offset that slows ṗ0 = `twist_reference` down to its speed; `None` where there is
    /// nothing to slow down any more. (An offset of zero is one that a replay may begin after.)
    pub(super) fn offset<const D: usize>(
        &self,
        twist_reference: &SVector<f64, D>,
        surface: &Surface<D>,
        now: Instant,
    ) -> Option<SVector<f64, D>> {
        let excess = -surface.outward_speed(twist_reference) - self.speed;
        (excess > 0.0 && now < self.end).then(|| surface.normal * excess)
    }
}

/// How far an impact has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Impact {
    /// The arm still moves in, or has stood since then.
    Braking { stands_since: Option<Instant> },
    /// The arm moves out again, and may still touch.
    Rebound,
    /// The arm has left the surface, or has come to rest on it. Until then it moves in slowly.
    Over { slow_until: Instant },
}

impl Impact {
    const BRAKING: Self = Self::Braking { stands_since: None };

    fn over(now: Instant) -> Self {
        Self::Over { slow_until: now + RETURN_FOR }
    }
}

/// The memory of one contact, from the first axis that joins until the last one leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactMemory<const D: usize> {
    /// Axes on which f̂ has reached f_min since they joined.
    reached: [bool; D],
    /// Largest s·f_lin on each axis, N.
    deepest: [f64; D],
    /// Largest speed of ṗ0 into the surface, m/s.
    approach: f64,
    impact: Impact,
    /// Largest speed into the surface of an arm that came back to it, m/s; infinite for another.
    returned: f64,
    /// Whether the arm has moved out of the surface although ṗ0 did not, whatever it pressed with.
    is_thrown_back: bool,
    /// Cycles in a row in which the force was not the predicted one.
    pub(super) mismatches: u32,
    /// Cycles in a row without a solution.
    pub(super) unsolved: u32,
}

impl<const D: usize> ContactMemory<D> {
    /// Of a contact that begins `now`, for an arm that may have bounced off before.
    pub(super) fn new(bounced: Option<Return>, now: Instant) -> Self {
        Self {
            reached: [false; D],
            deepest: [0.0; D],
            approach: 0.0,
            impact: if bounced.is_some() { Impact::over(now) } else { Impact::BRAKING },
            returned: bounced.map_or(f64::INFINITY, |bounced| bounced.speed),
            is_thrown_back: false,
            mismatches: 0,
            unsolved: 0,
        }
    }

    /// Records which axes have reached f_min (N, N·m). An axis that was released starts anew when
    /// it joins again.
    pub(super) fn follow(&mut self, contact: &Contact<D>, wrench: &SVector<f64, D>, minimum_force: &SVector<f64, D>) {
        for (axis, reached) in self.reached.iter_mut().enumerate() {
            *reached = match contact.sign(axis) {
                Some(sign) => *reached || sign * wrench[axis] >= minimum_force[axis],
                None => false,
            };
        }
    }

    /// Follows the impact.
    pub(super) fn follow_impact<const N: usize>(&mut self, sample: &Accepted<N, D>, belief: &Belief<D>) {
        let (surface, posture) = (belief.surface(), &sample.posture);
        let speed = surface.outward_speed(&(posture.jacobian() * sample.joint_velocity));
        self.follow_motion(speed, surface.outward_speed(&sample.twist_reference));
        self.go_on_with_impact(speed, surface.spring_force(posture.pose()) <= 0.0, sample.stamp);
    }

    /// The arm moves out of the surface at `speed`, and ṗ0 at `told` (m/s).
    fn follow_motion(&mut self, speed: f64, told: f64) {
        self.approach = self.approach.max(-told);
        self.is_thrown_back |= speed > STANDSTILL && told <= STANDSTILL;
    }

    /// The arm moves out of the surface at `speed` (m/s), and `has_left` it or has not.
    fn go_on_with_impact(&mut self, speed: f64, has_left: bool, now: Instant) {
        self.impact = match self.impact {
            Impact::Braking { .. } if speed > STANDSTILL && self.has_reached() => Impact::Rebound,
            Impact::Braking { stands_since } if speed > -STANDSTILL => {
                let since = stands_since.unwrap_or(now);
                if now.since(since) < RESTING {
                    Impact::Braking { stands_since: Some(since) }
                } else {
                    Impact::over(now)
                }
            }
            Impact::Braking { .. } => Impact::BRAKING,
            Impact::Rebound if speed < 0.0 || has_left => Impact::over(now),
            // An arm that came back faster than it was told to has to be halted once more.
            Impact::Over { .. } if -speed > self.returned + FOLLOWING && !self.has_reached() => Impact::BRAKING,
            stage => stage,
        };
    }

    /// Whether the arm has been brought to a halt: now the force is to settle.
    pub(super) fn is_settling(&self) -> bool {
        !matches!(self.impact, Impact::Braking { .. })
    }

    /// The largest speed into the surface that may be commanded `now`, in m/s: what the approach had, and a part of
    /// that for a while after the impact.
    pub(super) fn inward_speed(&self, now: Instant) -> f64 {
        let is_slow = matches!(self.impact, Impact::Over { slow_until } if now < slow_until);
        let speed = if is_slow { self.slow() } else { self.approach };
        speed.max(FOLLOWING)
    }

    /// The speed of the way back, m/s: a part of the first approach, however often it bounces.
    fn slow(&self) -> f64 {
        if self.returned.is_finite() { self.returned.min(self.approach) } else { self.approach * RETURN }
    }

    /// The way back after a contact that ends `now`. One that was felt in a few cycles alone may
    /// have bounced off unseen, before any of them showed the arm on its way out; one of less than f_min may have
    /// thrown it back before it had stood for long enough to be halted.
    pub(super) fn way_back(&self, now: Instant) -> Option<Return> {
        let speed = self.slow().max(FOLLOWING);
        let comes_back = self.is_settling() || self.has_reached() || self.is_thrown_back;
        comes_back.then(|| Return { speed, end: now + RETURN_FOR })
    }

    /// Whether any axis has reached f_min.
    pub(super) fn has_reached(&self) -> bool {
        self.reached.contains(&true)
    }

    /// The lower bound of the force on an axis whose spring presses with `force` now, in N; −∞
    /// where none holds.
    ///
    /// f̂ lags behind; on the way to f_min the force that the spring has already reached is kept. A
    /// lost force is regained as the cost decides: under a hard bound it would return at full
    /// speed, and bounce.
    pub(super) fn lower_bound(&mut self, axis: usize, force: f64, minimum_force: f64) -> f64 {
        let deepest = &mut self.deepest[axis];
        *deepest = if force > 0.0 { deepest.max(force) } else { 0.0 };
        if *deepest > 0.0 { minimum_force.min(*deepest) } else { f64::NEG_INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: Instant = Instant::from_nanoseconds(1_000_000_000);

    /// A contact in which the arm was brought to a halt after an approach at `speed`.
    fn halted(speed: f64) -> ContactMemory<2> {
        let mut memory = ContactMemory::new(None, START);
        memory.follow_motion(-speed, -speed);
        assert_eq!(memory.inward_speed(START), speed, "as fast as it came");
        memory.reached = [true, false];
        memory.go_on_with_impact(0.02, false, START);
        memory.go_on_with_impact(-0.01, false, START);
        assert!(matches!(memory.impact, Impact::Over { .. }));
        memory
    }

    #[test]
    fn after_the_impact_the_arm_is_slow_for_a_while_and_then_follows_as_fast_as_it_came() {
        let memory = halted(0.2);
        for (since, expected) in [(0, 0.05), (499_999_999, 0.05), (500_000_000, 0.2)] {
            let now = START + Span::from_nanoseconds(since);
            assert_eq!(memory.inward_speed(now), expected, "after {since} ns");
        }
    }

    #[test]
    fn an_arm_that_stands_is_halted_though_it_never_moved_out() {
        let mut memory = ContactMemory::<2>::new(None, START);
        let mut go_on = |speed, milliseconds: u64| {
            memory.go_on_with_impact(speed, false, START + Span::from_nanoseconds(milliseconds * 1_000_000));
            memory.is_settling()
        };
        assert!(!go_on(-0.2, 0) && !go_on(-0.0005, 10) && !go_on(-0.0005, 29), "too short");
        assert!(!go_on(-0.002, 30) && !go_on(0.0, 31) && !go_on(0.0, 50), "it moved in between");
        assert!(go_on(0.0, 51));
    }

    #[test]
    fn a_bounce_between_two_samples_has_a_way_back_too() {
        let mut memory = ContactMemory::<2>::new(None, START);
        memory.follow_motion(-0.2, -0.2);
        assert_eq!(memory.way_back(START), None, "hardly touched");
        memory.reached = [false, true];
        assert_eq!(memory.way_back(START).map(|back| back.speed), Some(0.05));
    }

    #[test]
    fn a_touch_below_f_min_that_throws_the_arm_back_has_a_way_back_too() {
        let way_back = |motion: &[(f64, f64)]| {
            let mut memory = ContactMemory::<2>::new(None, START);
            motion.iter().for_each(|&(speed, told)| memory.follow_motion(speed, told));
            memory.way_back(START).map(|back| back.speed)
        };
        assert_eq!(way_back(&[(-0.2, -0.2), (-0.1, -0.2)]), None, "still on its way in");
        // On its way in once more before f̂ has shown that it left.
        assert_eq!(way_back(&[(-0.2, -0.2), (0.1, -0.2), (-0.1, -0.2)]), Some(0.05));
        assert_eq!(way_back(&[(-0.2, -0.2), (-0.1, 0.1), (0.1, 0.1)]), None, "it moves out as it is told");
    }

    #[test]
    fn a_touch_that_is_faster_than_the_way_back_is_an_impact_of_its_own() {
        let back = halted(0.2).way_back(START);
        for (speed, is_braking) in [(-0.05, false), (-0.2, true)] {
            let mut memory = ContactMemory::<2>::new(back, START);
            memory.go_on_with_impact(speed, false, START);
            assert_eq!(memory.impact == Impact::BRAKING, is_braking, "at {speed} m/s");
        }
    }
}
