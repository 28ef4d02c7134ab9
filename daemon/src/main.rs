//! The daemon's program; everything is in the library, so that the demo can run the same code in a
//! process of its own.

fn main() -> std::process::ExitCode {
    admittanced::main_with_args(std::env::args_os().skip(1)).into()
}
