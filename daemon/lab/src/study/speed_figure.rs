//! The highest safe approach speed against the cycle time, on the paper's arm and surface: what is
//! attainable at all, the controller, and the paper profile.

use plotters::style::RGBColor;
use serde::Serialize;

use super::closed_loop::{self, FirstActive};
use super::controller::{self, Profile, Variant};
use super::draw::{Draw, SAMPLING_TIMES_S};
use super::statistics::exceeds;
use admittancectl::parallel;
use admittancectl::report::chart::{Chart, Line, LineStyle, Panel};

/// Instants of contact within a sample that a safe speed has to be safe at.
const INSTANTS: u32 = 16;
/// Speeds in m/s: the first, the distance at which they are tried upward, and that to which the
/// boundary is then narrowed.
const FIRST_M_S: f64 = 0.05;
const STEP_M_S: f64 = 0.05;
const RESOLUTION_M_S: f64 = 0.005;
const HIGHEST_M_S: f64 = 1.5;

const LOOKS: [LineStyle; 3] = [
    LineStyle { color: RGBColor(0x1B, 0x7F, 0x4B), width: 2.0, dash: &[2.0, 3.0] },
    LineStyle { color: RGBColor(0x0B, 0x5C, 0xAD), width: 2.2, dash: &[] },
    LineStyle { color: RGBColor(0xC4, 0x4E, 0x12), width: 1.4, dash: &[7.0, 4.0] },
];

/// One cycle time. Each speed is the highest in m/s below which all that were tried are safe,
/// whatever the instant of contact; 0 when none is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Speeds {
    /// T_s in s.
    pub(crate) sampling_time_s: f64,
    /// Some input keeps the force limits for 100 ms.
    pub(crate) attainable_m_s: f64,
    /// The controller keeps the force limits and is not stopped.
    pub(crate) controller_m_s: f64,
    /// So does the paper profile.
    pub(crate) paper_m_s: f64,
}

#[derive(Debug, Clone, Copy)]
enum Curve {
    Attainable,
    Run(Profile),
}

const CURVES: [Curve; 3] = [Curve::Attainable, Curve::Run(Profile::Default), Curve::Run(Profile::Paper)];

/// The three speeds at every cycle time.
///
/// # Errors
/// What controller, plant or judge do not accept.
pub(crate) fn speeds(threads: usize) -> Result<Vec<Speeds>, String> {
    let tasks: Vec<(f64, Curve)> =
        SAMPLING_TIMES_S.into_iter().flat_map(|time| CURVES.map(|curve| (time, curve))).collect();
    let found = parallel::map(tasks.len() as u64, threads, "curve points", |index| {
        let (time, curve) = tasks[index as usize];
        highest_safe_speed(time, curve)
    })?;
    let speeds = SAMPLING_TIMES_S.into_iter().zip(found.chunks_exact(CURVES.len())).map(|(sampling_time_s, speeds)| {
        Speeds { sampling_time_s, attainable_m_s: speeds[0], controller_m_s: speeds[1], paper_m_s: speeds[2] }
    });
    Ok(speeds.collect())
}

fn highest_safe_speed(sampling_time_s: f64, curve: Curve) -> Result<f64, String> {
    let mut safe = 0.0;
    let mut unsafe_above = FIRST_M_S;
    while unsafe_above <= HIGHEST_M_S && is_safe(sampling_time_s, unsafe_above, curve)? {
        safe = unsafe_above;
        unsafe_above += STEP_M_S;
    }
    while safe > 0.0 && unsafe_above <= HIGHEST_M_S && unsafe_above - safe > RESOLUTION_M_S {
        let middle = 0.5 * (safe + unsafe_above);
        if is_safe(sampling_time_s, middle, curve)? {
            safe = middle;
        } else {
            unsafe_above = middle;
        }
    }
    Ok(safe)
}

fn is_safe(sampling_time_s: f64, speed_m_s: f64, curve: Curve) -> Result<bool, String> {
    let profile = match curve {
        Curve::Attainable => Profile::Default,
        Curve::Run(profile) => profile,
    };
    let mut deepest: Option<(Draw, FirstActive)> = None;
    for instant in 0..INSTANTS {
        let draw = Draw::of_the_paper(sampling_time_s, speed_m_s, f64::from(instant) / f64::from(INSTANTS));
        let config = controller::controller(&draw, profile, Variant::Nominal)?;
        let seen = closed_loop::run(&draw, &config, &controller::scenario(&draw)?)?;
        let (limit, first) = (draw.normal_force_limit_n(), seen.first_active.clone().ok_or("no active sample")?);
        if matches!(curve, Curve::Run(_)) && (seen.stopped() || exceeds(seen.peak_n, limit)) {
            return Ok(false);
        }
        if deepest.as_ref().is_none_or(|(_, before)| first.normal_force_n > before.normal_force_n) {
            deepest = Some((draw, first));
        }
    }
    match (curve, deepest) {
        // The instants differ in how far the tool got before the first active sample and in nothing
        // else that counts: the judge is asked about the worst only.
        (Curve::Attainable, Some((draw, first))) => {
            Ok(closed_loop::contact(&draw, &first).lowest_peak()?.peak_n <= draw.normal_force_limit_n())
        }
        _ => Ok(true),
    }
}

/// The figure as SVG.
///
/// # Errors
/// What plotters says about a coordinate system that it cannot draw.
pub(crate) fn svg(speeds: &[Speeds]) -> Result<String, String> {
    let values: [fn(&Speeds) -> f64; 3] = [|s| s.attainable_m_s, |s| s.controller_m_s, |s| s.paper_m_s];
    let line = |(style, value): (LineStyle, fn(&Speeds) -> f64)| Line {
        style,
        points: speeds.iter().map(|speeds| (speeds.sampling_time_s * 1e3, value(speeds))).collect(),
    };
    let names = ["attainable at all", "controller", "paper profile"];
    let highest = speeds.iter().flat_map(|speeds| values.map(|value| value(speeds))).fold(0.1, f64::max);
    let chart = Chart {
        size: (860, 460),
        description: "Highest safe approach speed against cycle time".to_owned(),
        legend: LOOKS.into_iter().zip(names.map(str::to_owned)).collect(),
        panels: vec![Panel {
            x: 0.0..4.2,
            y: 0.0..highest * 1.1,
            x_label: "cycle time in ms".to_owned(),
            y_label: "approach speed in m/s".to_owned(),
            logarithmic: false,
            areas: Vec::new(),
            lines: LOOKS.into_iter().zip(values).map(line).collect(),
            notes: Vec::new(),
        }],
    };
    chart.svg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_contact_is_where_the_prototype_had_it() {
        let draw = Draw::of_the_paper(0.004, 0.25, 0.0);
        let [x, y, _] = draw.contact_point_m();
        assert!((x - 1.32).abs() < 1e-12 && (y - 0.68).abs() < 1e-12 && draw.contact_position[1] < 0.0);
    }

    #[test]
    fn the_figure_names_its_lines_and_axes() {
        let speeds = SAMPLING_TIMES_S.map(|sampling_time_s| Speeds {
            sampling_time_s,
            attainable_m_s: 0.5,
            controller_m_s: 0.4,
            paper_m_s: 0.3,
        });
        let svg = svg(&speeds).unwrap();
        for text in ["cycle time in ms", "approach speed in m/s", "attainable at all", "controller", "paper profile"] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn a_faster_cycle_attains_a_higher_speed() {
        let safe = |sampling_time_s, speed| is_safe(sampling_time_s, speed, Curve::Attainable).unwrap();
        assert!(safe(0.004, 0.35) && !safe(0.004, 0.5));
        assert!(safe(0.001, 0.65) && !safe(0.001, 0.8));
    }
}
