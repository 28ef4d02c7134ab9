//! The limits as text and, by the same struct, as JSON.

use std::fmt::Write as _;
use std::path::Path;

use admittance_runner::config::Config;
use comfy_table::Table;
use serde::Serialize;

use super::approach::AFTER_CONTACT_S;
use super::cell::{Cell, FORCE_TOLERANCE_N, is_own, limited_axes};
use super::ignorance::{Answer, Price};
use super::{Question, Worlds, search};
use admittance_core::quantities::AXIS_NAMES;

/// Everything that was asked and found.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Limits {
    /// File of the configuration.
    config: String,
    /// Name of the arm.
    robot: String,
    /// Law of the controller.
    law: &'static str,
    /// Joint position at contact in rad.
    joint_position_rad: Vec<f64>,
    /// That of the other elbow, which was not looked at.
    #[serde(skip_serializing_if = "Option::is_none")]
    other_joint_position_rad: Option<Vec<f64>>,
    /// Where the TCP touches, in m.
    contact_point_m: [f64; 3],
    /// Outward normal of the surface.
    surface_normal: [f64; 3],
    /// Direction of the approach.
    direction: [f64; 3],
    /// Part of the speed that goes into the surface.
    inward_share: f64,
    /// The configuration's own cycle time in s and stiffness in N/m.
    own_sampling_time_s: f64,
    own_stiffness_n_m: f64,
    /// Command delay in s, the same at all cycle times.
    command_delay_s: f64,
    /// Force limits of the admittance axes, and how far above them still counts as kept.
    force_limits: Vec<ForceLimit>,
    force_tolerance_n: f64,
    /// Instants of contact within a cycle.
    instants: u32,
    /// How long each approach was simulated after the contact, in s.
    time_after_contact_s: f64,
    /// In the table's order: cycle times descending, stiffnesses ascending.
    pub(crate) sampling_times_s: Vec<f64>,
    pub(crate) stiffnesses_n_m: Vec<f64>,
    /// Row by row.
    pub(crate) cells: Vec<Cell>,
    /// At the configured stiffness, a row each, without the limits of the drives; empty where there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) cells_unlimited_drives: Vec<Cell>,
    /// For the cell as configured.
    recommended: Recommended,
    /// What it costs not to know the stiffness, where that was asked.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) ignorance: Vec<Price>,
    /// Notes on the figures.
    notes: Vec<String>,
}

/// The speed to approach at with the configuration as it is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Recommended {
    /// Highest speed in m/s at which in none of the random worlds a force exceeded its limit or the
    /// controller stopped; 0 when there is none.
    pub(super) speed_m_s: f64,
    /// Highest safe speed with the model as told, m/s.
    pub(super) as_told_m_s: f64,
    /// What comes first above it: in a random world, or with the model as told, beyond whose speed none
    /// is tried.
    pub(super) limited_by: String,
    /// Random worlds.
    pub(super) worlds: u64,
    /// Their seed.
    pub(super) worlds_seed: u64,
    /// The share of such worlds, others included, that this speed is not safe in: with 95 % confidence
    /// at most so much.
    pub(super) unsafe_share_at_most: f64,
}

impl Recommended {
    pub(super) fn new(speed_m_s: f64, as_told_m_s: f64, limited_by: String, worlds: Worlds) -> Self {
        let Worlds { count, seed } = worlds;
        // Were it more, all of so many worlds would be safe in one of twenty draws at most; that the
        // speed was chosen by them changes nothing, since it is one number.
        let unsafe_share_at_most = 1.0 - 0.05_f64.powf(1.0 / count as f64);
        Self { speed_m_s, as_told_m_s, limited_by, worlds: count, worlds_seed: seed, unsafe_share_at_most }
    }
}

#[derive(Debug, Clone, Serialize)]
struct ForceLimit {
    axis: &'static str,
    force_limit_n: f64,
}

impl Limits {
    /// What was found, in the order of the table.
    pub(crate) fn new(
        path: &Path,
        config: &Config,
        question: &Question,
        mut cells: Vec<Cell>,
        mut cells_unlimited_drives: Vec<Cell>,
        recommended: Recommended,
    ) -> Self {
        let Question { approach, stiffnesses_n_m, sampling_times_s, instants, worlds: _ } = question;
        let by_place = |a: &Cell, b: &Cell| {
            b.sampling_time_s.total_cmp(&a.sampling_time_s).then(a.stiffness_n_m.total_cmp(&b.stiffness_n_m))
        };
        cells.sort_by(by_place);
        cells_unlimited_drives.sort_by(by_place);
        Self {
            config: path.display().to_string(),
            robot: config.robot.name.clone(),
            law: config.control.law.name(),
            joint_position_rad: approach.pose.joint_position_rad.clone(),
            other_joint_position_rad: approach.other_joint_position_rad.clone(),
            contact_point_m: approach.pose.tcp_position_m,
            surface_normal: approach.normal,
            direction: approach.direction,
            inward_share: approach.inward_share(),
            own_sampling_time_s: config.control.sampling_time_s,
            own_stiffness_n_m: config.environment.normal_stiffness_n_m,
            command_delay_s: config.control.command_delay_s,
            force_limits: limited_axes(config)
                .map(|(axis, force_limit_n)| ForceLimit { axis: AXIS_NAMES[axis], force_limit_n })
                .collect(),
            force_tolerance_n: FORCE_TOLERANCE_N,
            instants: *instants,
            time_after_contact_s: AFTER_CONTACT_S,
            sampling_times_s: sampling_times_s.clone(),
            stiffnesses_n_m: stiffnesses_n_m.clone(),
            recommended,
            ignorance: Vec::new(),
            notes: notes(config, question, &cells),
            cells,
            cells_unlimited_drives,
        }
    }
}

fn notes(config: &Config, question: &Question, cells: &[Cell]) -> Vec<String> {
    let own = config.control.sampling_time_s;
    let others = question.sampling_times_s.iter().any(|time| !is_own(config, *time));
    let mut notes = Vec::new();
    if others && config.mpc.step_lengths_s.is_some() {
        let own = milliseconds(own);
        notes.push(format!(
            "mpc.step_lengths_s is for {own} ms only; the other cycle times run with the default step lengths."
        ));
    }
    if let Some(horizon) = config.mpc.horizon.filter(|_| others) {
        let fastest = question.sampling_times_s.last().copied().unwrap_or(own);
        let span = |time: f64| milliseconds(f64::from(horizon) * time);
        notes.push(format!(
            "mpc.horizon = {horizon} steps at every cycle time: {} ms at {} ms, but {} ms at {} ms. Without the key the \
             horizon is as long in time at all of them.",
            span(own),
            milliseconds(own),
            span(fastest),
            milliseconds(fastest)
        ));
    }
    if config.control.command_delay_s > 0.0 && others {
        let delay = milliseconds(config.control.command_delay_s);
        notes.push(format!("control.command_delay_s = {delay} ms at every cycle time."));
    }
    if question.approach.inward_share() < 0.9995 {
        let share = 100.0 * question.approach.inward_share();
        notes.push(format!("Speeds are along the approach; {share:.1} % of them go into the surface."));
    }
    for cell in cells.iter().filter(|cell| cell.lowered) {
        notes.push(format!(
            "{} ms, {} N/m: some higher speeds are safe too, but not all up to them.",
            milliseconds(cell.sampling_time_s),
            stiffness(cell.stiffness_n_m)
        ));
    }
    for cell in cells.iter().filter(|cell| cell.speed_m_s.is_none()) {
        let (time, stiffness) = (milliseconds(cell.sampling_time_s), stiffness(cell.stiffness_n_m));
        notes.push(format!("{time} ms, {stiffness} N/m is left out: {}", cell.limited_by));
    }
    notes
}

/// Heading, table, what "safe" means, notes.
pub(crate) fn text(limits: &Limits) -> String {
    let mut text = format!("{}: {}, law {}\n", limits.config, limits.robot, limits.law);
    let _ = writeln!(
        text,
        "Contact at {} m with the joints at {} (rad or m){}.",
        list(&limits.contact_point_m),
        list(&limits.joint_position_rad),
        limits
            .other_joint_position_rad
            .as_ref()
            .map_or_else(String::new, |other| format!(" (the other elbow, {}, with --joints)", list(other)))
    );
    let _ = writeln!(
        text,
        "Approach along {}; outward surface normal {}.\n\nHighest safe approach speed in m/s, and what comes first above it:",
        list(&limits.direction),
        list(&limits.surface_normal),
    );
    let mut table = Table::new();
    let mark = |is_configured: bool| if is_configured { " *" } else { "" };
    let unlimited = limits
        .cells_unlimited_drives
        .first()
        .map(|cell| format!("{} N/m, drives without limits", stiffness(cell.stiffness_n_m)));
    let of_stiffness = |k: &f64| format!("{} N/m{}", stiffness(*k), mark(*k == limits.own_stiffness_n_m));
    let header = std::iter::once("cycle time".to_owned()).chain(limits.stiffnesses_n_m.iter().map(of_stiffness));
    table.set_header(header.chain(unlimited));
    let rows = limits.cells.chunks(limits.stiffnesses_n_m.len().max(1));
    for (index, (time, row)) in limits.sampling_times_s.iter().zip(rows).enumerate() {
        let name = format!("{} ms{}", milliseconds(*time), mark(*time == limits.own_sampling_time_s));
        let unlimited = limits.cells_unlimited_drives.get(index);
        table.add_row(std::iter::once(name).chain(row.iter().chain(unlimited).map(entry)));
    }
    let bounds: Vec<String> =
        limits.force_limits.iter().map(|limit| format!("{} N on {}", limit.force_limit_n, limit.axis)).collect();
    let _ = write!(
        text,
        "{table}\n* as configured. Stiffness: along the normal, believed and true.\n\
         Safe: at each of {} instants of contact within a cycle, and for {} s from then on, the true force is at most {} \
         (+ {} N), the contact is not lost, and the controller neither stops nor refuses a sample. Each answer is a speed \
         that was tried, the next higher one tried is not safe and at most {:.1} % above it; speeds below were tried down to \
         half. The simulated robot is exactly what the configuration says, without noise and late cycles.",
        limits.instants,
        limits.time_after_contact_s,
        bounds.join(", "),
        limits.force_tolerance_n,
        100.0 * (search::RESOLUTION - 1.0) + 0.5,
    );
    let _ = write!(text, "\n\n{}", recommendation(&limits.recommended, limits.force_tolerance_n));
    if !limits.ignorance.is_empty() {
        let _ = write!(text, "\n\n{}", ignorance(limits));
    }
    for note in &limits.notes {
        let _ = write!(text, "\nNote: {note}");
    }
    text
}

/// What it costs not to know the stiffness.
fn ignorance(limits: &Limits) -> String {
    let own = stiffness(limits.own_stiffness_n_m);
    let mut table = Table::new();
    table.set_header(["true stiffness", "noise", "told as it is", "told the range", &format!("told {own} N/m")]);
    let entry = |answer: &Answer| match answer.speed_m_s {
        None => format!("-\n{}", answer.limited_by),
        Some(0.0) => format!("< {}\n{}", search::LOWEST_M_S, answer.limited_by),
        Some(speed) => format!("{speed}\n{}", answer.limited_by),
    };
    for price in &limits.ignorance {
        let [least, most] = price.range_n_m.map(stiffness);
        let of_surface = [format!("{least} to {most} N/m"), format!("{} N", price.noise_n)];
        table.add_row(of_surface.into_iter().chain([&price.each, &price.range, &price.configured].map(entry)));
    }
    format!(
        "The price of ignorance, at {} ms: highest approach speed in m/s that is safe on the softest, the configured and the \
         hardest surface, by what is told of them. The noise of the wrench is told.\n{table}",
        milliseconds(limits.own_sampling_time_s)
    )
}

/// What to approach at, and why.
fn recommendation(found: &Recommended, tolerance_n: f64) -> String {
    if found.speed_m_s <= 0.0 {
        return format!("Recommended as configured: no speed; {}.", found.limited_by);
    }
    format!(
        "Recommended as configured: {} m/s ({} m/s with the model exactly as told). In {} random worlds of seed {} that a \
         careful commissioning leaves open (see --help) no force exceeds its limit (+ {tolerance_n} N) and nothing stops; losses \
         of contact are not counted. So, with 95 % confidence, in all but {:.1} % of such worlds at most. Above it comes: {}.",
        found.speed_m_s,
        found.as_told_m_s,
        found.worlds,
        found.worlds_seed,
        100.0 * found.unsafe_share_at_most,
        found.limited_by
    )
}

fn entry(cell: &Cell) -> String {
    match (cell.speed_m_s, cell.unsafe_m_s) {
        (None, _) => "-".to_owned(),
        // Below the lowest speed tried nothing is known.
        (Some(0.0), Some(lowest)) => format!("< {lowest}\n{}", cell.limited_by),
        (Some(speed), None) => format!(">= {speed}\n{}", cell.limited_by),
        (Some(speed), Some(_)) => format!("{speed}\n{}", cell.limited_by),
    }
}

fn list(values: &[f64]) -> String {
    // Rounding must not leave a minus sign before zero.
    let values = values.iter().map(|value| format!("{:.4}", (value * 1e4).round() / 1e4 + 0.0));
    format!("({})", values.collect::<Vec<_>>().join(", "))
}

/// A cycle time in ms, in its shortest exact form.
pub(crate) fn milliseconds(time_s: f64) -> f64 {
    (time_s * 1e9).round() / 1e6
}

/// A stiffness in N/m, as in 3e5.
pub(crate) fn stiffness(stiffness_n_m: f64) -> String {
    format!("{:e}", search::round_to_digits(stiffness_n_m, 6))
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::approach::Approach;
    use super::super::tests::planar;
    use super::*;

    pub(in crate::limits) fn made_up() -> Limits {
        let mut config = planar();
        config.mpc.horizon = Some(5);
        let question = Question {
            approach: Approach::new(&config, None, Some(&[0.0, -1.0])).unwrap(),
            stiffnesses_n_m: vec![1e5, 3e5],
            sampling_times_s: vec![0.004, 0.00025],
            instants: 16,
            worlds: Worlds { count: 100, seed: 7 },
        };
        let cell = |sampling_time_s, stiffness_n_m, speed_m_s, unsafe_m_s| Cell {
            sampling_time_s,
            stiffness_n_m,
            speed_m_s,
            unsafe_m_s,
            limited_by: "contact lost".to_owned(),
            lowered: false,
        };
        let cells = vec![
            cell(0.00025, 1e5, Some(1.23), None),
            cell(0.00025, 3e5, Some(0.0), Some(0.01)),
            cell(0.004, 3e5, None, None),
            cell(0.004, 1e5, Some(0.456), Some(0.46)),
        ];
        let recommended = Recommended::new(0.2, 0.456, "stop: Infeasible".to_owned(), question.worlds);
        let unlimited = vec![cell(0.00025, 1e5, Some(1.5), None), cell(0.004, 1e5, Some(0.567), Some(0.57))];
        Limits::new(Path::new("cell.toml"), &config, &question, cells, unlimited, recommended)
    }

    #[test]
    fn the_text_says_what_the_numbers_are() {
        let text = text(&made_up());
        for told in [
            "cell.toml: planar 2R, law mpc",
            "(1.3200, 0.6800, 0.0000) m",
            "other elbow",
            "Approach along (0.0000, -1.0000, 0.0000)",
            "1e5 N/m *",
            "4 ms *",
            "0.25 ms",
            "0.456",
            "1e5 N/m, drives without limits",
            "0.567",
            "Recommended as configured: 0.2 m/s (0.456 m/s with the model exactly as told)",
            "In 100 random worlds of seed 7",
            "in all but 3.0 % of such worlds",
            "Above it comes: stop: Infeasible",
            ">= 1.23",
            "< 0.01",
            "contact lost",
            "200 N on x, 200 N on y (+ 0.5 N)",
            "90.6 % of them go into the surface",
            "20 ms at 4 ms, but 1.25 ms at 0.25 ms",
            "4 ms, 3e5 N/m is left out",
        ] {
            assert!(text.contains(told), "{told} is missing in\n{text}");
        }
    }

    #[test]
    fn cells_are_in_the_order_of_the_table() {
        let json = serde_json::to_value(made_up()).unwrap();
        let speeds: Vec<Option<f64>> =
            json["cells"].as_array().unwrap().iter().map(|cell| cell["speed_m_s"].as_f64()).collect();
        assert_eq!(speeds, [Some(0.456), None, Some(1.23), Some(0.0)]);
    }
}
