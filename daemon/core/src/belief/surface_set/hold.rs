//! While the tool presses: a Kalman filter over what f̂ shows, m, the stiffness k, θ = k c with the
//! contact depth c, the slope of the surface along the path, and how that bends. The spring's force
//! at depth x is k x − θ: linear in what is not known.
//!
//! Slope and bend are along the heading: at first the direction in which the tool got 10 µm along the
//! surface, and then that of every further 0.2 mm. Where the normal is learned the slope goes over
//! into it cycle by cycle, with the tilt across the path that the direction of the force shows (`tilt`).

use nalgebra::{SMatrix, SVector, Vector3};

use super::Tuning;
use super::cell::{Range, Spring, roots};
use super::tilt::Tilt;
use super::touch::Moments;
use crate::belief::way::Way;

const M: usize = 0;
const K: usize = 1;
const THETA: usize = 2;
const SLOPE: usize = 3;
const BEND: usize = 4;
const STATES: usize = 5;

/// How the contact depth drifts, m/√s, and m/√m of path: creep, warmth, roughness.
const DRIFT: f64 = 1e-5;
const ROUGHNESS: f64 = 1e-5;
/// How the stiffness changes along the path, as a part of it, 1/√m.
const OTHER_MATERIAL: f64 = 0.3;
/// How the slope of the surface along the path changes, 1/√m.
const CURVING: f64 = 0.02;
/// Where the normal is learned, what curves it: one deviation at first, rad/m, and how that changes,
/// rad/m/√m.
const BENT: f64 = 5.0;
const BENDING: f64 = 1.0;
/// Normalised innovations squared, smoothed over so many samples, above which something has
/// changed at once.
const SMOOTHED: f64 = 8.0;
const SUDDEN: f64 = 6.0;
/// What is then no longer known: this part of the stiffness, and so much of the depth in m.
const OPENED_STIFFNESS: f64 = 0.3;
const OPENED_DEPTH: f64 = 5e-5;
/// The same part of what was not known of the slope at first.
const OPENED_SLOPE: f64 = 0.3;
/// A way along the surface that has a direction, m: at first, and where the path turns. In a single
/// cycle noise of the joints has one too.
const BEGINS: f64 = 1e-5;
const TURNS: f64 = 2e-4;

/// The stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hold {
    /// From which depths are counted, m: with them large, θ would lose digits.
    datum: f64,
    /// Which way the slope is counted, base frame; zero until the tool slides.
    heading: Vector3<f64>,
    /// The way since it was found, base frame, m.
    pending: Vector3<f64>,
    /// The heading as f̂ shows it, a lag later, of any length.
    dragged: Vector3<f64>,
    /// Tilt across the path that is not counted in the normal yet, base frame.
    across: Vector3<f64>,
    state: SVector<f64, STATES>,
    covariance: SMatrix<f64, STATES, STATES>,
    innovation: f64,
    /// By how much f̂ of the last sample was another one than expected, N, and the variance of that, N².
    error: (f64, f64),
    /// What f̂ was expected to show of the last sample, N.
    expected: f64,
    /// Time without a force of the likeliest surface, s.
    away: f64,
}

/// How the state goes on along the path: x' = F x.
struct Transition {
    /// What m becomes of m, k and θ.
    shown: [f64; 3],
    /// k, with which a slope becomes θ, N/m.
    stiffness: f64,
    /// Length of the path, m.
    path: f64,
}

impl Transition {
    /// F times a state, or times the columns of a covariance; of F, which is nearly empty, only what
    /// there is.
    fn of<const C: usize>(&self, columns: &SMatrix<f64, STATES, C>) -> SMatrix<f64, STATES, C> {
        let (mut next, [m, k, theta]) = (*columns, self.shown);
        let (by_slope, by_bend) = (self.stiffness * self.path, 0.5 * self.stiffness * self.path * self.path);
        for column in 0..C {
            let at = |row: usize| columns[(row, column)];
            next[(M, column)] = m * at(M) + k * at(K) + theta * at(THETA);
            next[(THETA, column)] = at(THETA) + by_slope * at(SLOPE) + by_bend * at(BEND);
            next[(SLOPE, column)] = at(SLOPE) + self.path * at(BEND);
        }
        next
    }
}

impl Hold {
    /// Goes on from what a touch has learned, where depths are counted from `datum` (m), and by so
    /// much (N/m, N) wrongly where the surface has a slope of 1.
    pub(super) fn new(
        datum: f64,
        Moments { mean, covariance: known }: &Moments,
        (k, theta): (f64, f64),
        tuning: &Tuning,
    ) -> Self {
        let by_slope = SVector::<f64, STATES>::new(0.0, k, theta, 1.0, 0.0);
        let mut covariance = by_slope * by_slope.transpose() * (tuning.slope * tuning.slope);
        let mut told = covariance.fixed_view_mut::<3, 3>(0, 0);
        told += known;
        if tuning.learns_normal() {
            covariance[(BEND, BEND)] = BENT * BENT;
        }
        let state = SVector::<f64, STATES>::new(mean[M], mean[K], mean[THETA], 0.0, 0.0);
        Self {
            datum,
            heading: Vector3::zeros(),
            pending: Vector3::zeros(),
            dragged: Vector3::zeros(),
            across: Vector3::zeros(),
            state,
            covariance,
            innovation: 1.0,
            error: (0.0, 1.0),
            expected: mean[M],
            away: 0.0,
        }
    }

    /// On to a sample at the end of `way` that shows a pressing `force` (N) and one along the surface,
    /// base frame.
    pub(super) fn follow(
        &mut self,
        way: &Way,
        (force, beside): (f64, &Vector3<f64>),
        weight: f64,
        (tuning, tilt): (&Tuning, &Tilt),
    ) {
        let learns = tuning.learns_normal();
        let path = self.heading.dot(&way.beside);
        self.predict(way, path, tuning);
        let along = if learns { self.heading.dot(beside) } else { 0.0 };
        self.correct(force, along, weight, tuning);
        if learns {
            self.keep_slope(tilt.slopes(&self.heading, force, along, tuning), &tuning.range);
            let left = if tuning.lag > 0.0 { libm::exp(-way.duration() / tuning.lag) } else { 0.0 };
            self.dragged = self.heading + (self.dragged - self.heading) * left;
            let dragged = self.dragged.try_normalize(f64::MIN_POSITIVE).unwrap_or(self.heading);
            self.across = tilt.across(&dragged, way, (force, beside), tuning);
            // From now on the pressing force is that along the normal with this in it.
            self.expected -= self.tilt().dot(beside);
        }
        let is_away = self.force_at(way.end()) <= 0.0;
        self.away = if is_away { self.away + way.duration() } else { 0.0 };
    }

    /// The way went on along the surface; returns the length of the path that it is, m. The slope is
    /// that along the path: in another direction less is known of it.
    pub(super) fn turn(&mut self, beside: &Vector3<f64>, tuning: &Tuning) -> f64 {
        self.pending += beside;
        let along = self.pending.norm();
        let is_first = self.heading == Vector3::zeros();
        if along < if is_first { BEGINS } else { TURNS } {
            return 0.0;
        }
        let heading = self.pending / along;
        if is_first {
            self.dragged = heading;
        } else {
            let kept = self.heading.dot(&heading);
            self.state[SLOPE] *= kept;
            self.covariance.row_mut(SLOPE).scale_mut(kept);
            self.covariance.column_mut(SLOPE).scale_mut(kept);
            self.state[BEND] *= kept * kept;
            self.covariance.row_mut(BEND).scale_mut(kept * kept);
            self.covariance.column_mut(BEND).scale_mut(kept * kept);
            let lost = (1.0 - kept * kept).max(0.0);
            self.covariance[(SLOPE, SLOPE)] += lost * tuning.slope * tuning.slope;
            if tuning.learns_normal() {
                self.covariance[(BEND, BEND)] += lost * BENT * BENT;
            }
        }
        (self.heading, self.pending) = (heading, Vector3::zeros());
        along
    }

    fn tilt(&self) -> Vector3<f64> {
        self.heading * self.state[SLOPE] + self.across
    }

    /// What the surface is tilted by against the normal along which depths are counted, as a vector
    /// along it: from now on it is counted in the normal.
    pub(super) fn take_tilt(&mut self) -> Vector3<f64> {
        let tilt = self.tilt();
        (self.state[SLOPE], self.across) = (0.0, Vector3::zeros());
        tilt
    }

    /// How fast the surface falls away from a tool that moves with this velocity along it (m/s, base frame), m/s:
    /// by a slope that is not counted in the normal.
    pub(super) fn falling_away(&self, along: &Vector3<f64>) -> f64 {
        self.state[SLOPE] * self.heading.dot(along)
    }

    /// How fast the normal turns along the path, rad/m: above zero the surface falls away.
    pub(super) fn bend(&self) -> f64 {
        self.state[BEND]
    }

    /// Counts depths from elsewhere: each is `shift` m more from now on.
    pub(super) fn shift(&mut self, shift: f64) {
        self.datum += shift;
    }

    /// On to the end of a way, `path` m of it in the direction of the slope.
    fn predict(&mut self, way: &Way, path: f64, tuning: &Tuning) {
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
        let shown = [left, touches * response, -touches * (1.0 - left)];
        self.go(&Transition { shown, stiffness: k, path });
        let (time, path) = (way.duration(), path.abs());
        let depth = DRIFT * DRIFT * time + ROUGHNESS * ROUGHNESS * path;
        let stiffness = OTHER_MATERIAL * OTHER_MATERIAL * path * k * k;
        // Another stiffness about the point at which the tool presses, not about c = datum.
        let at = way.end() - self.datum;
        self.covariance[(THETA, THETA)] += k * k * depth + stiffness * at * at;
        self.covariance[(K, K)] += stiffness;
        self.covariance[(K, THETA)] += stiffness * at;
        self.covariance[(THETA, K)] += stiffness * at;
        self.covariance[(SLOPE, SLOPE)] += CURVING * CURVING * path;
        if tuning.learns_normal() {
            self.covariance[(BEND, BEND)] += BENDING * BENDING * path;
        }
    }

    /// Of a force `beside` along the path, friction, a slope shows a part in what is taken for the
    /// pressing one: −(n + s t)ᵀf is m, and so −nᵀf = m + s tᵀf.
    fn correct(&mut self, force: f64, beside: f64, weight: f64, tuning: &Tuning) {
        let row = self.covariance.row(M) + self.covariance.row(SLOPE) * beside;
        let variance = row[M] + row[SLOPE] * beside + 1.0 / weight;
        self.expected = self.state[M] + self.state[SLOPE] * beside;
        let error = force - self.expected;
        let gain = (self.covariance.column(M) + self.covariance.column(SLOPE) * beside) / variance;
        self.state += gain * error;
        self.covariance -= gain * row;
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
        self.error = (error, variance);
        self.innovation += (error * error / variance - self.innovation) / SMOOTHED;
        if self.innovation > SUDDEN {
            let k = self.state[K];
            self.covariance[(K, K)] += OPENED_STIFFNESS * OPENED_STIFFNESS * k * k;
            self.covariance[(THETA, THETA)] += OPENED_DEPTH * OPENED_DEPTH * k * k;
            if tuning.learns_normal() {
                self.covariance[(SLOPE, SLOPE)] += OPENED_SLOPE * OPENED_SLOPE * tuning.slope * tuning.slope;
            }
            self.innovation = 1.0;
        }
        self.keep(&tuning.range);
    }

    /// At the edge of the range the state moves along what is not known.
    pub(super) fn keep(&mut self, range: &Range) {
        let k = self.state[K];
        let missing = k.clamp(range.least, range.most) - k;
        if missing != 0.0 && self.covariance[(K, K)] > 0.0 {
            let along = self.covariance.column(K) / self.covariance[(K, K)];
            self.state += along * missing;
            self.state[K] = k.clamp(range.least, range.most);
        }
    }

    /// A slope that can't be is moved along what is not known to the next that can. A stiffness that
    /// this would make impossible is not believed for it.
    fn keep_slope(&mut self, (least, most): (f64, f64), range: &Range) {
        let slope = self.state[SLOPE];
        let missing = slope.max(least).min(most) - slope;
        if missing != 0.0 && self.covariance[(SLOPE, SLOPE)] > 0.0 {
            self.state += self.covariance.column(SLOPE) * (missing / self.covariance[(SLOPE, SLOPE)]);
            self.state[K] = self.state[K].clamp(range.least, range.most);
        }
    }

    /// The same where the tool will be after a path of this length (m) along the surface: what is not
    /// known of its slope is not known of its depth there.
    pub(super) fn ahead(&self, path: f64) -> Self {
        let mut ahead = *self;
        ahead.go(&Transition { shown: [1.0, 0.0, 0.0], stiffness: self.state[K], path });
        ahead
    }

    fn go(&mut self, transition: &Transition) {
        self.state = transition.of(&self.state);
        let rows = transition.of(&self.covariance);
        self.covariance = transition.of(&rows.transpose()).transpose();
    }

    /// The likeliest surface.
    pub(super) fn likeliest(&self) -> Spring {
        Spring { depth: self.datum + self.state[THETA] / self.state[K], stiffness: self.state[K] }
    }

    /// Standard deviation of the stiffness, N/m.
    pub(super) fn stiffness_deviation(&self) -> f64 {
        libm::sqrt(self.covariance[(K, K)].max(0.0))
    }

    /// −2 times the logarithm of the likelihood of the last sample.
    pub(super) fn surprise(&self) -> f64 {
        let (error, variance) = self.error;
        error * error / variance + libm::log(variance)
    }

    /// By how much the errors are larger than was told, as a factor of variances.
    pub(super) fn scale(&self) -> f64 {
        self.innovation.max(1.0)
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
