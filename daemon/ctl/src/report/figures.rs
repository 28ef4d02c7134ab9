//! The figures: force and velocity offset over time, the whole of it and at first contact, and the
//! path of the TCP. Of the demo they are figures 3, 4 and 5 of the paper, with the default profile
//! beside its three.

use std::ops::Range;

use ipc_types::TruthSample;
use plant_sim::scenario::Scenario;
use plotters::style::RGBColor;

use super::chart::{Chart, Line, LineStyle, Note, Panel};
use crate::demo::{LIMIT_N, Run};

/// One look per curve, distinguishable without colour: the paper's dashed, dash-dotted and solid,
/// and a dotted one. The demo's fifth controller is in the table only: the default profile with a
/// detected contact point lies on the default profile.
const STYLES: [LineStyle; 4] = [
    LineStyle { color: RGBColor(0xC4, 0x4E, 0x12), width: 1.4, dash: &[7.0, 4.0] },
    LineStyle { color: RGBColor(0x5B, 0x3F, 0xA0), width: 1.4, dash: &[9.0, 3.0, 2.0, 3.0] },
    LineStyle { color: RGBColor(0x0B, 0x5C, 0xAD), width: 2.2, dash: &[] },
    LineStyle { color: RGBColor(0x1B, 0x7F, 0x4B), width: 2.0, dash: &[2.0, 3.0] },
];
const LIMIT: LineStyle = LineStyle { color: RGBColor(0xB0, 0x00, 0x20), width: 1.2, dash: &[14.0, 5.0] };
const MATERIAL: RGBColor = RGBColor(0xEE, 0xEA, 0xE2);
const MATERIAL_INK: RGBColor = RGBColor(0x6B, 0x64, 0x58);

/// One line of every figure.
pub(super) struct Curve {
    pub(super) title: String,
    /// Time in s and force in N, or torque in N m.
    pub(super) force: Vec<(f64, f64)>,
    /// Time in s and velocity offset in m/s, or rad/s.
    pub(super) offset: Vec<(f64, f64)>,
    /// Two coordinates of the TCP in m.
    pub(super) path: Vec<(f64, f64)>,
}

/// Which part of the curves a picture over time shows.
pub(super) struct Window {
    /// s.
    pub(super) time: Range<f64>,
    /// N or N m.
    pub(super) force: Range<f64>,
    /// m/s or rad/s.
    pub(super) offset: Range<f64>,
}

/// Number in the paper, caption, chart.
pub(super) fn of_demo(runs: &[Run], scenario: &Scenario) -> [(u32, &'static str, Chart); 3] {
    let curves: Vec<Curve> = runs
        .iter()
        .map(|run| {
            let over_time = |value: fn(&TruthSample) -> f64| {
                run.truths.iter().map(|truth| (truth.scenario_time_s, value(truth))).collect()
            };
            Curve {
                title: run.controller.title.replace("D_low", "low").replace("D_high", "high"),
                force: over_time(|truth| truth.wrench[1]),
                offset: over_time(|truth| truth.velocity_offset[1]),
                path: run.truths.iter().map(|truth| (truth.tcp_position[0], truth.tcp_position[1])).collect(),
            }
        })
        .collect();
    let whole = Window { time: 0.75..2.0, force: -680.0..40.0, offset: -0.1..1.7 };
    let initial = Window { time: 0.81..0.96, force: -260.0..20.0, offset: -0.1..1.2 };
    let mut path = paths(&curves, ["x", "y"], 1.31..1.40, 0.645..0.69);
    if let Some(surface) = &scenario.surface {
        draw_surface(&mut path.panels[0], surface.point_m, surface.normal);
    }
    [
        (
            3,
            "contact force and velocity offset in y direction",
            over_time(&curves, "y", -LIMIT_N, whole, "Contact force and velocity offset in y over time"),
        ),
        (
            4,
            "the same, initial contact phase",
            over_time(&curves, "y", -LIMIT_N, initial, "Contact force and velocity offset in y at first contact"),
        ),
        (5, "TCP trajectories in the initial contact phase", path),
    ]
}

/// Force above velocity offset on one task axis, with the force limit.
pub(super) fn over_time(curves: &[Curve], axis: &str, limit: f64, window: Window, description: &str) -> Chart {
    let Window { time, force, offset } = window;
    let unit = if axis.starts_with('r') { ["N m", "rad/s"] } else { ["N", "m/s"] };
    let panel = |y: Range<f64>, y_label: String, points: fn(&Curve) -> &Vec<(f64, f64)>| Panel {
        x: time.clone(),
        y,
        x_label: "time in s".to_owned(),
        y_label,
        logarithmic: false,
        areas: Vec::new(),
        lines: lines(curves, points),
        notes: Vec::new(),
    };
    let mut forces = panel(force, format!("contact force f_{axis} in {}", unit[0]), |curve| &curve.force);
    forces.lines.push(Line { style: LIMIT, points: vec![(time.start, limit), (time.end, limit)] });
    let offsets = panel(offset, format!("velocity offset \u{394}{} in {}", rate(axis), unit[1]), |curve| &curve.offset);
    let mut legend = legend(curves);
    legend.push((LIMIT, format!("force limit {} {}", limit.abs(), unit[0])));
    Chart { size: (860, 620), description: description.to_owned(), legend, panels: vec![forces, offsets] }
}

/// Where the TCP was, on two axes.
pub(super) fn paths(curves: &[Curve], axes: [&str; 2], x: Range<f64>, y: Range<f64>) -> Chart {
    Chart {
        size: (860, 520),
        description: "Trajectories of the TCP near the first contact".to_owned(),
        legend: legend(curves),
        panels: vec![Panel {
            x,
            y,
            x_label: format!("{} in m", axes[0]),
            y_label: format!("{} in m", axes[1]),
            logarithmic: false,
            areas: Vec::new(),
            lines: lines(curves, |curve| &curve.path),
            notes: Vec::new(),
        }],
    }
}

fn lines(curves: &[Curve], points: fn(&Curve) -> &Vec<(f64, f64)>) -> Vec<Line> {
    curves.iter().zip(STYLES).map(|(curve, style)| Line { style, points: points(curve).clone() }).collect()
}

fn legend(curves: &[Curve]) -> Vec<(LineStyle, String)> {
    curves.iter().zip(STYLES).map(|(curve, style)| (style, curve.title.clone())).collect()
}

/// The letter of an axis under a dot, as far as there is one.
fn rate(axis: &str) -> &str {
    match axis {
        "x" => "\u{1E8B}",
        "y" => "\u{1E8F}",
        "z" => "\u{17C}",
        other => other,
    }
}

/// The material below a plane that holds `point` (m), in the picture of x and y.
fn draw_surface(panel: &mut Panel, point: [f64; 3], normal: [f64; 3]) {
    let (x, y) = (panel.x.clone(), panel.y.clone());
    let slope = -normal[0] / normal[1];
    let height = |at: f64| (point[1] + slope * (at - point[0])).clamp(y.start, y.end);
    // The material's outline has a corner where the surface leaves the picture.
    let leaves = point[0] + (y.start - point[1]) / slope;
    let corner = leaves.clamp(x.start, x.end);
    panel.areas.push((
        MATERIAL,
        vec![
            (x.start, y.start),
            (x.start, height(x.start)),
            (corner, height(corner)),
            (x.end, height(x.end)),
            (x.end, y.start),
        ],
    ));
    panel.notes.push(Note { text: "surface".to_owned(), at: (x.start + 0.004, y.start + 0.004), color: MATERIAL_INK });
}
