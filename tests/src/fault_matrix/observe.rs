//! Compares what was seen with what the row says.

use ipc_types::{CommandSample, Mode, Motion, Source, StopReason, TruthSample};

use super::files::{daemon_file, scenario_file};
use super::force;
use super::row::{Counter, End, Expectation, Force, Injection, Robot, Said, Signal, Situation, Who};
use super::run::{FAULT_AT_S, Instants, Stage, Wrong};
use crate::PATIENCE;

/// Speed in m/s below which the TCP stands still.
const STANDSTILL: f64 = 1e-3;
/// Stops that a busy machine causes by taking the processor away.
const BY_MACHINE: [&str; 4] = ["SampleStale", "SamplesMissed", "FallbackExhausted", "RateMismatch"];
/// A sample that the plant itself publishes so late (ns) is the machine's doing.
const LATE_NS: u64 = 10_000_000;

/// The successive states that commands report.
pub(super) fn states<'a>(commands: impl Iterator<Item = &'a CommandSample>) -> Vec<Said> {
    let mut states: Vec<Said> = commands.filter_map(Said::of).collect();
    states.dedup();
    states
}

/// Whether these states, one after the other, are the expected ones.
pub(super) fn agrees(found: &[Said], expected: &Expectation) -> bool {
    let matters = |said: &&Said| expected.robot != Robot::ComesToRest || said.mode != Mode::Stopping;
    found.iter().filter(matters).eq(expected.command.iter().filter(matters))
}

/// How a busy machine disturbed the run; `None` if it did not.
pub(super) fn disturbance(stage: &Stage<'_>) -> Option<String> {
    let expected = stage.row.expected(stage.situation);
    let is_expected =
        |name: &str| expected.command.iter().any(|said| said.reason.map_or("None", StopReason::name) == name);
    if let Some(reason) = BY_MACHINE.into_iter().find(|name| stage.log.contains(name) && !is_expected(name)) {
        return Some(format!("a stop for {reason}"));
    }
    if stage.too_late {
        return Some("the motion went on before the recovery".to_owned());
    }
    let seen = stage.watcher.seen();
    let running = || seen.truths.iter().filter(|truth| truth.scenario_time_s >= 0.0);
    if let Some(late) = running().find(|truth| truth.lateness_ns > LATE_NS && expected.robot != Robot::NotRunning) {
        return Some(format!("a sample {} ms late", late.lateness_ns / 1_000_000));
    }
    // A command that is missed in contact may make it infeasible.
    let is_before: &dyn Fn(&TruthSample) -> bool = match stage.row.injection {
        Injection::FromStart => {
            let stops = |command: &&CommandSample| {
                Mode::from_code(command.mode).is_some_and(|mode| matches!(mode, Mode::Stopping | Mode::Stopped))
            };
            let stop = seen.commands.values().find(stops).map_or(u64::MAX, |command| command.state_stamp_ns);
            &move |truth| truth.stamp_ns <= stop
        }
        _ => &|truth| truth.scenario_time_s < FAULT_AT_S[usize::from(stage.situation == Situation::Contact)],
    };
    let missed = running().filter(|truth| truth.missed == 1 && is_before(truth)).count();
    (missed > 0).then(|| format!("{missed} commands missed before the fault"))
}

/// The time from the fault to the recovery.
pub(super) fn check(
    stage: &mut Stage<'_>,
    instants: &Instants,
    before: (&CommandSample, &TruthSample),
) -> Result<(), Wrong> {
    check_commands(stage, instants)?;
    check_rejected(stage, instants, before.0)?;
    check_robot(stage, instants)?;
    check_force(stage, instants, before)?;
    check_log(stage);
    check_ends(stage)
}

fn check_commands(stage: &Stage<'_>, instants: &Instants) -> Result<(), Wrong> {
    let expected = stage.row.expected(stage.situation);
    let seen = stage.watcher.seen();
    let found = states(seen.commands_within(instants.fault, instants.recovery));
    if !agrees(&found, expected) {
        return Err(format!("the commands say {found:?}, expected {:?}", expected.command));
    }
    if let Some(source) = expected.robot.source()
        && !seen.commands_within(instants.fault, instants.recovery).any(|command| command.source == source.code())
    {
        return Err(format!("no command comes from {}", source.name()));
    }
    Ok(())
}

/// No sample is refused without a reason: restarts later on may bring silences.
fn check_rejected(stage: &Stage<'_>, instants: &Instants, before: &CommandSample) -> Result<(), Wrong> {
    if stage.row.expected(stage.situation).counted.contains(&Counter::Rejected) {
        return Ok(());
    }
    let seen = stage.watcher.seen();
    let of_same_run = seen.commands_within(instants.fault, instants.recovery).filter(|c| c.boot_id == before.boot_id);
    let most = of_same_run.map(|command| command.rejected_count).max().unwrap_or(0);
    if most == before.rejected_count {
        Ok(())
    } else {
        Err(format!("rejected_count was {} and is {most}", before.rejected_count))
    }
}

fn check_robot(stage: &Stage<'_>, instants: &Instants) -> Result<(), Wrong> {
    let robot = stage.row.expected(stage.situation).robot;
    let seen = stage.watcher.seen();
    let last = seen.truths_within(instants.fault, instants.recovery).last();
    if robot == Robot::NotRunning {
        // Samples under way when it ended belong to the past.
        let later = seen.truths_within(instants.fault + 50_000_000, instants.recovery).count();
        return if later == 0 { Ok(()) } else { Err(format!("{later} truths of a robot that does not run")) };
    }
    let Some(last) = last else { return Err("the robot was not seen".to_owned()) };
    let speed = last.tcp_twist.iter().map(|v| v * v).sum::<f64>().sqrt();
    match robot {
        Robot::GoesOn | Robot::Pauses if last.motion != Motion::Offset.code() => Err("the robot is held".to_owned()),
        Robot::GoesOn if seen.truths_within(instants.fault, instants.recovery).any(|t| t.motion != last.motion) => {
            Err("the robot was held for a while".to_owned())
        }
        Robot::PlaysPlan | Robot::Retreats | Robot::MinimumForceStop | Robot::ComesToRest | Robot::StandsStill
            if speed > STANDSTILL =>
        {
            Err(format!("the robot moves at {speed} m/s"))
        }
        _ => Ok(()),
    }
}

fn check_force(
    stage: &mut Stage<'_>,
    instants: &Instants,
    before: (&CommandSample, &TruthSample),
) -> Result<(), Wrong> {
    let force = stage.row.expected(stage.situation).force;
    let (daemon, scenario) = (daemon_file(stage.row), scenario_file(stage.row, stage.situation));
    let bound = force::bound(force, &force::Situation { daemon: &daemon, scenario: &scenario, before });
    let seen = stage.watcher.seen();
    let truths = || seen.truths_within(instants.fault, instants.recovery);
    let peak = truths().map(|truth| truth.peak_normal_force_n).fold(0.0, f64::max);
    let rests = truths().last().map_or(0.0, |truth| truth.normal_force_n);
    let report = format!(
        "{} in {}: {:.1} N before, peak {peak:.1} N, bound {bound:.1} N, rests at {rests:.1} N",
        stage.row.name,
        stage.situation.name(),
        before.1.normal_force_n
    );
    drop(seen);
    stage.report = report;
    if peak <= bound {
        Ok(())
    } else {
        Err(format!("the true force reaches {peak:.1} N, {force:?}: at most {bound:.1} N"))
    }
}

fn check_log(stage: &mut Stage<'_>) {
    for line in &stage.row.expected(stage.situation).log {
        let earlier = stage.log.clone();
        if line.by == Who::Daemon && earlier.contains(&line.text) {
            continue;
        }
        stage.process(line.by).wait_until(&line.text, PATIENCE, |child| {
            child.stderr().contains(&line.text) || child.stdout().contains(&line.text)
        });
    }
}

fn check_ends(stage: &mut Stage<'_>) -> Result<(), Wrong> {
    use std::os::unix::process::ExitStatusExt;
    let expected = stage.row.expected(stage.situation).ends.clone();
    for who in [Who::Daemon, Who::Plant, Who::Newcomer] {
        if who == Who::Newcomer && stage.newcomer.is_none() {
            continue;
        }
        let status = stage.process(who).exit_status();
        let end = expected.iter().find(|end| matches!(end, End::Code(of, _) | End::Signal(of, _) if *of == who));
        let is_as_said = match end {
            // A daemon that was restarted: the new one runs.
            Some(End::Code(Who::Daemon, _)) => status.is_none(),
            Some(End::Code(_, code)) => status.and_then(|status| status.code()) == Some(*code),
            Some(End::Signal(_, Signal::Kill)) => status.and_then(|status| status.signal()) == Some(libc::SIGKILL),
            Some(End::Signal(_, Signal::Stop)) | None => status.is_none(),
        };
        if !is_as_said {
            return Err(format!("{who}: {status:?}, expected {end:?}"));
        }
    }
    Ok(())
}

/// Counts since before the fault.
pub(super) fn check_counts(stage: &Stage<'_>, before: &CommandSample) -> Result<(), Wrong> {
    let counted = &stage.row.expected(stage.situation).counted;
    let seen = stage.watcher.seen();
    let Some(now) = seen.command() else { return Err("no command was seen".to_owned()) };
    if now.boot_id != before.boot_id {
        return if counted.is_empty() { Ok(()) } else { Err("a new daemon counts from 0".to_owned()) };
    }
    for counter in [Counter::Rejected, Counter::Missed, Counter::Fallback] {
        let (was, is) = (counter.of(before), counter.of(now));
        if counted.contains(&counter) && is <= was {
            return Err(format!("{} was {was} and is {is}", counter.name()));
        }
    }
    Ok(())
}

/// Checks the whole run: nothing is silently replaced by zero or held.
pub(super) fn check_all(stage: &Stage<'_>) -> Result<(), Wrong> {
    let seen = stage.watcher.seen();
    for command in seen.commands.values() {
        let Some(said) = Said::of(command) else { return Err(format!("unknown codes in {command:?}")) };
        let is_finite = command.velocity_offset.iter().chain(&command.twist_command).all(|value| value.is_finite());
        let is_zero = command.velocity_offset.iter().all(|value| *value == 0.0);
        let in_contact = matches!(said.mode, Mode::Contact | Mode::Stopping);
        let is_ramp = command.source == Source::Ramp.code();
        if !is_finite || in_contact && (said.motion == Motion::Hold || is_zero && !is_ramp) {
            return Err(format!(
                "command {} says {said} with the offset {:?}",
                command.sequence, command.velocity_offset
            ));
        }
        if said.mode == Mode::Stopped && said.motion == Motion::Offset && command.source != Source::Retreat.code() {
            return Err(format!("command {} says {said} without a retreat", command.sequence));
        }
    }
    if stage.row.expected(stage.situation).force == Force::None && seen.truths.iter().any(|t| t.in_contact == 1) {
        return Err("the surface was touched".to_owned());
    }
    Ok(())
}
