//! What was found, for a terminal.

use std::fmt::Write as _;

use super::estimate::Estimate;
use super::found::Found;
use super::fragment::{half_width, number, three_digits};
use super::impact::Between;
use super::told::{JOINT_DEAD_TIME, REPORT_LAG};

pub(super) fn with_interval(estimate: &Estimate, factor: f64, unit: &str) -> String {
    let scaled = Estimate::new(estimate.value * factor, estimate.half_width * factor);
    format!("{} +- {} {unit}", number(&scaled), half_width(&scaled))
}

pub(super) fn between(of: &Between, factor: f64, unit: &str) -> String {
    let [value, least, most] = [of.value, of.least, of.most].map(|value| three_digits(value * factor));
    format!("{value} {unit}, between {least} and {most}")
}

/// Name and value of all that is no joint's.
pub(super) fn rows(found: &Found) -> Vec<(String, String)> {
    let mut rows = Vec::new();
    let mut add = |name: &str, value: String| rows.push((name.to_owned(), value));
    let loops = &found.loops;
    if REPORT_LAG.tells(&loops.report_lag_s) {
        add("lag of the reported velocities", with_interval(&loops.report_lag_s, 1e3, "ms"));
    }
    match (&found.command_delay_s, found.command_delay_between_s) {
        (Some(delay), _) => add("command delay", with_interval(delay, 1e3, "ms")),
        (None, Some((least, most))) => {
            add(
                "command delay",
                format!("between {:.3} and {:.3} ms, by the commands in force", least * 1e3, most * 1e3),
            );
        }
        (None, None) => {}
    }
    if let Some(tool) = &found.tool {
        if let Some(mass) = &tool.mass_kg {
            add("mass of the tool", with_interval(mass, 1.0, "kg"));
        }
        for (axis, of) in ["x", "y", "z"].iter().zip(tool.center_of_gravity_m.iter().flatten()) {
            if let Some(of) = of {
                add(&format!("centre of gravity, {axis}"), with_interval(of, 1e3, "mm"));
            }
        }
        add("noise of the wrench, x y z", with_interval(&tool.noise_n, 1.0, "N"));
    }
    for (name, of, factor, unit) in [
        ("lag of the wrench", &found.wrench_time_constant_s, 1e3, "ms"),
        ("dead time of the wrench", &found.wrench_dead_time_s, 1e3, "ms"),
        ("stiffness", &found.stiffness_n_m, 1e-3, "N/mm"),
    ] {
        if let Some(of) = of {
            add(name, with_interval(of, factor, unit));
        }
    }
    if let Some(impact) = &found.impact_stiffness_n_m {
        add("stiffness in an impact, before gears give", between(impact, 1e-3, "N/mm"));
    }
    for (number, touch) in found.touches.iter().enumerate() {
        let rms = format!("{:.2} N RMS of {:.0} N", touch.residual_n, touch.peak_n);
        add(&format!("touch {number}: left by the fit"), rms);
    }
    if found.saturated_samples > 0 {
        add("samples at the end of the sensor's range, left out", found.saturated_samples.to_string());
    }
    if let Some(lag_s) = found.lag_tolerance_s {
        add("lag that nothing explains", format!("{:.2} ms", lag_s * 1e3));
    }
    rows
}

/// Cells of each joint, under these names.
pub(super) const JOINT_HEADER: [&str; 6] =
    ["joint", "order", "time constant", "damping", "dead time", "left by the fit"];

pub(super) fn joints(found: &Found) -> Vec<Vec<String>> {
    let cells = |(number, joint): (usize, &super::loops::FoundLoop)| {
        let share = 100.0 * joint.residual_rad_s / joint.range_rad_s.max(1e-9);
        let told = |text: String| if joint.is_told { text } else { "not told".to_owned() };
        vec![
            number.to_string(),
            told(if joint.damping.is_some() { "second".to_owned() } else { "first".to_owned() }),
            told(with_interval(&joint.time_constant_s, 1e3, "ms")),
            joint.damping.as_ref().map_or_else(String::new, |damping| with_interval(damping, 1.0, "")),
            if JOINT_DEAD_TIME.tells(&joint.dead_time_s) {
                told(with_interval(&joint.dead_time_s, 1e3, "ms"))
            } else {
                "not told".to_owned()
            },
            format!("{:.1e} {} RMS, {share:.2} % of its range", joint.residual_rad_s, joint.speed_unit),
        ]
    };
    found.loops.joints.iter().enumerate().map(cells).collect()
}

/// Why a joint's loop is taken to be of first or second order.
pub(super) const ORDER: &str =
    "A loop is taken to be of second order where Akaike's criterion prefers it by 10 and the residual is 1 % smaller.";

/// All of it.
pub(super) fn text(found: &Found, fragment: &str) -> String {
    let mut text = format!("{} cycles, {:.1} s; values with their 95 % intervals\n\n", found.cycles, found.duration_s);
    let mut table = comfy_table::Table::new();
    table.load_style(comfy_table::presets::NOTHING).set_header(JOINT_HEADER);
    table.add_rows(joints(found));
    let _ = writeln!(text, "{table}\n{ORDER}\n");
    for (name, value) in rows(found) {
        let _ = writeln!(text, "{name}: {value}");
    }
    if !found.unknown.is_empty() {
        text += "\nNot told by this recording:\n";
        for unknown in &found.unknown {
            let _ = writeln!(text, "- {}: {}. It takes {}.", unknown.what, unknown.why, unknown.motion);
        }
    }
    let _ = write!(text, "\n# Put these in place of the keys of the same name:\n{fragment}");
    text
}
