//! Exit codes: those of sysexits.h where one fits.

/// How a program ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum ExitCode {
    /// Done as asked.
    Ok = 0,
    /// The run is valid, but does not show what it should.
    ClaimNotMet = 1,
    /// Wrong command line (EX_USAGE).
    Usage = 64,
    /// An input file is not what it should be (EX_DATAERR).
    DataError = 65,
    /// An input file is missing (EX_NOINPUT).
    NoInput = 66,
    /// Something needed is missing, or held by another process; also a missing processor feature
    /// (EX_UNAVAILABLE).
    Unavailable = 69,
    /// A bug of the program itself: a panic, a broken invariant (EX_SOFTWARE).
    Internal = 70,
    /// An output file cannot be created (EX_CANTCREAT).
    CantCreate = 73,
    /// Writing or reading failed on the way, such as on a full disk (EX_IOERR).
    IoError = 74,
    /// The machine is too busy for the timing that the result rests on; try again (EX_TEMPFAIL).
    MachineBusy = 75,
    /// A permission is lacking (EX_NOPERM).
    NoPermission = 77,
    /// The configuration is not acceptable (EX_CONFIG).
    Config = 78,
}

impl ExitCode {
    /// Every code, in ascending order.
    pub const ALL: [Self; 12] = [
        Self::Ok,
        Self::ClaimNotMet,
        Self::Usage,
        Self::DataError,
        Self::NoInput,
        Self::Unavailable,
        Self::Internal,
        Self::CantCreate,
        Self::IoError,
        Self::MachineBusy,
        Self::NoPermission,
        Self::Config,
    ];

    /// The number that the parent process sees.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Of a place or a port that could not be opened, for lack of permission or for another reason.
    pub const fn of_refusal(is_permission: bool) -> Self {
        if is_permission { Self::NoPermission } else { Self::Unavailable }
    }

    /// The exit code of a child process, if it is one of ours.
    pub fn from_code(code: i32) -> Option<Self> {
        Self::ALL.into_iter().find(|exit| i32::from(exit.code()) == code)
    }
}

impl From<ExitCode> for std::process::ExitCode {
    fn from(exit: ExitCode) -> Self {
        Self::from(exit.code())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_sysexits() {
        let codes = ExitCode::ALL.map(ExitCode::code);
        assert_eq!(codes, [0, 1, 64, 65, 66, 69, 70, 73, 74, 75, 77, 78]);
    }

    #[test]
    fn a_code_gives_its_name_back() {
        for exit in ExitCode::ALL {
            assert_eq!(ExitCode::from_code(i32::from(exit.code())), Some(exit));
        }
        assert_eq!(ExitCode::from_code(2), None);
        assert_eq!(ExitCode::from_code(-1), None);
        assert_eq!(ExitCode::from_code(64 + 256), None);
    }
}
