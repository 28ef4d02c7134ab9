//! The physics of plant-sim behind the C interface of `plant.h`, for a motion controller that is not plant-sim. It is
//! for tests alone: it trusts its caller, and a panic ends the program.

use std::ffi::{CStr, c_char, c_int};
use std::fs::File;
use std::io::Write;
use std::path::Path;

use admittance_client::Applied;
use admittance_core::quantities::Span;
use admittance_host::config;
use ipc_types::{Motion, StateSample, TASK_AXES};
use plant_sim::plant::{CycleTiming, Led};
use plant_sim::run::{AnyPlant, any_plant};
use plant_sim::scenario::Scenario;

/// Where the truth is written to.
const TRUTH: &str = "PLANT_TRUTH";

/// A plant, and where its truth goes.
pub struct Plant {
    plant: Box<dyn AnyPlant>,
    /// A file or pipe that is named by the environment; `None` when nobody wants it.
    truth: Option<File>,
}

impl std::fmt::Debug for Plant {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Plant at {} ns", self.plant.now_ns())
    }
}

/// `plant_timing`.
#[derive(Debug)]
#[repr(C)]
pub struct Timing {
    sampling_time_ns: u64,
    command_delay_ns: u64,
    joint_count: u32,
    reserved: u32,
}

/// `plant_cycle`.
#[derive(Debug)]
#[repr(C)]
pub struct Cycle {
    answer_time_ns: u64,
    lateness_ns: u64,
    missed_commands: u64,
    velocity_offset: [f64; TASK_AXES],
    motion: u32,
    missed: u32,
}

fn applied(motion: u32, offset: [f64; TASK_AXES]) -> Applied {
    if motion == Motion::Hold.code() { Applied::Hold } else { Applied::Offset(offset) }
}

/// See `plant.h`.
///
/// # Safety
/// `scenario` ends in a zero byte; `timing` points to room for one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn plant_open(scenario: *const c_char, first_stamp_ns: u64, timing: *mut Timing) -> *mut Plant {
    // SAFETY: as the caller promises.
    let path = unsafe { CStr::from_ptr(scenario) }.to_string_lossy();
    let opened = config::load::<Scenario>(Path::new(&*path)).map_err(|error| error.to_string()).and_then(|scenario| {
        let plant =
            any_plant(&scenario, first_stamp_ns, first_stamp_ns | 1, true).map_err(|error| error.to_string())?;
        let truth = std::env::var_os(TRUTH).map(|path| {
            File::options().write(true).open(&path).map_err(|error| format!("{TRUTH} = {path:?}: {error}"))
        });
        Ok((scenario, Plant { plant, truth: truth.transpose()? }))
    });
    match opened {
        Ok((scenario, plant)) => {
            let nanoseconds = |seconds| Span::from_seconds(seconds).nanoseconds();
            // SAFETY: as the caller promises.
            unsafe {
                timing.write(Timing {
                    sampling_time_ns: nanoseconds(scenario.timing.sampling_time_s),
                    command_delay_ns: nanoseconds(scenario.timing.command_delay_s),
                    joint_count: scenario.robot.joint.len() as u32,
                    reserved: 0,
                });
            }
            Box::into_raw(Box::new(plant))
        }
        Err(why) => {
            eprintln!("{why}");
            std::ptr::null_mut()
        }
    }
}

/// See `plant.h`.
///
/// # Safety
/// `plant` came from [`plant_open`] and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn plant_close(plant: *mut Plant) {
    if !plant.is_null() {
        // SAFETY: as the caller promises.
        drop(unsafe { Box::from_raw(plant) });
    }
}

/// See `plant.h`.
#[unsafe(no_mangle)]
pub extern "C" fn plant_cycle_end_ns(plant: &Plant) -> u64 {
    plant.plant.cycle_end_ns()
}

/// See `plant.h`.
#[unsafe(no_mangle)]
pub extern "C" fn plant_is_finished(plant: &Plant) -> c_int {
    c_int::from(plant.plant.is_finished())
}

/// See `plant.h`.
#[unsafe(no_mangle)]
pub extern "C" fn plant_measure(plant: &Plant, sample: &mut StateSample) -> c_int {
    let (boot_id, applied_command_sequence) = (sample.boot_id, sample.applied_command_sequence);
    *sample = StateSample { boot_id, applied_command_sequence, ..*plant.plant.sample() };
    c_int::from(plant.plant.publishes())
}

/// See `plant.h`.
#[unsafe(no_mangle)]
pub extern "C" fn plant_shows_commands(plant: &Plant) -> c_int {
    c_int::from(plant.plant.shows_commands())
}

/// See `plant.h`.
#[unsafe(no_mangle)]
pub extern "C" fn plant_truth(plant: &mut Plant, cycle: &Cycle) {
    let truth = plant.plant.led_truth(&Led {
        timing: CycleTiming { answer_time_ns: cycle.answer_time_ns, lateness_ns: cycle.lateness_ns },
        applied: applied(cycle.motion, cycle.velocity_offset),
        missed: cycle.missed != 0,
        missed_commands: cycle.missed_commands,
    });
    let Some(file) = &mut plant.truth else { return };
    // SAFETY: a sample of the wire has no padding: all its bytes are set.
    let bytes = unsafe { std::slice::from_raw_parts((&raw const truth).cast::<u8>(), size_of_val(&truth)) };
    if file.write_all(bytes).is_err() {
        // Its reader is gone.
        plant.truth = None;
    }
}

/// See `plant.h`.
#[unsafe(no_mangle)]
pub extern "C" fn plant_follow(plant: &mut Plant, motion: u32, offset: &[f64; TASK_AXES], until_ns: u64) -> u64 {
    plant.plant.follow(&applied(motion, *offset), until_ns);
    plant.plant.now_ns()
}

/// See `plant.h`.
#[unsafe(no_mangle)]
pub extern "C" fn plant_arrive(plant: &mut Plant, has_received: c_int) {
    plant.plant.arrive(has_received != 0);
}
