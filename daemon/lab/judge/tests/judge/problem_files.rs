//! The problem files: exact solutions that another method found, for the structured condensation
//! and the solver together.

use std::path::PathBuf;

use admittance_core::mpc::qp::QpOutcome;
use admittance_judge::problem_file::{ProblemFile, ProblemFileError, Task};
use admittance_judge::sequence::{Runner, Sequence, Start};

/// Largest deviation from the exact inputs, in m/s and rad/s.
const DEVIATION: f64 = 1e-9;
const FILES: [&str; 6] = ["d2_h5", "d6c1_h20", "d6c3_h10", "d6c3_h20", "d6c6_h10", "d6c6_h20"];

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("problems").join(format!("{name}.bin"))
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(path(name)).expect("the file is in the repository")
}

struct Check<'a>(&'a str);

impl Task for Check<'_> {
    type Output = f64;

    fn run<const N: usize, const M: usize>(self, sequence: &Sequence<N, M>) -> f64 {
        let mut runner = Runner::new(sequence);
        let mut worst = 0.0_f64;
        for start in [Start::Cold, Start::Warm] {
            for index in 0..sequence.problems.len() {
                let (outcome, deviation, residual) = runner.deviation(sequence, index, start);
                assert!(matches!(outcome, QpOutcome::Solved { .. }), "{} {index} {start:?}: {outcome:?}", self.0);
                assert!(deviation <= DEVIATION, "{} {index} {start:?}: off by {deviation:e}", self.0);
                assert!(residual.is_within(1e-10), "{} {index} {start:?}: {residual:?}", self.0);
                worst = worst.max(deviation);
            }
        }
        worst
    }
}

#[test]
fn every_problem_is_solved_exactly_cold_and_warm() {
    for name in FILES {
        let file = ProblemFile::read(&path(name)).expect("a file of problems");
        let worst = file.run(Check(name));
        println!("{name}: {} problems, off by {worst:.1e} at most", file.records.len());
    }
}

struct Bits;

impl Task for Bits {
    type Output = Vec<u64>;

    fn run<const N: usize, const M: usize>(self, sequence: &Sequence<N, M>) -> Vec<u64> {
        let mut runner = Runner::new(sequence);
        (0..sequence.problems.len())
            .flat_map(|index| {
                runner.solve(sequence, index, Start::Warm, |_, _, _, answer, _| {
                    answer.z.iter().map(|z| z.to_bits()).collect::<Vec<_>>()
                })
            })
            .collect()
    }
}

#[test]
fn the_same_problems_give_the_same_bits() {
    for name in FILES {
        let file = ProblemFile::read(&path(name)).expect("a file of problems");
        assert!(file.run(Bits) == file.run(Bits), "{name}");
    }
}

#[test]
fn what_is_no_file_of_problems_is_refused_with_the_field() {
    let good = bytes("d2_h5");
    let changed = |at: usize, new: &[u8]| {
        let mut bytes = good.clone();
        bytes[at..at + new.len()].copy_from_slice(new);
        bytes
    };
    // Header 32 bytes, Q 6 and R 2 numbers, then A of the first record.
    let cases = [
        (good[..20].to_vec(), "header: found 20 bytes"),
        (good[..good.len() - 1].to_vec(), "record 79, U: found 79 bytes, accepted: 80 bytes"),
        ([good.as_slice(), &[0]].concat(), "end of file: found 1 more bytes"),
        (changed(8, &5_i32.to_le_bytes()), "header, nd: found 5, accepted: 2 or 6"),
        (changed(16, &99_i32.to_le_bytes()), "header, H: found 99, accepted: 2 to 32"),
        (changed(32, &f64::NAN.to_le_bytes()), "Q[0]: found NaN, accepted: a finite number"),
        (changed(96, &2.0_f64.to_le_bytes()), "record 0, A[0, 0]: found 2"),
        (changed(96, &(1.0 + 1e-11_f64).to_le_bytes()), "record 0, A[0, 0]: found 1.00000000001"),
        (changed(32, &(-1.0_f64).to_le_bytes()), "Q[0]: found -1, accepted: a weight of at least 0"),
        (changed(80, &0.0_f64.to_le_bytes()), "R[0]: found 0, accepted: a weight above 0"),
        (changed(112, &0.0_f64.to_le_bytes()), "record 0, A[0, 2]: found 0, accepted: a sampling time above 0 s"),
        (changed(208, &1.0_f64.to_le_bytes()), "record 0, A[2, 2]: found 1, accepted: 1 − T_s/T above −1 and below 1"),
        (changed(12, &3_i32.to_le_bytes()), "header, nc: found 3, accepted: 0 to 2"),
        (changed(0, &7_i32.to_le_bytes()), "header, nx: found 7, accepted: 6 to 6"),
        (changed(20, &0_i32.to_le_bytes()), "header, count: found 0"),
    ];
    for (bytes, expected) in cases {
        let error = ProblemFile::parse(&bytes).expect_err("no file of problems").to_string();
        assert!(error.contains(expected), "{error}, not {expected}");
    }
    let missing = ProblemFile::read(&path("none"));
    assert!(matches!(missing, Err(ProblemFileError::Read(_))), "{missing:?}");
}
