//! `study verdict --world rigid-body`: verdicts in a world with masses. Arms, friction, gears, drives and
//! surfaces are drawn at random; the daemon is told the arm's kinematics, what a maker's sheet says of its masses
//! and gears, and else what `identify` finds in a recording of that arm on that surface.

mod commission;
mod draw;
mod figures;
mod run;

use std::fmt::Write as _;

use admittance_runner::parameters::link_in_impact;
use admittancectl::{parallel, plausible};
use commission::Commissioned;
use draw::{Cause, Cell, Contact, KINDS};
pub(super) use figures::Figures;
use plant_sim::scenario::Scenario;
use run::Seen;
use toml::Table;

use super::statistics::exceeds;

/// Contacts of an arm that was identified once.
const CONTACTS: u64 = 20;
/// The longest step of the plant is halved so often, at most, to resolve an arm.
const HALVINGS: u32 = 4;
/// So long after the touch [`Study::describe`] tells each cycle, s.
const TOLD_S: f64 = 0.03;

/// What became of a contact.
#[derive(Debug, Clone)]
pub(super) struct Run {
    index: u64,
    kind: &'static str,
    limit_n: f64,
    seen: Seen,
    /// Whether full outward speed from the first active sample on keeps the limit.
    is_attainable: bool,
    /// Of an unsound run: the causes without any one of which it is sound.
    causes: Vec<Cause>,
    /// Of a timid run: whether it is timid, too, where surface, lags and delay are told as they are.
    is_timid_by_physics: bool,
}

impl Run {
    fn is_unsound(&self) -> bool {
        exceeds(self.seen.peak_while_feasible_n, self.limit_n)
    }

    fn is_timid(&self) -> bool {
        self.is_attainable && self.seen.infeasible_cycles > 0
    }

    fn is_at_risk(&self) -> bool {
        self.seen.at_risk_cycles > 0 && self.seen.infeasible_cycles == 0
    }

    /// Over the limit before there was a verdict.
    fn is_already_over(&self) -> bool {
        self.seen.first_force_n.is_some_and(|force| force > self.limit_n)
    }
}

/// Why there is no run.
#[derive(Debug, Clone)]
pub(super) struct Failed {
    index: u64,
    why: String,
}

/// The runs of a study, each with its number, and arms that cannot be set up or identified.
pub(super) struct Study {
    seed: u64,
}

impl Study {
    pub(super) fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// Kind and number of the arm of a run.
    fn arm_of(index: u64) -> (usize, u64) {
        let arm = index / CONTACTS;
        ((arm % KINDS.len() as u64) as usize, arm / KINDS.len() as u64)
    }

    /// # Errors
    /// What no draw brings about.
    pub(super) fn figures(&self, runs: u64, threads: usize) -> Result<Figures, String> {
        let arms = runs.div_ceil(CONTACTS);
        let of_arm = |arm: u64| {
            let first = arm * CONTACTS;
            Ok(self.runs_of_arm(first..runs.min(first + CONTACTS)))
        };
        let all = parallel::map(arms, threads, "arms", of_arm)?.into_iter().flatten().collect::<Vec<_>>();
        Ok(Figures::of(self.seed, &all))
    }

    /// # Errors
    /// As [`Self::figures`].
    pub(super) fn describe(&self, index: u64) -> Result<String, String> {
        let (cell, commissioned) = self.cell(index)?;
        let mut text = format!("{}\nnot identified: {:?}\n{}\n", cell.kind, commissioned.unknown, commissioned.told);
        let body = format!("{:#?}\n{:#?}", cell.plant.surface, cell.plant.rigid_body);
        let contact = Contact::draw(self.seed, index);
        let _ = writeln!(text, "{body}\n{contact:#?}\n{:#?}", self.run(index, &cell, &commissioned)?);
        text += &beside(&cell, &commissioned.told, &contact)?;
        text += &cycles(&run::config(&commissioned.told, &contact, &cell)?, &resolved(cell.scenario(&contact)))?;
        Ok(text)
    }

    fn cell(&self, index: u64) -> Result<(Cell, Commissioned), String> {
        let (kind, arm) = Self::arm_of(index);
        let mut cell = Cell::draw(self.seed, kind, arm)?;
        let number = arm * KINDS.len() as u64 + kind as u64;
        let mut halved = 0;
        let commissioned = loop {
            match commission::commission(&cell, self.seed, number) {
                Err(why) if why.contains("substep_s") && halved < HALVINGS => {
                    cell.plant.timing.substep_s *= 0.5;
                    halved += 1;
                }
                other => break other?,
            }
        };
        Ok((cell, commissioned))
    }

    fn runs_of_arm(&self, indices: std::ops::Range<u64>) -> Vec<Result<Run, Failed>> {
        match self.cell(indices.start) {
            Ok((cell, commissioned)) => indices
                .map(|index| self.run(index, &cell, &commissioned).map_err(|why| Failed { index, why }))
                .collect(),
            Err(why) => indices.map(|index| Err(Failed { index, why: why.clone() })).collect(),
        }
    }

    fn run(&self, index: u64, cell: &Cell, commissioned: &Commissioned) -> Result<Run, String> {
        let contact = Contact::draw(self.seed, index);
        let limit_n = run::limit_n(&contact, cell);
        let config = run::config(&commissioned.told, &contact, cell)?;
        let scenario = resolved(cell.scenario(&contact));
        let seen = run::run(&config, &scenario)?;
        let is_attainable = !plausible::outward(&config, &scenario)?.is_over;
        let mut run = Run {
            index,
            kind: cell.kind,
            limit_n,
            seen,
            is_attainable,
            causes: Vec::new(),
            is_timid_by_physics: false,
        };
        if run.is_unsound() {
            for cause in Cause::ALL {
                let mut without = cell.scenario(&contact);
                cause.remove(&mut without, cell.normal);
                let seen = run::run(&config, &resolved(without))?;
                if !exceeds(seen.peak_while_feasible_n, limit_n) {
                    run.causes.push(cause);
                }
            }
        }
        if run.is_timid() {
            let told = cell.as_it_is(&commissioned.told);
            let seen = run::run(&run::config(&told, &contact, cell)?, &scenario)?;
            run.is_timid_by_physics = seen.infeasible_cycles > 0;
        }
        Ok(run)
    }
}

/// What the daemon was told of an impact, beside what is true.
fn beside(cell: &Cell, told: &Table, contact: &Contact) -> Result<String, String> {
    let along = nalgebra::Vector3::from(cell.normal).iamax();
    let of = |told: &Table| -> Result<Vec<(&'static str, Option<f64>)>, String> {
        let config = run::config(told, contact, cell)?;
        let link = link_in_impact(&config, &cell.plant.start.joint_position_rad);
        let surface = config.environment.impact_stiffness_n_m;
        let pressed = link.zip(surface).map(|(link, surface)| link.pressed(surface));
        Ok(vec![
            ("surface in an impact, N/m", surface),
            ("gears along the normal, N/m", link.map(|link| link.gears)),
            ("both in series, N/m", pressed),
            ("effective mass, kg", link.map(|link| link.mass)),
            ("lag of the wrench along the normal, s", Some(config.contact.wrench_time_constant_s[along])),
            ("dead time of the wrench, s", Some(config.contact.wrench_dead_time_s)),
            ("command delay, s", Some(config.control.command_delay_s)),
        ])
    };
    let pressed = run::config(told, contact, cell)?.environment.normal_stiffness_n_m;
    let mut text = format!("told and true; a slow press showed {pressed:.3e} N/m\n");
    for ((what, told), (_, truth)) in of(told)?.into_iter().zip(of(&cell.as_it_is(told))?) {
        let shown = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3e}"));
        let _ = writeln!(text, "{what}: {} {}", shown(told), shown(truth));
    }
    Ok(text)
}

/// The first cycles of a contact, a line each.
fn cycles(config: &admittance_runner::config::Config, scenario: &Scenario) -> Result<String, String> {
    let mut text =
        "ms: true normal force, its peak since the cycle before, f\u{302}, mode, verdict with its newtons\n".to_owned();
    let mut touched_s = None;
    run::run_seen(config, scenario, |step| {
        let (truth, command) = (&step.truth, &step.command);
        if truth.peak_normal_force_n > 0.0 {
            touched_s.get_or_insert(truth.scenario_time_s);
        }
        let Some(since) = touched_s.map(|touched| truth.scenario_time_s - touched).filter(|since| *since < TOLD_S)
        else {
            return;
        };
        let estimate: String = step.report.wrench[..3].iter().map(|force| format!("{force:8.1}")).collect();
        let _ = writeln!(
            text,
            "{:6.1}: {:7.1} {:7.1} |{estimate} | {:?} {:?} {:.1} in {:.4} s",
            1e3 * since,
            truth.normal_force_n,
            truth.peak_normal_force_n,
            ipc_types::Mode::from_code(command.mode),
            ipc_types::Verdict::from_code(command.verdict),
            command.verdict_margin,
            command.verdict_time_s,
        );
    })?;
    Ok(text)
}

/// With steps that resolve it.
fn resolved(mut scenario: Scenario) -> Scenario {
    for _ in 0..HALVINGS {
        match plant_sim::run::VirtualRun::new(&scenario) {
            Err(why) if why.to_string().contains("substep_s") => scenario.timing.substep_s *= 0.5,
            _ => break,
        }
    }
    scenario
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Its motors move out some milliseconds before its link does, which is over the limit by then.
    #[test]
    fn no_verdict_is_feasible_because_the_motors_move_out_already() {
        let study = Study::new(1);
        let (cell, commissioned) = study.cell(87).unwrap();
        for index in [87, 94] {
            let run = study.run(index, &cell, &commissioned).unwrap();
            assert!(exceeds(run.seen.peak_n, run.limit_n), "nothing is left to show: {run:?}");
            assert!(!run.is_unsound(), "{run:?}");
        }
    }

    /// What was identified of an impact ended below the true stiffness, which then was no configuration.
    #[test]
    fn an_arm_as_it_is_can_be_told_whatever_was_identified() {
        let study = Study::new(19_580);
        let (cell, commissioned) = study.cell(15).unwrap();
        study.run(15, &cell, &commissioned).unwrap();
    }

    #[test]
    fn an_arm_is_identified_and_pressed_with_and_again_the_same() {
        let study = Study::new(7);
        let text = || serde_json::to_string(&study.figures(2, 1).unwrap()).unwrap();
        let once = text();
        assert!(once.contains("\"counted\":2") && once.contains("excess_over_limit"), "{once}");
        assert_eq!(once, text());
    }
}
