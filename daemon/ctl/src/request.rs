//! `admittancectl status` and `reset`: the daemon's request service.

use std::time::Duration;

use admittance_host::clock::monotonic_ns;
use ipc_types::services::{self, Access};
use ipc_types::{
    IpcSettings, Mode, Motion, Node, RequestKind, RequestSample, ResponseSample, ResponseStatus, StopReason, Verdict,
};
use serde_json::json;

use crate::Exit;
use crate::diagnostics::{self, axes_text};
use crate::target::Target;

/// How long a request stays valid, and how long its answer is waited for.
const DEADLINE: Duration = Duration::from_secs(2);

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  admittancectl status --instance cell-3\n  admittancectl status --config cell.toml --json"
)]
pub(crate) struct StatusArgs {
    #[command(flatten)]
    target: Target,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  admittancectl reset --instance cell-3")]
pub(crate) struct ResetArgs {
    #[command(flatten)]
    target: Target,
    /// Reset although the commanded motion points into the surface or the force is above the release threshold. Control
    /// resumes at once, in contact.
    #[arg(long)]
    force: bool,
}

pub(crate) fn status(args: &StatusArgs) -> Result<Exit, (Exit, String)> {
    let (node, settings) = args.target.connect()?;
    let response = ask(&node, &settings, RequestKind::Status, false)?;
    let diagnostics = diagnostics::first(&diagnostics::subscribe(&node, &settings)?, &settings)?;
    if args.json {
        let mut json = json_of(&response);
        json["diagnostics"] = diagnostics::json_of(&diagnostics);
        println!("{json}");
    } else {
        println!("{}", response.text());
        println!("wrench            {} (N, N m; robot on environment)", axes_text(&response.wrench));
        println!("force limit       {} (N, N m)", axes_text(&diagnostics.force_limit));
        println!("velocity offset   {} (m/s, rad/s)", axes_text(&response.velocity_offset));
        println!(
            "cycles            {}: fallback {}, late {}, missed {}, rejected {}",
            response.cycles,
            response.fallback_count,
            response.late_count,
            response.missed_count,
            response.rejected_count
        );
        println!(
            "also              limited {}, contacts lost {}, solver failures {}, records dropped {}",
            diagnostics.limited_count,
            diagnostics.contact_losses,
            diagnostics.solver_failures,
            diagnostics.dropped_count
        );
        println!("latency           {:>10} {:>10} {:>10} {:>10} (us)", "p50", "p99", "p99.9", "max");
        for (name, all, last_second) in diagnostics::latencies(&diagnostics) {
            for (what, values) in [(name, all), ("  last second", last_second)] {
                let cells = values.map(|ns| format!("{:>10.1}", ns as f64 * 1e-3)).join(" ");
                println!("{what:<17} {cells}");
            }
        }
        println!("up                {:.1} s", response.uptime_ns as f64 * 1e-9);
    }
    Ok(Exit::Ok)
}

pub(crate) fn reset(args: &ResetArgs) -> Result<Exit, (Exit, String)> {
    if args.force {
        eprintln!("forced: control resumes at once, whatever the force and the commanded motion are");
    }
    let (node, settings) = args.target.connect()?;
    let response = ask(&node, &settings, RequestKind::Reset, args.force)?;
    println!("{}", response.text());
    Ok(if response.status == ResponseStatus::Done.code() { Exit::Ok } else { Exit::ClaimNotMet })
}

/// Asks the daemon, and waits for its answer.
pub(crate) fn ask(
    node: &Node,
    settings: &IpcSettings,
    kind: RequestKind,
    force: bool,
) -> Result<ResponseSample, (Exit, String)> {
    let unavailable = |why: String| (Exit::Unavailable, why);
    let service =
        services::request(node, &settings.instance, Access::Open).map_err(|error| unavailable(error.to_string()))?;
    let client = service.client().map_err(|error| unavailable(error.to_string()))?;
    let now = monotonic_ns();
    let deadline = now + DEADLINE.as_nanos() as u64;
    let request = RequestSample { id: now, deadline_ns: deadline, kind: kind.code(), force: u32::from(force) };
    // The server sees a request only as long as its pending response is kept.
    let pending =
        client.send_copy(request).map_err(|error| unavailable(format!("the request was not sent: {error:?}")))?;
    while monotonic_ns() < deadline {
        match pending.receive() {
            Ok(Some(response)) if response.id == request.id => return Ok(*response),
            Ok(_) => std::thread::sleep(Duration::from_millis(1)),
            Err(error) => return Err(unavailable(format!("the response was lost: {error:?}"))),
        }
    }
    Err(unavailable(format!(
        "admittanced/{} did not answer within {} s: is it running, or stopped by a debugger or SIGSTOP?",
        settings.instance,
        DEADLINE.as_secs()
    )))
}

fn json_of(response: &ResponseSample) -> serde_json::Value {
    json!({
        "text": response.text(),
        "mode": Mode::from_code(response.mode).map(Mode::name),
        "motion": Motion::from_code(response.motion).map(Motion::name),
        "stop_reason": StopReason::from_code(response.stop_reason).map(StopReason::name),
        "active_axes": response.active_axes,
        "verdict": Verdict::from_code(response.verdict).map(Verdict::name),
        "verdict_margin": response.verdict_margin,
        "verdict_time_s": response.verdict_time_s,
        "state_sequence": response.state_sequence,
        "command_sequence": response.command_sequence,
        "cycles": response.cycles,
        "fallback_count": response.fallback_count,
        "late_count": response.late_count,
        "missed_count": response.missed_count,
        "rejected_count": response.rejected_count,
        "compute_time_ns": response.compute_time_ns,
        "uptime_ns": response.uptime_ns,
        "wrench": response.wrench,
        "velocity_offset": response.velocity_offset,
    })
}
