//! Records of real processes: written, read by other programs, replayed bit by bit, watched; and no
//! reader disturbs the daemon.

mod mcap_file;
mod python_reader;
mod readers;
mod recorder_failures;

use std::path::{Path, PathBuf};
use std::process::Command;

use end_to_end::closed_loop::MPC_DEFAULT;
use end_to_end::session::{
    CONTRADICTION, MPC_PAPER, PAPER_SCENARIO, PATIENT, ctl_command, output, run_plant, start_daemon, wait_for_log,
    with_keys, write,
};
use end_to_end::{Child, PATIENCE, PrivateIpc, binaries, certain, undisturbed};
use ipc_types::RecordKind;
use mcap::records::Record;
use mcap_file::{mcap_records, with_altered_bit};
use python_reader::read_with_python;

/// Tests are not built for release: the command acts after a millisecond instead of the demo's
/// quarter.
const DELAY: (&str, &str) = ("timing.command_delay_s", "0.001");

/// The default profile, for a machine that is busy for some cycles.
fn patient_default() -> String {
    with_keys(MPC_DEFAULT, &[&PATIENT[..], &[("control.command_delay_s", "0.001")]].concat())
}

fn paper_scenario(ipc: &PrivateIpc) -> PathBuf {
    write(ipc, "scenario.toml", &with_keys(PAPER_SCENARIO, &[DELAY]))
}

fn start_recorder(ipc: &PrivateIpc, config: &Path, file: &Path) -> Child {
    let mut recorder = Child::spawn(ctl_command(ipc, "record", config).arg(file));
    wait_for_log(&mut recorder, "recording admittanced/planar");
    recorder
}

/// Ends a recorder as Ctrl-C does.
fn end_recorder(mut recorder: Child) -> String {
    recorder.signal(libc::SIGINT);
    assert_eq!(recorder.wait_for_exit(PATIENCE).code(), Some(0), "{}", recorder.report());
    recorder.stdout()
}

fn replay(file: &Path) -> (Option<i32>, String) {
    output(Command::new(&binaries().admittancectl).arg("replay").arg(file))
}

/// The number before `words` in a text.
fn number_before(text: &str, words: &str) -> u64 {
    let before = text.split(words).next().expect("a part").split_whitespace().last().expect("a word");
    before.parse().unwrap_or_else(|_| panic!("no number before {words:?} in {text}"))
}

#[test]
fn a_recorded_contact_is_replayed_to_the_bit() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &patient_default());
        let daemon = start_daemon(&ipc, &config);
        let (whole, late) = (ipc.directory().join("whole.mcap"), ipc.directory().join("late.mcap"));
        let recorder = start_recorder(&ipc, &config, &whole);
        let mut late_recorder = None;
        let truths = run_plant(&ipc, &paper_scenario(&ipc), |truth| {
            // Well after the daemon, and well before the contact.
            if truth.sequence > 10 && late_recorder.is_none() {
                late_recorder = Some(start_recorder(&ipc, &config, &late));
            }
        });
        assert!(truths.iter().any(|truth| truth.in_contact == 1));
        let tally = end_recorder(recorder);
        end_recorder(late_recorder.expect("begun during the run"));
        drop(daemon);
        println!("{}", tally.trim());
        certain(|| assert!(tally.contains("gaps: 0,"), "{tally}"));

        let (code, text) = replay(&whole);
        certain(|| assert_eq!(code, Some(0), "{text}"));
        assert!(text.contains("the controller was fresh"), "{text}");
        let compared = number_before(&text, " cycles, bit-identical");
        // All except the silences before the first sample and after the last order.
        let recorded = number_before(&tally, " records;");
        assert!(compared + 20 > recorded, "{compared} of {recorded}: {text}");

        let (code, text) = replay(&late);
        // No machine excuses a difference; but one that takes the processors away breaks the free
        // motion that a recording begun late needs (exit 65).
        certain(|| assert_ne!(code, Some(1), "{text}"));
        assert_eq!(code, Some(0), "{text}");
        assert!(text.contains("after 128 cycles in free motion"), "{text}");
        let of_late = number_before(&text, " cycles, bit-identical");
        assert!(of_late < compared && of_late > 100, "the contact is among the {of_late} of {compared} cycles: {text}");

        // One bit, in one cycle of the contact.
        let altered = ipc.directory().join("altered.mcap");
        let sequence = with_altered_bit(&whole, &altered);
        let (code, text) = replay(&altered);
        certain(|| assert_eq!(code, Some(1), "{text}"));
        assert!(text.contains(&format!("(record {sequence}, ")), "record {sequence}: {text}");
        assert!(text.contains("command.joint_velocity_offset[0]"), "{text}");
        // Another configuration leads to a difference, at the earliest in contact.
        let other = write(&ipc, "other.toml", &with_keys(&patient_default(), &[("mpc.input_weight", "[20.0, 20.0]")]));
        let mut replay_other = Command::new(&binaries().admittancectl);
        let (code, text) = output(replay_other.arg("replay").arg(&whole).arg("--config").arg(other));
        assert_eq!(code, Some(1), "{text}");
        assert!(number_before(&text, " cycles before it are bit-identical") > 100, "{text}");

        let report = ipc.directory().join("report");
        let mut draw = Command::new(&binaries().admittancectl);
        let (code, text) = output(draw.arg("report").arg(&whole).arg("--directory").arg(&report));
        assert_eq!(code, Some(0), "{text}");
        let page = std::fs::read_to_string(report.join("index.html")).expect("a page");
        assert_eq!(page.matches("<figure>").count(), 4);
        assert!(page.contains("true, in force") && page.contains("Figure 1: mode and verdict"), "{page}");
        for number in 1..=4 {
            assert!(report.join(format!("figure-{number}.svg")).exists());
        }
        // Between samples the force was higher: the plant's own peak.
        let cell = |what: &str| {
            let row =
                page.split(&format!("<td>{what}</td><td>")).nth(1).unwrap_or_else(|| panic!("no {what} in {page}"));
            row.split('<').next().and_then(|number| number.parse::<f64>().ok()).expect("a number")
        };
        let peak = truths.iter().map(|truth| truth.peak_wrench[1].abs()).fold(0.0, f64::max);
        let at_samples = cell("of that at the instants of samples, as drawn, |f_y| in N");
        assert!(
            (cell("peak true |f_y| in N") - peak).abs() < 0.06 && at_samples < peak + 0.06,
            "{at_samples} of {peak} N"
        );

        read_with_python(&whole, true);
    });
}

#[test]
fn a_recording_that_begins_mid_run_is_replayed_whatever_pauses_the_controller_makes() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &patient_default());
        let _daemon = start_daemon(&ipc, &config);
        // Of 5 ms: before it begins, soon after, and in contact.
        let pauses = [0.0, 0.02, 0.1, 0.2, 0.6, 0.604, 0.9, 1.1];
        let pause = |at_s: &f64| format!("{{ at_s = {at_s:?}, duration_s = 0.004, kind = \"overrun\" }}");
        let faults = format!("[{}]", pauses.iter().map(pause).collect::<Vec<_>>().join(", "));
        let scenario = write(&ipc, "scenario.toml", &with_keys(PAPER_SCENARIO, &[DELAY, ("fault", &faults)]));
        let file = ipc.directory().join("late.mcap");
        let mut recorder = None;
        let truths = run_plant(&ipc, &scenario, |truth| {
            if truth.scenario_time_s > 0.03 && recorder.is_none() {
                recorder = Some(start_recorder(&ipc, &config, &file));
            }
        });
        end_recorder(recorder.expect("begun during the run"));
        let made = truths.windows(2).filter(|pair| pair[1].stamp_ns - pair[0].stamp_ns == 9_000_000).count();
        assert_eq!(made, pauses.len(), "pauses");
        let (code, text) = replay(&file);
        certain(|| assert_ne!(code, Some(1), "{text}"));
        assert_eq!(code, Some(0), "{text}");
        assert!(number_before(&text, " cycles, bit-identical") > 100, "{text}");
    });
}

#[test]
fn orders_and_a_new_configuration_are_replayed_too() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &with_keys(MPC_PAPER, &[&PATIENT[..], &[CONTRADICTION]].concat()));
        let mut daemon = start_daemon(&ipc, &config);
        let file = ipc.directory().join("orders.mcap");
        let recorder = start_recorder(&ipc, &config, &file);
        // An infeasible contact: a stop, a reset that is refused, a retreat, a reset that is not.
        let motion = "[{ duration_s = 0.8, twist = [0.0, -0.25] }, { duration_s = 1.5, twist = [0.0, 0.2] }]";
        let changes = [("motion", motion), ("start.contact_time_s", "0.4"), DELAY];
        let mut resets = Vec::new();
        run_plant(&ipc, &write(&ipc, "retreat.toml", &with_keys(PAPER_SCENARIO, &changes)), |truth| {
            if truth.scenario_time_s > [0.65, 1.9, f64::INFINITY][resets.len()] {
                resets.push(output(&mut ctl_command(&ipc, "reset", &config)).0);
            }
        });
        // On a machine that is not too busy the first is refused; what matters is that the replay
        // has it end the same way.
        println!("resets ended with {resets:?}");
        // With limits that can be met, touch again.
        write(&ipc, "daemon.toml", &with_keys(MPC_PAPER, &PATIENT));
        daemon.signal(libc::SIGHUP);
        wait_for_log(&mut daemon, "reload: the new configuration is in force");
        run_plant(&ipc, &paper_scenario(&ipc), |_| {});
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
        end_recorder(recorder);
        let attached = |record: &Record<'_>| matches!(record, Record::Attachment { .. });
        assert_eq!(mcap_records(&file).iter().filter(|record| attached(record)).count(), 2, "both configurations");
        for kind in [RecordKind::Reset, RecordKind::Stop, RecordKind::Replaced] {
            let kind = format!("\"kind\":\"{kind}\",");
            let is_one = |record: &Record<'_>| match record {
                Record::Message { data, .. } => String::from_utf8_lossy(data).contains(&kind),
                _ => false,
            };
            assert!(mcap_records(&file).iter().any(is_one), "no record with {kind}");
        }
        let (code, text) = replay(&file);
        certain(|| assert_eq!(code, Some(0), "{text}"));
        println!("{text}");
        assert!(number_before(&text, " cycles, bit-identical") > 500, "{text}");
    });
}
