//! `admittance-lab study contact-cycles`: whether the solver answers every cycle of long contacts
//! of six and seven joints, in many poses and on many surfaces.

mod draw;
mod figures;
mod watched;

use std::fmt::Write as _;

use admittance_runner::cycle;
use admittance_runner::virtual_time::{Step, VirtualTime};
use admittancectl::{Exit, offline, parallel};
use draw::Draw;
use figures::Figures;
use ipc_types::{Mode, Source, StopReason};
use plant_sim::run::VirtualRun;
use watched::{Outcomes, Watched};

/// Contacts whose figures are added up at a time; of the last ones some may be too many.
const BATCH: u64 = 16;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Contact cycles to see, at least.
    #[arg(long, default_value_t = 100_000, value_parser = clap::value_parser!(u64).range(1..=10_000_000_000))]
    cycles: u64,
    /// Seed of the random contacts.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only this contact, and all about it.
    #[arg(long)]
    index: Option<u64>,
    #[command(flatten)]
    options: offline::Options,
}

/// What one contact showed.
#[derive(Debug, Clone)]
pub(crate) struct Seen {
    /// Number of the contact.
    index: u64,
    /// Its cell.
    cell: &'static str,
    /// Cycles in contact.
    contact_cycles: u64,
    /// What the solver answered.
    outcomes: Outcomes,
    /// Cycles in contact or in a stop whose problem had no usable answer.
    unanswered: u64,
    /// Stamp in s of the first one.
    first_s: Option<f64>,
    /// Cycles in contact or in a stop whose sample could not be used: there was no problem to answer.
    refused: u64,
    /// Why the first one could not.
    refusal: Option<String>,
    /// Why the controller stopped.
    stop_reason: Option<StopReason>,
}

impl Seen {
    /// The solver gave no answer, or one that did not pass the check, or the sample of an arm that only presses was refused:
    /// none may happen.
    fn is_finding(&self) -> bool {
        self.unanswered > 0 || self.refused > 0 || self.outcomes.failed > 0
    }
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    let options = &args.options;
    if options.wants_figure() {
        return Err((Exit::Usage, "--figure: accepted by `study verdict` alone".to_owned()));
    }
    let internal = |why| (Exit::Internal, why);
    if let Some(index) = args.index {
        print!("{}", describe(args.seed, index).map_err(internal)?);
        return Ok(Exit::Ok);
    }
    let seen = contacts(args.seed, args.cycles, options.threads()).map_err(internal)?;
    let figures = Figures::of(args.seed, &seen);
    for index in &figures.found {
        eprintln!("FOUND: admittance-lab study contact-cycles --seed {} --index {index}", args.seed);
    }
    options.print(&figures, || figures.table())?;
    Ok(if figures.found.is_empty() { Exit::Ok } else { Exit::ClaimNotMet })
}

/// Contacts 0, 1, … until so many contact cycles are seen: the same ones whatever the number of
/// threads.
fn contacts(seed: u64, cycles: u64, threads: usize) -> Result<Vec<Seen>, String> {
    let (mut all, mut left, mut first): (Vec<Seen>, _, _) = (Vec::new(), cycles, 0);
    while left > 0 {
        for seen in parallel::map(BATCH, threads, "contacts", |turn| press(seed, first + turn))? {
            if left == 0 {
                break;
            }
            left = left.saturating_sub(seen.contact_cycles);
            all.push(seen);
        }
        first += BATCH;
    }
    Ok(all)
}

/// Runs a contact to its end or to the hold of a stop.
fn press(seed: u64, index: u64) -> Result<Seen, String> {
    let draw = Draw::new(seed, index)?;
    let what = |why: String| format!("contact {index} of seed {seed}, {}: {why}", draw.cell);
    let plant = VirtualRun::new(&draw.scenario).map_err(|why| what(why.to_string()))?;
    let (watch, outcomes) = watched::pair();
    let cycle =
        cycle::build_watched(&draw.config, &|solver| Box::new(Watched::new(solver, watch.clone()))).map_err(what)?;
    let mut run = VirtualTime::new(cycle, plant);
    let mut seen = Seen {
        index,
        cell: draw.cell,
        contact_cycles: 0,
        outcomes: Outcomes::default(),
        unanswered: 0,
        first_s: None,
        refused: 0,
        refusal: None,
        stop_reason: None,
    };
    while let Some(Step { command, report, truth, .. }) = run.step().map_err(what)? {
        let is_in = |mode: Mode| command.mode == mode.code();
        seen.contact_cycles += u64::from(is_in(Mode::Contact));
        let is_fallback = [Source::Plan, Source::Retreat].iter().any(|source| command.source == source.code());
        let is_asked = is_in(Mode::Contact) || is_in(Mode::Stopping);
        match report.fault {
            Some(fault) if is_asked => {
                seen.refused += 1;
                seen.refusal.get_or_insert_with(|| format!("{fault:?} at {} s", truth.scenario_time_s));
            }
            None if is_asked && is_fallback => {
                seen.unanswered += 1;
                seen.first_s.get_or_insert(truth.scenario_time_s);
            }
            Some(_) | None => {}
        }
        seen.stop_reason = seen.stop_reason.or_else(|| StopReason::from_code(command.stop_reason));
        if is_in(Mode::Stopped) {
            break;
        }
    }
    seen.outcomes = outcomes.get();
    Ok(seen)
}

fn describe(seed: u64, index: u64) -> Result<String, String> {
    let (draw, seen) = (Draw::new(seed, index)?, press(seed, index)?);
    let (contact, environment) = (&draw.config.contact, &draw.config.environment);
    let mut text = format!("{}, untold: {:?}\n", draw.cell, draw.untold);
    let _ = writeln!(text, "admittance axes: {:?}", contact.admittance_axes);
    let _ = writeln!(text, "{environment:#?}");
    let _ = writeln!(text, "wrench weight: {:?}", draw.config.mpc.wrench_weight);
    let _ = writeln!(text, "{:#?}\n{:#?}\n{seen:#?}", draw.scenario.start, draw.scenario.motion);
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_answer_does_not_depend_on_the_number_of_threads() {
        let text = |threads| serde_json::to_string(&Figures::of(7, &contacts(7, 20_000, threads).unwrap())).unwrap();
        let one = text(1);
        assert_eq!(one, text(3));
        assert!(one.contains("\"found\":[]"), "{one}");
    }

    /// ṗ0 turns the tool faster than the joints may turn, and what the offset could do about it
    /// presses; or it asks for 140 rad/s near a singular pose.
    #[test]
    fn contacts_that_were_found_have_an_answer_in_every_cycle() {
        for (seed, index) in [(20_261_122, 960), (20_261_122, 1870), (20_261_122, 1956), (15_193, 14)] {
            let seen = press(seed, index).unwrap();
            assert!(!seen.is_finding() && seen.contact_cycles > 100, "{seen:?}");
        }
    }

    #[test]
    fn a_contact_that_cannot_be_solved_is_a_finding() {
        let seen = (0..8).map(|index| press(3, index).unwrap()).find(|seen| seen.contact_cycles > 1000).unwrap();
        assert!(!seen.is_finding() && seen.outcomes.solves >= seen.contact_cycles, "{seen:?}");
        for broken in [
            Seen { unanswered: 1, ..seen.clone() },
            Seen { refused: 1, ..seen.clone() },
            Seen { outcomes: Outcomes { failed: 1, ..seen.outcomes }, ..seen.clone() },
        ] {
            assert_eq!(Figures::of(3, &[seen.clone(), broken]).found, [seen.index]);
        }
    }
}
