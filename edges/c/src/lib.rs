//! The motion controller's side of admittanced for C and everything that can call C. The header
//! `admittance_client.h` is written from this file; what the calls do is `admittance_client::Controller`.
//!
//! A handle may be used from any thread, by one at a time. No call unwinds into its caller: a panic breaks the handle,
//! which then says so, and holds.

mod options;
mod status;
mod text;

use std::ffi::{c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};

use admittance_client::{Applied, Controller, Reception};
use ipc_types::{CommandSample, MAX_JOINTS, Motion, StateSample, TASK_AXES, quiet_iceoryx2};

pub use options::{ABI_VERSION, Options};
pub use status::Status;
use text::Text;

/// A motion controller that is connected, or waits for a daemon.
#[derive(Debug)]
pub struct Client {
    controller: Controller,
    text: Text,
    is_broken: bool,
}

/// What the joints are to do.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Instruction {
    /// Velocity offset to add to the twist reference, m/s and rad/s: x y z rx ry rz, base frame, at the TCP. Zero when
    /// they hold.
    pub velocity_offset: [f64; TASK_AXES],
    /// Until when this holds, in ns of CLOCK_MONOTONIC, unless an answer that is received meanwhile says otherwise;
    /// UINT64_MAX for ever.
    pub until_ns: u64,
    /// ADMITTANCED_MOTION_OFFSET: follow the twist reference plus the offset. ADMITTANCED_MOTION_HOLD: zero joint
    /// velocity, whatever the twist reference is.
    pub motion: u32,
    /// Not used: 0.
    pub reserved: u32,
}

/// What became of the answers so far.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C)]
pub struct Counts {
    /// Answers that came too late to act, or never, since the first accepted one.
    pub missed: u64,
    /// Answers that were refused.
    pub rejected: u64,
    /// Number of the command in force; 0 = none yet.
    pub applied_sequence: u64,
    /// 1 once an answer was accepted.
    pub has_received: u32,
    /// 1 when an answer that is due before the instant asked for is missing.
    pub is_missing: u32,
}

/// The version of this library's interface, to compare with ADMITTANCE_CLIENT_ABI_VERSION.
#[unsafe(no_mangle)]
pub extern "C" fn admittance_client_abi_version() -> u32 {
    ABI_VERSION
}

/// What a status says in general, as a text that lasts as long as the program; for a number that is no status as well.
#[unsafe(no_mangle)]
pub extern "C" fn admittance_status_text(status: i32) -> *const c_char {
    Status::text_of(status).as_ptr()
}

/// Opens the ports of a motion controller. It allocates and takes milliseconds: call it before the cycle starts.
///
/// On success *client is a handle for admittance_client_close. Otherwise *client is NULL, and `message` (NULL for none)
/// gets a text of at most `message_size` bytes with its end that names the option, its value and what is accepted.
///
/// # Safety
/// `options` points to options whose texts end in zero bytes; `client` to room for a pointer; `message` to
/// `message_size` bytes, or it is NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn admittance_client_open(
    options: *const Options,
    client: *mut *mut Client,
    message: *mut c_char,
    message_size: usize,
) -> Status {
    if client.is_null() {
        return Status::InvalidArgument;
    }
    // SAFETY: the caller gives room for a pointer.
    unsafe { client.write(std::ptr::null_mut()) };
    let opened = catch_unwind(|| {
        quiet_iceoryx2();
        // SAFETY: the caller gives options with proper texts, or NULL.
        let options = unsafe { options.as_ref() };
        // SAFETY: as above.
        options.ok_or(options::Refused::Null).and_then(|options| unsafe { options.open() })
    });
    let (status, why) = match opened {
        Ok(Ok(controller)) => {
            let opened = Box::new(Client { controller, text: Text::default(), is_broken: false });
            // SAFETY: as above.
            unsafe { client.write(Box::into_raw(opened)) };
            (Status::Ok, String::new())
        }
        Ok(Err(refused)) => (refused.status(), refused.to_string()),
        Err(_) => (Status::Panicked, "the library failed while the ports were opened".to_owned()),
    };
    // SAFETY: the caller gives that many bytes, or NULL.
    unsafe { text::copy(&why, message, message_size) };
    status
}

/// Closes the ports. NULL is accepted.
///
/// # Safety
/// `client` is a handle that is not used again, or NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn admittance_client_close(client: *mut Client) {
    if !client.is_null() {
        // SAFETY: it came from Box::into_raw, and the caller gives it back.
        let client = unsafe { Box::from_raw(client) };
        // Nobody can be told.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(client)));
    }
}

/// A cycle begins whose state was measured at `stamp_ns` of CLOCK_MONOTONIC. Fills in who the sample is from (sequence,
/// stamp, boot, joints, the command in force; plays_plan = 1) and sets the rest to 0: positions, velocities, references,
/// wrench, wrench_valid, joint_torque, torque_valid, follows_joint_velocity, joint_velocity_reference and drives_enabled are
/// the caller's to set.
///
/// # Safety
/// `client` is a handle that no other thread uses; `sample` points to room for a sample.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn admittance_client_begin(
    client: *mut Client,
    stamp_ns: u64,
    sample: *mut StateSample,
) -> Status {
    if sample.is_null() {
        return Status::InvalidArgument;
    }
    // SAFETY: the caller gives a handle of its own, and room for a sample.
    unsafe { within(client, |client| (sample.write(client.controller.begin(stamp_ns)), Status::Ok).1) }
}

/// Publishes the sample and wakes the daemon: the one system call of a cycle. It is no failure when no daemon runs.
///
/// # Safety
/// `client` is a handle that no other thread uses; `sample` points to a sample.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn admittance_client_publish(client: *mut Client, sample: *const StateSample) -> Status {
    // SAFETY: the caller gives a sample, or NULL.
    let Some(sample) = (unsafe { sample.as_ref() }) else { return Status::InvalidArgument };
    let publish = |client: &mut Client| {
        if client.controller.publish(sample) { Status::Ok } else { client.say(Status::NoRoom, &Status::NoRoom) }
    };
    // SAFETY: the caller gives a handle of its own.
    unsafe { within(client, publish) }
}

/// Takes the newest answer, if one has come that was not taken yet; it does not wait. `now_ns` is the present instant of
/// CLOCK_MONOTONIC: it decides whether the answer is there before it has to act.
///
/// ADMITTANCE_STATUS_OK: accepted, and it acts when it is due. ADMITTANCE_STATUS_LATE: accepted, and it acts from the
/// next sample on. ADMITTANCE_STATUS_NO_ANSWER: there is none. Below 0: refused; admittance_client_text says why.
///
/// # Safety
/// `client` is a handle that no other thread uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn admittance_client_receive(client: *mut Client, now_ns: u64) -> Status {
    let receive = |client: &mut Client| match client.controller.receive(now_ns) {
        Ok(None) => Status::NoAnswer,
        Ok(Some(Reception::InTime)) => Status::Ok,
        Ok(Some(Reception::Late)) => Status::Late,
        Err(rejection) => client.say(Status::from(&rejection), &rejection),
    };
    // SAFETY: the caller gives a handle of its own.
    unsafe { within(client, receive) }
}

/// Puts the answers in force that are due by `now_ns`, and says what the joints are to do: the answer to the sample
/// stamped t acts at t + command_delay_ns, exactly. Without a newer one its plan is played by elapsed time, and when it
/// is no longer valid the joints hold. Before the first answer ever the offset is zero.
///
/// With a status below 0 the instruction is to hold.
///
/// # Safety
/// `client` is a handle that no other thread uses; `instruction` points to room for one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn admittance_client_apply(
    client: *mut Client,
    now_ns: u64,
    instruction: *mut Instruction,
) -> Status {
    if instruction.is_null() {
        return Status::InvalidArgument;
    }
    let hold =
        Instruction { velocity_offset: [0.0; TASK_AXES], until_ns: u64::MAX, motion: Motion::Hold.code(), reserved: 0 };
    // SAFETY: the caller gives room for an instruction.
    unsafe { instruction.write(hold) };
    let apply = |client: &mut Client| {
        let applied = client.controller.apply(now_ns);
        let until_ns = client.controller.next_change(now_ns).unwrap_or(u64::MAX);
        let (velocity_offset, motion) = match applied {
            Applied::Offset(offset) => (offset, Motion::Offset.code()),
            Applied::Hold => (hold.velocity_offset, hold.motion),
        };
        // SAFETY: as above.
        unsafe { instruction.write(Instruction { velocity_offset, until_ns, motion, reserved: 0 }) };
        Status::Ok
    };
    // SAFETY: the caller gives a handle of its own.
    unsafe { within(client, apply) }
}

/// What the joints of a controller add to joint_velocity_reference at `now_ns`, rad/s or m/s of a prismatic joint, after
/// admittance_client_apply at that instant: of one that says follows_joint_velocity = 1 in its samples, and leaves to the
/// daemon how a twist moves its joints. Zeros while the instruction is to hold: then the joint velocity is zero, whatever
/// the reference is.
///
/// # Safety
/// `client` is a handle that no other thread uses; `joint_velocity_offset` points to room for ADMITTANCED_MAX_JOINTS
/// numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn admittance_client_joint_velocity_offset(
    client: *mut Client,
    now_ns: u64,
    joint_velocity_offset: *mut f64,
) -> Status {
    if joint_velocity_offset.is_null() {
        return Status::InvalidArgument;
    }
    let offset = joint_velocity_offset.cast::<[f64; MAX_JOINTS]>();
    // SAFETY: the caller gives room for that many.
    unsafe { offset.write_unaligned([0.0; MAX_JOINTS]) };
    // SAFETY: as above.
    let write = |client: &mut Client| unsafe {
        offset.write_unaligned(client.controller.joint_velocity_offset(now_ns));
        Status::Ok
    };
    // SAFETY: the caller gives a handle of its own.
    unsafe { within(client, write) }
}

/// Makes room for the next sample, so that admittance_client_publish finds it: once per cycle, when the answer has been
/// taken. It is done on a cycle's slack, and without it publish does the same itself, a little later.
///
/// # Safety
/// `client` is a handle that no other thread uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn admittance_client_make_ready(client: *mut Client) -> Status {
    // SAFETY: the caller gives a handle of its own.
    unsafe { within(client, |client| (client.controller.make_ready(), Status::Ok).1) }
}

/// Copies the newest accepted answer, with mode, verdict, stop reason and plan. ADMITTANCE_STATUS_NO_ANSWER, and nothing
/// copied, before the first.
///
/// # Safety
/// `client` is a handle that no other thread uses; `command` points to room for a command.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn admittance_client_newest(client: *mut Client, command: *mut CommandSample) -> Status {
    if command.is_null() {
        return Status::InvalidArgument;
    }
    let copy = |client: &mut Client| match client.controller.newest() {
        // SAFETY: the caller gives room for a command.
        Some(newest) => (unsafe { command.write(*newest) }, Status::Ok).1,
        None => Status::NoAnswer,
    };
    // SAFETY: the caller gives a handle of its own.
    unsafe { within(client, copy) }
}

/// Counts of the answers so far; `until_ns` is the instant up to which is_missing looks.
///
/// # Safety
/// `client` is a handle that no other thread uses; `counts` points to room for them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn admittance_client_counts(client: *mut Client, until_ns: u64, counts: *mut Counts) -> Status {
    if counts.is_null() {
        return Status::InvalidArgument;
    }
    let count = |client: &mut Client| {
        let playback = client.controller.playback();
        let found = Counts {
            missed: playback.missed(),
            rejected: playback.rejected(),
            applied_sequence: playback.applied_sequence(),
            has_received: u32::from(playback.has_received()),
            is_missing: u32::from(playback.is_missing(until_ns)),
        };
        // SAFETY: the caller gives room for counts.
        unsafe { counts.write(found) };
        Status::Ok
    };
    // SAFETY: the caller gives a handle of its own.
    unsafe { within(client, count) }
}

/// Why the last call with a status below 0 failed, with the values that were wrong; empty before. It lasts until the
/// next call.
///
/// # Safety
/// `client` is a handle that no other thread uses, or NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn admittance_client_text(client: *const Client) -> *const c_char {
    // SAFETY: the caller gives a handle of its own, or NULL.
    match unsafe { client.as_ref() } {
        Some(client) => client.text.as_ptr(),
        None => admittance_status_text(Status::InvalidArgument as c_int),
    }
}

impl Client {
    /// Keeps the text, without the heap.
    fn say(&mut self, status: Status, why: &dyn std::fmt::Display) -> Status {
        self.text.set(why);
        status
    }
}

/// Does the work of a call, which may panic, on a handle.
///
/// # Safety
/// `client` is NULL, or a handle that nobody else uses meanwhile.
unsafe fn within(client: *mut Client, work: impl FnOnce(&mut Client) -> Status) -> Status {
    // SAFETY: as the caller promises.
    let Some(client) = (unsafe { client.as_mut() }) else { return Status::InvalidArgument };
    if client.is_broken {
        return Status::Panicked;
    }
    // What a panic leaves half done is not used again.
    let done = catch_unwind(AssertUnwindSafe(|| work(client)));
    done.unwrap_or_else(|_| {
        client.is_broken = true;
        client.say(Status::Panicked, &Status::Panicked)
    })
}
