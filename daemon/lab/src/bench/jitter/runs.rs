//! Daemon and plant as processes, in contact or in free motion, at the rate of the benchmark.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::Path;
use std::time::Duration;

use admittance_core::quantities::Span;
use ipc_types::{Motion, Subscriber, TruthSample};
use plant_sim::scenario::Scenario;
use toml::{Table, Value};

use crate::keys::{parsed, real_time, set};

use super::arms::Motion as Way;
use super::figures::{Durations, Parts};
use super::observed::CycleParts;
use super::{DAEMON_CPU, PLANT_CPU, PRIORITY, Plan};
use admittancectl::Exit;
use admittancectl::session::Session;

/// Daemon and plant meet there, whatever their files say.
const INSTANCE: &str = "bench";
/// Between two looks at the truth: at 5 kHz its buffer holds 0.2 s.
const POLL: Duration = Duration::from_millis(10);
/// From the start of the motion to first contact, s.
const CONTACT_S: f64 = 0.2;
/// After first contact, until counting begins, s.
const SETTLING_S: f64 = 0.2;
/// Length of the run in free motion, s.
const FREE_S: f64 = 2.0;
/// Attempts at a run that a busy machine may spoil.
const TRIES: u32 = 3;

/// Runs of one plan.
#[derive(Debug)]
pub(crate) struct Runs {
    plan: Plan,
}

/// A run: the truth of each cycle that counts, and further results.
struct Seen {
    truths: Vec<TruthSample>,
    /// Why the daemon stopped the arm, if it did.
    stopped: Option<String>,
}

impl Runs {
    pub(crate) fn new(plan: Plan) -> Self {
        Self { plan }
    }

    /// One turn of contact: from the instant of each sample to its answer.
    pub(crate) fn contact(&self, cycle: &mut Durations) -> Result<(), (Exit, String)> {
        let seen = self.undisturbed(|| {
            let (mut session, truths) = self.start("role-daemon", &[])?;
            let seen = watch(&mut session, &truths)?;
            session.end("daemon")?;
            Ok(seen)
        })?;
        for truth in &seen {
            match truth.answer_time_ns {
                0 => cycle.add_endless(),
                time => cycle.add(time, truth.missed == 1),
            }
        }
        Ok(())
    }

    /// The parts of a cycle, from an observed daemon.
    pub(crate) fn observed(&self) -> Result<Parts, (Exit, String)> {
        let mut noted = HashMap::new();
        let seen = self.undisturbed(|| {
            let out = tempfile::NamedTempFile::new().map_err(|error| (Exit::Unavailable, error.to_string()))?;
            let (mut session, truths) =
                self.start("role-observed-daemon", &[OsStr::new("--out"), out.path().as_os_str()])?;
            let seen = watch(&mut session, &truths)?;
            session.end("daemon")?;
            noted = read(out.path())?;
            Ok(seen)
        })?;
        let mut parts = Parts { compute: Durations::new(), shell: Durations::new() };
        for truth in &seen {
            let Some(cycle) = noted.get(&truth.sequence) else { continue };
            parts.compute.add(cycle.compute_ns, false);
            let visible = truth.stamp_ns + truth.lateness_ns;
            let whole = cycle.sent_ns.saturating_sub(visible);
            parts.shell.add(whole.saturating_sub(cycle.solver_ns), false);
        }
        Ok(parts)
    }

    /// Share of a processor that the daemon's threads take in free motion at 1 kHz, blocking
    /// between samples.
    pub(crate) fn free_motion_cpu_percent(&self) -> Result<f64, (Exit, String)> {
        let plan = Plan { rate_hz: 1000, period: 1_000_000, budget: 500_000, turn_s: FREE_S, ..self.plan };
        let mut session = Session::new(&scenario(plan, Surface::None)?.0)?;
        launch(&mut session, plan, Surface::None, "role-daemon", &[])?;
        let (_node, truths) = session.watch(&|| false)?;
        let (mut first, mut last) = (None, None);
        loop {
            let ended = session.exit_status("plant");
            while let Ok(Some(truth)) = truths.receive() {
                if truth.scenario_time_s > CONTACT_S {
                    let now = processor_time(&mut session);
                    first.get_or_insert((truth.stamp_ns, now));
                    last = Some((truth.stamp_ns, now));
                }
            }
            match ended {
                Some(status) if status.success() => break,
                Some(status) => return Err(session.failure("plant", status)),
                None => std::thread::sleep(POLL),
            }
        }
        session.end("daemon")?;
        let share = |(begun, before): (u64, u64), (ended, after): (u64, u64)| {
            (after.saturating_sub(before)) as f64 / ended.saturating_sub(begun).max(1) as f64 * 100.0
        };
        Ok(first.zip(last).map_or(f64::NAN, |(first, last)| share(first, last)))
    }

    fn start(&self, role: &str, more: &[&OsStr]) -> Result<(Session, Watched), (Exit, String)> {
        let mut session = Session::new(&scenario(self.plan, Surface::Touched)?.0)?;
        launch(&mut session, self.plan, Surface::Touched, role, more)?;
        let watched = session.watch(&|| false)?;
        Ok((session, watched))
    }

    /// Cycles in contact of a run in which the daemon did not stop the arm.
    fn undisturbed(
        &self,
        mut run: impl FnMut() -> Result<Seen, (Exit, String)>,
    ) -> Result<Vec<TruthSample>, (Exit, String)> {
        for _ in 0..TRIES {
            let seen = run()?;
            let Some(reason) = seen.stopped else { return Ok(seen.truths) };
            eprintln!("the daemon stopped the arm ({reason}): running it again");
        }
        let text =
            format!("machine too busy: the daemon stopped the arm in {TRIES} runs; try again when nothing else runs");
        Err((Exit::MachineBusy, text))
    }
}

type Watched = (ipc_types::Node, Subscriber<TruthSample>);

/// Reads the truth to the end of the motion; a sample that was read too late is left out.
fn watch(session: &mut Session, (_node, truths): &Watched) -> Result<Seen, (Exit, String)> {
    let mut truths_in_contact = Vec::new();
    let mut held = false;
    loop {
        let ended = session.exit_status("plant");
        while let Ok(Some(truth)) = truths.receive() {
            held |= truth.scenario_time_s > 0.0 && truth.motion == Motion::Hold.code();
            if truth.scenario_time_s > CONTACT_S + SETTLING_S && truth.in_contact == 1 {
                truths_in_contact.push(*truth);
            }
        }
        match ended {
            Some(status) if status.success() => {
                let reason = || session.stop_reason().unwrap_or_else(|| "no answers".to_owned());
                return Ok(Seen { truths: truths_in_contact, stopped: held.then(reason) });
            }
            Some(status) => return Err(session.failure("plant", status)),
            None => {}
        }
        if let Some(status) = session.exit_status("daemon") {
            return Err(session.failure("daemon", status));
        }
        std::thread::sleep(POLL);
    }
}

fn read(path: &Path) -> Result<HashMap<u64, CycleParts>, (Exit, String)> {
    let failed = |why: String| (Exit::Internal, format!("{}: {why}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| failed(error.to_string()))?;
    let parts = text.lines().map(serde_json::from_str::<CycleParts>);
    let parts = parts.map(|parts| parts.map(|parts| (parts.sequence, parts)));
    parts.collect::<Result<_, _>>().map_err(|error| failed(error.to_string()))
}

/// Time in ns that all threads of the daemon have had a processor.
fn processor_time(session: &mut Session) -> u64 {
    let Some(id) = session.child("daemon").map(|child| child.id()) else { return 0 };
    let tasks = std::fs::read_dir(format!("/proc/{id}/task")).into_iter().flatten().flatten();
    let time = |task: std::fs::DirEntry| {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<u64>().ok()
    };
    tasks.filter_map(time).sum()
}

/// Whether there is a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Surface {
    Touched,
    None,
}

fn launch(
    session: &mut Session,
    plan: Plan,
    surface: Surface,
    role: &str,
    more: &[&OsStr],
) -> Result<(), (Exit, String)> {
    let config = session.write("daemon.toml", &config(plan, surface)?)?;
    let scenario = session.write("scenario.toml", &scenario(plan, surface)?.1)?;
    session.start("daemon", role, &[&[OsStr::new("--config"), config.as_os_str()], more].concat())?;
    session.start("plant", "role-plant", &[OsStr::new("--scenario"), scenario.as_os_str()])
}

/// The default profile at the rate of the plan.
fn config(plan: Plan, surface: Surface) -> Result<String, (Exit, String)> {
    let mut table = parsed(plan.arm.files().0)?;
    let period = Span::from_nanoseconds(plan.period).seconds();
    let budget = Span::from_nanoseconds(plan.budget).seconds();
    let wait = if surface == Surface::None { "event" } else { "hybrid" };
    set(&mut table, "ipc", "instance", INSTANCE);
    set(&mut table, "control", "sampling_time_s", period);
    set(&mut table, "control", "command_delay_s", budget);
    set(&mut table, "control", "answer_budget_s", budget);
    // What a busy machine does to the daemon is counted; it is not to end the run.
    set(&mut table, "control", "max_sample_age_s", 0.1);
    set(&mut table, "control", "max_consecutive_fallbacks", 20);
    set(&mut table, "control", "spin_s", (period / 4.0).min(300e-6));
    set(&mut table, "control", "wait", wait);
    if let Some(directions) = plan.directions {
        let gives_way = (0..plan.arm.most_directions()).map(|axis| Value::Boolean(axis < directions as usize));
        set(&mut table, "contact", "admittance_axes", gives_way.collect::<Vec<_>>());
    }
    real_time(&mut table, PRIORITY, DAEMON_CPU);
    Ok(table.to_string())
}

/// Down to the surface, then along it, to and fro.
fn scenario(plan: Plan, surface: Surface) -> Result<(Scenario, String), (Exit, String)> {
    let mut table = parsed(plan.arm.files().1)?;
    let Way { down, there, back } = plan.arm.motion();
    let at = |speed: f64, way: &[f64]| way.iter().map(|part| speed * part).collect::<Vec<_>>();
    set(&mut table, "ipc", "instance", INSTANCE);
    set(&mut table, "timing", "sampling_time_s", Span::from_nanoseconds(plan.period).seconds());
    set(&mut table, "timing", "command_delay_s", Span::from_nanoseconds(plan.budget).seconds());
    set(&mut table, "timing", "settle_s", 0.3);
    let mut phases = vec![(CONTACT_S + SETTLING_S, at(0.1, &down))];
    match surface {
        Surface::Touched => {
            set(&mut table, "start", "contact_time_s", CONTACT_S);
            // At most 64 phases; a long turn makes slow ones.
            let length = (plan.turn_s / 60.0).max(0.25);
            let speed = 0.025 / length;
            let count = (plan.turn_s / length).ceil() as usize;
            let twist = |phase: usize| at(speed, if phase.is_multiple_of(2) { &there } else { &back });
            phases.extend((0..count).map(|phase| (length, twist(phase))));
        }
        Surface::None => {
            table.remove("surface");
            if let Some(start) = table.get_mut("start").and_then(Value::as_table_mut) {
                start.remove("contact_time_s");
                start.remove("contact_phase");
            }
            phases = vec![(plan.turn_s, at(0.01, &down))];
        }
    }
    let phase = |(duration, twist): &(f64, Vec<f64>)| {
        let mut phase = Table::new();
        phase.insert("duration_s".to_owned(), Value::Float(*duration));
        phase.insert("twist".to_owned(), Value::Array(twist.iter().copied().map(Value::Float).collect()));
        Value::Table(phase)
    };
    table.insert("motion".to_owned(), Value::Array(phases.iter().map(phase).collect()));
    real_time(&mut table, PRIORITY - 5, PLANT_CPU);
    let text = table.to_string();
    let scenario =
        admittance_host::config::parse(&text, "scenario.toml").map_err(|error| (Exit::Internal, error.to_string()))?;
    Ok((scenario, text))
}

#[cfg(test)]
mod tests {
    use super::super::arms::Arm;
    use super::*;

    #[test]
    fn files_are_valid_at_every_rate_and_length() {
        let arms = [(Arm::Planar, None), (Arm::Six, Some(6)), (Arm::Seven, None), (Arm::Eight, Some(1))];
        for (rate, (arm, directions)) in [100, 250, 1000, 2000, 4000, 5000].into_iter().zip(arms.into_iter().cycle()) {
            for turn_s in [0.25, 2.5, 900.0] {
                let period = 1_000_000_000 / rate;
                let plan = Plan { rate_hz: rate as u32, period, budget: period / 2, turn_s, arm, directions };
                for surface in [Surface::Touched, Surface::None] {
                    let text = config(plan, surface).expect("valid");
                    let config = admittance_host::config::parse(&text, "daemon.toml");
                    let config: admittance_runner::config::Config = config.expect("valid");
                    admittance_runner::cycle::build(&config).expect("a controller");
                    let (scenario, _) = scenario(plan, surface).expect("valid");
                    assert_eq!(config.ipc.instance, scenario.ipc.instance);
                    plant_sim::run::VirtualRun::new(&scenario).expect("a plant");
                }
            }
        }
    }
}
