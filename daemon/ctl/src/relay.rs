//! `admittancectl relay`: records and diagnostics of a daemon, handed on to a place of their own in shared memory. What carries
//! that place to other machines never sees the daemon's, where commands, states and requests are.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ipc_types::resources::Needed;
use ipc_types::services::{self, Access};
use ipc_types::{IpcSettings, Publisher, Subscriber, WireSample};

use crate::Exit;
use crate::diagnostics::subscribe;
use crate::target::Target;
use crate::turn::waiting;

/// Time between two looks: far below what waits in the daemon's buffer of records (a second at 4 kHz), and no more at once than the
/// tunnel bears (64).
const POLL: Duration = Duration::from_millis(10);
/// Most of it for records that wait for their readers, of whom there is one more than the daemon has.
const NEEDED: Needed = Needed { bytes: 48 << 20, descriptors: 64 };
/// Without diagnostics for so long the daemon is said to be silent: it sends several a second.
const SILENT: Duration = Duration::from_secs(3);

#[derive(Debug, clap::Args)]
#[command(
    after_help = "It reads, and hands on what it reads; nothing comes back. It takes one of the two places that the daemon has for readers \
    of records. Ctrl-C or SIGTERM ends it; a daemon that is restarted is read again. What carries the place to another machine: \
    docs/monitoring.md.\n\nExit codes: 0 ended, 64 usage, 66 no configuration, 69 no daemon, 77 no permission.\n\nExamples:\n  admittancectl relay \
    --instance cell-3 --to-root-path /run/admittance-relay --to-prefix relay_"
)]
pub(crate) struct Args {
    #[command(flatten)]
    target: Target,
    /// Directory of the place that is handed on to, as ipc.root_path: not the daemon's.
    #[arg(long, value_name = "PATH")]
    to_root_path: PathBuf,
    /// Start of the names of its files in /dev/shm, as ipc.prefix: not the daemon's.
    #[arg(long, value_name = "PREFIX")]
    to_prefix: String,
}

/// One service, from here to there.
struct Line<T: WireSample + Copy> {
    from: Subscriber<T>,
    to: Publisher<T>,
    count: u64,
}

impl<T: WireSample + Copy> Line<T> {
    /// Hands on a turn of what waits; whether there was something. What cannot be sent shows to readers as a gap.
    fn hand_on(&mut self) -> bool {
        let before = self.count;
        for sample in waiting(&self.from) {
            self.count += u64::from(self.to.send_copy(*sample).is_ok());
        }
        self.count > before
    }
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    let (node, settings, opening) = args.target.connect()?;
    let there = destination(args, &settings)?;
    let unavailable = |why: String| (Exit::Unavailable, why);
    // What it lacks later would be a SIGBUS, and not its own alone.
    there.check(NEEDED).map_err(|error| (Exit::of_refusal(error.is_permission()), error.to_string()))?;
    let records =
        services::record(&node, &settings.instance, Access::Open).map_err(|error| unavailable(error.to_string()))?;
    let records = records.subscriber().map_err(|error| unavailable(error.to_string()))?;
    let diagnostics = subscribe(&node, &settings)?;
    let node_there = there
        .node("admittancectl-relay")
        .map_err(|error| (Exit::of_refusal(error.is_permission()), error.to_string()))?;
    let instance = &there.instance;
    let records_there =
        services::relayed_record(&node_there, instance).map_err(|error| unavailable(error.to_string()))?;
    let diagnostics_there =
        services::relayed_diagnostics(&node_there, instance).map_err(|error| unavailable(error.to_string()))?;
    let mut records = Line {
        from: records,
        to: records_there.publisher().map_err(|error| unavailable(error.to_string()))?,
        count: 0,
    };
    let mut diagnostics = Line {
        from: diagnostics,
        to: diagnostics_there.publisher().map_err(|error| unavailable(error.to_string()))?,
        count: 0,
    };
    drop(opening);
    let ended = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&ended))
            .map_err(|error| unavailable(format!("signal handlers: {error}")))?;
    }
    eprintln!(
        "admittanced/{instance}: record and diagnostics are handed on to {} with prefix {:?}",
        there.root_path.display(),
        there.prefix
    );
    let (mut heard, mut is_silent) = (Instant::now(), false);
    while !ended.load(Ordering::Relaxed) {
        records.hand_on();
        if diagnostics.hand_on() {
            (heard, is_silent) = (Instant::now(), false);
        } else if !is_silent && heard.elapsed() >= SILENT {
            is_silent = true;
            eprintln!("no diagnostics for {} s: is admittanced running? Waiting for it", SILENT.as_secs());
        }
        std::thread::sleep(POLL);
    }
    println!("handed on {} records, {} diagnostics", records.count, diagnostics.count);
    Ok(Exit::Ok)
}

/// Where it goes: another place, since what carries that one to other machines carries all of it.
fn destination(args: &Args, daemon: &IpcSettings) -> Result<IpcSettings, (Exit, String)> {
    let there = IpcSettings {
        root_path: args.to_root_path.clone(),
        prefix: args.to_prefix.clone(),
        instance: daemon.instance.clone(),
    };
    there.validate().map_err(|error| (Exit::Usage, error.to_string()))?;
    let own = |what: &str, value: String| {
        (Exit::Usage, format!("{what} {value} is the daemon's: accepted: another one, where nothing commands the arm"))
    };
    if there.root_path == daemon.root_path {
        return Err(own("--to-root-path", there.root_path.display().to_string()));
    }
    // Files in /dev/shm are told apart by their start alone.
    if there.prefix.starts_with(&daemon.prefix) || daemon.prefix.starts_with(&there.prefix) {
        return Err(own("--to-prefix", format!("{:?}, or the start of it,", there.prefix)));
    }
    Ok(there)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use ipc_types::Instance;

    #[derive(Parser)]
    struct Typed {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn it_never_hands_on_to_where_the_daemon_is() {
        let daemon = IpcSettings {
            root_path: "/run/admittanced".into(),
            prefix: "admittanced_".to_owned(),
            instance: Instance::new("cell-3").expect("a name"),
        };
        let to = |root_path: &str, prefix: &str| {
            let words = ["relay", "--instance", "cell-3", "--to-root-path", root_path, "--to-prefix", prefix];
            destination(&Typed::try_parse_from(words).expect("as typed").args, &daemon)
        };
        assert_eq!(to("/run/admittance-relay", "relay_").map(|there| there.instance), Ok(daemon.instance.clone()));
        for (root_path, prefix, named) in [
            ("/run/admittanced", "relay_", "--to-root-path /run/admittanced is the daemon's"),
            ("/run/admittanced/", "relay_", "--to-root-path"),
            ("/run/admittance-relay", "admittanced_", "--to-prefix \"admittanced_\", or the start of it,"),
            ("/run/admittance-relay", "admit", "--to-prefix"),
            ("/run/admittance-relay", "", "prefix"),
        ] {
            let (code, why) = to(root_path, prefix).expect_err(named);
            assert!(code == Exit::Usage && why.contains(named), "{why}");
        }
    }
}
