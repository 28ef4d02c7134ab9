//! What was the case when: a picture of bands, one below the other, over the time axis of the figures.

use std::fmt::Write as _;
use std::ops::Range;

use super::chart::{FONT, LEFT_PX, MARGIN_PX, escape, tick, tick_step, x_labels};

/// A stretch of time in which something was so.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Span {
    /// s.
    pub(super) time: Range<f64>,
    /// What was so.
    pub(super) name: String,
    /// Its colour, `#rrggbb`.
    pub(super) color: &'static str,
}

/// One band.
pub(super) struct Band {
    /// What is written above it, where a group of bands begins.
    pub(super) heading: Option<String>,
    /// What it tells of.
    pub(super) title: &'static str,
    pub(super) spans: Vec<Span>,
}

const HEADING_PX: u32 = 22;
const BAND_PX: u32 = 26;
const GAP_PX: u32 = 8;
const AXIS_PX: u32 = 44;
const LEGEND_ROW_PX: u32 = 20;
/// From a patch of the legend to its name, and from a name to the next patch.
const NAME_AT_PX: u32 = 17;
const NAMES_APART_PX: u32 = 16;
/// About the width of a letter: a name that doesn't fit is in the legend alone.
const LETTER_PX: f64 = 7.5;

/// The bands as SVG of this width in px.
pub(super) fn svg(bands: &[Band], range: &Range<f64>, description: &str, width_px: u32) -> String {
    let legend = legend(bands, width_px);
    let (left, right) = (LEFT_PX, width_px - 2 * MARGIN_PX);
    let x = |at: f64| f64::from(left) + (at - range.start) / (range.end - range.start) * f64::from(right - left);
    let top = 8 + LEGEND_ROW_PX * (1 + legend.iter().map(|entry| entry.row).max().unwrap_or(0));
    let headings = bands.iter().filter(|band| band.heading.is_some()).count() as u32;
    let bottom = top + bands.len() as u32 * (BAND_PX + GAP_PX) + headings * HEADING_PX;
    let height = bottom + AXIS_PX;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" width=\"{width_px}\" height=\"{height}\" \
         viewBox=\"0 0 {width_px} {height}\" font-family=\"{FONT}\" font-size=\"13\" fill=\"#222222\">\n<title>{}</title>\n\
         <rect width=\"{width_px}\" height=\"{height}\" fill=\"#FFFFFF\"/>\n",
        escape(description)
    );
    for Entry { name, color, x, row } in legend {
        let (y, text) = (6 + row * LEGEND_ROW_PX, escape(name));
        let _ = writeln!(svg, "<rect x=\"{x}\" y=\"{y}\" width=\"12\" height=\"12\" fill=\"{color}\"/>");
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{}\">{text}</text>", x + NAME_AT_PX, y + 11);
    }
    let mut y = top;
    for band in bands {
        if let Some(heading) = &band.heading {
            let _ = writeln!(svg, "<text x=\"{MARGIN_PX}\" y=\"{}\">{}</text>", y + 15, escape(heading));
            y += HEADING_PX;
        }
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            left - 8,
            y + 18,
            escape(band.title)
        );
        for Span { time, name, color } in &band.spans {
            let shown = time.start.max(range.start)..time.end.min(range.end);
            if shown.end < shown.start {
                continue;
            }
            let (from, width, text) = (x(shown.start), x(shown.end) - x(shown.start), escape(name));
            let _ = writeln!(
                svg,
                "<rect x=\"{from:.1}\" y=\"{y}\" width=\"{:.1}\" height=\"{BAND_PX}\" fill=\"{color}\"><title>{text}, {:.3} s to \
                 {:.3} s</title></rect>",
                width.max(0.5),
                time.start,
                time.end
            );
            if name.chars().count() as f64 * LETTER_PX + 8.0 < width {
                let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{}\" fill=\"#FFFFFF\">{text}</text>", from + 5.0, y + 18);
            }
        }
        y += BAND_PX + GAP_PX;
    }
    let step = tick_step(range, x_labels(width_px));
    let first = (range.start / step).ceil() as i64;
    for at in (first..).map(|index| index as f64 * step).take_while(|at| *at <= range.end + 1e-9 * step) {
        let _ = writeln!(
            svg,
            "<path d=\"M{0:.1} {bottom}v5\" stroke=\"#222222\"/><text x=\"{0:.1}\" y=\"{1}\" text-anchor=\"middle\">{2}</text>",
            x(at),
            bottom + 19,
            tick(at, step)
        );
    }
    let middle = (left + right) / 2;
    let _ = writeln!(svg, "<path d=\"M{left} {bottom}H{right}\" stroke=\"#222222\"/>");
    let _ = writeln!(svg, "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">time in s</text>\n</svg>", bottom + 38);
    svg
}

/// A name in the legend.
struct Entry<'a> {
    name: &'a str,
    color: &'static str,
    x: u32,
    row: u32,
}

/// Each name once, in as many rows as they need.
fn legend(bands: &[Band], width_px: u32) -> Vec<Entry<'_>> {
    let mut legend: Vec<Entry<'_>> = Vec::new();
    let (mut x, mut row) = (LEFT_PX, 0);
    for Span { name, color, .. } in bands.iter().flat_map(|band| &band.spans) {
        if legend.iter().any(|entry| entry.name == name) {
            continue;
        }
        let width = NAME_AT_PX + (name.chars().count() as f64 * LETTER_PX) as u32;
        if x + width > width_px - 2 * MARGIN_PX && x > LEFT_PX {
            (x, row) = (LEFT_PX, row + 1);
        }
        legend.push(Entry { name, color, x, row });
        x += width + NAMES_APART_PX;
    }
    legend
}

/// Stretches of the same name from what was so from each instant (s) on, up to `end`.
pub(super) fn spans(states: impl IntoIterator<Item = (f64, String, &'static str)>, end: f64) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    for (at, name, color) in states {
        match spans.last_mut() {
            Some(last) if last.name == name => last.time.end = at,
            Some(last) => {
                last.time.end = at;
                spans.push(Span { time: at..at, name, color });
            }
            None => spans.push(Span { time: at..at, name, color }),
        }
    }
    if let Some(last) = spans.last_mut() {
        last.time.end = end.max(last.time.start);
    }
    spans
}

#[cfg(test)]
mod tests {
    use super::*;

    fn band() -> Band {
        let state = |at, name: &str| (at, name.to_owned(), "#112233");
        let states = [state(0.0, "Free"), state(0.5, "Free"), state(0.8, "Contact"), state(1.0, "Contact")];
        Band { heading: None, title: "mode", spans: spans(states, 2.0) }
    }

    #[test]
    fn what_stays_the_same_is_one_stretch() {
        let spans = band().spans;
        assert_eq!(
            spans.iter().map(|span| (span.name.as_str(), span.time.clone())).collect::<Vec<_>>(),
            [("Free", 0.0..0.8), ("Contact", 0.8..2.0)]
        );
    }

    #[test]
    fn names_that_do_not_fit_beside_each_other_are_in_rows() {
        let states = (0..12).map(|index| (f64::from(index), format!("Stopped (Reason{index})"), "#112233"));
        let band = Band { heading: None, title: "mode", spans: spans(states, 12.0) };
        let entries = legend(std::slice::from_ref(&band), 860);
        assert_eq!(entries.iter().map(|entry| entry.row).collect::<Vec<_>>(), [0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2]);
        assert!(entries.iter().all(|entry| entry.x < 700));
    }

    #[test]
    fn groups_have_headings_and_nothing_is_beyond_a_narrow_picture() {
        let bands = ["first", "second"].map(|heading| Band { heading: Some(heading.to_owned()), ..band() });
        let svg = svg(&bands, &(0.0..2.0), "modes", 360);
        assert!(svg.contains(">first</text>") && svg.contains(">second</text>"), "{svg}");
        let ends = svg.split("<rect x=\"").skip(1).filter_map(|rect| {
            let (x, rest) = rect.split_once('"')?;
            let width = rest.split_once(" width=\"")?.1.split_once('"')?.0;
            Some(x.parse::<f64>().ok()? + width.parse::<f64>().ok()?)
        });
        let ends: Vec<f64> = ends.collect();
        assert!(ends.len() >= 4 && ends.iter().all(|end| *end <= 336.0 + 1e-9), "{ends:?}");
    }

    #[test]
    fn stretches_are_where_the_axis_says() {
        let svg = svg(&[band()], &(0.0..2.0), "modes", 860);
        // From 72 px to 836 px are 2 s.
        assert!(svg.contains("<rect x=\"72.0\" y=\"28\" width=\"305.6\""), "{svg}");
        assert!(svg.contains("<rect x=\"377.6\" y=\"28\" width=\"458.4\""), "{svg}");
        assert!(svg.contains("<title>Contact, 0.800 s to 2.000 s</title>") && svg.contains(">1.0</text>"), "{svg}");
    }
}
