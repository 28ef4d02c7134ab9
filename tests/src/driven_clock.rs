//! A daemon whose clock another program sets: `driven_clock.c`, preloaded.

use std::fs::File;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::ptr;
use std::sync::atomic::{AtomicU64, Ordering};

use admittance_host::clock::monotonic_ns;

use crate::PrivateIpc;
use crate::session::{output, write};

/// A clock that stands still between the instants that it is set to.
#[derive(Debug)]
pub struct DrivenClock {
    library: PathBuf,
    file: PathBuf,
}

impl DrivenClock {
    /// A clock that goes as everywhere, until somebody sets it.
    ///
    /// # Panics
    /// When the C compiler, which every build here has as its linker, does not compile it.
    pub fn new(ipc: &PrivateIpc) -> Self {
        let library = ipc.directory().join("driven_clock.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/driven_clock.c");
        let mut compiler = Command::new("cc");
        compiler.args(["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-o"]);
        let (code, text) = output(compiler.arg(&library).arg(source));
        assert_eq!(code, Some(0), "{text}");
        Self { library, file: write(ipc, "clock", &"\0".repeat(size_of::<u64>())) }
    }

    /// Lets a program run by this clock.
    pub fn drive(&self, program: &mut Command) {
        program.env("LD_PRELOAD", &self.library).env("DRIVEN_CLOCK", &self.file);
    }

    /// What a program is to be preloaded with.
    pub fn library(&self) -> &Path {
        &self.library
    }

    /// Eight bytes: the time in ns, or 0 while it goes by itself.
    pub fn file(&self) -> &Path {
        &self.file
    }
}

/// The hands of a [`DrivenClock`]: while they are held, it stands where it was set last.
#[derive(Debug)]
pub(crate) struct Hands {
    time: *const AtomicU64,
    now_ns: u64,
}

impl Hands {
    /// Takes them: from now on the clock stands.
    ///
    /// # Panics
    /// When the clock's file cannot be mapped.
    pub(crate) fn take(clock: &DrivenClock) -> Self {
        let file = File::options().read(true).write(true).open(clock.file()).expect("the clock was made");
        let (length, access) = (size_of::<u64>(), libc::PROT_READ | libc::PROT_WRITE);
        // SAFETY: a new mapping of a file as long as it; nothing else of this process is there.
        let memory = unsafe { libc::mmap(ptr::null_mut(), length, access, libc::MAP_SHARED, file.as_raw_fd(), 0) };
        assert_ne!(memory, libc::MAP_FAILED, "{}", std::io::Error::last_os_error());
        let mut hands = Self { time: memory.cast::<AtomicU64>().cast_const(), now_ns: 0 };
        hands.set(monotonic_ns());
        hands
    }

    /// Where it stands, in ns.
    pub(crate) fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Sets it to an instant in ns, not earlier than the last.
    pub(crate) fn set(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
        self.store(now_ns);
    }

    fn store(&self, value: u64) {
        // SAFETY: the mapping is aligned to a page and lives as long as this does.
        unsafe { &*self.time }.store(value, Ordering::SeqCst);
    }
}

impl Drop for Hands {
    fn drop(&mut self) {
        // It goes by itself again.
        self.store(0);
        // SAFETY: mapped by `take`, and not used any more.
        unsafe { libc::munmap(self.time.cast_mut().cast(), size_of::<u64>()) };
    }
}
