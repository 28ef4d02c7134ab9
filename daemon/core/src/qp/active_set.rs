//! A dual active-set method after Goldfarb & Idnani, "A numerically stable dual method for solving strictly convex quadratic
//! programs" (Math. Prog. 27, 1983), with two-sided rows and a warm start.
//!
//! In the coordinates y = U z (H = Uᵀ U) the problem is the point nearest to y0 = −U⁻ᵀ g that meets all rows cᵀy ≥ b,
//! c = ± U⁻ᵀ a. The method keeps the nearest point to y0 on a working set W with multipliers λ ≥ 0, y = y0 + Σ λ_i c_i,
//! and adds one violated row after the other; each addition raises the distance from y0, so no W comes twice.
//!
//! # Rules
//! - **Choice**: all rows are looked at, and the violated ones added worst first (violation over scale), each looked at
//!   again before it is; of equals the first. So no tie depends on anything but the order of rows.
//! - **Dependence**: a row whose normal is a combination of those in W is exchanged for the member that blocks it, never
//!   added. Where none blocks, Σ of the members' normals with weights ≥ 0 contradicts it: that is the certificate.
//! - **Drift**: what rounding adds up to in y over many steps is taken out by taking the nearest point afresh from W, at the end
//!   of every pass; a row of W that seems violated meanwhile is left alone.
//! - **Cycling**: in exact arithmetic impossible, see above. With rounding, rows that coincide could be exchanged for one another
//!   for ever: a row that all of W implies is left alone, whatever it seems to be violated by. Beyond that, the iteration limit.
//! - **Nearly singular W**: rows are orthogonalised, not squared, and what depends within 1e-9 never enters W.
//!
//! # Work
//! Set-up: n³/6 multiplications for U and n²/2 for y0; taking up a guess of w rows: w (n²/2 + 4 w n) at most. Then
//! iterations, each an addition or a removal, those of a wrong guess included; before each the limit is looked at and
//! `expired` asked. One takes n²/2 multiplications for a new row, 4 w n to project it (once, whatever blocks it), 4 w n to
//! remove one and 2 w n to take the nearest point afresh; a pass over all rows, with n²/2 and what A z takes, comes at most
//! twice an iteration.

use wide::f64x4;

use super::factor::Factor;
use super::lanes::{
    ALIGNMENT, LANES, add_scaled, before_cache_line, dot, groups, groups_mut, largest_magnitude, norm_squared, padded,
    tiles_mut,
};
use super::working_set::{Member, NO_MEMBERS, WorkingSet};
use super::{Answer, MAX_VARIABLES, Qp, QpOutcome, QpSolver, RowState, members_of};

/// Violation relative to a row's scale that counts as none.
const FEASIBLE: f64 = 1e-10;
/// Part of y that it may be moved by to put rounding right.
const ROUNDING: f64 = 1e-9;
/// By how much of its scale a row of the working set may miss its bound.
const MISSED: f64 = 1e-13;
/// Part of its length that may be left of a normal when the others are taken away, and be rounding.
const COMBINED: f64 = 1e-12;
/// Part of the worst violation from which on others are added before all rows are looked at again.
const CLOSE_TO_WORST: f64 = 0.003;
/// Part of the worst multiplier below zero from which on members of a wrong guess leave together.
const CLOSE_TO_WORST_PULL: f64 = 0.01;
/// Multiplier times length of its normal, relative to the largest, that counts as zero.
const ZERO_MULTIPLIER: f64 = 1e-12;

/// The largest problem that an [`ActiveSet`] solves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SolverCapacity {
    /// Variables.
    pub variables: usize,
    /// Constraint rows.
    pub rows: usize,
}

impl SolverCapacity {
    /// Number of f64 that [`ActiveSet::new`] wants.
    pub fn storage_len(&self) -> usize {
        let stride = padded(self.variables);
        Factor::storage_len(stride) + 2 * stride * stride + 5 * stride + padded(self.rows) + ALIGNMENT
    }
}

/// The solver.
#[derive(Debug)]
pub struct ActiveSet<B> {
    capacity: SolverCapacity,
    max_iterations: u32,
    storage: B,
    /// Where its first cache line starts.
    offset: usize,
    members: [Member; MAX_VARIABLES],
}

impl<B: AsMut<[f64]>> ActiveSet<B> {
    /// A solver that takes up to `max_iterations` additions and removals; `None` when `storage` is shorter than
    /// [`SolverCapacity::storage_len`] or the capacity beyond [`MAX_VARIABLES`].
    pub fn new(capacity: SolverCapacity, max_iterations: u32, mut storage: B) -> Option<Self> {
        let storage_mut = storage.as_mut();
        if storage_mut.len() < capacity.storage_len() || capacity.variables > MAX_VARIABLES {
            return None;
        }
        let offset = before_cache_line(storage_mut);
        Some(Self { capacity, max_iterations, storage, offset, members: NO_MEMBERS })
    }
}

/// A problem on its way.
struct Run<'a, 'q> {
    qp: &'a Qp<'q>,
    factor: Factor<'a>,
    working: WorkingSet<'a>,
    y0: &'a mut [f64],
    y: &'a mut [f64],
    /// Normal of the row that is being looked at.
    c: &'a mut [f64],
    /// Its part within W, Qᵀ c.
    d: &'a mut [f64],
    /// By how much the multipliers fall for each unit of its own, R⁻¹ d.
    fall: &'a mut [f64],
    /// A z.
    values: &'a mut [f64],
    /// Whether y and λ are those of W to rounding, and not a sum of many steps.
    fresh: bool,
    iterations: u32,
    max_iterations: u32,
}

enum Ended {
    Infeasible,
    Expired,
    Failed,
}

impl<B: AsMut<[f64]>> QpSolver for ActiveSet<B> {
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome {
        if qp.variables > self.capacity.variables || qp.variables == 0 || qp.row_count > self.capacity.rows {
            return QpOutcome::Failed { iterations: 0 };
        }
        let stride = qp.stride;
        let (factor, rest) = self.storage.as_mut()[self.offset..].split_at_mut(Factor::storage_len(stride));
        let (q, rest) = rest.split_at_mut(stride * stride);
        let (r, rest) = rest.split_at_mut(stride * stride);
        let (y0, rest) = rest.split_at_mut(stride);
        let (y, rest) = rest.split_at_mut(stride);
        let (c, rest) = rest.split_at_mut(stride);
        let (d, rest) = rest.split_at_mut(stride);
        let (fall, values) = rest.split_at_mut(stride);
        let mut run = Run {
            qp,
            factor: Factor::within(factor, stride),
            working: WorkingSet { members: &mut self.members, len: 0, q: tiles_mut(q), r: tiles_mut(r), stride },
            y0,
            y,
            c,
            d,
            fall,
            values: &mut values[..padded(qp.row_count)],
            fresh: false,
            iterations: 0,
            max_iterations: self.max_iterations,
        };
        let ended = run.solve(answer, expired);
        if matches!(ended, Err(Ended::Expired)) {
            run.write_working(answer.working);
        }
        let iterations = run.iterations;
        match ended {
            Ok(()) => QpOutcome::Solved { iterations },
            Err(Ended::Infeasible) => QpOutcome::Infeasible { iterations },
            Err(Ended::Expired) => QpOutcome::Expired { iterations },
            Err(Ended::Failed) => QpOutcome::Failed { iterations },
        }
    }
}

impl Run<'_, '_> {
    fn solve(&mut self, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> Result<(), Ended> {
        let qp = self.qp;
        if !self.factor.compute(qp.hessian, qp.variables) {
            return Err(Ended::Failed);
        }
        for (y0, g) in self.y0.iter_mut().zip(&qp.gradient[..qp.variables]) {
            *y0 = -g;
        }
        self.y0[qp.variables..].fill(0.0);
        self.factor.solve_transposed(self.y0, 0);
        self.warm_start(answer.working, expired)?;
        loop {
            answer.z[..qp.stride].copy_from_slice(self.y);
            self.factor.solve(&mut answer.z[..qp.stride]);
            let worst = self.violations(answer.z);
            if worst <= FEASIBLE {
                if self.fresh {
                    self.refine(answer.z);
                    break;
                }
                self.take_nearest(expired)?;
                continue;
            }
            let mut any = false;
            while let Some((row, side)) = self.next_violated(CLOSE_TO_WORST * worst) {
                if !self.add(row, side, CLOSE_TO_WORST * worst, answer, expired)? {
                    break;
                }
                any = true;
            }
            // A violation that only rounding on the way to z shows: W is as good as it gets, and the caller checks z.
            if !any && self.fresh {
                break;
            }
            if !any {
                self.take_nearest(expired)?;
            }
        }
        self.write_working(answer.working);
        answer.multipliers.fill(0.0);
        for member in &self.working.members[..self.working.len] {
            // One that counts as zero must not seem to push at the other bound.
            answer.multipliers[usize::from(member.row)] = signed(member.side, member.multiplier.max(0.0));
        }
        Ok(())
    }

    fn write_working(&self, working: &mut [RowState]) {
        working.fill(RowState::Inactive);
        for member in &self.working.members[..self.working.len] {
            working[usize::from(member.row)] = member.side;
        }
    }

    /// W from the guess, without the rows that depend on others or do not push: then λ ≥ 0, as the method needs it.
    fn warm_start(&mut self, guess: &[RowState], expired: &mut dyn FnMut() -> bool) -> Result<(), Ended> {
        for (row, side) in members_of(guess) {
            if !self.bound(row, side).is_finite() || self.working.len >= self.qp.variables {
                continue;
            }
            let start = self.normal(row, side);
            let projection = self.working.project(self.c, self.d, start);
            if !projection.dependent {
                self.working.push(Member::new(row, side, self.bound(row, side)), &projection, self.c, self.d);
            }
        }
        self.take_nearest(expired)
    }

    /// One more addition or removal, if there are any left and there is time.
    fn count_iteration(&mut self, expired: &mut dyn FnMut() -> bool) -> Result<(), Ended> {
        if self.iterations >= self.max_iterations {
            return Err(Ended::Failed);
        }
        if expired() {
            return Err(Ended::Expired);
        }
        self.iterations += 1;
        Ok(())
    }

    /// y and λ from W; members with λ < 0 leave first, the worst ones together.
    fn take_nearest(&mut self, expired: &mut dyn FnMut() -> bool) -> Result<(), Ended> {
        loop {
            self.working.nearest(self.y0, self.y, self.d);
            let members = &self.working.members[..self.working.len];
            let (mut largest, mut worst) = (0.0_f64, 0.0_f64);
            for push in members.iter().map(Member::push) {
                (largest, worst) = (largest.max(push.abs()), worst.min(push));
            }
            if worst >= -ZERO_MULTIPLIER * largest {
                self.fresh = true;
                return Ok(());
            }
            // The last ones first: what stands behind a member is rotated when it leaves.
            for index in (0..self.working.len).rev() {
                if self.working.members[index].push() <= CLOSE_TO_WORST_PULL * worst {
                    self.count_iteration(expired)?;
                    self.working.remove(index, self.d);
                }
            }
        }
    }

    /// Where an ill-conditioned H leaves the rows of W missed by more than rounding: once more, by what they are missed. The
    /// values are those at z.
    fn refine(&mut self, z: &mut [f64]) {
        let len = self.working.len;
        self.d[..padded(len)].fill(0.0);
        let mut worst = 0.0_f64;
        for (d, member) in self.d.iter_mut().zip(&self.working.members[..len]) {
            let row = usize::from(member.row);
            let value = if member.side == RowState::Upper { -self.values[row] } else { self.values[row] };
            *d = member.bound - value;
            worst = worst.max(d.abs() * self.qp.weight[row]);
        }
        if worst > MISSED {
            // Rows that nearly depend on one another would ask for more than rounding.
            let reach = ROUNDING * libm::sqrt(norm_squared(self.y));
            self.working.raise(self.d, self.y, reach);
            z[..self.qp.stride].copy_from_slice(self.y);
            self.factor.solve(&mut z[..self.qp.stride]);
        }
    }

    /// The bound with the sign of the normal: cᵀy ≥ bound.
    fn bound(&self, row: usize, side: RowState) -> f64 {
        match side {
            RowState::Upper => -self.qp.upper[row],
            _ => self.qp.lower[row],
        }
    }

    /// Writes the normal c = ± U⁻ᵀ a of a row; gives the column before which it is zero.
    fn normal(&mut self, row: usize, side: RowState) -> usize {
        let start = self.qp.rows.coefficients(row, self.c);
        self.c[..start].fill(0.0);
        if side == RowState::Upper {
            self.c[start..].iter_mut().for_each(|c| *c = -*c);
        }
        self.factor.solve_transposed(self.c, start);
        start
    }

    /// The largest violation times weight at z; 0 where all rows are met. Where one is not, the values become the violations
    /// times weight, with the sign of their side.
    fn violations(&mut self, z: &[f64]) -> f64 {
        let qp = self.qp;
        qp.rows.values(z, self.values);
        let bounds = || groups(qp.lower).iter().zip(groups(qp.upper)).zip(groups(qp.weight));
        let mut worst = f64x4::ZERO;
        for (value, ((lower, upper), weight)) in groups(self.values).iter().zip(bounds()) {
            let value = f64x4::new(*value);
            let outside = (value - f64x4::new(*upper)).fast_max(f64x4::new(*lower) - value);
            worst = (outside * f64x4::new(*weight)).fast_max(worst);
        }
        let worst = worst.to_array().into_iter().fold(0.0, f64::max);
        if worst > FEASIBLE {
            for (value, ((lower, upper), weight)) in groups_mut(self.values).iter_mut().zip(bounds()) {
                let here = f64x4::new(*value);
                let above = (here - f64x4::new(*upper)).fast_max(f64x4::ZERO);
                let below = (f64x4::new(*lower) - here).fast_max(f64x4::ZERO);
                *value = (f64x4::new(*weight) * (above - below)).to_array();
            }
        }
        worst
    }

    /// Takes the largest violation of at least `least` (above zero) from the list, the first of equals.
    fn next_violated(&mut self, least: f64) -> Option<(usize, RowState)> {
        let values = groups(self.values);
        let worst = largest_magnitude(self.values);
        if worst < least {
            return None;
        }
        let is_worst = |group: &[f64; LANES]| f64x4::new(*group).abs().simd_eq(f64x4::splat(worst)).any();
        let group = values.iter().position(is_worst)?;
        let row = group * LANES + values[group].iter().position(|value| value.abs() == worst)?;
        let side = if self.values[row] > 0.0 { RowState::Upper } else { RowState::Lower };
        self.values[row] = 0.0;
        Some((row, side))
    }

    /// Adds a row to W, if its violation times weight is still at least `least`: steps along the part of its normal that W
    /// leaves, letting members go whose multiplier reaches zero on the way. Says whether that has changed W.
    fn add(
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
            let len = self.working.len;
            let independent = (!projection.dependent && len < self.qp.variables).then_some(projection);
            let full = independent.map_or(f64::INFINITY, |projection| (violation / projection.rest).max(0.0));
            // λ of the members falls by step · R⁻¹ d.
            let fall = &mut self.fall[..padded(len)];
            fall.copy_from_slice(&self.d[..padded(len)]);
            self.working.solve(fall);
            let pairs = || self.working.members[..len].iter().zip(fall.iter());
            let mut largest = 0.0_f64;
            for (member, fall) in pairs() {
                let push = fall.abs() * member.length;
                largest = if push > largest { push } else { largest };
            }
            let mut blocking = (full, None);
            for (index, (member, fall)) in pairs().enumerate() {
                if fall * member.length > ZERO_MULTIPLIER * largest && member.multiplier < blocking.0 * fall {
                    blocking = (member.multiplier / fall, Some(index));
                }
            }
            let (step, blocked_by) = blocking;
            if independent.is_none() {
                // c is a combination of the members' normals: where it is one but for rounding, or y has drifted, their bounds
                // say what is missing, and y does not.
                let missed = pairs().fold(bound, |missed, (member, fall)| missed - fall * member.bound);
                let is_exact = projection.rest <= projection.whole * (COMBINED * COMBINED);
                if (is_exact || (!self.fresh && step.is_infinite())) && missed <= FEASIBLE / weight {
                    return Ok(has_let_go);
                }
            }
            if step.is_infinite() {
                if violation <= FEASIBLE / weight {
                    // Met, perhaps by letting others go, and dependent by rounding on those that are left: no contradiction.
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
                // Once it has pushed it belongs to W, even where letting others go meets it: without it W would not hold y.
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

/// A multiplier λ ≥ 0 with the sign of its side.
fn signed(side: RowState, multiplier: f64) -> f64 {
    if side == RowState::Upper { multiplier } else { -multiplier }
}
