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
//! | hold | a Kalman filter over (m, k, θ = k c, slope, bend); at the end of the range a second one | `hold`, `tilt`, `harder` |
//!
//! Touch goes over to hold once it is certain and an axis is in contact, and where the normal is told not before 20 ms
//! and a lag of f̂ after it was noticed; contact lost for 8 ms leads back, with what is known of k, for one second.
//! A force below β in free motion, of a tool that is not as heavy as told, is thus no contact to remember.
//!
//! The set of z deviations is {cost ≤ least + z² · max(1, least / (n − 2))}. On a plane all rows of
//! the force are one row in depth, so that a set costs no row: what the law asks for are the depths
//! at which the surfaces of the set press with some force, [`SurfaceSet::depths_of`].

mod bank;
mod cell;
mod harder;
mod hold;
mod normal;
mod shown_force;
mod tilt;
mod touch;

pub(crate) use cell::Spring;
pub(crate) use shown_force::ShownForce;

use nalgebra::Vector3;

use super::way::Way;
use cell::Range;
use harder::Harder;
use hold::Hold;
use tilt::Tilt;
use touch::Touch;

/// Error of the force that no noise explains: in N, and as a part of the force.
const FLOOR: f64 = 0.1;
const FLOOR_PART: f64 = 0.005;
/// The same of what f̂ still shows of a contact before.
const FADING_PART: f64 = 0.2;
/// By how much f̂ may be off throughout a touch, since a tool is not as heavy as told, or T_est not as long: a part of what is felt,
/// and at most so many N, which a quarter of a kilogram weighs.
const OFFSET_PART: f64 = 0.5;
const OFFSET: f64 = 2.5;
/// Time constant of what the tool's motion by q̇ differs from that by the positions, s: shorter than an arm takes to brake, and no shorter
/// than a cycle of 4 ms: an encoder's steps cancel from one to the next.
const DIFFERING: f64 = 0.004;
/// How long a touch takes from when it was noticed beyond the lag of f̂, s.
const TOUCH: f64 = 0.020;
/// Slope of a surface whose normal is told: one deviation of a plane that was aligned within a degree.
const TOLD_SLOPE: f64 = 0.01;
/// Largest tolerance of a normal is so many deviations of the slope.
const TOLERANCE_DEVIATIONS: f64 = 2.0;
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
    /// By how much the normal may be wrong, rad; 0 where it is told.
    pub normal_tolerance: f64,
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
    /// By how much f̂ may be off besides, throughout a touch, N. A hold follows it with θ.
    offset: f64,
    /// By how much the told normal may be wrong, as a slope; 0 where it is told as it is.
    tolerance: f64,
    /// Standard deviation of the slope of the surface along the path, at first.
    slope: f64,
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
    /// Between which depths the surface is told to begin, m.
    told_depths: (f64, f64),
    stage: Stage,
    /// Beside a hold.
    harder: Option<Harder>,
    tilt: Tilt,
    /// How long what is known of a lost contact's stiffness still holds, s.
    remembered: f64,
    /// Whether the surface is harder than any that was told.
    is_outside: bool,
    /// What f̂ still shows of a contact before, N.
    fading: f64,
    /// How much less presses by q̇ than by the joint positions, on average of late, N.
    differing: f64,
    /// A surface that begins here, for a force that no surface explains yet.
    unexplained: Spring,
    /// Greatest depth since the sample before, m.
    deepest: f64,
    risk: f64,
}

impl Tuning {
    /// Whether the normal is learned.
    fn learns_normal(&self) -> bool {
        self.tolerance > 0.0
    }

    /// How long a touch takes from when it was noticed, s. It knows of no slope: where there may be one,
    /// it ends as soon as it is certain.
    fn touch(&self) -> f64 {
        if self.learns_normal() { 0.0 } else { TOUCH + self.lag }
    }
}

impl SurfaceSet {
    /// Nothing seen. `lag` is T_est in s, `noise` the standard deviation of f̂ in N, `felt` the
    /// pressing force from which on it is felt in N, `depth` the configured contact depth in m.
    pub(crate) fn new(prior: &Prior, lag: f64, noise: f64, felt: f64, depth: f64) -> Self {
        let (least, most) = prior.stiffness;
        let told = Range { least, most };
        let tolerance = prior.depth_tolerance.unwrap_or(f64::INFINITY);
        let depths = (depth - tolerance, depth + tolerance);
        let normal_tolerance = libm::tan(prior.normal_tolerance);
        let slope = (normal_tolerance / TOLERANCE_DEVIATIONS).max(TOLD_SLOPE);
        let felt_after = felt / least;
        Self {
            tuning: Tuning {
                lag,
                range: told,
                depths,
                felt_after,
                noise,
                offset: OFFSET.min(OFFSET_PART * felt),
                tolerance: normal_tolerance,
                slope,
            },
            told,
            told_depths: depths,
            stage: Stage::Touch(Touch::new()),
            harder: None,
            tilt: Tilt::none(),
            remembered: 0.0,
            is_outside: false,
            fading: 0.0,
            differing: 0.0,
            unexplained: Spring { depth: 0.0, stiffness: least },
            deepest: f64::NEG_INFINITY,
            risk: prior.risk,
        }
    }

    /// Takes over what `old` knows, where it was told the same; returns whether it was.
    pub(crate) fn take_over(&mut self, old: &Self) -> bool {
        let (new, before) = (&self.tuning, &old.tuning);
        let is_same = self.told == old.told
            && self.told_depths == old.told_depths
            && (new.lag, new.tolerance) == (before.lag, before.tolerance);
        if is_same {
            let Tuning { noise, offset, .. } = self.tuning;
            let tuning = Tuning { noise, offset, ..old.tuning };
            *self = Self { tuning, risk: self.risk, ..*old };
        }
        is_same
    }

    /// Forgets the surface, but for what was told.
    pub(crate) fn forget(&mut self) {
        (self.stage, self.harder) = (Stage::Touch(Touch::new()), None);
        self.tuning.range = self.told;
        (self.remembered, self.fading, self.differing) = (0.0, 0.0, 0.0);
        (self.is_outside, self.deepest) = (false, f64::NEG_INFINITY);
        self.tuning.depths = self.told_depths;
        self.tilt = Tilt::none();
    }

    /// On to a sample at `depth` (m) that shows this force. Without a `way` from the sample before, everything begins anew.
    pub(crate) fn follow(&mut self, way: Option<&Way>, depth: f64, shown: &ShownForce, in_contact: bool) {
        let ShownForce { pressing: force, ref beside, feigned, differing } = *shown;
        let unexplained =
            |force: f64| Spring { depth: depth - force.max(0.0) / self.told.least, stiffness: self.told.least };
        let Some(way) = way else {
            self.unexplained = unexplained(force);
            self.forget();
            return;
        };
        self.deepest = way.deepest();
        let time = way.duration();
        self.differing = differing + (self.differing - differing) * libm::exp(-time / DIFFERING);
        self.fading *= if self.tuning.lag > 0.0 { libm::exp(-time / self.tuning.lag) } else { 0.0 };
        self.remembered = (self.remembered - time).max(0.0);
        if self.remembered == 0.0 && !self.is_outside {
            self.tuning.range = self.told;
        }
        let noise = self.tuning.noise;
        let (by_force, by_fading) = (FLOOR_PART * force, FADING_PART * self.fading);
        let floor = noise * noise + FLOOR * FLOOR + by_force * by_force + by_fading * by_fading;
        // In contact the surface is most of the force, and is not to wait for the tool to be at rest.
        let by_tool = if in_contact { 0.0 } else { feigned };
        let weight = 1.0 / (floor + by_tool * by_tool);
        // A touch does not know how much of the friction a slope shows.
        let by_slope = if self.tuning.learns_normal() { self.tuning.slope * beside.norm() } else { 0.0 };
        let force = force - self.fading;
        self.unexplained = unexplained(force);
        match &mut self.stage {
            Stage::Touch(touch) => {
                let weight = weight / (1.0 + weight * by_slope * by_slope);
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
            Stage::Hold(hold) => {
                // What is held is known well, and is not to follow a motion of the tool that only q̇ shows, or only the positions. A
                // touch can't wait for that: it is over before they agree.
                let weight = weight / (1.0 + weight * self.differing * self.differing);
                let path = hold.turn(&way.beside, &self.tuning);
                if self.tuning.learns_normal() {
                    self.tilt.path += path;
                }
                let told = (&self.tuning, &self.tilt);
                hold.follow(way, (force, beside), weight, told);
                // A stiffness that is remembered ends nearer than what is told.
                if self.remembered == 0.0 && !self.is_outside {
                    self.harder = Harder::follow(self.harder, hold, way, (force, beside), weight, told);
                    if let Some(found) = self.harder.as_ref().and_then(Harder::found) {
                        (*hold, self.harder, self.is_outside) = (found, None, true);
                        self.tuning.range.most = self.told.most * touch::HARDEST;
                    }
                }
            }
        }
        self.change_stage(in_contact);
    }

    fn change_stage(&mut self, in_contact: bool) {
        match &self.stage {
            Stage::Touch(touch) => {
                let Some(found) = touch.found() else { return };
                if touch.away() > LOST {
                    (self.fading, self.stage) = (self.fading + found.shown, Stage::Touch(Touch::new()));
                } else if in_contact
                    && touch.is_certain()
                    && touch.noticed().is_some_and(|since| since >= self.tuning.touch())
                    && touch.away() == 0.0
                {
                    let Spring { depth: datum, stiffness } = found.spring;
                    if let Some(moments) = touch.moments(datum, &self.tuning.range) {
                        let wrongly = self.wrong_by_slope(touch.beside_since(datum), datum, stiffness);
                        self.stage = Stage::Hold(Hold::new(datum, &moments, wrongly, &self.tuning));
                    }
                }
            }
            Stage::Hold(hold) if hold.away() > LOST => {
                let (k, shown) = (hold.likeliest().stiffness, hold.expected());
                let width = (REMEMBERED_DEVIATIONS * hold.stiffness_deviation()).max(REMEMBERED_PART * k);
                let most = if self.is_outside { self.told.most * touch::HARDEST } else { self.told.most };
                let within = |stiffness: f64| stiffness.clamp(self.told.least, most);
                let range = Range { least: within(k - width), most: within(k + width) };
                (self.tuning.range, self.remembered) = (range, REMEMBERED);
                (self.fading, self.stage) = (self.fading + shown, Stage::Touch(Touch::new()));
                self.harder = None;
            }
            Stage::Hold(_) => {}
        }
    }

    /// What a touch takes for stiffness (N/m) and for θ (N) where the surface has a slope of 1, after
    /// so much way `beside` (m) since it began at `depth`: the force is k (x − c − slope · way).
    fn wrong_by_slope(&self, beside: f64, depth: f64, stiffness: f64) -> (f64, f64) {
        if !self.tuning.learns_normal() {
            return (0.0, 0.0);
        }
        let pressed = (self.deepest - depth).max(beside * self.tuning.slope);
        (stiffness * beside / pressed.max(f64::MIN_POSITIVE), stiffness * beside)
    }

    /// By how much the surface turned out to be tilted against the normal along which depths are
    /// counted, since this was asked last: a vector along it; `None` where the normal is told.
    pub(crate) fn take_tilt(&mut self) -> Option<Vector3<f64>> {
        match &mut self.stage {
            Stage::Hold(hold) if self.tuning.learns_normal() => {
                let tilt = hold.take_tilt();
                self.tilt.of_normal += tilt;
                Some(tilt)
            }
            Stage::Touch(_) | Stage::Hold(_) => None,
        }
    }

    /// Whether the normal is learned.
    pub(crate) fn learns_normal(&self) -> bool {
        self.tuning.learns_normal()
    }

    /// How fast the normal turns along the path, rad/m: above zero the surface falls away.
    pub(crate) fn bend(&self) -> f64 {
        if let Stage::Hold(hold) = &self.stage { hold.bend() } else { 0.0 }
    }

    /// How fast the surface falls away from a tool that moves with this velocity along it (m/s, base frame), m/s,
    /// beside what its normal says.
    pub(crate) fn falling_away(&self, along: &Vector3<f64>) -> f64 {
        if let Stage::Hold(hold) = &self.stage { hold.falling_away(along) } else { 0.0 }
    }

    /// Whether the normal that was learned still holds.
    pub(crate) fn remembers_normal(&self) -> bool {
        matches!(self.stage, Stage::Hold(_)) || self.remembered > 0.0 || self.likeliest().is_some()
    }

    /// Where the contact point that is told begins along the normal as it is believed to be (`depth`,
    /// m), and how far from it the tool is along the surface (m): as far as the normal may be wrong the
    /// surface may be deeper there, or less deep.
    pub(crate) fn told_at(&mut self, depth: f64, distance: f64) {
        let (first, last) = self.told_depths;
        let tolerance = 0.5 * (last - first) + self.tuning.tolerance * distance;
        self.tuning.depths = (depth - tolerance, depth + tolerance);
    }

    /// Counts depths along another normal: where the tool is they are `shift` m more from now on.
    pub(crate) fn shift(&mut self, shift: f64) {
        if let Stage::Hold(hold) = &mut self.stage {
            hold.shift(shift);
        }
        if let Some(harder) = &mut self.harder {
            harder.shift(shift);
        }
        self.deepest += shift;
        self.unexplained.depth += shift;
    }

    /// The likeliest surface; `None` before a touch.
    pub(crate) fn likeliest(&self) -> Option<Spring> {
        match &self.stage {
            Stage::Touch(touch) => touch.found().map(|found| found.spring),
            Stage::Hold(hold) => Some(hold.likeliest()),
        }
    }

    /// What f̂ should show of a touch that was noticed, N; `None` once no surface touches that may be there.
    pub(crate) fn shown_of_touch(&self) -> Option<f64> {
        let Stage::Touch(touch) = &self.stage else { return None };
        touch.found().filter(|_| touch.away() == 0.0).map(|found| found.shown)
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

    /// The standard deviation of f̂, N.
    pub(crate) fn noise(&self) -> f64 {
        self.tuning.noise
    }

    /// The greatest stiffness of the set, N/m; of all that may be there, where nothing is touched.
    pub(crate) fn hardest(&self, deviations: f64) -> f64 {
        match &self.stage {
            Stage::Touch(_) => self.tuning.range.most,
            Stage::Hold(hold) => hold.likeliest().stiffness + deviations * hold.stiffness_deviation(),
        }
    }

    /// From which share of surfaces on that can't be kept below the limit to stop.
    pub(crate) fn risk(&self) -> f64 {
        self.risk
    }

    /// By how much the surface may be deeper or less deep after a path of this length (m) than where
    /// it was touched: one deviation, m.
    pub(crate) fn sloping(&self, path: f64) -> f64 {
        if self.tuning.learns_normal() { self.tuning.slope * path } else { 0.0 }
    }

    /// What is held, after a path of this length (m).
    fn held(&self, hold: &Hold, path: f64) -> Hold {
        if self.tuning.learns_normal() && path > 0.0 { hold.ahead(path) } else { *hold }
    }

    /// The least and greatest depth at which a surface of the set presses with `force` (N), where the
    /// tool is after a `path` (m) along it.
    pub(crate) fn depths_of(&self, force: f64, deviations: f64, path: f64) -> (f64, f64) {
        let Spring { depth, stiffness } = self.likeliest().unwrap_or(self.unexplained);
        let likeliest = depth + force / stiffness;
        match &self.stage {
            Stage::Touch(touch) => {
                let besides = deviations * self.sloping(path);
                touch.depths_of(force, deviations, &self.tuning.range).map(|(a, b)| (a - besides, b + besides))
            }
            Stage::Hold(hold) => Some(self.held(hold, path).depths_of(force, deviations, &self.tuning.range)),
        }
        .unwrap_or((likeliest, likeliest))
    }

    /// The greatest force in N at `depth` of a surface of the set, after a `path` (m) along it.
    pub(crate) fn strongest(&self, depth: f64, deviations: f64, path: f64) -> f64 {
        let spring = self.likeliest().unwrap_or(self.unexplained);
        match &self.stage {
            Stage::Touch(touch) => {
                touch.strongest(depth + deviations * self.sloping(path), deviations, &self.tuning.range)
            }
            Stage::Hold(hold) => Some(self.held(hold, path).strongest(depth, deviations)),
        }
        .unwrap_or(spring.stiffness * (depth - spring.depth))
    }

    /// Whether since the sample before some force was likelier than not above this one (N): between
    /// samples it is higher than at either, and what is believed has far less noise than f̂ without its
    /// lag.
    pub(crate) fn has_exceeded(&self, force: f64) -> bool {
        self.share_above(force, self.deepest, 0.0) > 0.5
    }

    /// How likely a surface is that presses with more than `force` (N) at `depth`, after a `path` (m)
    /// along it.
    pub(crate) fn share_above(&self, force: f64, depth: f64, path: f64) -> f64 {
        match &self.stage {
            Stage::Touch(touch) if touch.found().is_some() => {
                touch.share_above(force, depth, self.sloping(path), &self.tuning.range)
            }
            Stage::Touch(_) => 0.0,
            Stage::Hold(hold) => self.held(hold, path).share_above(force, depth),
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
mod normal_tests;
#[cfg(test)]
mod tests;
