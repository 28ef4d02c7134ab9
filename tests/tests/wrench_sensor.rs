//! The wrench as it really comes: a heavy tool on a biased sensor that sits elsewhere, in axes of
//! its own, reports the reaction and has an end.

use std::path::PathBuf;

use admittance_host::config::parse;
use admittance_runner::config::Config;
use end_to_end::closed_loop::{Experiment, MPC_DEFAULT};
use end_to_end::session::{
    PAPER_SCENARIO, PATIENT, ctl_command, output, plant_command, run_plant, start_daemon, until, wait_for_log,
    with_keys, write,
};
use end_to_end::{Child, PATIENCE, PrivateIpc, undisturbed};
use ipc_types::{Fault, Source, StopReason};
use plant_sim::scenario::Scenario;

/// A tool of 2 kg on a standing arm, so that gravity acts in its plane.
const SENSOR: &str = "{ origin_m = [-0.1, 0.02, 0.0], rpy_rad = [0.3, -0.2, 2.0], reports_reaction = true, \
                      bias = [6.0, -9.0, 4.0, 0.5, -0.3, 0.2], tool_mass_kg = 2.0, \
                      tool_center_of_gravity_m = [-0.05, 0.01, 0.0], gravity_m_s2 = [0.0, -9.81, 0.0] }";
/// What a daemon must be told of it.
const COMPENSATION: &str = "{ given_in = \"sensor\", sensor_origin_m = [-0.1, 0.02, 0.0], sensor_rpy_rad = [0.3, -0.2, 2.0], \
                            sign = \"reaction\", bias = [6.0, -9.0, 4.0, 0.5, -0.3, 0.2], tool_mass_kg = 2.0, \
                            tool_center_of_gravity_m = [-0.05, 0.01, 0.0], gravity_m_s2 = [0.0, -9.81, 0.0] }";

/// The default profile on a surface that forgives answers that are late now and then, as they are
/// on a busy machine.
fn configuration(changes: &[(&str, &str)]) -> String {
    let soft = [("control.command_delay_s", "0.003"), ("environment.normal_stiffness_n_m", "2e4")];
    with_keys(MPC_DEFAULT, &[&PATIENT[..], &soft, changes].concat())
}

/// What the scenario commands.
const MOTION_S: f64 = 3.0;

fn scenario(ipc: &PrivateIpc, changes: &[(&str, &str)]) -> PathBuf {
    let soft = [
        ("timing.command_delay_s", "0.003"),
        ("surface.stiffness_n_m", "2e4"),
        ("motion", &format!("[{{ duration_s = {MOTION_S:?}, twist = [0.0, -0.05] }}]")),
    ];
    write(ipc, "scenario.toml", &with_keys(PAPER_SCENARIO, &[&soft[..], changes].concat()))
}

/// The paper's contact in virtual time with so many inputs per cycle, with what a sensor adds and what
/// the daemon removes.
fn virtual_contact(
    inputs: u32,
    sensor: &[(&str, &str)],
    compensation: &[(&str, &str)],
) -> end_to_end::closed_loop::Run {
    let config: Config = parse(&with_keys(MPC_DEFAULT, compensation), "controller.toml").expect("valid");
    let scenario: Scenario = parse(&with_keys(PAPER_SCENARIO, sensor), "scenario.toml").expect("valid");
    let mut experiment = Experiment::paper(0.004, 0.25);
    experiment.config.wrench = config.wrench;
    experiment.config.mpc.inputs_per_cycle = Some(inputs);
    experiment.scenario.sensor = scenario.sensor;
    experiment.run()
}

#[test]
fn compensated_the_contact_is_the_same_in_virtual_time() {
    // The velocity between two samples is taken to be a straight line. Several inputs bend it.
    for (inputs, left) in [(1, 0.01), (4, 0.05)] {
        let plain = virtual_contact(inputs, &[], &[]);
        let sensed = virtual_contact(inputs, &[("sensor", SENSOR)], &[("wrench", COMPENSATION)]);
        assert!(plain.touched() && plain.stop_reason().is_none());
        assert_eq!(plain.instants.len(), sensed.instants.len());
        let (mut differs, mut accelerated) = (0.0_f64, 0.0_f64);
        for (plain, sensed) in plain.instants.iter().zip(&sensed.instants) {
            let (force, compensated) = (plain.truth.normal_force_n, sensed.truth.normal_force_n);
            let felt = (0..2).map(|axis| (plain.report.wrench[axis] - sensed.report.wrench[axis]).abs());
            differs = felt.chain([(force - compensated).abs()]).fold(differs, f64::max);
            accelerated = accelerated.max((2.0 * sensed.tool_acceleration[0]).hypot(2.0 * sensed.tool_acceleration[1]));
        }
        println!("{inputs} inputs: {differs} N are left of {accelerated} N that accelerate the tool");
        assert!(accelerated > 20.0 && differs < left * accelerated, "{differs} N of {accelerated} N");
    }
    // Every part of it is needed.
    let wrong = [
        ("sign = \"reaction\", ", ""),
        ("tool_mass_kg = 2.0", "tool_mass_kg = 1.0"),
        ("bias = [6.0, -9.0", "bias = [0.0, 0.0"),
        ("2.0], sign", "0.0], sign"),
        ("given_in = \"sensor\", sensor_origin_m = [-0.1, 0.02, 0.0], sensor_rpy_rad = [0.3, -0.2, 2.0], ", ""),
    ];
    for (part, other) in wrong {
        let altered = COMPENSATION.replace(part, other);
        assert_ne!(altered, COMPENSATION, "{part}");
        let run = virtual_contact(4, &[("sensor", SENSOR)], &[("wrench", &altered)]);
        let felt = run.instants[0].report.wrench[..2].iter().map(|force| force.abs()).fold(0.0, f64::max);
        assert!(felt > 1.0, "{part}: {felt} N are felt in the air");
    }
}

#[test]
fn at_the_end_of_its_range_it_is_bad_data() {
    let (sensor, compensation) = ([("sensor", SENSOR)], [("wrench", COMPENSATION)]);
    let whole = virtual_contact(4, &sensor, &compensation);
    let largest = |in_contact: bool| {
        let of_mode = whole.instants.iter().filter(|at| (at.command.active_axes != 0) == in_contact);
        of_mode.flat_map(|at| at.state.wrench[..3].iter()).map(|force| force.abs()).fold(0.0, f64::max)
    };
    let (free, touching) = (largest(false), largest(true));
    assert!(touching > free + 4.0, "{free} N in the air, {touching} N in contact");
    // A range that ends in between.
    let end = (free + touching) / 2.0;
    let ending =
        |text: &str, key: &str| text.replace(" }", &format!(", {key} = [{end}, {end}, {end}, 90.0, 90.0, 90.0] }}"));
    let clipped = ending(SENSOR, "range");
    let told = ending(COMPENSATION, "saturation");
    let run = virtual_contact(4, &[("sensor", &clipped)], &[("wrench", &told)]);
    let first = run.instants.iter().find(|at| at.report.fault.is_some()).expect("it ends");
    assert_eq!(first.report.fault.map(|fault| fault.name()), Some(Fault::WrenchSaturated));
    assert_eq!(first.report.wrench, [0.0; 6], "the law saw nothing");
    assert_eq!(first.command.source, Source::Plan.code(), "the last plan goes on");
    assert!(run.peak_normal() < 200.0, "{} N", run.peak_normal());
    // Not told where the range ends, the daemon takes the clipped force for the force.
    let blind = virtual_contact(4, &[("sensor", &clipped)], &compensation);
    assert!(blind.instants.iter().all(|at| at.report.fault.is_none()));
}

#[test]
fn a_touch_of_nothing_is_told_of() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let weightless = |text: &str| text.replace("-9.81", "0.0");
        // Half of what makes 2 kg as fast as the tool sets off is taken for a touch.
        let told = weightless(COMPENSATION).replace("tool_mass_kg = 2.0", "tool_mass_kg = 1.0");
        let config = write(&ipc, "daemon.toml", &configuration(&[("wrench", &told)]));
        let mut daemon = start_daemon(&ipc, &config);
        let motion = format!("[{{ duration_s = {MOTION_S:?}, twist = [0.0, -0.25] }}]");
        let fast = [("sensor", weightless(SENSOR)), ("motion", motion)];
        let truths =
            run_plant(&ipc, &scenario(&ipc, &fast.each_ref().map(|(key, value)| (*key, value.as_str()))), |_| ());
        assert!(truths.iter().any(|truth| truth.normal_force_n > 0.0), "it goes on to the surface");
        for part in ["a contact was over after", "N at most", "each kg of the tool made", "check wrench.tool_mass_kg"] {
            wait_for_log(&mut daemon, part);
        }
    });
}

/// The plant's true normal force at its peak and settled, of a contact of real processes; what the
/// daemon says at the end.
fn real_contact(sensor: &[(&str, &str)], compensation: &[(&str, &str)]) -> ([f64; 2], serde_json::Value) {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", &configuration(compensation));
    let _daemon = start_daemon(&ipc, &config);
    let mut said = None;
    let truths = run_plant(&ipc, &scenario(&ipc, sensor), |truth| {
        // Settled, and before the plant leaves the surface.
        if truth.scenario_time_s > MOTION_S - 0.3 && said.is_none() {
            said = Some(output(ctl_command(&ipc, "status", &config).arg("--json")));
        }
    });
    let peak = truths.iter().map(|truth| truth.peak_normal_force_n).fold(0.0, f64::max);
    let pressed = until(&truths, MOTION_S);
    let end = &pressed[pressed.len() - pressed.len() / 10..];
    let settled = end.iter().map(|truth| truth.normal_force_n).sum::<f64>() / end.len() as f64;
    let (code, text) = said.expect("asked while it pressed");
    assert_eq!(code, Some(0), "{text}");
    ([peak, settled], serde_json::from_str(&text).expect("one JSON object"))
}

#[test]
fn compensated_the_contact_is_the_same_through_real_processes() {
    undisturbed(|| {
        let ([plain_peak, plain], status) = real_contact(&[], &[]);
        assert_eq!(status["stop_reason"], "None", "{status}");
        let ([peak, settled], status) = real_contact(&[("sensor", SENSOR)], &[("wrench", COMPENSATION)]);
        assert_eq!(status["stop_reason"], "None", "{status}");
        println!("peak {plain_peak:.1} and {peak:.1} N, settled {plain:.2} and {settled:.2} N");
        // A busy machine answers a cycle late now and then.
        assert!(peak < 210.0 && (plain - settled).abs() < 2.0, "{plain} N, and {settled} N with a sensor");
        // The status tells what the law sees: what presses, not what the tool weighs.
        let wrench: Vec<f64> = serde_json::from_value(status["wrench"].clone()).expect("numbers");
        let normal = -(0.42261826 * wrench[0] + 0.90630779 * wrench[1]);
        assert!((normal - settled).abs() < 3.0, "{normal} N of {settled} N");
        // A daemon that is told nothing takes the tool for a contact.
        let (_, status) = real_contact(&[("sensor", SENSOR)], &[]);
        assert_eq!(status["stop_reason"], "StartedInContact", "{status}");
    });
}

#[test]
fn a_saturated_sensor_stops_the_arm_and_the_log_says_why() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let sensor = SENSOR.replace(" }", ", range = [35.0, 35.0, 35.0, 90.0, 90.0, 90.0] }");
        let compensation = COMPENSATION.replace(" }", ", saturation = [35.0, 35.0, 35.0, 90.0, 90.0, 90.0] }");
        // The end of the range is in the contact for good: the force that is kept is beyond it.
        let kept = [("contact.minimum_force", "[6.0, 60.0]"), ("contact.normal_force_reference_n", "90.0")];
        let config = write(&ipc, "daemon.toml", &configuration(&[&kept[..], &[("wrench", &compensation)]].concat()));
        let mut daemon = start_daemon(&ipc, &config);
        run_plant(&ipc, &scenario(&ipc, &[("sensor", &sensor)]), |_| {});
        wait_for_log(&mut daemon, "is at the end of the sensor's range, wrench.saturation");
        let (code, text) = output(&mut ctl_command(&ipc, "status", &config));
        assert_eq!(code, Some(0), "{text}");
        assert!(text.contains(StopReason::SampleInvalid.name()) || daemon.stderr().contains("SampleInvalid"), "{text}");
    });
}

/// The daemon's process in frames that are not the base frame: a heavy tool on a sensor, a touch, a slide and its end.
#[test]
fn a_daemon_in_another_task_frame_presses_and_slides() {
    undisturbed(|| {
        for frame in ["{ frame = \"tool\" }", "{ frame = \"rpy\", rpy_rad = [0.0, 0.0, 0.7] }"] {
            let ([peak, settled], status) =
                real_contact(&[("sensor", SENSOR)], &[("wrench", COMPENSATION), ("task", frame)]);
            assert_eq!(status["stop_reason"], "None", "{frame}: {status}");
            println!("{frame}: peak {peak:.1} N, settled {settled:.2} N");
            assert!(peak < 290.0 && (4.0..60.0).contains(&settled), "{frame}: {peak} N, {settled} N");
        }
    });
}

#[test]
fn taring_in_free_motion_brings_the_bias_to_nothing_but_noise() {
    taring("base");
}

/// The bias is the sensor's, whatever frame the law works in.
#[test]
fn taring_in_a_frame_that_turns_with_the_tool_is_the_same() {
    taring("tool");
}

fn taring(frame: &str) {
    let frame = format!("{{ frame = \"{frame}\" }}");
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        // All but the last newtons of the bias are known.
        let known =
            COMPENSATION.replace("bias = [6.0, -9.0, 4.0, 0.5, -0.3, 0.2]", "bias = [5.0, -7.5, 4.0, 0.5, -0.3, 0.2]");
        let allowed = ("requests", "{ tare_bias_max = [10.0, 10.0, 10.0, 2.0, 2.0, 2.0] }");
        let config = write(&ipc, "daemon.toml", &configuration(&[("wrench", &known), allowed, ("task", &frame)]));
        let mut daemon = start_daemon(&ipc, &config);
        let motion = "[{ duration_s = 30.0, twist = [0.0, -0.001] }]";
        let changes =
            [("sensor", SENSOR), ("motion", motion), ("noise.wrench", "0.3"), ("start.contact_time_s", "29.0")];
        let _plant = Child::spawn(&mut plant_command(&ipc, &scenario(&ipc, &changes)));
        let mut tared = (None, String::new());
        daemon.wait_until("enough samples in free motion", PATIENCE, |_| {
            tared = output(&mut ctl_command(&ipc, "tare", &config));
            assert!(
                tared.0 == Some(0) || tared.1.contains("accepted in mode Free") || tared.1.contains("accepted: 200;"),
                "{tared:?}"
            );
            tared.0 == Some(0)
        });
        let text = tared.1;
        println!("{text}");
        assert!(text.contains("wrench bias x 5.000 -> ") && text.contains("the mean of 200 samples"), "{text}");
        let (_, status) = output(ctl_command(&ipc, "status", &config).arg("--json"));
        let status: serde_json::Value = serde_json::from_str(&status).expect("one JSON object");
        let bias: Vec<f64> = serde_json::from_value(status["wrench_bias"].clone()).expect("numbers");
        // 0.3 N of noise over 200 samples are 0.02 N.
        for (found, real) in bias.iter().zip([6.0, -9.0, 4.0, 0.5, -0.3, 0.2]) {
            assert!((found - real).abs() < 0.12, "{bias:?}");
        }
        let wrench: Vec<f64> = serde_json::from_value(status["wrench"].clone()).expect("numbers");
        assert!(wrench.iter().all(|force| force.abs() < 2.0), "{wrench:?}");
        assert_eq!(status["mode"], "Free");
        let (code, text) = output(&mut ctl_command(&ipc, "reload", &config));
        assert!(code == Some(0) && text.contains("-> 5.000 N"), "the file's bias holds again: {text}");
    });
}
