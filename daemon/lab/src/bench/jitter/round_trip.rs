//! Round trips between two processors, both spinning: through bare shared memory, and through
//! iceoryx2 with the samples and services of the daemon.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use admittance_host::clock::monotonic_ns;
use ipc_types::services::{self, Access};
use ipc_types::{CommandSample, StateSample};
use plant_sim::scenario::Scenario;

use super::figures::Durations;
use super::{DAEMON_CPU, PLANT_CPU, on_processor};
use admittancectl::Exit;
use admittancectl::demo::SCENARIO;
use admittancectl::session::Session;

/// Round trips of each kind.
const TRIPS: u64 = 50_000;
/// First round trips, which wait for the other side to begin.
const BEGINNING: u64 = 100;
/// If the threads cannot run at the same time a trip takes a time slice: then there are fewer.
const PATIENCE: Duration = Duration::from_secs(3);

/// Memory that both threads see; unmapped on drop.
struct Shared(*mut libc::c_void);

/// Its size in bytes: a cache line to tell whose turn it is, and either sample.
const SHARED: usize = 4096;
/// Words of the turn's cache line.
const LINE: usize = 8;

// SAFETY: the memory is only used as the atomics that `words` gives.
unsafe impl Sync for Shared {}

impl Shared {
    fn map() -> Result<Self, (Exit, String)> {
        let (protection, flags) = (libc::PROT_READ | libc::PROT_WRITE, libc::MAP_SHARED | libc::MAP_ANONYMOUS);
        // SAFETY: a new mapping at an address of the kernel's choice, without a file.
        let address = unsafe { libc::mmap(std::ptr::null_mut(), SHARED, protection, flags, -1, 0) };
        if address == libc::MAP_FAILED {
            return Err((Exit::Unavailable, format!("shared memory: {}", std::io::Error::last_os_error())));
        }
        Ok(Self(address))
    }

    fn words(&self) -> &[AtomicU64] {
        // SAFETY: the mapping is page-aligned, zeroed, SHARED bytes long and lives as long as
        // `self`; all access is atomic.
        unsafe { std::slice::from_raw_parts(self.0.cast::<AtomicU64>(), SHARED / size_of::<u64>()) }
    }

    /// The word that says whose turn it is: odd numbers go there, even ones back.
    fn turn(&self) -> &AtomicU64 {
        &self.words()[0]
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        // SAFETY: the address and length of `map`; nothing borrows the memory any more.
        unsafe { libc::munmap(self.0, SHARED) };
    }
}

/// One number to the other processor and back, through a cache line alone.
pub(crate) fn ping_pong() -> Result<Durations, (Exit, String)> {
    bare(0, 0)
}

/// As many bytes as a state sample has there, and as many as a command sample has back.
pub(crate) fn ping_pong_of_samples() -> Result<Durations, (Exit, String)> {
    bare(size_of::<StateSample>() / size_of::<u64>(), size_of::<CommandSample>() / size_of::<u64>())
}

/// A round trip with this many words each way.
fn bare(there: usize, back: usize) -> Result<Durations, (Exit, String)> {
    let shared = Shared::map()?;
    let is_over = AtomicBool::new(false);
    let write = |count: usize, value: u64| {
        shared.words()[LINE..LINE + count].iter().for_each(|word| word.store(value, Ordering::Relaxed));
    };
    let read = |count: usize| {
        let sum =
            shared.words()[LINE..LINE + count].iter().fold(0, |sum: u64, word| sum ^ word.load(Ordering::Relaxed));
        std::hint::black_box(sum);
    };
    let trips = std::thread::scope(|scope| {
        scope.spawn(|| {
            on_processor(DAEMON_CPU, || {
                while !is_over.load(Ordering::Relaxed) {
                    let turn = shared.turn().load(Ordering::Acquire);
                    if turn % 2 == 1 {
                        read(there);
                        write(back, turn);
                        shared.turn().store(turn + 1, Ordering::Release);
                    }
                    std::hint::spin_loop();
                }
            });
        });
        on_processor(PLANT_CPU, || {
            let mut trips = Durations::new();
            let give_up = Instant::now() + PATIENCE;
            for trip in 0..TRIPS {
                let begun = monotonic_ns();
                write(there, trip);
                shared.turn().store(2 * trip + 1, Ordering::Release);
                while shared.turn().load(Ordering::Acquire) != 2 * trip + 2 {
                    std::hint::spin_loop();
                }
                read(back);
                let duration = monotonic_ns() - begun;
                if trip >= BEGINNING {
                    trips.add(duration, false);
                }
                if Instant::now() > give_up {
                    break;
                }
            }
            is_over.store(true, Ordering::Relaxed);
            trips
        })
    });
    Ok(trips)
}

/// A state sample to the other processor, and a command sample back.
pub(crate) fn iceoryx2() -> Result<Durations, (Exit, String)> {
    let scenario: Scenario =
        admittance_host::config::parse(SCENARIO, "paper.toml").map_err(|error| (Exit::Internal, error.to_string()))?;
    let session = Session::new(&scenario)?;
    let settings = session.settings();
    let is_over = AtomicBool::new(false);
    let unavailable = |error: &dyn std::fmt::Display| (Exit::Unavailable, error.to_string());
    let create = Access::OpenOrCreate;
    // Ports stay on the thread that makes them.
    let answer = || -> Result<(), (Exit, String)> {
        let node = settings.node("bench answer").map_err(|e| unavailable(&e))?;
        let state = services::state(&node, &settings.instance, create).map_err(|e| unavailable(&e))?;
        let command = services::command(&node, &settings.instance, create).map_err(|e| unavailable(&e))?;
        let states = state.subscriber().map_err(|e| unavailable(&e))?;
        let commands = command.publisher().map_err(|e| unavailable(&e))?;
        let mut answer = CommandSample::zeroed();
        let mut slot = commands.loan_uninit().ok();
        while !is_over.load(Ordering::Relaxed) {
            if let Ok(Some(sample)) = states.receive() {
                answer.state_sequence = sample.sequence;
                if let Some(slot) = slot.take() {
                    let _ = slot.write_payload(answer).send();
                }
                // In the time that the other side takes, as the daemon does.
                slot = commands.loan_uninit().ok();
            }
            std::hint::spin_loop();
        }
        Ok(())
    };
    let ask = || -> Result<Durations, (Exit, String)> {
        let node = settings.node("bench").map_err(|e| unavailable(&e))?;
        let state = services::state(&node, &settings.instance, create).map_err(|e| unavailable(&e))?;
        let command = services::command(&node, &settings.instance, create).map_err(|e| unavailable(&e))?;
        let states = state.publisher().map_err(|e| unavailable(&e))?;
        let commands = command.subscriber().map_err(|e| unavailable(&e))?;
        let mut trips = Durations::new();
        let give_up = Instant::now() + PATIENCE;
        let mut sample = StateSample::zeroed();
        let mut beginning = BEGINNING;
        while trips.count() < TRIPS && Instant::now() < give_up {
            sample.sequence += 1;
            let Ok(slot) = states.loan_uninit() else { continue };
            let begun = monotonic_ns();
            // Until the other side has its ports nobody receives: then the next one is sent.
            let _ = slot.write_payload(sample).send();
            let lost = begun + 100_000_000;
            loop {
                if let Ok(Some(answer)) = commands.receive()
                    && answer.state_sequence == sample.sequence
                {
                    let duration = monotonic_ns() - begun;
                    if beginning == 0 {
                        trips.add(duration, false);
                    }
                    beginning = beginning.saturating_sub(1);
                    break;
                }
                if monotonic_ns() > lost {
                    break;
                }
                std::hint::spin_loop();
            }
        }
        Ok(trips)
    };
    std::thread::scope(|scope| {
        let answering = scope.spawn(|| on_processor(DAEMON_CPU, answer));
        let trips = on_processor(PLANT_CPU, ask);
        is_over.store(true, Ordering::Relaxed);
        match answering.join() {
            Ok(answered) => answered.and(trips),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_trip_comes_back() {
        for trips in [ping_pong(), ping_pong_of_samples()] {
            assert!(trips.expect("memory").count() > 0);
        }
    }
}
