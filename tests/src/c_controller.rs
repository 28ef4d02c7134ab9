//! A motion controller in C in plant-sim's place: the C client as it is installed, its example compiled by this
//! machine's compiler, and the truth of its plant for whoever reads it.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use ipc_types::services::{self, Access};
use ipc_types::{Node, Publisher, TruthSample};

use crate::session::output;
use crate::{PrivateIpc, binaries};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
/// What every program in C and C++ is compiled with.
const STRICT: [&str; 4] = ["-Wall", "-Wextra", "-Werror", "-pedantic"];

/// Where `edges/c/install` has put the client, once for all tests of this process.
///
/// # Panics
/// When it does not.
pub fn installed() -> &'static Path {
    static PREFIX: OnceLock<PathBuf> = OnceLock::new();
    PREFIX.get_or_init(|| {
        let archive = &binaries().client_archive;
        let prefix = archive.with_file_name("c-client");
        let script = Path::new(ROOT).join("edges/c/install");
        let (code, text) = output(Command::new(script).arg(&prefix).arg(archive));
        assert_eq!(code, Some(0), "{text}");
        prefix
    })
}

/// Which of the client's libraries a program is linked with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Library {
    /// `libadmittance_client.so`.
    Shared,
    /// `libadmittance_client.a`, which the program then has in it.
    Static,
}

/// Compiles an example of the C client, as `name`, by this compiler with these arguments, and links it with the shared
/// library as pkg-config says.
///
/// # Panics
/// When it does not compile without a warning.
pub fn compile(compiler: &str, arguments: &[&str], example: &str, name: &str) -> PathBuf {
    link(Library::Shared, compiler, arguments, example, name)
}

/// As [`compile`], with either library.
///
/// # Panics
/// When it does not compile without a warning.
pub fn link(library: Library, compiler: &str, arguments: &[&str], example: &str, name: &str) -> PathBuf {
    let (prefix, plant) = (installed(), &binaries().plant_library);
    let mut pkg_config = Command::new("pkg-config");
    pkg_config.args(["--cflags", "--libs", "admittance_client"]).env("PKG_CONFIG_PATH", prefix.join("lib/pkgconfig"));
    if library == Library::Static {
        pkg_config.arg("--static");
    }
    let (code, mut flags) = output(&mut pkg_config);
    assert_eq!(code, Some(0), "{flags}");
    if library == Library::Static {
        // Both are in one directory, where the linker prefers the shared one.
        flags = flags.replace("-ladmittance_client", "-l:libadmittance_client.a");
    }
    let program = prefix.join(name);
    let mut command = Command::new(compiler);
    command.args(STRICT).args(arguments).arg("-I").arg(Path::new(ROOT).join("tests/plant"));
    // What follows the source is no source, whatever language that was said to be.
    command.arg(Path::new(ROOT).join("edges/c/examples").join(example)).args(["-x", "none"]);
    command.args(flags.split_whitespace()).arg(plant).arg("-pthread").arg("-o").arg(&program);
    command.arg(format!("-Wl,-rpath,{}", prefix.join("lib").display()));
    command.arg(format!("-Wl,-rpath,{}", plant.parent().expect("a file").display()));
    let (code, text) = output(&mut command);
    assert_eq!(code, Some(0), "{command:?}: {text}");
    program
}

/// A command line of the example controller for this scenario; its truth goes to `relay`.
///
/// # Panics
/// When it does not compile.
pub fn controller_command(ipc: &PrivateIpc, scenario: &Path, relay: &TruthRelay) -> Command {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    let program = PROGRAM.get_or_init(|| compile("gcc", &["-std=c11", "-O2"], "controller.c", "controller"));
    command_of(program, ipc, scenario, relay)
}

/// As [`controller_command`], of the example as it was compiled before.
pub fn command_of(program: &Path, ipc: &PrivateIpc, scenario: &Path, relay: &TruthRelay) -> Command {
    let settings = ipc.settings();
    let mut command = Command::new(program);
    command.arg(&settings.root_path).args([&settings.prefix, settings.instance.as_str()]).arg(scenario);
    command.env("PLANT_TRUTH", &relay.pipe);
    command
}

/// Publishes the truth that a plant library writes: a process may have one iceoryx2 only, and the controller's is in
/// its client.
#[derive(Debug)]
pub struct TruthRelay {
    pipe: PathBuf,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl TruthRelay {
    /// A relay for the plants of this place, one after the other.
    ///
    /// # Panics
    /// When there is no pipe or no service.
    pub fn new(ipc: &PrivateIpc) -> Self {
        let pipe = ipc.directory().join("truth");
        let path = std::ffi::CString::new(pipe.as_os_str().as_bytes()).expect("no zero byte");
        // SAFETY: the path ends in a zero byte and outlives the call.
        assert_eq!(unsafe { libc::mkfifo(path.as_ptr(), 0o600) }, 0, "{}", std::io::Error::last_os_error());
        // Open for writing as well: it does not end when a plant does.
        let reader = File::options().read(true).write(true).custom_flags(libc::O_NONBLOCK).open(&pipe);
        let (reader, settings) = (reader.expect("just made"), ipc.settings().clone());
        let is_over = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&is_over);
        let thread = std::thread::spawn(move || {
            let mut port: Option<(u64, Publisher<TruthSample>, Node)> = None;
            while !asked.load(Ordering::Relaxed) {
                let Some(truth) = next(&reader) else {
                    std::thread::sleep(Duration::from_micros(200));
                    continue;
                };
                // A new plant makes its services anew, as plant-sim does: the place may have been removed.
                if port.as_ref().is_none_or(|(boot_id, ..)| *boot_id != truth.boot_id) {
                    drop(port.take());
                    let node = settings.node("truth").expect("a node");
                    let service = services::truth(&node, &settings.instance, Access::OpenOrCreate).expect("a service");
                    port = Some((truth.boot_id, service.publisher().expect("a publisher"), node));
                }
                if let Some((_, publisher, _)) = &port {
                    // No subscriber is no failure.
                    let _ = publisher.send_copy(truth);
                }
            }
        });
        Self { pipe, is_over, thread: Some(thread) }
    }
}

/// The next truth in the pipe, which takes and gives each as a whole: it is shorter than what a pipe keeps together.
fn next(mut pipe: &File) -> Option<TruthSample> {
    let mut bytes = [0_u8; size_of::<TruthSample>()];
    match pipe.read(&mut bytes) {
        Ok(length) if length == bytes.len() => {
            // SAFETY: the plant library has written a sample, and every value of its bytes is one.
            let truth = unsafe { std::mem::transmute::<[u8; size_of::<TruthSample>()], TruthSample>(bytes) };
            Some(truth)
        }
        Err(error) if error.kind() == ErrorKind::WouldBlock => None,
        other => panic!("the pipe gave {other:?}, not one truth"),
    }
}

impl Drop for TruthRelay {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let ended = thread.join();
            assert!(ended.is_ok() || std::thread::panicking(), "the relay failed");
        }
    }
}
