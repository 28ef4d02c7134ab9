//! Solves the problems of a file, warm-started, and nothing else: instructions.py counts its
//! instructions.
//!
//! `solve FILE ROUNDS`

use std::path::Path;

use admittance_judge::problem_file::{ProblemFile, Task};
use admittance_judge::sequence::{Runner, Sequence, Start};

struct Rounds(usize);

impl Task for Rounds {
    type Output = u32;

    fn run<const N: usize, const M: usize>(self, sequence: &Sequence<N, M>) -> u32 {
        let mut runner = Runner::new(sequence);
        let mut iterations = 0;
        for _ in 0..self.0 {
            runner.reset();
            for index in 0..sequence.problems.len() {
                iterations += runner.solve(sequence, index, Start::Warm, |outcome, _, _, _, _| outcome.iterations());
            }
        }
        iterations
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, rounds] = arguments.as_slice() else { return Err("two arguments: FILE ROUNDS".into()) };
    let iterations = ProblemFile::read(Path::new(file))?.run(Rounds(rounds.parse()?));
    println!("{iterations} iterations");
    Ok(())
}
