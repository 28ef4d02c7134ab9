//! Requirements of a test beyond the Rust toolchain.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// The version of the Python package that the wire contract is tested with: that of the crate.
pub const ICEORYX2_PYTHON_VERSION: &str = "0.10.0";
/// The version of the Python package that recordings are read with.
pub const MCAP_PYTHON_VERSION: &str = "1.6.0";
/// The version of the Python package that the arm with masses is judged by.
pub const MUJOCO_PYTHON_VERSION: &str = "4.0.0";
/// The version of Pinocchio that imported arms are held to.
const PINOCCHIO_PYTHON_VERSION: &str = "4.1.0";
/// The version of the descriptions that are imported.
const ROBOT_DATA_PYTHON_VERSION: &str = "6.0.0";
/// The version of what the notebook draws with.
const MATPLOTLIB_PYTHON_VERSION: &str = "3.11.2";
/// The version of what wheels are built by.
const SETUPTOOLS_PYTHON_VERSION: &str = "84.2.1";
/// The version of the type checker.
const MYPY_PYTHON_VERSION: &str = "2.4.1";
/// The version of the tunnel that carries records to other machines.
const TUNNEL_VERSION: &str = "0.10.0";

/// The version of the package that EGM messages are held to.
const ABB_ROBOT_EGM_PYTHON_VERSION: &str = "1.0.7";

const REQUIRE: &str = "ADMITTANCE_TESTS_REQUIRE";
const PYTHON: &str = "ADMITTANCE_PYTHON";

/// Something that not every machine has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// A Python 3 that imports iceoryx2 of [`ICEORYX2_PYTHON_VERSION`], mcap of
    /// [`MCAP_PYTHON_VERSION`] and MuJoCo of [`MUJOCO_PYTHON_VERSION`]: see [`python`].
    Python,
    /// That Python with Pinocchio and example-robot-data, of the versions that CI installs.
    RobotDescriptions,
    /// That Python with ABBRobotEGM, of the version that CI installs.
    AbbRobotEgm,
    /// That Python with matplotlib, setuptools and mypy, of the versions that CI installs.
    PythonTools,
    /// Effective user id 0.
    Root,
    /// systemd and the means (root, namespaces) to run one apart from the machine's own.
    Systemd,
    /// strace, and the permission to trace.
    Strace,
    /// gcc, g++, pkg-config and nm.
    CToolchain,
    /// dpkg, binutils and lintian.
    Packages,
    /// iceoryx2's tunnel over zenoh, of `TUNNEL_VERSION`: see [`tunnel`]; and the means (root, iproute2, namespaces) to make
    /// two machines of one.
    Tunnel,
}

/// Whether the machine has what a test needs. If not, says `SKIPPED: reason`, and the test returns:
/// `if !needs(Need::Root) { return; }`.
///
/// # Panics
/// With `ADMITTANCE_TESTS_REQUIRE=all` a need that is not met fails the test.
#[must_use]
#[track_caller]
pub fn needs(need: Need) -> bool {
    let required = std::env::var(REQUIRE).ok();
    match reason_to_skip(required.as_deref(), need, look_for(need)) {
        Ok(None) => true,
        Ok(Some(reason)) => {
            let test = std::thread::current().name().unwrap_or("test").to_owned();
            // Not eprintln!: the harness shows that of failing tests only. A closed stderr is no
            // reason to fail.
            let _ = writeln!(std::io::stderr(), "SKIPPED: {reason} ({test})");
            false
        }
        Err(failure) => panic!("{failure}"),
    }
}

/// The interpreter of [`Need::Python`]: the first of `ADMITTANCE_PYTHON`, the one that `.ci/run`
/// installs, and `python3` that has the packages; `ADMITTANCE_PYTHON`, when set, is the only one
/// looked at.
pub fn python() -> Option<PathBuf> {
    find_python().as_ref().ok().cloned()
}

fn reason_to_skip(required: Option<&str>, need: Need, found: Result<(), String>) -> Result<Option<String>, String> {
    let all = match required {
        None | Some("") => false,
        Some("all") => true,
        Some(other) => return Err(format!("{REQUIRE} = \"{other}\": accepted is \"all\", or nothing")),
    };
    match found {
        Ok(()) => Ok(None),
        Err(reason) if all => Err(format!("this test needs {need:?}, and {REQUIRE}=all forbids to skip it: {reason}")),
        Err(reason) => Ok(Some(reason)),
    }
}

fn look_for(need: Need) -> Result<(), String> {
    match need {
        Need::Python => find_python().as_ref().map(|_| ()).map_err(Clone::clone),
        Need::RobotDescriptions => {
            find_python().as_ref().map_err(Clone::clone).and_then(|python| robot_descriptions(python))
        }
        Need::AbbRobotEgm => find_python().as_ref().map_err(Clone::clone).and_then(|python| abb_robot_egm(python)),
        Need::PythonTools => find_python().as_ref().map_err(Clone::clone).and_then(|python| python_tools(python)),
        Need::Root => root(),
        Need::Systemd => root().and_then(|()| systemd()),
        Need::Strace => run("strace", &["-o", "/dev/null", "true"]),
        Need::Packages => {
            ["dpkg-deb", "strip", "objdump", "lintian"].iter().try_for_each(|program| run(program, &["--version"]))
        }
        Need::Tunnel => root().and_then(|()| two_machines()).and_then(|()| find_tunnel().map(|_| ())),
        Need::CToolchain => {
            ["gcc", "g++", "pkg-config", "nm"].iter().try_for_each(|program| run(program, &["--version"]))
        }
    }
}

fn root() -> Result<(), String> {
    // SAFETY: geteuid takes nothing, cannot fail and touches no memory.
    match unsafe { libc::geteuid() } {
        0 => Ok(()),
        user => Err(format!("needs root, runs as user {user}")),
    }
}

fn systemd() -> Result<(), String> {
    let path = "/lib/systemd/systemd";
    if !Path::new(path).exists() {
        return Err(format!("there is no {path}"));
    }
    crate::systemd::cgroup_root()?;
    run("nsenter", &["--version"])?;
    run("unshare", &["--fork", "--pid", "--mount", "--uts", "--ipc", "--cgroup", "--mount-proc", "true"])
}

fn two_machines() -> Result<(), String> {
    run("ip", &["-Version"])?;
    run("nsenter", &["--version"])?;
    run("setpriv", &["--version"])?;
    run("taskset", &["--version"])?;
    run("unshare", &["--net", "--mount", "--time", "--monotonic", "1", "--fork", "true"])
}

/// iceoryx2's tunnel: the one in PATH, or the one that `.ci/run` installs.
pub fn tunnel() -> Option<PathBuf> {
    find_tunnel().ok()
}

fn find_tunnel() -> Result<PathBuf, String> {
    let name = "iox2-link-tunnel-zenoh";
    let candidates = [Some(PathBuf::from(name)), installed_by_ci(&format!("tools/bin/{name}"))];
    let is_it = |program: &PathBuf| {
        let said = Command::new(program).arg("--version").stdin(Stdio::null()).output();
        said.is_ok_and(|said| String::from_utf8_lossy(&said.stdout).trim_end().ends_with(TUNNEL_VERSION))
    };
    let found = candidates.into_iter().flatten().find(is_it);
    found.ok_or_else(|| format!("there is no {name} {TUNNEL_VERSION}: docs/monitoring.md says how to install it"))
}

fn find_python() -> &'static Result<PathBuf, String> {
    static FOUND: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    FOUND.get_or_init(|| {
        let candidates = match std::env::var_os(PYTHON).filter(|path| !path.is_empty()) {
            Some(path) => vec![PathBuf::from(path)],
            None => installed_by_ci("python/bin/python3").into_iter().chain([PathBuf::from("python3")]).collect(),
        };
        let versions =
            [("iceoryx2", ICEORYX2_PYTHON_VERSION), ("mcap", MCAP_PYTHON_VERSION), ("mujoco", MUJOCO_PYTHON_VERSION)];
        let script = format!("import iceoryx2, mcap.reader, mujoco\n{}", version_checks(&versions));
        let mut reasons = Vec::new();
        for candidate in candidates {
            match run(&candidate.to_string_lossy(), &["-c", &script]) {
                Ok(()) => return Ok(candidate),
                Err(reason) => reasons.push(reason),
            }
        }
        let packages = versions.map(|(package, version)| format!("{package} {version}")).join(", ");
        Err(format!("no Python with {packages}: {}", reasons.join("; ")))
    })
}

fn robot_descriptions(python: &Path) -> Result<(), String> {
    let script = format!(
        "import importlib.metadata as m, pinocchio; v = m.version('pin'), m.version('example-robot-data'); assert v == \
         ('{PINOCCHIO_PYTHON_VERSION}', '{ROBOT_DATA_PYTHON_VERSION}'), 'pin %s, example-robot-data %s' % v"
    );
    run(&python.to_string_lossy(), &["-c", &script])
}

fn abb_robot_egm(python: &Path) -> Result<(), String> {
    let versions = [("ABBRobotEGM", ABB_ROBOT_EGM_PYTHON_VERSION)];
    run(&python.to_string_lossy(), &["-c", &(version_checks(&versions) + "import ABBRobotEGM\n")])
}

/// Lines of Python that fail where a package has another version.
fn version_checks(versions: &[(&str, &str)]) -> String {
    let check = |(package, version): &(&str, &str)| {
        format!("v = m.version('{package}'); assert v == '{version}', '{package} %s, not {version}' % v\n")
    };
    format!("import importlib.metadata as m\n{}", versions.iter().map(check).collect::<String>())
}

fn python_tools(python: &Path) -> Result<(), String> {
    let versions = [
        ("matplotlib", MATPLOTLIB_PYTHON_VERSION),
        ("setuptools", SETUPTOOLS_PYTHON_VERSION),
        ("mypy", MYPY_PYTHON_VERSION),
    ];
    run(&python.to_string_lossy(), &["-c", &version_checks(&versions)])
}

/// What `.ci/run` keeps there.
fn installed_by_ci(file: &str) -> Option<PathBuf> {
    let cache = std::env::var_os("XDG_CACHE_HOME").filter(|path| !path.is_empty()).map(PathBuf::from);
    let cache = cache.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cache")))?;
    Some(cache.join("admittanced-ci").join(file)).filter(|path| path.exists())
}

/// Runs a program to see whether it works; the error names it and ends with the last line that it
/// wrote to stderr.
fn run(program: &str, arguments: &[&str]) -> Result<(), String> {
    let output = Command::new(program).args(arguments).stdin(Stdio::null()).output();
    let output = output.map_err(|error| format!("{program} does not run: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    let text = String::from_utf8_lossy(&output.stderr);
    Err(format!("{program} does not work here ({}): {}", output.status, text.lines().last().unwrap_or("")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_need_that_is_not_met_skips_or_fails_as_the_environment_says() {
        let missing = || Err("no such tool".to_owned());
        assert_eq!(reason_to_skip(None, Need::Strace, Ok(())), Ok(None));
        assert_eq!(reason_to_skip(Some("all"), Need::Strace, Ok(())), Ok(None));
        assert_eq!(reason_to_skip(None, Need::Strace, missing()), Ok(Some("no such tool".to_owned())));
        assert_eq!(reason_to_skip(Some(""), Need::Strace, missing()), Ok(Some("no such tool".to_owned())));
        let failure = reason_to_skip(Some("all"), Need::Strace, missing()).expect_err("all is required");
        assert!(failure.contains("Strace") && failure.contains("no such tool"), "{failure}");
        let failure = reason_to_skip(Some("most"), Need::Strace, Ok(())).expect_err("not a value");
        assert!(failure.contains("\"most\"") && failure.contains("\"all\""), "{failure}");
    }

    #[test]
    fn a_program_that_fails_or_is_missing_is_named_with_its_last_words() {
        assert_eq!(run("sh", &["-c", "exit 0"]), Ok(()));
        let failure = run("sh", &["-c", "echo first >&2; echo last >&2; exit 3"]).expect_err("it failed");
        assert!(failure.starts_with("sh does not work here") && failure.ends_with("last"), "{failure}");
        let failure = run("/no/such/program", &[]).expect_err("it is missing");
        assert!(failure.starts_with("/no/such/program does not run"), "{failure}");
    }

    #[test]
    fn the_interpreter_is_named_exactly_when_the_need_is_met() {
        assert_eq!(look_for(Need::Python).is_ok(), python().is_some());
    }
}
