//! The nearest point to y0 on W afresh, and what rounding makes of it.

use super::{Ended, Run, ZERO_MULTIPLIER};
use crate::mpc::qp::RowState;
use crate::mpc::qp::lanes::{distance_squared, norm_squared, padded};

/// Part of y that it may be moved by to put rounding right.
const ROUNDING: f64 = 1e-9;
/// By how much of its scale a row of the working set may miss its bound.
const MISSED: f64 = 1e-13;
/// Part of the worst multiplier below zero from which on members of a wrong guess leave together.
const CLOSE_TO_WORST_PULL: f64 = 0.01;
/// Part of its square by which the distance from y0 has to grow to count as progress.
const PROGRESS: f64 = 1e-12;
/// Times without progress after which bounds that contradict each other a little are let be.
const PATIENCE: u32 = 4;
/// Times without progress after which the solver gives up.
const IMPATIENCE: u32 = 9;

impl Run<'_, '_> {
    /// y and λ from a guess of W; members with λ < 0 leave first, the worst ones together.
    pub(super) fn take_guess(&mut self, expired: &mut dyn FnMut() -> bool) -> Result<(), Ended> {
        loop {
            let (largest, worst) = self.nearest();
            self.take_multipliers(1.0);
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

    /// y and λ from W. Where that makes some λ negative, λ goes towards it as far as none is, and
    /// the first that would be leaves: each step lengthens the distance from y0 that λ stands for,
    /// so nothing that has been gained is lost again.
    pub(super) fn take_nearest(&mut self, expired: &mut dyn FnMut() -> bool) -> Result<(), Ended> {
        loop {
            let (largest, worst) = self.nearest();
            if worst >= -ZERO_MULTIPLIER * largest {
                self.take_multipliers(1.0);
                self.fresh = true;
                return self.look_at_progress();
            }
            let members = &self.working.members[..self.working.len];
            let (mut part, mut first) = (1.0, 0);
            for (index, (member, lambda)) in members.iter().zip(self.d.iter()).enumerate() {
                if lambda * member.length < -ZERO_MULTIPLIER * largest
                    && member.multiplier < part * (member.multiplier - lambda)
                {
                    (part, first) = (member.multiplier / (member.multiplier - lambda), index);
                }
            }
            self.take_multipliers(part);
            self.count_iteration(expired)?;
            self.working.remove(first, self.d);
        }
    }

    /// Counts how often y was no farther from y0 than before, and gives up in the end.
    fn look_at_progress(&mut self) -> Result<(), Ended> {
        let distance = distance_squared(self.y, self.y0);
        if distance > self.farthest * (1.0 + PROGRESS) {
            (self.farthest, self.idle) = (distance, 0);
            return Ok(());
        }
        self.idle += 1;
        if self.idle >= IMPATIENCE { Err(Ended::Failed) } else { Ok(()) }
    }

    /// Whether rows seem to be exchanged for one another without y getting farther from y0.
    pub(super) fn is_stuck(&self) -> bool {
        self.idle >= PATIENCE
    }

    /// y from W, and λ in `d`: the largest λ ‖c‖, and the least, or 0.
    fn nearest(&mut self) -> (f64, f64) {
        self.working.nearest(self.y0, self.y, self.d);
        let members = &self.working.members[..self.working.len];
        let pushes = members.iter().zip(self.d.iter()).map(|(member, lambda)| lambda * member.length);
        pushes.fold((0.0_f64, 0.0_f64), |(largest, worst), push| (largest.max(push.abs()), worst.min(push)))
    }

    /// λ goes this part of the way to what is in `d`.
    fn take_multipliers(&mut self, part: f64) {
        for (member, lambda) in self.working.members[..self.working.len].iter_mut().zip(self.d.iter()) {
            member.multiplier =
                if part < 1.0 { (member.multiplier + part * (lambda - member.multiplier)).max(0.0) } else { *lambda };
        }
    }

    /// By how much of its scale a member misses its bound at most; in `d` by how much each one
    /// does. The values are those at z.
    pub(super) fn missed(&mut self) -> f64 {
        let len = self.working.len;
        self.d[..padded(len)].fill(0.0);
        let mut worst = 0.0_f64;
        for (d, member) in self.d.iter_mut().zip(&self.working.members[..len]) {
            let row = usize::from(member.row);
            let value = if member.side == RowState::Upper { -self.values[row] } else { self.values[row] };
            *d = member.bound - value;
            worst = worst.max(d.abs() * self.qp.weight[row]);
        }
        worst
    }

    /// The factors of W from the rows themselves, thoroughly, as all that follow in this problem.
    pub(super) fn factor_anew(&mut self) {
        self.working.is_thorough = true;
        let len = core::mem::take(&mut self.working.len);
        for index in 0..len {
            // No more have been taken up than have been looked at.
            let member = self.working.members[index];
            self.take_up(member);
        }
    }

    /// Where an ill-conditioned H leaves the rows of W missed by more than rounding: once more, by
    /// what they are missed, which is in `d`.
    pub(super) fn refine(&mut self, missed: f64, z: &mut [f64]) {
        if missed > MISSED {
            // Rows that nearly depend on one another would ask for more than rounding.
            let reach = ROUNDING * libm::sqrt(norm_squared(self.y));
            self.working.raise(self.d, self.y, reach);
            z[..self.qp.stride].copy_from_slice(self.y);
            self.factor.solve(&mut z[..self.qp.stride]);
        }
    }
}
