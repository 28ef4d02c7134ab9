//! All that recordings tell, found step by step: loops, then when commands act, then the tool and the
//! touches, which need each other.

use admittance_host::robot_description::{JointDescription, KindName};
use admittance_runner::config::{Config, WrenchSourceName};
use admittance_runner::parameters::link_in_impact;
use nalgebra::Vector3;
use serde::Serialize;

use super::arm::Arm;
use super::delay::command_delay;
use super::estimate::Estimate;
use super::impact::{self, Between};
use super::joint_loop::Loop;
use super::lag::unexplained_lag_s;
use super::loops::{Evidence, FADED_S, FoundLoops};
use super::reference::{References, delay_bracket, references, without_offset};
use super::told::{self, Quantity, ToldTool};
use super::tool::{Felt, Filter, FoundTool};
use super::touch::{FoundTouch, Touch, is_whole, normal, touch, touches, window};
use super::track::Track;
use super::unknown::{Unknown, unknown};
use super::way::{Instant, way};

/// After an offset a joint has forgotten it, s.
const FORGOTTEN_S: f64 = 0.1;
/// Touches that are looked at; the longest.
const MOST_TOUCHES: usize = 8;
const ROUNDS: usize = 2;
/// A joint that is slower than this at the beginning counts as at rest, rad/s.
const RESTING_RAD_S: f64 = 0.01;

/// What was found.
#[derive(Serialize)]
pub(super) struct Found {
    pub(super) cycles: usize,
    pub(super) duration_s: f64,
    #[serde(flatten)]
    pub(super) loops: FoundLoops,
    pub(super) command_delay_s: Option<Estimate>,
    /// Between which delays the sequences of the commands in force put it.
    pub(super) command_delay_between_s: Option<(f64, f64)>,
    pub(super) tool: Option<ToldTool>,
    /// Samples at the end of the sensor's range, which tell nothing of the wrench.
    pub(super) saturated_samples: usize,
    pub(super) touches: Vec<FoundTouch>,
    pub(super) stiffness_n_m: Option<Estimate>,
    /// Before gears give, where masses are told.
    pub(super) impact_stiffness_n_m: Option<Between>,
    pub(super) wrench_time_constant_s: Option<Estimate>,
    pub(super) wrench_dead_time_s: Option<Estimate>,
    /// What to allow for beyond the model; absent where nothing is left to explain.
    pub(super) lag_tolerance_s: Option<f64>,
    pub(super) unknown: Vec<Unknown>,
}

/// Recordings of one arm, and what follows from them at every step.
pub(super) struct Case<'a> {
    pub(super) config: &'a Config,
    pub(super) arm: &'a dyn Arm,
    pub(super) tracks: Vec<Track>,
    pub(super) references: Vec<References>,
    used: Vec<Vec<bool>>,
    /// Unit of each joint's velocity.
    pub(super) speed_units: Vec<&'static str>,
}

impl<'a> Case<'a> {
    pub(super) fn new(config: &'a Config, arm: &'a dyn Arm, tracks: Vec<Track>) -> Self {
        let speed_unit = |joint: &JointDescription| match joint.kind {
            KindName::Revolute => "rad/s",
            KindName::Prismatic => "m/s",
        };
        let speed_units = config.robot.joint.iter().map(speed_unit).collect();
        let used = tracks.iter().map(|track| settled(track, &without_offset(track, FORGOTTEN_S))).collect();
        let mut case = Self { config, arm, tracks, references: Vec::new(), used, speed_units };
        case.refer(
            delay_bracket(&case.tracks).map_or(config.control.command_delay_s, |(least, most)| 0.5 * (least + most)),
        );
        case
    }

    /// Takes commands to act so much later than their samples, s.
    pub(super) fn refer(&mut self, delay_s: f64) {
        self.references = self.tracks.iter().map(|track| references(track, delay_s)).collect();
    }

    pub(super) fn evidence(&self) -> Evidence<'_> {
        Evidence {
            tracks: &self.tracks,
            references: &self.references,
            used: &self.used,
            speed_units: &self.speed_units,
        }
    }

    pub(super) fn found(&mut self) -> Found {
        let joints = self.config.robot.joint.len();
        let mut loops = self.evidence().loops(joints);
        let between = delay_bracket(&self.tracks);
        let by_offset =
            |track: &Track| without_offset(track, FORGOTTEN_S).iter().map(|without| !without).collect::<Vec<_>>();
        let shows: Vec<Vec<bool>> = self.tracks.iter().map(|track| settled(track, &by_offset(track))).collect();
        let command_delay_s = command_delay(&self.tracks, &loops, &shows);
        if let Some(delay) = command_delay_s {
            self.refer(delay.value);
        }
        let felt = self.felt(&loops);
        if self.leave_out(&felt.touches) {
            loops = self.evidence().loops(joints);
        }
        let lags = (0..joints).filter(|joint| loops.joints[*joint].is_told);
        let lags = lags.filter_map(|joint| unexplained_lag_s(&self.evidence(), joint, &loops.joints[joint]));
        let lag_tolerance_s = lags.max_by(f64::total_cmp);
        let touches: Vec<&FoundTouch> = felt.found.iter().filter(|touch| touch.is_told).collect();
        let mean = |of: fn(&FoundTouch) -> Estimate| {
            Estimate::mean(&touches.iter().map(|touch| of(touch)).collect::<Vec<_>>())
        };
        let mut unknown_so_far = Vec::new();
        let tool = told::tool(self.config, felt.tool.as_ref(), &mut unknown_so_far);
        let mut told = |what: &Quantity, found: Option<Estimate>| what.told(found, &mut unknown_so_far);
        // It stays among the loops; what is noted counts.
        let _ = told(&told::REPORT_LAG, Some(loops.report_lag_s));
        let command_delay_s = told(&told::COMMAND_DELAY, command_delay_s);
        let stiffness_n_m = told(&told::STIFFNESS, mean(|touch| touch.stiffness_n_m));
        // Its upper end is told as well: a wide interval is on the safe side.
        let impact_stiffness_n_m = impact::stiffness(touches.iter().filter_map(|touch| touch.impact.as_ref()));
        // The lag of a wrench from motor torques is what the configuration says it is.
        let by_sensor = self.config.wrench.source == WrenchSourceName::Sample;
        let lag = mean(|touch| touch.time_constant_s).filter(|_| by_sensor);
        let wrench_time_constant_s = told(&told::WRENCH_LAG, lag);
        let dead_time = mean(|touch| touch.dead_time_s).filter(|_| by_sensor);
        let wrench_dead_time_s = told(&told::WRENCH_DEAD_TIME, dead_time);
        let mut found = Found {
            cycles: self.tracks.iter().map(Track::len).sum(),
            duration_s: self.tracks.iter().filter_map(|track| track.time_s.last()).sum(),
            command_delay_s,
            command_delay_between_s: between,
            stiffness_n_m,
            impact_stiffness_n_m,
            wrench_time_constant_s,
            wrench_dead_time_s,
            saturated_samples: self.tracks.iter().map(|track| track.saturated).sum(),
            loops,
            tool,
            touches: felt.found,
            lag_tolerance_s,
            unknown: unknown_so_far,
        };
        found.unknown = unknown(self.config, &found);
        found
    }

    /// Samples in which something presses on the arm do not tell how its loops are. Whether that
    /// leaves some out.
    fn leave_out(&mut self, touches: &[Touch]) -> bool {
        let mut has_changed = false;
        for touch in touches {
            let track = &self.tracks[touch.track];
            for sample in window(touch, &track.time_s) {
                has_changed |= std::mem::take(&mut self.used[touch.track][sample]);
            }
        }
        has_changed
    }

    fn felt(&self, loops: &FoundLoops) -> FeltAll {
        let models: Vec<Loop> = loops.joints.iter().map(|joint| joint.model).collect();
        let ways: Vec<Vec<Instant>> = self
            .tracks
            .iter()
            .zip(&self.references)
            .map(|(track, references)| way(self.arm, track, references, &models, 0..track.len()))
            .collect();
        let lags = &self.config.contact.wrench_time_constant_s;
        let mut filter = Filter { time_constant_s: lags[0], dead_time_s: self.config.contact.wrench_dead_time_s };
        let mut center = Vector3::from(self.config.wrench.tool_center_of_gravity_m);
        let mut all = FeltAll { tool: None, touches: Vec::new(), found: Vec::new() };
        let mut free: Vec<Vec<bool>> = self.tracks.iter().map(|track| settled(track, &track.is_free)).collect();
        for _ in 0..ROUNDS {
            let felt = Felt::new(self.config, &self.tracks, &ways, filter, center);
            // What presses is left out once it is known, and then known better.
            for _ in 0..2 {
                let Some(tool) = felt.tool(&free) else { return all };
                let pressing = self.pressing(&felt, &tool);
                all.touches = (0..self.tracks.len())
                    .flat_map(|track| touches(track, &self.tracks[track].time_s, &pressing[track], tool.noise_n.value))
                    .collect();
                free = self.tracks.iter().map(|track| settled(track, &vec![true; track.len()])).collect();
                for touch in &all.touches {
                    let samples = window(touch, &self.tracks[touch.track].time_s);
                    samples.for_each(|sample| free[touch.track][sample] = false);
                }
            }
            let Some(tool) = felt.tool(&free) else { return all };
            let pressing = self.pressing(&felt, &tool);
            let mut longest = all.touches.clone();
            longest.retain(|touch| is_whole(touch, &self.tracks[touch.track].time_s));
            longest.sort_by_key(|touch| std::cmp::Reverse(touch.samples.len()));
            longest.truncate(MOST_TOUCHES);
            let found = longest.iter().filter_map(|of| {
                let samples = window(of, &self.tracks[of.track].time_s);
                let way = self.part(&ways[of.track], &samples);
                let joints = &self.tracks[of.track].position[of.samples.start];
                let link = link_in_impact(self.config, joints);
                touch(way, &pressing[of.track][samples], &normal(self.config), link.as_ref())
            });
            all.found = found.collect();
            let told: Vec<&FoundTouch> = all.found.iter().filter(|touch| touch.is_told).collect();
            let mean = |of: fn(&FoundTouch) -> Estimate| {
                Estimate::mean(&told.iter().map(|touch| of(touch)).collect::<Vec<_>>())
            };
            let lag = mean(|touch| touch.time_constant_s).filter(|lag| told::WRENCH_LAG.tells(lag));
            if let Some((lag, dead)) = lag.zip(mean(|touch| touch.dead_time_s)) {
                filter = Filter { time_constant_s: lag.value, dead_time_s: dead.value };
            }
            if let Some(found) = &tool.center_of_gravity_m {
                center = Vector3::from(found.map(|coordinate| coordinate.value));
            }
            all.tool = Some(tool);
        }
        all
    }

    /// The force along the inward normal that each sample shows, N; NaN where there is no wrench.
    fn pressing(&self, felt: &Felt, tool: &FoundTool) -> Vec<Vec<f64>> {
        let normal = normal(self.config);
        let mut all: Vec<Vec<f64>> = self.tracks.iter().map(|track| vec![f64::NAN; track.len()]).collect();
        for (track, sample, wrench) in felt.without(tool) {
            all[track][sample] = -normal.dot(&wrench.fixed_rows::<3>(0));
        }
        all
    }

    fn part<'w>(&self, way: &'w [Instant], samples: &std::ops::Range<usize>) -> &'w [Instant] {
        let at = |sample: usize| way.iter().position(|instant| instant.sample == Some(sample)).unwrap_or(0);
        &way[at(samples.start)..=at(samples.end - 1)]
    }
}

struct FeltAll {
    tool: Option<FoundTool>,
    touches: Vec<Touch>,
    found: Vec<FoundTouch>,
}

/// The marked samples that do not depend on how the arm moved before its track began.
fn settled(track: &Track, marked: &[bool]) -> Vec<bool> {
    let is_moving = track.velocity[0].iter().any(|velocity| velocity.abs() > RESTING_RAD_S);
    let from_s = if is_moving { FADED_S } else { -1.0 };
    marked.iter().zip(&track.time_s).map(|(is_marked, time_s)| *is_marked && *time_s > from_s).collect()
}
