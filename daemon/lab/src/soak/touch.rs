//! One touch: a plant process from start to end, what is done to it and to the daemon meanwhile,
//! and whether there is control again afterwards.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use admittance_host::clock::monotonic_ns;
use ipc_types::{Mode, Node, RequestKind, Subscriber, TruthSample};

use super::files::{SETTLE_S, config, scenario};
use super::injection::{Fault, PRESSES_S, RETREATS_S, STANDS_S, Touch};
use super::outside::Held;
use super::pace::Pace;
use super::recording::Recording;
use super::tally::{Tally, Window};
use admittancectl::session::Session;
use admittancectl::{Exit, request};

/// Between two looks at the truth.
const POLL: Duration = Duration::from_millis(2);
/// How long the daemon may take to serve requests.
const PATIENCE: Duration = Duration::from_secs(10);
/// Between a SIGKILL of the daemon and its next start.
const RESTART: Duration = Duration::from_millis(40);
/// After a fault has ended, what is seen may still be its doing, ns.
pub(crate) const GRACE: u64 = 150_000_000;

type Done<T> = Result<T, (Exit, String)>;

/// Where touches take place: the processes and the plant's truth.
pub(crate) struct Stage {
    session: Session,
    node: Node,
    truths: Subscriber<TruthSample>,
    config: PathBuf,
    recording: Recording,
    /// Touches of the daemon that runs, and its memory after the first ones, KiB.
    touches: u32,
    memory: Option<u64>,
}

/// A fault that is under way while a plant runs.
#[derive(Default)]
struct UnderWay {
    /// When it began; and when it was over, or began, ns of CLOCK_MONOTONIC.
    since: Option<(Instant, u64)>,
    /// The process goes on, or the next one has been started.
    is_over: bool,
    /// A daemon that starts has been killed again.
    is_killed_again: bool,
    /// What attacks from outside.
    held: Option<Held>,
    /// When the motion begins, ns of CLOCK_MONOTONIC.
    motion: Option<u64>,
}

impl UnderWay {
    /// When what is seen may be the fault's doing.
    fn window(&self, touch: &Touch, motion: u64) -> Window {
        let planned = motion + (touch.at_s * 1e9) as u64;
        let end = self.since.map_or(planned + (touch.duration_s * 1e9) as u64, |(_, over)| over);
        (planned.min(end), end + GRACE)
    }
}

impl Stage {
    /// A daemon in a session of its own, whose observer runs already.
    pub(crate) fn new(mut session: Session, config: PathBuf) -> Done<Self> {
        start_daemon(&mut session, &config)?;
        let unavailable = |error: &dyn std::fmt::Display| (Exit::Unavailable, error.to_string());
        let node = session.settings().node("soak").map_err(|error| unavailable(&error))?;
        let instance = &session.settings().instance;
        let service = ipc_types::services::truth(&node, instance, ipc_types::services::Access::Open)
            .map_err(|error| unavailable(&error))?;
        let truths = service.subscriber().map_err(|error| unavailable(&error))?;
        // Before it serves requests, SIGHUP would end it.
        let give_up = Instant::now() + PATIENCE;
        while let Err(why) = request::ask(&node, session.settings(), request::request(RequestKind::Status)) {
            if let Some(status) = session.exit_status("daemon") {
                return Err(session.failure("daemon", status));
            }
            if Instant::now() > give_up {
                return Err(why);
            }
            std::thread::sleep(POLL);
        }
        let recording = Recording::begin(&mut session, &config)?;
        Ok(Self { session, node, truths, config, recording, touches: 0, memory: None })
    }

    /// Touches once, as drawn, and once more without a fault where the plant was killed.
    pub(crate) fn touch(&mut self, touch: &Touch, tally: &mut Tally) -> Done<()> {
        tally.touch();
        self.write_config(&config(touch.stiffness_n_m)?)?;
        self.signal("daemon", libc::SIGHUP);
        let mut ended = self.run(touch, Some(touch.fault), tally)?;
        if matches!(touch.fault, Fault::PlantKilled | Fault::PlantTerminated) {
            ended = self.run(touch, None, tally)?;
        }
        match ended {
            Ok(()) => tally.survived(touch.fault),
            Err(how) => tally.lost(touch, &how),
        }
        if touch.fault == Fault::RecorderKilled {
            let next = self.recording.next(&mut self.session, &self.config)?;
            std::mem::replace(&mut self.recording, next).check(tally, false)?;
        }
        self.look_at_memory(tally);
        Ok(())
    }

    /// Ends everything; what is then left of shared memory.
    pub(crate) fn end(mut self, tally: &mut Tally) -> Done<(Session, Vec<PathBuf>)> {
        self.session.end("recorder")?;
        self.recording.check(tally, true)?;
        self.session.end("daemon")?;
        let prefix = self.session.settings().prefix.clone();
        let Self { mut session, node, truths, .. } = self;
        drop((truths, node));
        session.end("observer")?;
        let left = ipc_types::shared_memory_files(&prefix).map_err(|error| (Exit::Unavailable, error.to_string()))?;
        Ok((session, left))
    }

    fn write_config(&self, text: &str) -> Done<()> {
        // It may have been made something else.
        let _ = std::fs::remove_file(&self.config);
        self.session.write("daemon.toml", text).map(drop)
    }

    fn signal(&mut self, name: &str, signal: i32) {
        if let Some(child) = self.session.child(name) {
            // SAFETY: kill takes numbers; the child is not reaped, so that its id is still its own.
            unsafe { libc::kill(child.id() as libc::pid_t, signal) };
        }
    }

    /// Runs a plant to its end with this fault. The error says why there is no control afterwards.
    fn run(&mut self, touch: &Touch, fault: Option<Fault>, tally: &mut Tally) -> Done<Result<(), String>> {
        let file = self.session.write("scenario.toml", &scenario(touch, fault)?)?;
        while let Ok(Some(_)) = self.truths.receive() {}
        self.session.start("plant", "role-plant", &[OsStr::new("--scenario"), file.as_os_str()])?;
        let (mut now, mut time) = (UnderWay::default(), f64::NEG_INFINITY);
        let (mut was_reset, mut is_ending, mut control) = (false, false, Err("the motion did not end".to_owned()));
        let mut pace = Pace::new();
        loop {
            pace.look(time);
            let ended = self.session.exit_status("plant");
            while let Ok(Some(truth)) = self.truths.receive() {
                time = truth.scenario_time_s;
                now.motion.get_or_insert(truth.stamp_ns.wrapping_add_signed((-time * 1e9) as i64));
            }
            // An earlier touch may have stopped the arm.
            if !was_reset && time > -SETTLE_S / 2.0 && time < 0.0 {
                was_reset = true;
                // Whether it helped is checked at the end.
                let _ = pace.time(|| self.control());
            }
            if let Some(fault) = fault {
                self.go_on(touch, fault, time, &mut now)?;
            }
            if control.is_err() && time > PRESSES_S + RETREATS_S + 0.05 {
                control = pace.time(|| self.control());
            }
            if control.is_ok() && !is_ending && time > PRESSES_S + RETREATS_S + STANDS_S {
                is_ending = true;
                self.signal("plant", libc::SIGTERM);
            }
            if let Some(status) = ended {
                if let (Some(fault), Some(motion)) = (fault, now.motion) {
                    tally.injected(fault, touch.in_contact, now.window(touch, motion));
                }
                let failure = self.session.failure("plant", status).1;
                self.session.forget("plant");
                let control = control.map_err(|how| format!("{how} ({pace})"));
                return Ok(if status.success() { control } else { Err(failure) });
            }
            let is_killed = fault.is_some_and(Fault::ends_daemon);
            if let Some(status) = self.session.exit_status("daemon").filter(|_| !is_killed) {
                return Err(self.session.failure("daemon", status));
            }
            std::thread::sleep(POLL);
        }
    }

    /// Begins the fault when it is time, and ends it.
    fn go_on(&mut self, touch: &Touch, fault: Fault, time: f64, now: &mut UnderWay) -> Done<()> {
        if now.is_over || matches!(fault, Fault::Scripted(_)) {
            return Ok(());
        }
        let Some((since, _)) = now.since else {
            if time < touch.at_s {
                return Ok(());
            }
            now.since = Some((Instant::now(), monotonic_ns()));
            return self.begin(touch, fault, now);
        };
        let lasted = since.elapsed() >= Duration::from_secs_f64(touch.duration_s);
        match fault {
            Fault::DaemonStopped if lasted => self.signal("daemon", libc::SIGCONT),
            Fault::PlantStopped if lasted => self.signal("plant", libc::SIGCONT),
            Fault::DaemonKilled if since.elapsed() >= RESTART => self.restart()?,
            Fault::DaemonKilledAtStart if lasted && !now.is_killed_again => {
                now.is_killed_again = true;
                self.session.forget("daemon");
                return Ok(());
            }
            Fault::DaemonKilledAtStart if since.elapsed() >= 2 * RESTART => self.restart()?,
            Fault::DaemonTerminated => match self.session.exit_status("daemon") {
                None => return Ok(()),
                Some(status) if status.success() => {
                    self.session.forget("daemon");
                    self.restart()?;
                }
                Some(status) => return Err(self.session.failure("daemon", status)),
            },
            Fault::SecondDaemon => {
                if !second_is_refused(&mut self.session)? {
                    return Ok(());
                }
            }
            Fault::Outside(_) => {
                let Some(held) = &mut now.held else { return Ok(()) };
                let is_done = held.go_on(&mut self.session)?;
                if !(lasted && is_done) {
                    return Ok(());
                }
                now.held.take().map_or(Ok(()), |held| held.end(&mut self.session))?;
                self.write_config(&config(touch.stiffness_n_m)?)?;
            }
            Fault::PlantKilled
            | Fault::PlantTerminated
            | Fault::RecorderKilled
            | Fault::GarbageReloaded
            | Fault::Scripted(_) => {}
            _ => return Ok(()),
        }
        now.is_over = true;
        now.since = Some((since, monotonic_ns()));
        Ok(())
    }

    fn begin(&mut self, touch: &Touch, fault: Fault, now: &mut UnderWay) -> Done<()> {
        match fault {
            Fault::DaemonStopped => self.signal("daemon", libc::SIGSTOP),
            Fault::DaemonKilled => self.session.forget("daemon"),
            Fault::DaemonKilledAtStart => {
                self.session.forget("daemon");
                self.restart()?;
            }
            Fault::DaemonTerminated => self.signal("daemon", libc::SIGTERM),
            Fault::PlantStopped => self.signal("plant", libc::SIGSTOP),
            Fault::PlantKilled => self.signal("plant", libc::SIGKILL),
            Fault::PlantTerminated => self.signal("plant", libc::SIGTERM),
            Fault::RecorderKilled => self.session.forget("recorder"),
            Fault::SecondDaemon => {
                let config = self.config.clone();
                self.session.start("second", "role-daemon", &[OsStr::new("--config"), config.as_os_str()])?;
            }
            Fault::GarbageReloaded => {
                self.write_config("control = \"garbage\"\n[[")?;
                self.signal("daemon", libc::SIGHUP);
            }
            Fault::Outside(kind) => now.held = Some(Held::begin(kind, touch, &self.config, &mut self.session)?),
            Fault::Scripted(_) => {}
        }
        Ok(())
    }

    fn restart(&mut self) -> Done<()> {
        (self.touches, self.memory) = (0, None);
        start_daemon(&mut self.session, &self.config)
    }

    /// Whether the daemon controls; if it is stopped, it is reset first, and asked again later.
    fn control(&mut self) -> Result<(), String> {
        let settings = self.session.settings();
        let ask = |kind| request::ask(&self.node, settings, request::request(kind)).map_err(|(_, why)| why);
        let status = ask(RequestKind::Status)?;
        match Mode::from_code(status.mode) {
            Some(Mode::Free) => Ok(()),
            Some(Mode::Stopped) => Err(format!("{}; {}", status.text(), ask(RequestKind::Reset)?.text())),
            // Somebody has asked for that.
            _ if status.enabled == 0 => Err(format!("{}; {}", status.text(), ask(RequestKind::Enable)?.text())),
            _ => Err(status.text().into_owned()),
        }
    }

    /// The daemon's memory must not grow from touch to touch.
    fn look_at_memory(&mut self, tally: &mut Tally) {
        /// Touches until everything has been used once.
        const FIRST: u32 = 4;
        /// Tolerance for the kernel's accounting, KiB.
        const SLACK: u64 = 1024;
        let Some(id) = self.session.child("daemon").map(|child| child.id()) else { return };
        let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
        let resident =
            status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.split_whitespace().next()?.parse().ok());
        let Some(resident) = resident else { return };
        self.touches += 1;
        match self.memory {
            None if self.touches >= FIRST => self.memory = Some(resident),
            Some(first) if resident > first + SLACK => {
                tally.broken("memory_stays", format!("daemon at {resident} KiB, {first} KiB after {FIRST} touches"));
                self.memory = Some(resident);
            }
            _ => {}
        }
    }
}

/// Whether a second process of the instance has ended as it should.
pub(super) fn second_is_refused(session: &mut Session) -> Done<bool> {
    match session.exit_status("second") {
        None => Ok(false),
        Some(status) if status.code().and_then(Exit::from_code) == Some(Exit::Unavailable) => {
            session.forget("second");
            Ok(true)
        }
        Some(status) => Err(session.failure("second", status)),
    }
}

fn start_daemon(session: &mut Session, config: &std::path::Path) -> Done<()> {
    session.start("daemon", "role-daemon", &[OsStr::new("--config"), config.as_os_str()])
}
