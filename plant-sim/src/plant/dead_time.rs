//! The references on their way to the joints' speed loops, each of which they reach after its dead
//! time.

use nalgebra::SVector;
use std::collections::VecDeque;

/// The references of N joints, by the instant from which each holds.
#[derive(Debug, Clone)]
pub(super) struct DeadTime<const N: usize> {
    dead_time_ns: [u64; N],
    references: VecDeque<(u64, SVector<f64, N>)>,
}

impl<const N: usize> DeadTime<N> {
    /// No reference yet: zero. References change at most `changes` times in the longest dead time.
    pub(super) fn new(dead_time_ns: [u64; N], changes: usize) -> Self {
        Self { dead_time_ns, references: VecDeque::with_capacity(changes + 2) }
    }

    /// A reference in rad/s that is given at `now_ns`, not earlier than any before it.
    pub(super) fn push(&mut self, now_ns: u64, reference: &SVector<f64, N>) {
        let longest = self.dead_time_ns.iter().copied().max().unwrap_or(0);
        // What has reached every joint is needed only as long as nothing newer has.
        while self.references.len() > 1 && self.references[1].0 + longest <= now_ns {
            self.references.pop_front();
        }
        self.references.push_back((now_ns, *reference));
    }

    /// What each loop is given at an instant, in rad/s.
    pub(super) fn reached(&self, now_ns: u64) -> SVector<f64, N> {
        SVector::from_fn(|joint, _| {
            let given = self.references.iter().rfind(|(from, _)| from + self.dead_time_ns[joint] <= now_ns);
            given.map_or(0.0, |(_, reference)| reference[joint])
        })
    }

    /// The next instant at which that changes.
    pub(super) fn next_change(&self, now_ns: u64) -> Option<u64> {
        let changes = self.references.iter().flat_map(|(from, _)| self.dead_time_ns.map(|dead| from + dead));
        changes.filter(|change| *change > now_ns).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn each_joint_gets_its_reference_after_its_own_dead_time() {
        let mut references = DeadTime::new([0, 300], 8);
        assert_eq!((references.reached(50), references.next_change(50)), (Vector2::zeros(), None));
        let given = [(100, Vector2::new(1.0, 1.0)), (200, Vector2::new(2.0, 2.0)), (300, Vector2::new(3.0, 3.0))];
        for (from, reference) in given {
            references.push(from, &reference);
        }
        assert_eq!((references.reached(300), references.next_change(300)), (Vector2::new(3.0, 0.0), Some(400)));
        assert_eq!((references.reached(499), references.next_change(499)), (Vector2::new(3.0, 1.0), Some(500)));
        assert_eq!(references.reached(500), Vector2::new(3.0, 2.0));
        references.push(700, &Vector2::new(7.0, 7.0));
        assert_eq!((references.reached(700), references.next_change(700)), (Vector2::new(7.0, 3.0), Some(1000)));
        assert_eq!((references.reached(1000), references.next_change(1000)), (Vector2::new(7.0, 7.0), None));
        assert!(references.references.len() <= 3, "{references:?}");
    }
}
