//! The velocity-controlled joints. Of first order they are equation (4), T_V q̈ + q̇ = q̇_ref for
//! each joint; of second order q⃛ / ω² + 2 ζ q̈ / ω + q̇ = q̇_ref. Both are solved exactly.

use nalgebra::SVector;

/// Velocity loops of N joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLoop<const N: usize> {
    loops: SVector<Order, N>,
}

/// The loop of one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Order {
    /// T_V in s.
    First { time_constant_s: f64 },
    /// ω in rad/s, and ζ.
    Second { frequency_rad_s: f64, damping: f64 },
}

/// The effect of an interval of constant velocity reference on the loops; it depends on the
/// interval's length alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointStep<const N: usize> {
    duration_s: f64,
    /// What is left of a velocity error per joint; e^(−h/T_V) of first order.
    decay: SVector<f64, N>,
    /// How far a unit of velocity error carries the joint, s; T_V (1 − e^(−h/T_V)) of first order.
    carry_s: SVector<f64, N>,
    /// What an acceleration at the start does. Of first order there is none.
    accelerated: Option<Accelerated<N>>,
}

/// The part of a step that belongs to the acceleration, which loops of second order have.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Accelerated<const N: usize> {
    /// Acceleration at the end by a unit of velocity error at the start, 1/s.
    by_error: SVector<f64, N>,
    /// Acceleration at the end by a unit of it at the start.
    by_itself: SVector<f64, N>,
    /// Velocity at the end by a unit of acceleration at the start, s.
    velocity_s: SVector<f64, N>,
    /// Position at the end by a unit of acceleration at the start, s².
    position_s2: SVector<f64, N>,
}

/// The motion of the joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointState<const N: usize> {
    /// rad.
    pub position: SVector<f64, N>,
    /// rad/s.
    pub velocity: SVector<f64, N>,
    /// rad/s²; zero throughout where all loops are of first order.
    pub acceleration: SVector<f64, N>,
}

impl<const N: usize> JointState<N> {
    /// At rest.
    pub fn at_rest(position: SVector<f64, N>) -> Self {
        Self { position, velocity: SVector::zeros(), acceleration: SVector::zeros() }
    }
}

/// Bandwidth (−3 dB) of a loop of second order, relative to its ω.
fn relative_bandwidth(damping: f64) -> f64 {
    let a = 1.0 - 2.0 * damping * damping;
    (a + a.hypot(1.0)).sqrt()
}

impl<const N: usize> JointLoop<N> {
    /// Loops with the time constants T_V in s, all above zero: of first order where the damping ζ
    /// is 0, else of second order with the −3 dB bandwidth 1/T_V.
    pub fn new(time_constant_s: SVector<f64, N>, damping: SVector<f64, N>) -> Self {
        let order = |time_constant_s: f64, damping: f64| match damping {
            0.0 => Order::First { time_constant_s },
            _ => Order::Second { frequency_rad_s: 1.0 / (time_constant_s * relative_bandwidth(damping)), damping },
        };
        Self { loops: time_constant_s.zip_map(&damping, order) }
    }

    /// The step of an interval of `duration_s`.
    pub fn step(&self, duration_s: f64) -> JointStep<N> {
        let of = |joint: usize| OneStep::of(self.loops[joint], duration_s);
        let entry = |entry: fn(&OneStep) -> f64| SVector::from_fn(|joint, _| entry(&of(joint)));
        let accelerates = self.loops.iter().any(|order| matches!(order, Order::Second { .. }));
        JointStep {
            duration_s,
            decay: entry(|step| step.decay),
            carry_s: entry(|step| step.carry_s),
            accelerated: accelerates.then(|| Accelerated {
                by_error: entry(|step| step.by_error),
                by_itself: entry(|step| step.by_itself),
                velocity_s: entry(|step| step.velocity_s),
                position_s2: entry(|step| step.position_s2),
            }),
        }
    }

    /// Joint accelerations in rad/s² under a velocity reference in rad/s.
    pub fn acceleration(&self, state: &JointState<N>, reference: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::from_fn(|joint, _| match self.loops[joint] {
            Order::First { time_constant_s } => (reference[joint] - state.velocity[joint]) / time_constant_s,
            Order::Second { .. } => state.acceleration[joint],
        })
    }

    /// Speeds in rad/s that the joints do not exceed while the reference stays.
    pub fn most_speed(&self, state: &JointState<N>, reference: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::from_fn(|joint, _| match self.loops[joint] {
            Order::First { .. } => state.velocity[joint].abs().max(reference[joint].abs()),
            // e² + (ė / ω)² of the error e never grows.
            Order::Second { frequency_rad_s, .. } => {
                let error = state.velocity[joint] - reference[joint];
                reference[joint].abs() + error.hypot(state.acceleration[joint] / frequency_rad_s)
            }
        })
    }
}

/// [`JointStep`] of one joint.
#[derive(Default)]
struct OneStep {
    decay: f64,
    carry_s: f64,
    by_error: f64,
    by_itself: f64,
    velocity_s: f64,
    position_s2: f64,
}

impl OneStep {
    fn of(order: Order, h: f64) -> Self {
        match order {
            Order::First { time_constant_s } => {
                // exp_m1: 1 − e^(−x) loses its digits where x is small, and substeps are short.
                let lost = -(-h / time_constant_s).exp_m1();
                Self { decay: 1.0 - lost, carry_s: lost * time_constant_s, ..Self::default() }
            }
            Order::Second { frequency_rad_s: omega, damping } => {
                // e^(A h) with A = [0 1; −ω² −2ζω] is e^(−σh) (c + s (A + σ)), σ = ζω.
                let (sigma, square) = (damping * omega, omega * omega * (1.0 - damping * damping));
                let root = square.abs().sqrt();
                let fading = (-sigma * h).exp();
                // Both times e^(−σh): alone they overflow where much damping meets a long step.
                let (c, s) = if root * h < 1e-6 {
                    (fading, fading * h)
                } else if square > 0.0 {
                    (fading * (root * h).cos(), fading * (root * h).sin() / root)
                } else {
                    let (slow, fast) = (((root - sigma) * h).exp(), ((-root - sigma) * h).exp());
                    (0.5 * (slow + fast), 0.5 * (slow - fast) / root)
                };
                let (decay, velocity_s) = (c + s * sigma, s);
                let (by_error, by_itself) = (-s * omega * omega, c - s * sigma);
                // ω² ∫e = −Δë − 2ζω Δe, from the equation itself.
                let integral = |acceleration: f64, error: f64| -(acceleration + 2.0 * sigma * error) / (omega * omega);
                Self {
                    carry_s: integral(by_error, decay - 1.0),
                    position_s2: integral(by_itself - 1.0, velocity_s),
                    decay,
                    by_error,
                    by_itself,
                    velocity_s,
                }
            }
        }
    }
}

impl<const N: usize> JointStep<N> {
    /// The state at the end of the interval, from that at its start and the velocity reference in
    /// rad/s, constant over the interval.
    pub fn advance(&self, state: &mut JointState<N>, reference: &SVector<f64, N>) {
        let error = state.velocity - reference;
        state.position += reference * self.duration_s + error.component_mul(&self.carry_s);
        state.velocity = reference + error.component_mul(&self.decay);
        if let Some(accelerated) = &self.accelerated {
            let before = state.acceleration;
            state.position += before.component_mul(&accelerated.position_s2);
            state.velocity += before.component_mul(&accelerated.velocity_s);
            state.acceleration =
                error.component_mul(&accelerated.by_error) + before.component_mul(&accelerated.by_itself);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Vector1, Vector2};

    #[test]
    fn step_response_is_the_analytic_one_whatever_the_steps() {
        let time_constant = Vector2::new(0.015, 0.010);
        let reference = Vector2::new(0.4, -0.7);
        let joints = JointLoop::new(time_constant, Vector2::zeros());
        for steps in [1, 7, 400] {
            let velocity_0 = Vector2::new(-0.1, 0.25);
            let mut state = JointState { velocity: velocity_0, ..JointState::at_rest(Vector2::new(0.3, -1.2)) };
            let position_0 = state.position;
            let step = joints.step(0.02 / f64::from(steps));
            for _ in 0..steps {
                step.advance(&mut state, &reference);
            }
            for joint in 0..2 {
                let (tau, target) = (time_constant[joint], reference[joint]);
                let decay = (-0.02 / tau).exp();
                let expected_velocity = target + (velocity_0[joint] - target) * decay;
                let expected_position =
                    position_0[joint] + target * 0.02 + (velocity_0[joint] - target) * tau * (1.0 - decay);
                assert!((state.velocity[joint] - expected_velocity).abs() < 1e-13, "{steps} steps, joint {joint}");
                assert!((state.position[joint] - expected_position).abs() < 1e-13, "{steps} steps, joint {joint}");
            }
        }
    }

    /// The second-order loop by small steps of the classical Runge-Kutta method.
    fn by_runge_kutta(state: &mut JointState<1>, omega: f64, zeta: f64, reference: f64, duration_s: f64) {
        let steps = 4000;
        let h = duration_s / f64::from(steps);
        let rate = |[_, v, a]: [f64; 3]| [v, a, omega * omega * (reference - v) - 2.0 * zeta * omega * a];
        let add = |x: [f64; 3], y: [f64; 3], by: f64| std::array::from_fn::<f64, 3, _>(|i| x[i] + by * y[i]);
        let mut x = [state.position[0], state.velocity[0], state.acceleration[0]];
        for _ in 0..steps {
            let k1 = rate(x);
            let k2 = rate(add(x, k1, h / 2.0));
            let k3 = rate(add(x, k2, h / 2.0));
            let k4 = rate(add(x, k3, h));
            x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        }
        (state.position[0], state.velocity[0], state.acceleration[0]) = (x[0], x[1], x[2]);
    }

    #[test]
    fn second_order_loops_follow_their_differential_equation() {
        for zeta in [0.3, 0.7, 1.0, 1.0 + 1e-9, 1.6, 5.0] {
            let joints = JointLoop::new(Vector1::new(0.012), Vector1::new(zeta));
            let Order::Second { frequency_rad_s: omega, .. } = joints.loops[0] else { panic!("of second order") };
            // −3 dB where it was asked for.
            let x: f64 = 1.0 / (0.012 * omega);
            let gain = 1.0 / (1.0 - x * x).hypot(2.0 * zeta * x);
            assert!((gain - 0.5f64.sqrt()).abs() < 1e-12, "damping {zeta}: gain {gain}");
            let mut expected = JointState {
                position: Vector1::new(0.2),
                velocity: Vector1::new(-0.4),
                acceleration: Vector1::new(7.0),
            };
            for steps in [1, 30] {
                let mut state = expected;
                let step = joints.step(0.02 / f64::from(steps));
                let most = joints.most_speed(&state, &Vector1::new(0.9))[0];
                for _ in 0..steps {
                    step.advance(&mut state, &Vector1::new(0.9));
                    assert!(state.velocity[0].abs() <= most, "{} above {most}", state.velocity[0]);
                }
                let mut there = expected;
                by_runge_kutta(&mut there, omega, zeta, 0.9, 0.02);
                for (found, expected) in [
                    (state.position[0], there.position[0]),
                    (state.velocity[0], there.velocity[0]),
                    (state.acceleration[0] / omega, there.acceleration[0] / omega),
                ] {
                    assert!((found - expected).abs() < 1e-10, "damping {zeta}, {steps} steps: {found}, not {expected}");
                }
                expected.position[0] += 1.0;
            }
        }
    }
}
