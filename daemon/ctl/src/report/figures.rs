//! The figures: force and velocity offset over time, the whole of it and at first contact, and the
//! path of the TCP. Of the demo they are figures 3, 4 and 5 of the paper, with the default profile
//! beside its three.

use std::ops::Range;

use ipc_types::TruthSample;
use plant_sim::scenario::Scenario;
use plotters::style::RGBColor;

use super::chart::{Chart, Line, LineStyle, Note, Panel};
use crate::demo::{LIMIT_N, Run};

/// One look per curve, distinguishable without colour: the paper's dashed, dash-dotted and solid, and
/// the default profile as a broad line, on which the one that finds the contact point lies as dots.
pub(crate) const STYLES: [LineStyle; 5] = [
    LineStyle { color: RGBColor(0xC4, 0x4E, 0x12), width: 1.4, dash: &[7.0, 4.0] },
    LineStyle { color: RGBColor(0x5B, 0x3F, 0xA0), width: 1.4, dash: &[9.0, 3.0, 2.0, 3.0] },
    LineStyle { color: RGBColor(0x0B, 0x5C, 0xAD), width: 2.2, dash: &[] },
    LineStyle { color: RGBColor(0x3F, 0xA8, 0x72), width: 4.0, dash: &[] },
    LineStyle { color: RGBColor(0x10, 0x3B, 0x26), width: 1.8, dash: &[2.0, 4.0] },
];
/// These colours and that of the limit, and what they are in the dark.
pub(super) const COLORS: [(RGBColor, &str); 6] = [
    (STYLES[0].color, "#F08A4B"),
    (STYLES[1].color, "#B39DF0"),
    (STYLES[2].color, "#62AEF5"),
    (STYLES[3].color, "#2C7A52"),
    (STYLES[4].color, "#C9F5DD"),
    (LIMIT.color, "#FF6B81"),
];
const LIMIT: LineStyle = LineStyle { color: RGBColor(0xB0, 0x00, 0x20), width: 1.2, dash: &[14.0, 5.0] };
/// What is believed, and what may be as well.
pub(super) const LIKELIEST: LineStyle = STYLES[2];
pub(super) const POSSIBLE: LineStyle = STYLES[0];
pub(super) const MATERIAL: RGBColor = RGBColor(0xEE, 0xEA, 0xE2);
pub(super) const MATERIAL_INK: RGBColor = RGBColor(0x6B, 0x64, 0x58);

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

/// Before and after the first contact of any controller, s: the paper's "initial contact phase".
const BEFORE_CONTACT_S: f64 = 0.01;
const AFTER_CONTACT_S: f64 = 0.14;
/// Paths are drawn for so long: low damping has then come back.
const PATH_S: f64 = 0.18;
/// Force in N that figure 4 shows at most: what the law is about is then large enough to read.
const INITIAL_FORCE_N: f64 = 1.3 * LIMIT_N;

/// Number in the paper, caption, chart.
pub(super) fn of_demo(runs: &[Run], scenario: &Scenario) -> [(u32, String, Chart); 3] {
    let truths = || runs.iter().flat_map(|run| &run.truths);
    let first_contact = truths().filter(|truth| truth.in_contact == 1).map(|truth| truth.scenario_time_s);
    let first_contact = first_contact.fold(f64::INFINITY, f64::min).min(range(truths().map(|t| t.scenario_time_s)).end);
    let initial = first_contact - BEFORE_CONTACT_S..first_contact + AFTER_CONTACT_S;
    let path = initial.start..first_contact + PATH_S;
    let is_on_path = |truth: &&TruthSample| path.contains(&truth.scenario_time_s);
    let curves: Vec<Curve> = runs
        .iter()
        .map(|run| {
            let over_time = |value: fn(&TruthSample) -> f64| {
                run.truths.iter().map(|truth| (truth.scenario_time_s, value(truth))).collect()
            };
            let at = |truth: &TruthSample| (truth.tcp_position[0], truth.tcp_position[1]);
            Curve {
                title: run.controller.title.replace("D_low", "low").replace("D_high", "high"),
                force: over_time(|truth| truth.wrench[1]),
                offset: over_time(|truth| truth.velocity_offset[1]),
                path: run.truths.iter().filter(is_on_path).map(at).collect(),
            }
        })
        .collect();
    let window = |time: Range<f64>| {
        let within = || truths().filter(|truth| time.contains(&truth.scenario_time_s));
        Window {
            force: roomy(&range(within().map(|truth| truth.wrench[1]).chain([0.0, -LIMIT_N]))),
            offset: roomy(&range(within().map(|truth| truth.velocity_offset[1]))),
            time: time.clone(),
        }
    };
    let whole = window(first_contact - 0.06..range(truths().map(|truth| truth.scenario_time_s)).end);
    let mut close = window(initial.clone());
    close.force.start = close.force.start.max(-INITIAL_FORCE_N);
    // The surface is drawn where it is touched.
    let touched = scenario.surface.as_ref().map_or([0.0; 3], |surface| surface.point_m);
    let paths_at = |axis: usize| {
        let shown = truths().filter(is_on_path).map(|truth| truth.tcp_position[axis]);
        roomy(&range(shown.chain(scenario.surface.as_ref().map(|_| touched[axis]))))
    };
    let mut trajectories = paths(&curves, ["x", "y"], paths_at(0), paths_at(1));
    if let Some(surface) = &scenario.surface {
        draw_surface(&mut trajectories.panels[0], surface.point_m, surface.normal);
    }
    let beyond = runs.iter().filter(|run| run.row.peak_force_y_n > INITIAL_FORCE_N);
    let beyond: Vec<String> =
        beyond.map(|run| format!("{} goes on to {:.0} N", run.controller.title, run.row.peak_force_y_n)).collect();
    let beyond = if beyond.is_empty() { String::new() } else { format!("; {}", beyond.join(", ")) };
    [
        (
            3,
            "contact force and velocity offset in y direction".to_owned(),
            over_time(&curves, "y", -LIMIT_N, whole, "Contact force and velocity offset in y over time"),
        ),
        (
            4,
            format!("the same, initial contact phase{beyond}"),
            over_time(&curves, "y", -LIMIT_N, close, "Contact force and velocity offset in y at first contact"),
        ),
        (5, "TCP trajectories from the first contact on; all come from straight above".to_owned(), trajectories),
    ]
}

/// Part of a range that is left free around its curves.
const ROOM: f64 = 0.08;

/// From the least to the largest finite value.
pub(crate) fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let finite = values.filter(|value| value.is_finite());
    let (low, high) =
        finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low <= high { low..high } else { 0.0..0.0 }
}

/// The range with room around, and never without width.
pub(crate) fn roomy(range: &Range<f64>) -> Range<f64> {
    let width = range.end - range.start;
    let room = if width > 0.0 { ROOM * width } else { 0.1 };
    range.start - room..range.end + room
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
    // The material's outline has a corner where the surface leaves the picture, above or below.
    let at_height = |height: f64| (point[0] + (height - point[1]) / slope).clamp(x.start, x.end);
    let mut corners = [at_height(y.start), at_height(y.end)];
    corners.sort_by(f64::total_cmp);
    let outline = [x.start, corners[0], corners[1], x.end].map(|at| (at, height(at)));
    panel.areas.push((MATERIAL, [&[(x.start, y.start)][..], &outline, &[(x.end, y.start)]].concat()));
    panel.notes.push(Note {
        text: "surface".to_owned(),
        at: (x.start + 0.04 * (x.end - x.start), y.start + 0.06 * (y.end - y.start)),
        color: MATERIAL_INK,
    });
}
