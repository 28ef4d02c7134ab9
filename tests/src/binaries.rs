//! The shipped programs, built as the tests were.

use std::ffi::OsString;
use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// Paths of the programs.
#[derive(Debug, Clone)]
pub struct Binaries {
    /// The daemon.
    pub admittanced: PathBuf,
    /// The emulated controller and robot.
    pub plant_sim: PathBuf,
    /// The tool.
    pub admittancectl: PathBuf,
    /// What developers measure with.
    pub admittance_lab: PathBuf,
}

/// Builds the programs in the profile of the running test and says where they are. `cargo test` has
/// built them already: cargo finds everything up to date, unless a test was run by itself.
///
/// # Panics
/// When the build fails (cargo's output is on stderr) or a program is missing from it.
pub fn binaries() -> &'static Binaries {
    static BINARIES: OnceLock<Binaries> = OnceLock::new();
    BINARIES.get_or_init(build)
}

fn build() -> Binaries {
    let test = std::env::current_exe().expect("the running test has a path");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo"));
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut child = Command::new(cargo)
        // All members, as for `cargo test`: features of a dependency are chosen for what is built
        // together.
        .args(["build", "--workspace", "--bins", "--message-format=json-render-diagnostics"])
        .args(["--profile", profile(&test)])
        .current_dir(root)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .expect("cargo starts: it started this test");
    let messages = std::io::BufReader::new(child.stdout.take().expect("stdout is piped")).lines();
    let programs: Vec<(String, PathBuf)> =
        messages.map_while(Result::ok).filter_map(|message| program(&message)).collect();
    let status = child.wait().expect("cargo is a child of this process");
    assert!(status.success(), "the programs do not build: {status}");
    let path = |name: &str| {
        let found = programs.iter().find(|(program, _)| program == name);
        found.map(|(_, path)| path.clone()).unwrap_or_else(|| panic!("cargo built no program {name}: {programs:?}"))
    };
    Binaries {
        admittanced: path("admittanced"),
        plant_sim: path("plant-sim"),
        admittancectl: path("admittancectl"),
        admittance_lab: path("admittance-lab"),
    }
}

/// The profile of a test at TARGET/DIRECTORY/deps/NAME: the directory is named after it, except
/// that dev's is "debug".
fn profile(test: &Path) -> &str {
    let directory = test.ancestors().nth(2).and_then(Path::file_name).and_then(|name| name.to_str());
    match directory {
        Some("debug") | None => "dev",
        Some(profile) => profile,
    }
}

/// Name and path of the program that a line of cargo's output reports.
fn program(message: &str) -> Option<(String, PathBuf)> {
    let message: serde_json::Value = serde_json::from_str(message).ok()?;
    let target = &message["target"];
    let is_program = target["kind"].as_array()?.iter().any(|kind| kind == "bin");
    let path = message["executable"].as_str().filter(|_| is_program)?;
    Some((target["name"].as_str()?.to_owned(), PathBuf::from(path)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_profile_is_that_of_the_running_test() {
        assert_eq!(profile(Path::new("/t/debug/deps/a-1")), "dev");
        assert_eq!(profile(Path::new("/t/release/deps/a-1")), "release");
        assert_eq!(profile(Path::new("/t/x86_64-unknown-linux-gnu/debug/deps/a-1")), "dev");
        assert_eq!(profile(Path::new("/t/soak/deps/a-1")), "soak");
    }

    #[test]
    fn only_programs_are_taken_from_the_output_of_cargo() {
        let artifact = |kind: &str, executable: &str| {
            format!(r#"{{"reason":"x","target":{{"kind":["{kind}"],"name":"n"}},"executable":{executable}}}"#)
        };
        assert_eq!(program(&artifact("bin", r#""/t/n""#)), Some(("n".to_owned(), PathBuf::from("/t/n"))));
        assert_eq!(program(&artifact("bin", "null")), None);
        assert_eq!(program(&artifact("test", r#""/t/n""#)), None);
        assert_eq!(program(r#"{"reason":"build-finished","success":true}"#), None);
        assert_eq!(program("no json"), None);
    }
}
