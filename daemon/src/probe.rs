//! A view into the real-time thread from inside its process, for tests that count what happens
//! between received and sent. In the shipped program it compiles to nothing.

use std::thread::JoinHandle;

use admittance_core::supervisor::Ending;
use admittance_host::exit::ExitCode;
use admittance_runner::config::Config;
use admittance_runner::cycle::Cycle;
use ipc_types::{CommandSample, IpcSettings};

use crate::channel::{Order, ServiceEnd, channel};
use crate::realtime_thread::{LoopTiming, RealtimeThread};

/// Callbacks in every cycle, on the real-time thread.
pub trait Probe: Send + 'static {
    /// The thread is about to look for a sample.
    fn looking(&mut self);
    /// The command has been sent; the notification has not. The law first asked for the time at
    /// `asked`, ns of CLOCK_MONOTONIC; 0 when it did not.
    fn sent(&mut self, command: &CommandSample, asked: u64);
}

/// Nobody to tell.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Unobserved;

impl Probe for Unobserved {
    #[inline(always)]
    fn looking(&mut self) {}

    #[inline(always)]
    fn sent(&mut self, _: &CommandSample, _: u64) {}
}

/// The daemon's real-time thread in this process, without a service thread.
pub struct ObservedThread {
    handle: JoinHandle<ExitCode>,
    service: ServiceEnd,
}

impl std::fmt::Debug for ObservedThread {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ObservedThread").field("is_finished", &self.is_finished()).finish()
    }
}

impl ObservedThread {
    /// Starts it as the daemon does, with real ports and the cycle of this configuration.
    ///
    /// # Errors
    /// A sentence that says why it cannot begin.
    pub fn start(
        config: &Config,
        cycle: Box<dyn Cycle>,
        settings: &IpcSettings,
        probe: impl Probe,
    ) -> Result<Self, String> {
        let (realtime_end, service) = channel();
        let thread = RealtimeThread {
            settings: settings.clone(),
            realtime: config.realtime.clone(),
            timing: LoopTiming::of(config),
            cycle,
            channel: realtime_end,
            boot_id: 1,
        };
        let (started, start) = std::sync::mpsc::channel();
        let (go, may_go) = std::sync::mpsc::channel();
        let handle = std::thread::spawn(move || thread.run(&started, &may_go, probe));
        match start.recv() {
            Ok(Ok(_)) => {
                // A thread that has ended is seen at its join.
                let _ = go.send(());
                Ok(Self { handle, service })
            }
            Ok(Err((_, why))) => Err(why),
            Err(_) => Err("the real-time thread ended at once".to_owned()),
        }
    }

    /// Asks it to end control, and then itself, as SIGTERM does.
    pub fn stop(&mut self) {
        // A full ring holds a stop already.
        let _ = self.service.give(Order::Stop(Ending::Shutdown), u64::MAX);
    }

    /// Whether it has ended.
    pub fn is_finished(&self) -> bool {
        self.handle.is_finished()
    }

    /// Waits for its end; `Internal` after a panic.
    pub fn join(self) -> ExitCode {
        self.handle.join().unwrap_or(ExitCode::Internal)
    }
}
