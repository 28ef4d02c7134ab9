//! `admittancectl record`: the daemon's records into a file. It only listens: neither a slow disk
//! nor a full one reaches the daemon.

use std::io::{BufWriter, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ipc_types::services::{self, Access};
use ipc_types::{IpcSettings, Node, RecordKind, RecordSample, Subscriber, TruthSample};
use mcap::McapError;
use time::OffsetDateTime;

use crate::Exit;
use crate::recording::{RecordingWriter, cause, create};
use crate::target::Target;
use crate::turn::{TURN, waiting};

/// Time between two reads: far below what the service's buffer holds.
const POLL: Duration = Duration::from_millis(5);
/// Longest time between two chunks: what a kill may lose.
const CHUNK: Duration = Duration::from_millis(500);
/// Without a record for so long the daemon is gone: it makes one per cycle, and at least one a
/// second without samples.
const SILENT: Duration = Duration::from_secs(3);
/// Recordings of the service's user: `StateDirectory=` of its unit.
const STATE_DIRECTORY: &str = "/var/lib/admittanced";
/// Between two looks for a plant.
const TRUTH_LOOK: Duration = Duration::from_millis(100);

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Ctrl-C ends the recording in order; a kill loses the last second at most. Channels: /state, /command, /cycle, and \
    /truth of plant-sim. Foxglove and PlotJuggler open the file.\n\nExit codes: 0 recorded, 64 usage, 66 no configuration, 69 no \
    daemon, 73 FILE cannot be created, 74 writing failed.\n\nExamples:\n  runuser -u admittanced -- admittancectl record --instance cell-3\n  \
    admittancectl record contact.mcap --config cell.toml --seconds 30"
)]
/// The recorder's arguments.
pub struct Args {
    /// The recording; it must not exist yet. INSTANCE-TIME.mcap (UTC) when absent: in
    /// /var/lib/admittanced for the service's user, for others in the present directory.
    file: Option<PathBuf>,
    #[command(flatten)]
    target: Target,
    /// End after this many seconds; on Ctrl-C when absent.
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<Duration>,
    /// Replace FILE if it exists.
    #[arg(long)]
    overwrite: bool,
}

fn seconds(text: &str) -> Result<Duration, String> {
    let accepted = "accepted: a number of seconds above 0, such as 30";
    let seconds: f64 = text.parse().map_err(|_| accepted.to_owned())?;
    if seconds > 0.0 {
        Duration::try_from_secs_f64(seconds).map_err(|_| accepted.to_owned())
    } else {
        Err(accepted.to_owned())
    }
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    let config_path = args.target.config_path()?;
    let (node, settings, opening) = args.target.connect()?;
    let configuration = read_configuration(&config_path)?;
    let unavailable = |why: String| (Exit::Unavailable, why);
    let service =
        services::record(&node, &settings.instance, Access::Open).map_err(|error| unavailable(error.to_string()))?;
    let records = service.subscriber().map_err(|error| unavailable(error.to_string()))?;
    drop(opening);
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&interrupted))
            .map_err(|error| unavailable(format!("signal handlers: {error}")))?;
    }
    let path = match &args.file {
        Some(path) => path.clone(),
        None => default_path(Path::new(STATE_DIRECTORY), settings.instance.as_str(), OffsetDateTime::now_utc()),
    };
    let file = create(&path, args.overwrite)?;
    let failed = |error: McapError| (Exit::IoError, failure(&path, error));
    let writer =
        RecordingWriter::new(BufWriter::new(file), settings.instance.as_str(), &configuration).map_err(failed)?;
    eprintln!("recording admittanced/{} into {}", settings.instance, path.display());
    let mut recorder = Recorder { writer, config_path, tally: Tally::default() };
    let until = args.seconds.map(|seconds| Instant::now() + seconds);
    let is_over = || interrupted.load(Ordering::Relaxed) || until.is_some_and(|until| Instant::now() >= until);
    recorder.listen(&node, &settings, &records, is_over).map_err(failed)?;
    recorder.writer.finish().map_err(failed)?;
    println!("{}", recorder.tally.sentence());
    Ok(Exit::Ok)
}

fn read_configuration(path: &Path) -> Result<String, (Exit, String)> {
    std::fs::read_to_string(path).map_err(|error| (Exit::NoInput, format!("{}: {error}", path.display())))
}

/// Where a recording goes that was given no name.
fn default_path(state_directory: &Path, instance: &str, now: OffsetDateTime) -> PathBuf {
    let (month, day) = (u8::from(now.month()), now.day());
    let (hour, minute, second) = now.to_hms();
    let name = format!("{instance}-{}{month:02}{day:02}T{hour:02}{minute:02}{second:02}Z.mcap", now.year());
    // SAFETY: geteuid takes nothing, cannot fail and touches no memory.
    let user = unsafe { libc::geteuid() };
    let is_own = std::fs::metadata(state_directory).is_ok_and(|found| found.is_dir() && found.uid() == user);
    if is_own { state_directory.join(name) } else { PathBuf::from(name) }
}

/// What went wrong, and what is left.
fn failure(path: &Path, error: McapError) -> String {
    format!("{}: {}; what was written until a second before is readable", path.display(), cause(error))
}

struct Recorder<W: Write> {
    writer: RecordingWriter<W>,
    config_path: PathBuf,
    tally: Tally,
}

impl<W: Write> Recorder<W> {
    fn listen(
        &mut self,
        node: &Node,
        settings: &IpcSettings,
        records: &Subscriber<RecordSample>,
        is_over: impl Fn() -> bool,
    ) -> Result<(), McapError> {
        let mut truths: Option<Subscriber<TruthSample>> = None;
        let (mut flushed, mut looked) = (Instant::now(), None::<Instant>);
        let (mut heard, mut is_silent) = (Instant::now(), false);
        // Turns that are left once it is over: so much may have come before, and is still written.
        let mut left: Option<usize> = None;
        loop {
            if left.is_none() && is_over() {
                left = Some(services::RECORD.qos.subscriber_max_buffer_size.div_ceil(TURN));
            }
            let mut taken = 0;
            for record in waiting(records) {
                self.take(&record)?;
                (heard, is_silent) = (Instant::now(), false);
                taken += 1;
            }
            let mut is_full = taken == TURN;
            if !is_silent && heard.elapsed() >= SILENT {
                is_silent = true;
                eprintln!("no record for {} s: is admittanced running? Waiting for it", SILENT.as_secs());
            }
            if truths.is_none() && looked.is_none_or(|looked| looked.elapsed() >= TRUTH_LOOK) {
                // There is none on a real robot.
                looked = Some(Instant::now());
                let service = services::truth(node, &settings.instance, Access::Open).ok();
                truths = service.and_then(|service| service.subscriber().ok());
            }
            if let Some(truths) = &truths {
                let mut taken = 0;
                for truth in waiting(truths) {
                    self.writer.truth(&truth)?;
                    taken += 1;
                }
                is_full |= taken == TURN;
            }
            if flushed.elapsed() >= CHUNK {
                self.writer.flush()?;
                flushed = Instant::now();
            }
            if let Some(left) = &mut left {
                *left -= 1;
                if *left == 0 || !is_full {
                    return Ok(());
                }
            }
            if !is_full {
                std::thread::sleep(POLL);
            }
        }
    }

    fn take(&mut self, record: &RecordSample) -> Result<(), McapError> {
        if let Some(remark) = self.tally.add(record) {
            eprintln!("{remark}");
        }
        self.writer.record(record)?;
        if record.kind == RecordKind::Replaced.code() && record.done == 1 {
            match std::fs::read_to_string(&self.config_path) {
                Ok(text) => self.writer.configuration(record.sequence, &text)?,
                Err(error) => {
                    eprintln!("the new configuration is not in the recording: {}: {error}", self.config_path.display())
                }
            }
        }
        Ok(())
    }
}

/// What was recorded, and what was not.
#[derive(Debug, Default)]
struct Tally {
    records: u64,
    gaps: u64,
    lost: u64,
    last: Option<(u64, u64)>,
}

impl Tally {
    /// Counts a record; returns what a person should know about it.
    fn add(&mut self, record: &RecordSample) -> Option<String> {
        self.records += 1;
        let (boot_id, sequence) = (record.boot_id, record.sequence);
        let (last_boot, last) = self.last.replace((boot_id, sequence))?;
        if last_boot != boot_id {
            return Some(format!("admittanced has restarted: its records begin anew with {sequence}"));
        }
        let lost = sequence.saturating_sub(last.saturating_add(1));
        if lost == 0 {
            return None;
        }
        self.gaps += 1;
        self.lost = self.lost.saturating_add(lost);
        Some(format!("gap: {lost} records before record {sequence} came too fast for this process or the daemon"))
    }

    fn sentence(&self) -> String {
        format!("{} records; gaps: {}, records lost in them: {}", self.records, self.gaps, self.lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_counted_and_told_apart_from_a_restart() {
        let mut tally = Tally::default();
        let mut add = |boot_id, sequence| tally.add(&RecordSample { boot_id, sequence, ..RecordSample::zeroed() });
        assert_eq!(add(1, 57), None);
        assert_eq!(add(1, 58), None);
        assert!(add(1, 62).expect("a gap").contains("3 records before record 62"));
        assert!(add(2, 1).expect("a restart").contains("restarted"));
        assert_eq!(add(2, 2), None);
        assert_eq!(tally.sentence(), "5 records; gaps: 1, records lost in them: 3");
    }

    #[test]
    fn without_a_name_it_goes_where_this_user_may_write() {
        let own = tempfile::tempdir().expect("a directory");
        let now = OffsetDateTime::from_unix_timestamp(1_763_868_411).expect("an instant");
        let name = "cell-3-20251123T032651Z.mcap";
        assert_eq!(default_path(own.path(), "cell-3", now), own.path().join(name));
        assert_eq!(default_path(Path::new("/no/such"), "cell-3", now), Path::new(name));
    }

    #[test]
    fn seconds_are_above_zero() {
        assert_eq!(seconds("1.5"), Ok(Duration::from_millis(1500)));
        for text in ["0", "-1", "x", "inf", "NaN"] {
            assert!(seconds(text).is_err_and(|why| why.contains("accepted")), "{text}");
        }
    }
}
