//! One contact in a closed loop in virtual time: the daemon's cycle against the plant, and what was
//! seen.

use admittance_runner::config::Config;
use admittance_runner::cycle;
use admittance_runner::virtual_time::{Step, VirtualTime};
use ipc_types::{StopReason, TruthSample, Verdict};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

use super::attainable::Contact;
use super::draw::{ACTIVATION_THRESHOLD_N, Draw};

/// The first active sample: the first whose wrench estimate exceeds β on an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FirstActive {
    /// Joint position in rad.
    pub(crate) joint_position_rad: [f64; 2],
    /// Joint velocity in rad/s.
    pub(crate) joint_velocity_rad_s: [f64; 2],
    /// True normal force at its instant in N.
    pub(crate) normal_force_n: f64,
}

/// What one run showed. Forces are true normal forces in N, seen at every step of the plant.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Seen {
    /// `None`: no sample was active.
    pub(crate) first_active: Option<FirstActive>,
    /// Samples from the first active one on at which the tool touched.
    pub(crate) samples_in_contact: u32,
    /// Whether the first verdict was feasible; `None` without any verdict.
    pub(crate) first_verdict_feasible: Option<bool>,
    /// Cycles with an infeasible verdict.
    pub(crate) infeasible_cycles: u32,
    /// Largest force from the first active sample on.
    pub(crate) peak_n: f64,
    /// Largest force in the cycles whose verdict was feasible, each from its sample to the next.
    pub(crate) peak_while_feasible_n: f64,
    /// Largest force in the cycles without a verdict: no axis active any more, or no answer of the
    /// solver.
    pub(crate) peak_without_verdict_n: f64,
    /// Times that contact ended after the first active sample.
    pub(crate) contact_losses: u32,
    /// Why it stopped, or `None`'s code.
    pub(crate) stop_reason: u32,
    /// Force at the end of the run.
    pub(crate) resting_force_n: f64,
}

impl Seen {
    /// Whether no verdict was infeasible.
    pub(crate) fn is_feasible(&self) -> bool {
        self.infeasible_cycles == 0
    }

    /// Whether the controller stopped, whatever the reason.
    pub(crate) fn stopped(&self) -> bool {
        self.stop_reason != StopReason::NONE
    }
}

/// Runs a controller against a plant to the end of the scenario's motion.
///
/// # Errors
/// What controller or plant do not accept.
pub(crate) fn run(config: &Config, scenario: &Scenario) -> Result<Seen, String> {
    let mut seen = Seen::default();
    let (mut losses_before, mut last_verdict) = (0, Verdict::None.code());
    let plant = VirtualRun::new(scenario).map_err(|error| error.to_string())?;
    let mut run = VirtualTime::new(cycle::build(config)?, plant);
    while let Some(Step { state, command, truth, .. }) = run.step()? {
        let active = state.wrench.iter().any(|force| force.abs() > ACTIVATION_THRESHOLD_N);
        if active && seen.first_active.is_none() {
            seen.first_active = Some(first_active(&state.joint_position, &state.joint_velocity, &truth));
            losses_before = truth.contact_losses;
            seen.peak_n = truth.normal_force_n;
        } else if seen.first_active.is_some() {
            // The truth's peak is that since the sample before: of the cycle whose verdict was the
            // last one.
            seen.peak_n = seen.peak_n.max(truth.peak_normal_force_n);
            let peak = truth.peak_normal_force_n;
            if last_verdict == Verdict::Feasible.code() {
                seen.peak_while_feasible_n = seen.peak_while_feasible_n.max(peak);
            } else if last_verdict == Verdict::None.code() {
                seen.peak_without_verdict_n = seen.peak_without_verdict_n.max(peak);
            }
        }
        if seen.first_active.is_some() {
            seen.samples_in_contact += u32::from(truth.in_contact == 1);
            seen.contact_losses = truth.contact_losses - losses_before;
            seen.resting_force_n = truth.normal_force_n;
        }
        last_verdict = command.verdict;
        if last_verdict != Verdict::None.code() {
            seen.first_verdict_feasible.get_or_insert(last_verdict == Verdict::Feasible.code());
        }
        seen.infeasible_cycles += u32::from(last_verdict == Verdict::Infeasible.code());
        seen.stop_reason = command.stop_reason;
    }
    Ok(seen)
}

pub(crate) fn first_active(position: &[f64], velocity: &[f64], truth: &TruthSample) -> FirstActive {
    FirstActive {
        joint_position_rad: [position[0], position[1]],
        joint_velocity_rad_s: [velocity[0], velocity[1]],
        normal_force_n: truth.normal_force_n,
    }
}

/// The contact from its first active sample on, as the judge sees it.
pub(crate) fn contact(draw: &Draw, first: &FirstActive) -> Contact {
    let limit = draw.joint_speed_limit_rad_s;
    Contact {
        arm: draw.arm,
        velocity_time_constant_s: draw.velocity_time_constant_s,
        joint_speed_bounds_rad_s: [(-limit, limit); 2],
        normal: draw.normal(),
        surface_point_m: draw.contact_point_m(),
        stiffness_n_m: draw.stiffness_n_m,
        joint_position_rad: first.joint_position_rad,
        joint_velocity_rad_s: first.joint_velocity_rad_s,
        pending_rad_s: Vec::new(),
        sampling_time_s: draw.sampling_time_s,
    }
    // No offset before the first active sample: what is on its way is the command.
    .after_delay(draw.delay_cycles, draw.twist_m_s())
}

#[cfg(test)]
mod tests {
    use admittance_core::quantities::Instant;
    use ipc_types::{CommandSample, Motion, VirtualPlant};
    use plant_sim::run::VirtualRun;

    use super::super::arm::dot;
    use super::super::attainable::{DURATION_S, JointState};
    use super::super::controller::{Profile, Variant, controller, scenario};
    use super::*;

    /// Lets the controller work until the first active sample and plays the judge's inputs from
    /// then on: (the judge's peak, the plant's), both in N.
    fn judge_and_plant(draw: &Draw) -> (f64, f64) {
        let mut cycle = cycle::build(&controller(draw, Profile::Default, Variant::Nominal).unwrap()).unwrap();
        let mut plant = VirtualRun::new(&scenario(draw).unwrap()).unwrap();
        let mut command = CommandSample::zeroed();
        let mut plan: Option<(Contact, Vec<JointState>, Vec<[f64; 2]>)> = None;
        let (mut judge_n, mut peak_n, mut since) = (0.0, 0.0_f64, 0);
        let cycles = (DURATION_S / draw.sampling_time_s).round() as usize;
        while since < cycles {
            let state = *plant.sample().unwrap();
            cycle.answer(&state, Instant::from_nanoseconds(state.stamp_ns), &mut || false, &mut command);
            command.sequence += 1;
            let starts = plan.is_none() && state.wrench.iter().any(|force| force.abs() > ACTIVATION_THRESHOLD_N);
            if starts {
                let first = first_active(&state.joint_position, &state.joint_velocity, &TruthSample::zeroed());
                let contact = contact(draw, &first);
                let answer = contact.lowest_peak().unwrap();
                judge_n = answer.peak_n;
                // One reference for each cycle from the sample on, and the state at its start.
                let references: Vec<[f64; 2]> = answer
                    .inputs
                    .iter()
                    .flat_map(|input| {
                        let cycles = (input.duration_s / draw.sampling_time_s).round() as usize;
                        std::iter::repeat_n(input.reference_rad_s, cycles)
                    })
                    .collect();
                let mut at = JointState { position: first.joint_position_rad, velocity: first.joint_velocity_rad_s };
                let mut states = Vec::new();
                for reference in &references {
                    states.push(at);
                    at = contact.advance(&at, *reference, draw.sampling_time_s);
                }
                plan = Some((contact, states, references));
            }
            if let Some((contact, states, references)) = &plan {
                // The command for this sample acts after the delay, at the pose of then.
                let acts = (since + draw.delay_cycles as usize).min(references.len() - 1);
                let twist = [[1.0, 0.0], [0.0, 1.0]]
                    .map(|axis| dot(contact.arm.lever_m(states[acts].position, axis), references[acts]));
                command.motion = Motion::Offset.code();
                command.velocity_offset = [0.0; 6];
                for (axis, commanded) in draw.twist_m_s().into_iter().enumerate() {
                    command.velocity_offset[axis] = twist[axis] - commanded;
                }
                command.plan_length = 1;
                command.plan_end_ns = [0; ipc_types::MAX_PLAN];
                command.plan_end_ns[0] = 1_000_000_000;
                command.planned_offset[0] = command.velocity_offset;
                command.valid_until_ns = state.stamp_ns + 1_000_000_000;
            }
            let truth = plant.advance(Some(&command)).unwrap();
            if plan.is_some() {
                since += 1;
                peak_n = peak_n.max(if starts { truth.normal_force_n } else { truth.peak_normal_force_n });
            }
        }
        (judge_n, peak_n)
    }

    #[test]
    fn the_plant_confirms_the_judge() {
        for index in 0..30 {
            let draw = Draw::new(9, index).unwrap();
            let (judge, plant) = judge_and_plant(&draw);
            assert!((plant / judge - 1.0).abs() < 2e-3, "case {index}: judge {judge} N, plant {plant} N");
        }
    }
}
