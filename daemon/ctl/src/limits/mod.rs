//! `admittancectl limits`: how fast a configured robot may approach, over stiffness and cycle time.
//! By simulation of the daemon's own cycle, not by a formula.

mod approach;
mod cell;
mod figure;
mod ignorance;
mod search;
mod table;

use std::path::{Path, PathBuf};

use admittance_runner::config::Config;
use admittance_runner::task_frame::TaskFrame;
use plant_sim::scenario::Scenario;

use crate::parallel::{Part, Progress};
use crate::{Exit, offline, parallel, plausible, validate};
pub(crate) use approach::Approach;
pub(crate) use cell::{FORCE_TOLERANCE_N, config_for, limited_axes, limited_forces, weight};
pub(crate) use search::{Cases, Found, highest_safe};
use table::{Limits, Recommended};

/// Factors of the configured stiffness, and cycle times in s, that are looked at unless others are
/// given: those that soon have an answer, and all.
const STIFFNESS_FACTORS: [f64; 3] = [0.3, 1.0, 3.0];
const SAMPLING_TIMES_S: [f64; 3] = [0.004, 0.002, 0.001];
const ALL_STIFFNESS_FACTORS: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 10.0];
const ALL_SAMPLING_TIMES_S: [f64; 5] = [0.004, 0.002, 0.001, 0.0005, 0.00025];
/// A world takes so much longer than the cell as told: its loops, its noise and its friction.
const WORLD_WEIGHT: f64 = 1.5;
/// A part of the normal that is rounding of a frame's turn.
const NO_NORMAL: f64 = 1e-12;
/// What the configuration's keys accept.
const ACCEPTED_STIFFNESS_N_M: (f64, f64) = (100.0, 1e8);
const ACCEPTED_SAMPLING_TIME_S: (f64, f64) = (0.0001, 0.1);

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  admittancectl limits deploy/demo/mpc-default.toml --all --figure limits.svg\n  \
    admittancectl limits deploy/demo/mpc-default.toml --ignorance\n  \
    admittancectl limits deploy/robots/six-joint.toml --joints 0.3,1.2,-1.8,2.2,1.57,0.3 --sampling-time-s 0.004,0.001\n\n\
    Safe: at every instant of contact within a cycle that was tried, the true force stays within the force limit + 0.5 N on \
    every admittance axis, the contact is not lost (with control.lag_tolerance_s but for a bounce at the impact), and the \
    controller neither stops nor refuses a sample. The simulated robot is exactly what the configuration says. The \
    recommended speed is that of random worlds as a careful commissioning leaves them open: stiffness x 0.5 to 2, normal \
    +- 1 degree, speed loops +- 25 % and half of them of second order, lags, delays, friction, damping, noise. More of them \
    (--worlds), and others (--seed), make it more certain, and lower.")]
pub(crate) struct Args {
    /// Configuration of the daemon.
    #[arg(value_name = "CONFIG")]
    config: PathBuf,
    /// Joint position at contact, base first, in rad, in m of joints that slide; required for all arms but those of
    /// two task axes. It is moved to environment.contact_point_m in the same orientation.
    #[arg(long, value_name = "Q1,Q2,...", value_delimiter = ',', allow_hyphen_values = true)]
    joints: Option<Vec<f64>>,
    /// Direction of the approach in the base frame, of any length; along the inward surface normal
    /// when absent.
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', allow_hyphen_values = true)]
    direction: Option<Vec<f64>>,
    /// Stiffnesses in N/m, believed and true, 8 at most; 0.3, 1 and 3 times the configured one when
    /// absent.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    stiffness_n_m: Option<Vec<f64>>,
    /// Cycle times in s; 4, 2 and 1 ms and the configured one when absent.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    sampling_time_s: Option<Vec<f64>>,
    /// Also 0.1 and 10 times the stiffness, 0.5 and 0.25 ms: takes several times as long.
    #[arg(long)]
    all: bool,
    /// Also what it costs not to know the stiffness: at the configured cycle time, for ranges of 3, 10
    /// and 50 times about the configured one, without noise and with environment.wrench_noise_n
    /// (0.5 N when that is 0). Takes several times as long.
    #[arg(long)]
    ignorance: bool,
    /// Instants of contact within a cycle, evenly spread, that a safe speed has to be safe at.
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1000))]
    instants: u32,
    /// Random worlds in which the recommended speed has to be safe.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    worlds: u64,
    /// Seed of the random worlds.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    options: offline::Options,
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    let config = validate::load(&args.config)?;
    let question = Question::new(args, &config)?;
    let options = &args.options;
    if options.wants_figure() && question.sampling_times_s.len() < 2 {
        return Err((Exit::Usage, "--figure: accepted with two cycle times at least".to_owned()));
    }
    options.begin_figure()?;
    let internal = |why| (Exit::Internal, why);
    let mut limits = limits(&args.config, &config, &question, options.threads()).map_err(internal)?;
    if args.ignorance {
        limits.ignorance = ignorance::prices(&config, &question, options.threads()).map_err(internal)?;
    }
    if options.wants_figure() {
        options.write_figure(&figure::svg(&limits).map_err(|why| (Exit::Internal, why))?)?;
    }
    options.print(&limits, || table::text(&limits))?;
    Ok(Exit::Ok)
}

/// What is asked, checked.
#[derive(Debug)]
struct Question {
    approach: Approach,
    /// Ascending.
    stiffnesses_n_m: Vec<f64>,
    /// Descending.
    sampling_times_s: Vec<f64>,
    instants: u32,
    worlds: Worlds,
}

/// The random worlds in which the recommended speed is safe.
#[derive(Debug, Clone, Copy)]
struct Worlds {
    count: u64,
    seed: u64,
}

impl Question {
    fn new(args: &Args, config: &Config) -> Result<Self, (Exit, String)> {
        let own = config.control.sampling_time_s;
        let mut sampling_times_s = match &args.sampling_time_s {
            Some(list) => accepted("--sampling-time-s", list, ACCEPTED_SAMPLING_TIME_S, "s", 32)?,
            None => {
                let usual = if args.all { &ALL_SAMPLING_TIMES_S[..] } else { &SAMPLING_TIMES_S };
                usual.iter().copied().chain([own]).collect()
            }
        };
        // Time passes in whole nanoseconds.
        sampling_times_s.iter_mut().filter(|time| **time != own).for_each(|time| *time = (*time * 1e9).round() / 1e9);
        sampling_times_s.sort_by(|a, b| b.total_cmp(a));
        sampling_times_s.dedup();
        let mut stiffnesses_n_m = match &args.stiffness_n_m {
            // At most as many as the figure has colours.
            Some(list) => accepted("--stiffness-n-m", list, ACCEPTED_STIFFNESS_N_M, "N/m", figure::LOOKS.len())?,
            None => (if args.all { &ALL_STIFFNESS_FACTORS[..] } else { &STIFFNESS_FACTORS })
                .iter()
                .map(|factor| search::round_to_digits(factor * config.environment.normal_stiffness_n_m, 6))
                .filter(|stiffness| (ACCEPTED_STIFFNESS_N_M.0..=ACCEPTED_STIFFNESS_N_M.1).contains(stiffness))
                .collect(),
        };
        stiffnesses_n_m.sort_by(f64::total_cmp);
        stiffnesses_n_m.dedup();
        let approach = Approach::new(config, args.joints.as_deref(), args.direction.as_deref())?;
        let normal = TaskFrame::with_tool(config, &approach.pose.tcp_axes).vector(approach.normal.into());
        if !cell::limited_axes(config).any(|(axis, _)| normal[axis].abs() > NO_NORMAL) {
            let why = "contact.admittance_axes has no axis along which the surface pushes back: no approach is safe";
            return Err((Exit::Config, why.to_owned()));
        }
        let worlds = Worlds { count: args.worlds, seed: args.seed };
        Ok(Self { approach, stiffnesses_n_m, sampling_times_s, instants: args.instants, worlds })
    }
}

fn accepted(
    option: &str,
    list: &[f64],
    (least, most): (f64, f64),
    unit: &str,
    longest: usize,
) -> Result<Vec<f64>, (Exit, String)> {
    if let Some(wrong) = list.iter().find(|value| !(least..=most).contains(*value)) {
        return Err((Exit::Usage, format!("{option} {wrong}: accepted: {least} to {most} {unit}")));
    }
    if list.is_empty() || list.len() > longest {
        return Err((Exit::Usage, format!("{option}: {} values, accepted: 1 to {longest}", list.len())));
    }
    Ok(list.to_vec())
}

/// The configuration at a cycle time, and its highest safe speed in m/s on the stiffness that it
/// believes.
///
/// # Errors
/// What cannot be simulated, and that no speed is safe.
pub(crate) fn highest_safe_speed(
    base: &Config,
    approach: &Approach,
    sampling_time_s: f64,
    instants: u32,
) -> Result<(Config, f64), String> {
    let stiffness = base.environment.normal_stiffness_n_m;
    let config = cell::config_for(base, sampling_time_s, stiffness)?;
    let found = cell::cell(base, approach, sampling_time_s, stiffness, instants, &Progress::silent().part(0))?;
    found.safe_speed().map(|speed| (config, speed))
}

/// The approach along the surface normal that a configuration describes by itself.
pub(crate) struct Touch(Approach);

impl Touch {
    /// Of a (checked) configuration.
    ///
    /// # Errors
    /// What it leaves open, such as the joints of an arm of six.
    pub(crate) fn of(config: &Config) -> Result<Self, (Exit, String)> {
        Approach::new(config, None, None).map(Self)
    }

    /// The highest safe speed in m/s at the configuration's own cycle time and stiffness.
    ///
    /// # Errors
    /// What cannot be simulated, and that no speed is safe.
    pub(crate) fn safe_speed(&self, config: &Config, instants: u32) -> Result<f64, String> {
        highest_safe_speed(config, &self.0, config.control.sampling_time_s, instants).map(|(_, speed)| speed)
    }

    /// A plant that touches at this speed.
    pub(crate) fn scenario(&self, config: &Config, speed_m_s: f64) -> Scenario {
        self.0.scenario(config, speed_m_s, 0.0)
    }
}

/// The speed for the cell as configured, when what nobody can tell is as it may be; `own` is what
/// was found for the cell as told.
///
/// # Errors
/// What controller or plant do not accept although the checks did.
fn recommended(
    config: &Config,
    question: &Question,
    own: &cell::Cell,
    threads: usize,
    progress: &Part<'_>,
) -> Result<Recommended, String> {
    let Worlds { count, seed } = question.worlds;
    let as_told_m_s = match own.safe_speed() {
        Ok(speed) => speed,
        Err(why) => return Ok(Recommended::new(0.0, 0.0, why, question.worlds)),
    };
    let config = config_for(config, own.sampling_time_s, own.stiffness_n_m)?;
    let cell = plausible::Cell::known(config, &question.approach, as_told_m_s);
    let one = (WORLD_WEIGHT * weight(own.sampling_time_s) as f64) as u64;
    let found = cell.plausible_speed(seed, count, threads, &|| progress.add(one))?;
    let as_told = || format!("{}, with the model exactly as told", own.limited_by);
    let limited_by = found.beyond.map_or_else(as_told, |(_, why)| why);
    Ok(Recommended::new(found.safe_m_s, as_told_m_s, limited_by, question.worlds))
}

/// All cells.
fn limits(path: &Path, config: &Config, question: &Question, threads: usize) -> Result<Limits, String> {
    let Question { approach, stiffnesses_n_m, sampling_times_s, instants, worlds } = question;
    let (own_time, own_stiffness) = (config.control.sampling_time_s, config.environment.normal_stiffness_n_m);
    let unlimited = unlimited_drives(config);
    // Fast cycles take longest: they come first, so that no thread is left alone with one.
    let cells_of = |time: &f64| {
        let limited = stiffnesses_n_m.iter().map(|stiffness| (config, *stiffness));
        let unlimited = unlimited.iter().map(|config| (config, own_stiffness));
        limited.chain(unlimited).map(|(config, stiffness)| (config, *time, stiffness)).collect::<Vec<_>>()
    };
    let mut asked: Vec<(&Config, f64, f64)> = sampling_times_s.iter().rev().flat_map(cells_of).collect();
    let is_own = |time: f64, stiffness: f64| cell::is_own(config, time) && stiffness == own_stiffness;
    let is_limited = |of: &Config| std::ptr::eq(of, config);
    let is_asked = asked.iter().any(|(of, time, stiffness)| is_limited(of) && is_own(*time, *stiffness));
    if !is_asked {
        asked.push((config, own_time, own_stiffness));
    }
    let of_cell = |time: f64| search::expected_tries((*instants).into()) * weight(time);
    let of_worlds = (WORLD_WEIGHT * (search::expected_tries(worlds.count) * weight(own_time)) as f64) as u64;
    let total = asked.iter().map(|(_, time, _)| of_cell(*time)).sum::<u64>() + of_worlds;
    let progress = Progress::begin(total, &format!("{} cells and {} worlds", asked.len(), worlds.count));
    let found = parallel::map_within(&progress, asked.len() as u64, threads, |index| {
        let (config, time, stiffness) = asked[index as usize];
        cell::cell(config, approach, time, stiffness, *instants, &progress.part(of_cell(time)))
    })?;
    let (limited, unlimited): (Vec<_>, Vec<_>) = asked.iter().zip(found).partition(|((of, ..), _)| is_limited(of));
    let [mut cells, unlimited] =
        [limited, unlimited].map(|found| found.into_iter().map(|(_, cell)| cell).collect::<Vec<_>>());
    let own = cells.iter().find(|cell| is_own(cell.sampling_time_s, cell.stiffness_n_m)).cloned();
    let own = own.ok_or("the cell as configured was not computed")?;
    let recommended = recommended(config, question, &own, threads, &progress.part(of_worlds))?;
    if !is_asked {
        cells.pop();
    }
    Ok(Limits::new(path, config, question, cells, unlimited, recommended))
}

/// The same with drives that take any reference; `None` where they are not limited.
fn unlimited_drives(config: &Config) -> Option<Config> {
    config.limits.joint_acceleration_rad_s2.as_ref()?;
    let mut unlimited = config.clone();
    let limits = &mut unlimited.limits;
    (limits.joint_acceleration_rad_s2, limits.joint_jerk_rad_s3, limits.stop_exceeds_jerk) = (None, None, false);
    Some(unlimited)
}

#[cfg(test)]
mod tests {
    use admittance_host::config::parse;
    use admittance_runner::config::FrameName;
    use admittance_runner::cycle;
    use admittance_runner::virtual_time::VirtualTime;
    use clap::Parser;
    use nalgebra::{Matrix3, Vector3};
    use plant_sim::run::VirtualRun;

    use super::*;

    pub(super) fn planar() -> Config {
        parse(include_str!("../../../../deploy/demo/mpc-default.toml"), "mpc-default.toml").unwrap()
    }

    pub(super) fn spatial() -> Config {
        parse(include_str!("../../../../deploy/robots/six-joint.toml"), "six-joint.toml").unwrap()
    }

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    fn args(line: &[&str]) -> Args {
        Line::try_parse_from(["limits", "cell.toml"].iter().chain(line)).unwrap().args
    }

    #[test]
    fn defaults_lie_around_the_configuration() {
        let mut config = planar();
        let question = Question::new(&args(&[]), &config).unwrap();
        assert_eq!(question.stiffnesses_n_m, [3e4, 1e5, 3e5]);
        assert_eq!(question.sampling_times_s, SAMPLING_TIMES_S);
        let question = Question::new(&args(&["--all"]), &config).unwrap();
        assert_eq!(question.stiffnesses_n_m, [1e4, 3e4, 1e5, 3e5, 1e6]);
        assert_eq!(question.sampling_times_s, ALL_SAMPLING_TIMES_S);
        config.control.sampling_time_s = 0.003;
        config.environment.normal_stiffness_n_m = 5e7;
        let question = Question::new(&args(&["--all"]), &config).unwrap();
        assert_eq!(question.sampling_times_s, [0.004, 0.003, 0.002, 0.001, 0.0005, 0.00025]);
        assert_eq!(question.stiffnesses_n_m, [5e6, 1.5e7, 5e7]);
    }

    #[test]
    fn arguments_are_checked() {
        let question = Question::new(&args(&["--joints", "-1.3,-1.4", "--stiffness-n-m=3e4,1e4,1e4"]), &planar());
        assert_eq!(question.map(|question| question.stiffnesses_n_m).unwrap_or_default(), [1e4, 3e4]);
        for (line, told) in [
            (["--sampling-time-s", "0"], "0.0001 to 0.1 s"),
            (["--stiffness-n-m", "NaN"], "N/m"),
            (["--stiffness-n-m", "1e3,2e3,3e3,4e3,5e3,6e3,7e3,8e3,9e3"], "1 to 8"),
            (["--joints", "1"], "one for each joint"),
            (["--direction", "0,1,0"], "out of the surface"),
        ] {
            let (code, why) = Question::new(&args(&line), &planar()).unwrap_err();
            assert!(code == Exit::Usage && why.contains(told), "{why}");
        }
    }

    #[test]
    fn an_arm_that_does_not_feel_the_surface_is_refused() {
        let mut config = spatial();
        config.contact.admittance_axes = vec![true, true, false, true, true, true];
        let line = args(&["--joints", "0.3,1.2,-1.8,2.2,1.57,0.3"]);
        let (code, why) = Question::new(&line, &config).unwrap_err();
        assert!(code == Exit::Config && why.contains("admittance_axes"), "{why}");
    }

    /// What gives way is a direction of the task frame, and so is the force that is limited.
    #[test]
    fn approaches_are_judged_in_the_task_frame() {
        let line = args(&["--joints", "0.3,1.2,-1.8,2.2,1.57,0.3"]);
        let standing = Question::new(&line, &spatial()).unwrap().approach.pose.tcp_axes;
        let normal = Vector3::new(0.25, -0.1, 1.0).normalize();
        for (frame, axes) in [(FrameName::Surface, Matrix3::from_columns(&[normal; 3])), (FrameName::Tool, standing)] {
            let mut config = spatial();
            config.task.frame = frame;
            config.environment.surface_normal = normal.into();
            config.contact.admittance_axes = (0..6).map(|axis| axis == 2).collect();
            let approach = Question::new(&line, &config).unwrap().approach;
            let safe = |speed: f64| cell::is_safe(&config, &approach, speed, 0.5).unwrap();
            assert_eq!(safe(0.05), Ok(()), "{frame}");
            // A limit that a stop in time does not keep.
            config.contact.force_limit = vec![20.0; 6];
            config.stopping.stop_force_n = None;
            config.contact.minimum_force.fill(4.0);
            let approach = Question::new(&line, &config).unwrap().approach;
            let scenario = approach.scenario(&config, 0.4, 0.5);
            let plant = VirtualRun::new(&scenario).unwrap();
            let mut run = VirtualTime::new(cycle::build(&config).unwrap(), plant);
            let (mut seen, mut normal_force) = (0.0_f64, 0.0_f64);
            while let Some(step) = run.step().unwrap() {
                let forces: Vec<_> = limited_forces(&config, &step.truth).collect();
                assert_eq!(forces.len(), 1);
                assert_eq!((forces[0].0, forces[0].2), (2, 20.0));
                seen = seen.max(forces[0].1);
                normal_force = normal_force.max(step.truth.peak_normal_force_n);
            }
            let along = axes.column(2).dot(&normal).abs();
            assert!(
                normal_force > 50.0 && (seen / normal_force - along).abs() < 0.02,
                "{frame}: {seen} of {normal_force} N"
            );
        }
        // The frame's x lies in the surface.
        let mut blind = spatial();
        blind.task.frame = FrameName::Surface;
        blind.contact.admittance_axes = (0..6).map(|axis| axis == 0).collect();
        let (code, why) = Question::new(&line, &blind).unwrap_err();
        assert!(code == Exit::Config && why.contains("admittance_axes"), "{why}");
    }

    #[test]
    fn files_end_with_the_codes_of_validate() {
        let directory = tempfile::tempdir().unwrap();
        let code = |path: &Path| run(&Args { config: path.to_owned(), ..args(&[]) }).unwrap_err().0;
        assert_eq!(code(&directory.path().join("missing.toml")), Exit::NoInput);
        let malformed = directory.path().join("malformed.toml");
        std::fs::write(&malformed, "[control]\nsampling_time_s = 5").unwrap();
        assert_eq!(code(&malformed), Exit::Config);
    }

    #[test]
    fn the_answer_is_safe_and_five_percent_more_is_not() {
        let config = planar();
        let line = args(&["--sampling-time-s", "0.004", "--stiffness-n-m", "1e5", "--instants", "4"]);
        let question = Question::new(&line, &config).unwrap();
        let limits = limits(Path::new("mpc-default.toml"), &config, &question, 2).unwrap();
        let speed = limits.cells[0].speed_m_s.unwrap();
        assert!((0.2..0.6).contains(&speed), "{:?}", limits.cells);
        let config = cell::config_for(&config, 0.004, 1e5).unwrap();
        let is_safe = |speed: f64| {
            (0..4).all(|instant| {
                cell::is_safe(&config, &question.approach, speed, f64::from(instant) / 4.0).unwrap().is_ok()
            })
        };
        assert!(is_safe(speed) && !is_safe(1.05 * speed), "{speed}");
    }
}
