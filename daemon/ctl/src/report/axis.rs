//! The axes of a panel, linear or logarithmic, as one type.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;

/// An axis.
#[derive(Clone)]
pub(crate) enum Axis {
    /// plotters' own.
    Linear(RangedCoordf64),
    /// Of a range above zero, with ticks at 1, 2 and 5 times the powers of ten.
    Logarithmic(Range<f64>),
}

impl Axis {
    pub(crate) fn new(range: &Range<f64>, logarithmic: bool) -> Self {
        if logarithmic { Self::Logarithmic(range.clone()) } else { Self::Linear(range.clone().into()) }
    }
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        match self {
            Self::Linear(axis) => axis.map(value, limit),
            Self::Logarithmic(range) => {
                let share = (value / range.start).ln() / (range.end / range.start).ln();
                limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
            }
        }
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        match self {
            Self::Linear(axis) => axis.key_points(hint),
            Self::Logarithmic(range) => {
                let decades = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
                let ticks = decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|n| n * 10f64.powi(decade)));
                ticks.filter(|tick| range.contains(tick)).collect()
            }
        }
    }

    fn range(&self) -> Range<f64> {
        match self {
            Self::Linear(axis) => axis.range(),
            Self::Logarithmic(range) => range.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use plotters::coord::ranged1d::BoldPoints;

    use super::*;

    #[test]
    fn decades_are_equally_long_on_a_logarithmic_axis() {
        let axis = Axis::new(&(0.01..10.0), true);
        assert_eq!([0.01, 0.1, 1.0, 10.0].map(|value| axis.map(&value, (0, 300))), [0, 100, 200, 300]);
        assert_eq!(axis.map(&1.0, (300, 0)), 100);
    }

    #[test]
    fn logarithmic_ticks_are_one_two_five() {
        let ticks = Axis::new(&(0.2..5.5), true).key_points(BoldPoints(10));
        assert_eq!(ticks.len(), 5, "{ticks:?}");
        assert!(ticks.iter().zip([0.2, 0.5, 1.0, 2.0, 5.0]).all(|(a, b): (&f64, f64)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn a_linear_axis_is_plotters_own() {
        let (axis, own) = (Axis::new(&(-1.0..3.0), false), RangedCoordf64::from(-1.0..3.0));
        assert_eq!(axis.key_points(BoldPoints(6)), own.key_points(BoldPoints(6)));
        assert_eq!(axis.map(&0.7, (0, 1000)), own.map(&0.7, (0, 1000)));
    }
}
