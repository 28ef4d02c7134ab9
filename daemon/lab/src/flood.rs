//! `admittance-lab flood`: more requests than a daemon can answer, and how long another client waits
//! meanwhile.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use admittance_host::clock::{monotonic_ns, sleep_until_ns};
use admittancectl::request::request;
use admittancectl::target::Target;
use admittancectl::{Exit, Outcome};
use ipc_types::services::{self, Access};
use ipc_types::{Client, IpcSettings, Node, RequestKind, RequestSample};
use serde_json::json;

const SECOND_NS: u64 = 1_000_000_000;
/// How long the other client asks before the flood comes, for comparison.
const QUIET_NS: u64 = 200_000_000;
/// Time between the other client's requests.
const PERIOD_NS: u64 = 20_000_000;
/// What has no answer after this long has none.
const PATIENCE_NS: u64 = 3 * SECOND_NS;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Each client keeps one request until it is answered, and sends others without waiting. One more client asks for status \
    and reset in turn, once before the flood and then in it.\n\nExit codes: 0 all of its requests were answered, 1 one was not, 69 no \
    daemon answers.\n\nExample:\n  admittance-lab flood --config cell.toml --clients 8 --rate-hz 10000 --seconds 12"
)]
pub(crate) struct Args {
    #[command(flatten)]
    target: Target,
    /// Clients that flood the daemon.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u64).range(1..=15))]
    clients: u64,
    /// Requests per second of all of them; they send fewer where the processors do not get to more.
    #[arg(long, default_value_t = 10_000, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    rate_hz: u64,
    /// How long.
    #[arg(long, default_value = "10", value_parser = seconds)]
    seconds: f64,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (0.1..=3600.0).contains(seconds));
    seconds.ok_or_else(|| "accepted: 0.1 to 3600".to_owned())
}

pub(crate) fn run(args: &Args) -> Outcome<Exit> {
    let (node, settings, opening) = args.target.connect()?;
    let other = client(&node, &settings)?;
    drop(opening);
    let quiet = ask_again_and_again(&other, monotonic_ns() + QUIET_NS);
    let (sent, end) = (AtomicU64::new(0), AtomicBool::new(false));
    let period = SECOND_NS * args.clients / args.rate_hz;
    let (flooded, failures) = std::thread::scope(|scope| {
        let flood = || flood(&settings, period.max(1), &sent, &end);
        let threads: Vec<_> = (0..args.clients).map(|_| scope.spawn(flood)).collect();
        let flooded = ask_again_and_again(&other, monotonic_ns() + (args.seconds * 1e9) as u64);
        end.store(true, Ordering::Relaxed);
        let ended = threads.into_iter().map(|thread| {
            let panicked = || Err((Exit::Internal, "a client's thread has panicked".to_owned()));
            thread.join().unwrap_or_else(|_| panicked())
        });
        let failures: Vec<_> = ended.filter_map(Result::err).collect();
        (flooded, failures)
    });
    if let Some(failure) = failures.into_iter().next() {
        return Err(failure);
    }
    let sent = sent.load(Ordering::Relaxed);
    let milliseconds = |waits: &Waits| waits.longest_ns as f64 * 1e-6;
    if args.json {
        let json = json!({
            "clients": args.clients,
            "requests": sent,
            "requests_per_second": (sent as f64 / args.seconds) as u64,
            "asked": flooded.asked,
            "unanswered": flooded.unanswered,
            "longest_wait_ms": milliseconds(&flooded),
            "longest_wait_before_ms": milliseconds(&quiet),
        });
        println!("{json}");
    } else {
        println!("{sent} requests of {} clients, {} per second", args.clients, (sent as f64 / args.seconds) as u64);
        println!(
            "another client: {} requests, {} without an answer, the longest wait {:.1} ms ({:.1} ms before the flood)",
            flooded.asked,
            flooded.unanswered,
            milliseconds(&flooded),
            milliseconds(&quiet)
        );
    }
    Ok(if flooded.unanswered == 0 { Exit::Ok } else { Exit::ClaimNotMet })
}

fn client(node: &Node, settings: &IpcSettings) -> Outcome<Client> {
    let service = services::request(node, &settings.instance, Access::Open)
        .map_err(|error| (Exit::Unavailable, error.to_string()))?;
    service.client().map_err(|error| (Exit::Unavailable, error.to_string()))
}

fn addressed(kind: RequestKind) -> RequestSample {
    let now = monotonic_ns();
    RequestSample { id: now, deadline_ns: now + PATIENCE_NS, ..request(kind) }
}

/// What a client that waits for its answers has seen.
#[derive(Debug, Default)]
struct Waits {
    asked: u64,
    unanswered: u64,
    longest_ns: u64,
}

/// Asks one thing after the other until `end` (ns).
fn ask_again_and_again(client: &Client, end: u64) -> Waits {
    let mut waits = Waits::default();
    while monotonic_ns() < end {
        let kind = if waits.asked % 2 == 0 { RequestKind::Status } else { RequestKind::Reset };
        let begun = monotonic_ns();
        waits.asked += 1;
        let pending = client.send_copy(addressed(kind));
        let mut is_answered = false;
        while !is_answered && monotonic_ns() < begun + PATIENCE_NS {
            is_answered = pending.as_ref().is_ok_and(|pending| matches!(pending.receive(), Ok(Some(_))));
            std::thread::sleep(Duration::from_micros(500));
        }
        waits.unanswered += u64::from(!is_answered);
        waits.longest_ns = waits.longest_ns.max(monotonic_ns() - begun);
        sleep_until_ns(begun + PERIOD_NS);
    }
    waits
}

/// One client of the flood: a request every `period` ns, two under way at most.
fn flood(settings: &IpcSettings, period: u64, sent: &AtomicU64, end: &AtomicBool) -> Outcome<()> {
    let node = settings.node("admittance-lab flood").map_err(|error| (Exit::Unavailable, error.to_string()))?;
    let client = client(&node, settings)?;
    let (mut kept, mut kept_since) = (None, 0);
    let mut next = monotonic_ns();
    while !end.load(Ordering::Relaxed) {
        let now = monotonic_ns();
        let is_over = kept.as_ref().is_none_or(|pending: &ipc_types::PendingResponse| {
            matches!(pending.receive(), Ok(Some(_))) || now > kept_since + PATIENCE_NS
        });
        let request = client.send_copy(addressed(RequestKind::Reset)).ok();
        sent.fetch_add(u64::from(request.is_some()), Ordering::Relaxed);
        if is_over {
            (kept, kept_since) = (request, now);
        }
        // A request that is not kept is given up at once: the daemon sees some of them all the same.
        next += period;
        if next > now {
            sleep_until_ns(next);
        } else {
            next = now;
        }
    }
    Ok(())
}
