//! The problem of a contact, (18): keep f_min ≤ s·f_lin ≤ f_max on the bounded axes, at the least
//! cost.

use nalgebra::SVector;

use super::beyond::Beyond;
use super::condensation::{InputAxes, Prediction, Slack};
use super::constraints::{AxisBound, ForceBounds, Softened};
use super::cost::SetPoint;
use super::drive_way::DriveWay;
use super::every_surface::{of_set, pressing_everywhere, shown_beyond};
use super::fastest_outward::outward;
use super::late_arm::{free_of_told, pressed_late};
use super::qp::QpSolver;
use super::{Demand, InputSelection, LowerBound, Mpc, Options, Settings, Situation, Solution, Verdict};
use crate::output::{MAX_STEPS, Plan};

/// The price of a force below f_min. At rest nothing pulls the force there; after an impact the
/// price is low enough that a dip between samples, which may be unavoidable, does not cause the
/// next impact.
const KEPT: Slack = Slack { softened: Softened::Minimum, price: 1.0, curvature: 0.1 };

/// R once the arm was halted, relative to R. An impact wants the arm to brake at once; afterwards a
/// loop that lags more than it was told would bounce for as long as the law corrects it within a
/// few cycles.
const SETTLING: f64 = 100.0;
/// Part of what f̂ shows beyond the force while that falls by which the force may be smaller than it is believed to be,
/// with a T_est that is a bit longer than told.
const MISSING: f64 = 0.35;
/// How many times the share counts besides by which T_est may be longer: what was learned of the surface is off by it too.
const MISSING_BY_LAG: f64 = 1.5;
/// Part of the joints' speed that has to be left for all of it: with less the weight goes down to R
/// steadily, so that an arm that slides along its limits does not jump from one law to the other.
const ENOUGH_SPEED: f64 = 0.05;
/// What the present turning of the arm counts in an impact, beside that of the slide to come: q̇ goes
/// from one to the other with T_V, and the force peaks after about as long.
const AT_FIRST: f64 = 0.4;
/// Largest speed in m/s that a turning arm has: near a singular pose it grows without bound.
const MOST_DRIFT: f64 = 0.1;
/// Part of f_min by which the force settles above it: at rest on the bound, the least error of the model would have the
/// bound throw it back each few cycles, by some mN.
const ABOVE_MINIMUM: f64 = 1e-3;
/// Largest lead of an arm that slides, in m/s: near a singular pose it grows without bound, and what is linear in the
/// lag does not hold.
const MOST_LEAD: f64 = 0.05;
/// The same where the force comes first, and the input is not dear: a plan that it shapes would miss by more.
const LEAD_IN_HASTE: f64 = 0.02;
/// Part of the joints' speed that a slide uses at most: what is left keeps the force.
const SLIDE: f64 = 0.95;
/// How far below the limit a plan stays where it can, relative to how far above it may be; half as far where it can't.
const ROOM: f64 = 4.0;
/// Part of what the drives allow at once that a tool may have to leave a depth with.
const BACK_AT_ONCE: f64 = 0.5;
/// Time constant with which the force settles, in times the sum of all that lags: the slowest speed loop, a cycle, the longest
/// dead time, the delay of commands, and by how much the arm may follow later.
const SETTLING_LAGS: f64 = 1.4;
/// Part of what joints on their way in cover yet that counts as excess. All of it would stop an arm of second order that was told to be
/// of first for what it does not press yet, and it would leave the surface again; with none of it noise would be more of an offset.
const COVERED_INWARD: f64 = 0.1;
/// Least part of the normal along what gives way that can take a motion out of the surface.
const LEAST_PART: f64 = 0.1;

impl<const N: usize, const D: usize> Settings<N, D> {
    /// Time constant with which the force settles, s.
    pub(super) fn settling_time(&self) -> f64 {
        let delay = self.loops.dead_time.max() + self.timing.command_delay.seconds() + self.options.lag_tolerance;
        SETTLING_LAGS * (self.loops.slowest() + self.timing.sampling_time.seconds() + delay)
    }
}

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Mpc<N, D, S, B> {
    /// Solves (18) for what a contact asks. `expired` is called before and between solver
    /// iterations.
    pub(crate) fn press(
        &mut self,
        situation: &Situation<'_, N, D>,
        demand: &Demand<D>,
        expired: &mut dyn FnMut() -> bool,
    ) -> Solution<&Plan<D>> {
        self.stuck_at = None;
        let Options { limit_tolerance: tolerance, force_limit, .. } = self.settings.options;
        // A plan that rides on the limit would miss it by what the linear model leaves out.
        // A set has its own room: what is uncertain.
        let room = if situation.belief.set().is_some() { 0.0 } else { ROOM };
        let levels = [-room, -room / 2.0, 0.0, 1.0].map(|part| part * tolerance);
        let mut level = levels[0];
        let beyond = Beyond::of(&self.settings, situation, demand);
        if let Some(verdict) = beyond.hopeless() {
            return Solution::Infeasible { verdict, iterations: 0 };
        }
        // What an arm that follows late would press deeper: without a plan that leaves it free, it is
        // as if nobody had asked for that.
        // (In an impact that is part of what links press.)
        let is_told = demand.settles || beyond.is_impact();
        let late = if is_told { 0.0 } else { pressed_late(&self.settings, situation) };
        let mut before = 0;
        for free in beyond.left_free(late, &self.settings, situation, demand) {
            match self.press_within(level, free, situation, demand, expired) {
                Solution::Planned { mut verdict, iterations, .. } => {
                    verdict.count_from(level.min(0.0), &force_limit);
                    let verdict = beyond.judged(verdict, &self.settings, situation, &self.plan);
                    before += iterations;
                    if !matches!(verdict, Verdict::Infeasible { .. }) {
                        return Solution::Planned { plan: &self.plan, verdict, iterations: before };
                    }
                }
                other => before += other.iterations(),
            }
        }
        let mut solution = self.press_within(level, 0.0, situation, demand, expired).after(before);
        for next in levels {
            let Solution::Infeasible { verdict: Verdict::Infeasible { axis, shortfall, .. }, iterations } = solution
            else {
                break;
            };
            if next > level && shortfall <= (next - level) * force_limit[axis] {
                let wider = self.press_within(next, 0.0, situation, demand, expired);
                let is_answer = matches!(wider, Solution::Planned { .. } | Solution::Infeasible { .. });
                // Without another solution the one before stands, if it is about the limit itself.
                if is_answer || level < 0.0 {
                    (level, solution) = (next, wider.after(iterations));
                } else {
                    break;
                }
            }
        }
        if let Solution::Planned { verdict, .. } | Solution::Infeasible { verdict, .. } = &mut solution {
            verdict.count_from(level.min(0.0), &force_limit);
        }
        if let Solution::Planned { verdict, iterations, .. } = solution {
            let verdict = beyond.judged(verdict, &self.settings, situation, &self.plan);
            if matches!(verdict, Verdict::Infeasible { .. }) {
                return Solution::Infeasible { verdict, iterations };
            }
            return Solution::Planned { plan: &self.plan, verdict, iterations };
        }
        solution.with(&self.plan)
    }

    /// (18) with every f_max larger by the part `tolerance`, and `late` N along the normal left free
    /// below it, as far as full outward speed allows.
    fn press_within(
        &mut self,
        tolerance: f64,
        late: f64,
        situation: &Situation<'_, N, D>,
        demand: &Demand<D>,
        expired: &mut dyn FnMut() -> bool,
    ) -> Solution<()> {
        let (settings, options) = (self.settings, self.settings.options);
        let (sample, surface, output) = (situation.sample, situation.belief.surface(), situation.output);
        let inputs = match options.inputs {
            InputSelection::Active => demand.active,
            InputSelection::All => settings.admittance,
        };
        let set = situation.belief.set();
        let of_set = set.and_then(|set| of_set(self, set, situation, &demand.signs, (tolerance, late)));
        if let Some(verdict) = of_set.and_then(|bounds| bounds.stop()) {
            return Solution::Infeasible { verdict, iterations: 0 };
        }
        let free = match &of_set {
            Some(bounds) => bounds.free,
            None if late > 0.0 => free_of_told(&settings, situation, &demand.signs, (tolerance, late)),
            None => 0.0,
        };
        // Where every surface that may be there presses with enough of a force, as that of the likeliest, and with as
        // much more as may be missing of it.
        let part = (MISSING + MISSING_BY_LAG * options.wrench_lag_tolerance).min(1.0);
        let missing = set.filter(|_| demand.settles).map_or(0.0, |set| part * shown_beyond(set, situation));
        let pressing = |force: f64| set.map_or(force, |set| pressing_everywhere(set, situation, force + missing));
        let mut bounds = ForceBounds::none();
        for axis in (0..D).filter(|&axis| demand.signs[axis] != 0.0) {
            let (sign, minimum) = (demand.signs[axis], demand.minimum[axis]);
            if let Some(of_set) = &of_set {
                let part = surface.normal[axis].abs();
                let minimum = if minimum > f64::NEG_INFINITY { pressing(minimum / part) * part } else { minimum };
                bounds.push(of_set.bound(axis, sign, minimum, &surface.normal));
                continue;
            }
            let maximum = options.force_limit[axis] * (1.0 + tolerance) - free * surface.normal[axis].abs();
            bounds.push(AxisBound { axis, sign, minimum, maximum });
        }
        let is_soft = options.lower_bound == LowerBound::OnceReached;
        let holds = is_soft && bounds.as_slice().iter().any(|bound| bound.minimum > f64::NEG_INFINITY);
        // The offset of released axes is on its way to zero: a known input, beside ṗ0.
        let mut known_twist = [SVector::zeros(); MAX_STEPS];
        let mut since = 0.0;
        for (twist, step) in known_twist.iter_mut().zip(options.steps()) {
            since += step;
            let ramp = output.released_offset(since);
            let known = |axis: usize, _| sample.twist_reference[axis] + if inputs[axis] { 0.0 } else { ramp[axis] };
            *twist = SVector::from_fn(known);
        }
        let slowing = if demand.inward_speed.is_finite() {
            let excess = -surface.outward_speed(&sample.twist_reference) - demand.inward_speed;
            SVector::from_fn(|axis, _| {
                let reach = if inputs[axis] { settings.limits.offset[axis] } else { 0.0 };
                (surface.normal[axis] * excess.max(0.0)).clamp(-reach, reach)
            })
        } else {
            SVector::zeros()
        };
        let mut way = None;
        if let Some(driven) = situation.driven(false) {
            let way = way.insert(DriveWay::new(driven));
            way.lead(situation, options.steps(), |step| known_twist[step] + slowing);
            for (known, led) in known_twist.iter_mut().zip(&way.twists) {
                (0..D).filter(|&axis| !inputs[axis]).for_each(|axis| known[axis] = led[axis]);
            }
        }
        let known_twist = &known_twist[..options.steps().len()];
        let mut known_reference = [SVector::zeros(); MAX_STEPS];
        let known_reference = &mut known_reference[..known_twist.len()];
        write_references(situation, known_twist, known_reference);
        situation.add_beside(options.steps(), known_reference);
        // A pulling spring would hold back a TCP that is leaving, and a fading estimate one that is
        // returning: an axis that should press but does not has no force cost.
        let wrench_axes = if is_soft && !holds { InputAxes::none() } else { InputAxes::from_mask(&demand.active) };
        // Once a force is kept, neither the part of ṗ0 into the surface nor the offset that cancels
        // it shall bias it.
        // One that leads out of it is along the surface as it was told.
        let inward = surface.outward_speed(&sample.twist_reference);
        let inward = if situation.belief.learns_normal() { inward } else { inward.min(0.0) };
        let out = if holds { way_out(&surface.normal, &inputs) } else { surface.normal };
        let wanted_offset = out * if holds { -inward } else { 0.0 };
        // A force set point below f_min would lean on the price of the lower bound with all its
        // weight: an error of the model would throw the arm from one to the other.
        // Axes that hardly feel the surface press in another way.
        let feels = |bound: &&AxisBound| situation.belief.surface_signs().sign(bound.axis).is_some();
        // Until it settles the force is to come to what it has reached, and no further.
        let above = if demand.settles { 1.0 + ABOVE_MINIMUM } else { 1.0 };
        let along_normal = |bound: &AxisBound| {
            let (part, kept) = (surface.normal[bound.axis].abs(), demand.kept[bound.axis]);
            if kept > f64::NEG_INFINITY {
                pressing(kept / part * above).min(of_set.map_or(f64::INFINITY, |set| set.most_kept()))
            } else {
                0.0
            }
        };
        let felt = bounds.as_slice().iter().filter(feels);
        let kept = if is_soft { felt.map(along_normal).fold(0.0, f64::max) } else { 0.0 };
        let normal_force = match set {
            None => options.normal_force_reference.max(kept),
            Some(_) => pressing(options.normal_force_reference).max(kept),
        };
        let used = |twist: &SVector<f64, D>| {
            let wanted = situation.told_with(twist);
            let used = |most: &SVector<f64, N>| wanted.zip_map(most, |speed, most| speed.abs() / most).max();
            settings.limits.joint_speed.as_ref().map_or(0.0, used)
        };
        // Where a joint is too slow for the slide, the arm slides more slowly and keeps the force:
        // the weight of the way along the surface would let it climb.
        let asked = sample.twist_reference + wanted_offset;
        let sliding = if holds { asked / (used(&asked) / SLIDE).max(1.0) } else { asked };
        let wanted_offset = wanted_offset + (sliding - asked);
        let told = situation.told_with(&sliding);
        let behind = if holds { situation.behind(&settings, &told) } else { SVector::zeros() };
        let behind_along_normal = situation.outward_speed(&behind);
        let lead = if holds { behind_along_normal - situation.falling_away(&told) } else { 0.0 };
        let lead_within = |most: f64| surface.normal * lead.clamp(-most, most);
        // Which way the arm shall move: along the surface, and away from it as fast as the force
        // settles.
        let settling = if holds && demand.settles {
            let of_slide = situation.outward_speed(&told) - situation.falling_away(&told);
            let excess = excess(&settings, situation, normal_force, of_slide);
            out * (excess / (surface.normal_stiffness() * settings.settling_time()))
        } else {
            SVector::zeros()
        };
        // Where little is left of the joints' speed, the force comes first: a dear input would keep
        // the way along the surface instead.
        let left = 1.0 - used(&(sliding + settling + lead_within(MOST_LEAD)));
        let calm = if is_soft && demand.settles { (left / ENOUGH_SPEED).clamp(0.0, 1.0) } else { 0.0 };
        let lead = lead_within(LEAD_IN_HASTE + calm * (MOST_LEAD - LEAD_IN_HASTE));
        // The model's J does not turn, so it would have the joints catch up with what they are behind by; where they
        // lag differently, that alone would look like a motion along the normal. An arm at its limits, or in an
        // impact, is behind by something else.
        let stays = if holds { calm * (MOST_LEAD / behind_along_normal.abs()).min(1.0) } else { 0.0 };
        let behind = behind * stays;
        let behind_along_surface = behind - situation.joint_velocity(&(surface.normal * (behind_along_normal * stays)));
        let start = situation.at_action(&settings, &bounds, &behind);
        if let Verdict::Infeasible { .. } = start.verdict {
            return Solution::Infeasible { verdict: start.verdict, iterations: 0 };
        }
        let mut constraints = settings.constraints(bounds, &SVector::zeros(), situation, &start.state);
        if demand.inward_speed.is_finite() {
            let way = (&(sample.twist_reference + output.offset()), &(sample.twist_reference + slowing));
            constraints.bound_inward_speed(demand.inward_speed, &surface.normal, known_twist, way, options.steps());
        }
        if let (Some(speed), Some(bound)) =
            (of_set.and_then(|bounds| bounds.way_back(&settings, situation)), &mut constraints.normal_speed)
        {
            let speed = match situation.driven(false) {
                None => speed,
                Some(mut driven) => {
                    let first = driven.advance(options.steps()[0], &situation.of_twist(&outward(&settings, situation)));
                    speed.min(BACK_AT_ONCE * situation.outward_speed(&first))
                }
            };
            bound.least[0] = bound.least[0].max(speed - surface.outward_speed(&known_twist[0]));
        }
        let drives = way.map(|way| {
            let known = (known_twist, &*known_reference);
            constraints.keep_drives(&way, situation, options.steps(), known, &sample.twist_reference)
        });
        constraints.drives = drives.as_ref();
        // (The deepest point of a set counts without the arm's turning.)
        let drift = if is_soft && !demand.settles && set.is_none() {
            // Until it is halted the arm turns as it does now, and more and more as it will slide.
            let [now, later] = [situation.joints.velocity, told].map(|joint_velocity| {
                situation.outward_speed(&situation.behind(&settings, &joint_velocity)).clamp(-MOST_DRIFT, MOST_DRIFT)
            });
            surface.normal * (AT_FIRST * now + (1.0 - AT_FIRST) * later)
        } else {
            lead
        };
        let drift = situation.joint_velocity(&drift) + behind_along_surface;
        known_reference.iter_mut().for_each(|reference| *reference -= drift);
        let prediction = Prediction {
            initial: start.state,
            known_reference,
            drift,
            inputs: InputAxes::from_mask(&inputs),
            previous_input: *output.offset(),
            wrench_axes,
            constraints,
            set_point: SetPoint {
                joint_position: sample.joint_position_reference,
                joint_velocity: told - behind_along_surface,
                wrench: surface.normal * -normal_force,
                input: wanted_offset + lead,
                fading_velocity: situation.joint_velocity(&settling),
                fading_input: settling,
            },
            weights: &options.weights,
            jacobian: *sample.posture.jacobian(),
            input_weight: options.input_weight * (1.0 + calm * (SETTLING - 1.0)),
            slack: holds.then_some(KEPT),
        };
        let solution = self.solve(situation, &prediction, known_twist, expired);
        let mut solution = solution.shifted(start.delay);
        if let Solution::Planned { verdict, .. } = &mut solution {
            *verdict = verdict.closest(start.verdict);
            verdict.count_free(free, &surface.normal);
        }
        match (solution, of_set.and_then(|bounds| bounds.at_risk())) {
            (Solution::Planned { plan, iterations, .. }, Some(verdict)) => {
                Solution::Planned { plan, verdict, iterations }
            }
            (solution, _) => solution,
        }
    }
}

/// What the surface presses with beyond a `force`, in N, less what joints that move out of it faster than the slide does (`of_slide`, m/s)
/// cover yet by themselves, until they are as slow as that: that is no excess any more.
pub(super) fn excess<const N: usize, const D: usize>(
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
    force: f64,
    of_slide: f64,
) -> f64 {
    let surface = situation.belief.surface();
    let [by_velocity, ..] = settings.loops.until_rest();
    let further = (situation.outward_speed(&situation.joints.velocity) - of_slide) * by_velocity.max();
    let covered = further.max(COVERED_INWARD * further);
    surface.spring_force(situation.sample.posture.pose()) - surface.normal_stiffness() * covered - force
}

/// J⁻¹ of the twist in each step.
fn write_references<const N: usize, const D: usize>(
    situation: &Situation<'_, N, D>,
    twists: &[SVector<f64, D>],
    references: &mut [SVector<f64, N>],
) {
    for (step, twist) in twists.iter().enumerate() {
        let is_repeated = step > 0 && twists[step - 1] == *twist;
        references[step] = if is_repeated { references[step - 1] } else { situation.joint_velocity(twist) };
    }
}

/// The velocity of offsets that take 1 m/s along the normal out of a motion: along what of the normal gives
/// way, the more of it the more the normal leans out of that. It is the normal where all of it gives way.
fn way_out<const D: usize>(normal: &SVector<f64, D>, gives_way: &[bool; D]) -> SVector<f64, D> {
    if (0..D).all(|axis| gives_way[axis] || normal[axis] == 0.0) {
        return *normal;
    }
    let part = SVector::<f64, D>::from_fn(|axis, _| if gives_way[axis] { normal[axis] } else { 0.0 });
    let square = part.norm_squared();
    if square < LEAST_PART * LEAST_PART { *normal } else { part / square }
}
