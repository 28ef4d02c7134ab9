//! The solver on small degenerate problems. Run it with cargo-fuzz (CONTRIBUTING.md); inputs are
//! replayed by the tests of admittance-judge.
#![no_main]

use admittance_judge::fuzzing::Case;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let case = Case::from_bytes(bytes);
    if let Err(finding) = case.check() {
        panic!("{finding}\n{case}");
    }
});
