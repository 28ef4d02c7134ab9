//! One contact of a daemon with an arm of masses.

use admittance_host::config::parse;
use admittance_runner::config::Config;
use admittance_runner::cycle;
use admittance_runner::virtual_time::{Step, VirtualTime};
use ipc_types::{StopReason, Verdict};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;
use serde::Serialize;
use toml::{Table, Value};

use super::draw::{Cell, Contact};
use crate::keys::set;

/// What a run showed. Forces are true normal forces in N.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(super) struct Seen {
    /// Force at the first sample with a verdict; `None` without any.
    pub(super) first_force_n: Option<f64>,
    pub(super) peak_n: f64,
    /// In cycles whose verdict was feasible, each from its sample to the next.
    pub(super) peak_while_feasible_n: f64,
    pub(super) infeasible_cycles: u32,
    pub(super) first_is_feasible: bool,
    pub(super) at_risk_cycles: u32,
    /// Code of the reason.
    pub(super) stop_reason: u32,
    pub(super) resting_n: f64,
    pub(super) losses: u32,
}

impl Seen {
    pub(super) fn stopped(&self) -> bool {
        self.stop_reason != StopReason::NONE
    }
}

/// The configuration of a contact.
///
/// # Errors
/// What its checks say.
pub(super) fn config(told: &Table, contact: &Contact, cell: &Cell) -> Result<Config, String> {
    let mut told = told.clone();
    let axes = cell.plant.robot.task_axes as usize;
    let limit = |axis: usize| if axis < 3 { contact.limit_n } else { 50.0 };
    let limits = Value::Array((0..axes).map(|axis| limit(axis).into()).collect());
    set(&mut told, "contact", "force_limit", limits);
    // What a person may set is another matter.
    told.remove("requests");
    if let Some(wrench) = told.get_mut("wrench").and_then(Value::as_table_mut) {
        wrench.remove("saturation");
    }
    parse(&told.to_string(), "told").map_err(|error| error.to_string())
}

/// The normal force in N at which the first axis is at its limit.
pub(super) fn limit_n(contact: &Contact, cell: &Cell) -> f64 {
    contact.limit_n / cell.normal.iter().map(|part| part.abs()).fold(0.0, f64::max)
}

/// Runs it.
///
/// # Errors
/// What controller or plant do not accept.
pub(super) fn run(config: &Config, scenario: &Scenario) -> Result<Seen, String> {
    run_seen(config, scenario, |_| {})
}

/// Runs it; every step is shown to `see`.
///
/// # Errors
/// As [`run`].
pub(super) fn run_seen(config: &Config, scenario: &Scenario, mut see: impl FnMut(&Step)) -> Result<Seen, String> {
    let plant = VirtualRun::new(scenario).map_err(|error| error.to_string())?;
    let mut run = VirtualTime::new(cycle::build(config)?, plant);
    let (mut seen, mut last) = (Seen::default(), Verdict::None.code());
    while let Some(step) = run.step()? {
        see(&step);
        let Step { command, truth, .. } = step;
        seen.peak_n = seen.peak_n.max(truth.peak_normal_force_n);
        if last == Verdict::Feasible.code() {
            seen.peak_while_feasible_n = seen.peak_while_feasible_n.max(truth.peak_normal_force_n);
        }
        last = command.verdict;
        if last != Verdict::None.code() && seen.first_force_n.is_none() {
            seen.first_force_n = Some(truth.normal_force_n);
            seen.first_is_feasible = last == Verdict::Feasible.code();
        }
        seen.infeasible_cycles += u32::from(last == Verdict::Infeasible.code());
        seen.at_risk_cycles += u32::from(last == Verdict::AtRisk.code());
        (seen.stop_reason, seen.resting_n, seen.losses) =
            (command.stop_reason, truth.normal_force_n, truth.contact_losses);
    }
    Ok(seen)
}
