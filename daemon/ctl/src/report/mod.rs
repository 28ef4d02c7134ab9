//! Reports: figures 3, 4 and 5 of the paper as SVG, with the table and the raw series of the demo,
//! or of a recording.

mod axis;
mod believed;
mod changes;
pub mod chart;
mod clip;
mod figures;
mod of_recording;
mod page;
#[cfg(test)]
mod tests;
mod timeline;

use std::fs;
use std::io;
use std::path::Path;

use crate::demo::{Experiment, HEADER, LIMIT_N, Run, cells};
pub(crate) use changes::Changes;
use chart::escape;
pub(crate) use figures::{STYLES, range, roomy};
pub(crate) use of_recording::{Args, run};
use page::figure_of;
pub(crate) use page::{TAIL, figure, head, table};

/// Writes index.html, timeline.svg, figure-3.svg, figure-4.svg, figure-5.svg and series.csv into
/// `directory`.
pub(crate) fn write(directory: &Path, runs: &[Run], experiment: &Experiment) -> io::Result<()> {
    let scenario = &experiment.scenario;
    fs::create_dir_all(directory)?;
    let mut html = head("admittanced: demo");
    html += &format!(
        "<h1>MPC-based admittance control: the experiment of section IV</h1>\n<p class=\"lead\">{}</p>\n",
        escape(&sentence(runs))
    );
    html += &format!(
        "<p>A planar arm moves its TCP straight down at 0.25 m/s and hits a plane that falls by 25°, stiffness \
         10<sup>5</sup> N/m. One real daemon process and one real plant process per controller, over shared memory, in \
         real time, 250 Hz; a command acts {} ms after its sample. All forces are the plant's true forces.</p>\n",
        experiment.delay_ms()
    );
    html += &page::table(&HEADER, runs.iter().map(|run| cells(run).to_vec()));
    let end_s = scenario.motion.iter().map(|phase| phase.duration_s).sum();
    html += &figure_of(directory, "timeline", "Modes and verdicts of each controller's daemon", |width_px| {
        let bands = runs.iter().flat_map(|run| run.changes.bands(Some(run.controller.title.to_owned()), end_s));
        let bands: Vec<_> = bands.collect();
        Ok(timeline::svg(&bands, &(0.0..end_s), "Modes and verdicts over time", width_px))
    })?;
    for (number, caption, chart) in figures::of_demo(runs, scenario) {
        html += &figure(directory, &format!("figure-{number}"), &format!("Figure {number}: {caption}"), &chart)?;
    }
    html += "<p>Raw series: <a href=\"series.csv\">series.csv</a></p>\n<h2>Configuration</h2>\n";
    for run in runs {
        let (name, config) = (run.controller.name, escape(&experiment.config(&run.controller)));
        html += &format!("<details><summary>{name}.toml</summary><pre>{config}</pre></details>\n");
    }
    html += TAIL;
    fs::write(directory.join("index.html"), html)?;
    fs::write(directory.join("series.csv"), series(runs)?)
}

/// What the page shows, as it came out.
fn sentence(runs: &[Run]) -> String {
    let of = |name: &str| runs.iter().find(|run| run.controller.name == name).map(|run| &run.row);
    let losses = |count: u32| match count {
        0 => "never loses contact".to_owned(),
        1 => "loses contact once".to_owned(),
        count => format!("loses contact {count} times"),
    };
    let mut parts = Vec::new();
    if let Some(low) = of("damping-low") {
        parts.push(format!("with low damping the arm {}", losses(low.contact_losses)));
    }
    if let Some(high) = of("damping-high") {
        parts.push(format!("with high damping it presses with up to {:.0} N", high.peak_force_y_n));
    }
    let mpc = || runs.iter().map(|run| &run.row).filter(|row| row.name.starts_with("mpc"));
    if mpc().count() > 0 {
        let (peak, lost) =
            mpc().fold((0.0_f64, 0), |(peak, lost), row| (peak.max(row.peak_force_y_n), lost + row.contact_losses));
        parts.push(format!(
            "with each of the {} MPCs it stays at {peak:.0} N or below and {}",
            mpc().count(),
            losses(lost)
        ));
    }
    format!(
        "Five ways to control the same arm at the same impact, where {LIMIT_N:.0} N are allowed: {}.",
        parts.join("; ")
    )
}

/// Every truth sample of every run.
fn series(runs: &[Run]) -> io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record([
        "controller",
        "sequence",
        "stamp_ns",
        "time_s",
        "force_x_n",
        "force_y_n",
        "peak_force_y_n",
        "normal_force_n",
        "velocity_offset_x_m_s",
        "velocity_offset_y_m_s",
        "tcp_x_m",
        "tcp_y_m",
        "tcp_velocity_x_m_s",
        "tcp_velocity_y_m_s",
        "contact_losses",
        "answer_time_ns",
        "missed",
    ])?;
    for run in runs {
        for truth in &run.truths {
            let values = [
                truth.wrench[0],
                truth.wrench[1],
                truth.peak_wrench[1],
                truth.normal_force_n,
                truth.velocity_offset[0],
                truth.velocity_offset[1],
                truth.tcp_position[0],
                truth.tcp_position[1],
                truth.tcp_twist[0],
                truth.tcp_twist[1],
            ];
            let mut record =
                vec![run.controller.name.to_owned(), truth.sequence.to_string(), truth.stamp_ns.to_string()];
            record.push(format!("{:.6}", truth.scenario_time_s));
            record.extend(values.map(|value| value.to_string()));
            record.extend([
                truth.contact_losses.to_string(),
                truth.answer_time_ns.to_string(),
                truth.missed.to_string(),
            ]);
            writer.write_record(record)?;
        }
    }
    writer.into_inner().map_err(|error| io::Error::other(error.to_string()))
}
