//! One touch: a plant process from start to end, what is done to it and to the daemon meanwhile,
//! and whether there is control again afterwards.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use admittance_host::clock::monotonic_ns;
use ipc_types::{Mode, Node, RequestKind, Subscriber, TruthSample};
use toml::{Table, Value};

use super::injection::{CONTACT_S, Fault, PRESSES_S, RETREATS_S, STANDS_S, Touch};
use super::recording::Recording;
use super::tally::{Tally, Window};
use admittancectl::demo::{CONTROLLERS, SCENARIO};
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
/// T_s in s, and what the daemon has of it for its answer: a busy machine is to disturb few
/// touches.
const SAMPLING_TIME_S: f64 = 0.004;
const ANSWER_BUDGET_S: f64 = 0.002;
/// Of the plant before its motion, s.
const SETTLE_S: f64 = 0.3;
/// The paper's surface, outward.
const NORMAL: [f64; 2] = [0.422_618_261_740_699_44, 0.906_307_787_036_649_9];
/// Speed of the retreat that the motion controller commands, m/s.
const RETREAT_M_S: f64 = 0.1;

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

/// A configuration of the daemon for surfaces of this stiffness, N/m.
pub(crate) fn config(stiffness: f64) -> Done<String> {
    let mut table = parsed(CONTROLLERS[3].config)?;
    let keys = [
        ("control", "sampling_time_s", SAMPLING_TIME_S),
        ("control", "command_delay_s", ANSWER_BUDGET_S),
        ("control", "answer_budget_s", ANSWER_BUDGET_S),
        ("control", "max_sample_age_s", 4.0 * SAMPLING_TIME_S),
        ("environment", "normal_stiffness_n_m", stiffness),
    ];
    keys.iter().for_each(|(section, key, value)| set(&mut table, section, key, *value));
    Ok(table.to_string())
}

/// What the plant plays: the touch, with this going wrong.
fn scenario(touch: &Touch, fault: Option<Fault>) -> Done<String> {
    let mut table = parsed(SCENARIO)?;
    let keys = [
        ("timing", "sampling_time_s", SAMPLING_TIME_S),
        ("timing", "command_delay_s", ANSWER_BUDGET_S),
        ("timing", "settle_s", SETTLE_S),
        ("start", "contact_time_s", CONTACT_S),
        ("start", "contact_phase", touch.contact_phase),
        ("surface", "stiffness_n_m", touch.stiffness_n_m),
    ];
    keys.iter().for_each(|(section, key, value)| set(&mut table, section, key, *value));
    let away = NORMAL.map(|n| n * RETREAT_M_S);
    let phases = [(PRESSES_S, [0.0, -touch.speed_m_s]), (RETREATS_S, away), (STANDS_S, [0.0, 0.0])];
    let phase = |(duration, twist): (f64, [f64; 2])| {
        let twist = Value::Array(twist.map(Value::Float).to_vec());
        Value::Table(Table::from_iter([("duration_s".to_owned(), duration.into()), ("twist".to_owned(), twist)]))
    };
    table.insert("motion".to_owned(), Value::Array(phases.map(phase).to_vec()));
    if let Some(Fault::Scripted(kind)) = fault {
        let fault = Table::from_iter([
            ("at_s".to_owned(), touch.at_s.into()),
            ("duration_s".to_owned(), touch.duration_s.into()),
            ("kind".to_owned(), kind.name().into()),
        ]);
        table.insert("fault".to_owned(), Value::Array(vec![Value::Table(fault)]));
    }
    Ok(table.to_string())
}

fn parsed(text: &str) -> Done<Table> {
    text.parse().map_err(|error: toml::de::Error| (Exit::Internal, error.to_string()))
}

fn set(table: &mut Table, section: &str, key: &str, value: f64) {
    if let Some(section) = table.get_mut(section).and_then(Value::as_table_mut) {
        section.insert(key.to_owned(), value.into());
    }
}

/// A fault that is under way while a plant runs.
#[derive(Debug, Default)]
struct UnderWay {
    /// When it began; and when it was over, or began, ns of CLOCK_MONOTONIC.
    since: Option<(Instant, u64)>,
    /// The process goes on, or the next one has been started.
    is_over: bool,
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
        if touch.fault == Fault::PlantKilled {
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
        let (mut was_reset, mut control) = (false, Err("the motion did not end".to_owned()));
        loop {
            let ended = self.session.exit_status("plant");
            while let Ok(Some(truth)) = self.truths.receive() {
                time = truth.scenario_time_s;
                now.motion.get_or_insert(truth.stamp_ns.wrapping_add_signed((-time * 1e9) as i64));
            }
            // An earlier touch may have stopped the arm.
            if !was_reset && time > -SETTLE_S / 2.0 && time < 0.0 {
                was_reset = true;
                // Whether it helped is checked at the end.
                let _ = self.control();
            }
            if let Some(fault) = fault {
                self.go_on(touch, fault, time, &mut now)?;
            }
            if control.is_err() && time > PRESSES_S + RETREATS_S + 0.05 {
                control = self.control();
            }
            if let Some(status) = ended {
                if let (Some(fault), Some(motion)) = (fault, now.motion) {
                    tally.injected(fault, touch.in_contact, now.window(touch, motion));
                }
                let failure = self.session.failure("plant", status).1;
                self.session.forget("plant");
                return Ok(if status.success() { control } else { Err(failure) });
            }
            let is_killed = fault == Some(Fault::DaemonKilled);
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
            match fault {
                Fault::DaemonStopped => self.signal("daemon", libc::SIGSTOP),
                Fault::DaemonKilled => self.session.forget("daemon"),
                Fault::PlantStopped => self.signal("plant", libc::SIGSTOP),
                Fault::PlantKilled => self.signal("plant", libc::SIGKILL),
                Fault::RecorderKilled => self.session.forget("recorder"),
                Fault::SecondDaemon => {
                    let config = self.config.clone();
                    self.session.start("second", "role-daemon", &[OsStr::new("--config"), config.as_os_str()])?;
                }
                Fault::GarbageReloaded => {
                    self.write_config("control = \"garbage\"\n[[")?;
                    self.signal("daemon", libc::SIGHUP);
                }
                Fault::Scripted(_) => {}
            }
            return Ok(());
        };
        let lasted = since.elapsed() >= Duration::from_secs_f64(touch.duration_s);
        match fault {
            Fault::DaemonStopped if lasted => self.signal("daemon", libc::SIGCONT),
            Fault::PlantStopped if lasted => self.signal("plant", libc::SIGCONT),
            Fault::DaemonKilled if since.elapsed() >= RESTART => {
                (self.touches, self.memory) = (0, None);
                start_daemon(&mut self.session, &self.config)?;
            }
            Fault::SecondDaemon => match self.session.exit_status("second") {
                None => return Ok(()),
                Some(status) if status.code() == Some(i32::from(Exit::Unavailable.code())) => {
                    self.session.forget("second")
                }
                Some(status) => return Err(self.session.failure("second", status)),
            },
            Fault::PlantKilled | Fault::RecorderKilled | Fault::GarbageReloaded | Fault::Scripted(_) => {}
            _ => return Ok(()),
        }
        now.is_over = true;
        now.since = Some((since, monotonic_ns()));
        Ok(())
    }

    /// Whether the daemon controls; if it is stopped, it is reset first, and asked again later.
    fn control(&mut self) -> Result<(), String> {
        let settings = self.session.settings();
        let ask = |kind| request::ask(&self.node, settings, request::request(kind)).map_err(|(_, why)| why);
        let status = ask(RequestKind::Status)?;
        match Mode::from_code(status.mode) {
            Some(Mode::Free) => Ok(()),
            Some(Mode::Stopped) => Err(format!("{}; {}", status.text(), ask(RequestKind::Reset)?.text())),
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

fn start_daemon(session: &mut Session, config: &std::path::Path) -> Done<()> {
    session.start("daemon", "role-daemon", &[OsStr::new("--config"), config.as_os_str()])
}

#[cfg(test)]
mod tests {
    use super::super::injection::Draw;
    use super::*;

    #[test]
    fn what_is_drawn_are_valid_files() {
        let mut draw = Draw::new(1);
        for _ in 0..40 {
            let touch = draw.touch();
            let config = config(touch.stiffness_n_m).expect("valid");
            let config = admittance_host::config::parse(&config, "daemon.toml");
            let config: admittance_runner::config::Config = config.expect("valid");
            admittance_runner::cycle::build(&config).expect("a controller");
            let scenario = scenario(&touch, Some(touch.fault)).expect("valid");
            let scenario = admittance_host::config::parse(&scenario, "scenario.toml").expect("valid");
            plant_sim::run::VirtualRun::new(&scenario).expect("a plant");
        }
    }
}
