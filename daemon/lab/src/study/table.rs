//! The study as text.

use std::fmt::Write as _;

use comfy_table::Table;

use super::controller::Variant;
use super::draw::ArmName;
use super::statistics::{Column, Distribution, Figures};

type Cell = fn(&Column) -> String;

/// One row per figure, one column per variant or arm, and a line per decade of stiffness below.
pub(crate) fn table(figures: &Figures) -> String {
    let rows: [(&str, Cell); 18] = [
        ("counted runs", |c| c.counted.to_string()),
        ("attainable", |c| c.attainable.to_string()),
        ("feasible", |c| c.feasible.to_string()),
        ("unsound (most over the limit)", |c| format!("{} ({:.1} %)", c.unsound, 100.0 * c.unsound_excess_max)),
        ("timid (share of attainable)", |c| match c.timid {
            Some(share) => format!("{} ({:.2} %)", c.timid_runs, 100.0 * share),
            None => "-".to_owned(),
        }),
        ("withdrawn", |c| c.withdrawn.to_string()),
        ("of these outpaced by the command later", |c| c.outpaced.to_string()),
        ("contact losses (runs; unavoidable)", |c| {
            format!("{} ({}; {})", c.contact_losses, c.runs_with_contact_losses, c.unavoidable_losses)
        }),
        ("over limit in cycles without verdict", |c| c.over_limit_without_verdict.to_string()),
        ("stops (without infeasible verdict)", |c| format!("{} ({})", c.stops, c.other_stops)),
        ("stops: peak over attainable, p50, p99, max", |c| distribution(c.stop_peak_ratio.as_ref(), 4)),
        ("stops: resting force p50, p99, max (N)", |c| distribution(c.resting_force_n.as_ref(), 1)),
        ("stops: resting over limit", |c| c.resting_over_limit.to_string()),
        ("apart: over limit at first active sample", |c| c.already_over_limit.to_string()),
        ("apart: under 3 samples in contact", |c| c.brief.to_string()),
        ("apart: no active sample", |c| c.no_contact.to_string()),
        ("apart: failed", |c| c.failed.to_string()),
        ("look at (unsound; timid; withdrawn; outpaced; lost; high; resting)", |c| {
            let some = |list: &[u64]| list.iter().take(3).map(u64::to_string).collect::<Vec<_>>().join(" ");
            let e = &c.examples;
            [&e.unsound, &e.timid, &e.withdrawn, &e.outpaced, &e.lost, &e.high, &e.resting]
                .map(|list| some(list))
                .join("; ")
        }),
    ];
    let other = |variant: &Variant| Some((variant.name(), figures.variants.get(variant.name())?));
    let of_arm = |arm: &ArmName| Some((arm.name(), figures.by_arm.get(arm.name())?));
    let first = if figures.by_arm.is_empty() { Variant::Nominal.name() } else { "all" };
    let columns: Vec<(&str, &Column)> = std::iter::once((first, &figures.nominal))
        .chain(Variant::ALL.iter().filter_map(other))
        .chain(ArmName::ALL.iter().filter_map(of_arm))
        .collect();
    let mut table = Table::new();
    let names = columns.iter().map(|(name, _)| (*name).to_owned());
    table.set_header(std::iter::once(format!("{} runs, seed {}", figures.runs, figures.seed)).chain(names));
    for (name, cell) in rows {
        table.add_row(std::iter::once(name.to_owned()).chain(columns.iter().map(|(_, column)| cell(column))));
    }
    let mut text = table.to_string();
    for decade in &figures.stiffness_decades {
        let _ = write!(
            text,
            "\n{:.0e} to {:.0e} N/m: {} attainable, {} unattainable",
            decade.from_n_m, decade.to_n_m, decade.attainable, decade.unattainable
        );
    }
    let _ =
        write!(text, "\nattainable in the linear problem, not confirmed on the nonlinear arm: {}", figures.unconfirmed);
    for speeds in figures.approach_speeds.iter().flatten() {
        let _ = write!(
            text,
            "\n{} ms: highest safe approach speed {:.3} m/s attainable, {:.3} m/s controller, {:.3} m/s paper profile",
            speeds.sampling_time_s * 1e3,
            speeds.attainable_m_s,
            speeds.controller_m_s,
            speeds.paper_m_s
        );
    }
    text
}

fn distribution(values: Option<&Distribution>, decimals: usize) -> String {
    match values {
        Some(d) => format!("{:.decimals$}, {:.decimals$}, {:.decimals$}", d.median, d.p99, d.max),
        None => "-".to_owned(),
    }
}
