//! The bounds, and which constraint row is which: the forces (18d), (18e), f_min ≤ s·f_lin ≤ f_max
//! on every bounded axis at every force point of the horizon, and the limits of joints and offset.
//!
//! Rows stand section by section in the order of [`RowKind`], in a section instant by instant, at
//! one instant by axis or joint.

use core::ops::Range;

use nalgebra::SVector;

use crate::mpc::condensation::InputAxes;
use crate::mpc::horizon::Horizon;
use crate::output::MAX_STEPS;
use crate::robot::{Interval, Reference};

/// Bounds of the force on one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisBound {
    /// The task axis.
    pub axis: usize,
    /// s: sign of the contact on this axis, +1 or −1.
    pub sign: f64,
    /// Lower bound of s·f_lin in N; −∞ if there is none.
    pub minimum: f64,
    /// Upper bound of s·f_lin in N.
    pub maximum: f64,
}

/// The axes with a bounded force in one cycle, at most D.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceBounds<const D: usize> {
    bounds: [AxisBound; D],
    len: usize,
}

impl<const D: usize> ForceBounds<D> {
    /// No axis bounded.
    pub fn none() -> Self {
        Self {
            bounds: [AxisBound { axis: 0, sign: 1.0, minimum: f64::NEG_INFINITY, maximum: f64::INFINITY }; D],
            len: 0,
        }
    }

    /// Adds the bound of one more axis; beyond D it is ignored, since each axis has one bound.
    pub fn push(&mut self, bound: AxisBound) {
        if self.len < D {
            self.bounds[self.len] = bound;
            self.len += 1;
        }
    }

    /// The bounds, in the order in which the rows of one instant stand.
    pub fn as_slice(&self) -> &[AxisBound] {
        &self.bounds[..self.len]
    }
}

/// Lower bound of what the inputs add to the commanded speed along a normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalSpeed<const D: usize> {
    /// n, outward.
    pub normal: SVector<f64, D>,
    /// Least nᵀu_k of each step, m/s.
    pub least: [f64; MAX_STEPS],
}

/// What the drives allow of the references in one cycle: (r_k − r_{k−1}) / h and the change of that over h, where h
/// is the length of step k − 1 (of step 0 for k = 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveBounds<const N: usize> {
    /// Largest of the first per joint, rad/s².
    pub acceleration: SVector<f64, N>,
    /// Largest of the second per joint, rad/s³; infinite where there is none.
    pub jerk: SVector<f64, N>,
    /// r before the first step.
    pub before: Reference<N>,
    /// r in each step without the inputs, rad/s: with the drift of the turning arm, and the turning of J.
    pub without_inputs: [SVector<f64, N>; MAX_STEPS],
}

impl<const N: usize> DriveBounds<N> {
    /// Before how many of the `steps` the jerk can be a bound: where its change over a longer one leads from full
    /// acceleration to full braking, it is none.
    fn jerk_steps(&self, steps: impl Iterator<Item = f64>) -> usize {
        let binds = |since: f64| (0..N).any(|joint| self.jerk[joint] * since < 2.0 * self.acceleration[joint]);
        steps.take_while(|since| binds(*since)).count()
    }

    /// What the change of r before step `step` is without the inputs, rad/s.
    pub(crate) fn change(&self, step: usize) -> SVector<f64, N> {
        let before = match step.checked_sub(1) {
            Some(before) => self.without_inputs[before],
            None => self.before.velocity.into(),
        };
        self.without_inputs[step] - before
    }
}

/// Everything that is bounded in one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constraints<'a, const N: usize, const D: usize> {
    /// s·f_lin at every force point.
    pub force: ForceBounds<D>,
    /// J⁻¹ (ṗ0 + Δṗ) in every step, rad/s.
    pub joint_speed: Option<Interval<N>>,
    /// Change of the references, and the change of that.
    pub drives: Option<&'a DriveBounds<N>>,
    /// Where each joint would come to rest, q + T_V q̇, at the end of every step, rad: bounded
    /// itself, q could reach its limit at a speed.
    pub rest_position: Option<Interval<N>>,
    /// Δṗ in every step, m/s and rad/s.
    pub offset: Option<Interval<D>>,
    /// (u_k − u_{k−1}) over the length of step k − 1 (of step 0 for k = 0), m/s² and rad/s².
    pub rate: Option<Interval<D>>,
    /// nᵀu in every step, m/s.
    pub normal_speed: Option<NormalSpeed<D>>,
}

impl<const N: usize, const D: usize> Constraints<'_, N, D> {
    /// Only the force is bounded, as in the paper.
    pub fn of_force(force: ForceBounds<D>) -> Self {
        Self {
            force,
            joint_speed: None,
            drives: None,
            rest_position: None,
            offset: None,
            rate: None,
            normal_speed: None,
        }
    }
}

/// What a row bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowKind {
    /// Speed of a joint; the instant is the step.
    JointSpeed,
    /// Change of a joint's reference; the instant is the step at whose start it changes.
    JointAcceleration,
    /// Change of that change relative to the times between; likewise.
    JointJerk,
    /// Offset of an input axis; the instant is the step.
    Offset,
    /// Change of the offset of an input axis; the instant is the step at whose start it changes.
    Rate,
    /// Speed along the normal that the inputs command; the instant is the step.
    NormalSpeed,
    /// Where a joint would come to rest, at the end of the step that is the instant.
    RestPosition,
    /// Force on an axis; the instant is the force point.
    Force,
    /// Softened lower bound of the force on an axis; the instant is the force point.
    MinimumForce,
    /// The slack t ≥ 0 of a softened problem.
    Slack,
}

/// Number of kinds.
pub(crate) const ROW_KINDS: usize = 10;

/// The bounds of the force that one common slack t ≥ 0 softens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Softened {
    /// s·f_lin ≤ f_max + t; no lower bound.
    Maximum,
    /// s·f_lin ≥ f_min − t.
    Minimum,
}

/// One row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row {
    /// What it bounds.
    pub kind: RowKind,
    /// The joint or task axis.
    pub component: usize,
    /// When: see [`RowKind`].
    pub instant: usize,
}

/// Rows of one kind: the first `len` of `components` at each of so many instants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Section<const C: usize> {
    components: [u8; C],
    len: usize,
    instants: usize,
    /// Row of the first.
    offset: usize,
    /// The row behind the last.
    end: usize,
}

/// Which row is which.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    sections: [Section<8>; ROW_KINDS],
    rows: usize,
}

const KINDS: [RowKind; ROW_KINDS] = [
    RowKind::JointSpeed,
    RowKind::JointAcceleration,
    RowKind::JointJerk,
    RowKind::Offset,
    RowKind::Rate,
    RowKind::NormalSpeed,
    RowKind::RestPosition,
    RowKind::Force,
    RowKind::MinimumForce,
    RowKind::Slack,
];

impl Layout {
    /// The rows of these constraints over this horizon.
    pub fn new<const N: usize, const D: usize>(
        constraints: &Constraints<'_, N, D>,
        horizon: &Horizon<N, D>,
        inputs: &InputAxes<D>,
        softened: Option<Softened>,
    ) -> Self {
        let steps = horizon.steps().len();
        let none = Section { components: [0; 8], len: 0, instants: 0, offset: 0, end: 0 };
        let mut layout = Self { sections: [none; ROW_KINDS], rows: 0 };
        const JOINTS: [u8; 8] = [0, 1, 2, 3, 4, 5, 6, 7];
        const ONE: [u8; 8] = [0; 8];
        let (mut inputs_of, mut forced) = ([0; 8], [0; 8]);
        let (inputs, bounds) = (inputs.as_slice(), constraints.force.as_slice());
        inputs_of.iter_mut().zip(inputs).for_each(|(to, axis)| *to = *axis as u8);
        forced.iter_mut().zip(bounds).for_each(|(to, bound)| *to = bound.axis as u8);
        let of = |count: usize, is_bounded: bool| if is_bounded { count } else { 0 };
        let (points, driven) = (horizon.force_points().len(), of(N, constraints.drives.is_some()));
        let lengths = (0..steps).map(|step| horizon.since_change(step));
        let jerked = constraints.drives.map_or(0, |drives| drives.jerk_steps(lengths));
        let softly = of(bounds.len(), softened == Some(Softened::Minimum));
        layout.add(RowKind::JointSpeed, JOINTS, of(N, constraints.joint_speed.is_some()), steps);
        layout.add(RowKind::JointAcceleration, JOINTS, driven, steps);
        layout.add(RowKind::JointJerk, JOINTS, driven, jerked);
        layout.add(RowKind::Offset, inputs_of, of(inputs.len(), constraints.offset.is_some()), steps);
        layout.add(RowKind::Rate, inputs_of, of(inputs.len(), constraints.rate.is_some()), steps);
        layout.add(RowKind::NormalSpeed, ONE, of(1, constraints.normal_speed.is_some()), steps);
        layout.add(RowKind::RestPosition, JOINTS, of(N, constraints.rest_position.is_some()), steps);
        layout.add(RowKind::Force, forced, bounds.len(), points);
        layout.add(RowKind::MinimumForce, forced, softly, points);
        layout.add(RowKind::Slack, ONE, of(1, softened.is_some()), 1);
        layout
    }

    // Called with constants: most of it is gone then.
    #[inline(always)]
    fn add(&mut self, kind: RowKind, components: [u8; 8], len: usize, instants: usize) {
        let offset = self.rows;
        self.rows += len * instants;
        self.sections[kind as usize] = Section { components, len, instants, offset, end: self.rows };
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The rows of one kind.
    pub(crate) fn rows_of(&self, kind: RowKind) -> Range<usize> {
        let section = &self.sections[kind as usize];
        section.offset..section.end
    }

    /// Row of the first component of `kind` at `instant`; `None` where it has no rows.
    // Asked in every step of every pass over the rows.
    #[inline(always)]
    pub(crate) fn rows_at(&self, kind: RowKind, instant: usize) -> Option<usize> {
        let section = &self.sections[kind as usize];
        (instant < section.instants && section.len > 0).then(|| section.offset + instant * section.len)
    }

    /// Number of a row; `None` if there is no such row.
    pub(crate) fn number(&self, row: &Row) -> Option<usize> {
        let section = &self.sections[row.kind as usize];
        let component =
            section.components[..section.len].iter().position(|&component| usize::from(component) == row.component)?;
        Some(self.rows_at(row.kind, row.instant)? + component)
    }

    /// Last instant of a kind.
    pub(crate) fn last_instant(&self, kind: RowKind) -> usize {
        let section = &self.sections[kind as usize];
        section.instants.saturating_sub(1)
    }

    /// What row number `number` bounds; `None` when there is no such row.
    pub fn row(&self, number: usize) -> Option<Row> {
        // Sections follow one another.
        let (kind, section) = KINDS.into_iter().zip(&self.sections).find(|(_, section)| number < section.end)?;
        let index = number - section.offset;
        Some(Row {
            kind,
            component: usize::from(section.components[index % section.len]),
            instant: index / section.len,
        })
    }
}
