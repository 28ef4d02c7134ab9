//! One contact in a closed loop, with what is believed of the surface cycle by cycle.

use admittance_runner::config::Config;
use admittance_runner::cycle;
use admittance_runner::virtual_time::{Step, VirtualTime};
use ipc_types::{Mode, StopReason, Verdict};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

use super::super::arm::dot;
use super::super::closed_loop::{FirstActive, first_active, is_active};
use super::super::draw::Draw;

/// The surface is known when it is so for this many samples.
const SAMPLES: u32 = 5;
const KNOWN_PART: f64 = 0.2;
const KNOWN_M: f64 = 50e-6;

/// What one run showed. Forces are true normal forces in N.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Seen {
    /// `None`: no sample was active.
    pub(super) first_active: Option<FirstActive>,
    /// Samples from then on at which the tool touched.
    pub(super) samples_in_contact: u32,
    /// Cycles with these verdicts.
    pub(super) safe_cycles: u32,
    pub(super) at_risk_cycles: u32,
    pub(super) infeasible_cycles: u32,
    /// Largest share, and newtons above the limit, of those that were at risk.
    pub(super) risk_share: f64,
    pub(super) risk_excess_n: f64,
    /// Largest force from the first active sample on.
    pub(super) peak_n: f64,
    /// The same until the next sample after those whose verdict was safe, stopped or not.
    pub(super) peak_while_safe_n: f64,
    /// The same after a first verdict that was safe, whatever the later ones said.
    pub(super) peak_after_safe_n: f64,
    /// Times that contact ended after it.
    pub(super) contact_losses: u32,
    /// Why it stopped, or `None`'s code.
    pub(super) stop_reason: u32,
    /// Force at the end of the run.
    pub(super) resting_n: f64,
    /// Error of the force that is believed in then: that of the likeliest surface at the true depth.
    pub(super) believed_error_n: f64,
    /// From when on after the first active sample the surface was known, where the tool was, s.
    pub(super) known_after_s: Option<f64>,
}

impl Seen {
    /// Whether it was never stopped.
    pub(super) fn accepted(&self) -> bool {
        self.infeasible_cycles == 0 && self.stop_reason == StopReason::NONE
    }

    /// Whether it was, and every verdict was that the limit can be kept.
    pub(super) fn was_safe(&self) -> bool {
        self.accepted() && self.at_risk_cycles == 0
    }
}

/// Runs a controller with this β (N) against a plant; `told` is given a line for each cycle from the first active
/// sample on.
pub(super) fn run(
    draw: &Draw,
    threshold_n: f64,
    (config, scenario): (&Config, &Scenario),
    told: &mut dyn FnMut(String),
) -> Result<Seen, String> {
    let mut seen = Seen::default();
    let (mut losses_before, mut started, mut known) = (0, 0, 0);
    let (mut last_verdict, mut first_verdict) = (Verdict::None.code(), Verdict::None.code());
    let (normal, point) = (draw.normal(), draw.contact_point_m());
    let plant = VirtualRun::new(scenario).map_err(|error| error.to_string())?;
    let mut run = VirtualTime::new(cycle::build(config)?, plant);
    while let Some(Step { state, command, truth, .. }) = run.step()? {
        let position = &state.joint_position[..draw.arm.joints()];
        let active = is_active(draw, position, &state.wrench, threshold_n);
        if active && truth.in_contact == 1 && seen.first_active.is_none() {
            let joints = draw.arm.joints();
            seen.first_active = Some(first_active(joints, &state.joint_position, &state.joint_velocity, &truth));
            (losses_before, started) = (truth.contact_losses, state.stamp_ns);
            seen.peak_n = truth.normal_force_n;
        } else if seen.first_active.is_some() {
            // That since the sample before: of the cycle whose verdict was the last one.
            let peak_n = truth.peak_normal_force_n;
            seen.peak_n = seen.peak_n.max(peak_n);
            if last_verdict == Verdict::Feasible.code() {
                seen.peak_while_safe_n = seen.peak_while_safe_n.max(peak_n);
            }
            if first_verdict == Verdict::Feasible.code() {
                seen.peak_after_safe_n = seen.peak_after_safe_n.max(peak_n);
            }
        }
        // A cycle without a verdict, in free motion or without an answer, leaves the last one standing.
        if command.verdict != Verdict::None.code() {
            last_verdict = command.verdict;
            if first_verdict == Verdict::None.code() {
                first_verdict = last_verdict;
            }
        }
        if command.verdict == Verdict::Infeasible.code() || command.stop_reason != StopReason::NONE {
            seen.infeasible_cycles += u32::from(command.verdict == Verdict::Infeasible.code());
            seen.stop_reason = command.stop_reason;
        }
        if seen.first_active.is_none() {
            continue;
        }
        seen.samples_in_contact += u32::from(truth.in_contact == 1);
        seen.contact_losses = truth.contact_losses - losses_before;
        seen.resting_n = truth.normal_force_n;
        seen.safe_cycles += u32::from(command.verdict == Verdict::Feasible.code());
        if command.verdict == Verdict::AtRisk.code() {
            seen.at_risk_cycles += 1;
            seen.risk_share = seen.risk_share.max(command.verdict_share);
            seen.risk_excess_n = seen.risk_excess_n.max(-command.verdict_margin);
        }
        let belief = run.cycle.belief();
        // Where the tool is, so that a normal that was learned counts as one that was told.
        let depth = |normal: [f64; 3], point: [f64; 3]| {
            dot(normal, std::array::from_fn(|axis| point[axis] - truth.tcp_position[axis]))
        };
        let error_m = depth(belief.normal.into(), belief.contact_point.into()) - depth(normal, point);
        let ratio = belief.stiffness / draw.stiffness_n_m;
        let is_known = (ratio - 1.0).abs() <= KNOWN_PART && error_m.abs() <= KNOWN_M;
        let believed = belief.stiffness * (truth.normal_force_n / draw.stiffness_n_m + error_m);
        seen.believed_error_n = (believed - truth.normal_force_n).abs();
        known = if is_known { known + 1 } else { 0 };
        let since_s = (state.stamp_ns - started) as f64 * 1e-9;
        if known == SAMPLES && seen.known_after_s.is_none() {
            seen.known_after_s = Some(since_s - f64::from(SAMPLES - 1) * draw.sampling_time_s);
        }
        let linear = |values: &[f64]| dot(normal, std::array::from_fn(|axis| values[axis]));
        told(format!(
            "{:8.3} ms  f̂ {:8.3}  f {:8.3} (peak {:8.3})  {} {} {:8.3} N {:6.4}  k {ratio:7.4}  c {:8.2} um  [{:.3e} {:.3e}]  offset {:7.4}",
            since_s * 1e3,
            -linear(&state.wrench),
            truth.normal_force_n,
            truth.peak_normal_force_n,
            Mode::name_of(command.mode),
            Verdict::name_of(command.verdict),
            command.verdict_margin,
            command.verdict_share,
            error_m * 1e6,
            belief.stiffness_band.0,
            belief.stiffness_band.1,
            linear(&command.velocity_offset),
        ));
    }
    Ok(seen)
}
