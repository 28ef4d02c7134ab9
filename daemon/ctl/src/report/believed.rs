//! What was believed of a surface of which only a range of the stiffness was told: stiffness and
//! contact point over time, when they were known, and what it cost.

use std::ops::Range;

use admittance_host::config::percent;
use ipc_types::{RecordSample, Verdict};

use super::chart::{Chart, Line, Panel};
use super::figures::{LIKELIEST, POSSIBLE, range, roomy};

/// From this part of the last belief on the stiffness counts as known, and from this distance, m, the
/// contact point.
const KNOWN_PART: f64 = 0.2;
const KNOWN_M: f64 = 50e-6;

/// After one cycle.
struct Belief {
    time_s: f64,
    stiffness_n_m: f64,
    band_n_m: [f64; 2],
    /// A point of the surface, its normal, the normal that was told, and where the tool was, base frame, m.
    point_m: [f64; 3],
    normal: [f64; 3],
    told_normal: [f64; 3],
    tool_m: [f64; 3],
    /// Where some of the surfaces that may be there can't be kept: newtons of the worst above the limit, and their share.
    at_risk: Option<(f64, f64)>,
    in_contact: bool,
    /// Between the normal and the one that was told, degrees.
    tilt_deg: f64,
}

impl Belief {
    fn is_of_its_band(&self) -> bool {
        let [least, most] = self.band_n_m;
        (least..=most).contains(&self.stiffness_n_m)
    }

    /// How deep the surface begins below a position, m along the inward normal that was told: one
    /// direction for all cycles, since along a normal that turns depths would jump.
    fn depth_at_m(&self, position_m: &[f64; 3]) -> f64 {
        let told = self.told_normal;
        let length = dot(&told, &told).sqrt();
        let normal = if dot(&self.normal, &told) > 0.0 { self.normal } else { told };
        let from_point = std::array::from_fn(|axis| position_m[axis] - self.point_m[axis]);
        (dot(&normal, &from_point) * length / dot(&normal, &told)) - dot(&told, position_m) / length
    }

    /// How much deeper the surface begins where the tool is than `other` says, m.
    fn deeper_than_m(&self, other: &Belief) -> f64 {
        self.depth_at_m(&self.tool_m) - other.depth_at_m(&self.tool_m)
    }
}

fn dot(one: &[f64; 3], other: &[f64; 3]) -> f64 {
    one.iter().zip(other).map(|(a, b)| a * b).sum()
}

/// All cycles in which there was a range; none where a stiffness was told.
#[derive(Default)]
pub(super) struct Beliefs(Vec<Belief>);

impl Beliefs {
    /// Takes what a cycle at a time in s believed, with the tool at a position in m, base frame.
    pub(super) fn add(&mut self, record: &RecordSample, time_s: f64, tool_m: &[f64; 3]) {
        let (band_n_m, command) = (record.believed_stiffness_band_n_m, &record.command);
        if self.0.is_empty() && band_n_m[0] >= band_n_m[1] {
            return;
        }
        self.0.push(Belief {
            time_s,
            stiffness_n_m: record.believed_stiffness_n_m,
            band_n_m,
            point_m: record.contact_point,
            normal: record.believed_normal,
            told_normal: record.surface_normal,
            tool_m: *tool_m,
            at_risk: (command.verdict == Verdict::AtRisk.code())
                .then_some((-command.verdict_margin, command.verdict_share)),
            in_contact: command.active_axes != 0,
            tilt_deg: record.believed_tilt_rad().to_degrees(),
        });
    }

    /// Rows of the table: what, and its value.
    pub(super) fn rows(&self) -> Vec<(String, String)> {
        if self.0.is_empty() {
            return Vec::new();
        }
        // Free again, it is another surface that is waited for.
        let touched: Vec<&Belief> = self.0.iter().filter(|belief| belief.in_contact).collect();
        // While f̂ fades after a contact the surface is a supposed one: the end is the last with one in
        // its band, from which on later cycles say nothing.
        let end = touched.iter().rposition(|belief| belief.is_of_its_band()).map_or(touched.len(), |at| at + 1);
        let touched = &touched[..end];
        let Some(last) = touched.last() else {
            return vec![("stiffness believed in N/m".to_owned(), "nothing was touched".to_owned())];
        };
        let is_known = |belief: &Belief| {
            (belief.stiffness_n_m / last.stiffness_n_m - 1.0).abs() <= KNOWN_PART
                && belief.deeper_than_m(last).abs() <= KNOWN_M
        };
        let unknown = touched.iter().rposition(|belief| !is_known(belief)).map_or(0, |index| index + 1);
        let known_ms = touched.get(unknown).map(|belief| 1e3 * (belief.time_s - touched[0].time_s));
        let at_risk: Vec<(f64, f64)> = touched.iter().filter_map(|belief| belief.at_risk).collect();
        let [least, most] = last.band_n_m;
        let tilt = touched.iter().any(|belief| belief.tilt_deg > 0.0).then(|| {
            let what = "tilt believed at the end of the contact, against the normal that was told".to_owned();
            (what, format!("{:.1} degrees", last.tilt_deg))
        });
        let rows = vec![
            (
                "stiffness believed at the end of the contact in N/m (one standard deviation)".to_owned(),
                format!("{:.0} ({least:.0} to {most:.0})", last.stiffness_n_m),
            ),
            (
                "believed within 20 % and 0.05 mm of that from then on, after the first touch".to_owned(),
                known_ms.map_or("never".to_owned(), |time| format!("{time:.1} ms")),
            ),
            (
                "cycles at risk: some of the surfaces that might be there could not be kept below the limit".to_owned(),
                match at_risk.iter().copied().reduce(|a, b| (a.0.max(b.0), a.1.max(b.1))) {
                    Some((worst_n, share)) => {
                        format!("{}, at most {} of them, the worst by {worst_n:.1} N", at_risk.len(), percent(share))
                    }
                    None => "none".to_owned(),
                },
            ),
        ];
        rows.into_iter().chain(tilt).collect()
    }

    /// Stiffness with its band above the contact point, and where the normal is learned its tilt below;
    /// `None` where a stiffness was told.
    pub(super) fn chart(&self, time: Range<f64>, learns_normal: bool) -> Option<Chart> {
        let last = self.0.iter().rfind(|belief| belief.in_contact && belief.is_of_its_band()).or(self.0.last())?;
        let within = || self.0.iter().filter(|belief| time.contains(&belief.time_s));
        let points =
            |of: &dyn Fn(&Belief) -> f64| within().map(|belief| (belief.time_s, of(belief))).collect::<Vec<_>>();
        let depth = points(&|belief| 1e3 * belief.deeper_than_m(last));
        let panel = |y_label: &str, lines: Vec<Line>| Panel {
            x: time.clone(),
            y: roomy(&range(lines.iter().flat_map(|line| &line.points).map(|(_, y)| *y))),
            x_label: "time in s".to_owned(),
            y_label: y_label.to_owned(),
            logarithmic: false,
            areas: Vec::new(),
            lines,
            notes: Vec::new(),
        };
        let edge = |end: usize| Line { style: POSSIBLE, points: points(&|belief| 1e-3 * belief.band_n_m[end]) };
        let likeliest = Line { style: LIKELIEST, points: points(&|belief| 1e-3 * belief.stiffness_n_m) };
        let begins = Line { style: LIKELIEST, points: depth };
        let mut panels = vec![
            panel("stiffness in kN/m", vec![edge(0), edge(1), likeliest]),
            panel("at the tool, mm deeper than the last", vec![begins]),
        ];
        if learns_normal {
            let tilt = Line { style: LIKELIEST, points: points(&|belief| belief.tilt_deg) };
            panels.push(panel("tilt against the told normal, degrees", vec![tilt]));
        }
        let what = if learns_normal { "Stiffness, contact point and tilt" } else { "Stiffness and contact point" };
        Some(Chart {
            size: (860, 310 * panels.len() as u32),
            description: format!("{what} as they were believed to be"),
            legend: vec![(LIKELIEST, "likeliest".to_owned()), (POSSIBLE, "may be: one standard deviation".to_owned())],
            panels,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOOL_M: [f64; 3] = [1.0, 0.0, 0.0];

    fn record(stiffness: f64, band: [f64; 2], depth_m: f64, verdict: Verdict) -> RecordSample {
        let mut record = RecordSample::default();
        (record.believed_stiffness_n_m, record.believed_stiffness_band_n_m) = (stiffness, band);
        (record.believed_normal, record.contact_point) = ([0.0, 1.0, 0.0], [1.0, -depth_m, 0.0]);
        record.surface_normal = [0.1_f64.sin(), 0.1_f64.cos(), 0.0];
        (record.command.verdict, record.command.verdict_margin) = (verdict.code(), -7.5);
        record.command.verdict_share = 0.25;
        record.command.active_axes = u32::from(verdict != Verdict::None);
        record
    }

    #[test]
    fn a_touch_is_explained() {
        let mut beliefs = Beliefs::default();
        let cycles = [
            (2e5, 0.0, Verdict::None),
            (5e5, 0.001, Verdict::AtRisk),
            (1.3e5, 0.002, Verdict::AtRisk),
            (1.1e5, 0.00203, Verdict::Feasible),
            (1e5, 0.002, Verdict::Feasible),
            (2e4, 0.004, Verdict::None),
        ];
        for (index, (stiffness, depth_m, verdict)) in (0..).zip(cycles) {
            let band = [0.9 * stiffness, 1.1 * stiffness];
            beliefs.add(&record(stiffness, band, depth_m, verdict), f64::from(index) * 0.004, &TOOL_M);
        }
        // f̂ fades: still in contact, and the softest surface is supposed.
        beliefs.add(&record(1e4, [9e4, 1.1e5], 0.001, Verdict::Feasible), 0.024, &TOOL_M);
        let values: Vec<String> = beliefs.rows().into_iter().map(|(_, value)| value).collect();
        assert_eq!(
            values,
            ["100000 (90000 to 110000)", "8.0 ms", "2, at most 25 % of them, the worst by 7.5 N", "5.7 degrees"]
        );
        let chart = beliefs.chart(-0.01..0.1, true).unwrap();
        // 1 mm along the normal that is believed in is more along the told one.
        let (time_s, deeper_mm) = chart.panels[1].lines[0].points[1];
        assert!(time_s == 0.004 && (deeper_mm + 1.0 / 0.1_f64.cos()).abs() < 1e-9, "{deeper_mm} mm");
        assert_eq!(chart.panels.len(), 3);
        assert!(chart.panels[2].lines[0].points.iter().all(|(_, tilt_deg)| (tilt_deg - 5.73).abs() < 0.01));
        assert_eq!(beliefs.chart(-0.01..0.1, false).unwrap().panels.len(), 2, "no tilt of a normal that is told");
        chart.svg().unwrap();
    }

    #[test]
    fn a_normal_that_turns_about_the_tool_moves_no_surface() {
        // The point that is told is 0.3 m from the tool. The surface stays where the tool touches it.
        let (mut beliefs, tool_m) = (Beliefs::default(), [1.3, 0.0, 0.0]);
        for (index, tilt_rad) in (0..).zip([0.0_f64, 0.05, 0.1]) {
            let normal = [tilt_rad.sin(), tilt_rad.cos(), 0.0];
            let mut record = record(1e5, [9e4, 1.1e5], 0.0, Verdict::Feasible);
            (record.surface_normal, record.believed_normal) = ([0.0, 1.0, 0.0], normal);
            record.contact_point = [1.0, 0.3 * tilt_rad.tan(), 0.0];
            beliefs.add(&record, f64::from(index) * 0.004, &tool_m);
        }
        let chart = beliefs.chart(0.0..0.1, true).unwrap();
        let deeper_mm = &chart.panels[1].lines[0].points;
        assert!(deeper_mm.iter().all(|(_, mm)| mm.abs() < 1e-9), "{deeper_mm:?}");
    }

    #[test]
    fn where_a_stiffness_was_told_there_is_nothing_to_say() {
        let mut beliefs = Beliefs::default();
        beliefs.add(&record(1e5, [1e5; 2], 0.0, Verdict::Feasible), 0.0, &TOOL_M);
        assert!(beliefs.rows().is_empty() && beliefs.chart(0.0..1.0, true).is_none());
    }
}
