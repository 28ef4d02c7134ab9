//! What the fuzzer starts from and what it has found, without a fuzzer; and some thousand inputs
//! that nothing guides.

use std::collections::BTreeMap;
use std::path::Path;

use admittance_judge::fuzzing::{Case, Verdict};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Random inputs: some seconds.
const INPUTS: u64 = 100_000;

/// Checks inputs, and says for how many of plain and of hard numbers which verdict was reached.
fn check(inputs: impl Iterator<Item = (String, Vec<u8>)>) -> BTreeMap<(bool, Verdict), usize> {
    let (mut tally, mut findings) = (BTreeMap::new(), Vec::new());
    for (name, bytes) in inputs {
        let case = Case::from_bytes(&bytes);
        match case.check() {
            Ok(verdict) => *tally.entry((case.is_plain, verdict)).or_insert(0) += 1,
            Err(finding) => findings.push(format!("{name}: {finding}\n{case}")),
        }
    }
    assert!(findings.is_empty(), "{} findings:\n{}", findings.len(), findings[..findings.len().min(5)].join("\n"));
    tally
}

#[test]
fn the_corpus_shows_no_fault() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/qp");
    let files = std::fs::read_dir(&folder).expect("the corpus");
    let paths = files.map(|file| file.expect("a file of the corpus").path());
    let tally = check(paths.map(|path| (path.display().to_string(), std::fs::read(&path).expect("a readable file"))));
    println!("{tally:?}");
    assert!(
        tally.contains_key(&(true, Verdict::Solved)) && tally.contains_key(&(true, Verdict::Infeasible)),
        "{tally:?}"
    );
}

#[test]
fn random_bytes_show_no_fault() {
    let input = |seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut bytes = vec![0; rng.random_range(0..512)];
        rng.fill_bytes(&mut bytes);
        (format!("seed {seed}"), bytes)
    };
    let tally = check((0..INPUTS).map(input));
    println!("{tally:?}");
    // Of every kind, and hardly anything left open.
    let count = |verdict: Verdict| {
        tally.iter().filter(|(key, _)| key.1 == verdict).map(|(_, count)| *count as u64).sum::<u64>()
    };
    assert!(count(Verdict::Solved) * 4 > INPUTS && count(Verdict::Infeasible) * 4 > INPUTS, "{tally:?}");
    assert!(count(Verdict::Undecided) * 1000 < INPUTS, "{tally:?}");
}
