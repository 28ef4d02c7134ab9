//! The plant in real time: sample at nominal instants, publish, wait for the answer, publish the
//! truth, integrate.

use std::ffi::OsString;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use admittance_client::{LeadRefusal, Led, Ports};
use admittance_core::quantities::Span;
use admittance_host::clock::{monotonic_ns, pause, sleep_then_spin_until_ns, sleep_until_ns};
use admittance_host::config::{self, LoadError};
use admittance_host::exit::ExitCode;
use admittance_host::output::{fatal, report_panics, say_line, until_unread};
use admittance_host::realtime::{StepOutcome, go_real_time};
use admittance_host::time_limit::TimeLimit;
use admittance_host::{cpu, logging};
use ipc_types::resources::Needed;
use ipc_types::services::{self, Access};
use ipc_types::{Publisher, TruthSample};

use crate::args::{self, Args};
use crate::egm;
use crate::plant::{CycleTiming, Retreated};
use crate::run::{AnyPlant, SINGULAR, any_plant};
use crate::scenario::Scenario;
use crate::summary::Summary;

const PROGRAM: &str = "plant-sim";
/// Before each sample the plant stops sleeping and spins, so that it publishes at the nominal
/// instant.
const SPIN_NS: u64 = 150_000;
/// Before each sample it stops looking for answers, to integrate.
const INTEGRATION_NS: u64 = 400_000;
/// Time between two looks for an answer that is already late.
const LATE_POLL_NS: u64 = 30_000;

/// Runs the plant with these arguments (without the program's name) and says how it ended.
pub fn main_with_args(arguments: impl Iterator<Item = OsString>) -> ExitCode {
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
    let outcome = run(args);
    logging::tell_all_withheld();
    match outcome {
        Ok(()) => ExitCode::Ok,
        Err((code, why)) => {
            fatal(PROGRAM, &why);
            code
        }
    }
}

fn run(args: Args) -> Result<(), (ExitCode, String)> {
    // Before anything that takes time: a signal that comes meanwhile is acted on.
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(|error| (ExitCode::Unavailable, format!("signal handlers: {error}")))?;
    }
    logging::init().map_err(|why| (ExitCode::Usage, why))?;
    ipc_types::quiet_iceoryx2();
    let scenario: Scenario =
        config::load(&args.scenario).map_err(|error: LoadError| (error.exit_code(), error.to_string()))?;
    let settings = scenario
        .ipc
        .settings(args.instance.as_deref(), args.root_path, args.prefix)
        .map_err(|why| (ExitCode::Config, why))?;
    let unavailable = |why: String| (ExitCode::Unavailable, why);
    settings.check(Needed::PLANT).map_err(|error| (ExitCode::of_refusal(error.is_permission()), error.to_string()))?;
    if let Some(edge) = args.egm {
        become_real_time(&scenario)?;
        return egm::run(&scenario, &settings, edge, args.controller_timeout_s, &stop, args.quiet);
    }
    let opening = TimeLimit::of_opening("plant-sim", &settings.prefix);
    let ports = Ports::open(&settings, "plant-sim")
        .map_err(|error| (ExitCode::of_refusal(error.is_permission()), error.to_string()))?;
    let truths = services::truth(ports.node(), &settings.instance, Access::OpenOrCreate)
        .map_err(|error| unavailable(error.to_string()))?
        .publisher()
        .map_err(|error| unavailable(error.to_string()))?;
    let led = match &scenario.twist {
        None => None,
        Some(section) => Some(
            Led::open(&settings, "plant-sim twist", section.limits())
                .map_err(|error| (ExitCode::of_refusal(error.is_permission()), error.to_string()))?,
        ),
    };
    drop(opening);
    become_real_time(&scenario)?;
    if !args.quiet {
        let version = env!("CARGO_PKG_VERSION");
        tracing::info!("plant-sim {version}: scenario \"{}\", waiting for admittanced", scenario.name);
    }

    let first = monotonic_ns() + 10_000_000;
    let boot_id = (first ^ u64::from(std::process::id()) << 32) | 1;
    let mut plant =
        any_plant(&scenario, first, boot_id, true).map_err(|error| (ExitCode::Config, error.to_string()))?;
    for overload in plant.overloads() {
        tracing::warn!("{overload}");
    }
    let patience = first + (args.controller_timeout_s * 1e9) as u64;
    let mut turns = Turns {
        led,
        ports,
        truths,
        sampling_time: Span::from_seconds(scenario.timing.sampling_time_s).nanoseconds(),
        delay: Span::from_seconds(scenario.timing.command_delay_s).nanoseconds(),
    };
    let mut summary = Summary::of_scenario(&scenario);
    while !plant.is_finished() && !stop.load(Ordering::Relaxed) {
        summary.add(&turns.turn(&mut *plant));
        if let Some(divergence) = plant.divergence() {
            return Err((ExitCode::Internal, divergence.to_string()));
        }
        if plant.met_singularity() {
            return Err((ExitCode::Config, SINGULAR.to_owned()));
        }
        if !plant.has_received() && monotonic_ns() > patience {
            let text = format!(
                "no command on admittanced/{}/command within {} s: is admittanced running with this instance, root path and prefix?",
                settings.instance, args.controller_timeout_s
            );
            return Err((ExitCode::Unavailable, text));
        }
    }
    if !args.quiet {
        let settled = if plant.is_finished() {
            format!("settled |f_y| {:.1} N", summary.settled_force_y_n())
        } else {
            "ended by a signal".to_owned()
        };
        tracing::info!(
            "{}: peak |f_y| {:.1} N, contact losses {}, {settled}, {} cycles, {} missed, {} rejected",
            scenario.name,
            summary.peak_force_y_n,
            summary.contact_losses,
            summary.cycles,
            summary.missed_samples,
            plant.rejected()
        );
    }
    // A second signal ends the retreat as well.
    stop.store(false, Ordering::Relaxed);
    plant.begin_retreat();
    let was_clear = plant.retreated().is_some();
    while plant.retreated().is_none() && !stop.load(Ordering::Relaxed) {
        turns.turn(&mut *plant);
    }
    match plant.retreated() {
        _ if was_clear => {}
        None => tracing::warn!("the retreat was ended by a signal: the tool may still press on the surface"),
        Some(Retreated { is_clear: false, gap_m, .. }) => {
            tracing::warn!("the tool did not get away from the surface: it is {:.1} mm from it", gap_m * 1e3);
        }
        Some(Retreated { gap_m, was_jogged, .. }) if !args.quiet => {
            let how = if was_jogged { ", without the daemon's offset, which kept it there" } else { "" };
            tracing::info!("retreated: the tool is {:.1} mm from the surface{how}", gap_m * 1e3);
        }
        Some(_) => {}
    }
    Ok(())
}

fn become_real_time(scenario: &Scenario) -> Result<(), (ExitCode, String)> {
    for report in go_real_time(&scenario.realtime) {
        if let StepOutcome::Refused(why) = report.outcome {
            if scenario.realtime.require_realtime {
                return Err((ExitCode::NoPermission, format!("{} was refused: {why}", report.step)));
            }
            tracing::warn!("real time: {}: refused: {why}", report.step);
        }
    }
    Ok(())
}

/// What every cycle needs; the ports go last, since their node is the last to leave.
struct Turns {
    /// Where other programs lead the arm, if they may.
    led: Option<Led>,
    truths: Publisher<TruthSample>,
    ports: Ports,
    /// T_s in ns.
    sampling_time: u64,
    /// When the command of a sample acts, in ns after its stamp.
    delay: u64,
}

impl Turns {
    /// One cycle, with its truth.
    fn turn(&mut self, plant: &mut dyn AnyPlant) -> TruthSample {
        let timing = cycle(&self.ports, plant, self.sampling_time, self.delay);
        let truth = plant.settle(timing);
        if let Ok(slot) = self.truths.loan_uninit() {
            // No subscriber is no failure.
            let _ = slot.write_payload(truth).send();
        }
        if let Some(led) = &mut self.led {
            plant.lead(&led.twist(monotonic_ns(), &plant.tool_axes(), say));
        }
        plant.integrate();
        truth
    }
}

/// At powers of two: a line for each would block the loop.
fn say(refusal: &LeadRefusal, count: u64) {
    if count.is_power_of_two() {
        tracing::warn!("a twist that is not followed: {refusal} ({count} so far)");
    }
}

/// Publishes the current sample at its instant and waits for its answer.
fn cycle(ports: &Ports, plant: &mut dyn AnyPlant, sampling_time: u64, delay: u64) -> CycleTiming {
    let stamp = plant.now_ns();
    let slot = ports.loan();
    sleep_then_spin_until_ns(stamp, SPIN_NS);
    let lateness_ns = monotonic_ns().saturating_sub(stamp);
    if plant.publishes()
        && let Some(slot) = slot
    {
        ports.send(slot, plant.sample());
        if plant.notifies() {
            ports.notify();
        }
    }
    let give_up = stamp + sampling_time - INTEGRATION_NS.min(sampling_time / 2);
    loop {
        if let Some(command) = ports.command() {
            let visible = monotonic_ns();
            match plant.receive(&command, visible) {
                Ok(_) if command.state_sequence == plant.sample().sequence => {
                    return CycleTiming { answer_time_ns: visible.saturating_sub(stamp), lateness_ns };
                }
                Ok(_) => {}
                // One line for each would block this loop when every command is rejected.
                Err(rejection) if plant.rejected().is_power_of_two() => {
                    tracing::warn!("command not accepted ({} so far): {rejection}", plant.rejected());
                }
                Err(_) => {}
            }
        }
        let now = monotonic_ns();
        if now >= give_up {
            return CycleTiming { answer_time_ns: 0, lateness_ns };
        }
        if now > stamp + delay {
            sleep_until_ns((now + LATE_POLL_NS).min(give_up));
        } else {
            pause();
        }
    }
}
