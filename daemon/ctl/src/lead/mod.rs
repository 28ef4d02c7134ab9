//! `admittancectl move`: leads the arm, where its motion controller lets programs lead it, and ends with it at rest.

mod axes;
mod watch;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use admittance_host::clock::{monotonic_ns, sleep_until_ns};
use admittance_runner::config::{Config, ContactPointName};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use ipc_types::services::{self, Access};
use ipc_types::{IpcSettings, Node, Publisher, ServiceError, TASK_AXES, TwistFrame, TwistSample};

use crate::Exit;
use crate::target::Target;
use axes::{AxisSpeed, axis_and_speed, shown, twist_of};
use watch::{Watch, WhyOver};

/// Time between two samples, and for how long each counts: this process may sleep through nine of them.
const STEP_NS: u64 = 10_000_000;
const VALID_NS: u64 = 100_000_000;
/// Samples of zero at the end: one would do.
const ZEROS: u32 = 10;
/// The longest motion.
const LONGEST_S: f64 = 3600.0;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Where the motion controller takes twists: admittance-egm and plant-sim with a [twist] section, whose limits hold; what is faster \
    is brought down to them. The daemon's offset is added, its force limits hold, and a stop of the daemon ends the motion. Ctrl-C and \
    SIGTERM end it with zero; killed, it is followed for 0.1 s more. One program leads at a time.\n\nExit codes: 0 done, 1 ended before: by a \
    signal, by the daemon, or without a contact; 64 usage, 66 no configuration, 69 no daemon, nobody follows, or somebody else \
    leads.\n\nExamples:\n  admittancectl move --twist x=0.02 z=-0.01 --for 2 --instance cell-3\n  admittancectl move --twist z=0.02 --frame tool \
    --for 10 --until-contact --instance cell-3"
)]
pub(crate) struct Args {
    /// Axis (x y z rx ry rz) and its speed in m/s, of rx ry rz in rad/s; zero on axes that are not named.
    #[arg(long, required = true, num_args = 1..=TASK_AXES, value_name = "AXIS=SPEED", value_parser = axis_and_speed)]
    twist: Vec<AxisSpeed>,
    /// Whose axes they are: the base's, or the tool's as it stands. The speed is the TCP's in either.
    #[arg(long, default_value = "base", value_parser = frames())]
    frame: TwistFrame,
    /// How long, in seconds; with --until-contact how long at most.
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    duration: Duration,
    /// End as soon as the daemon says Contact.
    #[arg(long)]
    until_contact: bool,
    #[command(flatten)]
    target: Target,
}

fn frames() -> impl TypedValueParser<Value = TwistFrame> {
    PossibleValuesParser::new(TwistFrame::ALL.iter().map(|frame| frame.name())).map(|text| {
        *TwistFrame::ALL.iter().find(|frame| frame.name() == text).expect("one of the names that are accepted")
    })
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: Option<f64> = text.parse().ok().filter(|seconds| *seconds > 0.0 && *seconds <= LONGEST_S);
    seconds
        .map(Duration::from_secs_f64)
        .ok_or_else(|| format!("accepted: seconds above 0, at most {LONGEST_S}, such as 2.5"))
}

pub(crate) fn run(args: &Args) -> Result<Exit, (Exit, String)> {
    let config = args.target.configuration()?;
    let twist = twist_of(&args.twist, &controlled(&config)).map_err(|why| (Exit::Usage, format!("--twist: {why}")))?;
    // Before anything moves: a signal that comes from here on ends with zero.
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM, signal_hook::consts::SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&interrupted))
            .map_err(|error| (Exit::Unavailable, format!("signal handlers: {error}")))?;
    }
    let (node, settings, opening) = args.target.connect()?;
    let publisher = publisher(&node, &settings)?;
    let mut watch = Watch::begin(&node, &settings, args.until_contact)?;
    drop(opening);
    let mut leader =
        Leader { publisher, boot_id: monotonic_ns() ^ u64::from(std::process::id()) << 32 | 1, sequence: 0 };
    if let Some(why) = watch.refuses() {
        return Err((Exit::ClaimNotMet, format!("not moved: {why}")));
    }
    let axes = if args.frame == TwistFrame::Tool { "of the tool" } else { "of the base" };
    eprintln!("leading admittanced/{}: {} in the axes {axes}; Ctrl-C ends it", settings.instance, shown(&twist));
    if args.until_contact
        && let Some(note) = where_the_surface_is(&config)
    {
        eprintln!("{note}");
    }
    let begun = monotonic_ns();
    let until = begun + args.duration.as_nanos() as u64;
    let mut step = begun;
    let why = loop {
        let now = monotonic_ns();
        if interrupted.load(Ordering::Relaxed) {
            break WhyOver::Interrupted;
        } else if let Some(why) = watch.over() {
            break why;
        } else if now >= until {
            break WhyOver::Time;
        }
        if now >= step {
            leader.say(args.frame, twist)?;
            step = now + STEP_NS;
        }
        sleep_until_ns((now + watch::LOOK_NS).min(step).min(until));
    };
    let lasted_s = (monotonic_ns() - begun) as f64 * 1e-9;
    for _ in 0..ZEROS {
        leader.say(args.frame, [0.0; TASK_AXES])?;
        sleep_until_ns(monotonic_ns() + STEP_NS);
    }
    let (code, said) = why.said(args.until_contact);
    println!("led for {lasted_s:.2} s, now zero: {said}");
    Ok(code)
}

/// What becomes of a contact that is met elsewhere than where the daemon was told: who leads until contact often does not know.
fn where_the_surface_is(config: &Config) -> Option<String> {
    let environment = &config.environment;
    let told = environment.contact == ContactPointName::Configured && environment.stiffness_range_n_m.is_none();
    // Along the normal it rests at the least force that each axis allows which feels the surface.
    let feels = config.contact.minimum_force.iter().zip(environment.surface_normal);
    let of_axes = feels.filter(|(force, normal)| **force > 0.0 && normal.abs() > 0.1);
    let rests_n = of_axes.map(|(force, normal)| force / normal.abs()).reduce(f64::max)?;
    let allowed_mm = 1e3 * rests_n / environment.normal_stiffness_n_m;
    told.then(|| {
        format!(
            "the daemon takes the surface to be where environment.contact_point_m is: met deeper by more than some {allowed_mm:.1} mm \
             (minimum_force by stiffness) it is left again; environment.contact = \"detected\" finds it"
        )
    })
}

/// Which axes the arm controls.
fn controlled(config: &Config) -> [bool; TASK_AXES] {
    let (axes, count) = (config.robot.controlled(), config.robot.task_axes as usize);
    std::array::from_fn(|axis| axis < count && axes.has(axis))
}

fn publisher(node: &Node, settings: &IpcSettings) -> Result<Publisher<TwistSample>, (Exit, String)> {
    let unavailable = |why: String| (Exit::Unavailable, why);
    let service = services::twist(node, &settings.instance, Access::Open).map_err(|error| match error {
        ServiceError::NotFound { .. } => unavailable(format!("nobody follows: {error}")),
        error => unavailable(error.to_string()),
    })?;
    service.publisher().map_err(|error| unavailable(error.to_string()))
}

/// This program's samples.
struct Leader {
    publisher: Publisher<TwistSample>,
    boot_id: u64,
    sequence: u64,
}

impl Leader {
    fn say(&mut self, frame: TwistFrame, twist: [f64; TASK_AXES]) -> Result<(), (Exit, String)> {
        self.sequence += 1;
        let sample = TwistSample {
            sequence: self.sequence,
            stamp_ns: monotonic_ns(),
            boot_id: self.boot_id,
            valid_for_ns: VALID_NS,
            frame: frame.code(),
            twist,
            ..TwistSample::zeroed()
        };
        let sent = self.publisher.send_copy(sample);
        sent.map(drop)
            .map_err(|error| (Exit::Unavailable, format!("the twist was not sent: {error:?}; nobody leads any more")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_above_zero_and_end() {
        assert_eq!(seconds("0.25"), Ok(Duration::from_millis(250)));
        for text in ["0", "-1", "nan", "inf", "3601", "a while"] {
            assert!(seconds(text).is_err_and(|why| why.contains("accepted: seconds above 0")), "{text}");
        }
    }
}
