//! What was found as a page: the table, measured and fitted curves, and the fragment.

use std::fs;
use std::io;
use std::path::Path;

use super::found::{Case, Found};
use super::text::{JOINT_HEADER, ORDER, joints, rows};
use crate::report::chart::{Chart, Line, Panel, escape};
use crate::report::{STYLES, TAIL, figure, head, range, roomy, table};

/// What is drawn of a motion, s: the part in which a joint changes its speed the most.
const SHOWN_S: f64 = 1.0;

/// By this a page of identify is known.
pub(super) const TITLE: &str = "admittanced: identified";

/// A curve as it was measured, and as it is fitted.
struct Curves {
    caption: String,
    y_label: String,
    measured: Vec<(f64, f64)>,
    fitted: Vec<(f64, f64)>,
}

/// Writes index.html and its figures into a directory that is there.
pub(super) fn write(directory: &Path, files: &str, case: &Case<'_>, found: &Found, fragment: &str) -> io::Result<()> {
    let mut html = head(TITLE);
    html += &format!("<h1>{}</h1>\n<p>Identified from {}</p>\n", escape(&case.config.robot.name), escape(files));
    html += &table(&JOINT_HEADER, joints(found).into_iter());
    html += &format!("<p>{}</p>\n", escape(ORDER));
    html +=
        &table(&["", "found, with its 95 % interval"], rows(found).into_iter().map(|(name, value)| vec![name, value]));
    if !found.unknown.is_empty() {
        html += "<h2>Not told</h2>\n";
        let cells =
            |unknown: &super::unknown::Unknown| vec![unknown.what.clone(), unknown.why.clone(), unknown.motion.clone()];
        html += &table(&["what", "why", "what would tell it"], found.unknown.iter().map(cells));
    }
    html += &format!("<h2>Keys</h2>\n<pre>{}</pre>\n<h2>Measured and fitted</h2>\n", escape(fragment));
    for (number, curves) in curves(case, found).into_iter().enumerate() {
        let caption = format!("Figure {}: {}", number + 1, curves.caption);
        html += &figure(directory, &format!("figure-{}", number + 1), &caption, &chart(&curves))?;
    }
    fs::write(directory.join("index.html"), html + TAIL)
}

fn curves(case: &Case<'_>, found: &Found) -> Vec<Curves> {
    let mut all = Vec::new();
    for (number, joint) in found.loops.joints.iter().enumerate() {
        let moved = case.evidence().follow(&joint.model, number);
        let liveliest = case.tracks.iter().zip(&moved).map(|(track, moved)| {
            let samples: Vec<_> = track.velocity.iter().map(|velocity| velocity[number]).collect();
            let (start, change) = liveliest(&track.time_s, &samples);
            (change, start, track, moved)
        });
        let Some((_, start, track, moved)) = liveliest.max_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
        let shown = (start..track.len()).take_while(|at| track.time_s[*at] < track.time_s[start] + SHOWN_S);
        all.push(Curves {
            caption: format!("joint {number}, where it changes its speed the most"),
            y_label: format!("reported velocity in {}", joint.speed_unit),
            measured: shown.clone().map(|at| (track.time_s[at], track.velocity[at][number])).collect(),
            fitted: shown.map(|at| (track.time_s[at], moved[at].shown)).collect(),
        });
    }
    for (number, touch) in found.touches.iter().enumerate() {
        all.push(Curves {
            caption: format!("touch {number}"),
            y_label: "force along the normal in N".to_owned(),
            measured: touch.curve.iter().map(|(time_s, measured, _)| (*time_s, *measured)).collect(),
            fitted: touch.curve.iter().map(|(time_s, _, fitted)| (*time_s, *fitted)).collect(),
        });
    }
    all
}

/// Where the stretch begins in which values change the most, and by how much.
fn liveliest(time_s: &[f64], values: &[f64]) -> (usize, f64) {
    let (mut start, mut change, mut best) = (0, 0.0, (0, 0.0));
    for at in 1..values.len() {
        change += (values[at] - values[at - 1]).powi(2);
        while time_s[at] - time_s[start] > SHOWN_S {
            start += 1;
            change -= (values[start] - values[start - 1]).powi(2);
        }
        if change > best.1 {
            best = (start, change);
        }
    }
    best
}

fn chart(curves: &Curves) -> Chart {
    let named = [("measured", STYLES[0], &curves.measured), ("fitted", STYLES[1], &curves.fitted)];
    let both = || curves.measured.iter().chain(&curves.fitted);
    Chart {
        size: (860, 320),
        description: curves.caption.clone(),
        legend: named.iter().map(|(name, style, _)| (*style, (*name).to_owned())).collect(),
        panels: vec![Panel {
            x: roomy(&range(both().map(|(time_s, _)| *time_s))),
            y: roomy(&range(both().map(|(_, value)| *value))),
            x_label: "time in s".to_owned(),
            y_label: curves.y_label.clone(),
            logarithmic: false,
            areas: Vec::new(),
            lines: named.iter().map(|(_, style, points)| Line { style: *style, points: (*points).clone() }).collect(),
            notes: Vec::new(),
        }],
    }
}
