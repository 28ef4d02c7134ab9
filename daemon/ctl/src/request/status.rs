//! `admittancectl status`.

use admittance_core::quantities::Span;
use admittance_host::config::fixed;
use ipc_types::services::{self, Access};
use ipc_types::{DiagnosticsSample, Law, RequestKind, ResponseSample, ServiceError};

use super::status_json::{Said, of_diagnostics, schema, values};
use super::{ask, request};
use crate::Exit;
use crate::diagnostics::{self, axes_text, mode_text, verdict_text};
use crate::target::Target;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  admittancectl status --instance cell-3\n  admittancectl status --config cell.toml --json\n  \
    admittancectl status --schema"
)]
pub(crate) struct StatusArgs {
    #[command(flatten)]
    target: Target,
    /// One JSON object, with a version; --schema says what its keys are.
    #[arg(long)]
    json: bool,
    /// The JSON schema of what --json prints; no daemon is asked.
    #[arg(long, conflicts_with = "json")]
    schema: bool,
}

pub(crate) fn status(args: &StatusArgs) -> Result<Exit, (Exit, String)> {
    if args.schema {
        println!("{:#}", schema());
        return Ok(Exit::Ok);
    }
    let (node, settings, opening) = args.target.connect()?;
    // Where records and diagnostics are handed on to there is nobody to ask.
    let asked =
        !matches!(services::request(&node, &settings.instance, Access::Open), Err(ServiceError::NotFound { .. }));
    let subscriber = diagnostics::subscribe(&node, &settings)?;
    let answer = if asked { Some(ask(&node, &settings, request(RequestKind::Status))?) } else { None };
    let diagnostics = diagnostics::first(&subscriber, &settings)?;
    drop(opening);
    let response = answer.unwrap_or_else(|| of_diagnostics(&diagnostics));
    if args.json {
        println!("{}", values(&Said { response: &response, diagnostics: &diagnostics, asked }));
        return Ok(Exit::Ok);
    }
    if asked {
        println!("{}", response.text());
    } else {
        println!("{}: {}", mode_text(response.mode, response.stop_reason), verdict_text(&diagnostics));
        println!("read only         what the diagnostics say; this place has no requests to the daemon");
    }
    say(&response, &diagnostics, asked);
    Ok(Exit::Ok)
}

/// All that is known, line by line; what only an answer has where there is one.
fn say(response: &ResponseSample, diagnostics: &DiagnosticsSample, asked: bool) {
    println!("wrench            {} (N, N m; robot on environment)", axes_text(&response.wrench));
    println!("force limit       {} (N, N m)", axes_text(&response.force_limit));
    if asked {
        say_in_force(response);
    }
    let [least, most] = response.believed_stiffness_band_n_m;
    if least < most {
        println!(
            "believed          {:.0} N/m, {least:.0} to {most:.0} (of a range that is told; one standard deviation)",
            response.believed_stiffness_n_m
        );
        if asked && diagnostics.believed_tilt_rad > 0.0 {
            println!(
                "believed normal   {}, {} degrees from the one that is told",
                coordinates(&response.believed_normal),
                fixed(response.believed_tilt_rad().to_degrees(), 1)
            );
        }
    }
    println!("velocity offset   {} (m/s, rad/s)", axes_text(&response.velocity_offset));
    println!(
        "cycles            {}: fallback {}, late {}, missed {}, rejected {}",
        response.cycles, response.fallback_count, response.late_count, response.missed_count, response.rejected_count
    );
    let age = diagnostics::sample_age_ns(diagnostics);
    let age = age.map_or("none yet".to_owned(), |age| format!("{:.1} ms old", age as f64 * 1e-6));
    println!("last sample       {age}, {} of the last 100 missed", diagnostics.missed_lately);
    println!(
        "also              force exceeded {}, limited {}, contacts lost {}, solver failures {}, records dropped {}",
        diagnostics.exceeded_count,
        diagnostics.limited_count,
        diagnostics.contact_losses,
        diagnostics.solver_failures,
        diagnostics.dropped_count
    );
    println!("latency           {:>10} {:>10} {:>10} {:>10} (us)", "p50", "p99", "p99.9", "max");
    for (name, all, last_second) in diagnostics::latencies(diagnostics) {
        for (what, values) in [(name, all), ("  last second", last_second)] {
            let cells = values.map(|ns| format!("{:>10.1}", ns as f64 * 1e-3)).join(" ");
            println!("{what:<17} {cells}");
        }
    }
    println!("up                {:.1} s", Span::from_nanoseconds(response.uptime_ns).seconds());
}

/// What is in force, as only the daemon itself says.
fn say_in_force(response: &ResponseSample) {
    println!("wrench bias       {} (N, N m; as the sensor gives it)", axes_text(&response.wrench_bias));
    println!("law               {}, control {}", law_name(response), enabled_text(response));
    println!(
        "environment       {:.0} N/m along {}, at {} m",
        response.normal_stiffness_n_m,
        coordinates(&response.surface_normal),
        coordinates(&response.contact_point)
    );
}

fn law_name(response: &ResponseSample) -> &'static str {
    Law::name_of(response.law)
}

fn enabled_text(response: &ResponseSample) -> &'static str {
    if response.enabled == 1 { "enabled" } else { "disabled" }
}

fn coordinates(values: &[f64; 3]) -> String {
    values.map(|value| fixed(value, 4)).join(" ")
}
