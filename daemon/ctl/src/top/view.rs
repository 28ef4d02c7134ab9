//! What `top` draws.

use std::time::Duration;

use admittance_host::config::fixed;
use ipc_types::{DiagnosticsSample, Mode, QUANTILES};
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Gauge, List, Paragraph, Row, Table, Widget};

use super::Watched;
use crate::diagnostics::{latencies, mode_text, verdict_text};
use admittance_core::quantities::AXIS_NAMES;

/// After this long without a state sample the forces are called old.
const NO_SAMPLE: Duration = Duration::from_secs(1);
/// Part of a limit from which on a force is drawn as near it.
const NEAR: f64 = 0.8;

/// The whole picture.
pub(super) struct View<'a>(pub(super) &'a Watched);

impl Widget for View<'_> {
    fn render(self, area: Rect, buffer: &mut Buffer) {
        let sample = &self.0.sample;
        let axes = controlled(sample).count() as u16;
        let [head, forces, latency, counters, changes, keys] = Layout::vertical([
            Constraint::Length(2 + u16::from(learns(sample))),
            Constraint::Length(axes + 2),
            Constraint::Length(9),
            Constraint::Length(5),
            Constraint::Min(3),
            Constraint::Length(1),
        ])
        .areas(area);
        self.head(head, buffer);
        render_forces(sample, forces, buffer);
        render_latency(sample, latency, buffer);
        render_counters(sample, counters, buffer);
        self.changes(changes, buffer);
        Line::from("q quit").style(Style::new().add_modifier(Modifier::DIM)).render(keys, buffer);
    }
}

impl View<'_> {
    fn head(&self, area: Rect, buffer: &mut Buffer) {
        let sample = &self.0.sample;
        let bold = Style::new().add_modifier(Modifier::BOLD);
        let mode = Span::styled(mode_text(sample.mode, sample.stop_reason), bold.fg(mode_color(sample)));
        let first = Line::from(vec![
            Span::styled(format!("admittanced/{}  ", self.0.instance), bold),
            mode,
            Span::raw(format!("  {}", verdict_text(sample))),
        ]);
        let second = match self.0.silent_for() {
            Some(silence) => Line::styled(
                format!("silent for {:.0} s: ended, or stopped by a debugger or SIGSTOP?", silence.as_secs_f64()),
                bold.fg(Color::Red),
            ),
            None => {
                let age = self.0.heard.elapsed().as_secs_f64();
                let up = sample.uptime_ns as f64 * 1e-9;
                let begin = format!("up {up:.0} s, as of {age:.1} s ago, {} samples/s", sample.cycles_last_second);
                match self.0.sample_age() {
                    Some(age) if age < NO_SAMPLE => {
                        Line::raw(format!("{begin}, the last one {:.1} s ago", age.as_secs_f64()))
                    }
                    Some(age) => Line::styled(
                        format!("{begin}: none for {:.0} s, forces are as old", age.as_secs_f64()),
                        bold.fg(Color::Yellow),
                    ),
                    None => Line::styled(format!("{begin}: none yet"), bold.fg(Color::Yellow)),
                }
            }
        };
        let believed = learns(sample).then(|| believed(sample));
        Paragraph::new([first, second].into_iter().chain(believed).collect::<Vec<_>>()).render(area, buffer);
    }

    fn changes(&self, area: Rect, buffer: &mut Buffer) {
        // The newest first: it must be visible on any terminal size.
        let lines = self.0.changes.iter().rev().map(|(at, what)| format!("{:>9.1} s  {what}", *at as f64 * 1e-9));
        List::new(lines).block(Block::bordered().title("Mode (time since start)")).render(area, buffer);
    }
}

/// Whether the surface is learned: a range of its stiffness is told.
fn learns(sample: &DiagnosticsSample) -> bool {
    let [least, most] = sample.believed_stiffness_band_n_m;
    least < most
}

fn believed(sample: &DiagnosticsSample) -> Line<'static> {
    let ([least, most], tilt) = (sample.believed_stiffness_band_n_m, sample.believed_tilt_rad.to_degrees());
    let stiffness = sample.believed_stiffness_n_m;
    let tilted = if tilt > 0.0 { format!(", normal {} degrees off", fixed(tilt, 1)) } else { String::new() };
    Line::raw(format!("believed {stiffness:.0} N/m, {least:.0} to {most:.0}{tilted}"))
}

fn mode_color(sample: &DiagnosticsSample) -> Color {
    match Mode::from_code(sample.mode) {
        Some(Mode::Free) => Color::Green,
        Some(Mode::Contact) => Color::Cyan,
        Some(Mode::Stopping | Mode::Stopped) => Color::Red,
        _ => Color::Reset,
    }
}

/// Axes with a force limit.
fn controlled(sample: &DiagnosticsSample) -> impl Iterator<Item = usize> {
    (0..(sample.task_axes as usize).min(AXIS_NAMES.len())).filter(|axis| sample.force_limit[*axis] > 0.0)
}

fn render_forces(sample: &DiagnosticsSample, area: Rect, buffer: &mut Buffer) {
    let block = Block::bordered().title("Force against limit, velocity offset (* in contact)");
    let inner = block.inner(area);
    block.render(area, buffer);
    for (row, axis) in inner.rows().zip(controlled(sample)) {
        let (force, limit) = (sample.wrench[axis], sample.force_limit[axis]);
        let share = (force.abs() / limit).clamp(0.0, 1.0);
        let [unit, of_offset] = if axis < 3 { ["N", "m/s"] } else { ["N m", "rad/s"] };
        let offset = sample.velocity_offset[axis];
        let color = match share {
            share if share >= 1.0 => Color::Red,
            share if share >= NEAR => Color::Yellow,
            _ => Color::Blue,
        };
        let contact = if sample.active_axes & (1 << axis) != 0 { "*" } else { " " };
        Gauge::default()
            .gauge_style(Style::new().fg(color))
            .ratio(if share.is_finite() { share } else { 0.0 })
            .label(format!(
                "{contact}{:<2} {force:>9.1} of {limit:.1} {unit}, {offset:>+8.4} {of_offset}",
                AXIS_NAMES[axis]
            ))
            .render(row, buffer);
    }
}

fn render_latency(sample: &DiagnosticsSample, area: Rect, buffer: &mut Buffer) {
    let cells = |name: String, values: [u64; QUANTILES]| {
        let values = values.map(|ns| format!("{:>10.1}", ns as f64 * 1e-3));
        Row::new(std::iter::once(name).chain(values))
    };
    let rows = latencies(sample).into_iter().flat_map(|(name, all, last_second)| {
        [cells(format!("{name}, last second"), last_second), cells(format!("{name}, since start"), all)]
    });
    let header = ["", "p50", "p99", "p99.9", "max"].map(|text| format!("{text:>10}"));
    let widths = [
        Constraint::Length(22),
        Constraint::Length(10),
        Constraint::Length(10),
        Constraint::Length(10),
        Constraint::Length(10),
    ];
    let table = Table::new(rows, widths)
        .header(Row::new(header).style(Style::new().add_modifier(Modifier::BOLD)))
        .block(Block::bordered().title("Latency in us"));
    Widget::render(table, area, buffer);
}

fn render_counters(sample: &DiagnosticsSample, area: Rect, buffer: &mut Buffer) {
    let text = |counters: &[(&str, u64)]| {
        let counters: Vec<String> = counters.iter().map(|(name, count)| format!("{name} {count}")).collect();
        Line::raw(counters.join("   "))
    };
    let lines = vec![
        text(&[("cycles", sample.cycles), ("fallback", sample.fallback_count), ("late", sample.late_count)]),
        text(&[
            ("samples missed", sample.missed_count),
            ("of the last 100", sample.missed_lately),
            ("rejected", sample.rejected_count),
            ("offset limited", sample.limited_count),
        ]),
        text(&[
            ("force exceeded", sample.exceeded_count),
            ("contacts lost", sample.contact_losses),
            ("solver failures", sample.solver_failures),
            ("records dropped", sample.dropped_count),
        ]),
    ];
    Paragraph::new(lines).block(Block::bordered().title("Counters")).render(area, buffer);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(sample: DiagnosticsSample) -> String {
        let area = Rect::new(0, 0, 80, 30);
        let mut buffer = Buffer::empty(area);
        View(&Watched::new("planar".to_owned(), sample)).render(area, &mut buffer);
        buffer.content().chunks(80).map(|row| row.iter().map(|cell| cell.symbol()).collect::<String>() + "\n").collect()
    }

    #[test]
    fn what_is_believed_of_a_surface_is_shown_where_it_is_learned() {
        let known = DiagnosticsSample {
            task_axes: 2,
            believed_stiffness_n_m: 51e3,
            believed_stiffness_band_n_m: [51e3; 2],
            ..DiagnosticsSample::zeroed()
        };
        assert!(!shown(known).contains("believed"));
        let learned = DiagnosticsSample { believed_stiffness_band_n_m: [48e3, 55e3], ..known };
        assert!(shown(learned).contains("believed 51000 N/m, 48000 to 55000   "), "{}", shown(learned));
        let tilted = DiagnosticsSample { believed_tilt_rad: 1.5_f64.to_radians(), ..learned };
        assert!(shown(tilted).contains("48000 to 55000, normal 1.5 degrees off"), "{}", shown(tilted));
    }
}
