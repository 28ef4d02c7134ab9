//! What a call says: a code, and what the code means. The header is written from the table below.

use std::ffi::CStr;
use std::fmt;

use admittance_client::Rejection;

macro_rules! statuses {
    ($($name:ident = $code:literal, $c_name:literal: $text:literal;)+) => {
        /// What a call says. Below 0: it failed.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(i32)]
        pub enum Status {
            $(#[doc = $text] $name = $code,)+
        }

        impl Status {
            /// Every status, with its name in C.
            pub const ALL: &[(Self, &str)] = &[$((Self::$name, $c_name),)+];

            /// What a code means; of one that is not declared, that it is none.
            pub fn text_of(code: i32) -> &'static CStr {
                const fn text(bytes: &'static str) -> &'static CStr {
                    match CStr::from_bytes_with_nul(bytes.as_bytes()) {
                        Ok(text) => text,
                        Err(_) => panic!("a text of the table has a zero byte"),
                    }
                }
                match code {
                    $($code => const { text(concat!($text, "\0")) },)+
                    _ => c"this number is no status of this library",
                }
            }
        }
    };
}

statuses! {
    Ok = 0, "OK": "done";
    NoAnswer = 1, "NO_ANSWER": "there is no answer that was not taken yet";
    Late = 2, "LATE": "the answer came too late to act at its instant: it acts from the next sample on";
    InvalidArgument = -1, "INVALID_ARGUMENT": "an argument is NULL, or not accepted";
    Unavailable = -2, "UNAVAILABLE": "shared memory, a service or a port cannot be had";
    Permission = -3, "PERMISSION": "shared memory belongs to another user, or is not writable";
    Schema = -4, "SCHEMA": "the other side speaks another version of the wire contract";
    NoRoom = -5, "NO_ROOM": "there was no room for a sample: it was not published";
    NotFinite = -10, "NOT_FINITE": "refused: a number of the answer is not finite";
    JointCount = -11, "JOINT_COUNT": "refused: the answer is for another number of joints";
    Motion = -12, "MOTION": "refused: the answer has a motion code that is not declared";
    Plan = -13, "PLAN": "refused: the plan of the answer is too long, or its end times do not increase";
    BeyondLimit = -14, "BEYOND_LIMIT": "refused: the answer is beyond the limits of this controller";
    Older = -15, "OLDER": "refused: a newer sample was answered before";
    UnknownSample = -16, "UNKNOWN_SAMPLE": "refused: the answer is to a sample that this boot has not published";
    Panicked = -99, "PANICKED": "the library failed: close the handle, and hold";
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::text_of(*self as i32).to_str().unwrap_or_default())
    }
}

impl From<&Rejection> for Status {
    fn from(rejection: &Rejection) -> Self {
        match rejection {
            Rejection::NotFinite { .. } => Self::NotFinite,
            Rejection::JointCount { .. } => Self::JointCount,
            Rejection::Motion { .. } => Self::Motion,
            Rejection::Plan { .. } => Self::Plan,
            Rejection::BeyondLimit { .. } => Self::BeyondLimit,
            Rejection::Older { .. } => Self::Older,
            Rejection::UnknownSample { .. } => Self::UnknownSample,
        }
    }
}
