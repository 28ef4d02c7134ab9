//! What is believed of a surface of which only a range of stiffness is told: the set of all
//! (stiffness k, contact depth c) that fit the samples.
//!
//! Everything is along the inward normal. At depth x the spring presses with F = k (x − c)₊; f̂ shows
//! it through the lag (6), f = lag(F), with an error of variance 1/w = σ² + 0.1² + (0.005 f)²: the
//! noise that is told, and a floor for what no model knows.
//!
//! | stage | what is known | file |
//! |---|---|---|
//! | touch | cells between contact depths on the way just travelled, each a least squares | `touch`, `bank`, `cell` |
//! | hold | a Kalman filter over (m, k, θ = k c, slope) | `hold` |
//!
//! Touch goes over to hold 20 ms and a lag of f̂ after it was noticed; contact lost for 8 ms leads back, with what
//! is known of k, for one second.
//!
//! The set of z deviations is {cost ≤ least + z² · max(1, least / (n − 2))}. On a plane all rows of
//! the force are one row in depth, so that a set costs no row: what the law asks for are the depths
//! at which the surfaces of the set press with some force, [`SurfaceSet::depths_of`].

mod bank;
mod cell;
mod hold;
mod normal;
mod touch;

pub(crate) use cell::Spring;

use super::way::Way;
use cell::Range;
use hold::Hold;
use touch::Touch;

/// Error of the force that no noise explains: in N, and as a part of the force.
const FLOOR: f64 = 0.1;
const FLOOR_PART: f64 = 0.005;
/// The same of what f̂ still shows of a contact before.
const FADING_PART: f64 = 0.2;
/// How long a touch takes from when it was noticed beyond the lag of f̂, s.
const TOUCH: f64 = 0.020;
/// Contact is lost when nothing has touched for so long, s.
const LOST: f64 = 0.008;
/// For so long the stiffness of a lost contact is remembered, s, within so many deviations and at
/// least this part.
const REMEMBERED: f64 = 1.0;
const REMEMBERED_DEVIATIONS: f64 = 4.0;
const REMEMBERED_PART: f64 = 0.1;

/// What is told of a surface that is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Least and greatest stiffness along the normal, N/m.
    pub stiffness: (f64, f64),
    /// By how much the contact point may be deeper or less deep than the configured one, m; `None`
    /// where it may be anywhere.
    pub depth_tolerance: Option<f64>,
    /// From which share of surfaces on that can't be kept below the limit to stop.
    pub risk: f64,
}

/// What does not change.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Tuning {
    /// T_est in s.
    lag: f64,
    range: Range,
    /// Between which depths the surface begins, m.
    depths: (f64, f64),
    /// How far the tool gets into the softest surface until β, m.
    felt_after: f64,
    /// Standard deviation of f̂, N.
    noise: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "there is no heap to put the larger one on, and one alone lives")]
enum Stage {
    Touch(Touch),
    Hold(Hold),
}

/// The set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfaceSet {
    tuning: Tuning,
    told: Range,
    stage: Stage,
    /// How long what is known of a lost contact's stiffness still holds, s.
    remembered: f64,
    /// Whether the surface is harder than any that was told.
    is_outside: bool,
    /// What f̂ still shows of a contact before, N.
    fading: f64,
    /// A surface that begins here, for a force that no surface explains yet.
    unexplained: Spring,
    /// Greatest depth since the sample before, m.
    deepest: f64,
    risk: f64,
}

impl SurfaceSet {
    /// Nothing seen. `lag` is T_est in s, `noise` the standard deviation of f̂ in N, `felt` the
    /// pressing force from which on it is felt in N, `depth` the configured contact depth in m.
    pub(crate) fn new(prior: &Prior, lag: f64, noise: f64, felt: f64, depth: f64) -> Self {
        let (least, most) = prior.stiffness;
        let told = Range { least, most };
        let tolerance = prior.depth_tolerance.unwrap_or(f64::INFINITY);
        let depths = (depth - tolerance, depth + tolerance);
        Self {
            tuning: Tuning { lag, range: told, depths, felt_after: felt / least, noise },
            told,
            stage: Stage::Touch(Touch::new()),
            remembered: 0.0,
            is_outside: false,
            fading: 0.0,
            unexplained: Spring { depth: 0.0, stiffness: least },
            deepest: f64::NEG_INFINITY,
            risk: prior.risk,
        }
    }

    /// Takes over what `old` knows, where it was told the same.
    pub(crate) fn take_over(&mut self, old: &Self) {
        if self.told == old.told && self.tuning.lag == old.tuning.lag {
            let tuning = Tuning { noise: self.tuning.noise, ..old.tuning };
            *self = Self { tuning, risk: self.risk, ..*old };
        }
    }

    /// Forgets the surface, but for what was told.
    pub(crate) fn forget(&mut self) {
        self.stage = Stage::Touch(Touch::new());
        (self.tuning.range, self.remembered, self.fading) = (self.told, 0.0, 0.0);
        (self.is_outside, self.deepest) = (false, f64::NEG_INFINITY);
    }

    /// On to a sample at `depth` (m) that shows a pressing `force` (N). Without a `way` from the
    /// sample before, everything begins anew.
    pub(crate) fn follow(&mut self, way: Option<&Way>, depth: f64, force: f64, in_contact: bool) {
        let Some(way) = way else {
            self.forget();
            return;
        };
        self.deepest = way.deepest();
        let time = way.duration();
        self.fading *= if self.tuning.lag > 0.0 { libm::exp(-time / self.tuning.lag) } else { 0.0 };
        self.remembered = (self.remembered - time).max(0.0);
        if self.remembered == 0.0 && !self.is_outside {
            self.tuning.range = self.told;
        }
        let noise = self.tuning.noise;
        let (by_force, by_fading) = (FLOOR_PART * force, FADING_PART * self.fading);
        let weight = 1.0 / (noise * noise + FLOOR * FLOOR + by_force * by_force + by_fading * by_fading);
        let force = force - self.fading;
        self.unexplained = Spring { depth: depth - force.max(0.0) / self.told.least, stiffness: self.told.least };
        match &mut self.stage {
            Stage::Touch(touch) => {
                touch.follow(way, force, weight, in_contact, &self.tuning);
                if touch.is_outside() && self.remembered > 0.0 {
                    // Another surface than the one that is remembered.
                    (self.tuning.range, self.remembered) = (self.told, 0.0);
                } else if touch.is_outside() && !self.is_outside {
                    // The stop that follows needs to know the surface as it is.
                    self.is_outside = true;
                    self.tuning.range.most = self.told.most * touch::HARDEST;
                }
            }
            Stage::Hold(hold) => hold.follow(way, force, weight, &self.tuning),
        }
        self.change_stage();
    }

    fn change_stage(&mut self) {
        match &self.stage {
            Stage::Touch(touch) => {
                let Some(found) = touch.found() else { return };
                if touch.away() > LOST {
                    (self.fading, self.stage) = (self.fading + found.shown, Stage::Touch(Touch::new()));
                } else if touch.is_certain()
                    && touch.noticed().is_some_and(|since| since >= TOUCH + self.tuning.lag)
                    && touch.away() == 0.0
                {
                    let datum = found.spring.depth;
                    if let Some(moments) = touch.moments(datum, &self.tuning.range) {
                        self.stage = Stage::Hold(Hold::new(datum, &moments));
                    }
                }
            }
            Stage::Hold(hold) if hold.away() > LOST => {
                let (k, shown) = (hold.likeliest().stiffness, hold.expected());
                let width = (REMEMBERED_DEVIATIONS * hold.stiffness_deviation()).max(REMEMBERED_PART * k);
                let range = Range {
                    least: (k - width).clamp(self.told.least, self.told.most),
                    most: (k + width).clamp(self.told.least, self.told.most),
                };
                (self.tuning.range, self.remembered) = (range, REMEMBERED);
                (self.fading, self.stage) = (self.fading + shown, Stage::Touch(Touch::new()));
            }
            Stage::Hold(_) => {}
        }
    }

    /// The likeliest surface; `None` before a touch.
    pub(crate) fn likeliest(&self) -> Option<Spring> {
        match &self.stage {
            Stage::Touch(touch) => touch.found().map(|found| found.spring),
            Stage::Hold(hold) => Some(hold.likeliest()),
        }
    }

    /// A surface that would explain the force if it began here; before a touch was noticed.
    pub(crate) fn unexplained(&self) -> Spring {
        self.unexplained
    }

    /// What f̂ was expected to show of the last sample in N; `None` while that is being learned.
    pub(crate) fn expected(&self) -> Option<f64> {
        if let Stage::Hold(hold) = &self.stage { Some(hold.expected() + self.fading) } else { None }
    }

    /// Whether the surface is harder than any that was told.
    pub(crate) fn is_outside(&self) -> bool {
        self.is_outside
    }

    /// From which share of surfaces on that can't be kept below the limit to stop.
    pub(crate) fn risk(&self) -> f64 {
        self.risk
    }

    /// The least and greatest depth at which a surface of the set presses with `force` (N).
    pub(crate) fn depths_of(&self, force: f64, deviations: f64) -> (f64, f64) {
        let Spring { depth, stiffness } = self.likeliest().unwrap_or(self.unexplained);
        let likeliest = depth + force / stiffness;
        match &self.stage {
            Stage::Touch(touch) => touch.depths_of(force, deviations, &self.tuning.range),
            Stage::Hold(hold) => Some(hold.depths_of(force, deviations, &self.tuning.range)),
        }
        .unwrap_or((likeliest, likeliest))
    }

    /// The greatest force in N at `depth` of a surface of the set.
    pub(crate) fn strongest(&self, depth: f64, deviations: f64) -> f64 {
        let spring = self.likeliest().unwrap_or(self.unexplained);
        match &self.stage {
            Stage::Touch(touch) => touch.strongest(depth, deviations, &self.tuning.range),
            Stage::Hold(hold) => Some(hold.strongest(depth, deviations)),
        }
        .unwrap_or(spring.stiffness * (depth - spring.depth))
    }

    /// Whether since the sample before some force was likelier than not above this one (N): between
    /// samples it is higher than at either, and what is believed has far less noise than f̂ without its
    /// lag.
    pub(crate) fn has_exceeded(&self, force: f64) -> bool {
        self.share_above(force, self.deepest) > 0.5
    }

    /// How likely a surface is that presses with more than `force` (N) at `depth`.
    pub(crate) fn share_above(&self, force: f64, depth: f64) -> f64 {
        match &self.stage {
            Stage::Touch(touch) if touch.found().is_some() => touch.share_above(force, depth, &self.tuning.range),
            Stage::Touch(_) => 0.0,
            Stage::Hold(hold) => hold.share_above(force, depth),
        }
    }

    /// Least and greatest stiffness of the set of one deviation, N/m.
    pub(crate) fn stiffness_band(&self) -> (f64, f64) {
        match &self.stage {
            Stage::Touch(_) => (self.tuning.range.least, self.tuning.range.most),
            Stage::Hold(hold) => {
                let (k, deviation) = (hold.likeliest().stiffness, hold.stiffness_deviation());
                let Range { least, most } = self.told;
                ((k - deviation).clamp(least, most), (k + deviation).clamp(least, most))
            }
        }
    }
}

#[cfg(test)]
mod tests;
