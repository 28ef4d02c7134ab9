//! A terminal for a program under test, and what a person would see on it.

use std::fs::File;
use std::io::Write;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};

use crate::Child;

/// Rows and columns of every terminal.
const SIZE: (u16, u16) = (40, 110);

/// The other side of a program's terminal.
#[derive(Debug)]
pub struct Terminal {
    master: File,
}

impl Terminal {
    /// A new one, and the side of the program.
    pub(crate) fn open() -> (Self, OwnedFd) {
        let (mut master, mut slave) = (-1, -1);
        let size = libc::winsize { ws_row: SIZE.0, ws_col: SIZE.1, ws_xpixel: 0, ws_ypixel: 0 };
        // SAFETY: the two numbers are valid for writing, the size for reading; no name and no
        // attributes are asked for.
        let opened = unsafe {
            libc::openpty(&raw mut master, &raw mut slave, std::ptr::null_mut(), std::ptr::null(), &raw const size)
        };
        assert_eq!(opened, 0, "no terminal: {}", std::io::Error::last_os_error());
        // SAFETY: openpty has opened both, and nothing else owns them.
        unsafe { (Self { master: File::from_raw_fd(master) }, OwnedFd::from_raw_fd(slave)) }
    }

    /// Reads what the program writes.
    pub(crate) fn output(&self) -> File {
        self.master.try_clone().expect("a descriptor is left")
    }

    /// Types these characters.
    ///
    /// # Panics
    /// When the terminal is gone.
    pub fn keys(&mut self, text: &str) {
        self.master.write_all(text.as_bytes()).expect("the terminal takes input");
    }

    /// Whether the terminal shows what is typed, as it does unless a program has changed it.
    pub fn echoes(&self) -> bool {
        // SAFETY: an all-zero termios is a valid value, and the call only writes to it.
        let (status, attributes) = unsafe {
            let mut attributes: libc::termios = std::mem::zeroed();
            (libc::tcgetattr(self.master.as_raw_fd(), &raw mut attributes), attributes)
        };
        assert_eq!(status, 0, "the terminal's attributes: {}", std::io::Error::last_os_error());
        attributes.c_lflag & libc::ECHO != 0
    }
}

/// What the terminal of `child` shows now, and whether that is the alternate screen.
pub fn screen(child: &Child) -> (String, bool) {
    let mut parser = vt100::Parser::new(SIZE.0, SIZE.1, 0);
    parser.process(child.stdout().as_bytes());
    (parser.screen().contents(), parser.screen().alternate_screen())
}

/// In the child, before exec: a session of its own, with its stdin as the controlling terminal.
///
/// # Errors
/// Where there is none to take.
pub fn take_terminal() -> std::io::Result<()> {
    // SAFETY: setsid takes nothing and touches no memory.
    if unsafe { libc::setsid() } < 0 {
        return Err(std::io::Error::last_os_error());
    }
    // SAFETY: TIOCSCTTY takes a number and touches no memory.
    if unsafe { libc::ioctl(0, libc::TIOCSCTTY, 0) } != 0 {
        return Err(std::io::Error::last_os_error());
    }
    Ok(())
}
