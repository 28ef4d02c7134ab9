//! `admittance-lab study`: what the controller's verdicts are worth, over many random contacts.

#[cfg(test)]
mod approach;
mod arm;
mod attainable;
mod closed_loop;
mod contact_cycles;
mod controller;
mod draw;
mod ocp;
mod rigid_body;
mod robustness;
mod single_case;
mod speed_figure;
mod statistics;
mod table;
mod task;
mod unknown;

use std::path::PathBuf;

use admittancectl::{Exit, offline, parallel};
use closed_loop::FirstActive;
use controller::{Profile, Variant};
use draw::{AnyArm, ArmName, Arms, Draw};
use ocp::NoAnswer;
use statistics::Case;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  admittance-lab study verdict --runs 200 --seed 1\n  admittance-lab study case --seed 1 --index 17"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Hold the feasibility verdict against what is attainable at all, over random contacts in
    /// virtual time.
    #[command(after_help = "Examples:\n  admittance-lab study verdict --runs 1000 --seed 1\n  \
        admittance-lab study verdict --runs 10000 --seed 1 --json > verdict.json\n  \
        admittance-lab study verdict --arms all --runs 5000 --seed 3\n  \
        admittance-lab study verdict --surface range50 --noise-n 0.5 --sampling-time 0.001 --runs 1000 --seed 1\n  \
        admittance-lab study verdict --surface range50 --arms six,seven --noise-n 0.5 --sampling-time 0.001 --seed 1\n\n\
        First active sample: the first whose wrench estimate exceeds the activation threshold on an axis. Attainable: from \
        its state some input, held for a sampling time each, keeps the force limits for 100 ms. Feasible: no verdict of the \
        run is infeasible. Unsound: a limit exceeded by more than 0.5 N + 0.5 % in a cycle whose verdict was feasible. \
        Timid: infeasible though attainable, at once or later. Withdrawn: feasible first, infeasible later. \
        Outpaced, and withdrawn all the same: an infeasible verdict 60 ms before which no input follows the command within the limits \
        for 100 ms. With --drive-limits the inputs of the judge keep the limits of acceleration and jerk as well. The same seed gives the same \
        answer, whatever the number of threads.\n\n\
        With --surface, of contacts apart from brief ones and those over the limit at the first active sample: safe: every verdict was; \
        at_risk: not stopped, and a verdict was (at_risk_share: the largest share of what may be there that could not be kept, and \
        at_risk_excess_n by how much the worst was over); infeasible: stopped. safe_then_over: over the limit in a cycle whose verdict was safe, \
        stopped later or not; withdrawn_then_over: safe at first, over after a later verdict was not. over_at_risk: accepted, \
        attainable and over all the same. stop_peak_max: of stops, over the limit or the attainable peak. avoidable_losses: contacts \
        lost that some input keeps. known_after_ms: until stiffness (20 %) and depth (50 um) are known. settled_error_n: true force at \
        the end against what is asked; believed_error_n: against what is believed. outside_range: stops as a surface outside its range.")]
    Verdict(VerdictArgs),
    /// Press in worlds that a careful commissioning leaves open: stiffness, tilt, speed loops,
    /// delays, lags, friction, damping and noise as nobody told them.
    #[command(after_help = "Examples:\n  admittance-lab study robustness --runs 1200 --seed 1\n  \
        admittance-lab study robustness --seed 1 --index 17\n\n\
        Over limit: a true force above its limit by more than 0.5 N. Unattainable: full outward speed from the first active \
        sample on would not have kept it either. False stop: a stop although full outward speed keeps the limit. Mistaken: something \
        else, such as the tool's inertia, taken for a contact, or for a surface that pulls, before the tool touched. \
        Silent: over the limit without a stop, a verdict that is Infeasible or AtRisk, or a sample counted as exceeded. \
        Losses count from 50 ms after the first touch.")]
    Robustness(robustness::Args),
    /// Press with six and seven joints for long, in many poses: the solver answers every cycle.
    #[command(after_help = "Examples:\n  admittance-lab study contact-cycles --cycles 10000000 --seed 1\n  \
        admittance-lab study contact-cycles --seed 1 --index 17\n\n\
        Poses, surfaces, stiffness, weights and motions are drawn at random, and what nobody told as in `study robustness`. \
        Fallback: a cycle in contact or in a stop without a usable answer, although its sample is usable and time does not \
        run out. The same seed gives \
        the same answer, whatever the number of threads. Exit code 1: something was FOUND.")]
    ContactCycles(contact_cycles::Args),
    /// Say all about one contact of a verdict study.
    #[command(after_help = "Example:\n  admittance-lab study case --seed 1 --index 42 --save /tmp/case-42")]
    Case(CaseArgs),
}

/// In what a verdict is studied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum World {
    /// Joints follow (4), whatever they press on.
    FirstOrder,
    /// Arms with masses, friction, gears and drives.
    RigidBody,
}

#[derive(Debug, clap::Args)]
struct VerdictArgs {
    /// Number of random contacts.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    runs: u64,
    /// Seed of the random contacts.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Random arms that take turns, in random frames (with --surface in the base frame) and directions, in place of the
    /// planar one with two joints: all, or some of planar-2r planar-3r scara gantry five six six-on-rail seven eight, with commas.
    #[arg(long, conflicts_with = "figure")]
    arms: Option<Arms>,
    /// Drives that refuse jumps: random limits of acceleration and jerk of each joint, told to controller and plant.
    #[arg(long, conflicts_with_all = ["surface", "figure"])]
    drive_limits: bool,
    /// The world: joints that follow (4) and springs, or arms with masses that are told what `identify` finds.
    #[arg(long, value_enum, default_value_t = World::FirstOrder, conflicts_with_all = ["surface", "arms", "drive_limits"])]
    world: World,
    /// Surfaces of which so much is told: all (contact point detected), or a range of stiffness.
    #[arg(long, value_enum)]
    surface: Option<unknown::Told>,
    /// With --surface: standard deviation of the wrench's noise in N, which is told.
    #[arg(long, default_value_t = 0.0, value_parser = unknown::noise, requires = "surface", allow_hyphen_values = true)]
    noise_n: f64,
    /// With --surface: from which share of surfaces that can't be kept on to stop, contact.risk.
    #[arg(long, value_parser = unknown::risk, requires = "surface", allow_hyphen_values = true)]
    risk: Option<f64>,
    /// With --surface: T_s of every contact in s; else one of those of the contacts is drawn.
    #[arg(long, value_name = "S", value_parser = sampling_time, requires = "surface", allow_hyphen_values = true)]
    sampling_time: Option<f64>,
    /// With --surface: mpc.inputs_per_cycle; else as many as last 0.5 ms each.
    #[arg(long, requires = "surface", value_parser = clap::value_parser!(u8).range(1..=8))]
    inputs: Option<u8>,
    #[command(flatten)]
    not_as_told: unknown::NotAsTold,
    /// With --surface or --world rigid-body: one case of it, in full; with --arms a number means the same whichever
    /// arms there are.
    #[arg(long)]
    index: Option<u64>,
    #[command(flatten)]
    options: offline::Options,
}

#[derive(Debug, clap::Args)]
struct CaseArgs {
    /// Seed of the study.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of the contact in the study, from 0.
    #[arg(long)]
    index: u64,
    /// Of a study with --arms; a number means the same whichever arms it had.
    #[arg(long)]
    arms: bool,
    /// Of a study with --drive-limits.
    #[arg(long)]
    drive_limits: bool,
    /// Also write its scenario and its controllers' configurations into this directory.
    #[arg(long, value_name = "DIRECTORY")]
    save: Option<PathBuf>,
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    match &args.what {
        What::Verdict(args) => verdict(args),
        What::Robustness(args) => robustness::run(args),
        What::ContactCycles(args) => contact_cycles::run(args),
        What::Case(args) => one_of_them(args),
    }
}

/// One of those that are drawn.
fn sampling_time(text: &str) -> Result<f64, String> {
    let accepted = draw::SAMPLING_TIMES_S;
    text.parse().ok().filter(|time| accepted.contains(time)).ok_or_else(|| format!("accepted: one of {accepted:?}"))
}

fn one_of_them(args: &CaseArgs) -> Result<Exit, (Exit, String)> {
    let internal = |why| (Exit::Internal, why);
    let drawn = Drawn::new(args.arms, args.drive_limits, args.seed, args.index).map_err(internal)?;
    print!("{}", single_case::describe(&drawn).map_err(internal)?);
    if let Some(directory) = &args.save {
        single_case::save(&drawn, directory).map_err(|why| (Exit::Unavailable, why))?;
    }
    Ok(Exit::Ok)
}

fn verdict(args: &VerdictArgs) -> Result<Exit, (Exit, String)> {
    let (options, threads) = (&args.options, args.options.threads());
    let internal = |why| (Exit::Internal, why);
    if args.world == World::RigidBody {
        if options.wants_figure() {
            return Err((Exit::Usage, "--figure: accepted without --world rigid-body".to_owned()));
        }
        let study = rigid_body::Study::new(args.seed);
        if let Some(index) = args.index {
            print!("{}", study.describe(index).map_err(internal)?);
            return Ok(Exit::Ok);
        }
        let figures = study.figures(args.runs, threads).map_err(internal)?;
        options.print(&figures, || figures.table())?;
        return Ok(Exit::Ok);
    }
    if args.index.is_some() && args.surface.is_none() {
        return Err((
            Exit::Usage,
            "--index: accepted with --surface or --world rigid-body; else `study case`".to_owned(),
        ));
    }
    if let Some(told) = args.surface {
        let VerdictArgs { noise_n, risk, not_as_told, seed, inputs, sampling_time: sampling_time_s, .. } = *args;
        let arms = args.arms.clone();
        let world = unknown::World { arms, told, noise_n, risk, sampling_time_s, inputs, not_as_told, seed };
        if told == unknown::Told::Known
            && let Some(option) = not_as_told.of_a_range()
        {
            return Err((
                Exit::Usage,
                format!("{option} with --surface known: accepted with a range: range3, range10, range50"),
            ));
        }
        if told == unknown::Told::Known && not_as_told.tilt_deg > 0.0 {
            eprintln!(
                "--tilt-deg {} with --surface known: without a range of the stiffness no tolerance of the normal is told, and the \
                 tilt is not learned; range3, range10 and range50 learn it",
                not_as_told.tilt_deg
            );
        }
        if let Some(index) = args.index {
            print!("{}", world.describe(index).map_err(|why| (Exit::Internal, why))?);
            return Ok(Exit::Ok);
        }
        let figures = world.figures(args.runs, threads).map_err(|why| (Exit::Internal, why))?;
        options.print(&figures, || serde_json::to_string_pretty(&figures).unwrap_or_default() + "\n")?;
        return Ok(Exit::Ok);
    }
    options.begin_figure()?;
    let cases = match &args.arms {
        None => cases(args.drive_limits, args.seed, args.runs, threads),
        Some(Arms(arms)) => cases_of(arms, args.drive_limits, args.seed, args.runs, threads),
    };
    let cases = cases.map_err(|why| (Exit::Internal, why))?;
    let mut figures = statistics::figures(args.seed, &cases);
    if options.wants_figure() {
        let speeds = speed_figure::speeds(threads).map_err(|why| (Exit::Internal, why))?;
        let svg = speed_figure::svg(&speeds).map_err(|why| (Exit::Internal, why))?;
        options.write_figure(&svg)?;
        figures.approach_speeds = Some(speeds);
    }
    options.print(&figures, || table::table(&figures))?;
    Ok(Exit::Ok)
}

/// Cases 0 to `runs` − 1, in this order.
///
/// # Errors
/// A case that could not be drawn.
fn cases(driven: bool, seed: u64, runs: u64, threads: usize) -> Result<Vec<Case>, String> {
    parallel::map(runs, threads, "contacts", |index| one_case(Drawn::new(false, driven, seed, index)?))
}

/// The first `runs` cases of these arms.
///
/// # Errors
/// A case that could not be drawn.
fn cases_of(arms: &[ArmName], driven: bool, seed: u64, runs: u64, threads: usize) -> Result<Vec<Case>, String> {
    let drawn = |case| Drawn::new(true, driven, seed, AnyArm::index_of(arms, case));
    parallel::map(runs, threads, "contacts", |case| one_case(drawn(case)?))
}

/// A contact of a study.
pub(crate) struct Drawn {
    /// Which arm it is, with --arms.
    arm: Option<ArmName>,
    draw: Draw,
}

impl Drawn {
    /// The contact with this index, of a study with --arms or without, of arms whose drives are limited or not.
    ///
    /// # Errors
    /// A case that could not be drawn.
    fn new(of_arms: bool, driven: bool, seed: u64, index: u64) -> Result<Self, String> {
        let drawn = if of_arms {
            let AnyArm { name, draw } = AnyArm::new(seed, index)?;
            Self { arm: Some(name), draw }
        } else {
            Self { arm: None, draw: Draw::new(seed, index)? }
        };
        Ok(if driven { Self { draw: drawn.draw.with_drives(seed), ..drawn } } else { drawn })
    }

    /// What controllers are tried with it: with --arms and with drives the one that believes what is true.
    pub(crate) fn variants(&self) -> &'static [Variant] {
        if self.arm.is_some() || self.draw.drives.is_some() { &[Variant::Nominal] } else { &Variant::ALL }
    }
}

/// The lowest peak in N; without an input that does what is commanded there is none.
fn peak_of(answer: Result<f64, NoAnswer>) -> Result<f64, String> {
    match answer {
        Err(NoAnswer::Contradicted) => Ok(f64::INFINITY),
        other => other.map_err(String::from),
    }
}

/// Runs every variant of a case, and asks the judge.
fn one_case(drawn: Drawn) -> Result<Case, String> {
    let run = |variant: &Variant| {
        let scenario = controller::scenario(&drawn.draw)?;
        let config = controller::controller(&drawn.draw, Profile::Default, *variant)?;
        closed_loop::run(&drawn.draw, &config, &scenario)
    };
    let runs: Vec<_> = drawn.variants().iter().map(run).collect();
    let Drawn { arm, draw } = drawn;
    // Up to the first active sample all variants are the same.
    let first = runs[0].as_ref().ok().and_then(|seen| seen.first_active.clone());
    let answer = first.as_ref().map(|first| closed_loop::contact(&draw, first).lowest_peak());
    let optimum_n = answer.as_ref().and_then(|answer| answer.as_ref().ok()).map_or(f64::NAN, |answer| answer.optimum_n);
    let attainable_peak_n = answer.map(|answer| peak_of(answer.map(|answer| answer.peak_n)));
    // What a command asks of the arm later on no controller may be able to do either.
    let earlier = runs[0].as_ref().ok().and_then(|seen| seen.before_infeasible.as_ref());
    let later_peak_n = earlier.map(|earlier| closed_loop::later_contact(&draw, earlier).lowest_peak());
    let later_peak_n = later_peak_n.map(|answer| peak_of(answer.map(|answer| answer.peak_n)));
    // Only where a contact was lost is it worth the time to ask whether it had to be.
    let has_lost = runs.iter().flatten().any(|seen| seen.is_feasible() && seen.contact_losses > 0);
    let in_contact = |first: &FirstActive| closed_loop::contact(&draw, first).lowest_peak_in_contact();
    let peak_in_contact_n =
        first.as_ref().filter(|_| has_lost).map(|first| in_contact(first).map_or(f64::INFINITY, |a| a.optimum_n));
    Ok(Case { arm, draw, attainable_peak_n, later_peak_n, optimum_n, peak_in_contact_n, runs })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_answer_does_not_depend_on_the_number_of_threads() {
        let text = |threads| {
            let figures = statistics::figures(11, &cases(false, 11, 12, threads).unwrap());
            serde_json::to_string(&figures).unwrap()
        };
        assert_eq!(text(1), text(3));
    }

    #[test]
    fn all_variants_become_active_in_the_same_state() {
        for index in 0..8 {
            let case = one_case(Drawn::new(false, false, 2, index).unwrap()).unwrap();
            let first = |run: &Result<closed_loop::Seen, String>| run.as_ref().unwrap().first_active.clone();
            let active = first(&case.runs[0]).unwrap();
            // The judge's arm and surface are the plant's.
            let contact = closed_loop::contact(&case.draw, &active);
            let force = contact.stiffness_n_m * contact.penetration_m(&contact.joint_position);
            assert!((force - active.normal_force_n).abs() < 1e-6 * force, "{force} {}", active.normal_force_n);
            assert!(case.runs.iter().all(|run| first(run) == first(&case.runs[0])), "case {index}");
        }
    }

    #[test]
    fn the_judge_agrees_with_every_joint_outward_at_once() {
        // Not the judge's method, but an upper bound that is easily computed.
        for index in 0..40 {
            let draw = Draw::new(3, index).unwrap();
            let config = controller::controller(&draw, Profile::Default, Variant::Nominal).unwrap();
            let seen = closed_loop::run(&draw, &config, &controller::scenario(&draw).unwrap()).unwrap();
            let contact = closed_loop::contact(&draw, &seen.first_active.unwrap());
            let (judge, outward) = (contact.lowest_peak().unwrap(), contact.peak_of_full_speed_outward_n());
            let ratio = judge.peak_n / outward;
            assert!((0.97..1.001).contains(&ratio), "case {index}: {} of {outward} N", judge.peak_n);
        }
    }
}
