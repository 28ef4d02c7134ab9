//! The Python package as its wheel has it, with the C client in it, for scripts of tests.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::c_controller::installed;
use crate::session::output;
use crate::{PrivateIpc, python};

const PACKAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../edges/python/admittance");

/// An interpreter that finds the package. Needs [`crate::Need::Python`] and [`crate::Need::CToolchain`].
///
/// # Panics
/// When the package cannot be put together.
pub fn command(ipc: &PrivateIpc) -> Command {
    let mut command = Command::new(python().expect("needs(Python) found one"));
    command.env("PYTHONPATH", packages(ipc));
    command
}

/// Runs a script to its end, and returns what it says.
///
/// # Panics
/// When it fails.
pub fn run(ipc: &PrivateIpc, script: &str, arguments: &[&str]) -> String {
    let (code, text) = output(command(ipc).arg("-c").arg(script).args(arguments));
    assert_eq!(code, Some(0), "{text}");
    text
}

fn packages(ipc: &PrivateIpc) -> PathBuf {
    let packages = ipc.directory().join("packages");
    let package = packages.join("admittance");
    std::fs::create_dir_all(&package).expect("a directory");
    for entry in std::fs::read_dir(PACKAGE).expect("the package is there") {
        let path = entry.expect("it can be listed").path();
        if path.is_file() {
            copy(&path, &package.join(path.file_name().expect("a file")));
        }
    }
    copy(&installed().join("lib/libadmittance_client.so"), &package.join("libadmittance_client.so"));
    packages
}

fn copy(from: &Path, to: &Path) {
    std::fs::copy(from, to).expect("copied");
}
