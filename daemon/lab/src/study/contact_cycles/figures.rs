//! From contacts to figures.

use std::collections::BTreeMap;

use comfy_table::Table;
use serde::Serialize;

use super::Seen;
use super::draw::CELLS;

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Counts {
    contacts: usize,
    /// Cycles in contact.
    contact_cycles: u64,
    /// Problems given to the solver, those of stops included.
    solves: u64,
    /// Of them, proven infeasible.
    infeasible: u64,
    /// Of them, given up.
    solver_failures: u64,
    /// Cycles in contact or in a stop without a usable answer, although the sample was one.
    fallbacks: u64,
    /// Cycles in contact or in a stop whose sample could not be used.
    refused: u64,
    /// Iterations of a problem in the mean.
    iterations_mean: f64,
    /// Most iterations of a problem.
    iterations_max: u32,
    /// By reason.
    stops: BTreeMap<String, usize>,
}

impl Counts {
    fn of<'a>(seen: impl Iterator<Item = &'a Seen> + Clone) -> Self {
        let sum = |what: fn(&Seen) -> u64| seen.clone().map(what).sum();
        let (solves, iterations) = (sum(|seen| seen.outcomes.solves), sum(|seen| seen.outcomes.iterations));
        let mut stops = BTreeMap::new();
        for reason in seen.clone().filter_map(|seen| seen.stop_reason) {
            *stops.entry(reason.to_string()).or_insert(0) += 1;
        }
        Self {
            contacts: seen.clone().count(),
            contact_cycles: sum(|seen| seen.contact_cycles),
            solves,
            infeasible: sum(|seen| seen.outcomes.infeasible),
            solver_failures: sum(|seen| seen.outcomes.failed),
            fallbacks: sum(|seen| seen.unanswered),
            refused: sum(|seen| seen.refused),
            iterations_mean: iterations as f64 / solves.max(1) as f64,
            iterations_max: seen.map(|seen| seen.outcomes.iterations_max).max().unwrap_or(0),
            stops,
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct OfCell {
    cell: &'static str,
    #[serde(flatten)]
    counts: Counts,
}

/// The whole study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Figures {
    seed: u64,
    #[serde(flatten)]
    all: Counts,
    by_cell: Vec<OfCell>,
    /// Contacts in which a problem had no usable answer.
    pub(super) found: Vec<u64>,
}

impl Figures {
    pub(super) fn of(seed: u64, seen: &[Seen]) -> Self {
        let of_cell =
            |cell: &'static str| OfCell { cell, counts: Counts::of(seen.iter().filter(move |seen| seen.cell == cell)) };
        Self {
            seed,
            all: Counts::of(seen.iter()),
            by_cell: CELLS.map(of_cell).to_vec(),
            found: seen.iter().filter(|seen| seen.is_finding()).map(|seen| seen.index).collect(),
        }
    }

    /// As text.
    pub(super) fn table(&self) -> String {
        let mut table = Table::new();
        table.set_header([
            "cell",
            "contacts",
            "contact cycles",
            "problems",
            "infeasible",
            "failed",
            "fallbacks",
            "samples refused",
            "iterations: mean, most",
            "stops",
        ]);
        let all = [("all", &self.all)];
        for (name, of) in self.by_cell.iter().map(|of| (of.cell, &of.counts)).chain(all) {
            let counts = [of.contact_cycles, of.solves, of.infeasible, of.solver_failures, of.fallbacks, of.refused];
            let stops: Vec<String> = of.stops.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
            let row = [name.to_owned(), of.contacts.to_string()].into_iter();
            let row = row
                .chain(counts.map(|count| count.to_string()))
                .chain([format!("{:.1}, {}", of.iterations_mean, of.iterations_max)]);
            table.add_row(row.chain([stops.join(", ")]));
        }
        format!("{table}\n{} contacts with a problem that had no usable answer (seed {})", self.found.len(), self.seed)
    }
}
