//! Records of real processes: written, read by others, replayed to the bit, watched; and no reader disturbs the daemon.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use end_to_end::closed_loop::MPC_DEFAULT;
use end_to_end::session::{
    CONTRADICTION, MPC_PAPER, PAPER_SCENARIO, PATIENT, ctl_command, output, run_plant, start_daemon, wait_for_log,
    with_keys, write,
};
use end_to_end::{Child, Need, PATIENCE, PrivateIpc, binaries, needs, python, screen};
use ipc_types::RecordKind;
use ipc_types::services::{self, Access};
use mcap::records::Record;

/// Tests are not built for release: the command acts after a millisecond instead of the demo's quarter.
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

/// Every record of an MCAP file, chunks unpacked.
fn mcap_records(file: &Path) -> Vec<Record<'static>> {
    let bytes = std::fs::read(file).expect("the recording is there");
    let reader = mcap::read::ChunkFlattener::new(&bytes).expect("an MCAP file that is complete");
    reader.map(|record| record.expect("a sound file").into_owned()).collect()
}

/// Writes a recording again with one bit of one command changed: the last of the joint velocity offset's first element, in
/// the middle of the contact. Returns the sequence of its record.
fn with_altered_bit(original: &Path, altered: &Path) -> u64 {
    let records = mcap_records(original);
    let topics: BTreeMap<u16, String> = records
        .iter()
        .filter_map(|record| match record {
            Record::Channel(channel) => Some((channel.id, channel.topic.clone())),
            _ => None,
        })
        .collect();
    let is_command = |id: u16| topics.get(&id).is_some_and(|topic| topic == "/command");
    let json = |data: &[u8]| serde_json::from_slice::<serde_json::Value>(data).expect("JSON");
    let in_contact: Vec<usize> = (0..records.len())
        .filter(|index| match &records[*index] {
            Record::Message { header, data } => is_command(header.channel_id) && json(data)["active_axes"] != 0,
            _ => false,
        })
        .collect();
    let target = in_contact[in_contact.len() / 2];
    let mut sequence = 0;
    let mut writer = mcap::Writer::new(BufWriter::new(File::create(altered).expect("a new file"))).expect("a header");
    for (index, record) in records.into_iter().enumerate() {
        match record {
            Record::Metadata(metadata) => writer.write_metadata(&metadata).expect("written"),
            Record::Attachment { header, data, .. } => {
                let (log_time, create_time) = (header.log_time, header.create_time);
                let (name, media_type) = (header.name, header.media_type);
                writer.attach(&mcap::Attachment { log_time, create_time, name, media_type, data }).expect("written");
            }
            Record::Schema { header, data } => {
                writer.add_schema_with_id(header.id, &header.name, &header.encoding, &data).map(drop).expect("written");
            }
            Record::Channel(channel) => {
                writer
                    .add_channel_with_id(
                        channel.id,
                        channel.schema_id,
                        &channel.topic,
                        &channel.message_encoding,
                        &channel.metadata,
                    )
                    .map(drop)
                    .expect("written");
            }
            Record::Message { header, data } => {
                let mut data = data.into_owned();
                if index == target {
                    let mut command = json(&data);
                    let value = command["joint_velocity_offset"][0].as_f64().expect("a number");
                    command["joint_velocity_offset"][0] = f64::from_bits(value.to_bits() ^ 1).into();
                    sequence = u64::from(header.sequence);
                    data = command.to_string().into_bytes();
                }
                writer.write_to_known_channel(&header, &data).expect("written");
            }
            _ => {}
        }
    }
    writer.finish().expect("written");
    sequence
}

#[test]
fn a_recorded_contact_is_replayed_to_the_bit() {
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
    assert!(tally.contains("gaps: 0,"), "{tally}");

    let (code, text) = replay(&whole);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("the controller was fresh"), "{text}");
    let compared = number_before(&text, " cycles, bit-identical");
    // All but the silences before the first sample and after the last order.
    let recorded = number_before(&tally, " records;");
    assert!(compared + 20 > recorded, "{compared} of {recorded}: {text}");

    let (code, text) = replay(&late);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("after 128 cycles in free motion"), "{text}");
    let of_late = number_before(&text, " cycles, bit-identical");
    assert!(of_late < compared && of_late > 100, "the contact is among the {of_late} of {compared} cycles: {text}");

    // One bit, in one cycle of the contact.
    let altered = ipc.directory().join("altered.mcap");
    let sequence = with_altered_bit(&whole, &altered);
    let (code, text) = replay(&altered);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains(&format!("(record {sequence}, ")), "record {sequence}: {text}");
    assert!(text.contains("command.joint_velocity_offset[0]"), "{text}");
    // Another configuration differs somewhere, and in the contact at the earliest.
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
    assert_eq!(page.matches("<figure>").count(), 3);
    assert!(page.contains("true, in force") && page.contains("peak true |f_y| in N"), "{page}");
    for number in 3..=5 {
        assert!(report.join(format!("figure-{number}.svg")).exists());
    }

    read_with_python(&whole, true);
}

#[test]
fn orders_and_a_new_configuration_are_replayed_too() {
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
    // On a machine that is not too busy the first is refused; what matters is that the replay has it end the same way.
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
        let kind = format!("\"kind\":{},", kind.code());
        let is_one = |record: &Record<'_>| match record {
            Record::Message { data, .. } => String::from_utf8_lossy(data).contains(&kind),
            _ => false,
        };
        assert!(mcap_records(&file).iter().any(is_one), "no record with {kind}");
    }
    let (code, text) = replay(&file);
    assert_eq!(code, Some(0), "{text}");
    println!("{text}");
    assert!(number_before(&text, " cycles, bit-identical") > 500, "{text}");
}

#[test]
fn a_killed_recorder_leaves_what_it_had_flushed() {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", &patient_default());
    let mut daemon = start_daemon(&ipc, &config);
    let file = ipc.directory().join("killed.mcap");
    let mut recorder = start_recorder(&ipc, &config, &file);
    let truths = run_plant(&ipc, &paper_scenario(&ipc), |truth| {
        if truth.scenario_time_s > 1.5 {
            recorder.signal(libc::SIGKILL);
        }
    });
    assert_eq!(recorder.wait_for_exit(PATIENCE).code(), None, "killed");
    assert!(daemon.exit_status().is_none(), "{}", daemon.report());
    let before = truths.iter().filter(|truth| truth.scenario_time_s <= 1.5).count() as u64;
    let (code, text) = replay(&file);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("breaks off"), "{text}");
    let compared = number_before(&text, " cycles, bit-identical");
    println!("{compared} of {before} cycles before the kill are readable");
    // A recorder that only writes at its end, or full chunks, would have left nothing.
    assert!(compared > 200 && compared <= before + 20, "{compared} of {before}: {text}");
    read_with_python(&file, false);
}

/// The PyPI package sees the same channels, schemas and configuration. It tells the number of cycles.
fn read_with_python(file: &Path, complete: bool) {
    if !needs(Need::Python) {
        return;
    }
    let script = r#"
import collections, json, sys
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.records import Attachment, Channel, Footer, Message, Metadata, Schema

counts, keys, topics, schemas = collections.Counter(), {}, {}, {}
attachments, metadata, complete = [], [], False
try:
    with open(sys.argv[1], "rb") as file:
        for record in StreamReader(file, record_size_limit=None).records:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                topics[record.id] = record
            elif isinstance(record, Message):
                channel = topics[record.channel_id]
                schema = json.loads(schemas[channel.schema_id].data)
                message = json.loads(record.data)
                assert channel.message_encoding == "json"
                assert schemas[channel.schema_id].encoding == "jsonschema" and schema["type"] == "object"
                for name, field in schema["properties"].items():
                    # All that Foxglove takes.
                    assert field["type"] in ("number", "integer", "array"), name
                    assert field["type"] != "array" or field["items"]["type"] in ("number", "integer"), name
                assert set(message) == set(schema["required"]) == set(schema["properties"]), channel.topic
                counts[channel.topic] += 1
            elif isinstance(record, Attachment):
                attachments.append((record.name, record.data.decode()))
            elif isinstance(record, Metadata):
                metadata.append((record.name, record.metadata))
            elif isinstance(record, Footer):
                complete = True
except McapError as error:
    print("breaks off:", error, file=sys.stderr)
if complete:
    with open(sys.argv[1], "rb") as file:
        reader = make_reader(file)
        assert sum(1 for _ in reader.iter_messages(topics=["/cycle"])) == counts["/cycle"]
        assert next(reader.iter_attachments()).name == "configuration-0.toml"
print(json.dumps({"counts": counts, "attachments": attachments, "metadata": metadata, "complete": complete}))
"#;
    let mut reader = Command::new(python().expect("needs(Python) found one"));
    let Output { status, stdout, stderr } = reader.arg("-c").arg(script).arg(file).output().expect("python starts");
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    let found: serde_json::Value = serde_json::from_slice(&stdout).expect("one JSON object");
    assert_eq!(found["complete"], complete);
    assert_eq!(found["metadata"][0][0], "admittanced");
    let configuration = found["attachments"][0][1].as_str().expect("a text");
    assert!(configuration.contains("[mpc]"), "{configuration}");
    let count = |topic: &str| found["counts"][topic].as_u64().unwrap_or(0);
    assert!(count("/state") > 200 && count("/cycle") >= count("/command"), "{}", found["counts"]);
    assert!(count("/command") >= count("/state") && count("/truth") > 200, "{}", found["counts"]);
}

#[test]
fn a_subscriber_that_never_reads_does_not_disturb_the_daemon() {
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
    let diagnostics = &status["diagnostics"];
    assert_eq!((&diagnostics["records_dropped"], &diagnostics["fallback_count"]), (&0.into(), &0.into()), "{status}");
    // The daemon has seen what the plant has published, but for what the machine was too busy for.
    let answered =
        diagnostics["cycles"].as_u64().expect("a number") + diagnostics["missed_count"].as_u64().expect("a number");
    assert!(answered + 20 > truths.len() as u64, "{answered} of {}: {status}", truths.len());

    let mut sequences = Vec::new();
    while let Ok(Some(record)) = records.receive() {
        sequences.push(record.sequence);
    }
    // The newest ones, and none is missing among them; the daemon goes on while they are read.
    assert!(sequences.len() as u64 >= qos, "{}", sequences.len());
    assert!(sequences[0] > 1, "what overflowed is gone");
    assert!(sequences.windows(2).all(|pair| pair[1] == pair[0] + 1), "{sequences:?}");
}

#[test]
fn a_recorder_that_cannot_write_says_so_and_the_daemon_goes_on() {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", &patient_default());
    let record = |file: &str, more: &[&str]| output(ctl_command(&ipc, "record", &config).arg(file).args(more));
    let (code, text) = record("x.mcap", &[]);
    assert_eq!((code, text.contains("is admittanced running")), (Some(69), true), "{text}");
    let mut daemon = start_daemon(&ipc, &config);
    let (code, text) = record("/no/such/directory/x.mcap", &[]);
    assert_eq!((code, text.contains("/no/such/directory/x.mcap")), (Some(73), true), "{text}");
    let existing = write(&ipc, "existing.mcap", "precious");
    let (code, text) = record(&existing.to_string_lossy(), &[]);
    assert_eq!((code, text.contains("--overwrite")), (Some(73), true), "{text}");
    assert_eq!(std::fs::read_to_string(&existing).expect("it is there"), "precious");
    // A disk that is full.
    let (code, text) = record("/dev/full", &["--overwrite"]);
    assert_eq!((code, text.contains("No space left")), (Some(74), true), "{text}");
    let (code, text) = record(&existing.to_string_lossy(), &["--overwrite", "--seconds", "0.2"]);
    assert_eq!((code, text.contains(" records; gaps: 0,")), (Some(0), true), "{text}");
    let (code, text) = replay(&existing);
    assert_eq!((code, text.contains("no cycle can be compared")), (Some(65), true), "{text}");
    let (code, text) = replay(&config);
    assert_eq!((code, text.contains("no MCAP file")), (Some(65), true), "{text}");
    daemon.terminate();
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
}

#[test]
fn top_shows_mode_and_force_and_gives_the_terminal_back() {
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
    let mut seen = None;
    run_plant(&ipc, &paper_scenario(&ipc), |truth| {
        if truth.scenario_time_s > 1.0 && seen.is_none() {
            let (text, _) = screen(&top);
            seen = Some(text).filter(|text| text.contains("Contact  feasible"));
        }
    });
    let seen = seen.expect("the contact was seen");
    println!("{seen}");
    // The force on y as it was shown, in newtons: pushing down, below the limit.
    let line =
        seen.lines().find(|line| line.contains("*y ") && line.contains("of 200.0 N")).expect("axis y in contact");
    let force = line.split("*y ").nth(1).and_then(|rest| rest.split_whitespace().next()).expect("a number");
    assert!((-200.0..-5.0).contains(&force.parse::<f64>().expect("a number")), "{line}");
    for text in
        ["N to spare on", "answer, last second", "p99.9", "fallback 0", "records dropped 0", "s  Free", "s  Idle"]
    {
        assert!(seen.contains(text), "{text:?} is missing in\n{seen}");
    }

    terminal.keys("q");
    assert_eq!(top.wait_for_exit(PATIENCE).code(), Some(0), "{}", top.report());
    other.terminate();
    assert_eq!(other.wait_for_exit(PATIENCE).code(), Some(0), "{}", other.report());
    for (top, terminal) in [(&top, &terminal), (&other, &other_terminal)] {
        assert!(!screen(top).1 && terminal.echoes(), "the terminal is as it was");
    }
}
