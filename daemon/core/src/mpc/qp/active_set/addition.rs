//! One row added to W: the step of the dual method, and the certificate where no step is possible.

use super::{Ended, FEASIBLE, Run, ZERO_MULTIPLIER, signed};
use crate::mpc::qp::lanes::{add_scaled, dot, norm_squared, padded};
use crate::mpc::qp::working_set::Member;
use crate::mpc::qp::{Answer, RowState};

/// Rounding in what a member's bound says of y, relative to the lengths of both.
const NOISE: f64 = 1e-14;
/// Part of a row's scale by which bounds of rows that depend on one another may contradict.
const NEGLIGIBLE: f64 = 1e-6;
/// How many times as long as a normal a member's part in it has to be to be exchanged for it.
const BETTER: f64 = 10.0;

impl Run<'_, '_> {
    /// Adds a row to W, if its violation times weight is still at least `least`: steps along the
    /// part of its normal that W leaves, letting members go whose multiplier reaches zero on the
    /// way. Says whether that has changed W.
    pub(super) fn add(
        &mut self,
        row: usize,
        side: RowState,
        least: f64,
        answer: &mut Answer<'_>,
        expired: &mut dyn FnMut() -> bool,
    ) -> Result<bool, Ended> {
        if self.working.contains(row) {
            // It is in W already: that it seems violated is what many steps have added up to.
            return Ok(false);
        }
        let bound = self.bound(row, side);
        let weight = self.qp.weight[row];
        let mut member = Member::new(row, side, bound);
        let mut has_let_go = false;
        let start = self.normal(row, side);
        let mut violation = bound - dot(&self.c[start..], &self.y[start..]);
        if violation < least / weight {
            // Another row has met it as well.
            return Ok(false);
        }
        self.count_iteration(expired)?;
        let mut projection = self.working.project(self.c, self.d, start);
        loop {
            if !violation.is_finite() {
                return Err(Ended::Failed);
            }
            if self.is_stuck() && projection.is_nearly_dependent() && violation <= NEGLIGIBLE / weight {
                // Followed, it would move y by far more than it is missed by, and all others with it.
                return Ok(has_let_go);
            }
            let len = self.working.len;
            let longest = self.combine();
            let fall = &self.fall[..padded(len)];
            let pairs = || self.working.members[..len].iter().zip(fall.iter());
            // Of long normals that cancel, what is left may be their rounding.
            let is_cancelled = projection.is_cancelled(longest);
            let is_independent = !projection.dependent && !is_cancelled && len < self.qp.variables;
            let independent = is_independent.then_some(projection);
            let full = independent.map_or(f64::INFINITY, |projection| (violation / projection.rest).max(0.0));
            let mut blocking = (full, None);
            for (index, (member, fall)) in pairs().enumerate() {
                if fall * member.length > ZERO_MULTIPLIER * longest && member.multiplier < blocking.0 * fall {
                    blocking = (member.multiplier / fall, Some(index));
                }
            }
            let (step, blocked_by) = blocking;
            if independent.is_none() {
                // The members' bounds say what is missing, and y does so to rounding only.
                let missed = pairs().fold(bound, |missed, (member, fall)| missed - fall * member.bound);
                let is_implied = missed <= FEASIBLE / weight;
                // What is left of c in place of the member that blocks it. Where that is not enough
                // for it either, exchanging them would make rounding hold y.
                let part = |index: usize| self.fall[index] * self.working.distance(index, self.scratch);
                let in_its_place = projection.with(blocked_by.map_or(0.0, part));
                let left = if in_its_place.dependent { in_its_place.rest } else { projection.rest };
                let y_length = libm::sqrt(norm_squared(self.y));
                let noise = NOISE * longest * y_length;
                let unseen = libm::sqrt(left) * y_length + noise;
                let is_small = violation <= FEASIBLE / weight + unseen || self.is_stuck();
                let is_lost = is_small && missed <= NEGLIGIBLE / weight + noise;
                let is_exact = is_cancelled || projection.is_exact();
                // Where nothing blocks it, the bounds have to contradict one another by more than they are known.
                let is_unproven = step.is_infinite() && missed <= FEASIBLE / weight + noise;
                let is_alone = is_implied && is_exact;
                // In place of a long one among normals that cancel, it holds y better than they do.
                let is_long = |index: usize| {
                    let part = fall[index] * self.working.members[index].length;
                    part * part > BETTER * BETTER * projection.whole
                };
                let is_better = !in_its_place.is_cancelled(longest) && blocked_by.is_some_and(is_long);
                if is_unproven || (is_alone || is_lost) && !is_better {
                    return Ok(has_let_go);
                }
            }
            if step.is_infinite() {
                if violation <= FEASIBLE / weight {
                    // Met, perhaps by letting others go, and dependent by rounding on those that
                    // are left: no contradiction.
                    return Ok(has_let_go);
                }
                self.certify(&member, answer);
                return Err(Ended::Infeasible);
            }
            self.fresh = false;
            for (member, fall) in self.working.members[..len].iter_mut().zip(fall.iter()) {
                member.multiplier -= step * fall;
            }
            member.multiplier += step;
            if independent.is_some() {
                add_scaled(self.y, step, self.c);
                violation -= step * projection.rest;
            }
            match (blocked_by, independent) {
                // Once it has pushed it belongs to W, even where letting others go meets it:
                // without it W would not hold y.
                (Some(index), _) => {
                    projection = self.working.release(index, &projection, self.c, self.d);
                    self.count_iteration(expired)?;
                    has_let_go = true;
                }
                (None, Some(projection)) => {
                    self.working.push(member, &projection, self.c, self.d);
                    return Ok(true);
                }
                (None, None) => return Err(Ended::Failed),
            }
        }
    }

    /// Writes by how much λ of the members falls for each unit of the row's own, R⁻¹ d, which is
    /// how its normal is a combination of theirs; gives the longest part, |R⁻¹ d| ‖c‖.
    pub(super) fn combine(&mut self) -> f64 {
        let len = self.working.len;
        let fall = &mut self.fall[..padded(len)];
        fall.copy_from_slice(&self.d[..padded(len)]);
        self.working.solve(fall);
        let mut longest = 0.0_f64;
        for (member, fall) in self.working.members[..len].iter().zip(fall.iter()) {
            let part = fall.abs() * member.length;
            longest = if part > longest { part } else { longest };
        }
        longest
    }

    /// The row that cannot be met against the members that hold it: Σ y_i a_i = 0.
    fn certify(&self, row: &Member, answer: &mut Answer<'_>) {
        answer.working.fill(RowState::Inactive);
        answer.multipliers.fill(0.0);
        let members = &self.working.members[..self.working.len];
        for (member, fall) in members.iter().zip(self.fall.iter()) {
            answer.multipliers[usize::from(member.row)] = signed(member.side, -fall.min(0.0));
            answer.working[usize::from(member.row)] = member.side;
        }
        answer.multipliers[usize::from(row.row)] += signed(row.side, 1.0);
        answer.working[usize::from(row.row)] = row.side;
    }
}
