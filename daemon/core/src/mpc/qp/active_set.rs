//! A dual active-set method after Goldfarb & Idnani, "A numerically stable dual method for solving
//! strictly convex quadratic programs" (Math. Prog. 27, 1983), with two-sided rows and a warm
//! start.
//!
//! In the coordinates y = U z (H = Uᵀ U) the problem is the point nearest to y0 = −U⁻ᵀ g that meets
//! all rows cᵀy ≥ b, c = ± U⁻ᵀ a. The method keeps the nearest point to y0 on a working set W with
//! multipliers λ ≥ 0, y = y0 + Σ λ_i c_i, and adds one violated row after the other; each addition
//! raises the distance from y0, so no W comes twice.
//!
//! # Rules
//! - **Choice**: all rows are looked at, and the violated ones added worst first (violation over
//!   scale), each looked at again before it is; of equals the first. So no tie depends on anything
//!   but the order of rows.
//! - **Dependence**: a row whose normal is a combination of those in W is exchanged for the member
//!   that blocks it, never added. Where none blocks, Σ of the members' normals with weights ≥ 0
//!   contradicts it: that is the certificate.
//! - **Drift**: what rounding adds up to in y over many steps is taken out by taking the nearest
//!   point afresh from W, at the end of every pass; a row of W that seems violated meanwhile is
//!   left alone. Where W is missed even then, its factors are made anew from the rows.
//! - **Cycling**: in exact arithmetic impossible, see above. With rounding, rows that all but
//!   depend on one another could be exchanged for ever. So one that W implies is left alone as far
//!   as [`ActiveSet`] promises, and whether y still gets farther from y0 is counted.
//! - **Nearly singular W**: rows are orthogonalised, not squared, and what depends within 1e-9
//!   never enters W.
//!
//! # Work
//! Set-up: n³/6 multiplications for U and n²/2 for y0; taking up a guess of w rows: w (n²/2 + 4 w
//! n) at most. Then iterations, each an addition or a removal, those of a wrong guess included;
//! before each the limit is looked at and `expired` asked. One takes n²/2 multiplications for a new
//! row, 4 w n to project it (once, whatever blocks it), 4 w n to remove one and 2 w n to take the
//! nearest point afresh; a pass over all rows, with n²/2 and what A z takes, comes at most twice an
//! iteration. W's factors are made anew once at most, w (n²/2 + 4 w n) again.

mod addition;
mod nearest;
mod violations;

use super::factor::Factor;
use super::lanes::{ALIGNMENT, before_cache_line, padded, tiles_mut};
use super::working_set::{Member, NO_MEMBERS, WorkingSet};
use super::{Answer, MAX_VARIABLES, Qp, QpOutcome, QpSolver, RowState, members_of};

/// Violation relative to a row's scale that counts as none.
const FEASIBLE: f64 = 1e-10;
/// Part of its length below which what is left of a normal may be what others leave that cancel.
const CANCELLING: f64 = 1e-3;
/// Part of the worst violation from which on others are added before all rows are looked at again:
/// of force points close to one another the list would go through all, each exchanged for the next.
const CLOSE_TO_WORST: f64 = 0.3;
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
        Factor::storage_len(stride) + 2 * stride * stride + 6 * stride + padded(self.rows) + ALIGNMENT
    }
}

/// The solver.
///
/// # Nearly dependent rows
/// What a `Solved` answer promises, in the coordinates y = U z, H = Uᵀ U, in which a row is cᵀy ≥ b
/// with c = ± U⁻ᵀ a: every row is met to 1e-10 of its scale, and to rounding. But a row outside the
/// working set may all but be a combination of those in it, c = Σ f_i c_i + e, with ‖e‖ at most
/// 1e-9 of ‖c‖ or 1e-12 of the longest f_i c_i. Rounding cannot tell that from an exact one, and
/// stepping along e would move y by the violation divided by ‖e‖. Where the members miss their
/// bounds by o_i,
///
/// b − cᵀy = (b − Σ f_i b_i) + Σ f_i o_i − eᵀy,
///
/// so such a row is violated by at most m + Σ |f_i o_i| + ‖e‖ ‖y‖: what the bounds contradict one
/// another by, rounding by the conditioning of the working set, and the part of y that the row
/// alone sees. One member may be left out of the sum, if its own part in c is then in e.
///
/// m is at most 1e-10 of the row's scale. Where exchanging such rows for one another takes y no
/// farther from y0 any more, it may be 1e-6, and so may the violation of a row with an ‖e‖ of up to
/// 1e-7 of ‖c‖; whoever needs better looks at [`super::kkt_residual`]. Where it would be more than
/// that, the outcome is `Failed` or `Infeasible`.
///
/// A row with slightly more left of its normal than that is followed, and its multiplier is as
/// large as y moves over ‖e‖. Where the rounding of the working set's multipliers, 4 ε Σ λ_i ‖c_i‖,
/// would violate a row by more than 1e-10 of its scale, the solver may exchange rows without end,
/// and then gives up: `Failed`.
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
    /// A solver that takes up to `max_iterations` additions and removals; `None` when `storage` is
    /// shorter than [`SolverCapacity::storage_len`] or the capacity beyond [`MAX_VARIABLES`].
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
    scratch: &'a mut [f64],
    /// A z.
    values: &'a mut [f64],
    /// Whether y and λ are those of W to rounding, and not a sum of many steps.
    fresh: bool,
    /// The farthest that y has been from y0 when it was, squared.
    farthest: f64,
    /// How often it was no farther since.
    idle: u32,
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
        let (fall, rest) = rest.split_at_mut(stride);
        let (scratch, values) = rest.split_at_mut(stride);
        let mut run = Run {
            qp,
            factor: Factor::within(factor, stride),
            working: WorkingSet {
                members: &mut self.members,
                len: 0,
                q: tiles_mut(q),
                r: tiles_mut(r),
                stride,
                is_thorough: false,
            },
            y0,
            y,
            c,
            d,
            fall,
            scratch,
            values: &mut values[..padded(qp.row_count)],
            fresh: false,
            farthest: 0.0,
            idle: 0,
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
            let worst = self.worst_violation(answer.z);
            let missed = if self.fresh { self.missed() } else { 0.0 };
            if missed > FEASIBLE && !self.working.is_thorough {
                self.factor_anew();
                self.take_nearest(expired)?;
                continue;
            }
            if worst <= FEASIBLE {
                if self.fresh {
                    self.refine(missed, answer.z);
                    break;
                }
                self.take_nearest(expired)?;
                continue;
            }
            self.list_violations();
            let (mut any, mut least) = (false, CLOSE_TO_WORST * worst);
            while let Some((row, side)) = self.next_violated(least) {
                if self.add(row, side, least, answer, expired)? {
                    any = true;
                } else if any || !self.fresh {
                    break;
                } else {
                    // Left alone, however much it is violated: then the others are no less urgent.
                    least = FEASIBLE;
                }
            }
            // A violation that only rounding on the way to z shows, or that is promised above: W is
            // as good as it gets, and the caller checks z.
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

    /// W from the guess, without the rows that depend on others or do not push: then λ ≥ 0, as the
    /// method needs it.
    fn warm_start(&mut self, guess: &[RowState], expired: &mut dyn FnMut() -> bool) -> Result<(), Ended> {
        for (row, side) in members_of(guess) {
            if !self.bound(row, side).is_finite() || self.working.len >= self.qp.variables {
                continue;
            }
            self.take_up(Member::new(row, side, self.bound(row, side)));
        }
        self.take_guess(expired)
    }

    /// Takes a member into W, unless it depends on those in it.
    fn take_up(&mut self, member: Member) {
        let start = self.normal(usize::from(member.row), member.side);
        let projection = self.working.project(self.c, self.d, start);
        // Only where little is left there may be others so long.
        let may_cancel = projection.rest <= projection.whole * (CANCELLING * CANCELLING);
        let is_cancelled = may_cancel && projection.is_cancelled(self.combine());
        if !projection.dependent && !is_cancelled {
            self.working.push(member, &projection, self.c, self.d);
        }
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
}

/// A multiplier λ ≥ 0 with the sign of its side.
fn signed(side: RowState, multiplier: f64) -> f64 {
    if side == RowState::Upper { multiplier } else { -multiplier }
}
