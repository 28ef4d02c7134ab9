//! One contact in a closed loop in virtual time: the daemon's cycle against the plant, and what was
//! seen.

use std::collections::VecDeque;

use admittance_runner::config::Config;
use admittance_runner::cycle;
use admittance_runner::virtual_time::{Step, VirtualTime};
use ipc_types::{Mode, StopReason, TruthSample, Verdict};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

use super::attainable::{Contact, Driven};
use super::draw::{ACTIVATION_THRESHOLD_N, AFTER_CONTACT_S, Draw};
use super::task::Frame;

/// How long in s before a verdict that is withdrawn the judge is asked again, what it says being of 100 ms.
const BEFORE_S: f64 = 0.06;

/// A sample, and the command that it was answered with.
#[derive(Debug, Clone, PartialEq)]
struct Answered {
    sample: FirstActive,
    /// ṗ0 + Δṗ, m/s and rad/s.
    twist: Vec<f64>,
}

/// A state some time before the first infeasible verdict.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Earlier {
    sample: FirstActive,
    /// The twist that was commanded a sample before: with a delay it is still to act, and it is what is streamed.
    twist_before: Vec<f64>,
}

/// The first active sample: the first whose wrench estimate exceeds β on an axis.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FirstActive {
    /// Joint position in rad or m.
    pub(crate) joint_position: Vec<f64>,
    /// Joint velocity in rad/s or m/s.
    pub(crate) joint_velocity: Vec<f64>,
    /// True normal force at its instant in N.
    pub(crate) normal_force_n: f64,
}

/// What one run showed. Forces are true normal forces in N, seen at every step of the plant; in a frame that
/// turns, weighted as the judge weights them.
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
    /// The state 60 ms before the first of them, where that is after the first active sample.
    pub(crate) before_infeasible: Option<Earlier>,
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

/// Whether a contact of so many ns has been looked at for long enough. Drives that refuse jumps may take longer than that for a stop: where
/// the arm rests is known when it has come to rest.
fn is_over(draw: &Draw, lasted_ns: u64, mode: u32) -> bool {
    draw.drives.is_some() && lasted_ns as f64 * 1e-9 > AFTER_CONTACT_S && mode != Mode::Stopping.code()
}

/// Runs a controller against a plant to the end of the scenario's motion.
///
/// # Errors
/// What controller or plant do not accept.
pub(crate) fn run(draw: &Draw, config: &Config, scenario: &Scenario) -> Result<Seen, String> {
    let (arm, task, normal) = (&draw.arm, &draw.task, draw.normal());
    let limit_n = draw.normal_force_limit_n();
    let weight = |position: &[f64]| match task.frame {
        Frame::Base | Frame::Rpy(_) | Frame::Surface => 1.0,
        Frame::Tool => limit_n / task.normal_force_limit_n(arm, position, normal),
    };
    let mut seen = Seen::default();
    let (mut losses_before, mut last_verdict, mut since) = (0, Verdict::None.code(), None);
    let (mut latest, kept) = (VecDeque::new(), (BEFORE_S / draw.sampling_time_s).round() as usize + 2);
    let plant = VirtualRun::new(scenario).map_err(|error| error.to_string())?;
    let mut run = VirtualTime::new(cycle::build(config)?, plant);
    while let Some(Step { state, command, truth, .. }) = run.step()? {
        let position = &state.joint_position[..arm.joints()];
        if seen.first_active.is_none() && is_active(draw, position, &state.wrench, ACTIVATION_THRESHOLD_N) {
            let first = first_active(arm.joints(), &state.joint_position, &state.joint_velocity, &truth);
            seen.peak_n = truth.normal_force_n * weight(position);
            losses_before = truth.contact_losses;
            seen.first_active = Some(FirstActive { normal_force_n: seen.peak_n, ..first });
        } else if seen.first_active.is_some() {
            // The truth's peak is that since the sample before: of the cycle whose verdict was the
            // last one.
            let peak = truth.peak_normal_force_n * weight(position);
            seen.peak_n = seen.peak_n.max(peak);
            if last_verdict == Verdict::Feasible.code() {
                seen.peak_while_feasible_n = seen.peak_while_feasible_n.max(peak);
            } else if last_verdict == Verdict::None.code() {
                seen.peak_without_verdict_n = seen.peak_without_verdict_n.max(peak);
            }
        }
        if seen.first_active.is_some() {
            let since_ns = *since.get_or_insert(state.stamp_ns);
            if is_over(draw, state.stamp_ns - since_ns, command.mode) {
                break;
            }
            seen.samples_in_contact += u32::from(truth.in_contact == 1);
            seen.contact_losses = truth.contact_losses - losses_before;
            seen.resting_force_n = truth.normal_force_n * weight(position);
        }
        last_verdict = command.verdict;
        if last_verdict != Verdict::None.code() {
            seen.first_verdict_feasible.get_or_insert(last_verdict == Verdict::Feasible.code());
        }
        if seen.first_active.is_some() && seen.infeasible_cycles == 0 {
            let sample = first_active(arm.joints(), &state.joint_position, &state.joint_velocity, &truth);
            let twist = draw.twist().into_iter().zip(command.velocity_offset).map(|(twist, offset)| twist + offset);
            latest.push_back(Answered { sample, twist: twist.collect() });
            if latest.len() > kept {
                latest.pop_front();
            }
            if last_verdict == Verdict::Infeasible.code() && latest.len() == kept {
                let Answered { sample, .. } = latest[1].clone();
                seen.before_infeasible = Some(Earlier { sample, twist_before: latest[0].twist.clone() });
            }
        }
        seen.infeasible_cycles += u32::from(last_verdict == Verdict::Infeasible.code());
        seen.stop_reason = command.stop_reason;
    }
    Ok(seen)
}

/// Whether a wrench (base frame) is above β along a direction that gives way.
pub(crate) fn is_active(draw: &Draw, position: &[f64], wrench: &[f64], threshold_n: f64) -> bool {
    let force = draw.task.seen(&draw.arm, position, draw.normal(), [wrench[0], wrench[1], wrench[2]]);
    force.iter().zip(&draw.task.gives_way).any(|(force, gives)| *gives && force.abs() > threshold_n)
}

pub(crate) fn first_active(joints: usize, position: &[f64], velocity: &[f64], truth: &TruthSample) -> FirstActive {
    FirstActive {
        joint_position: position[..joints].to_vec(),
        joint_velocity: velocity[..joints].to_vec(),
        normal_force_n: truth.normal_force_n,
    }
}

/// The contact from its first active sample on, as the judge sees it.
pub(crate) fn contact(draw: &Draw, first: &FirstActive) -> Contact {
    // No offset before the first active sample: what is on its way is the command.
    from(draw, first, &draw.twist()).after_delay(draw.delay_cycles)
}

/// The same from a later sample on.
pub(crate) fn later_contact(draw: &Draw, earlier: &Earlier) -> Contact {
    let mut contact = from(draw, &earlier.sample, &earlier.twist_before);
    let on_its_way =
        contact.arm.joint_velocity(&earlier.sample.joint_position, &draw.task.controlled, &earlier.twist_before);
    contact.pending = vec![on_its_way; draw.delay_cycles as usize];
    contact
}

/// The contact from a sample on; `streamed` is the twist before it.
fn from(draw: &Draw, first: &FirstActive, streamed: &[f64]) -> Contact {
    let before = || draw.arm.joint_velocity(&first.joint_position, &draw.task.controlled, streamed);
    Contact {
        arm: draw.arm.clone(),
        task: draw.task.clone(),
        twist: draw.twist(),
        velocity_time_constant_s: draw.velocity_time_constant_s.clone(),
        joint_speed_bounds: draw.joint_speed_limit.iter().map(|limit| (-limit, *limit)).collect(),
        normal: draw.normal(),
        surface_point_m: draw.contact_point_m(),
        stiffness_n_m: draw.stiffness_n_m,
        damping_n_s_m: 0.0,
        limit_n: draw.normal_force_limit_n(),
        joint_position: first.joint_position.clone(),
        joint_velocity: first.joint_velocity.clone(),
        pending: Vec::new(),
        sampling_time_s: draw.sampling_time_s,
        drives: draw.drives.as_ref().map(|drives| Driven {
            acceleration: drives.acceleration.clone(),
            jerk: drives.jerk.clone(),
            before: before(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use admittance_core::quantities::Instant;
    use ipc_types::{CommandSample, Motion, VirtualPlant};
    use plant_sim::run::VirtualRun;

    use super::super::arm::product;
    use super::super::attainable::{DURATION_S, JointState};
    use super::super::controller::{Profile, Variant, controller, scenario};
    use super::super::draw::AnyArm;
    use super::*;

    /// Lets the controller work until the first active sample and plays the judge's inputs from
    /// then on: (the judge's peak, the least and the most that the plant's is), all in N. The plant tells the
    /// peak since the sample before, and a tool's frame may have turned meanwhile.
    fn judge_and_plant(draw: &Draw) -> (f64, [f64; 2]) {
        let mut cycle = cycle::build(&controller(draw, Profile::Default, Variant::Nominal).unwrap()).unwrap();
        let mut plant = VirtualRun::new(&scenario(draw).unwrap()).unwrap();
        let mut command = CommandSample::zeroed();
        let mut plan: Option<(Contact, Vec<JointState>, Vec<Vec<f64>>)> = None;
        let (mut judge_n, mut peak_n, mut since, mut weight_before) = (0.0, [0.0_f64; 2], 0, None);
        let cycles = (DURATION_S / draw.sampling_time_s).round() as usize;
        while since < cycles {
            let state = *plant.sample().unwrap();
            cycle.answer(&state, Instant::from_nanoseconds(state.stamp_ns), &mut || false, &mut command);
            command.sequence += 1;
            let position = &state.joint_position[..draw.arm.joints()];
            let starts = plan.is_none() && is_active(draw, position, &state.wrench, ACTIVATION_THRESHOLD_N);
            if starts {
                let joints = draw.arm.joints();
                let first = first_active(joints, position, &state.joint_velocity, &TruthSample::zeroed());
                let contact = contact(draw, &first);
                let answer = contact.lowest_peak().unwrap();
                judge_n = answer.peak_n;
                // One reference for each cycle from the sample on, and the state at its start.
                let references: Vec<Vec<f64>> = answer
                    .inputs
                    .iter()
                    .flat_map(|input| {
                        let cycles = (input.duration_s / draw.sampling_time_s).round() as usize;
                        std::iter::repeat_n(input.reference.clone(), cycles)
                    })
                    .collect();
                let mut at = JointState { position: first.joint_position, velocity: first.joint_velocity };
                let mut states = Vec::new();
                for reference in &references {
                    let next = contact.advance(&at, reference, draw.sampling_time_s);
                    states.push(std::mem::replace(&mut at, next));
                }
                plan = Some((contact, states, references));
            }
            if let Some((contact, states, references)) = &plan {
                // The command for this sample acts after the delay, at the pose of then.
                let acts = (since + draw.delay_cycles as usize).min(references.len() - 1);
                let jacobian = contact.arm.jacobian(&states[acts].position);
                let twist: Vec<f64> = jacobian.iter().map(|row| product(row, &references[acts])).collect();
                command.motion = Motion::Offset.code();
                command.velocity_offset = [0.0; 6];
                for (axis, commanded) in draw.twist().into_iter().enumerate() {
                    command.velocity_offset[axis] = twist[axis] - commanded;
                }
                command.plan_length = 1;
                command.plan_end_ns = [0; ipc_types::MAX_PLAN];
                command.plan_end_ns[0] = 1_000_000_000;
                command.planned_offset[0] = command.velocity_offset;
                command.valid_until_ns = state.stamp_ns + 1_000_000_000;
            }
            let truth = plant.advance(Some(&command)).unwrap();
            if let Some((contact, ..)) = &plan {
                since += 1;
                let normal_n = if starts { truth.normal_force_n } else { truth.peak_normal_force_n };
                let weight = contact.weight(position);
                let before = weight_before.replace(weight).unwrap_or(weight);
                let both = [weight.min(before), weight.max(before)];
                peak_n = std::array::from_fn(|end| f64::max(peak_n[end], normal_n * both[end]));
            }
        }
        (judge_n, peak_n)
    }

    /// Whether the judge's peak is the plant's within 0.2 %.
    fn confirms((judge, [least, most]): (f64, [f64; 2])) -> bool {
        judge >= least * (1.0 - 2e-3) && judge <= most * (1.0 + 2e-3)
    }

    #[test]
    fn the_plant_confirms_the_judge_of_any_arm() {
        for index in 0..32 {
            let AnyArm { name, draw } = AnyArm::new(9, index).unwrap();
            let both = judge_and_plant(&draw);
            assert!(confirms(both), "case {index}, {name}: judge and plant {both:?} N");
        }
    }

    #[test]
    fn the_plant_confirms_the_judge() {
        for index in 0..30 {
            let draw = Draw::new(9, index).unwrap();
            let both = judge_and_plant(&draw);
            assert!(confirms(both), "case {index}: judge and plant {both:?} N");
        }
    }
}
