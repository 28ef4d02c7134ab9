//! `admittancectl report`: the figures of a recording.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use admittance_core::quantities::{AXIS_NAMES, Instant};
use admittance_core::robot::Pose;
use admittance_core::with_arm;
use admittance_host::config;
use admittance_runner::config::{Config, FrameName};
use admittance_runner::task_frame::TaskFrame;
use ipc_types::{RecordKind, RecordSample, StateSample, TruthSample};
use nalgebra::{Rotation3, Vector6};

use super::believed::Beliefs;
use super::changes::Changes;
use super::chart::{Chart, escape};
use super::figures::{Curve, Window, over_time, paths, range, roomy};
use super::page::{TAIL, figure, figure_of, head, table_row};
use crate::Exit;
use crate::recording::{Item, Recording, Source};

/// What is shown before and after the first contact, in s.
const BEFORE_CONTACT_S: f64 = 0.01;
const AFTER_CONTACT_S: f64 = 0.14;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "The axis shown is the one whose force comes closest to its limit. With plant-sim's truth in the recording, true and \
    measured values are drawn beside each other; peaks between samples are in the table alone.\n\nExit codes: 0 written, 64 usage, 65 no recording, or a damaged one, 66 no such file, 73 the \
    directory cannot be written.\n\nExample:\n  admittancectl report contact.mcap --directory contact-report"
)]
pub(crate) struct Args {
    #[command(flatten)]
    source: Source,
    /// Where index.html and the figures go.
    #[arg(long, default_value = "recording-report")]
    directory: PathBuf,
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    let recording = args.source.open()?;
    let file = args.source.file.display();
    let malformed = |why: &str| (Exit::DataError, format!("{}: {why}", file));
    let text = recording.configurations().get(&0).ok_or_else(|| malformed("no configuration in it"))?;
    let config: Config =
        config::parse(text, "the recorded configuration").map_err(|error| (Exit::Config, error.to_string()))?;
    let series = Series::of(&recording, &config)?;
    if series.cycles == 0 {
        return Err(malformed("no cycle in it"));
    }
    write(&args.directory, &file.to_string(), text, &config, &series).map_err(|error| {
        (Exit::CantCreate, format!("the report in {} was not written: {error}", args.directory.display()))
    })?;
    eprintln!("report: {}", args.directory.join("index.html").display());
    Ok(Exit::Ok)
}

/// What one sample says of every direction of the task.
struct Point {
    time_s: f64,
    force: [f64; 6],
    offset: [f64; 6],
    tcp_m: [f64; 3],
}

/// What is drawn of a recording.
#[derive(Default)]
struct Series {
    measured: Vec<Point>,
    truth: Vec<Point>,
    cycles: u64,
    /// Records that answered no sample, by their kind: a replay compares those too.
    others: BTreeMap<&'static str, u64>,
    first_contact_s: Option<f64>,
    changes: Changes,
    beliefs: Beliefs,
    /// Largest true forces, between samples too.
    true_peak: [f64; 6],
    last: Option<Box<RecordSample>>,
    complete: bool,
}

impl Series {
    fn of(recording: &Recording, config: &Config) -> Result<Self, (Exit, String)> {
        let mut series = Self::default();
        let mut start = None;
        let mut seconds = |stamp_ns: u64| {
            let stamp = Instant::from_nanoseconds(stamp_ns);
            let start = *start.get_or_insert(stamp);
            if stamp >= start { stamp.since(start).seconds() } else { -start.since(stamp).seconds() }
        };
        let mut items = recording.items();
        for item in items.by_ref() {
            match item? {
                Item::Record(record) => {
                    let is_sample = record.kind == RecordKind::Sample.code();
                    let time_s = seconds(if is_sample { record.state.stamp_ns } else { record.now_ns });
                    series.changes.add(&record, time_s);
                    if is_sample {
                        series.add(record, time_s, config);
                    } else {
                        *series.others.entry(RecordKind::name_of(record.kind)).or_default() += 1;
                    }
                }
                Item::Truth(truth) => {
                    let time_s = seconds(truth.stamp_ns);
                    let point = point_of_truth(config, &truth, time_s);
                    // Peaks between samples are of the base frame's directions.
                    let between = if config.task.frame == FrameName::Base { truth.peak_wrench } else { point.force };
                    series.true_peak = std::array::from_fn(|axis| {
                        between[axis].abs().max(point.force[axis].abs()).max(series.true_peak[axis])
                    });
                    series.truth.push(point);
                }
            }
        }
        series.complete = items.is_complete();
        Ok(series)
    }

    fn add(&mut self, record: Box<RecordSample>, time_s: f64, config: &Config) {
        self.cycles += 1;
        let tcp = tcp(config, &record.state);
        let tcp_m = tcp.map_or([f64::NAN; 3], |tcp| tcp.position.into());
        let frame = tcp.map(|tcp| TaskFrame::with_tool(config, &tcp.rotation));
        // Without a pose nothing is known of where the surface begins.
        if tcp_m.iter().all(|part| part.is_finite()) {
            self.beliefs.add(&record, time_s, &tcp_m);
        }
        if record.command.active_axes != 0 {
            self.first_contact_s.get_or_insert(time_s);
        }
        let offset = Vector6::from(record.command.velocity_offset);
        let offset = frame.map_or(offset, |frame| frame.twist(offset)).into();
        self.measured.push(Point { time_s, force: record.wrench, offset, tcp_m });
        self.last = Some(record);
    }

    /// From the first instant to the last, in s.
    fn whole(&self) -> Range<f64> {
        let points = self.measured.iter().chain(&self.truth).map(|point| point.time_s);
        range(points.chain(self.changes.end_s()))
    }

    /// The axis whose force comes closest to its limit.
    fn axis(&self, config: &Config) -> usize {
        let share = |axis: usize| {
            let limit = config.contact.force_limit[axis];
            self.measured.iter().map(|point| point.force[axis].abs() / limit).fold(0.0, f64::max)
        };
        let controlled = (0..config.robot.task_axes as usize).filter(|axis| config.contact.admittance_axes[*axis]);
        controlled.max_by(|a, b| share(*a).total_cmp(&share(*b))).unwrap_or(0)
    }
}

fn point_of_truth(config: &Config, truth: &TruthSample, time_s: f64) -> Point {
    let frame = TaskFrame::with_tool(config, Rotation3::new(truth.tcp_rotation.into()).matrix());
    let turned = |values: [f64; 6]| frame.twist(Vector6::from(values)).into();
    Point { time_s, force: turned(truth.wrench), offset: turned(truth.velocity_offset), tcp_m: truth.tcp_position }
}

/// Where the measured joint positions put the TCP, base frame.
fn tcp(config: &Config, state: &StateSample) -> Option<Pose> {
    fn of<const N: usize>(config: &Config, state: &StateSample) -> Option<Pose> {
        let joints: [f64; N] = std::array::from_fn(|joint| state.joint_position[joint]);
        Some(config.robot.chain::<N>()?.kinematics(&joints.into()).pose)
    }
    let (joints, axes) = (config.robot.joint.len(), config.robot.task_axes);
    with_arm!((joints, axes), <N, _D> => of::<N>(config, state), else None)
}

fn write(directory: &Path, file: &str, text: &str, config: &Config, series: &Series) -> io::Result<()> {
    fs::create_dir_all(directory)?;
    let mut html = head("admittanced: recording");
    html += &format!("<h1>{}</h1>\n<p>Recording {}</p>\n", escape(&config.robot.name), escape(file));
    html += &table(config, series);
    let whole = series.whole();
    html += &figure_of(directory, "figure-1", "Figure 1: mode and verdict", |width_px| {
        Ok(series.changes.timeline(&roomy_end(&whole), width_px))
    })?;
    html += &series.changes.table();
    for ((caption, chart), number) in figures(config, series, whole).into_iter().zip(2..) {
        html += &figure(directory, &format!("figure-{number}"), &format!("Figure {number}: {caption}"), &chart)?;
    }
    html += &format!("<h2>Configuration</h2>\n<pre>{}</pre>\n{TAIL}", escape(text));
    fs::write(directory.join("index.html"), html)
}

fn figures(config: &Config, series: &Series, whole: Range<f64>) -> Vec<(&'static str, Chart)> {
    let axis = series.axis(config);
    // Over the axis of the force the one along which the TCP goes furthest.
    let travel = |of: usize| width(&range(series.measured.iter().map(|point| point.tcp_m[of])));
    let up = if axis < 3 { axis } else { 2 };
    let along = (0..3).filter(|of| *of != up).max_by(|a, b| travel(*a).total_cmp(&travel(*b))).unwrap_or(0);
    let curves: Vec<Curve> = [("measured, commanded", &series.measured), ("true, in force", &series.truth)]
        .into_iter()
        .filter(|(_, points)| !points.is_empty())
        .map(|(title, points)| Curve {
            title: title.to_owned(),
            force: points.iter().map(|point| (point.time_s, point.force[axis])).collect(),
            offset: points.iter().map(|point| (point.time_s, point.offset[axis])).collect(),
            path: points.iter().map(|point| (point.tcp_m[along], point.tcp_m[up])).collect(),
        })
        .collect();
    let every = || series.measured.iter().chain(&series.truth);
    let pushes_down = range(every().map(|point| point.force[axis]));
    let limit = config.contact.force_limit[axis].copysign(pushes_down.start + pushes_down.end);
    let window = |time: Range<f64>| {
        let within = || every().filter(|point| time.contains(&point.time_s));
        let force = range(within().map(|point| point.force[axis]).chain([0.0, limit]));
        let offset = range(within().map(|point| point.offset[axis]).chain([0.0]));
        Window { force: roomy(&force), offset: roomy(&offset), time }
    };
    let name = AXIS_NAMES[axis];
    let mut figures = vec![(
        "contact force and velocity offset",
        over_time(&curves, name, limit, window(whole), "Contact force and velocity offset over time"),
    )];
    if let Some(contact) = series.first_contact_s {
        let time = contact - BEFORE_CONTACT_S..contact + AFTER_CONTACT_S;
        let near = || every().filter(|point| time.contains(&point.time_s));
        let x = roomy(&range(near().map(|point| point.tcp_m[along])));
        let y = roomy(&range(near().map(|point| point.tcp_m[up])));
        let initial =
            over_time(&curves, name, limit, window(time.clone()), "Contact force and velocity offset at first contact");
        figures.push(("the same, initial contact phase", initial));
        figures.push((
            "TCP trajectory in the initial contact phase",
            paths(&curves, [AXIS_NAMES[along], AXIS_NAMES[up]], x, y),
        ));
        let believed = series.beliefs.chart(time, config.environment.normal_tolerance_rad > 0.0);
        figures.extend(believed.map(|chart| ("what was believed of the surface, initial contact phase", chart)));
    }
    figures
}

fn table(config: &Config, series: &Series) -> String {
    let axis = series.axis(config);
    let peak = |points: &[Point]| points.iter().map(|point| point.force[axis].abs()).fold(0.0, f64::max);
    let unit = if axis < 3 { "N" } else { "N m" };
    let command = series.last.as_ref().map(|last| last.command);
    let count = |of: fn(&ipc_types::CommandSample) -> u64| command.as_ref().map_or(0, of).to_string();
    let mut rows = vec![
        ("cycles that answered a sample".to_owned(), series.cycles.to_string()),
        (format!("peak measured |f_{}| in {unit}", AXIS_NAMES[axis]), format!("{:.1}", peak(&series.measured))),
        (format!("force limit in {unit}"), config.contact.force_limit[axis].to_string()),
        (
            "samples with the force beyond its limit since the daemon's start".to_owned(),
            series.last.as_ref().map_or(0, |last| last.exceeded_count).to_string(),
        ),
        (
            "contacts lost since the daemon's start".to_owned(),
            series.last.as_ref().map_or(0, |last| last.contact_losses).to_string(),
        ),
        ("fallbacks since the daemon's start".to_owned(), count(|command| command.fallback_count)),
        ("late answers since the daemon's start".to_owned(), count(|command| command.late_count)),
        ("samples missed since the daemon's start".to_owned(), count(|command| command.missed_count)),
        ("first stop".to_owned(), series.changes.first_stop()),
    ];
    if !series.truth.is_empty() {
        let name = AXIS_NAMES[axis];
        let of_truth = [
            (format!("peak true |f_{name}| in {unit}"), format!("{:.1}", series.true_peak[axis])),
            (
                format!("of that at the instants of samples, as drawn, |f_{name}| in {unit}"),
                format!("{:.1}", peak(&series.truth)),
            ),
        ];
        rows.splice(2..2, of_truth);
    }
    if !series.others.is_empty() {
        let kinds: Vec<String> = series.others.iter().map(|(kind, count)| format!("{count} {kind}")).collect();
        let what =
            "records besides, of silences and orders; a replay counts those after its begin as cycles too".to_owned();
        rows.insert(1, (what, kinds.join(", ")));
    }
    rows.extend(series.beliefs.rows());
    if !series.complete {
        rows.push(("end".to_owned(), "breaks off: its recorder was killed, or the disk was full".to_owned()));
    }
    let rows: String = rows.into_iter().map(|(what, value)| table_row(&[what, value], "td")).collect();
    format!("<table>\n{rows}</table>\n")
}

fn width(range: &Range<f64>) -> f64 {
    range.end - range.start
}

/// The range, never without width.
fn roomy_end(range: &Range<f64>) -> Range<f64> {
    if width(range) > 0.0 { range.clone() } else { range.start..range.start + 0.1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_what_is_finite_and_have_a_width() {
        assert_eq!(range([2.0, f64::NAN, -1.0, f64::INFINITY].into_iter()), -1.0..2.0);
        assert_eq!(range(std::iter::empty()), 0.0..0.0);
        let same = roomy(&(3.0..3.0));
        assert!(same.start < 3.0 && 3.0 < same.end);
    }
}
