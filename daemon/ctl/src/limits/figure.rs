//! Highest safe speed against cycle time, a line for each stiffness, on logarithmic axes.

use std::ops::Range;

use plotters::style::RGBColor;

use super::cell::Cell;
use super::table::{Limits, milliseconds, stiffness};
use crate::report::chart::{Chart, Line, LineStyle, Panel};

/// From the softest surface to the stiffest, told apart by dashes as well as by colour.
pub(crate) const LOOKS: [LineStyle; 8] = [
    LineStyle { color: RGBColor(0x1B, 0x7F, 0x4B), width: 2.0, dash: &[2.0, 3.0] },
    LineStyle { color: RGBColor(0x2A, 0x9D, 0xA8), width: 1.6, dash: &[7.0, 4.0] },
    LineStyle { color: RGBColor(0x0B, 0x5C, 0xAD), width: 2.2, dash: &[] },
    LineStyle { color: RGBColor(0x7A, 0x3E, 0x9D), width: 1.6, dash: &[10.0, 3.0, 2.0, 3.0] },
    LineStyle { color: RGBColor(0xC4, 0x4E, 0x12), width: 1.6, dash: &[4.0, 2.0] },
    LineStyle { color: RGBColor(0xA0, 0x1F, 0x3C), width: 2.0, dash: &[1.0, 2.0] },
    LineStyle { color: RGBColor(0x55, 0x55, 0x55), width: 1.6, dash: &[12.0, 4.0] },
    LineStyle { color: RGBColor(0x8A, 0x6D, 0x1B), width: 2.2, dash: &[6.0, 2.0, 1.0, 2.0, 1.0, 2.0] },
];

/// The figure as SVG.
///
/// # Errors
/// What plotters says about a coordinate system that it cannot draw.
pub(crate) fn svg(limits: &Limits) -> Result<String, String> {
    // A logarithmic axis has no place for speeds below the lowest one tried.
    let points = |cell: &Cell| {
        let speed = cell.speed_m_s.filter(|speed| *speed > 0.0)?;
        Some((milliseconds(cell.sampling_time_s), speed))
    };
    let of_stiffness = |stiffness: f64| {
        let cells = limits.cells.iter().filter(move |cell| cell.stiffness_n_m == stiffness);
        cells.filter_map(points).collect::<Vec<_>>()
    };
    let styled = || LOOKS.into_iter().zip(&limits.stiffnesses_n_m);
    let times = limits.sampling_times_s.iter().map(|time| milliseconds(*time));
    let speeds = limits.cells.iter().filter_map(points).map(|(_, speed)| speed);
    let chart = Chart {
        size: (860, 480),
        description: "Highest safe approach speed against cycle time".to_owned(),
        legend: styled().map(|(style, k)| (style, format!("{} N/m", stiffness(*k)))).collect(),
        panels: vec![Panel {
            x: around(times),
            y: around(speeds),
            x_label: "cycle time in ms".to_owned(),
            y_label: "highest safe approach speed in m/s".to_owned(),
            logarithmic: true,
            areas: Vec::new(),
            lines: styled().map(|(style, k)| Line { style, points: of_stiffness(*k) }).collect(),
            notes: Vec::new(),
        }],
    };
    chart.svg()
}

/// A range with all values in it and some room on both sides.
fn around(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (least, most) = values.fold((f64::INFINITY, 0.0), |(least, most), value| (value.min(least), value.max(most)));
    // Without any value: any range.
    if most > 0.0 { least * 0.8..most * 1.25 } else { 0.01..1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::table::tests::made_up;
    use super::*;

    #[test]
    fn the_figure_names_its_lines_and_axes() {
        let svg = svg(&made_up()).unwrap();
        for text in ["cycle time in ms", "highest safe approach speed in m/s", "1e5 N/m", "3e5 N/m"] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn ranges_hold_all_values_and_are_above_zero() {
        let range = around([0.25, 4.0].into_iter());
        assert!(range.contains(&0.25) && range.contains(&4.0) && range.start > 0.0);
        assert!(around(std::iter::empty()).start > 0.0);
    }

    #[test]
    fn no_two_lines_share_a_colour() {
        for (index, look) in LOOKS.iter().enumerate() {
            assert!(LOOKS[..index].iter().all(|other| other.color != look.color));
        }
    }
}
