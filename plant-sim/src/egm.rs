//! The plant as a robot controller that is guided by EGM: a message a cycle to the edge, joint speeds back. It keeps the
//! last speed that it was told until CommTimeout, as such robots do; its path correction is off, so that speeds alone move
//! it. What it was told while a cycle lasts acts from the next one on.

mod controller;
mod network;

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};

use admittance_client::Applied;
use admittance_core::quantities::Span;
use admittance_host::clock::{monotonic_ns, sleep_then_spin_until_ns};
use admittance_host::exit::ExitCode;
use ipc_types::services::{self, Access};
use ipc_types::{IpcSettings, TASK_AXES};

use crate::plant::{CycleTiming, Led};
use crate::run::any_plant;
use crate::scenario::Scenario;
use crate::summary::Summary;
use controller::{RobotController, Told};
use network::Network;

/// Before each message the plant stops sleeping and spins.
const SPIN_NS: u64 = 150_000;
/// Before the end of a cycle the answer is awaited no longer: the arm has to move on.
const INTEGRATION_NS: u64 = 1_000_000;

/// Runs a scenario to its end, with the edge at `edge`.
///
/// # Errors
/// How the program ends, and why.
pub(crate) fn run(
    scenario: &Scenario,
    settings: &IpcSettings,
    edge: SocketAddr,
    patience_s: f64,
    stop: &AtomicBool,
    is_quiet: bool,
) -> Result<(), (ExitCode, String)> {
    let Some(way) = &scenario.egm else {
        return Err((
            ExitCode::Config,
            format!("--egm {edge}: the scenario has no [egm]; accepted: one, which may be empty"),
        ));
    };
    if scenario.twist.is_some() {
        let why =
            format!("--egm {edge}: the scenario has [twist]; accepted: none, since the edge's file says who leads it");
        return Err((ExitCode::Config, why));
    }
    if scenario.drives.is_some() {
        let why = format!(
            "--egm {edge}: the scenario has [drives]; accepted: none, since joints that are told speeds over EGM jump"
        );
        return Err((ExitCode::Config, why));
    }
    let unavailable = |why: String| (ExitCode::Unavailable, why);
    let node = settings.node("plant-sim").map_err(|error| unavailable(error.to_string()))?;
    let truths = services::truth(&node, &settings.instance, Access::OpenOrCreate)
        .map_err(|error| unavailable(error.to_string()))?
        .publisher()
        .map_err(|error| unavailable(error.to_string()))?;
    let mut network = Network::open(way, edge).map_err(|error| unavailable(format!("--egm {edge}: {error}")))?;

    let first = monotonic_ns() + 10_000_000;
    let mut plant =
        any_plant(scenario, first, first | 1, true).map_err(|error| (ExitCode::Config, error.to_string()))?;
    let mut controller = RobotController::new(scenario, way, first);
    let mut summary = Summary::of_scenario(scenario);
    let patience = first + Span::from_seconds(patience_s).nanoseconds();
    while !plant.is_finished() && !stop.load(Ordering::Relaxed) {
        let stamp = plant.now_ns();
        sleep_then_spin_until_ns(stamp, SPIN_NS);
        let lateness_ns = monotonic_ns().saturating_sub(stamp);
        let mut is_missed = true;
        while let Some(datagram) = network.receive() {
            if plant.shows_commands() {
                is_missed &= !controller.hear(datagram, stamp);
            }
        }
        is_missed &= controller.has_heard();
        if is_missed {
            controller.miss();
        }
        if controller.stops_by_itself(stamp) {
            tracing::warn!("CommTimeout: nothing was heard for {} s: the robot stops by itself", way.comm_timeout_s);
        }
        if plant.publishes() {
            network.send(&controller.message(plant.sample()));
        }
        // It acts with the next cycle, whenever in this one it comes: what is left of the cycle is the plant's own.
        let answered_ns = network.await_datagram(plant.cycle_end_ns().saturating_sub(INTEGRATION_NS));
        let told = controller.told();
        let applied = match told {
            Told::Speeds(_) => Applied::Offset([0.0; TASK_AXES]),
            Told::Nothing => Applied::Hold,
        };
        let answer_time_ns = answered_ns.map_or(0, |answered_ns| answered_ns.saturating_sub(stamp));
        let timing = CycleTiming { answer_time_ns, lateness_ns };
        let truth = plant.led_truth(&Led { timing, applied, missed: is_missed, missed_commands: controller.missed() });
        summary.add(&truth);
        if let Ok(slot) = truths.loan_uninit() {
            // No subscriber is no failure.
            let _ = slot.write_payload(truth).send();
        }
        plant.follow_joints(&told.speeds(), plant.cycle_end_ns());
        plant.arrive(controller.has_heard());
        if let Some(divergence) = plant.divergence() {
            return Err((ExitCode::Internal, divergence.to_string()));
        }
        if plant.met_singularity() {
            let why = "the arm met a pose at which its Jacobian has no inverse: change the scenario's motion";
            return Err((ExitCode::Config, why.to_owned()));
        }
        if !controller.has_heard() && monotonic_ns() > patience {
            return Err(unavailable(format!(
                "no EgmSensor message from {edge} within {patience_s} s: is the edge running?"
            )));
        }
    }
    if !is_quiet {
        tracing::info!(
            "{}: peak normal force {:.1} N, contact losses {}, {} cycles, {} without an answer, {} datagrams not understood",
            scenario.name,
            summary.peak_normal_force_n,
            summary.contact_losses,
            summary.cycles,
            controller.missed(),
            controller.not_understood()
        );
    }
    Ok(())
}
