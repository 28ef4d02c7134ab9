//! Line charts on plotters' SVG backend, which knows neither dashes nor fractions of a pixel: it
//! draws on a canvas ten times as fine as the picture, and each line's dash pattern is added to the
//! finished SVG by the line's colour.

use std::fmt::Write as _;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::Axis;
use super::clip::clip;

/// Canvas units per pixel of the picture.
const FINE: u32 = 10;
pub(super) const FONT: &str = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif";
/// plotters divides every size by this before it writes it.
const FONT_FACTOR: f64 = 1.24;
const TEXT_PX: f64 = 13.0;
const LEGEND_ROW_PX: u32 = 22;
pub(super) const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
pub(super) const GRID: RGBColor = RGBColor(0xE4, 0xE4, 0xE4);

/// How a line looks. No two lines of a chart may share a colour: dashes are told apart by it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineStyle {
    /// Colour.
    pub color: RGBColor,
    /// Width in px.
    pub width: f64,
    /// Lengths in px of strokes and gaps, in turn; empty is a solid line.
    pub dash: &'static [f64],
}

/// One line of a panel with its points in the panel's units.
#[derive(Debug, Clone)]
pub struct Line {
    /// How it is drawn.
    pub style: LineStyle,
    /// x and y.
    pub points: Vec<(f64, f64)>,
}

/// A line of text at a point of the panel, next to what it names.
#[derive(Debug, Clone)]
pub struct Note {
    /// The text.
    pub text: String,
    /// Where it begins, x and y.
    pub at: (f64, f64),
    /// Its colour.
    pub color: RGBColor,
}

/// One coordinate system.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Range of x.
    pub x: Range<f64>,
    /// Range of y.
    pub y: Range<f64>,
    /// What x is, with its unit.
    pub x_label: String,
    /// What y is, with its unit.
    pub y_label: String,
    /// Whether both axes are logarithmic; their ranges are then above zero, and all points within
    /// them.
    pub logarithmic: bool,
    /// Closed polygons below all lines.
    pub areas: Vec<(RGBColor, Vec<(f64, f64)>)>,
    /// Its lines.
    pub lines: Vec<Line>,
    /// What is written beside them.
    pub notes: Vec<Note>,
}

/// A figure: panels of equal height, one below the other, under one legend.
#[derive(Debug, Clone)]
pub struct Chart {
    /// Width and height in px, legend included.
    pub size: (u32, u32),
    /// Alternative text for screen readers.
    pub description: String,
    /// Names of the lines.
    pub legend: Vec<(LineStyle, String)>,
    /// From top to bottom.
    pub panels: Vec<Panel>,
}

/// Space around the plot area of every panel, in px.
pub(super) const LEFT_PX: u32 = 72;
const BOTTOM_PX: u32 = 48;
pub(super) const MARGIN_PX: u32 = 12;
/// Room in px that a legend's entry and a label of the x axis need.
const LEGEND_ENTRY_PX: u32 = 270;
const X_LABEL_PX: u32 = 78;

/// About how many labels an x axis of a picture of this width has room for.
pub(super) fn x_labels(width_px: u32) -> u32 {
    (width_px.saturating_sub(LEFT_PX) / X_LABEL_PX).max(2)
}

impl Chart {
    /// The same for a page of another width in px.
    #[must_use]
    pub fn of_width(&self, width_px: u32) -> Self {
        let plots_px = self.size.1 - self.legend_px();
        let mut chart = Self { size: (width_px, 0), ..self.clone() };
        chart.size.1 = plots_px + chart.legend_px();
        chart
    }

    /// Legend entries in one row.
    fn columns(&self) -> usize {
        (self.size.0 / LEGEND_ENTRY_PX).max(1) as usize
    }

    /// Height in px that the legend takes.
    fn legend_px(&self) -> u32 {
        self.legend.len().div_ceil(self.columns()) as u32 * LEGEND_ROW_PX + 8
    }

    /// Draws the chart.
    ///
    /// # Errors
    /// What plotters says about a coordinate system that it cannot draw.
    pub fn svg(&self) -> Result<String, String> {
        let mut svg = String::new();
        self.draw(&mut svg).map_err(|error| error.to_string())?;
        Ok(self.finish(&svg))
    }

    fn draw(&self, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
        let canvas = SVGBackend::with_string(svg, (self.size.0 * FINE, self.size.1 * FINE)).into_drawing_area();
        canvas.fill(&WHITE)?;
        let (legend, plots) = canvas.split_vertically(self.legend_px() * FINE);
        self.draw_legend(&legend)?;
        for (area, panel) in plots.split_evenly((self.panels.len(), 1)).iter().zip(&self.panels) {
            panel.draw(area, x_labels(self.size.0))?;
        }
        canvas.present()?;
        Ok(())
    }

    fn draw_legend(&self, area: &Area<'_>) -> Result<(), Box<dyn std::error::Error>> {
        let columns = self.columns();
        let column = (self.size.0 - MARGIN_PX) / columns as u32;
        for (i, (style, text)) in self.legend.iter().enumerate() {
            let x = MARGIN_PX + (i % columns) as u32 * column;
            let y = (LEGEND_ROW_PX * (i / columns) as u32 + LEGEND_ROW_PX / 2 + 4) * FINE;
            let at = |px: u32| ((px * FINE) as i32, y as i32);
            area.draw(&PathElement::new(vec![at(x), at(x + 46)], style.shape()))?;
            area.draw(&Text::new(text.clone(), at(x + 54), text_style(INK).pos(Pos::new(HPos::Left, VPos::Center))))?;
        }
        Ok(())
    }

    /// Picture size, description, dashes and subscripts, which plotters cannot express.
    fn finish(&self, svg: &str) -> String {
        let (width, height) = self.size;
        let head_end = svg.find('>').map_or(0, |i| i + 1);
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {} {}\">\n<title>{}</title>",
            width * FINE,
            height * FINE,
            escape(&self.description),
        );
        out.push_str(&subscripts(&svg[head_end..]));
        let styles = self.legend.iter().map(|(style, _)| style);
        for style in styles.chain(self.panels.iter().flat_map(|p| p.lines.iter().map(|l| &l.style))) {
            style.dash_in(&mut out);
        }
        out
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Plot<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Axis, Axis>>;

impl Panel {
    fn draw(&self, area: &Area<'_>, x_labels: u32) -> Result<(), Box<dyn std::error::Error>> {
        let mut plot: Plot<'_, '_> = ChartBuilder::on(area)
            .margin(MARGIN_PX * FINE)
            .margin_right(2 * MARGIN_PX * FINE)
            .x_label_area_size((BOTTOM_PX - MARGIN_PX) * FINE)
            .y_label_area_size((LEFT_PX - MARGIN_PX) * FINE)
            .build_cartesian_2d(Axis::new(&self.x, self.logarithmic), Axis::new(&self.y, self.logarithmic))?;
        let (x_step, y_step) = (tick_step(&self.x, x_labels), tick_step(&self.y, 6));
        for (color, polygon) in &self.areas {
            plot.draw_series(std::iter::once(Polygon::new(polygon.clone(), color.filled())))?;
        }
        plot.configure_mesh()
            .x_labels(x_labels as usize)
            .y_labels(6)
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .x_label_formatter(&|value| self.tick(*value, x_step))
            .y_label_formatter(&|value| self.tick(*value, y_step))
            .label_style(text_style(INK))
            .axis_desc_style(text_style(INK))
            .axis_style(INK.stroke_width(FINE))
            .bold_line_style(GRID.stroke_width(FINE))
            .light_line_style(TRANSPARENT)
            .set_all_tick_mark_size(5 * FINE)
            .draw()?;
        for line in &self.lines {
            let pieces = clip(&line.points, &self.x, &self.y);
            plot.draw_series(pieces.into_iter().map(|piece| PathElement::new(piece, line.style.shape())))?;
        }
        for note in &self.notes {
            let style = text_style(note.color).pos(Pos::new(HPos::Left, VPos::Bottom));
            plot.draw_series(std::iter::once(Text::new(note.text.clone(), note.at, style)))?;
        }
        Ok(())
    }

    fn tick(&self, value: f64, step: f64) -> String {
        // A logarithmic axis has no step: its ticks need as many decimals as they have.
        tick(value, if self.logarithmic { value } else { step })
    }
}

impl LineStyle {
    fn shape(&self) -> ShapeStyle {
        self.color.stroke_width((self.width * f64::from(FINE)).round() as u32)
    }

    fn dash_in(&self, svg: &mut String) {
        let RGBColor(r, g, b) = self.color;
        let stroke = format!("stroke=\"#{r:02X}{g:02X}{b:02X}\" stroke-width");
        let mut dash = String::new();
        for length in self.dash {
            write!(dash, "{} ", length * f64::from(FINE)).expect("writing to a String never fails");
        }
        if !self.dash.is_empty() {
            let dashed = format!("stroke-dasharray=\"{}\" {stroke}", dash.trim_end());
            if !svg.contains(&dashed) {
                *svg = svg.replace(&stroke, &dashed);
            }
        }
    }
}

fn text_style(color: RGBColor) -> TextStyle<'static> {
    (FONT, TEXT_PX * FONT_FACTOR * f64::from(FINE)).into_font().color(&color)
}

/// About how far apart plotters puts `labels` labels on a range: 1, 2 or 5 times a power of ten.
pub(super) fn tick_step(range: &Range<f64>, labels: u32) -> f64 {
    let least = (range.end - range.start).abs() / f64::from(labels);
    let decade = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|n| n * decade).find(|step| *step >= least * 0.999).unwrap_or(decade)
}

/// A tick label with as many decimals as its step needs, and a minus sign that is as wide as a
/// digit.
pub(super) fn tick(value: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let text = format!("{value:.decimals$}");
    let zero = !text.contains(|c: char| ('1'..='9').contains(&c));
    if zero { text.trim_start_matches('-').to_owned() } else { text.replace('-', "\u{2212}") }
}

/// Sets the letter after an underscore as a subscript, in text elements only.
fn subscripts(svg: &str) -> String {
    let mut out = String::with_capacity(svg.len());
    for line in svg.lines() {
        match line.split_once('_') {
            Some((before, after)) if !line.starts_with('<') => {
                let (subscript, rest) = after.split_at(after.chars().next().map_or(0, char::len_utf8));
                write!(
                    out,
                    "{before}<tspan font-size=\"75%\" dy=\"0.3em\">{subscript}</tspan><tspan dy=\"-0.22em\">{rest}</tspan>"
                )
                .expect("writing to a String never fails");
            }
            _ => out.push_str(line),
        }
        out.push('\n');
    }
    out
}

/// Text as XML content.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED_DASHED: LineStyle = LineStyle { color: RGBColor(200, 0, 0), width: 1.5, dash: &[6.0, 4.0] };
    const BLUE_SOLID: LineStyle = LineStyle { color: RGBColor(0, 0, 200), width: 2.0, dash: &[] };

    fn chart() -> Chart {
        let line = |style, slope: f64| Line { style, points: vec![(0.0, 0.0), (2.0, slope)] };
        Chart {
            size: (400, 300),
            description: "a < b".to_owned(),
            legend: vec![(RED_DASHED, "first".to_owned()), (BLUE_SOLID, "second".to_owned())],
            panels: vec![Panel {
                x: 0.0..1.0,
                y: -1.0..1.0,
                x_label: "time in s".to_owned(),
                y_label: "force f_y in N".to_owned(),
                logarithmic: false,
                areas: Vec::new(),
                lines: vec![line(RED_DASHED, 3.0), line(BLUE_SOLID, -3.0)],
                notes: vec![Note { text: "limit".to_owned(), at: (0.5, 0.5), color: INK }],
            }],
        }
    }

    #[test]
    fn the_svg_says_what_the_axes_and_the_legend_are() {
        let svg = chart().svg().unwrap();
        for text in ["time in s", "force f<tspan", "first", "second", "limit", "<title>a &lt; b</title>"] {
            assert!(svg.contains(text), "{text} is missing in {svg}");
        }
        assert_eq!(svg.matches("<svg").count(), 1);
        assert!(svg.trim_end().ends_with("</svg>"));
    }

    #[test]
    fn lines_differ_without_their_colour() {
        let svg = chart().svg().unwrap();
        assert_eq!(svg.matches("stroke-dasharray=\"60 40\" stroke=\"#C80000\"").count(), 2, "legend and line");
        assert_eq!(svg.matches("stroke-dasharray").count(), 2);
        assert_eq!(svg.matches("stroke=\"#0000C8\"").count(), 2);
    }

    #[test]
    fn tick_labels_have_the_decimals_of_their_step() {
        assert_eq!(tick(-200.0, 100.0), "\u{2212}200");
        assert_eq!(tick(0.30000000000000004, 0.1), "0.3");
        assert_eq!(tick(-1e-17, 0.05), "0.00");
        assert_eq!(tick_step(&(0.0..1.0), 10), 0.1);
        assert_eq!(tick_step(&(-650.0..20.0), 6), 200.0);
    }
}
