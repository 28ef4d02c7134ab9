//! Figures 3, 4 and 5 of the paper, and the default profile beside its three.

use std::ops::Range;

use ipc_types::TruthSample;
use plant_sim::scenario::Scenario;
use plotters::style::RGBColor;

use super::chart::{Chart, Line, LineStyle, Note, Panel};
use crate::demo::{LIMIT_N, Run};

/// One look per controller, distinguishable without colour: the paper's dashed, dash-dotted and solid, and a dotted one. A fifth
/// is in the table only: the default profile with a detected contact point lies on the default profile.
const STYLES: [LineStyle; 4] = [
    LineStyle { color: RGBColor(0xC4, 0x4E, 0x12), width: 1.4, dash: &[7.0, 4.0] },
    LineStyle { color: RGBColor(0x5B, 0x3F, 0xA0), width: 1.4, dash: &[9.0, 3.0, 2.0, 3.0] },
    LineStyle { color: RGBColor(0x0B, 0x5C, 0xAD), width: 2.2, dash: &[] },
    LineStyle { color: RGBColor(0x1B, 0x7F, 0x4B), width: 2.0, dash: &[2.0, 3.0] },
];
const LIMIT: LineStyle = LineStyle { color: RGBColor(0xB0, 0x00, 0x20), width: 1.2, dash: &[14.0, 5.0] };
const MATERIAL: RGBColor = RGBColor(0xEE, 0xEA, 0xE2);
const MATERIAL_INK: RGBColor = RGBColor(0x6B, 0x64, 0x58);

type Value = fn(&TruthSample) -> f64;

/// Number in the paper, caption, chart.
pub(super) fn all(runs: &[Run], scenario: &Scenario) -> [(u32, &'static str, Chart); 3] {
    let over_time = |time: Range<f64>, force: Range<f64>, offset: Range<f64>, description: &str| Chart {
        size: (860, 620),
        description: description.to_owned(),
        legend: legend(runs, true),
        panels: vec![
            time_panel(runs, &time, force, "contact force f_y in N", |truth| truth.wrench[1], true),
            time_panel(
                runs,
                &time,
                offset,
                "velocity offset \u{394}\u{1E8F} in m/s",
                |truth| truth.velocity_offset[1],
                false,
            ),
        ],
    };
    [
        (
            3,
            "contact force and velocity offset in y direction",
            over_time(0.75..2.0, -680.0..40.0, -0.1..1.7, "Contact force and velocity offset in y over time"),
        ),
        (
            4,
            "the same, initial contact phase",
            over_time(0.81..0.96, -260.0..20.0, -0.1..1.2, "Contact force and velocity offset in y at first contact"),
        ),
        (5, "TCP trajectories in the initial contact phase", trajectories(runs, scenario)),
    ]
}

fn legend(runs: &[Run], with_limit: bool) -> Vec<(LineStyle, String)> {
    let mut legend: Vec<_> = runs
        .iter()
        .zip(STYLES)
        .map(|(run, style)| (style, run.controller.title.replace("D_low", "low").replace("D_high", "high")))
        .collect();
    if with_limit {
        legend.push((LIMIT, format!("force limit {LIMIT_N} N")));
    }
    legend
}

fn time_panel(runs: &[Run], time: &Range<f64>, y: Range<f64>, y_label: &str, value: Value, with_limit: bool) -> Panel {
    let mut lines: Vec<Line> = runs
        .iter()
        .zip(STYLES)
        .map(|(run, style)| {
            let points = run.truths.iter().map(|truth| (truth.scenario_time_s, value(truth))).collect();
            Line { style, points }
        })
        .collect();
    if with_limit {
        lines.push(Line { style: LIMIT, points: vec![(time.start, -LIMIT_N), (time.end, -LIMIT_N)] });
    }
    Panel {
        x: time.clone(),
        y,
        x_label: "time in s".to_owned(),
        y_label: y_label.to_owned(),
        logarithmic: false,
        areas: Vec::new(),
        lines,
        notes: Vec::new(),
    }
}

fn trajectories(runs: &[Run], scenario: &Scenario) -> Chart {
    let (x, y) = (1.31..1.40, 0.645..0.69);
    let mut areas = Vec::new();
    let mut notes = Vec::new();
    if let Some(surface) = &scenario.surface {
        let slope = -surface.normal[0] / surface.normal[1];
        let height = |at: f64| (surface.point_m[1] + slope * (at - surface.point_m[0])).clamp(y.start, y.end);
        // Where the surface leaves the picture it has a corner of its own.
        let leaves = surface.point_m[0] + (y.start - surface.point_m[1]) / slope;
        let corner = leaves.clamp(x.start, x.end);
        areas.push((
            MATERIAL,
            vec![
                (x.start, y.start),
                (x.start, height(x.start)),
                (corner, height(corner)),
                (x.end, height(x.end)),
                (x.end, y.start),
            ],
        ));
        notes.push(Note { text: "surface".to_owned(), at: (x.start + 0.004, y.start + 0.004), color: MATERIAL_INK });
    }
    let lines = runs
        .iter()
        .zip(STYLES)
        .map(|(run, style)| {
            let points = run.truths.iter().map(|truth| (truth.tcp_position[0], truth.tcp_position[1])).collect();
            Line { style, points }
        })
        .collect();
    Chart {
        size: (860, 520),
        description: "Trajectories of the TCP near the first contact".to_owned(),
        legend: legend(runs, false),
        panels: vec![Panel {
            x,
            y,
            x_label: "x in m".to_owned(),
            y_label: "y in m".to_owned(),
            logarithmic: false,
            areas,
            lines,
            notes,
        }],
    }
}
