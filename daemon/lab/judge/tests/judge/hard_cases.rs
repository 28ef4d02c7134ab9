//! Random problems that were hard once, again: their seeds are kept in problems/hard_seeds.txt.

use admittance_judge::judge::Defendant;
use admittance_judge::random_qp::{MAX_ROWS, MAX_VARIABLES};

#[test]
fn what_was_hard_once_is_solved() {
    let seeds: Vec<u64> = include_str!("../../problems/hard_seeds.txt")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.trim().parse().expect("a seed a line"))
        .collect();
    assert!(!seeds.is_empty());
    let tally = Defendant::new(MAX_VARIABLES, MAX_ROWS + 1).try_seeds(seeds.iter().copied());
    assert!(tally.disagreements.is_empty(), "{:?}", tally.disagreements);
    assert_eq!(tally.solved + tally.judge_off + tally.infeasible, seeds.len());
}
