//! The URDF that a description is from: read once for its text and its SHA-256, and later to see
//! whether it is still the same.

use std::fmt::Write as _;
use std::io;
use std::path::Path;

use admittance_host::config::{escaped, read_bytes};
use admittance_host::robot_description::RobotDescription;
use sha2::{Digest as _, Sha256};

use super::xml::LARGEST_URDF;

/// What is in the file, and its SHA-256 in hexadecimal digits.
pub(super) fn read(path: &Path) -> io::Result<(Vec<u8>, String)> {
    let bytes = read_bytes(path, LARGEST_URDF)?;
    let mut digits = String::new();
    for byte in Sha256::digest(&bytes) {
        // A string takes every text.
        let _ = write!(digits, "{byte:02x}");
    }
    Ok((bytes, digits))
}

/// What to say of the URDF that the robot of a file was imported from.
pub(crate) fn warning(robot: &RobotDescription, file: &Path) -> Option<String> {
    let source = robot.source.as_ref()?;
    let path = file.parent().unwrap_or(Path::new("")).join(&source.urdf);
    let urdf = escaped(&path.to_string_lossy());
    match read(&path) {
        Ok((_, found)) if found.eq_ignore_ascii_case(&source.sha256) => None,
        Ok((_, found)) => Some(format!(
            "robot.source.urdf = {urdf} has changed since it was imported (SHA-256 {found}, then {}): import it again, take over \
             what differs, and robot.source.sha256",
            source.sha256
        )),
        Err(error) => Some(format!(
            "robot.source.urdf = {urdf} cannot be read: {error}: whether it has changed since it was imported is not \
             known; give its path, or leave [robot.source] out"
        )),
    }
}
