//! Recordings in memory: whole, broken off, damaged.

use ipc_types::{CommandSample, RecordKind, RecordSample, StateSample, TruthSample};

use super::*;

/// A record that differs from others in every part.
fn record(sequence: u64) -> RecordSample {
    let mut state = StateSample { sequence, stamp_ns: 5_000 + sequence, ..StateSample::zeroed() };
    state.wrench = [0.1 + 0.2, -0.0, f64::NAN, f64::INFINITY, 5e-324, -1.0 / 3.0];
    let command = CommandSample { state_sequence: sequence, verdict_margin: 1e-17, ..CommandSample::zeroed() };
    RecordSample {
        sequence,
        boot_id: u64::MAX,
        now_ns: 6_000 + sequence,
        kind: RecordKind::Sample.code(),
        state,
        command,
        ..RecordSample::zeroed()
    }
}

fn written(finish: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = RecordingWriter::new(&mut bytes, "planar", "a = 1").expect("memory takes all");
    for sequence in 1..=3 {
        writer.record(&record(sequence)).expect("memory takes all");
    }
    writer.truth(&TruthSample { sequence: 9, ..TruthSample::zeroed() }).expect("memory takes all");
    writer.flush().expect("memory takes all");
    if finish {
        writer.configuration(3, "b = 2").expect("memory takes all");
        writer.finish().expect("memory takes all");
    } else {
        std::mem::forget(writer);
    }
    bytes
}

fn open(bytes: Vec<u8>) -> Recording {
    Recording::from_bytes(bytes, "test.mcap").expect("a recording")
}

fn read(bytes: Vec<u8>) -> (Vec<RecordSample>, usize, bool) {
    let recording = open(bytes);
    let (mut records, mut truths) = (Vec::new(), 0);
    let mut items = recording.items();
    for item in items.by_ref() {
        match item.expect("readable") {
            Item::Record(record) => records.push(*record),
            Item::Truth(_) => truths += 1,
        }
    }
    (records, truths, items.is_complete())
}

#[test]
fn what_is_written_is_read_to_the_bit() {
    use ipc_types::layout::WireType as _;
    let bytes = written(true);
    let (records, truths, complete) = read(bytes.clone());
    assert!(records.iter().zip(1..).all(|(found, sequence)| found.same_bits(&record(sequence))), "{records:?}");
    assert_eq!((records.len(), truths, complete), (3, 1, true));
    let recording = Recording::from_bytes(bytes, "test.mcap").expect("a recording");
    let texts: Vec<_> = recording.configurations().iter().map(|(at, text)| (*at, text.as_str())).collect();
    assert_eq!(texts, [(0, "a = 1"), (3, "b = 2")]);
    assert_eq!(recording.metadata()["instance"], "planar");
}

#[test]
fn a_file_that_breaks_off_is_read_up_to_there() {
    let (records, _, complete) = read(written(false));
    assert_eq!((records.len(), complete), (3, false));
    let mut torn = written(true);
    torn.truncate(torn.len() / 2);
    let (records, _, complete) = read(torn);
    assert!(records.len() <= 3 && !complete);
    let Err((code, text)) = Recording::from_bytes(b"no recording".to_vec(), "x.mcap") else { panic!("accepted") };
    assert!(code == crate::Exit::DataError && text.contains("x.mcap"), "{text}");
}

/// Three chunks of three records each.
fn written_in_chunks(finish: bool) -> Vec<u8> {
    written_with(0, finish)
}

/// In chunks of three records, with another configuration from each of the first ones on, so many.
fn written_with(configurations: u64, finish: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = RecordingWriter::new(&mut bytes, "planar", "a = 1").expect("memory takes all");
    for sequence in 1..=9 {
        writer.record(&record(sequence)).expect("memory takes all");
        if sequence <= configurations {
            writer.configuration(sequence, "b = 2").expect("memory takes all");
        }
        if sequence % 3 == 0 {
            writer.flush().expect("memory takes all");
        }
    }
    if finish {
        writer.finish().expect("memory takes all")
    } else {
        std::mem::forget(writer)
    }
    bytes
}

fn sequences(recording: &Recording) -> Vec<u64> {
    let record = |item: Result<Item, _>| match item.expect("what is left is readable") {
        Item::Record(record) => Some(record.sequence),
        Item::Truth(_) => None,
    };
    recording.items().filter_map(record).collect()
}

#[test]
fn a_bit_that_flips_is_noticed_wherever_it_is() {
    let bytes = written_in_chunks(true);
    for at in (0..bytes.len()).step_by(3) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        let recording = open(damaged);
        let is_there = recording.damages().iter().any(|damage| damage.bytes.contains(&at));
        assert!(is_there, "byte {at} of {}: {:?}", bytes.len(), recording.damages());
        // At most one chunk is lost.
        let left = if at % 20 == 0 { sequences(&recording) } else { (1..=9).collect() };
        assert!(left.len() >= 6 && left.iter().all(|sequence| (1..=9).contains(sequence)), "byte {at}: {left:?}");
        let Err((code, text)) = recording.refuse_damage() else { panic!("byte {at}") };
        assert!(code == crate::Exit::DataError && text.contains("damaged at byte"), "{text}");
    }
}

#[test]
fn a_bit_that_flips_in_a_file_that_breaks_off_changes_nothing_or_is_noticed() {
    let whole = written_in_chunks(false);
    let record_bits = |recording: &Recording| (sequences(recording), recording.configurations().clone());
    let before = record_bits(&open(whole.clone()));
    for at in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[at] ^= 1 << (at / 8 % 8);
        let recording = open(damaged);
        if recording.damages().is_empty() {
            assert_eq!(
                (record_bits(&recording), recording.record_version()),
                (before.clone(), PRESENT_RECORD_VERSION),
                "byte {at}"
            );
        }
    }
}

/// Where the records of a file are.
fn framed(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let (mut records, mut at) = (Vec::new(), mcap::MAGIC.len());
    while let Some(found) = fields::record(bytes, at) {
        records.push(at..found.end);
        at = found.end;
    }
    records
}

#[test]
fn a_file_that_breaks_off_anywhere_is_not_damaged() {
    let whole = written_with(9, false);
    // The first ones say what it is.
    for end in framed(&whole)[2].start..whole.len() {
        assert_eq!(open(whole[..end].to_vec()).damages(), [], "cut off at byte {end}");
    }
}

/// `admittance-lab hostile recordings --seed 28003 --index 2236`: in a file that broke off in the chunk behind it, a
/// configuration whose length led beyond the end seemed to be what broke off, and was lost without a word.
#[test]
fn a_length_that_leads_beyond_where_a_file_breaks_off_is_noticed() {
    let whole = written_with(9, false);
    let records = framed(&whole);
    assert!(records.len() > 8, "{records:?}");
    let record_bits = |recording: &Recording| (sequences(recording), recording.configurations().clone());
    let mut noticed = 0;
    // The first ones say what it is.
    for last in 3..records.len() {
        let cut = &whole[..records[last].start + records[last].len() * 2 / 3];
        let before = record_bits(&open(cut.to_vec()));
        for (record, bit) in records[..last].iter().flat_map(|record| (0..64).map(move |bit| (record, bit))) {
            let mut damaged = cut.to_vec();
            damaged[record.start + 1 + bit / 8] ^= 1 << (bit % 8);
            let recording = match Recording::from_bytes(damaged, "test.mcap") {
                Ok(recording) => recording,
                // Nothing that is whole says what it is.
                Err((_, text)) => {
                    assert!(text.contains("damaged at byte"), "{text}");
                    noticed += 1;
                    continue;
                }
            };
            noticed += usize::from(!recording.damages().is_empty());
            if recording.damages().is_empty() {
                assert_eq!(record_bits(&recording), before, "cut in record {last}, bit {bit} of {record:?}");
            }
        }
    }
    assert!(noticed > 1000, "{noticed}");
}

#[test]
fn what_is_whole_is_recovered_around_the_damage() {
    let bytes = written_in_chunks(true);
    let chunks = open(bytes.clone()).contents_of_chunks();
    // The channels and schemas, then the records.
    assert_eq!(chunks.len(), 4);
    let with = |alter: &dyn Fn(&mut Vec<u8>)| {
        let mut damaged = bytes.clone();
        alter(&mut damaged);
        sequences(&open(damaged))
    };
    let middle = chunks[2].clone();
    assert_eq!(with(&|bytes| bytes[middle.end - 20] ^= 1), [1, 2, 3, 7, 8, 9]);
    assert_eq!(with(&|bytes| bytes[middle.start - 1] ^= 1), [1, 2, 3, 7, 8, 9], "its length");
    assert_eq!(with(&|bytes| bytes[middle.start - 9] ^= 1), [1, 2, 3, 7, 8, 9], "its kind");
    assert_eq!(with(&|bytes| bytes[middle.clone()].fill(0)), [1, 2, 3, 7, 8, 9]);
    assert_eq!(with(&|bytes| drop(bytes.drain(middle.start - 5..middle.end - 5))), [1, 2, 3, 7, 8, 9]);
    // A block that was written twice.
    let again = bytes[middle.start - 20..middle.end + 20].to_vec();
    let twice = |bytes: &mut Vec<u8>| drop(bytes.splice(middle.end + 20..middle.end + 20, again.clone()));
    assert_eq!(with(&twice), [1, 2, 3, 4, 5, 6, 7, 8, 9]);
    // Without the schemas the channels are known by their order.
    assert_eq!(with(&|bytes| bytes[chunks[0].start + 50] ^= 1), [1, 2, 3, 4, 5, 6, 7, 8, 9]);
}

#[test]
fn a_record_that_lost_its_sample_is_left_out() {
    let mut bytes = Vec::new();
    let mut writer = RecordingWriter::new(&mut bytes, "planar", "a = 1").expect("memory takes all");
    for sequence in 1..=2 {
        // Its chunk ends between a record's messages, as one that is full does.
        writer.record_in_two_chunks(&record(sequence)).expect("memory takes all");
    }
    writer.finish().expect("memory takes all");
    let chunks = open(bytes.clone()).contents_of_chunks();
    assert_eq!(sequences(&open(bytes.clone())), [1, 2]);
    let first = chunks[1].clone();
    bytes[first.end - 20] ^= 1;
    assert_eq!(sequences(&open(bytes)), [2]);
}

#[test]
fn no_length_is_believed() {
    let bytes = written_in_chunks(true);
    let recording = open(bytes.clone());
    // Of the file's records and of what is within them.
    for at in 0..bytes.len() - 8 {
        if bytes[at + 2..at + 8] == [0; 6]
            && (at % 3 == 0 || recording.contents_of_chunks().iter().any(|chunk| at + 8 == chunk.start))
        {
            let mut damaged = bytes.clone();
            damaged[at + 6] = 0x7f;
            assert!(!open(damaged).damages().is_empty(), "byte {at}");
        }
    }
}
