//! The lowest attainable peak force from the first active sample on: an optimal control problem,
//! linearised again along each solution, whose inputs are then tried on the nonlinear arm. It
//! shares no model code with the controller.

use super::arm::{Arm, dot, lag};
use super::ocp::{self, Stage};

/// How long the force must keep the limit, in s.
pub(crate) const DURATION_S: f64 = 0.1;
/// Inputs change every T_s until here, in s; then in multiples of it: the peak is long past.
const FINE_INPUTS_S: f64 = 0.04;
/// Least length in s of the inputs after that.
const COARSE_INPUT_S: f64 = 0.004;
/// Linearisations: about the first pose, then along the solution before.
const PASSES: usize = 4;
/// Relative change of the optimum at which another pass is pointless.
const SAME_OPTIMUM: f64 = 1e-7;
/// Largest distance in s between two instants at which the confirmation looks at the force.
const CONFIRMATION_GRID_S: f64 = 2e-5;
/// Times shorter than this are rounding.
const NO_TIME_S: f64 = 1e-12;

/// The contact at the first active sample.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Contact {
    /// The arm.
    pub(crate) arm: Arm,
    /// T_V per joint in s.
    pub(crate) velocity_time_constant_s: [f64; 2],
    /// Least and largest speed reference of each joint in rad/s.
    pub(crate) joint_speed_bounds_rad_s: [(f64, f64); 2],
    /// Outward unit normal of the surface.
    pub(crate) normal: [f64; 2],
    /// A point of the undeformed surface in m.
    pub(crate) surface_point_m: [f64; 2],
    /// Stiffness along the normal in N/m.
    pub(crate) stiffness_n_m: f64,
    /// Joint position in rad and velocity in rad/s at the sample.
    pub(crate) joint_position_rad: [f64; 2],
    pub(crate) joint_velocity_rad_s: [f64; 2],
    /// Speed references in rad/s that are already on their way, one for each cycle of delay.
    pub(crate) pending_rad_s: Vec<[f64; 2]>,
    /// T_s in s: how long each input is held.
    pub(crate) sampling_time_s: f64,
}

/// Joint speed references held for a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Input {
    /// How long, in s.
    pub(crate) duration_s: f64,
    /// Reference of each joint in rad/s.
    pub(crate) reference_rad_s: [f64; 2],
}

/// The answer.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Attainable {
    /// Optimum in N of the last linearisation: largest k·penetration over its grid.
    pub(crate) optimum_n: f64,
    /// Largest normal force in N that the inputs lead to on the nonlinear arm.
    pub(crate) peak_n: f64,
    /// The inputs, pending ones first.
    pub(crate) inputs: Vec<Input>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct JointState {
    pub(super) position: [f64; 2],
    pub(super) velocity: [f64; 2],
}

impl Contact {
    /// The lowest attainable peak.
    ///
    /// # Errors
    /// Clarabel's status when it does not solve the problem.
    pub(crate) fn lowest_peak(&self) -> Result<Attainable, String> {
        self.solve(PASSES, false)
    }

    /// The same among inputs that never lose contact.
    ///
    /// # Errors
    /// Clarabel's status; `PrimalInfeasible` when no input keeps contact.
    pub(crate) fn lowest_peak_in_contact(&self) -> Result<Attainable, String> {
        self.solve(PASSES, true)
    }

    fn solve(&self, passes: usize, keeps_contact: bool) -> Result<Attainable, String> {
        let pending: Vec<Input> = self
            .pending_rad_s
            .iter()
            .map(|reference| Input { duration_s: self.sampling_time_s, reference_rad_s: *reference })
            .collect();
        let (start, peak_before_n) = self.apply(self.start(), &pending);
        let lengths = self.input_lengths();
        // About the first pose: an arm that stays where it is.
        let mut around: Vec<Stage> =
            lengths.iter().map(|length| Stage { duration_s: *length, state: None, reference: [0.0; 2] }).collect();
        let mut best: Option<Attainable> = None;
        let mut optimum_before = f64::INFINITY;
        for _ in 0..passes {
            let solution = ocp::minimise(self, &start, peak_before_n, &around, keeps_contact)?;
            let inputs: Vec<Input> = solution
                .references
                .iter()
                .zip(&lengths)
                .map(|(reference, length)| Input { duration_s: *length, reference_rad_s: *reference })
                .collect();
            around = self.stages(start, &inputs);
            let peak_n = self.apply(start, &inputs).1.max(peak_before_n);
            let optimum_n = solution.optimum_n;
            let converged = (optimum_n - optimum_before).abs() <= SAME_OPTIMUM * optimum_n.abs();
            optimum_before = optimum_n;
            // Any inputs that were tried are attainable; the optimum is that of the linearisation
            // that knows most.
            let inputs = pending.iter().copied().chain(inputs).collect();
            best = Some(match best {
                Some(best) if best.peak_n <= peak_n => Attainable { optimum_n, ..best },
                _ => Attainable { optimum_n, peak_n, inputs },
            });
            if converged {
                break;
            }
        }
        best.ok_or_else(|| "no pass".to_owned())
    }

    /// The same contact when the command is `twist_m_s` until the first input acts: in each of so
    /// many cycles of delay the reference is J⁻¹(q) of it at the cycle's start.
    pub(crate) fn after_delay(mut self, cycles: u32, twist_m_s: [f64; 2]) -> Self {
        let mut state = self.start();
        for _ in 0..cycles {
            let reference = self.arm.joint_velocity(state.position, twist_m_s);
            state = self.advance(&state, reference, self.sampling_time_s);
            self.pending_rad_s.push(reference);
        }
        self
    }

    fn start(&self) -> JointState {
        JointState { position: self.joint_position_rad, velocity: self.joint_velocity_rad_s }
    }

    /// Lengths in s of the inputs from the end of the delay to the end of the horizon.
    fn input_lengths(&self) -> Vec<f64> {
        let cycle = self.sampling_time_s;
        let coarse = cycle * (COARSE_INPUT_S / cycle).round().max(1.0);
        let mut at = cycle * self.pending_rad_s.len() as f64;
        let mut lengths = Vec::new();
        while at < DURATION_S - NO_TIME_S {
            let length = if at < FINE_INPUTS_S - NO_TIME_S { cycle } else { coarse };
            lengths.push(length.min(DURATION_S - at));
            at += length;
        }
        lengths
    }

    /// Depth in m of the TCP below the undeformed surface; negative is a gap.
    pub(super) fn penetration_m(&self, q: [f64; 2]) -> f64 {
        let tcp = self.arm.tcp(q);
        dot(self.normal, [self.surface_point_m[0] - tcp[0], self.surface_point_m[1] - tcp[1]])
    }

    /// The state after `time_s` of a constant reference.
    pub(super) fn advance(&self, state: &JointState, reference: [f64; 2], time_s: f64) -> JointState {
        let mut next = *state;
        for (joint, reference) in reference.into_iter().enumerate() {
            let time_constant = self.velocity_time_constant_s[joint];
            let (moved, velocity) = lag(time_constant, state.velocity[joint], reference, time_s);
            next.position[joint] += moved;
            next.velocity[joint] = velocity;
        }
        next
    }

    /// Where the inputs lead, and the largest normal force in N on the way, both ends included.
    fn apply(&self, mut state: JointState, inputs: &[Input]) -> (JointState, f64) {
        let force = |q| (self.stiffness_n_m * self.penetration_m(q)).max(0.0);
        let mut peak = force(state.position);
        for input in inputs {
            let steps = (input.duration_s / CONFIRMATION_GRID_S - 1e-9).ceil().max(1.0) as u32;
            let start = state;
            for step in 1..=steps {
                let time = input.duration_s * f64::from(step) / f64::from(steps);
                state = self.advance(&start, input.reference_rad_s, time);
                peak = peak.max(force(state.position));
            }
        }
        (state, peak)
    }

    /// Peak in N on the nonlinear arm when every joint goes outward, as seen from the start, at
    /// full speed.
    #[cfg(test)]
    pub(super) fn peak_of_full_speed_outward_n(&self) -> f64 {
        let lever = self.arm.lever_m(self.joint_position_rad, self.normal);
        let outward = std::array::from_fn(|joint| {
            let (least, most) = self.joint_speed_bounds_rad_s[joint];
            if lever[joint] > 0.0 { most } else { least }
        });
        let input = |reference_rad_s| Input { duration_s: self.sampling_time_s, reference_rad_s };
        let pending = self.pending_rad_s.iter().map(|reference| input(*reference));
        // Until the peak is past; if it went on the arm would come round again.
        let cycles = (0.06 / self.sampling_time_s) as usize;
        let inputs: Vec<Input> = pending.chain(std::iter::repeat_n(input(outward), cycles)).collect();
        self.apply(self.start(), &inputs).1
    }

    /// The trajectory of inputs, for the next linearisation.
    fn stages(&self, start: JointState, inputs: &[Input]) -> Vec<Stage> {
        let mut state = start;
        let stage = |input: &Input| {
            let stage = Stage { duration_s: input.duration_s, state: Some(state), reference: input.reference_rad_s };
            state = self.advance(&state, input.reference_rad_s, input.duration_s);
            stage
        };
        inputs.iter().map(stage).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::approach::{worst_instant, worst_of};
    use super::*;

    fn contact(bounds: [(f64, f64); 2]) -> Contact {
        let arm = Arm { links_m: [1.0, 1.0] };
        let q = [1.217, -1.471];
        let (sine, cosine) = 25f64.to_radians().sin_cos();
        let tcp = arm.tcp(q);
        let approach = arm.joint_velocity(q, [0.0, -0.4]);
        Contact {
            arm,
            velocity_time_constant_s: [0.015, 0.010],
            joint_speed_bounds_rad_s: bounds,
            normal: [sine, cosine],
            surface_point_m: [tcp[0] + 0.0006 * sine, tcp[1] + 0.0006 * cosine],
            stiffness_n_m: 1e5,
            joint_position_rad: q,
            joint_velocity_rad_s: approach,
            pending_rad_s: vec![approach],
            sampling_time_s: 0.001,
        }
    }

    /// Every joint outward at full speed at once: the optimum of the problem that is linearised
    /// about the first pose.
    fn closed_form_n(contact: &Contact) -> f64 {
        let delay = contact.sampling_time_s * contact.pending_rad_s.len() as f64;
        let mut start = contact.start();
        for reference in &contact.pending_rad_s {
            start = contact.advance(&start, *reference, contact.sampling_time_s);
        }
        let lever = contact.arm.lever_m(start.position, contact.normal);
        let outward: [f64; 2] = std::array::from_fn(|joint| {
            let (least, most) = contact.joint_speed_bounds_rad_s[joint];
            if lever[joint] > 0.0 { most } else { least }
        });
        let depth = |time: f64| {
            let q = contact.advance(&start, outward, time).position;
            let moved = std::array::from_fn(|joint| q[joint] - start.position[joint]);
            contact.penetration_m(start.position) - dot(lever, moved)
        };
        let instants = ((DURATION_S - delay) / ocp::GRID_S).round() as u32;
        let deepest = (0..=instants).map(|i| depth(f64::from(i) * ocp::GRID_S)).fold(f64::NEG_INFINITY, f64::max);
        contact.stiffness_n_m * deepest
    }

    #[test]
    fn linear_case_is_the_closed_form() {
        for bounds in [[(-3.0, 3.0); 2], [(-0.8, 3.0), (-3.0, 0.5)], [(-6.0, 0.2), (-0.3, 6.0)]] {
            let contact = contact(bounds);
            let (expected, answer) = (closed_form_n(&contact), contact.solve(1, false).unwrap());
            println!("{bounds:?}: {} N, closed form {expected} N", answer.optimum_n);
            assert!((answer.optimum_n / expected - 1.0).abs() < 1e-6, "{} {expected}", answer.optimum_n);
        }
    }

    #[test]
    fn a_bound_that_holds_one_joint_back_costs_force() {
        let free = contact([(-3.0, 3.0); 2]).lowest_peak().unwrap();
        let lever = contact([(-3.0, 3.0); 2]).arm.lever_m([1.217, -1.471], contact([(-3.0, 3.0); 2]).normal);
        // Only the bound on the outward side of a joint matters.
        let outward = |most: f64| if lever[0] > 0.0 { (-3.0, most) } else { (-most, 3.0) };
        let inward = |most: f64| if lever[0] > 0.0 { (-most, 3.0) } else { (-3.0, most) };
        let held = contact([outward(0.5), (-3.0, 3.0)]).lowest_peak().unwrap();
        let same = contact([inward(0.5), (-3.0, 3.0)]).lowest_peak().unwrap();
        println!("{} {} {}", free.peak_n, held.peak_n, same.peak_n);
        assert!(held.peak_n > 1.04 * free.peak_n);
        assert!((same.peak_n / free.peak_n - 1.0).abs() < 1e-6);
    }

    #[test]
    fn inputs_keep_their_bounds_and_last_as_long_as_the_horizon() {
        for sampling_time_s in super::super::draw::SAMPLING_TIMES_S {
            let answer = Contact { sampling_time_s, ..contact([(-3.0, 3.0); 2]) }.lowest_peak().unwrap();
            let total: f64 = answer.inputs.iter().map(|input| input.duration_s).sum();
            assert!((total - DURATION_S).abs() < 1e-9, "{total}");
            let references = answer.inputs.iter().flat_map(|input| input.reference_rad_s);
            assert!(references.skip(2).all(|reference| reference.abs() <= 3.0));
            assert!((answer.peak_n / answer.optimum_n - 1.0).abs() < 1e-3, "{} {}", answer.peak_n, answer.optimum_n);
        }
    }

    #[test]
    fn peaks_are_those_of_the_prototype() {
        // T_s, speed, lowest reachable |f_y| at the worst instant of contact. The prototype looked
        // at a few instants only, which matters where the tool gets far within a cycle: its figures
        // are between those of the worst of 32 and 8 % below.
        let expected = [
            (0.004, 0.3, 167.0, 0.08),
            (0.004, 0.4, 209.0, 0.08),
            (0.004, 0.5, 265.0, 0.03),
            (0.001, 0.6, 174.0, 0.03),
            (0.001, 0.8, 219.0, 0.04),
            (0.00025, 0.8, 178.0, 0.01),
            (0.00025, 1.0, 220.0, 0.01),
        ];
        for (sampling_time_s, speed, peak, share) in expected {
            let started = std::time::Instant::now();
            let answer = worst_instant(sampling_time_s, speed).lowest_peak().unwrap();
            let along_y = answer.peak_n * 25f64.to_radians().cos();
            println!(
                "{} ms, {speed} m/s: |f_y| {along_y:.1} N, expected {peak} N; {:.0} ms",
                sampling_time_s * 1e3,
                started.elapsed().as_secs_f64() * 1e3
            );
            assert!((1.0 - share..1.01).contains(&(peak / along_y)), "{along_y} {peak}");
        }
        // With the instants that the prototype looked at: at 0.3 m/s the worst of 8.
        let along_y = worst_of(8, 0.004, 0.3).lowest_peak().unwrap().peak_n * 25f64.to_radians().cos();
        assert!((along_y / 167.0 - 1.0).abs() < 0.005, "{along_y}");
    }
}
