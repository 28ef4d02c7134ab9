//! From the command line to two running threads, and to an exit code.

use std::ffi::OsString;
use std::sync::mpsc;

use admittance_host::clock::monotonic_ns;
use admittance_host::config::LoadError;
use admittance_host::exit::ExitCode;
use admittance_host::output::{fatal, report_panics, say_line, until_unread};
use admittance_host::realtime::{StepOutcome, StepReport};
use admittance_host::time_limit::TimeLimit;
use admittance_host::{config, cpu, logging};
use ipc_types::resources::Needed;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::args::{self, Args};
use crate::channel::channel;
use crate::instance_lock;
use crate::probe::Unobserved;
use crate::realtime_thread::{LoopTiming, RealtimeThread};
use crate::service_thread::ServiceThread;
use admittance_runner::config::{Config, Wait};
use admittance_runner::cycle;

const PROGRAM: &str = "admittanced";
/// Stack of the real-time thread. The law keeps data of a horizon's size elsewhere.
const STACK_BYTES: usize = 2 << 20;

/// Runs the daemon with these arguments (without the program's name) and says how it ended.
pub fn main_with_args(arguments: impl Iterator<Item = OsString>) -> ExitCode {
    // Before all else: a signal that comes while the daemon starts is acted on once it runs.
    let signals = Signals::new([SIGTERM, SIGINT, SIGHUP]);
    // The code below may use instructions that this processor lacks.
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
    report_panics(PROGRAM);
    let signals = signals.map_err(|error| (ExitCode::Unavailable, format!("signal handlers: {error}")));
    match signals.and_then(|signals| run(args, signals)) {
        Ok(code) => code,
        Err((code, why)) => {
            fatal(PROGRAM, &why);
            code
        }
    }
}

fn run(args: Args, signals: Signals) -> Result<ExitCode, (ExitCode, String)> {
    logging::init().map_err(|why| (ExitCode::Usage, why))?;
    ipc_types::quiet_iceoryx2();
    let config: Config = config::load(&args.config).map_err(|error| {
        let code = match error {
            LoadError::Read { .. } => ExitCode::NoInput,
            LoadError::Config(_) => ExitCode::Config,
        };
        (code, error.to_string())
    })?;
    let settings = config
        .ipc
        .settings(args.instance.as_deref(), args.root_path, args.prefix)
        .map_err(|why| (ExitCode::Config, why))?;
    settings.check(Needed::DAEMON).map_err(|error| (ExitCode::of_refusal(error.is_permission()), error.to_string()))?;
    let _lock = instance_lock::take(&settings)?;
    let controller = cycle::build(&config).map_err(|why| (ExitCode::Config, why))?;
    tracing::info!(
        instance = settings.instance.as_str(),
        "admittanced {} for {} at {:.6} s per cycle",
        env!("CARGO_PKG_VERSION"),
        config.robot.name,
        config.control.sampling_time_s
    );
    config.warnings().iter().for_each(|warning| tracing::warn!("{warning}"));

    let opening = TimeLimit::of_opening("admittanced", &settings.prefix);
    let (realtime_end, service_end) = channel();
    let thread = RealtimeThread {
        settings: settings.clone(),
        realtime: config.realtime.clone(),
        timing: LoopTiming::of(&config),
        cycle: controller,
        channel: realtime_end,
        boot_id: (monotonic_ns() ^ u64::from(std::process::id()) << 32) | 1,
    };
    let (started, start) = mpsc::channel();
    let (go, may_go) = mpsc::channel();
    let handle = std::thread::Builder::new()
        .name("real-time".to_owned())
        .stack_size(STACK_BYTES)
        .spawn(move || thread.run(&started, &may_go, Unobserved))
        .map_err(|error| (ExitCode::Unavailable, format!("the real-time thread cannot be started: {error}")))?;
    let reports = start.recv().map_err(|_| (ExitCode::Internal, "the real-time thread ended at once".to_owned()))??;
    report(&reports, config.realtime.require_realtime)?;
    if config.control.wait == Wait::Spin && config.realtime.priority > 0 && is_throttled() {
        tracing::warn!(
            "control.wait = \"spin\" with SCHED_FIFO: the kernel takes the processor away when others starve; run \
             sysctl kernel.sched_rt_runtime_us=-1, or use \"hybrid\""
        );
    }

    let node = settings
        .node("admittanced service")
        .map_err(|error| (ExitCode::of_refusal(error.is_permission()), error.to_string()))?;
    let mut service = ServiceThread::open(node, &settings.instance, service_end, args.config, config, signals)
        .map_err(|why| (ExitCode::Unavailable, why))?;
    drop(opening);
    // Only now may the arm be controlled: until here the process may end at any moment.
    let _ = go.send(());
    let has_served = service.run_or_stop(|| handle.is_finished());
    let code = handle.join().unwrap_or(ExitCode::Internal);
    if code == ExitCode::Internal {
        return Err((code, "the real-time thread failed; the last command was Hold".to_owned()));
    }
    if !has_served {
        return Err((ExitCode::Internal, "the service thread failed; control was ended as by SIGTERM".to_owned()));
    }
    tracing::info!("ended");
    Ok(code)
}

/// Logs the outcome of the real-time set-up.
fn report(reports: &[StepReport], required: bool) -> Result<(), (ExitCode, String)> {
    for report in reports {
        match &report.outcome {
            StepOutcome::Done => tracing::info!("real time: {}: done", report.step),
            StepOutcome::NotRequested => tracing::info!("real time: {}: not asked for", report.step),
            StepOutcome::Refused(why) if required => {
                let text = format!("realtime.require_realtime: {} was refused: {why}", report.step);
                return Err((ExitCode::NoPermission, text));
            }
            StepOutcome::Refused(why) => tracing::warn!("real time: {}: refused: {why}", report.step),
        }
    }
    Ok(())
}

/// Whether the kernel interrupts real-time threads that never sleep.
fn is_throttled() -> bool {
    let runtime = std::fs::read_to_string("/proc/sys/kernel/sched_rt_runtime_us");
    // Newer kernels may lack the throttle, and with it the file.
    runtime.is_ok_and(|runtime| !runtime.trim_start().starts_with('-'))
}
