//! `admittance-lab study robustness`: what remains of the law's promises in the worlds that a
//! careful commissioning leaves open.

mod cells;
mod figures;
mod outward;

use std::fmt::{self, Write as _};

use admittance_runner::config::Config;
use admittancectl::plausible::{self, Cause, Cell, Contact, Peak};
use admittancectl::{Exit, offline, parallel};
use figures::Figures;
use plant_sim::scenario::Scenario;
use serde::Serialize;

/// How long after the touch the cycles of a run are told, s.
const TOLD_S: f64 = 0.1;
/// What is told of the stiffness: twice as much is plausible, and a little more.
const STIFFNESS_WITHIN: f64 = 2.5;
/// What is told of an arm that follows late, s.
const LAG_TOLERANCE_S: f64 = 0.005;
/// contact.wrench_lag_tolerance that a controller is told.
const WRENCH_LAG_TOLERANCE: f64 = 0.25;
/// What is told of speed loops whose order is not known: that they are of second order with this damping ratio.
const LOOP_DAMPING: f64 = 0.8;
/// Parts of the highest safe speed with the model as told.
const SPEEDS: [f64; 3] = [1.0, 0.5, 0.25];

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Number of random worlds.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    runs: u64,
    /// Seed of the random worlds.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    told: Told,
    /// Only this run, and all about it.
    #[arg(long)]
    index: Option<u64>,
    #[command(flatten)]
    options: offline::Options,
}

/// Which cells, and what their controllers are told: unless asked otherwise, what docs/commissioning.md says to
/// tell where a number is known no better than these worlds leave it.
#[derive(Debug, Clone, PartialEq, clap::Args)]
struct Told {
    /// Only this cell; all of them when absent.
    #[arg(long, value_parser = cells::NAMES)]
    cell: Option<String>,
    /// Tell the controller the stiffness as one number, no tolerances, and loops of first order.
    #[arg(long, conflicts_with_all = ["stiffness_within", "lag_tolerance", "wrench_lag_tolerance", "loop_damping"])]
    exact: bool,
    /// Tell the controller only that the stiffness is within this factor of what it would be told.
    #[arg(long, value_name = "FACTOR", default_value_t = STIFFNESS_WITHIN, allow_negative_numbers = true, value_parser = within)]
    stiffness_within: f64,
    /// Tell the controller that the arm may follow so many seconds later than it was told.
    #[arg(long, value_name = "SECONDS", default_value_t = LAG_TOLERANCE_S, allow_negative_numbers = true, value_parser = lag_tolerance)]
    lag_tolerance: f64,
    /// Tell the controller that the wrench may lag longer than it was told by this share.
    #[arg(long, value_name = "SHARE", default_value_t = WRENCH_LAG_TOLERANCE, allow_negative_numbers = true, value_parser = share)]
    wrench_lag_tolerance: f64,
    /// Tell the controller that the speed loops are of second order, with this damping ratio.
    #[arg(long, value_name = "RATIO", default_value_t = LOOP_DAMPING, allow_negative_numbers = true, value_parser = damping)]
    loop_damping: f64,
    /// Multiply the shipped weight of the wrench.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, allow_negative_numbers = true, value_parser = weight)]
    wrench_weight: f64,
    /// Multiply the shipped weight of the input.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, allow_negative_numbers = true, value_parser = weight)]
    input_weight: f64,
}

impl Default for Told {
    fn default() -> Self {
        Self {
            cell: None,
            exact: false,
            stiffness_within: STIFFNESS_WITHIN,
            lag_tolerance: LAG_TOLERANCE_S,
            wrench_lag_tolerance: WRENCH_LAG_TOLERANCE,
            loop_damping: LOOP_DAMPING,
            wrench_weight: 1.0,
            input_weight: 1.0,
        }
    }
}

impl Told {
    /// The names of the cells, which take turns.
    fn names(&self) -> Vec<&'static str> {
        cells::NAMES.into_iter().filter(|name| self.cell.as_deref().is_none_or(|only| only == *name)).collect()
    }

    /// The cells with these names.
    ///
    /// # Errors
    /// As [`cells::with_speeds`].
    fn cells(&self, names: &[&str], threads: usize) -> Result<Vec<(&'static str, Cell)>, String> {
        let cells = cells::with_speeds(names, threads)?.into_iter();
        Ok(cells.map(|(name, cell)| (name, self.tell(cell))).collect())
    }

    /// The cell with what is told.
    fn tell(&self, cell: Cell) -> Cell {
        let cell = cell.weighing(self.wrench_weight, self.input_weight);
        if self.exact {
            return cell;
        }
        cell.knowing_a_range(self.stiffness_within)
            .allowing_lag(self.lag_tolerance)
            .allowing_wrench_lag(self.wrench_lag_tolerance)
            .following_with_damping(self.loop_damping)
    }
}

/// The options that say it again.
impl fmt::Display for Told {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let usual = Self::default();
        if let Some(cell) = &self.cell {
            write!(f, " --cell \"{cell}\"")?;
        }
        if self.exact {
            write!(f, " --exact")?;
        }
        for (name, told, usual) in [
            ("stiffness-within", self.stiffness_within, usual.stiffness_within),
            ("lag-tolerance", self.lag_tolerance, usual.lag_tolerance),
            ("wrench-lag-tolerance", self.wrench_lag_tolerance, usual.wrench_lag_tolerance),
            ("loop-damping", self.loop_damping, usual.loop_damping),
            ("wrench-weight", self.wrench_weight, usual.wrench_weight),
            ("input-weight", self.input_weight, usual.input_weight),
        ] {
            if told != usual {
                write!(f, " --{name} {told}")?;
            }
        }
        Ok(())
    }
}

fn within(text: &str) -> Result<f64, String> {
    let factor = text.parse().ok().filter(|factor| (1.0..=10.0).contains(factor));
    factor.ok_or_else(|| "accepted: 1 to 10".to_owned())
}

fn lag_tolerance(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (0.0..=0.02).contains(seconds));
    seconds.ok_or_else(|| "accepted: 0 to 0.02 s, as control.lag_tolerance_s".to_owned())
}

fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "accepted: 0 to 1, as contact.wrench_lag_tolerance".to_owned())
}

fn damping(text: &str) -> Result<f64, String> {
    let ratio = text.parse().ok().filter(|ratio| (0.0..=5.0).contains(ratio));
    ratio.ok_or_else(|| "accepted: 0 to 5, as robot.velocity_loop.damping".to_owned())
}

fn weight(text: &str) -> Result<f64, String> {
    let factor = text.parse().ok().filter(|factor| (1e-3..=1e3).contains(factor));
    factor.ok_or_else(|| "accepted: 0.001 to 1000".to_owned())
}

/// A contact in a random world.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    /// Number of the run.
    index: u64,
    /// Its cell.
    cell: &'static str,
    /// Part of the highest safe speed.
    speed: f64,
    /// What it showed.
    contact: Contact,
    /// What full outward speed attains in it.
    outward: Peak,
    /// Of a bad contact, for each cause: what is bad with it alone, and what without it.
    causes: Vec<(Cause, Faults, Faults)>,
}

/// What of a contact the controller could have avoided.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Faults {
    /// Above the limit although full outward speed keeps it.
    over: bool,
    /// Contact lost later than 50 ms after the first touch, before any stop.
    lost: bool,
    /// A stop although full outward speed keeps the limit.
    stopped: bool,
}

impl Faults {
    fn any(self) -> bool {
        self.over || self.lost || self.stopped
    }
}

impl Run {
    /// A stop although full outward speed keeps the limit.
    fn is_false_stop(&self) -> bool {
        self.contact.stop_reason.is_some() && !self.outward.is_over
    }

    /// Above the limit although full outward speed keeps it.
    fn is_avoidably_over(&self) -> bool {
        self.contact.is_over && !self.outward.is_over
    }

    /// What is wrong that the controller could have avoided.
    fn faults(&self) -> Faults {
        Faults { over: self.is_avoidably_over(), lost: self.contact.late_losses > 0, stopped: self.is_false_stop() }
    }

    /// Whether anything is.
    fn is_bad(&self) -> bool {
        self.faults().any()
    }

    /// Of a contact above the limit: its peak over that of full outward speed, or over the limit where
    /// that one keeps it.
    fn excess(&self) -> f64 {
        self.contact.peak_ratio / self.outward.ratio.max(1.0)
    }
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    let (options, threads) = (&args.options, args.options.threads());
    if options.wants_figure() {
        return Err((Exit::Usage, "--figure: accepted by `study verdict` alone".to_owned()));
    }
    let internal = |why| (Exit::Internal, why);
    let names = args.told.names();
    if let Some(index) = args.index {
        let (turn, speed) = place(names.len(), index);
        let cells = args.told.cells(&names[turn..=turn], threads).map_err(internal)?;
        print!("{}", describe(&cells[0], speed, args.seed, index).map_err(internal)?);
        return Ok(Exit::Ok);
    }
    let cells = args.told.cells(&names, threads).map_err(internal)?;
    let of_run = |index| {
        let (turn, speed) = place(cells.len(), index);
        one(&cells[turn], speed, args.seed, index)
    };
    let runs = parallel::map(args.runs, threads, "contacts", of_run).map_err(internal)?;
    let figures = Figures::of(args.seed, &args.told, &cells, &runs);
    options.print(&figures, || figures.table())?;
    Ok(Exit::Ok)
}

/// Which of `count` cells a run is of, and the part of its speed: cells take turns, and so do speeds.
fn place(count: usize, index: u64) -> (usize, f64) {
    let count = count as u64;
    ((index % count) as usize, SPEEDS[(index / count) as usize % SPEEDS.len()])
}

fn one((name, cell): &(&'static str, Cell), speed: f64, seed: u64, index: u64) -> Result<Run, String> {
    let world = plausible::world(seed, index, cell.config().robot.joint.len());
    let press = |is_on: &dyn Fn(Cause) -> bool| {
        let scenario = cell.scenario(&world, speed * cell.highest_speed_m_s, is_on);
        let both = plausible::press(cell.config(), &scenario)
            .and_then(|contact| Ok((contact, attainable(cell.config(), &scenario)?)));
        let (contact, outward) = both.map_err(|why| format!("run {index} of seed {seed}, {name}: {why}"))?;
        Ok::<Run, String>(Run { index, cell: name, speed, contact, outward, causes: Vec::new() })
    };
    let mut run = press(&|_| true)?;
    if run.is_bad() {
        for cause in Cause::ALL {
            let (alone, without) = (press(&|other| other == cause)?, press(&|other| other != cause)?);
            run.causes.push((cause, alone.faults(), without.faults()));
        }
    }
    Ok(run)
}

/// What full outward speed attains, on the axes that the controller may move.
fn attainable(config: &Config, scenario: &Scenario) -> Result<Peak, String> {
    plausible::outward_by(config, scenario, |pose, normal, speeds, reference| {
        outward::fastest_twist(config, pose, normal, speeds, reference)
    })
}

fn describe(named: &(&'static str, Cell), speed: f64, seed: u64, index: u64) -> Result<String, String> {
    let (name, cell) = named;
    let world = plausible::world(seed, index, cell.config().robot.joint.len());
    let run = one(named, speed, seed, index)?;
    let named = speed * cell.highest_speed_m_s;
    let Run { contact, outward, causes, .. } = run;
    let mut text =
        format!("{name}, {speed} of its speed: {named:.3} m/s\n{world:#?}\n{contact:#?}\noutward: {outward:?}\n");
    for (cause, alone, without) in causes {
        let (alone, cured) = (alone.any(), !without.any());
        let _ = writeln!(text, "{cause:?}: bad with it alone: {alone}, good without it: {cured}");
    }
    text += &cycles(cell, &world, named)?;
    Ok(text)
}

/// The first cycles of a contact, or of what the controller takes for one, a line each.
fn cycles(cell: &Cell, world: &plausible::World, speed_m_s: f64) -> Result<String, String> {
    let scenario = cell.scenario(world, speed_m_s, |_| true);
    let mut text =
        "ms: largest true force since the cycle before, f\u{302}, twist offset, mode, verdict with its newtons\n"
            .to_owned();
    let mut touched_s = None;
    plausible::press_seen(cell.config(), &scenario, |step| {
        let (truth, command) = (&step.truth, &step.command);
        let mode = ipc_types::Mode::from_code(command.mode);
        let acts_on_contact = !matches!(mode, Some(ipc_types::Mode::Idle | ipc_types::Mode::Free));
        if acts_on_contact || truth.peak_wrench.iter().any(|force| *force != 0.0) {
            touched_s.get_or_insert(truth.scenario_time_s);
        }
        let Some(since) = touched_s.map(|touched| truth.scenario_time_s - touched).filter(|since| *since < TOLD_S)
        else {
            return;
        };
        let of = |values: &[f64; 6], digits: usize| {
            values[..3].iter().map(|value| format!("{value:9.digits$}")).collect::<String>()
        };
        let _ = writeln!(
            text,
            "{:6.1}: {} |{} |{} | {mode:?} {:?} {:.1}",
            1e3 * since,
            of(&truth.peak_wrench, 1),
            of(&step.report.wrench, 1),
            of(&command.velocity_offset, 4),
            ipc_types::Verdict::from_code(command.verdict),
            command.verdict_margin,
        );
    })?;
    Ok(text)
}

#[cfg(test)]
mod tests;
