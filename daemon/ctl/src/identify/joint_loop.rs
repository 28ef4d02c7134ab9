//! How a joint follows its reference, by the closed forms of the daemon's own model.

use admittance_core::mpc::Discretization;
use admittance_core::robot::VelocityLoops;
use nalgebra::SVector;

use super::reference::References;

/// A joint's speed loop, as `[robot]` tells one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Loop {
    pub(super) time_constant_s: f64,
    /// 0 is a loop of first order.
    pub(super) damping: f64,
    pub(super) dead_time_s: f64,
    pub(super) report_lag_s: f64,
}

/// A joint at an instant.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moving {
    pub(super) position: f64,
    pub(super) velocity: f64,
    acceleration: f64,
    /// The velocity as it is reported.
    pub(super) shown: f64,
}

impl Moving {
    pub(super) fn beginning(position: f64, velocity: f64) -> Self {
        Self { position, velocity, acceleration: 0.0, shown: velocity }
    }
}

/// What a stretch of constant reference makes of position, velocity, acceleration and reported
/// velocity: by velocity, acceleration and reference at its start.
#[derive(Clone, Copy)]
struct Step {
    position: [f64; 3],
    velocity: [f64; 3],
    acceleration: [f64; 3],
    shown: [f64; 3],
    /// What is left of the reported velocity.
    left: f64,
}

impl Loop {
    fn step(&self, duration_s: f64) -> Step {
        let mut loops = VelocityLoops::<1>::first_order(SVector::from([self.time_constant_s]));
        loops.damping[0] = self.damping;
        let lag = self.report_lag_s;
        let step = Discretization::Zoh.step(duration_s, &loops, &SVector::<f64, 1>::new(lag));
        let by = |to: usize| {
            let of = &step.carried_by[to];
            [of[0][0], of[1][0], step.carried_by_reference[to][0]]
        };
        let position = [step.position_by[0][0], step.position_by[1][0], step.position_by_reference[0]];
        let filtered = [step.wrench_by[0][(0, 0)], step.wrench_by[1][(0, 0)], step.wrench_by_reference[(0, 0)]];
        // The filter of a velocity is the derivative of that of its position.
        let (shown, left) = if lag > 0.0 {
            (std::array::from_fn(|from| (position[from] - filtered[from]) / lag), step.wrench_decay[0])
        } else {
            (by(0), 0.0)
        };
        Step { position, velocity: by(0), acceleration: by(1), shown, left }
    }

    /// The motion of one joint at ascending instants (s), from the first on.
    pub(super) fn follow(&self, references: &References, joint: usize, at_s: &[f64], start: Moving) -> Vec<Moving> {
        let mut steps = Steps { of: *self, known: Vec::new() };
        let (mut now, mut now_s) = (start, at_s.first().copied().unwrap_or(0.0));
        let mut moved = Vec::with_capacity(at_s.len());
        let reaches = |index: usize| references.from_s.get(index).map_or(f64::INFINITY, |from| from + self.dead_time_s);
        let mut next = references.from_s.partition_point(|from| from + self.dead_time_s <= now_s);
        for until_s in at_s {
            while now_s < *until_s {
                while reaches(next) <= now_s {
                    next += 1;
                }
                let reference = references.value.get(next.saturating_sub(1)).map_or(0.0, |value| value[joint]);
                let end_s = reaches(next).min(*until_s);
                now = steps.of_length(end_s - now_s).taken(&now, reference);
                now_s = end_s;
            }
            moved.push(now);
        }
        moved
    }
}

/// Steps that were computed already: of a steady cycle a few lengths come back again and again.
struct Steps {
    of: Loop,
    known: Vec<(u64, Step)>,
}

/// More lengths than this are those of stamps that jitter.
const MOST_STEPS: usize = 16;

impl Steps {
    fn of_length(&mut self, length_s: f64) -> Step {
        // To the picosecond: a sum of times is not exact.
        let length_ps = (length_s * 1e12).round() as u64;
        if let Some((_, step)) = self.known.iter().find(|(known, _)| *known == length_ps) {
            return *step;
        }
        if self.known.len() == MOST_STEPS {
            self.known.clear();
        }
        let step = self.of.step(length_ps as f64 * 1e-12);
        self.known.push((length_ps, step));
        step
    }
}

impl Step {
    fn taken(&self, from: &Moving, reference: f64) -> Moving {
        let of = |by: &[f64; 3]| by[0] * from.velocity + by[1] * from.acceleration + by[2] * reference;
        Moving {
            position: from.position + of(&self.position),
            velocity: of(&self.velocity),
            acceleration: of(&self.acceleration),
            shown: self.left * from.shown + of(&self.shown),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_response_with_dead_time_and_report_lag_is_the_analytic_one() {
        let references = References { from_s: vec![0.0, 0.01], value: vec![[0.0; 8], [0.4; 8]] };
        let (t, dead, lag) = (0.012, 0.0023, 0.004);
        let joint = Loop { time_constant_s: t, damping: 0.0, dead_time_s: dead, report_lag_s: lag };
        let at: Vec<f64> = (0..60).map(|sample| f64::from(sample) * 1e-3).collect();
        for (moving, at) in joint.follow(&references, 3, &at, Moving::default()).iter().zip(&at) {
            let s = (at - 0.01 - dead).max(0.0);
            let velocity = 0.4 * (1.0 - (-s / t).exp());
            let shown = 0.4 * (1.0 - (t * (-s / t).exp() - lag * (-s / lag).exp()) / (t - lag));
            let position = 0.4 * (s - t * (1.0 - (-s / t).exp()));
            assert!((moving.velocity - velocity).abs() < 1e-10, "at {at}: {} not {velocity}", moving.velocity);
            assert!((moving.shown - shown).abs() < 1e-10, "at {at}: {} not {shown}", moving.shown);
            assert!((moving.position - position).abs() < 1e-12, "at {at}: {} not {position}", moving.position);
        }
    }
}
