//! Recordings of which a bit has flipped, or that were torn: `replay` and `report` name the place, and
//! `--recover` goes on with the rest. What a length says is not believed: memory is limited here.
//! `admittance-lab hostile recordings` does this many thousand times, in one process.

use std::path::{Path, PathBuf};
use std::process::Command;

use end_to_end::session::output;
use end_to_end::{PrivateIpc, binaries};

fn original(name: &str) -> Vec<u8> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings");
    std::fs::read(directory.join(name).with_extension("mcap")).expect("the recording is there")
}

/// `admittancectl` with at most 1 GiB of memory.
fn ctl(arguments: &[&str], file: &Path) -> (Option<i32>, String) {
    let mut command = Command::new("sh");
    command.args(["-c", r#"ulimit -v 1048576; exec "$0" "$@""#]).arg(&binaries().admittancectl);
    output(command.args(arguments).arg(file))
}

fn written(ipc: &PrivateIpc, bytes: &[u8]) -> PathBuf {
    let path = ipc.directory().join("damaged.mcap");
    std::fs::write(&path, bytes).expect("written");
    path
}

/// Where the records of the file begin, up to the end of the data.
fn records(bytes: &[u8]) -> Vec<(u8, usize)> {
    let mut at = 8;
    let mut records = Vec::new();
    while records.last().is_none_or(|(opcode, _)| *opcode != mcap::records::op::DATA_END) {
        records.push((bytes[at], at));
        at += 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("eight")) as usize;
    }
    records
}

#[test]
fn a_flipped_bit_is_named_and_no_length_is_believed() {
    let ipc = PrivateIpc::new("damaged");
    let bytes = original("force-exceeded");
    let whole = ctl(&["replay"], &written(&ipc, &bytes));
    assert_eq!(whole.0, Some(0), "{}", whole.1);
    // Each record's kind, a low and a high bit of its length, and two bits of its body.
    let records = records(&bytes);
    let mut places: Vec<(usize, u8)> = vec![(3, 1), (bytes.len() - 3, 4), (bytes.len() - 20, 0)];
    for (_, at) in &records {
        places.extend([(*at, 0), (at + 1, 3), (at + 8, 6), (at + 9, 0), (at + 40, 5)]);
    }
    for (byte, bit) in places {
        let mut damaged = bytes.clone();
        damaged[byte] ^= 1 << bit;
        let file = written(&ipc, &damaged);
        let (code, text) = ctl(&["replay"], &file);
        let place = "damaged.mcap: damaged at byte ";
        assert_eq!((code, text.contains(place)), (Some(65), true), "byte {byte}, bit {bit}: {text}");
        let (from, to) =
            text.split(place).nth(1).and_then(|rest| rest.split_once(", or after it before byte ")).expect("a range");
        let range = from.parse::<usize>().expect("a byte")
            ..to.split(':').next().and_then(|to| to.parse().ok()).expect("a byte");
        assert!(range.contains(&byte), "byte {byte}: {text}");
        // Without its configuration, or with too little left, there is nothing to compare.
        let (code, text) = ctl(&["replay", "--recover"], &file);
        let is_short =
            code == Some(65) && (text.contains("no cycle can be compared") || text.contains("no configuration"));
        assert!(code == Some(0) || is_short, "byte {byte}, bit {bit}: {code:?}: {text}");
        assert!(text.contains("left out"), "{text}");
    }
}

#[test]
fn recover_goes_on_with_the_good_part() {
    let ipc = PrivateIpc::new("damaged");
    let mut bytes = original("faults-free-bridged");
    let chunks: Vec<usize> =
        records(&bytes).iter().filter(|(opcode, _)| *opcode == mcap::records::op::CHUNK).map(|(_, at)| *at).collect();
    assert!(chunks.len() > 2, "schemas, and two chunks of messages: {chunks:?}");
    let last = *chunks.last().expect("some");
    bytes[last + 100] ^= 8;
    let file = written(&ipc, &bytes);
    let (code, text) = ctl(&["replay", "--recover"], &file);
    assert_eq!((code, text.contains(" cycles, bit-identical")), (Some(0), true), "{text}");
    let report = ipc.directory().join("report");
    let directory = report.display().to_string();
    assert_eq!(ctl(&["report", "--directory", &directory], &file).0, Some(65));
    let (code, text) = ctl(&["report", "--recover", "--directory", &directory], &file);
    assert_eq!((code, report.join("index.html").exists()), (Some(0), true), "{text}");
    // What is no file is not read at all.
    let (code, text) = ctl(&["replay"], Path::new("/dev/zero"));
    assert_eq!((code, text.contains("not a regular file")), (Some(66), true), "{text}");
}
