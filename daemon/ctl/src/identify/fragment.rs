//! What was found as keys of the daemon's configuration, with what they were.

use admittance_host::config::parse;
use admittance_runner::config::Config;
use admittance_runner::cycle;

use super::estimate::Estimate;
use super::found::Found;
use super::text::between;
use super::told::{DAMPING, JOINT_DEAD_TIME, REPORT_LAG};
use super::toml_text::with_key;
use super::unknown::loaded;

/// A key with its new value.
pub(super) struct Entry {
    pub(super) section: &'static str,
    pub(super) key: &'static str,
    pub(super) value: String,
    pub(super) was: String,
    /// How certain it is.
    pub(super) remark: String,
    /// Why the configuration does not take it beside its other keys.
    pub(super) refused: Option<String>,
}

/// A number with as many digits as it is worth, in TOML.
pub(super) fn number(estimate: &Estimate) -> String {
    // Where the interval has no end, four digits.
    let step = if estimate.half_width.is_finite() { 0.1 * estimate.half_width } else { 0.0 };
    let least = step.max(1e-4 * estimate.value.abs()).max(1e-9);
    rounded(estimate.value, least)
}

/// A number to about `step`, in TOML.
fn rounded(value: f64, step: f64) -> String {
    let scale = 10_f64.powf(-step.log10().floor());
    // Of a large step the scale is no whole number.
    let value =
        if scale >= 1.0 { (value * scale).round() / scale } else { (value * scale).round() * (1.0 / scale).round() };
    format!("{:?}", if value == 0.0 { 0.0 } else { value })
}

/// A number that is known to a few per cent at best, in TOML.
pub(super) fn three_digits(value: f64) -> String {
    rounded(value, 1e-2 * value.abs().max(1e-9))
}

pub(super) fn half_width(estimate: &Estimate) -> String {
    if !estimate.half_width.is_finite() {
        return "unknown".to_owned();
    }
    let digits = estimate.half_width.max(1e-9);
    rounded(digits, 0.1 * digits)
}

/// By what share of what is printed the value may be larger than that, up to the end of its interval: rounded up to
/// thousandths, 1 at most. `None` of a value that may be zero, of which it would be no measure.
fn share_above(of: &Estimate) -> Option<f64> {
    let printed: f64 = number(of).parse().ok()?;
    let share = (of.value + of.half_width) / printed - 1.0;
    of.is_there().then(|| ((1e3 * share).ceil() / 1e3).min(1.0))
}

fn list(values: impl Iterator<Item = String>) -> String {
    format!("[{}]", values.collect::<Vec<_>>().join(", "))
}

/// The keys, of which those that the configuration `text` does not take are marked; and the text with
/// the others.
pub(super) fn entries(found: &Found, config: &Config, text: &str) -> (Vec<Entry>, String) {
    let mut entries = of_robot(found, config);
    entries.extend(of_cycle(found, config));
    entries.extend(of_wrench(found, config));
    let mut text = text.to_owned();
    for entry in &mut entries {
        let changed = with_key(&text, entry.section, entry.key, &entry.value);
        let parsed = parse::<Config>(&changed, "changed").map_err(|error| error.to_string());
        match parsed.and_then(|config| cycle::build(&config).map(|_| ())) {
            Ok(()) => text = changed,
            Err(why) => entry.refused = why.lines().last().map(|line| line.trim_start_matches("changed").to_owned()),
        }
    }
    (entries, text)
}

fn entry(section: &'static str, key: &'static str, value: String, was: String, remark: String) -> Entry {
    Entry { section, key, value, was, remark, refused: None }
}

fn interval(estimates: impl Iterator<Item = Estimate>, unit: &str) -> String {
    format!("95 %: +- {} {unit}", list(estimates.map(|estimate| half_width(&estimate))))
}

fn of_one(section: &'static str, key: &'static str, unit: &str, found: &Estimate, was: f64) -> Entry {
    let remark = format!("95 %: +- {} {unit}", half_width(found));
    entry(section, key, number(found), format!("{was:?}"), remark)
}

fn of_robot(found: &Found, config: &Config) -> Vec<Entry> {
    let (robot, joints) = (&config.robot, &found.loops.joints);
    let mut entries = Vec::new();
    let old = &robot.velocity_time_constant_s;
    let of_joint = |joint: usize, found: &Estimate, was: f64| {
        if joints[joint].is_told { number(found) } else { format!("{was:?}") }
    };
    if joints.iter().any(|joint| joint.is_told) {
        let value = list(joints.iter().enumerate().map(|(n, joint)| of_joint(n, &joint.time_constant_s, old[n])));
        let mut remark = interval(joints.iter().map(|joint| joint.time_constant_s), "s");
        let kept: Vec<String> = (0..joints.len()).filter(|n| !joints[*n].is_told).map(|n| n.to_string()).collect();
        if !kept.is_empty() {
            remark += &format!("; joint {} as it was", kept.join(", "));
        }
        entries.push(entry("robot", "velocity_time_constant_s", value, format!("{old:?}"), remark));
    }
    let told = robot.velocity_loop.as_ref();
    let section = "robot.velocity_loop";
    let was = |values: Option<&Vec<f64>>| values.map_or_else(|| "absent".to_owned(), |values| format!("{values:?}"));
    let damping = told.and_then(|told| told.damping.as_ref());
    let zero = Estimate::new(0.0, 1.0);
    if joints.iter().any(|joint| joint.damping.is_some() && joint.is_told) || damping.is_some() {
        let of = |n: usize| joints[n].damping.unwrap_or(zero);
        let value = |n: usize| {
            // A loop of first order is told by having no damping.
            let is_told = joints[n].damping.as_ref().is_none_or(|damping| DAMPING.tells(damping));
            if is_told { of_joint(n, &of(n), robot.damping(n)) } else { format!("{:?}", robot.damping(n)) }
        };
        let value = list((0..joints.len()).map(value));
        let remark = interval(joints.iter().filter_map(|joint| joint.damping), "of those of second order");
        entries.push(entry(section, "damping", value, was(damping), remark));
    }
    let dead = told.and_then(|told| told.dead_time_s.as_ref());
    if joints.iter().any(|joint| joint.is_told && joint.dead_time_s.is_there()) || dead.is_some() {
        let of = |n: usize| if joints[n].dead_time_s.is_there() { joints[n].dead_time_s } else { zero };
        let value = |n: usize| {
            let is_told = JOINT_DEAD_TIME.tells(&joints[n].dead_time_s);
            if is_told { of_joint(n, &of(n), robot.dead_time_s(n)) } else { format!("{:?}", robot.dead_time_s(n)) }
        };
        let value = list((0..joints.len()).map(value));
        let remark = interval(joints.iter().map(|joint| joint.dead_time_s), "s");
        entries.push(entry(section, "dead_time_s", value, was(dead), remark));
    }
    let (lag, old_lag) = (&found.loops.report_lag_s, robot.report_lag_s());
    if REPORT_LAG.tells(lag) && (lag.value > 0.0 || old_lag > 0.0) {
        entries.push(of_one(section, "report_lag_s", "s", lag, old_lag));
    }
    entries
}

fn of_cycle(found: &Found, config: &Config) -> Vec<Entry> {
    let mut entries = Vec::new();
    if let Some(delay) = &found.command_delay_s {
        entries.push(of_one("control", "command_delay_s", "s", delay, config.control.command_delay_s));
    }
    if let Some(lag_s) = found.lag_tolerance_s {
        let remark = "what the loops above leave unexplained; its price is in docs/commissioning.md".to_owned();
        let was = format!("{:?}", config.control.lag_tolerance_s);
        entries.push(entry("control", "lag_tolerance_s", rounded(lag_s.min(0.02), 1e-5), was, remark));
    }
    entries
}

/// A list of `[wrench]` with a value for each axis; axes that are not told keep theirs.
fn of_axes(key: &'static str, found: &[Option<Estimate>], was: &[f64], unit: &str) -> Option<Entry> {
    if found.iter().all(Option::is_none) {
        return None;
    }
    let value = |(found, was): (&Option<Estimate>, &f64)| found.as_ref().map_or_else(|| format!("{was:?}"), number);
    let width = |found: &Option<Estimate>| found.as_ref().map_or_else(|| "as it was".to_owned(), half_width);
    let remark = format!("95 %: +- {} {unit}", list(found.iter().map(width)));
    Some(entry("wrench", key, list(found.iter().zip(was).map(value)), format!("{was:?}"), remark))
}

fn of_wrench(found: &Found, config: &Config) -> Vec<Entry> {
    let mut entries = Vec::new();
    if let Some(tool) = &found.tool {
        let wrench = &config.wrench;
        if let Some(mass) = tool.mass_kg.as_ref().filter(|mass| mass.is_there()) {
            entries.push(of_one("wrench", "tool_mass_kg", "kg", mass, wrench.tool_mass_kg));
        }
        let center = tool.center_of_gravity_m.as_ref().map_or(&[][..], |center| &center[..]);
        entries.extend(of_axes("tool_center_of_gravity_m", center, &wrench.tool_center_of_gravity_m, "m"));
        let unit = "N, N m; `admittancectl tare` finds it as well";
        entries.extend(of_axes("bias", &tool.bias, &wrench.bias, unit));
        if tool.noise_n.value > 1e-3 {
            entries.push(of_one(
                "environment",
                "wrench_noise_n",
                "N",
                &tool.noise_n,
                config.environment.wrench_noise_n,
            ));
        }
    }
    if let Some(lag) = &found.wrench_time_constant_s {
        let old = &config.contact.wrench_time_constant_s;
        let value =
            list(old.iter().enumerate().map(
                |(axis, was)| {
                    if loaded(config, axis) { number(lag) } else { format!("{was:?}") }
                },
            ));
        let remark = format!("95 %: +- {} s; axes that felt nothing as they were", half_width(lag));
        entries.push(entry("contact", "wrench_time_constant_s", value, format!("{old:?}"), remark));
        // A narrow interval is no reason to allow for less: it knows nothing of what is no lag.
        let was = config.contact.wrench_lag_tolerance;
        if let Some(share) = share_above(lag).filter(|share| *share > was) {
            let remark = "up to the end of the interval of wrench_time_constant_s".to_owned();
            entries.push(entry("contact", "wrench_lag_tolerance", format!("{share:?}"), format!("{was:?}"), remark));
        }
    }
    if let Some(dead) = &found.wrench_dead_time_s
        && (dead.is_there() || config.contact.wrench_dead_time_s > 0.0)
    {
        let dead = if dead.is_there() { *dead } else { Estimate { value: 0.0, ..*dead } };
        entries.push(of_one("contact", "wrench_dead_time_s", "s", &dead, config.contact.wrench_dead_time_s));
    }
    if let Some(stiffness) = &found.stiffness_n_m {
        let was = config.environment.normal_stiffness_n_m;
        entries.push(of_one("environment", "normal_stiffness_n_m", "N/m", stiffness, was));
    }
    if let Some(impact) = &found.impact_stiffness_n_m {
        let environment = &config.environment;
        let was = |was: Option<f64>| was.map_or_else(|| "absent".to_owned(), |was| format!("{was:?}"));
        let remark = format!("95 %: {}", between(impact, 1.0, "N/m"));
        let mut add = |key: &'static str, value: f64, before: Option<f64>| {
            entries.push(entry("environment", key, three_digits(value), was(before), remark.clone()));
        };
        add("impact_stiffness_n_m", impact.value, environment.impact_stiffness_n_m);
        // What is too soft would make a verdict unsound.
        add("most_impact_stiffness_n_m", impact.most, environment.most_impact_stiffness_n_m);
    }
    entries
}

/// The fragment as it is printed.
pub(super) fn text(entries: &[Entry]) -> String {
    let mut text = String::new();
    let mut sections: Vec<&str> = Vec::new();
    entries.iter().for_each(|entry| {
        if !sections.contains(&entry.section) {
            sections.push(entry.section);
        }
    });
    for section in sections {
        text += &format!("[{section}]\n");
        for Entry { key, value, was, remark, refused, .. } in entries.iter().filter(|entry| entry.section == section) {
            match refused {
                None => text += &format!("{key} = {value}   # was {was}; {remark}\n"),
                Some(why) => {
                    text +=
                        &format!("# {key} = {value}   was {was}; {remark}; not accepted beside the other keys: {why}\n")
                }
            }
        }
        text += "\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_they_are_worth() {
        for (value, half_width, expected) in
            [(0.0123456, 1e-4, "0.01235"), (98765.4, 500.0, "98770.0"), (0.0, 1e-5, "0.0"), (2.00034, 0.02, "2.0")]
        {
            assert_eq!(number(&Estimate::new(value, half_width)), expected);
        }
        let endless = Estimate::new(1.234567, f64::INFINITY);
        assert_eq!((number(&endless).as_str(), half_width(&endless).as_str()), ("1.2346", "unknown"));
    }

    #[test]
    fn what_is_printed_and_its_share_reach_to_the_end_of_the_interval() {
        for (value, half_width) in [(0.0424926, 0.0102592), (0.02, 0.003004), (0.0123, 0.003), (5e-4, 4.9e-4)] {
            let lag = Estimate::new(value, half_width);
            let (printed, share) =
                (number(&lag).parse::<f64>().expect("a number"), share_above(&lag).expect("a share"));
            let (reached, end) = (printed * (1.0 + share), value + half_width);
            assert!(
                reached >= end - 1e-12 && reached <= end + 2e-3 * printed,
                "{value} +- {half_width}: {reached}, {end}"
            );
        }
        for (value, half_width) in [(3e-5, 1e-4), (0.0, 1e-5), (0.02, f64::INFINITY)] {
            assert_eq!(share_above(&Estimate::new(value, half_width)), None);
        }
    }
}
