//! The program; everything is in the library, so that admittance-lab can use the pieces.

fn main() -> std::process::ExitCode {
    admittancectl::main()
}
