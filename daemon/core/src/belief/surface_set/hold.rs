//! While the tool presses: a Kalman filter over what f̂ shows, m, the stiffness k, θ = k c with the
//! contact depth c, and the slope of the surface along the path. The spring's force at depth x is
//! k x − θ: linear in what is not known.

use nalgebra::{SMatrix, SVector};

use super::Tuning;
use super::cell::{Range, Spring, roots};
use super::touch::Moments;
use crate::belief::way::Way;

const M: usize = 0;
const K: usize = 1;
const THETA: usize = 2;
const SLOPE: usize = 3;

/// How the contact depth drifts, m/√s, and m/√m of path: creep, warmth, roughness.
const DRIFT: f64 = 1e-5;
const ROUGHNESS: f64 = 1e-5;
/// How the stiffness changes along the path, as a part of it, 1/√m.
const OTHER_MATERIAL: f64 = 0.3;
/// Slope of the surface along the path against what was told, at first, and how it changes, 1/√m.
const SLOPE_AT_FIRST: f64 = 0.002;
const CURVING: f64 = 0.02;
/// Normalised innovations squared, smoothed over so many samples, above which something has
/// changed at once.
const SMOOTHED: f64 = 8.0;
const SUDDEN: f64 = 6.0;
/// What is then no longer known: this part of the stiffness, and so much of the depth in m.
const OPENED_STIFFNESS: f64 = 0.3;
const OPENED_DEPTH: f64 = 5e-5;

/// The stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hold {
    /// From which depths are counted, m: with them large, θ would lose digits.
    datum: f64,
    state: SVector<f64, 4>,
    covariance: SMatrix<f64, 4, 4>,
    innovation: f64,
    /// What f̂ was expected to show of the last sample, N.
    expected: f64,
    /// Time without a force of the likeliest surface, s.
    away: f64,
}

impl Hold {
    /// Goes on from what a touch has learned, where depths are counted from `datum` (m).
    pub(super) fn new(datum: f64, Moments { mean, covariance: known }: &Moments) -> Self {
        let mut covariance = SMatrix::<f64, 4, 4>::zeros();
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(known);
        covariance[(SLOPE, SLOPE)] = SLOPE_AT_FIRST * SLOPE_AT_FIRST;
        let state = SVector::<f64, 4>::new(mean[M], mean[K], mean[THETA], 0.0);
        Self { datum, state, covariance, innovation: 1.0, expected: mean[M], away: 0.0 }
    }

    /// On to a sample at the end of `way` that shows a pressing `force` (N).
    pub(super) fn follow(&mut self, way: &Way, force: f64, weight: f64, tuning: &Tuning) {
        self.predict(way, tuning);
        self.correct(force, weight, &tuning.range);
        let is_away = self.force_at(way.end()) <= 0.0;
        self.away = if is_away { self.away + way.duration() } else { 0.0 };
    }

    fn predict(&mut self, way: &Way, tuning: &Tuning) {
        let (mut left, mut response) = (1.0, 0.0);
        for piece in way.pieces() {
            let (decay, weights) = piece.weights(tuning.lag);
            left *= decay;
            let shown = weights.iter().zip(piece.depth).map(|(weight, x)| weight * (x - self.datum)).sum::<f64>();
            response = decay * response + shown;
        }
        let k = self.state[K];
        // Where the likeliest surface is not touched f̂ fades.
        let touches = if k * (way.end() - self.datum) > self.state[THETA] { 1.0 } else { 0.0 };
        let mut step = SMatrix::<f64, 4, 4>::identity();
        (step[(M, M)], step[(M, K)], step[(M, THETA)]) = (left, touches * response, -touches * (1.0 - left));
        step[(THETA, SLOPE)] = k * way.along;
        self.state = step * self.state;
        self.covariance = step * self.covariance * step.transpose();
        let (time, path) = (way.duration(), way.along);
        let depth = DRIFT * DRIFT * time + ROUGHNESS * ROUGHNESS * path;
        let stiffness = OTHER_MATERIAL * OTHER_MATERIAL * path * k * k;
        // Another stiffness about the point at which the tool presses, not about c = datum.
        let at = way.end() - self.datum;
        self.covariance[(THETA, THETA)] += k * k * depth + stiffness * at * at;
        self.covariance[(K, K)] += stiffness;
        self.covariance[(K, THETA)] += stiffness * at;
        self.covariance[(THETA, K)] += stiffness * at;
        self.covariance[(SLOPE, SLOPE)] += CURVING * CURVING * path;
    }

    fn correct(&mut self, force: f64, weight: f64, range: &Range) {
        let variance = self.covariance[(M, M)] + 1.0 / weight;
        self.expected = self.state[M];
        let error = force - self.state[M];
        let gain = self.covariance.column(M) / variance;
        self.state += gain * error;
        let row = self.covariance.row(M).into_owned();
        self.covariance -= gain * row;
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
        self.innovation += (error * error / variance - self.innovation) / SMOOTHED;
        if self.innovation > SUDDEN {
            let k = self.state[K];
            self.covariance[(K, K)] += OPENED_STIFFNESS * OPENED_STIFFNESS * k * k;
            self.covariance[(THETA, THETA)] += OPENED_DEPTH * OPENED_DEPTH * k * k;
            self.innovation = 1.0;
        }
        self.keep(range);
    }

    /// At the edge of the range the state moves along what is not known.
    fn keep(&mut self, range: &Range) {
        let k = self.state[K];
        let missing = k.clamp(range.least, range.most) - k;
        if missing != 0.0 && self.covariance[(K, K)] > 0.0 {
            let along = self.covariance.column(K) / self.covariance[(K, K)];
            self.state += along * missing;
            self.state[K] = k.clamp(range.least, range.most);
        }
    }

    /// The likeliest surface.
    pub(super) fn likeliest(&self) -> Spring {
        Spring { depth: self.datum + self.state[THETA] / self.state[K], stiffness: self.state[K] }
    }

    /// Standard deviation of the stiffness, N/m.
    pub(super) fn stiffness_deviation(&self) -> f64 {
        libm::sqrt(self.covariance[(K, K)].max(0.0))
    }

    /// What f̂ was expected to show of the last sample, N.
    pub(super) fn expected(&self) -> f64 {
        self.expected
    }

    /// For how long the likeliest surface does not touch, s.
    pub(super) fn away(&self) -> f64 {
        self.away
    }

    /// Force of the likeliest surface at a depth in N.
    fn force_at(&self, depth: f64) -> f64 {
        self.state[K] * (depth - self.datum) - self.state[THETA]
    }

    fn force_deviation(&self, depth: f64) -> f64 {
        let (x, p) = (depth - self.datum, &self.covariance);
        libm::sqrt((p[(K, K)] * x * x - 2.0 * p[(K, THETA)] * x + p[(THETA, THETA)]).max(0.0))
    }

    /// The greatest force in N at `depth` of a surface of the set.
    pub(super) fn strongest(&self, depth: f64, deviations: f64) -> f64 {
        self.force_at(depth) + deviations * self.force_deviation(depth)
    }

    /// How likely a surface is that presses with more than `force` (N) at `depth`.
    pub(super) fn share_above(&self, force: f64, depth: f64) -> f64 {
        super::normal::above(force - self.force_at(depth), self.force_deviation(depth))
    }

    /// The least and greatest depth at which a surface of the set presses with `force` (N):
    /// force = k x − θ ± z deviations. Stiffnesses out of the range are left out.
    pub(super) fn depths_of(&self, force: f64, deviations: f64, range: &Range) -> (f64, f64) {
        let (k, theta, p) = (self.state[K], self.state[THETA], &self.covariance);
        let z = deviations * deviations;
        let missing = force + theta;
        let likeliest = missing / k;
        let found = roots(
            k * k - z * p[(K, K)],
            -2.0 * k * missing + 2.0 * z * p[(K, THETA)],
            missing * missing - z * p[(THETA, THETA)],
        );
        let (mut least, mut most) = (likeliest, likeliest);
        let mut see = |x: f64| (least, most) = (least.min(x), most.max(x));
        for x in found.into_iter().flatten() {
            // The surface that has this force there has this stiffness.
            let spread = self.force_deviation(self.datum + x);
            let side = libm::copysign(deviations, missing - k * x);
            let stiffness = k + side * (p[(K, K)] * x - p[(K, THETA)]) / spread.max(f64::MIN_POSITIVE);
            if (range.least..=range.most).contains(&stiffness) {
                see(x);
            }
        }
        if p[(K, K)] > 0.0 {
            let by = p[(K, THETA)] / p[(K, K)];
            let beside = (p[(THETA, THETA)] - by * p[(K, THETA)]).max(0.0);
            for edge in [range.least, range.most] {
                let away = (edge - k) * (edge - k) / p[(K, K)];
                if away <= z {
                    let (middle, width) = (theta + by * (edge - k), libm::sqrt(beside * (z - away)));
                    see((force + middle - width) / edge);
                    see((force + middle + width) / edge);
                }
            }
        }
        (self.datum + least, self.datum + most)
    }
}
