//! Which axes are in contact (III.C): an axis joins when |f̂| exceeds β, or somewhat earlier where the
//! samples show a surface, and leaves below the release threshold. While it is active it carries the
//! sign of its contact, which never flips: release first, then activation.

use nalgebra::SVector;

/// Share of β above which an axis joins where the samples show a surface. It is no smaller, since a bias, or a tool that is lighter
/// than told, enters what they show as it enters f̂.
const NOTICED: f64 = 0.8;

/// Thresholds on |f̂| per task axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thresholds<const D: usize> {
    /// Axes that admittance control may take over at all.
    pub admittance: [bool; D],
    /// β in N or N·m: an axis joins above it.
    pub activation: SVector<f64, D>,
    /// In N or N·m, at most β: an active axis leaves below it. The paper has one threshold for
    /// both.
    pub release: SVector<f64, D>,
}

impl<const D: usize> Thresholds<D> {
    /// The same for an f̂ that may be off by so much (N, N·m): a force has to be larger than that. An
    /// axis leaves where it was told to: an arm that comes to rest on a surface knows its friction less
    /// well, and must not take that for the end of the contact.
    #[must_use]
    pub(crate) fn beyond(&self, unsure: &SVector<f64, D>) -> Self {
        Self { activation: self.activation.sup(unsure), ..*self }
    }

    /// The same for a surface that the samples show: an axis joins below β, though not below the release threshold.
    #[must_use]
    pub(super) fn where_noticed(&self) -> Self {
        Self { activation: (self.activation * NOTICED).sup(&self.release), ..*self }
    }

    /// What is `felt` of a surface, on the axes on which f̂ presses the same way and would not release them.
    pub(super) fn held(&self, felt: &Felt<D>, wrench: &SVector<f64, D>) -> Felt<D> {
        let is_held = |axis: usize| felt.signs[axis] * wrench[axis] >= self.release[axis];
        Felt { signs: core::array::from_fn(|axis| if is_held(axis) { felt.signs[axis] } else { 0.0 }) }
    }

    /// Which axes feel a force above β in `wrench` (N, N·m).
    pub(crate) fn felt(&self, wrench: &SVector<f64, D>) -> Felt<D> {
        let sign = |axis: usize| {
            let is_felt = self.admittance[axis] && wrench[axis].abs() > self.activation[axis];
            match (is_felt, wrench[axis] > 0.0) {
                (false, _) => 0.0,
                (true, true) => 1.0,
                (true, false) => -1.0,
            }
        };
        Felt { signs: core::array::from_fn(sign) }
    }
}

/// The admittance axes on which f̂ is above β.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Felt<const D: usize> {
    /// The sign of f̂ per axis; 0 where it is not above β.
    signs: [f64; D],
}

impl<const D: usize> Felt<D> {
    /// Whether there is any.
    pub(crate) fn is_any(&self) -> bool {
        self.first().is_some()
    }

    /// The first of them.
    pub(crate) fn first(&self) -> Option<usize> {
        self.signs.iter().position(|&sign| sign != 0.0)
    }
}

/// Normal components below this carry no force worth a bound.
const LEAST_NORMAL_COMPONENT: f64 = 0.1;

/// The signs of contact that a surface gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfaceSigns<const D: usize>([f64; D]);

impl<const D: usize> SurfaceSigns<D> {
    /// For the outward `normal`: the robot presses against it.
    pub(crate) fn of(normal: &SVector<f64, D>) -> Self {
        let sign = |n: f64| if n.abs() >= LEAST_NORMAL_COMPONENT { -n.signum() } else { 0.0 };
        Self(core::array::from_fn(|axis| sign(normal[axis])))
    }

    /// Those of a normal that was learned: as they were told, unless it says otherwise.
    pub(crate) fn learned(&self, normal: &SVector<f64, D>) -> Self {
        let learned = Self::of(normal);
        let is_as_told = |axis: usize| self.0[axis] * normal[axis] < 0.0;
        Self(core::array::from_fn(|axis| if is_as_told(axis) { self.0[axis] } else { learned.0[axis] }))
    }

    /// s of an axis; `None` where the normal has hardly a component.
    pub(crate) fn sign(&self, axis: usize) -> Option<f64> {
        (self.0[axis] != 0.0).then_some(self.0[axis])
    }

    /// The admittance axes that feel the surface.
    pub(crate) fn axes(self, admittance: &[bool; D]) -> impl Iterator<Item = usize> + use<D> {
        let felt: [bool; D] = core::array::from_fn(|axis| admittance[axis] && self.0[axis] != 0.0);
        (0..D).filter(move |&axis| felt[axis])
    }
}

/// The contact of every axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Contact<const D: usize> {
    /// s per axis: +1 or −1 while active, 0 otherwise.
    signs: [f64; D],
}

impl<const D: usize> Contact<D> {
    /// No axis in contact.
    pub(crate) fn none() -> Self {
        Self { signs: [0.0; D] }
    }

    /// The contact after the estimate `wrench` (N, N·m; robot on environment), of which `felt` is
    /// above β. With the signs of a `surface`, an axis joins with its own only.
    #[must_use]
    pub(crate) fn update(
        &self,
        thresholds: &Thresholds<D>,
        felt: &Felt<D>,
        surface: Option<&SurfaceSigns<D>>,
        wrench: &SVector<f64, D>,
    ) -> Self {
        let mut next = *self;
        for (axis, sign) in next.signs.iter_mut().enumerate() {
            if *sign != 0.0 {
                if *sign * wrench[axis] < thresholds.release[axis] {
                    *sign = 0.0;
                }
            } else if surface.is_none_or(|signs| signs.sign(axis) == Some(felt.signs[axis])) {
                *sign = felt.signs[axis];
            }
        }
        next
    }

    /// Whether any axis is in contact.
    pub(crate) fn is_any(&self) -> bool {
        self.signs.iter().any(|&sign| sign != 0.0)
    }

    /// Which axes are in contact.
    pub(crate) fn active(&self) -> [bool; D] {
        self.signs.map(|sign| sign != 0.0)
    }

    /// s of an axis, `None` while it is not in contact.
    pub(crate) fn sign(&self, axis: usize) -> Option<f64> {
        (self.signs[axis] != 0.0).then_some(self.signs[axis])
    }

    /// One bit per active axis, axis 0 lowest.
    pub(crate) fn mask(&self) -> u32 {
        (0..D).filter(|&axis| self.signs[axis] != 0.0).fold(0, |mask, axis| mask | 1 << axis)
    }
}
