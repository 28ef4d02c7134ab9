//! What a running process or thread asks of the system.

use std::path::Path;
use std::process::Command;

use crate::session::wait_for_log;
use crate::{Child, PATIENCE};

/// strace on a process or thread. See [`Need::Strace`](crate::Need::Strace).
pub struct Strace(Child);

impl Strace {
    /// Writes the system calls of this process or thread into a file from now on.
    ///
    /// # Panics
    /// When strace does not attach.
    pub fn attach(id: &str, trace: &Path) -> Self {
        let mut child = Child::spawn(Command::new("strace").arg("-o").arg(trace).args(["-p", id]));
        wait_for_log(&mut child, "attached");
        Self(child)
    }

    /// Leaves it alone again; the file is then whole.
    ///
    /// # Panics
    /// When strace does not end.
    pub fn detach(mut self) {
        self.0.signal(libc::SIGINT);
        self.0.wait_for_exit(PATIENCE);
    }
}
