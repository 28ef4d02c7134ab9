//! Bytes at random, and the arm with some of them changed: import ends, with a file that is valid or
//! with one line that says why not.

use proptest::prelude::*;

use super::{ARM, origin, printed};

/// Import itself has parsed what it prints.
fn ends_well(bytes: &[u8], scenario: bool) {
    if let Err(refused) = printed(bytes, &origin("world", "tcp"), scenario) {
        let message = refused.of("arm.urdf");
        assert!(message.starts_with("arm.urdf:") && !message.contains(char::is_control), "{message:?}");
    }
}

/// Pieces of which XML and URDF are made.
const PIECES: [&str; 24] = [
    "<",
    ">",
    "/>",
    "\"",
    "=",
    " ",
    "&amp;",
    "&#0;",
    "<!--",
    "-->",
    "<![CDATA[",
    "]]>",
    "<?a",
    "0",
    "-1",
    "nan",
    "1e309",
    "name",
    "<link name=\"x\"/>",
    "<inertial>",
    "type=\"fixed\"",
    "xmlns=\"u\"",
    "\u{feff}",
    "tcp",
];

/// A run for longer: PROPTEST_CASES=100000 cargo test --release -p admittancectl --lib any_bytes
fn config() -> ProptestConfig {
    let cases = if std::env::var_os("PROPTEST_CASES").is_some() { ProptestConfig::default().cases } else { 100 };
    ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(cases) }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn bytes(bytes in proptest::collection::vec(any::<u8>(), 0..400), scenario: bool) {
        ends_well(&bytes, scenario);
    }

    #[test]
    fn pieces(pieces in proptest::collection::vec(proptest::sample::select(&PIECES[..]), 0..60), scenario: bool) {
        ends_well(format!("<robot>{}</robot>", pieces.concat()).as_bytes(), scenario);
    }

    #[test]
    fn changed(
        changes in proptest::collection::vec((0..ARM.len(), 0_usize..12, proptest::sample::select(&PIECES[..])), 1..4),
        scenario: bool,
    ) {
        let mut bytes = ARM.as_bytes().to_vec();
        for (at, length, piece) in changes {
            let at = at.min(bytes.len());
            let end = (at + length).min(bytes.len());
            bytes.splice(at..end, piece.bytes());
        }
        ends_well(&bytes, scenario);
    }

    /// A value in quotes takes another's place: what is XML still, and about an arm.
    #[test]
    fn exchanged(from in 0_usize..400, to in 0_usize..400, scenario: bool) {
        let mut parts: Vec<&str> = ARM.split('"').collect();
        let values = parts.len() / 2;
        parts[2 * (from % values) + 1] = ARM.split('"').nth(2 * (to % values) + 1).unwrap_or_default();
        ends_well(parts.join("\"").as_bytes(), scenario);
    }
}
