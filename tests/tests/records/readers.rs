//! Other readers while the daemon runs: a subscriber, and `admittancectl top`.

use std::process::Command;

use end_to_end::session::{
    MPC_PAPER, PAPER_SCENARIO, PATIENT, ctl_command, output, run_plant, start_daemon, with_keys, write,
};
use end_to_end::{Child, PATIENCE, PrivateIpc, binaries, screen, undisturbed};
use ipc_types::services::{self, Access};

use crate::{paper_scenario, patient_default};

/// Holds `status --json` to `status --schema`.
fn has_the_keys_of_its_schema(status: &serde_json::Value) {
    let (code, schema) = output(Command::new(&binaries().admittancectl).args(["status", "--schema"]));
    let schema: serde_json::Value = serde_json::from_str(&schema).expect("one JSON object");
    assert_eq!((code, &schema["properties"]["version"]["const"]), (Some(0), &status["version"]));
    let keys = status.as_object().expect("an object");
    assert!(keys.keys().all(|key| schema["properties"].get(key).is_some()), "{status}");
    let required = schema["required"].as_array().expect("a list");
    assert!(required.iter().all(|key| keys.contains_key(key.as_str().expect("a name"))), "{status}");
}

#[test]
fn a_subscriber_that_never_reads_does_not_disturb_the_daemon() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let fast =
            [("control.sampling_time_s", "0.001"), ("control.answer_budget_s", "0.001"), ("control.spin_s", "0.0003")];
        let config = write(&ipc, "daemon.toml", &with_keys(MPC_PAPER, &[&PATIENT[..], &fast[..]].concat()));
        let _daemon = start_daemon(&ipc, &config);
        let node = ipc.settings().node("test").expect("a node");
        let service = services::record(&node, &ipc.settings().instance, Access::Open).expect("the daemon made it");
        let records = service.subscriber().expect("a subscriber");
        let qos = services::RECORD.qos.subscriber_max_buffer_size as u64;
        // More cycles in free motion than the buffer holds.
        let changes = [
            ("timing.sampling_time_s", "0.001"),
            ("timing.command_delay_s", "0.0005"),
            ("motion", "[{ duration_s = 4.5, twist = [0.0, 0.01] }]"),
            ("start.contact_time_s", "1.0"),
        ];
        let scenario = with_keys(PAPER_SCENARIO, &changes);
        let scenario = scenario.replace("contact_time_s = 1.0\n", "");
        let truths = run_plant(&ipc, &write(&ipc, "scenario.toml", &scenario), |_| {});
        assert!(truths.len() as u64 > qos, "{} samples fit into the buffer", truths.len());
        let (code, status) = output(ctl_command(&ipc, "status", &config).arg("--json"));
        assert_eq!(code, Some(0), "{status}");
        let status: serde_json::Value = serde_json::from_str(&status).expect("one JSON object");
        assert_eq!((&status["version"], &status["verdict"]), (&1.into(), &"None".into()), "{status}");
        assert!(status.get("verdict_axis").is_none(), "of no verdict: {status}");
        assert_eq!((&status["records_dropped"], &status["fallback_count"]), (&0.into(), &0.into()), "{status}");
        // The daemon has seen every sample that the plant has published, except those missed on a
        // busy machine.
        let number = |key: &str| status[key].as_u64().expect("a number");
        let answered = number("cycles") + number("missed_count");
        assert!(answered + 20 > truths.len() as u64, "{answered} of {}: {status}", truths.len());
        // The daemon has been silent before and after: no silence is a sample.
        assert!(number("cycles") <= truths.len() as u64 + 1, "{status}");
        assert_eq!(number("rejected_count"), 0, "{status}");
        has_the_keys_of_its_schema(&status);

        let mut sequences = Vec::new();
        while let Ok(Some(record)) = records.receive() {
            sequences.push(record.sequence);
        }
        // The newest ones, and none is missing among them; the daemon goes on while they are read.
        assert!(sequences.len() as u64 >= qos, "{}", sequences.len());
        assert!(sequences[0] > 1, "what overflowed is gone");
        assert!(sequences.windows(2).all(|pair| pair[1] == pair[0] + 1), "{sequences:?}");
    });
}

#[test]
fn top_shows_mode_and_force_and_gives_the_terminal_back() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &patient_default());
        let (code, text) = output(&mut ctl_command(&ipc, "top", &config));
        assert_eq!((code, text.contains("admittancectl status")), (Some(64), true), "no terminal: {text}");
        let (mut top, _terminal) = Child::spawn_on_terminal(&mut ctl_command(&ipc, "top", &config));
        assert_eq!(top.wait_for_exit(PATIENCE).code(), Some(69), "no daemon: {}", top.stdout());
        assert!(top.stdout().contains("is admittanced running"), "{}", top.stdout());

        let _daemon = start_daemon(&ipc, &config);
        let (mut top, mut terminal) = Child::spawn_on_terminal(&mut ctl_command(&ipc, "top", &config));
        let (mut other, other_terminal) = Child::spawn_on_terminal(&mut ctl_command(&ipc, "top", &config));
        for top in [&mut top, &mut other] {
            top.wait_until("the picture", PATIENCE, |top| screen(top).0.contains("admittanced/planar  Idle"));
            assert!(screen(top).1, "a screen of its own");
        }
        assert!(!terminal.echoes(), "keys are not shown");
        let (mut seen, mut status) = (None, String::new());
        run_plant(&ipc, &paper_scenario(&ipc), |truth| {
            if truth.scenario_time_s > 1.0 && seen.is_none() {
                let (text, _) = screen(&top);
                seen = Some(text).filter(|text| text.contains("Contact  feasible"));
                status = output(ctl_command(&ipc, "status", &config).arg("--json")).1;
            }
        });
        let seen = seen.expect("the contact was seen");
        println!("{seen}");
        // The force on y as it was shown, in newtons: pushing down, below the limit.
        let line =
            seen.lines().find(|line| line.contains("*y ") && line.contains("of 200.0 N")).expect("axis y in contact");
        let force = line.split("*y ").nth(1).and_then(|rest| rest.split_whitespace().next()).expect("a number");
        assert!((-200.0..-5.0).contains(&force.parse::<f64>().expect("a number")), "{line}");
        for text in [
            "velocity offset (* in contact)",
            " m/s",
            " s ago, ",
            "the last one 0.",
            "of the last 100 ",
            "N to spare on",
            "answer, last second",
            "p99.9",
            "records dropped 0",
            "s  Free",
            "s  Idle",
        ] {
            assert!(seen.contains(text), "{text:?} is missing in\n{seen}");
        }
        let fallbacks = seen.split("fallback ").nth(1).and_then(|rest| rest.split_whitespace().next());
        assert!(fallbacks.is_some_and(|number| number.parse::<u64>().is_ok()), "{seen}");

        let status: serde_json::Value = serde_json::from_str(&status).expect("one JSON object");
        assert!(status["sample_age_ns"].as_u64().is_some_and(|age| age > 0), "{status}");
        assert_eq!((&status["verdict"], &status["active_axes"]), (&"Feasible".into(), &serde_json::json!(["x", "y"])));
        assert!(["x", "y"].contains(&status["verdict_axis"].as_str().expect("with a verdict")), "{status}");
        has_the_keys_of_its_schema(&status);
        // The plant has ended: what is shown of the force is as old as its last sample.
        top.wait_until("old forces", PATIENCE, |top| screen(top).0.contains("forces are as old"));

        terminal.keys("q");
        assert_eq!(top.wait_for_exit(PATIENCE).code(), Some(0), "{}", top.report());
        other.terminate();
        assert_eq!(other.wait_for_exit(PATIENCE).code(), Some(0), "{}", other.report());
        for (top, terminal) in [(&top, &terminal), (&other, &other_terminal)] {
            assert!(!screen(top).1 && terminal.echoes(), "the terminal is as it was");
        }
    });
}

#[test]
fn status_shows_what_is_believed_of_a_surface_of_which_a_range_is_told() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let range = [
            ("environment.stiffness_range_n_m", "[2e4, 2e5]"),
            ("environment.contact_tolerance_m", "0.001"),
            ("environment.wrench_noise_n", "0.2"),
        ];
        let config = write(&ipc, "daemon.toml", &with_keys(&patient_default(), &range));
        let _daemon = start_daemon(&ipc, &config);
        let mut said = Vec::new();
        run_plant(&ipc, &paper_scenario(&ipc), |truth| {
            // Before the touch at 0.816 s, and long after.
            if truth.scenario_time_s > [0.3, 1.5, f64::INFINITY][said.len()] {
                let json = output(ctl_command(&ipc, "status", &config).arg("--json")).1;
                said.push((json, output(&mut ctl_command(&ipc, "status", &config)).1));
            }
        });
        let band = |json: &str| -> [f64; 2] {
            let json: serde_json::Value = serde_json::from_str(json).expect("one JSON object");
            has_the_keys_of_its_schema(&json);
            [0, 1].map(|end| json["believed_stiffness_band_n_m"][end].as_f64().expect("there was a sample"))
        };
        let [(before, text_before), (after, text_after)] = &said[..] else { panic!("{said:?}") };
        assert_eq!(band(before), [2e4, 2e5]);
        assert!(text_before.contains(" N/m, 20000 to 200000 (of a range that is told"), "{text_before}");
        let [least, most] = band(after);
        assert!(0.8e5 < least && least < 1e5 && 1e5 < most && most < 1.2e5, "{least} to {most} N/m: {text_after}");
        // The plant has left the surface. What f̂ showed while it faded was the softest of the range.
        let json = output(ctl_command(&ipc, "status", &config).arg("--json")).1;
        let left: serde_json::Value = serde_json::from_str(&json).expect("one JSON object");
        let likeliest = left["believed_stiffness_n_m"].as_f64().expect("there was a sample");
        assert!((0.8e5..1.2e5).contains(&likeliest), "{likeliest} N/m out of contact: {json}");
    });
}
