//! The daemon's request service: asking and the answer's exit code.

mod change;
mod control;
mod status;
mod status_json;

use std::time::Duration;

use admittance_host::clock::monotonic_ns;
use ipc_types::services::{self, Access};
use ipc_types::{IpcSettings, Node, RequestKind, RequestSample, ResponseSample, ResponseStatus};

use crate::Exit;
use crate::target::Target;

pub(crate) use change::{SetEnvironmentArgs, SetForceLimitArgs, SetLawArgs, set_environment, set_force_limit, set_law};
pub(crate) use control::{
    DisableArgs, EnableArgs, ReloadArgs, ResetArgs, TareArgs, disable, enable, reload, reset, tare,
};
pub(crate) use status::{StatusArgs, status};

/// How long a request stays valid.
const DEADLINE: Duration = Duration::from_secs(2);
/// How much longer to wait for the answer.
const GRACE: Duration = Duration::from_secs(1);

/// A request of a kind, with nothing given.
pub fn request(kind: RequestKind) -> RequestSample {
    RequestSample { kind: kind.code(), ..RequestSample::zeroed() }
}

/// Sends the request, prints what was done or why it was refused, and returns the exit code.
fn tell(target: &Target, request: RequestSample) -> Result<Exit, (Exit, String)> {
    let (node, settings, opening) = target.connect()?;
    let response = ask(&node, &settings, request)?;
    drop(opening);
    println!("{}", response.text());
    Ok(if response.status == ResponseStatus::Done.code() { Exit::Ok } else { Exit::ClaimNotMet })
}

/// Asks the daemon, and waits for its answer.
pub fn ask(node: &Node, settings: &IpcSettings, request: RequestSample) -> Result<ResponseSample, (Exit, String)> {
    let unavailable = |why: String| (Exit::Unavailable, why);
    let service =
        services::request(node, &settings.instance, Access::Open).map_err(|error| unavailable(error.to_string()))?;
    let client = service.client().map_err(|error| unavailable(error.to_string()))?;
    let now = monotonic_ns();
    let deadline = now + DEADLINE.as_nanos() as u64;
    let request = RequestSample { id: now, deadline_ns: deadline, ..request };
    // The server sees a request only as long as its pending response is kept.
    let pending =
        client.send_copy(request).map_err(|error| unavailable(format!("the request was not sent: {error:?}")))?;
    while monotonic_ns() < deadline + GRACE.as_nanos() as u64 {
        match pending.receive() {
            Ok(Some(response)) if response.id == request.id => return Ok(*response),
            Ok(_) => std::thread::sleep(Duration::from_millis(1)),
            Err(error) => return Err(unavailable(format!("the response was lost: {error:?}"))),
        }
    }
    Err(unavailable(format!(
        "admittanced/{} did not answer within {} s: is it running, or stopped by a debugger or SIGSTOP? What was asked lapses \
         with its deadline",
        settings.instance,
        (DEADLINE + GRACE).as_secs()
    )))
}
