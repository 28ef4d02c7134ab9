//! `admittancectl doctor`: whether this machine can keep a deadline, and what to change where it
//! cannot. Reads only.

mod checks;
mod machine;

use std::path::PathBuf;

use admittance_host::config::Value;
use admittance_host::ipc_section::IpcSection;
use admittance_host::realtime::RealtimeSection;
use admittance_runner::config::{Config, Wait};
use comfy_table::{ContentArrangement, Table, presets};
use serde::Serialize;

use crate::{Exit, validate};
use machine::Machine;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Nothing is changed. Run it as the user that the daemon runs as: permissions are those of who asks.\n\n\
    Exit codes: 0 nothing that the configuration requires is refused (warnings alone are 0), 1 something is, 66 no such file, \
    78 configuration.\n\nExamples:\n  admittancectl doctor\n  admittancectl doctor --config /etc/admittanced/cell-3.toml\n  \
    admittancectl doctor --json | jq '.checks[] | select(.status != \"ok\")'"
)]
pub(crate) struct Args {
    /// The daemon's configuration: what it asks for is then checked against what the machine
    /// grants.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

/// How a check ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Status {
    /// As it should be.
    Ok,
    /// It works, but timing suffers.
    Warning,
    /// The configuration asks for it and would not get it.
    Refused,
}

/// One thing about the machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct Check {
    /// What was looked at.
    name: &'static str,
    status: Status,
    /// The value found, with its unit.
    found: String,
    /// What to change: a command, a kernel parameter or a key; empty when nothing is.
    change: String,
}

/// What a configuration asks of the machine.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Asked {
    lock_memory: bool,
    /// SCHED_FIFO priority; 0 none.
    priority: u32,
    cpu: Option<u32>,
    cpu_dma_latency: bool,
    /// A refused step ends the daemon.
    require_realtime: bool,
    /// The thread never sleeps.
    spins: bool,
}

impl Asked {
    fn by(config: &Config) -> Self {
        let RealtimeSection { lock_memory, priority, cpu, cpu_dma_latency_us, require_realtime } = config.realtime;
        let cpu_dma_latency = cpu_dma_latency_us.is_some();
        let spins = config.control.wait == Wait::Spin;
        Self { lock_memory, priority, cpu, cpu_dma_latency, require_realtime, spins }
    }
}

const NO_DEFAULT: &str = "every key of [ipc] has a default";

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    let (asked, ipc) = match &args.config {
        Some(file) => {
            let config = validate::load(file)?;
            (Asked::by(&config), config.ipc)
        }
        None => (Asked::default(), IpcSection::when_missing().ok_or((Exit::Internal, NO_DEFAULT.to_owned()))?),
    };
    let settings = ipc.settings(None, None, None).map_err(|why| (Exit::Config, why))?;
    let checks = checks::all(&Machine::observe(&settings), &asked);
    let refused = checks.iter().filter(|check| check.status == Status::Refused).count();
    if args.json {
        println!("{}", serde_json::json!({ "checks": checks, "refused": refused }));
    } else {
        println!("{}", table(&checks));
    }
    if refused > 0 {
        eprintln!("{refused} of what the configuration asks for would be refused");
        return Ok(Exit::ClaimNotMet);
    }
    Ok(Exit::Ok)
}

fn table(checks: &[Check]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN).set_content_arrangement(ContentArrangement::Dynamic);
    table.set_header(["", "what", "found", "what to change"]);
    for check in checks {
        let status = match check.status {
            Status::Ok => "ok",
            Status::Warning => "warning",
            Status::Refused => "REFUSED",
        };
        table.add_row([status, check.name, &check.found, &check.change]);
    }
    table
}
