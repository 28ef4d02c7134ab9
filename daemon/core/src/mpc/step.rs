//! How the continuous model becomes a step.

use nalgebra::{SMatrix, SVector};

use super::joint_response::{Estimate, Motion, Order};
use crate::robot::VelocityLoops;

/// What a joint carries from step to step beside q: q̇, q̈, and the reference in its dead time.
pub const CARRIED: usize = 3;

/// How many numbers joints with these loops carry: 1 or [`CARRIED`].
pub(crate) fn carried_by<const N: usize>(loops: &VelocityLoops<N>) -> usize {
    if loops.is_plain() { 1 } else { CARRIED }
}

/// How the continuous model becomes a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Discretization {
    /// First-order Euler (14), (17); for loops (4) alone.
    Euler,
    /// Exact under a constant reference (zero-order hold), with J frozen.
    Zoh,
}

/// One step of the model under a constant joint velocity reference r, joint by joint and axis by
/// axis: q ← q + Σ a_c c + b r, c ← Σ c_c' c' + d r,
/// f̂ ← e f̂ + (1 − e) f_lin(q) + K_e J (Σ A_c c + B r). c runs over what a joint carries: q̇ and, where loops are more than (4), q̈ and the
/// reference before, which acts for the rest of its dead time. All values on the right are those at
/// the start, and A, B act joint by joint, for each axis with its own numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step<const N: usize, const D: usize> {
    /// Length in s.
    pub duration: f64,
    /// How many of the carried numbers there are: 1 or [`CARRIED`].
    pub carried: usize,
    /// a: s by q̇, s² by q̈, s by the reference before.
    pub position_by: [SVector<f64, N>; CARRIED],
    /// b in s.
    pub position_by_reference: SVector<f64, N>,
    /// The carried number of the first index, by that of the second.
    pub carried_by: [[SVector<f64, N>; CARRIED]; CARRIED],
    /// d.
    pub carried_by_reference: [SVector<f64, N>; CARRIED],
    /// e.
    pub wrench_decay: SVector<f64, D>,
    /// A: by how much the estimate follows the motion within the step, a column for each axis.
    pub wrench_by: [SMatrix<f64, N, D>; CARRIED],
    /// B in s.
    pub wrench_by_reference: SMatrix<f64, N, D>,
}

impl<const N: usize, const D: usize> Step<N, D> {
    fn standing(duration: f64, carried: usize) -> Self {
        let zeros = [SVector::zeros(); CARRIED];
        Self {
            duration,
            carried,
            position_by: zeros,
            position_by_reference: SVector::zeros(),
            carried_by: [zeros; CARRIED],
            carried_by_reference: zeros,
            wrench_decay: SVector::zeros(),
            wrench_by: [SMatrix::zeros(); CARRIED],
            wrench_by_reference: SMatrix::zeros(),
        }
    }
}

impl Discretization {
    /// The step of `duration` s for these speed loops and a wrench estimate with T_est (in s; 0
    /// means f̂ = f_lin at every instant, section V). The dead time that all joints have is not
    /// part of it: by that the whole horizon begins later.
    pub fn step<const N: usize, const D: usize>(
        self,
        duration: f64,
        loops: &VelocityLoops<N>,
        wrench_time_constant: &SVector<f64, D>,
    ) -> Step<N, D> {
        self.step_after(&loops.further_dead_time(), duration, loops, wrench_time_constant)
    }

    /// The same under a reference that has reached the loops.
    pub(crate) fn without_dead_time<const N: usize, const D: usize>(
        self,
        duration: f64,
        loops: &VelocityLoops<N>,
        wrench_time_constant: &SVector<f64, D>,
    ) -> Step<N, D> {
        self.step_after(&SVector::zeros(), duration, loops, wrench_time_constant)
    }

    fn step_after<const N: usize, const D: usize>(
        self,
        dead_time: &SVector<f64, N>,
        duration: f64,
        loops: &VelocityLoops<N>,
        wrench_time_constant: &SVector<f64, D>,
    ) -> Step<N, D> {
        match self {
            Self::Euler => euler(duration, &loops.time_constant, wrench_time_constant),
            Self::Zoh => exact(duration, loops, dead_time, wrench_time_constant),
        }
    }
}

fn euler<const N: usize, const D: usize>(
    duration: f64,
    velocity_time_constant: &SVector<f64, N>,
    wrench_time_constant: &SVector<f64, D>,
) -> Step<N, D> {
    let mut step = Step::standing(duration, 1);
    step.position_by[0] = SVector::repeat(duration);
    step.carried_by[0][0] = velocity_time_constant.map(|t| 1.0 - duration / t);
    step.carried_by_reference[0] = velocity_time_constant.map(|t| duration / t);
    step.wrench_decay = wrench_time_constant.map(|t| if t > 0.0 { 1.0 - duration / t } else { 0.0 });
    // An ideal measurement is f_lin at the end.
    let by_velocity = |_, axis: usize| if wrench_time_constant[axis] > 0.0 { 0.0 } else { duration };
    step.wrench_by[0] = SMatrix::from_fn(by_velocity);
    step
}

/// The exact step, during whose first `dead_time` s the reference before it acts.
fn exact<const N: usize, const D: usize>(
    duration: f64,
    loops: &VelocityLoops<N>,
    dead_time: &SVector<f64, N>,
    wrench_time_constant: &SVector<f64, D>,
) -> Step<N, D> {
    let mut step = Step::standing(duration, carried_by(loops));
    // Axes that are alike decay alike, and joints that are alike move alike: what they share is computed once.
    for axis in 0..D {
        let lag = wrench_time_constant[axis];
        step.wrench_decay[axis] = match axis.checked_sub(1) {
            Some(before) if wrench_time_constant[before] == lag => step.wrench_decay[before],
            _ if lag > 0.0 => libm::exp(-duration / lag),
            _ => 0.0,
        };
    }
    let mut alike = None;
    let (mut whole, mut estimates) = (Motion::default(), [Estimate::default(); D]);
    for joint in 0..N {
        let (order, waits) = (Order::of(loops, joint), dead_time[joint].min(duration));
        if alike != Some((order, waits)) {
            (whole, estimates) = moved(duration, waits, order, wrench_time_constant);
            alike = Some((order, waits));
        }
        for to in 0..2 {
            for from in 0..2 {
                step.carried_by[to][from][joint] = whole.carried_by[to][from];
            }
            step.carried_by[to][2][joint] = whole.carried_by_earlier[to];
            step.carried_by_reference[to][joint] = whole.carried_by_reference[to];
            step.position_by[to][joint] = whole.position_by[to];
        }
        step.position_by[2][joint] = whole.position_by_earlier;
        step.position_by_reference[joint] = whole.position_by_reference;
        // What is told during this step is the reference before the next.
        step.carried_by_reference[2][joint] = 1.0;
        for (axis, estimate) in estimates.iter().enumerate() {
            for from in 0..2 {
                step.wrench_by[from][(joint, axis)] = estimate.by[from];
            }
            step.wrench_by[2][(joint, axis)] = estimate.by_earlier;
            step.wrench_by_reference[(joint, axis)] = estimate.by_reference;
        }
    }
    step
}

/// What a joint does over a step during whose first `waits` s the reference before it acts, and what the
/// estimate on each axis shows of it.
fn moved<const D: usize>(
    duration: f64,
    waits: f64,
    order: Order,
    wrench_time_constant: &SVector<f64, D>,
) -> (Motion, [Estimate; D]) {
    let [before, after, whole] = motions(duration, waits, order);
    let mut estimates = [Estimate::default(); D];
    for axis in 0..D {
        let lag = wrench_time_constant[axis];
        estimates[axis] = match axis.checked_sub(1) {
            Some(last) if wrench_time_constant[last] == lag => estimates[last],
            _ => {
                let estimate = Estimate::over(duration - waits, order, lag, &after);
                if waits > 0.0 { Estimate::over(waits, order, lag, &before).then(&before, &estimate) } else { estimate }
            }
        };
    }
    (whole, estimates)
}

/// What a joint does while its reference waits, what it does afterwards, and both.
fn motions(duration: f64, waits: f64, order: Order) -> [Motion; 3] {
    let after = Motion::over(duration - waits, order);
    if waits <= 0.0 {
        return [Motion::default(), after, after];
    }
    let before = Motion::over(waits, order);
    [before, after, before.then(&after)]
}

/// a of the exact step of `duration` s, under zero reference.
pub(super) fn position_by<const N: usize>(duration: f64, loops: &VelocityLoops<N>) -> [SVector<f64, N>; CARRIED] {
    let mut by = [SVector::zeros(); CARRIED];
    let further = loops.further_dead_time();
    for joint in 0..N {
        let [_, _, whole] = motions(duration, further[joint].min(duration), Order::of(loops, joint));
        let [by_velocity, by_acceleration] = whole.position_by;
        for (by, value) in by.iter_mut().zip([by_velocity, by_acceleration, whole.position_by_earlier]) {
            by[joint] = value;
        }
    }
    by
}

#[cfg(test)]
mod tests {
    use nalgebra::{Vector1, Vector3, Vector5};

    use super::*;

    #[test]
    fn joints_and_axes_that_are_alike_move_as_each_of_them_alone() {
        let loops = VelocityLoops {
            time_constant: Vector5::new(0.015, 0.015, 0.012, 0.012, 0.015),
            damping: Vector5::new(0.0, 0.0, 0.0, 0.7, 0.0),
            ..VelocityLoops::first_order(Vector5::repeat(0.01))
        };
        let (waits, lags) = (Vector5::new(0.0, 0.0002, 0.0002, 0.0002, 0.0), Vector3::new(0.02, 0.02, 0.0));
        for duration in [0.0001, 0.001] {
            let all = exact(duration, &loops, &waits, &lags);
            for (joint, axis) in (0..5).flat_map(|joint| (0..3).map(move |axis| (joint, axis))) {
                let own = VelocityLoops {
                    time_constant: Vector1::new(loops.time_constant[joint]),
                    damping: Vector1::new(loops.damping[joint]),
                    ..VelocityLoops::first_order(Vector1::new(0.01))
                };
                let alone = exact(duration, &own, &Vector1::new(waits[joint]), &Vector1::new(lags[axis]));
                assert_eq!(all.wrench_decay[axis], alone.wrench_decay[0]);
                assert_eq!(all.position_by_reference[joint], alone.position_by_reference[0]);
                assert_eq!(all.wrench_by_reference[(joint, axis)], alone.wrench_by_reference[(0, 0)]);
                for from in 0..CARRIED {
                    assert_eq!(all.position_by[from][joint], alone.position_by[from][0]);
                    assert_eq!(all.wrench_by[from][(joint, axis)], alone.wrench_by[from][(0, 0)]);
                    assert_eq!(all.carried_by_reference[from][joint], alone.carried_by_reference[from][0]);
                    for to in 0..CARRIED {
                        assert_eq!(all.carried_by[to][from][joint], alone.carried_by[to][from][0]);
                    }
                }
            }
        }
    }
}
