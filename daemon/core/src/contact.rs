//! Which axes are in contact (III.C): an axis joins when |f̂| exceeds β and leaves below the release threshold. While it is
//! active it carries the sign of its contact, which never flips: release first, then activation.

use nalgebra::SVector;

/// Thresholds on |f̂| per task axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thresholds<const D: usize> {
    /// Axes that admittance control may take over at all.
    pub admittance: [bool; D],
    /// β in N or N·m: an axis joins above it.
    pub activation: SVector<f64, D>,
    /// In N or N·m, at most β: an active axis leaves below it. The paper has one threshold for both.
    pub release: SVector<f64, D>,
}

/// Normal components below this carry no force worth a bound.
const LEAST_NORMAL_COMPONENT: f64 = 0.1;

/// The signs of contact that a surface gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceSigns<const D: usize>([f64; D]);

impl<const D: usize> SurfaceSigns<D> {
    /// For the outward `normal`: the robot presses against it.
    pub fn of(normal: &SVector<f64, D>) -> Self {
        let sign = |n: f64| if n.abs() >= LEAST_NORMAL_COMPONENT { -n.signum() } else { 0.0 };
        Self(core::array::from_fn(|axis| sign(normal[axis])))
    }

    /// s of an axis; `None` where the normal has hardly a component.
    pub fn sign(&self, axis: usize) -> Option<f64> {
        (self.0[axis] != 0.0).then_some(self.0[axis])
    }

    /// The admittance axes that feel the surface.
    pub fn axes(self, admittance: &[bool; D]) -> impl Iterator<Item = usize> + use<D> {
        let felt: [bool; D] = core::array::from_fn(|axis| admittance[axis] && self.0[axis] != 0.0);
        (0..D).filter(move |&axis| felt[axis])
    }
}

/// The contact of every axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact<const D: usize> {
    /// s per axis: +1 or −1 while active, 0 otherwise.
    signs: [f64; D],
}

impl<const D: usize> Contact<D> {
    /// No axis in contact.
    pub fn none() -> Self {
        Self { signs: [0.0; D] }
    }

    /// The contact after the estimate `wrench` (N, N·m; robot on environment). With the signs of a `surface`, an axis joins
    /// with its own only.
    #[must_use]
    pub fn update(
        &self,
        thresholds: &Thresholds<D>,
        surface: Option<&SurfaceSigns<D>>,
        wrench: &SVector<f64, D>,
    ) -> Self {
        let mut next = *self;
        for (axis, sign) in next.signs.iter_mut().enumerate() {
            if *sign != 0.0 {
                if *sign * wrench[axis] < thresholds.release[axis] {
                    *sign = 0.0;
                }
            } else if thresholds.admittance[axis] && wrench[axis].abs() > thresholds.activation[axis] {
                let felt = if wrench[axis] > 0.0 { 1.0 } else { -1.0 };
                *sign = if surface.is_none_or(|signs| signs.sign(axis) == Some(felt)) { felt } else { 0.0 };
            }
        }
        next
    }

    /// Whether any axis is in contact.
    pub fn is_any(&self) -> bool {
        self.signs.iter().any(|&sign| sign != 0.0)
    }

    /// Which axes are in contact.
    pub fn active(&self) -> [bool; D] {
        self.signs.map(|sign| sign != 0.0)
    }

    /// s of an axis, `None` while it is not in contact.
    pub fn sign(&self, axis: usize) -> Option<f64> {
        (self.signs[axis] != 0.0).then_some(self.signs[axis])
    }

    /// One bit per active axis, axis 0 lowest.
    pub fn mask(&self) -> u32 {
        (0..D).filter(|&axis| self.signs[axis] != 0.0).fold(0, |mask, axis| mask | 1 << axis)
    }
}
