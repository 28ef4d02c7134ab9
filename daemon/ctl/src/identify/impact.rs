//! The first instants of a touch: what the surface's stiffness is before gears give. A slow press shows
//! surface and gears in series.

use admittance_core::belief::{ImpactLink, Swing};
use nalgebra::Vector3;

use super::estimate::Estimate;
use super::least_squares::{Fit, Problem};
use super::way::Instant;

/// Logarithm of the stiffness, depth at which the surface begins (m), lag of the wrench (s).
const PARAMETERS: usize = 3;
/// What is looked at, before and after the touch, s.
const BEFORE_S: f64 = 0.01;
const AFTER_S: f64 = 0.03;
/// Where the search begins, as multiples of what the slow press shows.
const STARTS: [f64; 5] = [1.0, 2.5, 6.0, 16.0, 40.0];
/// Hardest surface, N/m.
const HARDEST_N_M: f64 = 1e8;
/// Of the touch, the stretches that count as witnesses, s.
const BLOCK_S: f64 = 0.004;

/// What the slow press showed.
pub(super) struct Press {
    pub(super) stiffness_n_m: f64,
    pub(super) begins_m: f64,
    pub(super) lag_s: f64,
    pub(super) dead_time_s: f64,
}

/// The stiffness in an impact with this link, by the arm's way and the force (N) along the inward normal at
/// its samples. `None` where the touch does not show it.
pub(super) fn stiffness(
    way: &[Instant],
    pressing: &[f64],
    normal: &Vector3<f64>,
    link: &ImpactLink,
    press: &Press,
) -> Option<Estimate> {
    let depths: Vec<(f64, f64)> = way.iter().map(|instant| (instant.time_s, -normal.dot(&instant.position))).collect();
    let touch_s = depths.iter().find(|(_, depth)| *depth > press.begins_m)?.0;
    let near = |time_s: f64| (touch_s - BEFORE_S..touch_s + AFTER_S).contains(&time_s);
    let samples = way.iter().filter(|instant| instant.sample.is_some()).zip(pressing);
    let shown: Vec<(f64, f64)> = samples
        .filter(|(instant, force)| near(instant.time_s) && force.is_finite())
        .map(|(instant, force)| (instant.time_s, *force))
        .collect();
    let depths: Vec<(f64, f64)> = depths.into_iter().filter(|(time_s, _)| near(*time_s)).collect();
    let residuals = |values: &[f64; PARAMETERS]| -> Vec<f64> {
        let series = estimated(&depths, values, link);
        let at = |time_s: f64| {
            let after = series.partition_point(|(at_s, _)| *at_s < time_s);
            series.get(after).or(series.last()).map_or(0.0, |(_, force)| *force)
        };
        shown.iter().map(|(time_s, force)| at(time_s - press.dead_time_s) - force).collect()
    };
    let blocks: Vec<usize> =
        shown.iter().map(|(time_s, _)| ((time_s - touch_s + BEFORE_S) / BLOCK_S).max(0.0) as usize).collect();
    let fits = STARTS.map(|factor| {
        let problem = Problem {
            start: [(press.stiffness_n_m * factor).ln(), press.begins_m, press.lag_s],
            probe: [0.01, 1e-6, 1e-5],
            least: [press.stiffness_n_m.ln() - 0.7, press.begins_m - 0.003, 0.0],
            most: [HARDEST_N_M.ln(), press.begins_m + 0.003, 0.5],
            residuals: &residuals,
            blocks: &blocks,
        };
        problem.solve()
    });
    let best: Fit<PARAMETERS> = fits.into_iter().min_by(|a, b| a.mean_square().total_cmp(&b.mean_square()))?;
    let value = best.values[0].exp();
    Some(Estimate::new(value, value * best.half_width[0]))
}

/// What the wrench shows at each instant.
fn estimated(depths: &[(f64, f64)], values: &[f64; PARAMETERS], link: &ImpactLink) -> Vec<(f64, f64)> {
    let [logarithm, begins_m, lag_s] = *values;
    let mut swing: Option<Swing> = None;
    let (mut estimate, mut force) = (0.0, 0.0);
    let mut series = Vec::with_capacity(depths.len());
    for pair in depths.windows(2) {
        let [(from_s, from), (to_s, to)] = [pair[0], pair[1]];
        let duration_s = to_s - from_s;
        match &mut swing {
            Some(swing) => swing.follow(to - from, duration_s),
            None if to > begins_m => {
                let speed = (to - from) / duration_s;
                let share = ((to - begins_m) / (to - from)).clamp(0.0, 1.0);
                let mut touching = Swing::touching(link, logarithm.exp(), speed);
                touching.follow(to - begins_m, share * duration_s);
                swing = Some(touching);
            }
            None => {}
        }
        let before = std::mem::replace(&mut force, swing.as_ref().map_or(0.0, Swing::force));
        let left = if lag_s > 0.0 { (-duration_s / lag_s).exp() } else { 0.0 };
        let middle = 0.5 * (before + force);
        estimate = middle + (estimate - middle) * left;
        series.push((to_s, estimate));
    }
    series
}
