//! `admittancectl status`.

use admittance_core::quantities::Span;
use admittance_host::config::fixed;
use ipc_types::{Law, RequestKind, ResponseSample};

use super::status_json::{Said, schema, values};
use super::{ask, request};
use crate::Exit;
use crate::diagnostics::{self, axes_text};
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
    let response = ask(&node, &settings, request(RequestKind::Status))?;
    let diagnostics = diagnostics::first(&diagnostics::subscribe(&node, &settings)?, &settings)?;
    drop(opening);
    if args.json {
        println!("{}", values(&Said { response: &response, diagnostics: &diagnostics }));
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
        let [least, most] = response.believed_stiffness_band_n_m;
        if least < most {
            println!(
                "believed          {:.0} N/m, {least:.0} to {most:.0} (of a range that is told; one standard deviation)",
                response.believed_stiffness_n_m
            );
            let tilt = response.believed_tilt_rad();
            if tilt > 0.0 {
                println!(
                    "believed normal   {}, {} degrees from the one that is told",
                    coordinates(&response.believed_normal),
                    fixed(tilt.to_degrees(), 1)
                );
            }
        }
        println!("velocity offset   {} (m/s, rad/s)", axes_text(&response.velocity_offset));
        println!(
            "cycles            {}: fallback {}, late {}, missed {}, rejected {}",
            response.cycles,
            response.fallback_count,
            response.late_count,
            response.missed_count,
            response.rejected_count
        );
        let age = diagnostics::sample_age_ns(&diagnostics);
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
    values.map(|value| fixed(value, 4)).join(" ")
}
