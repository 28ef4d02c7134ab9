//! The first instants of touches: what the surface's stiffness is before gears give. A slow press shows
//! surface and gears in series.
//!
//! Masses and gears are those of a maker's sheet, and one mass stands for several links. So all touches are
//! fitted at once, with gears, mass and the lag of the wrench beside the stiffness, each as far off as it may be; and
//! the interval is that of the likelihood: every stiffness with which some of them explain the touches about as
//! well as the best. No straight line would do: a surface that is far harder than the gears shows much the same
//! as one that is harder still, so that the interval reaches much further up than down.

use admittance_core::belief::{ImpactLink, Swing};
use nalgebra::Vector3;
use serde::Serialize;

use super::least_squares::{Fit, Problem, correlation_time, mean_square};
use super::way::Instant;

/// What is looked at, before and after the touch, s.
const BEFORE_S: f64 = 0.01;
const AFTER_S: f64 = 0.03;
/// Hardest surface, N/m.
const HARDEST_N_M: f64 = 1e8;
/// From one stiffness that is tried to the next, of its logarithm.
const STEP: f64 = 0.1;
/// A surface that is harder by this is tried from the softest on: the press says what both are in series.
const LEAST_HARDER: f64 = 1.02;
/// Touches that are looked at: the longest.
const MOST_TOUCHES: usize = 4;
/// Logarithms of gears, mass and lag, then where the surface begins in each touch, m; all from what is told.
const PARAMETERS: usize = 3 + MOST_TOUCHES;
/// Standard deviations of them: a maker's sheet tells gears within a quarter; one mass stands for the links of an
/// arm, which are told within a tenth, to another tenth.
const DEVIATIONS: [f64; 3] = [0.114, 0.1, 0.05];
const BEGINS_M: f64 = 3e-4;
/// By how much a surface that hardens shows another stiffness in a slow press than in an impact, a standard deviation
/// of the logarithm.
const ANOTHER: f64 = 0.1;
/// As much a sum of squares may be above the least within the 95 % interval of one parameter (χ² of one degree).
const WITHIN: f64 = 3.84;
/// Where the search begins: what the fit leaves, N, and how many samples in a row it is the same.
const FIRST_LEFT_N: f64 = 1.0;
const FIRST_CORRELATION: f64 = 10.0;
const ROUNDS: usize = 3;
/// No fit leaves less, N.
const LEAST_LEFT_N: f64 = 1e-3;

/// What the slow press showed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Press {
    pub(super) stiffness_n_m: f64,
    pub(super) begins_m: f64,
    pub(super) lag_s: f64,
    pub(super) dead_time_s: f64,
    /// What the wrench shows without a touch, N.
    pub(super) offset_n: f64,
}

/// The first instants of a touch.
#[derive(Debug, Clone)]
pub(super) struct FirstInstants {
    /// Time (s) and depth of the motors (m) at each instant of the way.
    depths: Vec<(f64, f64)>,
    /// Time (s) and force along the inward normal (N) at each sample.
    shown: Vec<(f64, f64)>,
    link: ImpactLink,
    press: Press,
}

/// A value with its 95 % interval, which is wider on one side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Between {
    pub(super) value: f64,
    pub(super) least: f64,
    pub(super) most: f64,
}

impl Between {
    /// Whether some surface would be too hard to explain the touches.
    pub(super) fn has_an_end(&self) -> bool {
        self.most < HARDEST_N_M
    }
}

impl FirstInstants {
    /// By the arm's way and the force (N) along the inward normal at its samples, of a link as it is told.
    pub(super) fn of(
        way: &[Instant],
        pressing: &[f64],
        normal: &Vector3<f64>,
        link: ImpactLink,
        press: Press,
    ) -> Option<Self> {
        let depths = || way.iter().map(|instant| (instant.time_s, -normal.dot(&instant.position)));
        let (touch_s, _) = depths().find(|(_, depth)| *depth > press.begins_m)?;
        let near = |time_s: f64| (touch_s - BEFORE_S..touch_s + AFTER_S).contains(&time_s);
        let samples = way.iter().filter(|instant| instant.sample.is_some()).zip(pressing);
        let shown: Vec<(f64, f64)> = samples
            .filter(|(instant, force)| near(instant.time_s) && force.is_finite())
            .map(|(instant, force)| (instant.time_s, force - press.offset_n))
            .collect();
        let depths: Vec<(f64, f64)> = depths().filter(|(time_s, _)| near(*time_s)).collect();
        (!shown.is_empty()).then_some(Self { depths, shown, link, press })
    }

    /// What is left of each sample, N, on a surface of a stiffness in N/m.
    fn left(&self, stiffness_n_m: f64, [gears, mass, lag]: [f64; 3], begins_m: f64) -> Vec<f64> {
        let link = ImpactLink { mass: self.link.mass * mass.exp(), gears: self.link.gears * gears.exp() };
        let series = self.estimated(stiffness_n_m, &link, self.press.lag_s * lag.exp(), self.press.begins_m + begins_m);
        let at = |time_s: f64| {
            let after = series.partition_point(|(at_s, _)| *at_s < time_s);
            series.get(after).or(series.last()).map_or(0.0, |(_, force)| *force)
        };
        self.shown.iter().map(|(time_s, force)| at(time_s - self.press.dead_time_s) - force).collect()
    }

    /// What the wrench shows at each instant.
    fn estimated(&self, stiffness_n_m: f64, link: &ImpactLink, lag_s: f64, begins_m: f64) -> Vec<(f64, f64)> {
        let mut swing: Option<Swing> = None;
        let (mut estimate, mut force) = (0.0, 0.0);
        let mut series = Vec::with_capacity(self.depths.len());
        for pair in self.depths.windows(2) {
            let [(from_s, from), (to_s, to)] = [pair[0], pair[1]];
            let duration_s = to_s - from_s;
            match &mut swing {
                Some(swing) => swing.follow(to - from, duration_s),
                None if to > begins_m => {
                    let speed = (to - from) / duration_s;
                    let share = ((to - begins_m) / (to - from)).clamp(0.0, 1.0);
                    let mut touching = Swing::touching(link, stiffness_n_m, speed);
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
}

/// The touches, and how much what is left of each counts.
struct Touches<'a> {
    all: Vec<&'a FirstInstants>,
    /// Variance of what a fit leaves times how many samples in a row it is the same, N².
    variance: Vec<f64>,
}

impl Touches<'_> {
    fn left(&self, stiffness_n_m: f64, values: &[f64; PARAMETERS]) -> Vec<Vec<f64>> {
        let [gears, mass, lag, ..] = *values;
        let of = |(touch, begins_m): (&&FirstInstants, &f64)| touch.left(stiffness_n_m, [gears, mass, lag], *begins_m);
        self.all.iter().zip(&values[3..]).map(of).collect()
    }

    /// The best of all else on a surface of a stiffness in N/m.
    fn fit(&self, stiffness_n_m: f64, start: [f64; PARAMETERS]) -> Fit<PARAMETERS> {
        let residuals = |values: &[f64; PARAMETERS]| -> Vec<f64> {
            let mut all = Vec::new();
            for (left, variance) in self.left(stiffness_n_m, values).into_iter().zip(&self.variance) {
                let size = variance.sqrt();
                all.extend(left.into_iter().map(|left| left / size));
            }
            for (touch, _) in self.all.iter().zip(&self.variance) {
                let link = ImpactLink { gears: touch.link.gears * values[0].exp(), ..touch.link };
                let by_all = ANOTHER * (self.all.len() as f64).sqrt();
                all.push((link.pressed(stiffness_n_m) / touch.press.stiffness_n_m).ln() / by_all);
            }
            all.extend(DEVIATIONS.iter().zip(values).map(|(deviation, value)| value / deviation));
            all.extend(values[DEVIATIONS.len()..].iter().map(|begins_m| begins_m / BEGINS_M));
            all
        };
        let blocks = vec![0; residuals(&start).len()];
        let each =
            |first: f64, begins_m: f64| std::array::from_fn(|k| if k < DEVIATIONS.len() { first } else { begins_m });
        let problem = Problem {
            start,
            probe: each(1e-3, 1e-7),
            least: each(-1.0, -0.003),
            most: each(1.0, 0.003),
            residuals: &residuals,
            blocks: &blocks,
        };
        problem.solve()
    }

    /// Stiffnesses (N/m) from the softest to the hardest that there may be, each with its best fit.
    fn fits(&self, softest_n_m: f64) -> Vec<(f64, Fit<PARAMETERS>)> {
        let count = ((HARDEST_N_M / softest_n_m).ln() / STEP).ceil().max(1.0) as usize;
        let stiffness = |of: usize| (softest_n_m * (of as f64 * STEP).exp()).min(HARDEST_N_M);
        // From both ends on, since a fit may stay in a valley that the other does not enter.
        let mut all: Vec<(f64, Fit<PARAMETERS>)> = Vec::new();
        let mut start = [0.0; PARAMETERS];
        for of in 0..=count {
            let fit = self.fit(stiffness(of), start);
            start = fit.values;
            all.push((stiffness(of), fit));
        }
        for (stiffness_n_m, best) in all.iter_mut().rev() {
            let fit = self.fit(*stiffness_n_m, start);
            start = fit.values;
            if sum(&fit) < sum(best) {
                *best = fit;
            }
        }
        all
    }
}

/// Sum of squares.
fn sum(fit: &Fit<PARAMETERS>) -> f64 {
    fit.mean_square() * fit.residuals.len() as f64
}

/// The stiffness in an impact, by the first instants of touches; `None` without any.
pub(super) fn stiffness<'a>(touches: impl Iterator<Item = &'a FirstInstants>) -> Option<Between> {
    let all: Vec<&FirstInstants> = touches.take(MOST_TOUCHES).collect();
    let count = all.len() as f64;
    let pressed = (all.iter().map(|touch| touch.press.stiffness_n_m.ln()).sum::<f64>() / count).exp();
    if all.is_empty() || !pressed.is_finite() {
        return None;
    }
    let variance = vec![FIRST_LEFT_N * FIRST_LEFT_N * FIRST_CORRELATION; all.len()];
    let mut touches = Touches { all, variance };
    let mut fits = touches.fits(LEAST_HARDER * pressed);
    let best = |fits: &[(f64, Fit<PARAMETERS>)]| {
        let (stiffness_n_m, fit) = fits.iter().min_by(|a, b| sum(&a.1).total_cmp(&sum(&b.1)))?;
        Some((*stiffness_n_m, fit.values))
    };
    for _ in 1..ROUNDS {
        let (stiffness_n_m, values) = best(&fits)?;
        let left = touches.left(stiffness_n_m, &values);
        touches.variance = left.iter().map(|left| worth(left, 1.0 + (3.0 + 1.0) / count)).collect();
        fits = touches.fits(LEAST_HARDER * pressed);
    }
    let (value, _) = best(&fits)?;
    let least_sum = fits.iter().map(|(_, fit)| sum(fit)).fold(f64::INFINITY, f64::min);
    let within = || fits.iter().filter(|(_, fit)| sum(fit) <= least_sum + WITHIN).map(|(stiffness, _)| *stiffness);
    // What is tried next is out of it.
    let (step, least) = (STEP.exp(), within().fold(f64::INFINITY, f64::min));
    let most = within().fold(0.0, f64::max);
    Some(Between { value, least: least / step, most: (most * step).min(HARDEST_N_M) })
}

/// Variance of what a fit of so many parameters leaves, times how many samples in a row it is the same, N².
fn worth(left: &[f64], parameters: f64) -> f64 {
    let samples = left.len() as f64;
    let effective = samples / correlation_time(left);
    mean_square(left).max(LEAST_LEFT_N * LEAST_LEFT_N) * samples / (effective - parameters).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAG_S: f64 = 0.02;
    const LINK: ImpactLink = ImpactLink { mass: 5.0, gears: 6e4 };

    /// A touch of motors that come at a speed in m/s and stop, with the noise of a sample every 2 ms in N, as of a link that
    /// is told so many times as heavy and as stiff.
    fn touch(
        surface_n_m: f64,
        speed_m_s: f64,
        noise_n: &mut impl FnMut() -> f64,
        [mass, gears]: [f64; 2],
    ) -> FirstInstants {
        let at = |time_s: f64| {
            let since_s = (time_s - 0.01).max(0.0);
            if time_s < 0.01 { speed_m_s * (time_s - 0.01) } else { speed_m_s * 0.01 * -(-since_s / 0.01).exp_m1() }
        };
        let depths: Vec<(f64, f64)> =
            (0..=80).map(|of| f64::from(of) * 0.0005).map(|time_s| (time_s, at(time_s))).collect();
        let press = Press {
            stiffness_n_m: LINK.pressed(surface_n_m),
            begins_m: 0.0,
            lag_s: LAG_S,
            dead_time_s: 0.0,
            offset_n: 0.0,
        };
        let shown: Vec<(f64, f64)> = (0..=20).map(|of| (f64::from(of) * 0.002, 0.0)).collect();
        let mut touch = FirstInstants { depths, shown, link: LINK, press };
        let truth: Vec<f64> = touch.left(surface_n_m, [0.0; 3], 0.0);
        touch.shown.iter_mut().zip(truth).for_each(|(shown, truth)| shown.1 = truth + noise_n());
        touch.link = ImpactLink { mass: mass * LINK.mass, gears: gears * LINK.gears };
        touch
    }

    fn normal_numbers(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            (0..12).fold(-6.0, |sum, _| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                sum + (state >> 11) as f64 / (1_u64 << 53) as f64
            })
        }
    }

    #[test]
    fn the_interval_holds_a_surface_whose_gears_and_masses_are_told_as_a_maker_s_sheet_does() {
        let (mut held, mut all) = (0, 0);
        for surface_n_m in [3e4, 1e5, 4e5, 1e6] {
            for (seed, told) in [[1.0, 1.0], [1.1, 0.8], [0.9, 1.25], [1.1, 1.25], [0.9, 0.8]].into_iter().enumerate() {
                let mut noise = normal_numbers(17 + seed as u64);
                let mut noise_n = move || 0.3 * noise();
                let touches = [0.04, 0.06, 0.08].map(|speed| touch(surface_n_m, speed, &mut noise_n, told));
                let found = stiffness(touches.iter()).expect("three touches");
                println!("{surface_n_m:.1e} N/m, told {told:?}: {found:?}");
                let holds = (found.least..=found.most).contains(&surface_n_m);
                (all, held) = (all + 1, held + u32::from(holds));
                // Softer than its gears, it is the surface that gives.
                let is_soft = surface_n_m < LINK.gears;
                assert!(
                    !is_soft || found.has_an_end() && found.most < 3.0 * surface_n_m,
                    "no wider than needed: {found:?}"
                );
            }
        }
        assert!(held >= 19 && all == 20, "{held} of {all} hold the truth");
    }
}
