//! Random problems of every size against Clarabel at 1e-10: 2,000, or as many as
//! ADMITTANCE_RANDOM_PROBLEMS says.

use admittance_judge::judge::{Defendant, Tally};
use admittance_judge::random_qp::{MAX_ROWS, MAX_VARIABLES};

#[test]
fn random_problems_are_judged_alike() {
    let problems: u64 = std::env::var("ADMITTANCE_RANDOM_PROBLEMS")
        .map_or(2_000, |text| text.parse().expect("ADMITTANCE_RANDOM_PROBLEMS is a number of problems"));
    let threads = std::thread::available_parallelism().map_or(1, |threads| threads.get() as u64);
    let tallies: Vec<Tally> = std::thread::scope(|scope| {
        let part = |thread: u64| {
            move || Defendant::new(MAX_VARIABLES, MAX_ROWS + 1).try_seeds((thread..problems).step_by(threads as usize))
        };
        let running: Vec<_> = (0..threads).map(|thread| scope.spawn(part(thread))).collect();
        running.into_iter().map(|running| running.join().expect("no panic")).collect()
    });
    let sum = |count: fn(&Tally) -> usize| tallies.iter().map(count).sum::<usize>();
    let (solved, infeasible, excluded) = (sum(|t| t.solved), sum(|t| t.infeasible), sum(|t| t.excluded));
    let iterations = tallies.iter().map(|tally| tally.most_iterations).max().unwrap_or(0);
    let (appeals, judge_off) = (sum(|t| t.appeals), sum(|t| t.judge_off));
    println!(
        "{solved} solved, {judge_off} Clarabel off ({appeals} of both after a second look), {infeasible} infeasible, \
         {excluded} excluded, at most {iterations} iterations"
    );
    let disagreements: Vec<_> = tallies.iter().flat_map(|tally| &tally.disagreements).collect();
    assert!(
        disagreements.is_empty(),
        "{} disagreements: {:?}",
        disagreements.len(),
        &disagreements[..disagreements.len().min(20)]
    );
    // The problems must be of every kind, and the judge able to say something and seldom off.
    assert!(judge_off as u64 * 1000 <= problems, "Clarabel off in {judge_off}");
    assert!(solved as u64 * 2 > problems && infeasible as u64 * 20 > problems && excluded as u64 * 20 < problems);
}
