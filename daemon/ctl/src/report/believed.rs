//! What was believed of a surface of which only a range of the stiffness was told: stiffness and
//! contact point over time, when they were known, and what it cost.

use std::ops::Range;

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
    /// How deep the surface begins, m along the inward normal from the base.
    depth_m: f64,
    /// Newtons above the limit of the worst surface that may be there, where some can't be kept.
    at_risk_n: Option<f64>,
    in_contact: bool,
    /// Between the normal and the one that was told, degrees.
    tilt_deg: f64,
}

impl Belief {
    fn is_of_its_band(&self) -> bool {
        let [least, most] = self.band_n_m;
        (least..=most).contains(&self.stiffness_n_m)
    }
}

/// All cycles in which there was a range; none where a stiffness was told.
#[derive(Default)]
pub(super) struct Beliefs(Vec<Belief>);

impl Beliefs {
    /// Takes what a cycle at a time in s believed.
    pub(super) fn add(&mut self, record: &RecordSample, time_s: f64) {
        let (band_n_m, command) = (record.believed_stiffness_band_n_m, &record.command);
        if self.0.is_empty() && band_n_m[0] >= band_n_m[1] {
            return;
        }
        let normal = record.believed_normal;
        let along: f64 = normal.iter().zip(record.contact_point).map(|(n, at)| n * at).sum();
        self.0.push(Belief {
            time_s,
            stiffness_n_m: record.believed_stiffness_n_m,
            band_n_m,
            depth_m: -along,
            at_risk_n: (command.verdict == Verdict::AtRisk.code()).then_some(-command.verdict_margin),
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
                && (belief.depth_m - last.depth_m).abs() <= KNOWN_M
        };
        let unknown = touched.iter().rposition(|belief| !is_known(belief)).map_or(0, |index| index + 1);
        let known_ms = touched.get(unknown).map(|belief| 1e3 * (belief.time_s - touched[0].time_s));
        let at_risk: Vec<f64> = touched.iter().filter_map(|belief| belief.at_risk_n).collect();
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
                "cycles at risk: some surface that might be there could not be kept below the limit".to_owned(),
                match at_risk.iter().copied().reduce(f64::max) {
                    Some(worst) => format!("{}, the worst by {worst:.1} N", at_risk.len()),
                    None => "none".to_owned(),
                },
            ),
        ];
        rows.into_iter().chain(tilt).collect()
    }

    /// Stiffness with its band above the contact point; `None` where a stiffness was told.
    pub(super) fn chart(&self, time: Range<f64>) -> Option<Chart> {
        let last = self.0.iter().rfind(|belief| belief.in_contact && belief.is_of_its_band()).or(self.0.last())?;
        let within = || self.0.iter().filter(|belief| time.contains(&belief.time_s));
        let points =
            |of: &dyn Fn(&Belief) -> f64| within().map(|belief| (belief.time_s, of(belief))).collect::<Vec<_>>();
        let depth = points(&|belief| 1e3 * (belief.depth_m - last.depth_m));
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
        Some(Chart {
            size: (860, 620),
            description: "Stiffness and contact point as they were believed to be".to_owned(),
            legend: vec![(LIKELIEST, "likeliest".to_owned()), (POSSIBLE, "may be: one standard deviation".to_owned())],
            panels: vec![
                panel("stiffness in kN/m", vec![edge(0), edge(1), likeliest]),
                panel("surface begins, mm from the last", vec![begins]),
            ],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(stiffness: f64, band: [f64; 2], depth_m: f64, verdict: Verdict) -> RecordSample {
        let mut record = RecordSample::default();
        (record.believed_stiffness_n_m, record.believed_stiffness_band_n_m) = (stiffness, band);
        (record.believed_normal, record.contact_point) = ([0.0, 1.0, 0.0], [1.0, -depth_m, 0.0]);
        record.surface_normal = [0.1_f64.sin(), 0.1_f64.cos(), 0.0];
        (record.command.verdict, record.command.verdict_margin) = (verdict.code(), -7.5);
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
            beliefs.add(&record(stiffness, band, depth_m, verdict), f64::from(index) * 0.004);
        }
        // f̂ fades: still in contact, and the softest surface is supposed.
        beliefs.add(&record(1e4, [9e4, 1.1e5], 0.001, Verdict::Feasible), 0.024);
        let values: Vec<String> = beliefs.rows().into_iter().map(|(_, value)| value).collect();
        assert_eq!(values, ["100000 (90000 to 110000)", "8.0 ms", "2, the worst by 7.5 N", "5.7 degrees"]);
        let chart = beliefs.chart(-0.01..0.1).unwrap();
        assert_eq!(chart.panels[1].lines[0].points[1], (0.004, -1.0), "mm");
        chart.svg().unwrap();
    }

    #[test]
    fn where_a_stiffness_was_told_there_is_nothing_to_say() {
        let mut beliefs = Beliefs::default();
        beliefs.add(&record(1e5, [1e5; 2], 0.0, Verdict::Feasible), 0.0);
        assert!(beliefs.rows().is_empty() && beliefs.chart(0.0..1.0).is_none());
    }
}
