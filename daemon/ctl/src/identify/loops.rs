//! The joints' speed loops: time constant, order, dead time, and the lag with which their velocities
//! are reported.

use serde::Serialize;

use super::estimate::Estimate;
use super::joint_fit::{JointFit, LAG, Sizes};
use super::joint_loop::{Loop, Moving};
use super::least_squares::mean_square;
use super::reference::References;
use super::track::Track;

/// Length of the stretches that count as witnesses of their own, s.
pub(super) const BLOCK_S: f64 = 0.25;
/// After so long nothing is left of how a joint moved before a recording began, s.
pub(super) const FADED_S: f64 = 0.15;
/// A loop is of second order where Akaike's criterion prefers it by so much, and the residual falls
/// by this part at least.
const AKAIKE: f64 = 10.0;
const LEAST_GAIN: f64 = 0.01;
/// Where the search begins, s.
const TIME_CONSTANTS_S: [f64; 5] = [0.003, 0.006, 0.012, 0.025, 0.05];
const DEAD_TIMES_S: [f64; 6] = [0.0, 0.001, 0.002, 0.004, 0.008, 0.016];
const DAMPINGS: [f64; 2] = [0.7, 1.5];
/// Between samples J is a straight line, and controllers work in ticks of their own: no interval is
/// narrower than this (s), or this part of a time constant.
const FINEST_S: f64 = 2e-5;
const FINEST: f64 = 1e-3;
/// A lag of the report that is shorter makes no difference, s.
const LEAST_LAG_S: f64 = 1e-4;

/// What a recording shows of the joints.
pub(super) struct Evidence<'a> {
    pub(super) tracks: &'a [Track],
    pub(super) references: &'a [References],
    /// Which samples count, by track.
    pub(super) used: &'a [Vec<bool>],
    /// Unit of each joint's velocity.
    pub(super) speed_units: &'a [&'static str],
}

/// A joint's loop as it was found.
#[derive(Debug, Clone, Serialize)]
pub(super) struct FoundLoop {
    pub(super) time_constant_s: Estimate,
    /// Of a loop of second order.
    pub(super) damping: Option<Estimate>,
    pub(super) dead_time_s: Estimate,
    /// RMS of what the fit leaves of the reported velocity, and the range of that, rad/s; m/s of a joint
    /// that slides.
    pub(super) residual_rad_s: f64,
    pub(super) range_rad_s: f64,
    /// Of both.
    pub(super) speed_unit: &'static str,
    /// By how much Akaike's criterion prefers second order.
    pub(super) second_order_gain: f64,
    /// Whether the recording tells its time constant and dead time.
    pub(super) is_told: bool,
    #[serde(skip)]
    pub(super) model: Loop,
}

/// All joints.
#[derive(Debug, Clone, Serialize)]
pub(super) struct FoundLoops {
    pub(super) joints: Vec<FoundLoop>,
    pub(super) report_lag_s: Estimate,
}

impl Evidence<'_> {
    /// The motion of a joint, by the samples of each track.
    pub(super) fn follow(&self, model: &Loop, joint: usize) -> Vec<Vec<Moving>> {
        let follow = |(track, references): (&Track, &References)| {
            let start = Moving::beginning(track.position[0][joint], track.velocity[0][joint]);
            model.follow(references, joint, &track.time_s, start)
        };
        self.tracks.iter().zip(self.references).map(follow).collect()
    }

    /// Residuals of velocity, then of position per cycle, in rad/s.
    pub(super) fn residuals(&self, model: &Loop, joint: usize) -> [Vec<f64>; 2] {
        let mut all = [Vec::new(), Vec::new()];
        for ((track, used), moved) in self.tracks.iter().zip(self.used).zip(self.follow(model, joint)) {
            for sample in (1..track.len()).filter(|sample| used[*sample]) {
                all[0].push(moved[sample].shown - track.velocity[sample][joint]);
                let went = track.position[sample][joint] - track.position[sample - 1][joint];
                let goes = moved[sample].position - moved[sample - 1].position;
                all[1].push((goes - went) / (track.time_s[sample] - track.time_s[sample - 1]));
            }
        }
        all
    }

    fn blocks(&self) -> Vec<usize> {
        let (mut blocks, mut before) = (Vec::new(), 0);
        for (track, used) in self.tracks.iter().zip(self.used) {
            let of = |sample: usize| before + (track.time_s[sample] / BLOCK_S) as usize;
            blocks.extend((1..track.len()).filter(|sample| used[*sample]).map(of));
            before = of(track.len() - 1) + 1;
        }
        [blocks.clone(), blocks].concat()
    }

    /// Least and largest reported velocity, rad/s.
    fn range(&self, joint: usize) -> f64 {
        let shown = self.tracks.iter().zip(self.used).flat_map(|(track, used)| {
            track.velocity.iter().zip(used).filter(|(_, used)| **used).map(|(velocity, _)| velocity[joint])
        });
        let (low, high) = shown.fold((0.0_f64, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
        high - low
    }

    /// The loops, as they fit best.
    pub(super) fn loops(&self, joints: usize) -> FoundLoops {
        let blocks = self.blocks();
        let first: Vec<(JointFit, Sizes)> = (0..joints).map(|joint| self.first(joint, &blocks)).collect();
        let lags: Vec<Estimate> = first
            .iter()
            .filter(|(fit, _)| fit.is_told)
            .map(|(fit, _)| Estimate::new(fit.model.report_lag_s, fit.half_width[3]))
            .collect();
        let lag = Estimate::mean(&lags).unwrap_or(Estimate::new(0.0, f64::INFINITY)).doubted(FINEST_S);
        let known = if lag.is_there() && lag.value > LEAST_LAG_S { lag.value } else { 0.0 };
        let joints = first.iter().enumerate().map(|(joint, (fit, sizes))| {
            let start = Loop { report_lag_s: known, ..fit.model };
            self.found(joint, &self.again(joint, start, *sizes, &blocks), fit, &lag)
        });
        FoundLoops { joints: joints.collect(), report_lag_s: Estimate { value: known, ..lag } }
    }

    /// With the lag of the report as it is known. Before its reference nothing follows: where the dead
    /// time would be negative it is zero, and the others are fitted beside that.
    fn again(&self, joint: usize, start: Loop, sizes: Sizes, blocks: &[usize]) -> JointFit {
        let is_second = start.damping > 0.0;
        let free = if is_second {
            self.fit(joint, start, sizes, blocks, [0, 1, 2])
        } else {
            self.fit(joint, start, sizes, blocks, [0, 1])
        };
        if free.model.dead_time_s >= 0.0 {
            return free;
        }
        let start = Loop { dead_time_s: 0.0, ..free.model };
        let mut held = if is_second {
            self.fit(joint, start, sizes, blocks, [0, 2])
        } else {
            self.fit(joint, start, sizes, blocks, [0])
        };
        held.half_width[1] = free.half_width[1];
        held.is_told &= free.is_told;
        held
    }

    /// With a lag of the report of its own, and the better of both orders.
    fn first(&self, joint: usize, blocks: &[usize]) -> (JointFit, Sizes) {
        let even = Sizes { velocity: 1.0, position: 1.0 };
        let starts = TIME_CONSTANTS_S.into_iter().flat_map(|t| DEAD_TIMES_S.map(|dead| (t, dead)));
        let models = starts.map(|(time_constant_s, dead_time_s)| Loop {
            time_constant_s,
            dead_time_s,
            damping: 0.0,
            report_lag_s: 0.0,
        });
        let badness = |model: &Loop| mean_square(&self.residuals(model, joint)[0]);
        let start = models.map(|model| (badness(&model), model)).min_by(|a, b| a.0.total_cmp(&b.0));
        let start =
            start.map_or(Loop { time_constant_s: 0.01, damping: 0.0, dead_time_s: 0.0, report_lag_s: 0.0 }, |s| s.1);
        let rough = self.fit(joint, Loop { report_lag_s: 5e-4, ..start }, even, blocks, [0, 1, LAG]);
        // Rounding leaves this much of an exact fit.
        let least = 1e-7 * self.range(joint).max(1e-3);
        let [velocity, position] = self.residuals(&rough.model, joint).map(|all| mean_square(&all).sqrt().max(least));
        let sizes = Sizes { velocity, position };
        let plain = self.fit(joint, rough.model, sizes, blocks, [0, 1, LAG]);
        let second = DAMPINGS
            .into_iter()
            .map(|damping| self.fit(joint, Loop { damping, ..plain.model }, sizes, blocks, [0, 1, 2, LAG]))
            .min_by(|a, b| a.mean_square.total_cmp(&b.mean_square));
        let Some(second) = second else { return (plain, sizes) };
        let effective = plain.effective.min(second.effective);
        let of = |fit: &JointFit, parameters: f64| {
            effective * fit.mean_square.max(f64::MIN_POSITIVE).ln() + 2.0 * parameters
        };
        let gain = of(&plain, 3.0) - of(&second, 4.0);
        let is_better = gain > AKAIKE && second.mean_square < (1.0 - LEAST_GAIN) * plain.mean_square;
        (JointFit { akaike: gain, ..if is_better { second } else { plain } }, sizes)
    }

    fn found(&self, joint: usize, fit: &JointFit, first: &JointFit, lag: &Estimate) -> FoundLoop {
        let model = fit.model;
        let by_lag = |k: usize| if lag.half_width.is_finite() { first.by_lag[k] * lag.half_width } else { 0.0 };
        let time_constant_s = Estimate::new(model.time_constant_s, fit.half_width[0])
            .doubted(FINEST * model.time_constant_s)
            .doubted(FINEST_S)
            .doubted(by_lag(0));
        let dead_time_s = Estimate::new(model.dead_time_s, fit.half_width[1]).doubted(FINEST_S).doubted(by_lag(1));
        let damping = (model.damping > 0.0).then(|| Estimate::new(model.damping, fit.half_width[2]).doubted(FINEST));
        let residuals = self.residuals(&model, joint);
        FoundLoop {
            is_told: fit.is_told && time_constant_s.half_width < 0.25 * time_constant_s.value,
            time_constant_s,
            damping,
            dead_time_s,
            residual_rad_s: mean_square(&residuals[0]).sqrt(),
            range_rad_s: self.range(joint),
            speed_unit: self.speed_units[joint],
            second_order_gain: first.akaike,
            model,
        }
    }
}
