//! What a person sees of the law, by the programs themselves: daemon, plant-sim and admittancectl over
//! shared memory, in lock step, so that no machine is too busy for it.

use std::process::Command;

use end_to_end::closed_loop::{MPC_DEFAULT, NORMAL};
use end_to_end::lock_step::{LockStep, Moment};
use end_to_end::session::{PAPER_SCENARIO, output, wait_for_log, with_keys};
use end_to_end::{Child, PATIENCE, binaries, fresh, share};
use ipc_types::{Mode, Motion, StopReason};
use serde_json::Value;

const SIX_JOINT: &str = include_str!("../../deploy/robots/six-joint.toml");
const SIX_JOINT_SCENARIO: &str = include_str!("../../plant-sim/scenarios/six-joint.toml");
/// f_max of the demo's axes, N.
const LIMIT_N: f64 = 200.0;

/// Checks at some instants of contact within a cycle, and at one that nobody has chosen.
fn at_instants(check: fn(f64)) {
    [0.1, 0.6].into_iter().for_each(check);
    fresh(|seed| check(share(seed, 0)));
}

/// A text without a key of a section.
fn without(text: &str, section: &str, key: &str) -> String {
    let mut table: toml::Table = text.parse().expect("TOML");
    table[section].as_table_mut().expect("a section").remove(key).expect("the key is there");
    table.to_string()
}

/// The paper's cell without command delay at this cycle time (s), first contact at 0.2 s.
fn paper(sampling_time_s: f64, config: &[(&str, &str)], scenario: &[(&str, &str)]) -> (String, String) {
    let [period, age, budget] = [1.0, 3.0, 0.5].map(|part| format!("{:?}", part * sampling_time_s));
    let of_config = [
        ("control.sampling_time_s", period.as_str()),
        ("control.max_sample_age_s", &age),
        ("control.answer_budget_s", &budget),
        ("control.command_delay_s", "0.0"),
    ];
    let of_scenario = [
        ("timing.sampling_time_s", period.as_str()),
        ("timing.command_delay_s", "0.0"),
        ("timing.settle_s", "0.06"),
        ("start.contact_time_s", "0.2"),
    ];
    (
        with_keys(MPC_DEFAULT, &[&of_config, config].concat()),
        with_keys(PAPER_SCENARIO, &[&of_scenario, scenario].concat()),
    )
}

/// A motion of (duration in s, speed straight down in m/s).
fn down(phases: &[(f64, f64)]) -> String {
    let phase =
        |(duration_s, speed): &(f64, f64)| format!("{{ duration_s = {duration_s:?}, twist = [0.0, {:?}] }}", -speed);
    format!("[{}]", phases.iter().map(phase).collect::<Vec<_>>().join(", "))
}

fn peak(moments: &[Moment]) -> f64 {
    moments.iter().map(|at| at.truth.peak_normal_force_n).fold(0.0, f64::max)
}

fn is_in(at: &Moment, mode: Mode) -> bool {
    at.command.mode == mode.code()
}

/// The first reason of a stop.
fn stop_reason(moments: &[Moment]) -> Option<StopReason> {
    let stop = moments.iter().find(|at| at.command.stop_reason != StopReason::NONE)?;
    StopReason::from_code(stop.command.stop_reason)
}

/// What f̂ shows of a force into the paper's surface, N.
fn pressing(at: &Moment) -> f64 {
    -(0..2).map(|axis| NORMAL[axis] * at.state.wrench[axis]).sum::<f64>()
}

/// Commanded speed out of the paper's surface, m/s; what is held is not commanded.
fn commanded(at: &Moment) -> f64 {
    if at.command.motion == Motion::Hold.code() {
        return 0.0;
    }
    (0..2).map(|axis| NORMAL[axis] * (at.state.twist_reference[axis] + at.command.velocity_offset[axis])).sum()
}

/// A floor 0.33 m below the base's origin: a plane through the origin would press with 33 kN.
#[test]
fn a_floor_that_nobody_told_is_pressed_on_as_one_that_was() {
    at_instants(|share| {
        let found = without(SIX_JOINT, "environment", "contact_point_m");
        let found = with_keys(&found, &[("environment.contact", "\"detected\"")]);
        let scenario = with_keys(SIX_JOINT_SCENARIO, &[("start.contact_phase", &format!("{share:?}"))]);
        let [told, found] = [SIX_JOINT, &found].map(|config| {
            let mut cell = LockStep::new(config);
            let moments = cell.run(&scenario, |_, _| {});
            let log = cell.daemon.stderr();
            assert_eq!(stop_reason(&moments), None, "contact at {share}: {log}");
            assert!(log.contains("INFO Contact") && !log.contains("Stop"), "{log}");
            let last = moments.last().expect("a run");
            assert!(is_in(last, Mode::Contact) && last.truth.contact_losses == 0, "contact at {share}: {log}");
            (peak(&moments), last.truth.normal_force_n)
        });
        println!("contact at {share}: peak and settled force {told:.1?} N told, {found:.1?} N found");
        assert!(told.0 <= 150.5 && found.0 <= 150.5, "{} N, {} N", told.0, found.0);
        assert!((found.1 - 6.0).abs() < 0.5, "settled at {} N", found.1);
    });
}

/// Faster than can be kept, as told and with a millisecond that nobody told.
#[test]
fn a_stop_never_moves_inward_and_a_contact_no_faster_than_the_approach() {
    at_instants(|share| {
        let (mut stops, mut contacts) = (0, 0);
        for (sampling_time_s, speed, late_s) in [(0.004, 0.3, "0.001"), (0.004, 0.6, "0.001"), (0.001, 0.8, "0.001")] {
            let (motion, share) = (down(&[(0.5, speed)]), format!("{share:?}"));
            let (config, scenario) = paper(
                sampling_time_s,
                &[("limits.velocity_offset", "[20.0, 20.0]")],
                &[("motion", &motion), ("timing.command_delay_s", late_s), ("start.contact_phase", &share)],
            );
            let mut cell = LockStep::new(&config);
            let moments = cell.run(&scenario, |_, _| {});
            let what = format!("{speed} m/s at {sampling_time_s} s, {late_s} s late, contact at {share}");
            for at in &moments {
                let inward = -commanded(at);
                if is_in(at, Mode::Stopping) || is_in(at, Mode::Stopped) {
                    stops += 1;
                    assert!(inward <= 1e-6, "{what}: {inward} m/s in a stop");
                } else if is_in(at, Mode::Contact) {
                    contacts += 1;
                    assert!(inward <= speed * NORMAL[1] + 1e-6, "{what}: {inward} m/s in contact");
                }
            }
            let rest = moments.last().expect("a run").truth.normal_force_n;
            println!("{what}: {:?}, peak {:.0} N, rests at {rest:.1} N", stop_reason(&moments), peak(&moments));
            assert!(stop_reason(&moments).is_none() || rest <= LIMIT_N / 2.0, "{what}: {rest} N");
        }
        assert!(stops > 100 && contacts > 3, "{stops} cycles of stops, {contacts} of contacts");
    });
}

/// A tool between sensor and surface, of which the daemon knows nothing, with a mass in kg.
fn tool(mass_kg: f64) -> String {
    format!(
        "{{ origin_m = [-0.15, 0.0, 0.0], tool_mass_kg = {mass_kg:?}, tool_center_of_gravity_m = [-0.06, 0.02, 0.0] }}"
    )
}

/// How long the wrench pulled by more than β before the arm touched, in cycles and at once.
fn pulled(moments: &[Moment]) -> usize {
    let pulls: Vec<bool> =
        moments.iter().take_while(|at| at.truth.in_contact == 0).map(|at| pressing(at) < -5.0).collect();
    pulls.split(|pulls| !pulls).map(<[bool]>::len).max().unwrap_or(0)
}

/// The arm becomes a little faster while it moves in, and the mass of its tool pulls on the sensor.
#[test]
fn a_tool_that_pulls_for_a_moment_holds_nobody() {
    let mut met = 0;
    for faster in [0.116, 0.118, 0.12] {
        let motion = down(&[(0.05, 0.04), (0.1, 0.08), (0.4, 0.08 + faster)]);
        let tool = tool(1.0);
        let keys = [("motion", motion.as_str()), ("sensor", &tool), ("wrench.time_constant_s", "[0.002, 0.002]")];
        let (config, scenario) = paper(0.001, &[("contact.wrench_time_constant_s", "[0.002, 0.002]")], &keys);
        let mut cell = LockStep::new(&config);
        let moments = cell.run(&scenario, |_, _| {});
        let (longest, reason) = (pulled(&moments), stop_reason(&moments));
        let touch = moments.iter().position(|at| at.truth.in_contact == 1);
        println!("{faster} m/s faster: {longest} cycles of pull at once; touch at {touch:?}, {reason:?}");
        if (1..=5).contains(&longest) {
            met += 1;
            let touch = touch.unwrap_or_else(|| panic!("held before the touch: {}", cell.daemon.stderr()));
            let until = &moments[..touch + 10];
            assert_eq!(stop_reason(until), None, "{faster} m/s faster: {}", cell.daemon.stderr());
            assert!(until.iter().any(|at| is_in(at, Mode::Contact)), "{faster} m/s faster");
        }
    }
    assert!(met > 0, "no tool pulls for a moment");
}

/// Twice as hard as told, and fast: above the limit, below the guard, so nothing stops.
#[test]
fn samples_beyond_the_limit_are_in_status_and_report() {
    let (motion, stiffness) = (down(&[(0.6, 0.5)]), ("surface.stiffness_n_m", "2e5"));
    let (config, scenario) = paper(0.001, &[], &[("motion", &motion), stiffness]);
    let mut cell = LockStep::new(&config);
    let recording = cell.directory().join("beyond.mcap");
    let mut recorder = Child::spawn(&mut cell.ctl(&["record", &recording.to_string_lossy()]));
    wait_for_log(&mut recorder, "recording admittanced/");
    let moments = cell.run(&scenario, |_, _| {});
    let (json, text) = (cell.ask(&["status", "--json"]), cell.ask(&["status"]));
    let force = moments.iter().flat_map(|at| at.truth.peak_wrench.map(f64::abs)).fold(0.0, f64::max);
    assert!(force > LIMIT_N + 0.5 && stop_reason(&moments).is_none(), "{force} N, {:?}", stop_reason(&moments));
    let status: Value = serde_json::from_str(&json).unwrap_or_else(|error| panic!("{error}: {json}"));
    let count = status["exceeded_count"].as_u64().expect("a number");
    println!("{force:.1} N; {count} samples beyond the limit");
    assert!(count > 0, "{json}");
    assert!(text.contains(&format!("force exceeded {count},")), "{text}");

    recorder.signal(libc::SIGINT);
    assert_eq!(recorder.wait_for_exit(PATIENCE).code(), Some(0), "{}", recorder.report());
    let directory = cell.directory().join("report");
    let mut report = Command::new(&binaries().admittancectl);
    let (code, text) = output(report.arg("report").arg(&recording).arg("--directory").arg(&directory));
    assert_eq!(code, Some(0), "{text}");
    let page = std::fs::read_to_string(directory.join("index.html")).expect("a page");
    let row = page.split("samples with the force beyond its limit").nth(1).expect("a row");
    let row = row.split("</tr>").next().unwrap_or_default();
    assert!(row.contains(&format!(">{count}<")), "{count}: {row}");
}
