//! A daemon whose clock another program sets: `driven_clock.c`, preloaded.

use std::path::{Path, PathBuf};
use std::process::Command;

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
