//! What ends a motion besides its time: a contact, a daemon that stops or is gone.

use std::time::{Duration, Instant};

use ipc_types::services::{self, Access};
use ipc_types::{DiagnosticsSample, IpcSettings, Mode, Node, RecordSample, Subscriber};

use crate::Exit;
use crate::diagnostics::{first, mode_text, subscribe};

/// Between two looks, ns: the daemon's service thread, whose word it is, turns every 5 ms.
pub(super) const LOOK_NS: u64 = 2_000_000;
/// After so long without a word of the daemon it is taken for gone: it gives some several times a second.
const SILENT: Duration = Duration::from_millis(700);

/// Why a motion is over.
#[derive(Debug, PartialEq)]
pub(super) enum WhyOver {
    Time,
    Contact,
    Interrupted,
    /// The daemon has the arm no longer, with its mode and reason.
    Left(String),
    Restarted,
    Silent,
}

impl WhyOver {
    /// The exit code, and what a person is told.
    pub(super) fn said(self, until_contact: bool) -> (Exit, String) {
        match self {
            Self::Time if until_contact => (Exit::ClaimNotMet, "no contact in that time".to_owned()),
            Self::Time => (Exit::Ok, "the time is over".to_owned()),
            Self::Contact => (Exit::Ok, "contact".to_owned()),
            Self::Interrupted => (Exit::ClaimNotMet, "ended by a signal".to_owned()),
            Self::Left(mode) => (Exit::ClaimNotMet, format!("the daemon says {mode}")),
            Self::Restarted => (Exit::ClaimNotMet, "admittanced has restarted".to_owned()),
            Self::Silent => {
                (Exit::Unavailable, "admittanced is silent: ended, or stopped by a debugger or SIGSTOP?".to_owned())
            }
        }
    }
}

/// The daemon, as its diagnostics have it, and where a contact ends the motion each of its cycles.
pub(super) struct Watch {
    diagnostics: Subscriber<DiagnosticsSample>,
    newest: DiagnosticsSample,
    heard: Instant,
    records: Option<Subscriber<RecordSample>>,
    /// Whether the daemon had the arm when it was looked at last.
    had: bool,
}

impl Watch {
    /// The daemon is there, and its words are awaited.
    ///
    /// # Errors
    /// 69 when it is not.
    pub(super) fn begin(node: &Node, settings: &IpcSettings, until_contact: bool) -> Result<Self, (Exit, String)> {
        let unavailable = |why: String| (Exit::Unavailable, why);
        let records = if until_contact {
            let service = services::record(node, &settings.instance, Access::Open);
            let service = service.map_err(|error| unavailable(error.to_string()))?;
            Some(service.subscriber().map_err(|error| unavailable(format!("--until-contact reads records: {error}")))?)
        } else {
            None
        };
        let diagnostics = subscribe(node, settings)?;
        let newest = first(&diagnostics, settings)?;
        let had = has_the_arm(newest.mode);
        Ok(Self { diagnostics, newest, heard: Instant::now(), records, had })
    }

    /// Why a motion cannot begin.
    pub(super) fn refuses(&self) -> Option<String> {
        let mode = mode_text(self.newest.mode, self.newest.stop_reason);
        match (&self.records, Mode::from_code(self.newest.mode)) {
            // Nothing would limit the force.
            (None, Some(Mode::Idle) | None) => {
                Some(format!("the daemon says {mode}; accepted: every other mode (admittancectl enable)"))
            }
            (None, Some(_)) | (Some(_), Some(Mode::Free)) => None,
            (Some(_), _) => Some(format!("the daemon says {mode}; accepted with --until-contact: Free")),
        }
    }

    /// Why the motion is over; `None` while it goes on.
    pub(super) fn over(&mut self) -> Option<WhyOver> {
        while let Some(Ok(Some(record))) = self.records.as_ref().map(|records| records.receive()) {
            if record.boot_id == self.newest.boot_id && record.command.mode == Mode::Contact.code() {
                return Some(WhyOver::Contact);
            }
        }
        while let Ok(Some(sample)) = self.diagnostics.receive() {
            let was = std::mem::replace(&mut self.newest, *sample);
            self.heard = Instant::now();
            if was.boot_id != sample.boot_id {
                return Some(WhyOver::Restarted);
            }
            // A stopped arm may be led out of the surface; one that stops may not be led on.
            if std::mem::replace(&mut self.had, has_the_arm(sample.mode)) && !self.had {
                return Some(WhyOver::Left(mode_text(sample.mode, sample.stop_reason)));
            }
        }
        (self.heard.elapsed() >= SILENT).then_some(WhyOver::Silent)
    }
}

fn has_the_arm(mode: u32) -> bool {
    matches!(Mode::from_code(mode), Some(Mode::Free | Mode::Contact))
}
