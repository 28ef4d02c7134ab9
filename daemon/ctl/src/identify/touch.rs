//! Touches: stiffness along the normal, and the lag and the dead time with which the wrench shows it.

use admittance_core::belief::ImpactLink;
use admittance_runner::config::Config;
use nalgebra::{Vector1, Vector3};
use plant_sim::wrench_estimate::WrenchEstimate;
use serde::Serialize;

use super::estimate::Estimate;
use super::impact::{FirstInstants, Press};
use super::least_squares::{Fit, MOST_INFLATION, Problem, mean_square};
use super::way::Instant;

/// Stiffness (N/m), depth at which the surface begins (m), time constant and dead time of the wrench
/// (s), and what the wrench shows without a touch (N).
const PARAMETERS: usize = 5;
const DEAD_TIME: usize = 3;
/// How long before its first force, and after its last one, a touch is looked at, s.
pub(super) const AROUND_S: f64 = 0.08;
/// As far apart two touches are two, s.
const APART_S: f64 = 0.05;
/// The least force (N) that may be a touch, and how many deviations of the noise.
const LEAST_FORCE_N: f64 = 1.0;
const DEVIATIONS: f64 = 6.0;
/// A touch that is shorter tells nothing, samples.
const SHORTEST: usize = 8;
/// So long before its first force the arm has to be free, s: how deep it was pressing when a recording
/// began, nobody knows.
const LEAST_FREE_S: f64 = 0.02;
/// Where the search begins, s.
const TIME_CONSTANTS_S: [f64; 4] = [0.001, 0.006, 0.02, 0.06];
const DEAD_TIMES_S: [f64; 3] = [0.0, 0.002, 0.006];
/// Starts, best first, from which the search goes on.
const FITS: usize = 3;
/// Of a touch, the stretches that count as witnesses, s.
const BLOCK_S: f64 = 0.03;
/// No interval is narrower than this (s), or this part of a value: the way between samples is not exact.
const FINEST_S: f64 = 1e-5;
const FINEST: f64 = 1e-3;

/// Samples of a touch.
#[derive(Debug, Clone)]
pub(super) struct Touch {
    pub(super) track: usize,
    pub(super) samples: std::ops::Range<usize>,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct FoundTouch {
    pub(super) stiffness_n_m: Estimate,
    pub(super) time_constant_s: Estimate,
    pub(super) dead_time_s: Estimate,
    /// RMS of what the fit leaves, and the largest force, N.
    pub(super) residual_n: f64,
    pub(super) peak_n: f64,
    pub(super) is_told: bool,
    /// Time (s), measured and fitted force along the inward normal (N).
    #[serde(skip)]
    pub(super) curve: Vec<(f64, f64, f64)>,
    /// Where masses are told, and gears give.
    #[serde(skip)]
    pub(super) impact: Option<FirstInstants>,
}

/// Outward normal of the surface as it is told.
pub(super) fn normal(config: &Config) -> Vector3<f64> {
    Vector3::from(config.environment.surface_normal).normalize()
}

/// Where the forces along the inward normal (N) of a track's samples show a touch; NaN is none.
pub(super) fn touches(track: usize, time_s: &[f64], pressing: &[f64], noise_n: f64) -> Vec<Touch> {
    let least = LEAST_FORCE_N.max(DEVIATIONS * noise_n);
    let mut touches: Vec<Touch> = Vec::new();
    for sample in (0..time_s.len()).filter(|sample| pressing[*sample] > least) {
        match touches.last_mut().filter(|last| time_s[sample] - time_s[last.samples.end - 1] < APART_S) {
            Some(last) => last.samples.end = sample + 1,
            None => touches.push(Touch { track, samples: sample..sample + 1 }),
        }
    }
    touches.retain(|touch| touch.samples.len() >= SHORTEST);
    touches
}

/// Whether its beginning is in the track.
pub(super) fn is_whole(touch: &Touch, time_s: &[f64]) -> bool {
    time_s[touch.samples.start] - time_s[0] >= LEAST_FREE_S
}

/// The samples that are looked at.
pub(super) fn window(touch: &Touch, time_s: &[f64]) -> std::ops::Range<usize> {
    let (from_s, to_s) = (time_s[touch.samples.start] - AROUND_S, time_s[touch.samples.end - 1] + AROUND_S);
    time_s.partition_point(|time_s| *time_s < from_s)..time_s.partition_point(|time_s| *time_s <= to_s)
}

/// What the wrench shows of a surface at the samples of a way, N.
fn shown(way: &[Instant], depths_m: &[f64], values: &[f64; PARAMETERS]) -> Vec<f64> {
    let [stiffness, begins_m, lag, dead_time_s, offset] = *values;
    let mut estimate = WrenchEstimate::new(Vector1::new(lag));
    let mut step = None;
    let mut series = Vec::with_capacity(way.len());
    let mut last = (way[0].time_s, depths_m[0] - begins_m);
    series.push((last.0, 0.0));
    let mut advance = |length_s: f64, force: f64| {
        let known = step.filter(|(of, _): &(f64, _)| (of - length_s).abs() < 1e-12);
        let (_, prepared) = known.unwrap_or_else(|| (length_s, estimate.step(length_s)));
        step = Some((length_s, prepared));
        estimate.advance(&prepared, &Vector1::new(force));
        estimate.estimate()[0]
    };
    for (instant, depth) in way.iter().zip(depths_m).skip(1) {
        let (length_s, depth) = (instant.time_s - last.0, depth - begins_m);
        // The force bends where the surface begins.
        let share = last.1 / (last.1 - depth);
        let mut left_s = length_s;
        if (last.1 < 0.0) != (depth < 0.0) && share > 1e-6 && share < 1.0 - 1e-6 {
            advance(share * length_s, 0.0);
            left_s = (1.0 - share) * length_s;
        }
        series.push((instant.time_s, advance(left_s, stiffness * depth.max(0.0))));
        last = (instant.time_s, depth);
    }
    let delayed = |at_s: f64| {
        let next = series.partition_point(|(time_s, _)| *time_s <= at_s);
        match (next.checked_sub(1).map(|before| series[before]), series.get(next)) {
            (Some((from_s, before)), Some((to_s, after))) => {
                before + (after - before) * (at_s - from_s) / (to_s - from_s)
            }
            (Some((_, last)), None) => last,
            (None, _) => 0.0,
        }
    };
    way.iter().filter(|at| at.sample.is_some()).map(|at| offset + delayed(at.time_s - dead_time_s)).collect()
}

/// A touch by the arm's way through it, and the forces (N) along the inward normal of the way's samples; with
/// the link that an impact meets, where masses are told.
pub(super) fn touch(
    way: &[Instant],
    pressing: &[f64],
    normal: &Vector3<f64>,
    link: Option<&ImpactLink>,
) -> Option<FoundTouch> {
    let depths: Vec<f64> = way.iter().map(|instant| -normal.dot(&instant.position)).collect();
    let times: Vec<(f64, f64)> =
        way.iter().zip(&depths).filter(|(at, _)| at.sample.is_some()).map(|(at, depth)| (at.time_s, *depth)).collect();
    let usable: Vec<usize> = (0..pressing.len()).filter(|at| pressing[*at].is_finite()).collect();
    let peak = pressing.iter().copied().filter(|force| force.is_finite()).fold(0.0, f64::max);
    let (first_s, _) = *times.first()?;
    let blocks: Vec<usize> = usable.iter().map(|at| ((times[*at].0 - first_s) / BLOCK_S) as usize).collect();
    let residuals = |values: &[f64; PARAMETERS]| -> Vec<f64> {
        let shown = shown(way, &depths, values);
        usable.iter().map(|at| shown[*at] - pressing[*at]).collect()
    };
    let (stiffness, begins_m) = guess(&times, pressing, peak)?;
    let starts =
        TIME_CONSTANTS_S.into_iter().flat_map(|lag| DEAD_TIMES_S.map(|dead| [stiffness, begins_m, lag, dead, 0.0]));
    let mut starts: Vec<(f64, [f64; PARAMETERS])> =
        starts.map(|start| (mean_square(&residuals(&start)), start)).collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let fits = starts.into_iter().take(FITS).map(|(_, start)| {
        let problem = Problem {
            start,
            probe: probe(stiffness),
            least: bounds(begins_m)[0],
            most: bounds(begins_m)[1],
            residuals: &residuals,
            blocks: &blocks,
        };
        problem.solve()
    });
    let fit: Fit<PARAMETERS> = fits.min_by(|a, b| a.mean_square().total_cmp(&b.mean_square()))?;
    let fit = if fit.values[DEAD_TIME] < 0.0 { without_dead_time(&fit, begins_m, &residuals, &blocks) } else { fit };
    let of = |k: usize, finest: f64| Estimate::new(fit.values[k], fit.half_width[k]).doubted(finest);
    let fitted = shown(way, &depths, &fit.values);
    let [stiffness_n_m, begins_m, lag_s, dead_time_s, offset_n] = fit.values;
    let press = Press { stiffness_n_m, begins_m, lag_s, dead_time_s, offset_n };
    Some(FoundTouch {
        stiffness_n_m: of(0, FINEST * fit.values[0]),
        impact: link.and_then(|link| FirstInstants::of(way, pressing, normal, *link, press)),
        time_constant_s: of(2, FINEST_S),
        dead_time_s: of(DEAD_TIME, FINEST_S),
        residual_n: mean_square(&fit.residuals).sqrt(),
        peak_n: peak,
        is_told: fit.inflation[0] < MOST_INFLATION && fit.half_width[0] < 0.25 * fit.values[0],
        curve: times
            .iter()
            .zip(pressing)
            .zip(&fitted)
            .map(|((at, measured), fitted)| (at.0, *measured, *fitted))
            .collect(),
    })
}

/// The same beside a dead time of zero: no force is shown before it is there.
fn without_dead_time(
    free: &Fit<PARAMETERS>,
    begins_m: f64,
    residuals: &dyn Fn(&[f64; PARAMETERS]) -> Vec<f64>,
    blocks: &[usize],
) -> Fit<PARAMETERS> {
    const KEPT: [usize; 4] = [0, 1, 2, 4];
    let all = |kept: &[f64; 4]| {
        let mut all = [0.0; PARAMETERS];
        KEPT.iter().zip(kept).for_each(|(parameter, value)| all[*parameter] = *value);
        all
    };
    let held = Problem {
        start: KEPT.map(|k| free.values[k]),
        probe: KEPT.map(|k| probe(free.values[0])[k]),
        least: KEPT.map(|k| bounds(begins_m)[0][k]),
        most: KEPT.map(|k| bounds(begins_m)[1][k]),
        residuals: &|kept: &[f64; 4]| residuals(&all(kept)),
        blocks,
    };
    let held = held.solve();
    let mut fit = Fit { values: all(&held.values), residuals: held.residuals, ..free.clone() };
    for (k, parameter) in KEPT.into_iter().enumerate() {
        fit.half_width[parameter] = held.half_width[k];
    }
    fit
}

/// By how much the parameters are moved to see what they do.
fn probe(stiffness: f64) -> [f64; PARAMETERS] {
    [1e-4 * stiffness, 1e-8, 2e-6, 2e-6, 1e-3]
}

/// Least and most of the parameters, for a surface that begins about there.
fn bounds(begins_m: f64) -> [[f64; PARAMETERS]; 2] {
    [[100.0, begins_m - 0.05, 0.0, -0.005, -20.0], [1e8, begins_m + 0.05, 0.5, 0.1, 20.0]]
}

/// Stiffness (N/m) and depth of the surface (m) by the line of force over depth, of what presses
/// hard.
fn guess(times: &[(f64, f64)], pressing: &[f64], peak: f64) -> Option<(f64, f64)> {
    let hard = || times.iter().zip(pressing).filter(|(_, force)| **force > 0.3 * peak);
    let count = hard().count() as f64;
    if count < 3.0 {
        return None;
    }
    let (depth, force) = hard().fold((0.0, 0.0), |(depth, force), ((_, d), f)| (depth + d / count, force + f / count));
    let (square, product) =
        hard().fold((0.0, 0.0), |(s, p), ((_, d), f)| (s + (d - depth) * (d - depth), p + (d - depth) * (f - force)));
    let slope = product / square;
    let stiffness = if slope.is_finite() { slope.clamp(1e3, 1e7) } else { 1e5 };
    Some((stiffness, depth - force / stiffness))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_touch_that_a_recording_begins_in_is_not_whole() {
        let time_s: Vec<f64> = (0..400).map(|sample| f64::from(sample) * 0.001).collect();
        let mut pressing = vec![0.0; 400];
        pressing[..50].fill(30.0);
        pressing[200..260].fill(30.0);
        let touches = touches(0, &time_s, &pressing, 0.3);
        let whole: Vec<bool> = touches.iter().map(|touch| is_whole(touch, &time_s)).collect();
        assert_eq!(whole, [false, true]);
    }
}
