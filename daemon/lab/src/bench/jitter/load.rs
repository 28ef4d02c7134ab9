//! Work that competes for processors, caches and disk, at normal priority.

use std::io::{Seek, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use admittancectl::Exit;

/// What is written before it is forced to the disk, in bytes.
const WRITTEN: usize = 4 << 20;

/// Runs until it is dropped.
#[derive(Debug)]
pub(crate) struct Load {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Load {
    /// One thread for each processor that computes, and one that writes.
    pub(crate) fn start() -> Result<Self, (Exit, String)> {
        let file = tempfile::tempfile().map_err(|error| (Exit::Unavailable, format!("a file to write to: {error}")))?;
        let stop = Arc::new(AtomicBool::new(false));
        let mut threads = Vec::new();
        for _ in 0..admittancectl::parallel::processors() {
            let stop = Arc::clone(&stop);
            threads.push(std::thread::spawn(move || compute(&stop)));
        }
        let stopped = Arc::clone(&stop);
        threads.push(std::thread::spawn(move || write(file, &stopped)));
        Ok(Self { stop, threads })
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // It does nothing that could fail.
            let _ = thread.join();
        }
    }
}

/// More memory than the caches hold, again and again.
fn compute(stop: &AtomicBool) {
    let mut memory = vec![1_u64; 1 << 20];
    while !stop.load(Ordering::Relaxed) {
        for index in 1..memory.len() {
            memory[index] = memory[index].wrapping_mul(6_364_136_223_846_793_005).wrapping_add(memory[index - 1]);
        }
        std::hint::black_box(&memory);
    }
}

fn write(mut file: std::fs::File, stop: &AtomicBool) {
    let data = vec![7; WRITTEN];
    while !stop.load(Ordering::Relaxed) {
        // A full disk is load as well.
        let _ = file.rewind().and_then(|()| file.write_all(&data)).and_then(|()| file.sync_data());
    }
}
