//! The daemon's diagnostics: subscribing to them, and their words for `status` and `top`.

use std::time::Duration;

use admittance_core::quantities::AXIS_NAMES;
use admittance_host::clock::monotonic_ns;
use admittance_host::config::{fixed, percent};
use ipc_types::services::{self, Access};
use ipc_types::{DiagnosticsSample, IpcSettings, Mode, Node, QUANTILES, StopReason, Subscriber, TASK_AXES, Verdict};

use crate::Exit;

/// How long to wait for a sample of a daemon that sends several a second.
const PATIENCE: Duration = Duration::from_secs(2);

/// A subscriber of the daemon's diagnostics.
pub(crate) fn subscribe(node: &Node, settings: &IpcSettings) -> Result<Subscriber<DiagnosticsSample>, (Exit, String)> {
    let unavailable = |why: String| (Exit::Unavailable, why);
    let service = services::diagnostics(node, &settings.instance, Access::Open)
        .map_err(|error| unavailable(error.to_string()))?;
    service.subscriber().map_err(|error| unavailable(error.to_string()))
}

/// The first sample that arrives.
///
/// # Errors
/// 69 when none does.
pub(crate) fn first(
    subscriber: &Subscriber<DiagnosticsSample>,
    settings: &IpcSettings,
) -> Result<DiagnosticsSample, (Exit, String)> {
    let give_up = monotonic_ns() + PATIENCE.as_nanos() as u64;
    while monotonic_ns() < give_up {
        match subscriber.receive() {
            Ok(Some(sample)) => return Ok(*sample),
            Ok(None) => std::thread::sleep(Duration::from_millis(5)),
            Err(error) => return Err((Exit::Unavailable, format!("the diagnostics cannot be read: {error:?}"))),
        }
    }
    Err((
        Exit::Unavailable,
        format!(
            "admittanced/{} sent no diagnostics within {} s: is it running, or stopped by a debugger or SIGSTOP?",
            settings.instance,
            PATIENCE.as_secs()
        ),
    ))
}

/// Of each latency its name, and its quantiles since the start and in the last second, in ns.
pub(crate) fn latencies(sample: &DiagnosticsSample) -> [(&'static str, [u64; QUANTILES], [u64; QUANTILES]); 3] {
    [
        ("wake-up", sample.wake_up_ns, sample.wake_up_last_second_ns),
        ("compute", sample.compute_ns, sample.compute_last_second_ns),
        ("answer", sample.answer_ns, sample.answer_last_second_ns),
    ]
}

/// How old the last accepted state sample was when this was published, in ns; `None` before the
/// first.
pub(crate) fn sample_age_ns(sample: &DiagnosticsSample) -> Option<u64> {
    (sample.state_stamp_ns > 0).then(|| sample.stamp_ns.saturating_sub(sample.state_stamp_ns))
}

/// Values of the axes with three decimals.
pub(crate) fn axes_text(values: &[f64; TASK_AXES]) -> String {
    values.map(|value| fixed(value, 3)).join(" ")
}

/// "Stopped (Infeasible)".
pub(crate) fn mode_text(mode: u32, stop_reason: u32) -> String {
    let mode = Mode::name_of(mode);
    match stop_reason {
        StopReason::NONE => mode.to_owned(),
        code => format!("{mode} ({})", StopReason::name_of(code)),
    }
}

/// "feasible, 83.2 N to spare on y".
pub(crate) fn verdict_text(sample: &DiagnosticsSample) -> String {
    let axis = AXIS_NAMES.get(sample.verdict_axis as usize).unwrap_or(&"?");
    match Verdict::from_code(sample.verdict) {
        Some(Verdict::Feasible) => format!("feasible, {} N to spare on {axis}", fixed(sample.verdict_margin, 1)),
        Some(Verdict::Infeasible) => {
            format!(
                "infeasible, {} N missing on {axis} in {:.1} ms",
                fixed(-sample.verdict_margin, 1),
                sample.verdict_time_s * 1e3
            )
        }
        Some(Verdict::AtRisk) => {
            format!(
                "at risk ({} of what may be there), up to {} N above on {axis} in {:.1} ms",
                percent(sample.verdict_share),
                fixed(-sample.verdict_margin, 1),
                sample.verdict_time_s * 1e3
            )
        }
        Some(Verdict::None) | None => "no verdict".to_owned(),
    }
}
