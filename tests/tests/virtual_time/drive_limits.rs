//! Limits of the drives, judged a streamed reference at a time: with a Franka Research 3's on arms of six and seven
//! joints, at 1 and 4 ms, through everything that moves the arm.

use std::collections::BTreeSet;

use admittance_core::quantities::Instant;
use admittance_core::supervisor::Ending;
use admittance_runner::config::ResolutionName;
use admittance_runner::cycle::{self, Cycle};
use end_to_end::closed_loop::Experiment;
use end_to_end::drive_judge::{Published, Worst, judge};
use ipc_types::{CommandSample, Mode, Motion, StateSample, VirtualPlant};
use plant_sim::faults::FaultKind;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::{FaultSection, FollowsName};

const SIX: [&str; 2] = [
    include_str!("../../../deploy/robots/six-joint.toml"),
    include_str!("../../../plant-sim/scenarios/six-joint.toml"),
];
const SEVEN: [&str; 2] = [
    include_str!("../../../deploy/robots/seven-joint.toml"),
    include_str!("../../../plant-sim/scenarios/seven-joint.toml"),
];

/// What one unit in the last place of a velocity makes of a jerk.
const ROUNDING: f64 = 1e-6;

/// By how much the references that the daemon asks for may exceed the limits of acceleration and jerk where it sees every
/// sample: how J turns until the next one it knows to first order, and of a twist that does not change meanwhile. Joints that
/// follow what the daemon resolves do as they are told, however long the cycle is.
const TURNING: [(f64, f64); 2] = [(1.001, 1.07), (1.01, 1.85)];

/// How often samples come, and inputs within that.
#[derive(Debug, Clone, Copy)]
struct Rate {
    sampling_time: f64,
    inputs: u32,
}

const RATES: [Rate; 3] = [
    Rate { sampling_time: 0.001, inputs: 1 },
    Rate { sampling_time: 0.004, inputs: 4 },
    Rate { sampling_time: 0.004, inputs: 1 },
];

/// One of the arms with the drives of a Franka Research 3, told to daemon and plant.
fn experiment([config, scenario]: [&str; 2], rate: Rate) -> Experiment {
    let mut experiment = Experiment::new(config, scenario, rate.sampling_time);
    let joints = experiment.config.robot.joint.len();
    experiment.config.mpc.inputs_per_cycle = Some(rate.inputs);
    experiment.with_drives(Published::fr3().of_joints(joints), rate.sampling_time / f64::from(rate.inputs))
}

/// The seven joints where the daemon resolves twists: beside them the joints go to a posture that is half a radian
/// and more away, so that the elbow is in motion whatever else happens.
fn resolved(rate: Rate) -> Experiment {
    let mut experiment = experiment(SEVEN, rate);
    let redundancy = &mut experiment.config.redundancy;
    redundancy.resolution = ResolutionName::Posture;
    redundancy.posture_rad = Some(vec![1.0, 0.6, -0.8, -1.5, 0.8, 1.0, 0.0]);
    let limits = &mut experiment.config.limits;
    limits.joint_position_min_rad = Some(vec![-2.9; 7]);
    limits.joint_position_max_rad = Some(vec![2.9; 7]);
    experiment.scenario.controller.follows = FollowsName::JointVelocity;
    experiment
}

/// What becomes of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    /// It is answered.
    Answered,
    /// It is answered, and there is no time to solve anything.
    NoTime,
    /// Nobody sees it, and the arm plays the last plan.
    Missed,
    /// Nobody sees it, and the daemon acts on the silence.
    Silent,
}

/// A run as the drives see it.
struct Stream {
    /// Of each stretch between two standstills by the brakes, what was asked for.
    asked: Vec<Vec<Vec<f64>>>,
    /// What the drives were given.
    given: Vec<Vec<Vec<f64>>>,
    interval: f64,
    modes: BTreeSet<u32>,
    last: CommandSample,
    peak_normal: f64,
}

impl Stream {
    /// Runs to the end of the motion; `fate` sees the controller and every sample before.
    fn of(experiment: &Experiment, mut fate: impl FnMut(&mut dyn Cycle, &StateSample) -> Fate) -> Self {
        let Experiment { config, scenario } = experiment;
        let mut plant = VirtualRun::new(scenario).expect("the scenario can be set up");
        let mut cycle = cycle::build(config).expect("the config describes a controller");
        let mut stream = Self {
            asked: vec![Vec::new()],
            given: vec![Vec::new()],
            interval: config.control.sampling_time_s / f64::from(config.inputs_per_cycle()),
            modes: BTreeSet::new(),
            last: CommandSample::zeroed(),
            peak_normal: 0.0,
        };
        while !plant.is_finished() {
            let state = *plant.sample().expect("no fault drops samples");
            let now = Instant::from_nanoseconds(state.stamp_ns);
            let fate = fate(cycle.as_mut(), &state);
            let command = &mut stream.last;
            let _ = match fate {
                Fate::Missed => None,
                Fate::Silent => Some(cycle.silence(now, command)),
                Fate::Answered | Fate::NoTime => Some(cycle.answer(&state, now, &mut || fate == Fate::NoTime, command)),
            };
            command.sequence += 1;
            stream.modes.insert(command.mode);
            let told = (fate != Fate::Missed).then_some(&*command);
            let truth = plant.advance(told).expect("the plant takes every command");
            stream.peak_normal = stream.peak_normal.max(truth.peak_normal_force_n);
            if state.drives_enabled == 0 {
                // Brakes know no limit; what follows begins from standstill.
                stream.begin_anew();
                continue;
            }
            for [asked, given] in plant.streamed() {
                stream.asked.last_mut().expect("begun").push(asked);
                stream.given.last_mut().expect("begun").push(given);
            }
        }
        stream
    }

    fn begin_anew(&mut self) {
        for stretches in [&mut self.asked, &mut self.given] {
            if stretches.last().is_some_and(|stretch| !stretch.is_empty()) {
                stretches.push(Vec::new());
            }
        }
    }

    /// The worst of all stretches.
    fn judged(&self, stretches: &[Vec<Vec<f64>>]) -> Worst {
        let of = |references: &Vec<Vec<f64>>| {
            let joints = references.first().map_or(0, Vec::len);
            judge(references.iter().map(Vec::as_slice), self.interval, &Published::fr3().of_joints(joints))
        };
        let worst = stretches.iter().map(of).max_by(|a, b| a.most().total_cmp(&b.most()));
        worst.expect("references were streamed")
    }

    fn reached(&self, mode: Mode) -> bool {
        self.modes.contains(&mode.code())
    }
}

/// Something that happens to an arm.
struct Life {
    name: &'static str,
    stream: Stream,
    /// Modes that it has to lead to, or it was not lived.
    through: &'static [Mode],
    /// Whether the daemon sees every sample, and is heard.
    is_seen: bool,
}

fn sliding(speed: f64) -> [f64; 6] {
    [0.8 * speed, 0.6 * speed, -speed, 0.0, 0.0, 0.0]
}

const AWAY: [f64; 6] = [0.0, 0.0, 0.1, 0.0, 0.0, 0.0];

fn there_and_back(base: &Experiment, speed: f64) -> Experiment {
    base.clone().with_motion(&[(0.5, &sliding(speed)), (0.2, &AWAY), (0.1, &[0.0; 6])])
}

fn answered(_: &mut dyn Cycle, _: &StateSample) -> Fate {
    Fate::Answered
}

/// Everything that moves an arm.
fn lives(base: &Experiment, rate: Rate) -> Vec<Life> {
    use Mode::{Contact, Free, Idle, Stopped, Stopping};
    let slow = there_and_back(base, 0.03);
    let cycles = move |time: f64| (time / rate.sampling_time).round() as u64;
    let settled = cycles(base.scenario.timing.settle_s);
    // Whether the sample is within so many s from the start of the motion.
    let within = move |state: &StateSample, from: f64, lasts: f64| {
        let begin = settled + cycles(from);
        (begin..begin + cycles(lasts).max(1)).contains(&state.sequence)
    };
    let mut lives = Vec::new();
    let mut seen = |name, stream, through| lives.push(Life { name, stream, through, is_seen: true });
    seen("a touch, a slide and a release", Stream::of(&slow, answered), &[Free, Contact][..]);
    seen("the same twice as fast", Stream::of(&there_and_back(base, 0.06), answered), &[Free, Contact]);
    seen("a stop and a retreat", Stream::of(&there_and_back(base, 0.15), answered), &[Free, Stopping, Stopped]);
    let again = base.clone().with_motion(&[
        (0.4, &sliding(0.15)),
        (0.8, &[0.0, 0.0, 0.04, 0.0, 0.0, 0.0]),
        (0.1, &[0.0; 6]),
        (1.2, &sliding(0.03)),
    ]);
    let mut resets = 0;
    let reset = |cycle: &mut dyn Cycle, _: &StateSample| {
        resets += u32::from(cycle.mode() == Stopped && cycle.reset(false).is_ok());
        Fate::Answered
    };
    let stream = Stream::of(&again, reset);
    assert!(resets > 0, "a reset was taken");
    seen("a stop, a retreat, a reset and another approach", stream, &[Stopping, Stopped, Free]);
    let withdrawn = |from: f64, given: f64| {
        move |cycle: &mut dyn Cycle, state: &StateSample| {
            if within(state, from, 0.0) {
                cycle.end(Ending::Disabled);
            } else if within(state, given, 0.0) {
                let _ = cycle.enable();
            }
            Fate::Answered
        }
    };
    seen("control withdrawn in contact", Stream::of(&slow, withdrawn(0.3, 0.75)), &[Contact, Stopped]);
    let mut free = base.clone().with_motion(&[(0.15, &sliding(0.03)), (0.2, &AWAY), (0.1, &[0.0; 6])]);
    (free.scenario.surface, free.scenario.start.contact_time_s) = (None, None);
    seen("control withdrawn in free motion, and given again", Stream::of(&free, withdrawn(0.1, 0.3)), &[Idle, Free]);
    let only = |fate: Fate, from: f64, lasts: f64| {
        move |_: &mut dyn Cycle, state: &StateSample| if within(state, from, lasts) { fate } else { Fate::Answered }
    };
    let two = 2.0 * rate.sampling_time;
    for from in [0.208, 0.3] {
        seen("no time to solve", Stream::of(&slow, only(Fate::NoTime, from, two)), &[Contact]);
        seen("never time to solve again", Stream::of(&slow, only(Fate::NoTime, from, 1.0)), &[Stopping, Stopped]);
    }
    let mut unseen = |name, stream, through| lives.push(Life { name, stream, through, is_seen: false });
    unseen(
        "a stop far too late, the sensor saturated",
        Stream::of(&there_and_back(base, 0.4), answered),
        &[Stopping, Stopped],
    );
    for from in [0.208, 0.3] {
        unseen("two samples missed", Stream::of(&slow, only(Fate::Missed, from, two)), &[Contact][..]);
        unseen("silence", Stream::of(&slow, only(Fate::Silent, from, 0.1)), &[Stopped]);
    }
    for at_s in [0.1, 0.3] {
        for (kind, name, through) in [
            (FaultKind::CommandLoss, "commands are lost", &[Contact][..]),
            (FaultKind::NanWrench, "the wrench is none", &[Stopped]),
            (FaultKind::DrivesDisabled, "the drives are off", &[Contact]),
        ] {
            let mut faulty = slow.clone();
            faulty.scenario.fault = vec![FaultSection { at_s, duration_s: 0.1, kind }];
            unseen(name, Stream::of(&faulty, answered), through);
        }
    }
    lives
}

#[test]
fn whatever_moves_the_arm_keeps_the_limits_of_its_drives() {
    let mut failures = Vec::new();
    for rate in RATES {
        let arms =
            [("six", experiment(SIX, rate)), ("seven", experiment(SEVEN, rate)), ("seven resolved", resolved(rate))];
        for (arm, base) in &arms {
            for Life { name, stream, through, is_seen } in lives(base, rate) {
                let [asked, given] = [&stream.asked, &stream.given].map(|references| stream.judged(references));
                let what = format!("{arm} joints, {rate:?}, {name}");
                println!(
                    "{what}: given {:.7}, asked for {:.4} of the acceleration and {:.4} of the jerk, peak {:.1} N",
                    given.most(),
                    asked.acceleration.0,
                    asked.jerk.0,
                    stream.peak_normal
                );
                if let Some(mode) = through.iter().find(|mode| !stream.reached(**mode)) {
                    failures.push(format!("{what}: never {mode:?}"));
                }
                if given.most() > 1.0 + ROUNDING {
                    failures.push(format!("{what}: given {given:?}"));
                }
                let (acceleration, jerk) = TURNING[usize::from(rate.sampling_time > 0.001 && *arm != "seven resolved")];
                let is_within = asked.speed.0 <= 1.0 && asked.acceleration.0 <= acceleration && asked.jerk.0 <= jerk;
                if is_seen && !is_within {
                    failures.push(format!("{what}: asked {asked:?}"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn a_daemon_that_is_not_told_asks_for_far_more() {
    let mut untold = there_and_back(&experiment(SIX, RATES[0]), 0.03);
    let limits = &mut untold.config.limits;
    (limits.joint_acceleration_rad_s2, limits.joint_jerk_rad_s3) = (None, None);
    let stream = Stream::of(&untold, answered);
    let [asked, given] = [&stream.asked, &stream.given].map(|references| stream.judged(references));
    assert!(asked.acceleration.0 > 5.0 && asked.jerk.0 > 10.0, "{asked:?}");
    // The motion controller has the last word.
    assert!(given.most() <= 1.0 + ROUNDING, "{given:?}");
}

#[test]
fn a_stop_that_may_exceed_the_jerk_presses_less() {
    let kept = there_and_back(&experiment(SIX, RATES[0]), 0.15);
    let mut exceeded = kept.clone();
    exceeded.config.limits.stop_exceeds_jerk = true;
    exceeded.scenario.drives.as_mut().expect("told").joint_jerk_rad_s3 = None;
    let [kept, exceeded] = [kept, exceeded].map(|experiment| Stream::of(&experiment, answered));
    let judged = exceeded.judged(&exceeded.given);
    assert!(judged.jerk.0 > 1.5 && judged.acceleration.0 <= 1.0 + ROUNDING, "{judged:?}");
    assert!(exceeded.peak_normal < kept.peak_normal, "{} N, {} N", exceeded.peak_normal, kept.peak_normal);
}

/// A ramp to standstill counts from the last twist reference that was seen. It has to end: a `Hold` that never came would let
/// an arm that nobody sees follow the next one.
#[test]
fn without_a_usable_sample_the_ramp_to_standstill_ends_in_hold() {
    for rate in RATES {
        for base in [experiment(SIX, rate), experiment(SEVEN, rate), resolved(rate)] {
            for speed in [0.03, 0.15, 0.4] {
                let mut blind = base.clone().with_motion(&[(0.8, &sliding(speed)), (0.8, &AWAY)]);
                blind.scenario.fault = vec![FaultSection { at_s: 0.25, duration_s: 2.0, kind: FaultKind::NanWrench }];
                let stream = Stream::of(&blind, answered);
                let given = stream.given.last().and_then(|stretch| stretch.last()).expect("streamed");
                let what = format!("{rate:?}, {speed} m/s: {:?} {given:?}", stream.last.motion);
                assert_eq!(stream.last.motion, Motion::Hold.code(), "{what}");
                assert!(given.iter().all(|reference| *reference == 0.0), "{what}");
            }
        }
    }
}
