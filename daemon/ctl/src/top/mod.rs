//! `admittancectl top`: a running daemon in the terminal, several times a second.

mod keys;
mod view;

use std::io::{self, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ipc_types::{DiagnosticsSample, Subscriber};
use ratatui::DefaultTerminal;

use crate::Exit;
use crate::diagnostics::{first, mode_text, sample_age_ns, subscribe};
use crate::target::Target;
use view::View;

/// Between two looks at keys and diagnostics.
const TURN: Duration = Duration::from_millis(50);
/// After this long without diagnostics the daemon is shown as silent.
const SILENT: Duration = Duration::from_secs(1);
/// Changes of mode that are kept.
const CHANGES: usize = 100;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Keys: q, Esc or Ctrl-C end it. Works over ssh. For scripts: admittancectl status --json.\n\nExit codes: 0 ended, 64 \
    usage or no terminal, 66 no configuration, 69 no daemon answers.\n\nExamples:\n  admittancectl top --instance cell-3\n  \
    admittancectl top --config cell.toml"
)]
pub(crate) struct Args {
    #[command(flatten)]
    target: Target,
}

/// What is shown.
pub(crate) struct Watched {
    /// Name of the daemon.
    instance: String,
    sample: DiagnosticsSample,
    heard: Instant,
    /// Changes of mode since top began: time since the start of the daemon in ns, and the mode.
    changes: Vec<(u64, String)>,
}

impl Watched {
    fn new(instance: String, sample: DiagnosticsSample) -> Self {
        let changes = vec![(sample.uptime_ns, mode_text(sample.mode, sample.stop_reason))];
        Self { instance, sample, heard: Instant::now(), changes }
    }

    fn take(&mut self, sample: &DiagnosticsSample) {
        if sample.boot_id != self.sample.boot_id {
            self.changes.push((sample.uptime_ns, "admittanced has restarted".to_owned()));
        }
        let mode = mode_text(sample.mode, sample.stop_reason);
        if self.changes.last().is_none_or(|(_, last)| *last != mode) {
            self.changes.push((sample.uptime_ns, mode));
        }
        if self.changes.len() > CHANGES {
            self.changes.remove(0);
        }
        (self.sample, self.heard) = (*sample, Instant::now());
    }

    /// How old force and position are that the law acts on; `None` before the first sample. Stamps are of the daemon's
    /// machine, which may be another one: what has gone by since it said so is counted here.
    fn sample_age(&self) -> Option<Duration> {
        sample_age_ns(&self.sample).map(|age_ns| Duration::from_nanos(age_ns) + self.heard.elapsed())
    }

    /// How long the daemon has been silent, if that is long.
    fn silent_for(&self) -> Option<Duration> {
        Some(self.heard.elapsed()).filter(|silence| *silence >= SILENT)
    }
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    if !(io::stdout().is_terminal() && io::stdin().is_terminal()) {
        return Err((
            Exit::Usage,
            "top needs a terminal for input and output; elsewhere: admittancectl status [--json]".to_owned(),
        ));
    }
    let (node, settings, opening) = args.target.connect()?;
    let subscriber = subscribe(&node, &settings)?;
    drop(opening);
    let sample = first(&subscriber, &settings)?;
    let watched = Watched::new(settings.instance.as_str().to_owned(), sample);
    let ended = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM, signal_hook::consts::SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&ended))
            .map_err(|error| (Exit::Unavailable, format!("signal handlers: {error}")))?;
    }
    let failed = |error: io::Error| (Exit::Unavailable, format!("the terminal: {error}"));
    // With a panic hook that gives the terminal back.
    let mut terminal = ratatui::try_init().map_err(failed)?;
    watch(&mut terminal, &subscriber, watched, &ended);
    // A terminal that is gone takes nothing back, and what complains of that on it panics.
    let _ = ratatui::try_restore();
    if terminal.show_cursor().is_err() {
        std::mem::forget(terminal);
    }
    Ok(Exit::Ok)
}

fn watch(
    terminal: &mut DefaultTerminal,
    subscriber: &Subscriber<DiagnosticsSample>,
    mut watched: Watched,
    ended: &AtomicBool,
) {
    let mut stdin = io::stdin().lock();
    while !ended.load(Ordering::Relaxed) {
        while let Ok(Some(sample)) = subscriber.receive() {
            watched.take(&sample);
        }
        let drawn = terminal.draw(|frame| frame.render_widget(View(&watched), frame.area()));
        // Nothing can be drawn on a terminal that is gone.
        if drawn.is_err() || keys::wait_for_end(&mut stdin, TURN) {
            return;
        }
    }
}
