//! `admittancectl status`.

use admittance_core::quantities::Span;
use ipc_types::{Law, Mode, Motion, RequestKind, ResponseSample, StopReason, Verdict};
use serde_json::json;

use super::{ask, request};
use crate::Exit;
use crate::diagnostics::{self, axes_text};
use crate::target::Target;

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

pub(crate) fn status(args: &StatusArgs) -> Result<Exit, (Exit, String)> {
    let (node, settings, opening) = args.target.connect()?;
    let response = ask(&node, &settings, request(RequestKind::Status))?;
    let diagnostics = diagnostics::first(&diagnostics::subscribe(&node, &settings)?, &settings)?;
    drop(opening);
    if args.json {
        let mut json = json_of(&response);
        json["diagnostics"] = diagnostics::json_of(&diagnostics);
        println!("{json}");
    } else {
        println!("{}", response.text());
        println!("wrench            {} (N, N m; robot on environment)", axes_text(&response.wrench));
        println!("wrench bias       {} (N, N m; as the sensor gives it)", axes_text(&response.wrench_bias));
        println!("force limit       {} (N, N m)", axes_text(&response.force_limit));
        println!("law               {}, control {}", law_name(&response), enabled_text(&response));
        println!(
            "environment       {:.0} N/m along {}, at {} m",
            response.normal_stiffness_n_m,
            coordinates(&response.surface_normal),
            coordinates(&response.contact_point)
        );
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
            "also              force exceeded {}, limited {}, contacts lost {}, solver failures {}, records dropped {}",
            diagnostics.exceeded_count,
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
        println!("up                {:.1} s", Span::from_nanoseconds(response.uptime_ns).seconds());
    }
    Ok(Exit::Ok)
}

fn law_name(response: &ResponseSample) -> &'static str {
    Law::name_of(response.law)
}

fn enabled_text(response: &ResponseSample) -> &'static str {
    if response.enabled == 1 { "enabled" } else { "disabled" }
}

fn coordinates(values: &[f64; 3]) -> String {
    values.map(|value| format!("{value:.4}")).join(" ")
}

fn json_of(response: &ResponseSample) -> serde_json::Value {
    json!({
        "text": response.text(),
        "mode": Mode::name_of(response.mode),
        "motion": Motion::name_of(response.motion),
        "stop_reason": StopReason::name_of(response.stop_reason),
        "active_axes": response.active_axes,
        "verdict": Verdict::name_of(response.verdict),
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
        "wrench_bias": response.wrench_bias,
        "force_limit": response.force_limit,
        "law": Law::name_of(response.law),
        "enabled": response.enabled == 1,
        "normal_stiffness_n_m": response.normal_stiffness_n_m,
        "surface_normal": response.surface_normal,
        "contact_point_m": response.contact_point,
        "velocity_offset": response.velocity_offset,
    })
}
