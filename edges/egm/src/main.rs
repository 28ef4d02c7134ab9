//! The edge's program; everything is in the library.

fn main() -> std::process::ExitCode {
    admittance_egm::main_with_args(std::env::args_os().skip(1)).into()
}
