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
    /// The edge to ABB robots.
    pub admittance_egm: PathBuf,
    /// The same with a loop that fails when it is told to.
    pub failing_edge: PathBuf,
    /// What developers measure with.
    pub admittance_lab: PathBuf,
    /// The C client, from which its libraries are installed.
    pub client_archive: PathBuf,
    /// The plant for a controller in C.
    pub plant_library: PathBuf,
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
        // All members, and the test that uses cbindgen, as for `cargo test`: what is chosen for a dependency
        // depends on what is built together, and anything else is another build of everything.
        .args(["build", "--workspace", "--bins", "--lib", "--test", "header", "--example", "failing_edge"])
        .arg("--message-format=json-render-diagnostics")
        .args(["--profile", profile(&test)])
        .current_dir(root)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .expect("cargo starts: it started this test");
    let messages = std::io::BufReader::new(child.stdout.take().expect("stdout is piped")).lines();
    let programs: Vec<(String, PathBuf)> =
        messages.map_while(Result::ok).filter_map(|message| artifact(&message)).collect();
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
        admittance_egm: path("admittance-egm"),
        failing_edge: path("failing_edge"),
        admittance_lab: path("admittance-lab"),
        client_archive: path("admittance_client_c"),
        plant_library: path("plant_library"),
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

/// Name and path of the program, or the library for C, that a line of cargo's output reports.
fn artifact(message: &str) -> Option<(String, PathBuf)> {
    let message: serde_json::Value = serde_json::from_str(message).ok()?;
    let target = &message["target"];
    let is_of = |kind: &str| target["kind"].as_array().is_some_and(|kinds| kinds.iter().any(|found| found == kind));
    let file = |ending: &str| {
        let files = message["filenames"].as_array()?;
        files.iter().filter_map(|file| file.as_str()).find(|file| file.ends_with(ending))
    };
    let path = if is_of("bin") || is_of("example") {
        message["executable"].as_str()?
    } else if is_of("staticlib") {
        file(".a")?
    } else if is_of("cdylib") {
        file(".so")?
    } else {
        return None;
    };
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
    fn only_programs_and_libraries_for_c_are_taken_from_the_output_of_cargo() {
        let line = |kind: &str, executable: &str| {
            format!(
                r#"{{"reason":"x","target":{{"kind":["{kind}"],"name":"n"}},"executable":{executable},"filenames":["/t/n.rlib","/t/n.a"]}}"#
            )
        };
        assert_eq!(artifact(&line("bin", r#""/t/n""#)), Some(("n".to_owned(), PathBuf::from("/t/n"))));
        assert_eq!(artifact(&line("bin", "null")), None);
        assert_eq!(artifact(&line("test", r#""/t/n""#)), None);
        assert_eq!(artifact(&line("staticlib", "null")), Some(("n".to_owned(), PathBuf::from("/t/n.a"))));
        assert_eq!(artifact(r#"{"reason":"build-finished","success":true}"#), None);
        assert_eq!(artifact("no json"), None);
    }
}
