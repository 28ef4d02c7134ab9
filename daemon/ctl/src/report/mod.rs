//! Reports: figures 3, 4 and 5 of the paper as SVG, with the table and the raw series of the demo,
//! or of a recording.

mod axis;
mod changes;
pub mod chart;
mod clip;
mod figures;
mod of_recording;
mod timeline;

use std::fs;
use std::io;
use std::path::Path;

use plant_sim::scenario::Scenario;

use crate::demo::{HEADER, Run, cells};
use chart::{Chart, escape};
pub(crate) use of_recording::{Args, run};

/// Writes index.html, figure-3.svg, figure-4.svg, figure-5.svg and series.csv into `directory`.
pub(crate) fn write(directory: &Path, runs: &[Run], scenario: &Scenario) -> io::Result<()> {
    fs::create_dir_all(directory)?;
    let mut html = head("admittanced: demo");
    html += "<h1>MPC-based admittance control: the experiment of section IV</h1>\n<p>A planar arm moves its TCP straight down at \
             0.25 m/s and hits a plane that falls by 25°, stiffness 10<sup>5</sup> N/m. One real daemon process and one real \
             plant process per controller, over shared memory, in real time, 250 Hz. All forces are the plant's true forces.</p>\n";
    html += &table(runs);
    for (number, caption, chart) in figures::of_demo(runs, scenario) {
        html += &write_figure(directory, number, caption, &chart)?;
    }
    html += "<p>Raw series: <a href=\"series.csv\">series.csv</a></p>\n<h2>Configuration</h2>\n";
    for run in runs {
        let (name, config) = (run.controller.name, escape(run.controller.config));
        html += &format!("<details><summary>{name}.toml</summary><pre>{config}</pre></details>\n");
    }
    html += TAIL;
    fs::write(directory.join("index.html"), html)?;
    fs::write(directory.join("series.csv"), series(runs)?)
}

/// Writes a figure of its own, and returns it for the page.
fn write_figure(directory: &Path, number: u32, caption: &str, chart: &Chart) -> io::Result<String> {
    write_svg(directory, number, caption, &chart.svg().map_err(io::Error::other)?)
}

fn write_svg(directory: &Path, number: u32, caption: &str, svg: &str) -> io::Result<String> {
    fs::write(directory.join(format!("figure-{number}.svg")), svg)?;
    Ok(format!("<figure>\n{svg}<figcaption>Figure {number}: {}</figcaption>\n</figure>\n", escape(caption)))
}

fn head(title: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{}</title>\n{STYLE}</head>\n<body>\n",
        escape(title)
    )
}

const STYLE: &str = "<style>body{font-family:Helvetica,Arial,sans-serif;max-width:56rem;margin:2rem auto;padding:0 1rem;color:#222}\
    table{border-collapse:collapse}td,th{border:1px solid #bbb;padding:.3rem .6rem;text-align:right}\
    td:first-child,th:first-child{text-align:left}figure{margin:2rem 0}svg{max-width:100%;height:auto}</style>\n";
const TAIL: &str = "</body>\n</html>\n";

fn table(runs: &[Run]) -> String {
    let body: String = runs.iter().map(|run| table_row(&cells(run), "td")).collect();
    format!("<table>\n{}{body}</table>\n", table_row(&HEADER.map(str::to_owned), "th"))
}

fn table_row(cells: &[String], tag: &str) -> String {
    let cells: String = cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect();
    format!("<tr>{cells}</tr>\n")
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
