//! From the command line to the loop, and from its end to the exit code.

use std::ffi::OsString;
use std::net::{IpAddr, SocketAddr};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use admittance_client::{Arm, ControllerError, Limits};
use admittance_core::quantities::Span;
use admittance_host::config::{self, LoadError};
use admittance_host::exit::ExitCode;
use admittance_host::output::{fatal, say_line, until_unread};
use admittance_host::realtime::{StepOutcome, go_real_time};
use admittance_host::time_limit::TimeLimit;
use admittance_host::twist_section::TwistSection;
use admittance_host::{cpu, logging};
use admittance_runner::config::{Config, Wait};
use ipc_types::resources::Needed;
use ipc_types::{MAX_JOINTS, TASK_AXES};

use crate::args::{self, Args};
use crate::arm::{AnyArm, any_arm};
use crate::config::{EdgeConfig, units};
use crate::edge::{Edge, EdgeError, Setup};
use crate::guide::Guide;
use crate::link::Link;
use crate::notify::Notify;

const PROGRAM: &str = "admittance-egm";
/// The answer of the daemon is awaited for this part of a cycle at most: the rest is for what comes before and after.
const LONGEST_ANSWER: f64 = 0.8;
/// How much longer than its budget an answer is awaited, s: it has to be published, and seen.
const ANSWER_ALLOWANCE_S: f64 = 0.0003;
/// By how much more than its own limit the daemon may ask for. An answer that is refused leaves the arm to the last plan: the
/// limits are there for what no sound daemon gives.
const LIMIT_MARGIN: f64 = 2.0;

type Failure = (ExitCode, String);

/// The arm that the loop computes with, made from the one of the daemon's file.
type Exchange<'a> = &'a dyn Fn(Box<dyn AnyArm>) -> Box<dyn AnyArm>;

/// Runs the edge with these arguments (without the program's name) and says how it ended.
pub fn main_with_args(arguments: impl Iterator<Item = OsString>) -> ExitCode {
    main_with_arm(arguments, &|arm| arm)
}

/// The same with an arm in place of the one that the daemon's file describes: whoever tries what becomes of the robot when the
/// loop fails has one that fails.
pub fn main_with_arm(arguments: impl Iterator<Item = OsString>, exchange: Exchange<'_>) -> ExitCode {
    if let Some(feature) = cpu::missing_cpu_feature() {
        let why = format!("this processor lacks {feature}, which this build needs (x86-64-v3): build for this machine");
        fatal(PROGRAM, &why);
        return ExitCode::Unavailable;
    }
    let args = match args::parse(arguments) {
        Ok(args) => args,
        Err(error) if error.use_stderr() => {
            fatal(PROGRAM, error.to_string().trim_start_matches("error: "));
            return ExitCode::Usage;
        }
        Err(help) => {
            return until_unread(PROGRAM, || {
                say_line(format_args!("{}", help.to_string().trim_end()));
                ExitCode::Ok
            });
        }
    };
    // Without a backtrace, whatever the environment asks for: to find its names takes longer than CommTimeout, and the robot
    // goes on meanwhile.
    std::panic::set_hook(Box::new(|panic| fatal(PROGRAM, &panic.to_string())));
    match run(args, exchange) {
        Ok(()) => ExitCode::Ok,
        Err((code, why)) => {
            fatal(PROGRAM, &why);
            code
        }
    }
}

/// What both files say, checked.
struct Plan {
    edge: EdgeConfig,
    listen: SocketAddr,
    robot: IpAddr,
    setup: Setup,
    guide: Guide,
}

fn run(args: Args, exchange: Exchange<'_>) -> Result<(), Failure> {
    // Before anything that takes time: a signal that comes meanwhile is acted on.
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(|error| (ExitCode::Unavailable, format!("signal handlers: {error}")))?;
    }
    logging::init().map_err(|why| (ExitCode::Usage, why))?;
    ipc_types::quiet_iceoryx2();
    let is_check = args.check;
    let Plan { edge: config, listen, robot, setup, guide } = plan(args, exchange)?;
    if is_check {
        // Nobody reading it is no failure of the files.
        until_unread(PROGRAM, || {
            say_line(format_args!("valid: {listen} for {robot}"));
            ExitCode::Ok
        });
        return Ok(());
    }
    setup
        .settings
        .check(Needed::PLANT)
        .map_err(|error| (ExitCode::of_refusal(error.is_permission()), error.to_string()))?;
    let link = Link::bind(listen, robot).map_err(|error| {
        let is_permission = error.kind() == std::io::ErrorKind::PermissionDenied;
        (ExitCode::of_refusal(is_permission), format!("egm.listen = \"{listen}\": {error}"))
    })?;
    let address = link.local_address().map_or_else(|_| listen.to_string(), |address| address.to_string());
    let opening = TimeLimit::of_opening(PROGRAM, &setup.settings.prefix);
    let mut edge = Edge::new(setup, guide, link, stop).map_err(failure)?;
    drop(opening);
    for report in go_real_time(&config.realtime) {
        if let StepOutcome::Refused(why) = report.outcome {
            if config.realtime.require_realtime {
                let text = format!("realtime.require_realtime: {} was refused: {why}", report.step);
                return Err((ExitCode::NoPermission, text));
            }
            tracing::warn!("real time: {}: refused: {why}", report.step);
        }
    }
    let led = if config.twist.is_some() { ", and is led by other programs" } else { "" };
    tracing::info!("admittance-egm {} awaits {robot} on {address}{led}", env!("CARGO_PKG_VERSION"));
    let mut notify = Notify::ready();
    // Whatever ends the loop, a panic as well, the robot is led to a standstill: else it keeps its last speed. What has failed
    // in the loop may fail once more while the plan is played out: then the zeros come at once.
    let outcome = catch_unwind(AssertUnwindSafe(|| edge.run(&mut notify)));
    Notify::stopping();
    let played_out = catch_unwind(AssertUnwindSafe(|| edge.play_out()));
    edge.say_farewell();
    if let Ok(Err(error)) = played_out {
        tracing::warn!("the last plan was not played to its end: {error}");
    }
    tracing::info!("{}", edge.summary());
    logging::tell_all_withheld();
    match outcome {
        Ok(outcome) => outcome.map_err(failure),
        Err(_) => Err((ExitCode::Internal, "the loop failed; the robot was sent zeros".to_owned())),
    }
}

fn plan(args: Args, exchange: Exchange<'_>) -> Result<Plan, Failure> {
    let read = |error: LoadError| (error.exit_code(), error.to_string());
    let wrong = |why: String| (ExitCode::Config, why);
    let edge: EdgeConfig = config::load(&args.config).map_err(read)?;
    let daemon: Config = config::load(&args.daemon_config).map_err(read)?;
    let settings = daemon.ipc.settings(args.instance.as_deref(), args.root_path, args.prefix).map_err(wrong)?;
    let units = units(&daemon);
    let named = |why: String| wrong(format!("{}: {why}", args.config.display()));
    let speed_limit = edge.egm.speed_limit(&units).map_err(named)?;
    let torque_factor = edge.egm.torque_factors(units.len(), daemon.wrench.source).map_err(named)?;
    check_references(&daemon).map_err(|why| wrong(format!("{}: {why}", args.daemon_config.display())))?;
    check_delay(&daemon).map_err(|why| wrong(format!("{}: {why}", args.daemon_config.display())))?;
    let chain = any_arm(&daemon.robot, daemon.control.minimum_reciprocal_condition)
        .ok_or_else(|| wrong("robot: an arm that is not known".to_owned()))?;
    // Both were checked with the file.
    let (Ok(listen), Ok(robot)) = (edge.egm.listen.parse(), edge.egm.robot_address.parse()) else {
        return Err(wrong("egm.listen, egm.robot_address: no addresses".to_owned()));
    };
    let lead = edge.twist.as_ref().map(TwistSection::limits);
    let (arm, spin_ns, answer_ns) = (of(&daemon, &speed_limit), spin_ns(&daemon), answer_ns(&daemon));
    let setup = Setup { settings, arm, spin_ns, answer_ns, speed_limit, torque_factor, lead };
    Ok(Plan { edge, listen, robot, setup, guide: Guide::new(exchange(chain), units, speed_limit) })
}

/// What is sent here is J⁻¹ of a twist, and steps to zero where the arm is to stand.
fn check_references(daemon: &Config) -> Result<(), String> {
    if daemon.redundancy.is_told() {
        return Err(
            "[redundancy]: accepted with EGM: absent, since the edge resolves twists itself, by the least norm"
                .to_owned(),
        );
    }
    match &daemon.limits.joint_acceleration_rad_s2 {
        None => Ok(()),
        Some(limits) => Err(format!(
            "limits.joint_acceleration_rad_s2 = {limits:?}: accepted with EGM: absent, since zeros are sent at once where the arm \
             is to stand; the robot's controller keeps its drives' limits"
        )),
    }
}

/// A robot acts on an answer in its next cycle at the earliest.
fn check_delay(daemon: &Config) -> Result<(), String> {
    let (delay_s, cycle_s) = (daemon.control.command_delay_s, daemon.control.sampling_time_s);
    if delay_s < cycle_s {
        return Err(format!(
            "control.command_delay_s = {delay_s}: accepted with EGM: at least control.sampling_time_s = {cycle_s}, since a robot \
             acts on an answer in its next cycle"
        ));
    }
    Ok(())
}

/// The robot's messages are awaited as the daemon awaits its samples. To look all the time is not for an edge, which may have
/// the daemon's processor.
fn spin_ns(daemon: &Config) -> u64 {
    match daemon.control.wait {
        Wait::Event => 0,
        Wait::Hybrid | Wait::Spin => Span::from_seconds(daemon.control.spin_s).nanoseconds(),
    }
}

fn answer_ns(daemon: &Config) -> u64 {
    let control = &daemon.control;
    let longest_s = LONGEST_ANSWER * control.sampling_time_s;
    Span::from_seconds((control.answer_budget_s + ANSWER_ALLOWANCE_S).min(longest_s)).nanoseconds()
}

/// What daemon and edge have agreed on.
fn of(daemon: &Config, speed_limit: &[f64; MAX_JOINTS]) -> Arm {
    let mut limits = Limits { velocity_offset: [f64::INFINITY; TASK_AXES], joint_velocity_offset: *speed_limit };
    for (limit, told) in limits.velocity_offset.iter_mut().zip(&daemon.limits.velocity_offset) {
        *limit = LIMIT_MARGIN * told;
    }
    limits.joint_velocity_offset.iter_mut().for_each(|limit| *limit *= LIMIT_MARGIN);
    Arm {
        joint_count: daemon.robot.joint.len(),
        sampling_time_ns: Span::from_seconds(daemon.control.sampling_time_s).nanoseconds(),
        command_delay_ns: Span::from_seconds(daemon.control.command_delay_s).nanoseconds(),
        limits,
    }
}

fn failure(error: EdgeError) -> Failure {
    let code = match &error {
        EdgeError::Controller(ControllerError::Open(open)) => ExitCode::of_refusal(open.is_permission()),
        EdgeError::Open(open) => ExitCode::of_refusal(open.is_permission()),
        EdgeError::Controller(_) => ExitCode::Config,
        EdgeError::Socket(_) => ExitCode::Unavailable,
    };
    (code, error.to_string())
}
