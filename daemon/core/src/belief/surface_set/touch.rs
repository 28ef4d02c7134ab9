//! A touch: from free motion until some time after the first force. Linear least squares on banks
//! of contact depths that lie on the way just travelled.

use nalgebra::{SMatrix, SVector};

use super::Tuning;
use super::bank::Bank;
use super::cell::{Best, Cell, Range, Spring};
use crate::belief::way::Way;

/// Nodes close together, of the last cycles.
const FINE: usize = 32;
/// Nodes that reach further back.
const COARSE: usize = 40;
/// How far apart in time nodes are on the way, s.
const FINE_SPACING: f64 = 0.00025;
const COARSE_SPACING: f64 = 0.002;
/// Part of the way from the first touch of the softest surface until it is felt that is between
/// two coarse nodes of a slow approach, and between two fine ones.
const COARSE_PART: f64 = 2.0 / COARSE as f64;
const FINE_PART: f64 = COARSE_PART / 8.0;
/// A likelihood ratio: by how much a surface must explain the samples better than none.
pub(super) const EVIDENCE: f64 = 25.0;
/// The same where an axis is in contact.
const EVIDENCE_IN_CONTACT: f64 = 4.0;
/// With less than this nothing was touched after all.
const NO_EVIDENCE: f64 = 4.0;
/// With more there are no doubts that something was: until then, and until an axis is in contact, the tool may still
/// be on its way to the surface, and there are new nodes.
const CERTAIN: f64 = 100.0;
/// Likelihood against the best that does not count any more.
const UNLIKELY: f64 = 1e-6;
/// How many times harder than told a surface may be for it to be learned.
pub(super) const HARDEST: f64 = 100.0;
/// Part by which a surface is harder than the hardest that must explain the samples better for it to be
/// out of range: one that is clearly nearer to this than to the hardest. A fit is no better than T_est is
/// told, and by a second touch, while f̂ still shows the first, worse: 12 % too hard where T_est was 11 % off.
pub(super) const OUTSIDE: f64 = 1.25;

/// Depths of a contact point that is not told, m.
const ANYWHERE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// Where a surface begins.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Begins {
    /// Between these depths, as it is told, m.
    Between((f64, f64)),
    /// Not there: anywhere.
    Elsewhere,
}

/// The best surface of each cell, as the last sample left them.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    cell: Cell,
    response: [f64; 2],
    best: Best,
}

/// The stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Touch {
    fine: Bank<FINE>,
    coarse: Bank<COARSE>,
    /// Way along the surface so far, m.
    beside: f64,
    /// Since the last node of each bank, s.
    since_fine: f64,
    since_coarse: f64,
    /// Σ w f² beyond what the best surface explained when the touch was noticed.
    constant: f64,
    /// Samples since then, and their Σ w.
    samples: u32,
    weights: f64,
    /// Time since then in s; `None` before it.
    noticed: Option<f64>,
    /// Time without any surface of the set touching, s.
    away: f64,
    /// Whether the best surface is harder than any that was told.
    is_outside: bool,
    begins: Begins,
    /// The best surface, with the lag of f̂ and without.
    best: Option<Found>,
}

/// The best surface of all cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    /// Its cost, relative to no contact.
    pub cost: f64,
    /// The surface.
    pub spring: Spring,
    /// What f̂ should show of it, N.
    pub shown: f64,
}

/// Of (what f̂ should show in N, k in N/m, θ in N).
pub(super) struct Moments {
    pub mean: SVector<f64, 3>,
    pub covariance: SMatrix<f64, 3, 3>,
}

impl Touch {
    /// Nothing seen.
    pub(super) fn new() -> Self {
        Self {
            fine: Bank::empty(),
            coarse: Bank::empty(),
            beside: 0.0,
            since_fine: 0.0,
            since_coarse: 0.0,
            constant: 0.0,
            samples: 0,
            weights: 0.0,
            noticed: None,
            away: 0.0,
            is_outside: false,
            begins: Begins::Between(ANYWHERE),
            best: None,
        }
    }

    /// The best surface, once a touch was noticed.
    pub(super) fn found(&self) -> Option<&Found> {
        self.best.as_ref().filter(|_| self.noticed.is_some())
    }

    /// Time since a touch was noticed, s.
    pub(super) fn noticed(&self) -> Option<f64> {
        self.noticed
    }

    /// Whether there are no doubts that something was touched.
    pub(super) fn is_certain(&self) -> bool {
        self.found().is_some_and(|best| -best.cost > CERTAIN)
    }

    /// For how long no surface touches that may be there, s.
    pub(super) fn away(&self) -> f64 {
        self.away
    }

    /// Whether the surface is harder than any that was told.
    pub(super) fn is_outside(&self) -> bool {
        self.is_outside
    }

    /// On to a sample at the end of `way` that shows a pressing `force` (N).
    pub(super) fn follow(&mut self, way: &Way, force: f64, weight: f64, in_contact: bool, tuning: &Tuning) {
        let (beside, along, duration) = (self.beside, way.along(), way.duration());
        for piece in way.pieces() {
            self.beside += along * piece.duration / duration;
            let (decay, weights) = piece.weights(tuning.lag);
            self.fine.advance(piece, weights, decay);
            self.coarse.advance(piece, weights, decay);
            self.since_fine += piece.duration;
            self.since_coarse += piece.duration;
            if !(in_contact && self.is_certain()) {
                self.place(piece.depth[2], tuning);
            }
        }
        self.beside = beside + along;
        self.fine.add(force, weight);
        self.coarse.add(force, weight);
        let is_felt = in_contact || force * force * weight > EVIDENCE_IN_CONTACT;
        if self.noticed.is_none() && !is_felt {
            self.best = None;
            return;
        }
        if let Begins::Between(depths) = &mut self.begins {
            *depths = tuning.depths;
            if self.begins_elsewhere(in_contact, tuning) {
                self.begins = Begins::Elsewhere;
            }
        }
        self.best = self.search(&tuning.range);
        let Some(best) = self.best else { return };
        match &mut self.noticed {
            None => {
                let wanted = if in_contact { EVIDENCE_IN_CONTACT } else { EVIDENCE };
                if -best.cost > wanted {
                    (self.noticed, self.samples, self.weights) = (Some(0.0), 0, 0.0);
                    self.constant = -best.cost;
                }
            }
            Some(_) if -best.cost < NO_EVIDENCE => self.noticed = None,
            Some(since) => {
                *since += way.duration();
                self.samples += 1;
                self.weights += weight;
                self.constant += weight * force * force;
                self.away = if way.end() < best.spring.depth { self.away + way.duration() } else { 0.0 };
            }
        }
        self.is_outside = self.noticed.is_some()
            && best.spring.stiffness >= tuning.range.most * 0.999
            && self.samples >= 4
            && self.is_certain()
            && self.harder(tuning).is_some_and(|cost| {
                let wanted = EVIDENCE * self.scale(cost).max(self.doubt(tuning.offset));
                best.cost - cost > wanted
            });
    }

    /// How many times as convincing as told the samples have to be where each is off by as much as this (N): at a small force an
    /// offset looks like a hard surface.
    fn doubt(&self, offset: f64) -> f64 {
        1.0 + offset * offset * self.weights / f64::from(self.samples)
    }

    /// Whether the samples say so clearly that the surface begins out of the tolerance of its contact
    /// point: a tolerance that is too narrow would leave no surface, or a wrong one.
    fn begins_elsewhere(&self, in_contact: bool, tuning: &Tuning) -> bool {
        if tuning.depths == ANYWHERE {
            return false;
        }
        // One that begins where it is told and is harder than told is another matter.
        let any = Range { most: tuning.range.most * HARDEST, ..tuning.range };
        let within = self.search(&any).map_or(0.0, |found| found.cost.min(0.0));
        best_of(self.candidates_between(ANYWHERE, &tuning.range)).is_some_and(|found| {
            let is_noticed = -found.cost > if in_contact { EVIDENCE_IN_CONTACT } else { EVIDENCE };
            is_noticed && within - found.cost > EVIDENCE * self.scale(found.cost)
        })
    }

    /// The cost of the best surface that is harder than any that was told.
    fn harder(&self, tuning: &Tuning) -> Option<f64> {
        let most = tuning.range.most;
        self.search(&Range { least: most * OUTSIDE, most: most * HARDEST }).map(|found| found.cost)
    }

    /// New nodes at this depth, and an end to those that are deeper: nothing touches there now.
    fn place(&mut self, depth: f64, tuning: &Tuning) {
        self.fine.drop_below(depth);
        self.coarse.drop_below(depth);
        if depth < tuning.depths.0 {
            // The first cell of those that are told begins at the last node before them.
            (self.since_fine, self.since_coarse) = (FINE_SPACING, COARSE_SPACING);
        }
        if self.since_coarse >= COARSE_SPACING * 0.999 && depth - self.coarse.last() >= tuning.felt_after * COARSE_PART
        {
            self.coarse.push(depth, self.beside);
            self.since_coarse = 0.0;
        }
        if self.since_fine >= FINE_SPACING * 0.999 && depth - self.fine.last() >= tuning.felt_after * FINE_PART {
            self.fine.push(depth, self.beside);
            self.since_fine = 0.0;
        }
    }

    /// Every cell in which the surface may begin.
    fn candidates(&self, range: &Range) -> impl Iterator<Item = Candidate> {
        let depths = match self.begins {
            Begins::Between(depths) => depths,
            Begins::Elsewhere => ANYWHERE,
        };
        self.candidates_between(depths, range)
    }

    /// Every cell with a depth between these, m: the coarse ones only where the fine ones don't reach.
    fn candidates_between(&self, (least, most): (f64, f64), range: &Range) -> impl Iterator<Item = Candidate> {
        let fine = (0..self.fine.cells()).map(|j| self.fine.cell(j));
        let first = self.fine.first();
        let coarse =
            (0..self.coarse.cells()).map(|j| self.coarse.cell(j)).filter(move |(cell, _)| cell.depth[0] < first);
        let cells = fine.chain(coarse).filter(move |(cell, _)| cell.depth[1] >= least && cell.depth[0] <= most);
        cells.map(|(cell, response)| Candidate { cell, response, best: cell.best(range) })
    }

    fn search(&self, range: &Range) -> Option<Found> {
        best_of(self.candidates(range))
    }

    /// The way along the surface since the tool was at this depth, m.
    pub(super) fn beside_since(&self, depth: f64) -> f64 {
        let then = self.fine.beside(depth).or_else(|| self.coarse.beside(depth));
        then.map_or(0.0, |then| self.beside - then)
    }

    /// By how much the errors are larger than was told, as a factor of variances.
    pub(super) fn scale(&self, cost: f64) -> f64 {
        let free = self.samples as f64 - 2.0;
        if free >= 1.0 { ((self.constant + cost) / free).max(1.0) } else { 1.0 }
    }

    /// Mean and covariance of (what f̂ should show, k, θ = k (c − datum)): every cell with its
    /// likelihood.
    pub(super) fn moments(&self, datum: f64, range: &Range) -> Option<Moments> {
        let found = self.found()?;
        let scale = self.scale(found.cost);
        let spread = (range.most - range.least).max(1e-3 * range.most);
        // Of a stiffness that is anywhere in the range.
        let prior = 12.0 / (spread * spread);
        let (mut all, mut mean, mut square) = (0.0, SVector::<f64, 3>::zeros(), SMatrix::<f64, 3, 3>::zeros());
        for Candidate { cell, response, best } in self.candidates(range) {
            let likelihood = libm::exp(-0.5 * (best.cost - found.cost) / scale);
            if likelihood < UNLIKELY {
                continue;
            }
            let [aa, ab, bb] = cell.squares.map(|sum| sum / scale);
            let information = SMatrix::<f64, 2, 2>::new(aa + prior, ab, ab, bb + prior);
            let [start, end] = cell.depth.map(|depth| depth - datum);
            let map = SMatrix::<f64, 3, 2>::new(response[0], response[1], 1.0, 1.0, start, end);
            let Some(covariance) = information.try_inverse() else { continue };
            let middle = map * SVector::<f64, 2>::from(best.weights);
            all += likelihood;
            mean += middle * likelihood;
            square += (map * covariance * map.transpose() + middle * middle.transpose()) * likelihood;
        }
        (all > 0.0).then(|| {
            let mean = mean / all;
            Moments { mean, covariance: square / all - mean * mean.transpose() }
        })
    }

    /// The cost up to which a surface is in the set of `deviations`.
    fn level(&self, deviations: f64) -> Option<f64> {
        let found = self.found()?;
        Some(found.cost + deviations * deviations * self.scale(found.cost))
    }

    /// The least and greatest depth at which a surface of the set presses with `force` (N).
    pub(super) fn depths_of(&self, force: f64, deviations: f64, range: &Range) -> Option<(f64, f64)> {
        let level = self.level(deviations)?;
        let candidates = self.candidates(range).filter(|candidate| candidate.best.cost <= level);
        candidates
            .filter_map(|Candidate { cell, .. }| cell.depths_of(force, level, range))
            .reduce(|(least, most), (low, high)| (least.min(low), most.max(high)))
    }

    /// The greatest force in N at `depth` of a surface of the set.
    pub(super) fn strongest(&self, depth: f64, deviations: f64, range: &Range) -> Option<f64> {
        let level = self.level(deviations)?;
        let candidates = self.candidates(range).filter(|candidate| candidate.best.cost <= level);
        candidates.filter_map(|Candidate { cell, .. }| cell.strongest(depth, level, range)).reduce(f64::max)
    }

    /// How likely a surface is that presses with more than `force` (N) at `depth`: every cell with
    /// its likelihood, within a cell by the normal distribution about its best surface, which may be
    /// deeper or less deep by `besides` (one deviation, m).
    pub(super) fn share_above(&self, force: f64, depth: f64, besides: f64, range: &Range) -> f64 {
        let Some(found) = self.found() else { return 1.0 };
        let scale = self.scale(found.cost);
        let (mut all, mut above) = (0.0, 0.0);
        for Candidate { cell, best, .. } in self.candidates(range) {
            let weight = libm::exp(-0.5 * (best.cost - found.cost) / scale);
            let [a, b] = best.weights;
            let expected = a * (depth - cell.depth[0]) + b * (depth - cell.depth[1]);
            let variance = cell.force_variance(depth).map_or(0.0, |variance| variance.max(0.0) * scale);
            let by_depth = (a + b) * besides;
            let deviation = libm::sqrt(variance + by_depth * by_depth);
            all += weight;
            above += weight * super::normal::above(force - expected, deviation);
        }
        if all > 0.0 { above / all } else { 1.0 }
    }
}

fn best_of(candidates: impl Iterator<Item = Candidate>) -> Option<Found> {
    let best = candidates.min_by(|a, b| a.best.cost.total_cmp(&b.best.cost))?;
    let Candidate { cell, response, best } = best;
    let [a, b] = best.weights;
    Some(Found { cost: best.cost, spring: cell.spring(best.weights), shown: a * response[0] + b * response[1] })
}
