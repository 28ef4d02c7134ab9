//! Recordings that something has damaged. Each is refused with the place, or holds what it held; and
//! what is recovered of it was in it.

use std::path::{Path, PathBuf};
use std::time::Instant;

use admittancectl::recording::{Item, Recording};
use admittancectl::{Exit, Outcome, parallel};
use ipc_types::RecordSample;
use ipc_types::layout::WireType as _;
use rand::{Rng, RngExt as _, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Threads.
const THREADS: usize = 2;

/// A recording as it was written.
struct Original {
    bytes: Vec<u8>,
    held: Held,
}

/// What a recording holds.
#[derive(Clone)]
struct Held {
    records: Vec<RecordSample>,
    configurations: Vec<(u64, String)>,
    version: u32,
}

/// What becomes of the bytes.
#[derive(Debug, Clone, Copy)]
enum Harm {
    Bit { byte: usize, bit: u8 },
    Zeroed { byte: usize, count: usize },
    Overwritten { byte: usize, count: usize },
    Removed { byte: usize, count: usize },
    Doubled { byte: usize, count: usize },
}

/// How a damaged recording was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ending {
    /// Refused, with the place.
    Named,
    /// Refused as no recording.
    Foreign,
    /// Read to the same content.
    Harmless,
}

/// Damages copies of all recordings in a directory. Whether something was found.
pub(super) fn attack(directory: &Path, runs: u64, seed: u64, index: Option<u64>) -> Outcome<bool> {
    let begun = Instant::now();
    let originals = files(directory)?.iter().map(original).collect::<Outcome<Vec<Original>>>()?;
    let range = index.map_or(0..runs, |index| index..index + 1);
    let first = range.start;
    let seen =
        parallel::map(range.end - first, THREADS, "recordings", |turn| Ok(damage(&originals, seed, first + turn)));
    let seen = seen.map_err(|why: String| (Exit::Internal, why))?;
    let mut found = 0;
    for ((what, result), number) in seen.iter().zip(first..) {
        if index.is_some() {
            println!("{what}: {result:?}");
        }
        if let Err(why) = result {
            found += 1;
            println!("FOUND: admittance-lab hostile recordings --seed {seed} --index {number}\n  {what}: {why}");
        }
    }
    let count = |ending| seen.iter().filter(|(_, result)| *result == Ok(ending)).count();
    println!(
        "recordings of seed {seed}: {} damaged in {:.0} s: {} named with their place, {} harmless, {} no recording any more; \
         found in {found}",
        seen.len(),
        begun.elapsed().as_secs_f64(),
        count(Ending::Named),
        count(Ending::Harmless),
        count(Ending::Foreign)
    );
    Ok(found > 0)
}

/// The recordings in a directory, in the order of their names.
fn files(directory: &Path) -> Outcome<Vec<PathBuf>> {
    let failed = |error: std::io::Error| (Exit::NoInput, format!("{}: {error}", directory.display()));
    let entries = std::fs::read_dir(directory).map_err(failed)?;
    let paths = entries.map(|entry| Ok(entry.map_err(failed)?.path())).collect::<Outcome<Vec<PathBuf>>>()?;
    let mut files: Vec<_> =
        paths.into_iter().filter(|path| path.extension().is_some_and(|end| end == "mcap")).collect();
    files.sort();
    if files.is_empty() {
        return Err((Exit::NoInput, format!("{}: no recording (*.mcap) in it", directory.display())));
    }
    Ok(files)
}

fn original(file: &PathBuf) -> Outcome<Original> {
    let bytes = std::fs::read(file).map_err(|error| (Exit::NoInput, format!("{}: {error}", file.display())))?;
    let recording = Recording::from_bytes(bytes.clone(), &file.display().to_string())?.refuse_damage()?;
    let held = held(&recording).map_err(|why| (Exit::DataError, why))?;
    Ok(Original { bytes, held })
}

fn held(recording: &Recording) -> Result<Held, String> {
    let mut records = Vec::new();
    for item in recording.items() {
        if let Item::Record(record) = item.map_err(|(_, why)| why)? {
            records.push(*record);
        }
    }
    let configurations = recording.configurations().iter().map(|(at, text)| (*at, text.clone())).collect();
    Ok(Held { records, configurations, version: recording.record_version() })
}

/// One damage: what it was, and what came of it.
fn damage(originals: &[Original], seed: u64, index: u64) -> (String, Result<Ending, String>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(index);
    let which = random.random_range(0..originals.len());
    let Original { bytes, held } = &originals[which];
    // Every fourth breaks off, as that of a recorder that was killed.
    let cut = (random.random_range(0..4) == 0).then(|| random.random_range(bytes.len() / 4..bytes.len()));
    let mut bytes = bytes[..cut.unwrap_or(bytes.len())].to_vec();
    let before = match cut {
        None => Ok(held.clone()),
        Some(_) => Recording::from_bytes(bytes.clone(), "cut").map_err(|(_, why)| why).and_then(|cut| self::held(&cut)),
    };
    let harm = draw(&mut random, bytes.len());
    harm.apply(&mut bytes, &mut random);
    let ending = cut.map_or(String::new(), |at| format!(", cut off at byte {at}"));
    (format!("file {which}{ending}, {harm:?}"), before.and_then(|before| examine(bytes, harm, &before)))
}

fn draw(random: &mut impl Rng, length: usize) -> Harm {
    let (byte, kind) = (random.random_range(0..length), random.random_range(0..20));
    let count = random.random_range(1..=(length - byte).min(5000));
    match kind {
        0 => Harm::Zeroed { byte, count },
        1 => Harm::Overwritten { byte, count },
        2 => Harm::Removed { byte, count },
        3 => Harm::Doubled { byte, count },
        _ => Harm::Bit { byte, bit: random.random_range(0..8) },
    }
}

impl Harm {
    fn apply(self, bytes: &mut Vec<u8>, random: &mut impl Rng) {
        match self {
            Self::Bit { byte, bit } => bytes[byte] ^= 1 << bit,
            Self::Zeroed { byte, count } => bytes[byte..byte + count].fill(0),
            Self::Overwritten { byte, count } => random.fill_bytes(&mut bytes[byte..byte + count]),
            Self::Removed { byte, count } => drop(bytes.drain(byte..byte + count)),
            Self::Doubled { byte, count } => {
                let again = bytes[byte..byte + count].to_vec();
                bytes.splice(byte..byte, again);
            }
        }
    }
}

/// Reads what is left. `before`: what it held before the harm.
fn examine(bytes: Vec<u8>, harm: Harm, before: &Held) -> Result<Ending, String> {
    let recording = match Recording::from_bytes(bytes, "damaged") {
        Ok(recording) => recording,
        Err((_, why)) => {
            return match harm {
                Harm::Bit { byte, .. } if names(&why, byte) => Ok(Ending::Named),
                Harm::Bit { .. } => Err(format!("not recognised: {why}")),
                _ => Ok(Ending::Foreign),
            };
        }
    };
    if recording.damages().is_empty() {
        let after = held(&recording)?;
        let is_same = after.records.len() == before.records.len() && after.configurations == before.configurations;
        // What was cut out at the end of a file that breaks off is one that breaks off before.
        let may_be_shorter = !matches!(harm, Harm::Bit { .. }) && !recording.items().is_complete();
        if !(is_same || may_be_shorter) || after.version != before.version {
            return Err(format!("{} of {} records, unnoticed", after.records.len(), before.records.len()));
        }
        are_from(&after, before)?;
        return Ok(Ending::Harmless);
    }
    if let Harm::Bit { byte, .. } = harm
        && !recording.damages().iter().any(|damage| damage.bytes.contains(&byte))
    {
        return Err(format!("somewhere else: {:?}", recording.damages()));
    }
    are_from(&held(&recording)?, before)?;
    match recording.refuse_damage() {
        Err((Exit::DataError, text)) if text.contains("damaged at byte") => Ok(Ending::Named),
        Err((code, text)) => Err(format!("{code:?}: {text}")),
        Ok(_) => Err("accepted".to_owned()),
    }
}

/// Whether a message tells of a damage that begins at this byte or before it, and ends behind it.
fn names(message: &str, byte: usize) -> bool {
    let number = |behind: &str| {
        let text = message.split_once(behind)?.1;
        text.split(|c: char| !c.is_ascii_digit()).next()?.parse::<usize>().ok()
    };
    let (start, end) = (number("damaged at byte "), number("before byte "));
    start.is_some_and(|start| start <= byte) && end.is_some_and(|end| byte < end)
}

/// Whether all that was read was there, and in this order.
fn are_from(after: &Held, before: &Held) -> Result<(), String> {
    let mut left = before.records.iter();
    for record in &after.records {
        if !left.any(|known| known.same_bits(record)) {
            return Err(format!("record {} is not as it was", record.sequence));
        }
    }
    let known = after.configurations.iter().all(|found| before.configurations.contains(found));
    if known { Ok(()) } else { Err("a configuration is not as it was".to_owned()) }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn recordings(names: &[&str]) -> Vec<Original> {
        let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/recordings");
        names.iter().map(|name| original(&directory.join(name)).expect("a recording")).collect()
    }

    #[test]
    fn no_damage_goes_unnoticed() {
        // Of one chunk and of several; with more than one configuration; of the first version.
        let originals =
            recordings(&["force-exceeded.mcap", "faults-free-bridged.mcap", "reload-stopped-then-reset.mcap"]);
        let (mut named, mut harmless) = (0, 0);
        for index in 0..300 {
            match damage(&originals, 1, index) {
                (_, Ok(Ending::Named)) => named += 1,
                (_, Ok(_)) => harmless += 1,
                (what, Err(why)) => panic!("{index}: {what}: {why}"),
            }
        }
        assert!(named > 200 && harmless > 0, "{named} named, {harmless} harmless");
    }

    #[test]
    fn what_says_no_more_what_it_is_is_refused_with_the_place() {
        let [original] = &recordings(&["force-exceeded.mcap"])[..] else { panic!("one") };
        // Byte 100 is of the metadata, which is all that is there before a configuration that breaks off.
        let mut bytes = original.bytes[..300].to_vec();
        bytes[100] ^= 1;
        let harm = Harm::Bit { byte: 100, bit: 0 };
        assert_eq!(examine(bytes.clone(), harm, &original.held), Ok(Ending::Named));
        let elsewhere = Harm::Bit { byte: 10, bit: 0 };
        assert!(examine(bytes, elsewhere, &original.held).is_err_and(|why| why.starts_with("not recognised: ")));
    }

    #[test]
    fn what_is_not_as_it_was_is_seen() {
        let [original] = &recordings(&["force-exceeded.mcap"])[..] else { panic!("one") };
        let mut altered = original.held.clone();
        altered.records[3].command.velocity_offset[0] += 1e-12;
        assert!(are_from(&altered, &original.held).is_err_and(|why| why.contains("is not as it was")));
        let harm = Harm::Bit { byte: 0, bit: 0 };
        let mut lost = original.held.clone();
        lost.records.pop();
        assert!(examine(original.bytes.clone(), harm, &lost).is_err_and(|why| why.contains("unnoticed")));
    }
}
