//! The soak's faults in plant and daemon, and their times: drawn from the seed alone.

use plant_sim::faults::FaultKind;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::outside::Outside;

/// From the start of the motion to first contact, s.
pub(crate) const CONTACT_S: f64 = 0.2;
/// How long the commanded motion presses, s from its start.
pub(crate) const PRESSES_S: f64 = 0.6;
/// How long the arm then moves away, s.
pub(crate) const RETREATS_S: f64 = 0.4;
/// How long it stands still afterwards, s: time for a reset.
pub(crate) const STANDS_S: f64 = 0.4;
/// The same at most, on a machine that is too busy to ask for one in time.
pub(crate) const STANDS_AT_MOST_S: f64 = 5.0;

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    /// A fault that the plant plays from its scenario.
    Scripted(FaultKind),
    /// SIGSTOP of the daemon, then SIGCONT.
    DaemonStopped,
    /// SIGKILL of the daemon; it is started again.
    DaemonKilled,
    /// SIGKILL of the daemon, and of the next one while it starts.
    DaemonKilledAtStart,
    /// SIGTERM of the daemon; it is started again.
    DaemonTerminated,
    /// SIGSTOP of the plant, then SIGCONT.
    PlantStopped,
    /// SIGKILL of the plant.
    PlantKilled,
    /// SIGTERM of the plant.
    PlantTerminated,
    /// SIGKILL of `admittancectl record`; the next one begins another file.
    RecorderKilled,
    /// A second daemon of the same instance.
    SecondDaemon,
    /// The configuration file is garbage, and SIGHUP.
    GarbageReloaded,
    /// An attack that kills nothing.
    Outside(Outside),
}

impl Fault {
    /// Every kind.
    pub(crate) fn all() -> Vec<Self> {
        let scripted = FaultKind::ALL.iter().map(|kind| Self::Scripted(*kind));
        let processes = [
            Self::DaemonStopped,
            Self::DaemonKilled,
            Self::DaemonKilledAtStart,
            Self::DaemonTerminated,
            Self::PlantStopped,
            Self::PlantKilled,
            Self::PlantTerminated,
            Self::RecorderKilled,
            Self::SecondDaemon,
            Self::GarbageReloaded,
        ];
        scripted.chain(processes).chain(Outside::ALL.map(Self::Outside)).collect()
    }

    /// Its name in tables and JSON.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Scripted(kind) => kind.name(),
            Self::DaemonStopped => "daemon_stopped",
            Self::DaemonKilled => "daemon_killed",
            Self::DaemonKilledAtStart => "daemon_killed_at_start",
            Self::DaemonTerminated => "daemon_terminated",
            Self::PlantStopped => "plant_stopped",
            Self::PlantKilled => "plant_killed",
            Self::PlantTerminated => "plant_terminated",
            Self::RecorderKilled => "recorder_killed",
            Self::SecondDaemon => "second_daemon",
            Self::GarbageReloaded => "garbage_reloaded",
            Self::Outside(kind) => kind.name(),
        }
    }

    /// Whether the daemon ends by it.
    pub(crate) fn ends_daemon(self) -> bool {
        matches!(self, Self::DaemonKilled | Self::DaemonKilledAtStart | Self::DaemonTerminated)
    }
}

/// One touch of the surface, and the fault in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Touch {
    /// Commanded speed along −y, m/s.
    pub(crate) speed_m_s: f64,
    /// Stiffness of the surface along its normal, N/m; known to the daemon.
    pub(crate) stiffness_n_m: f64,
    /// Instant of contact within a sample, as a share of it.
    pub(crate) contact_phase: f64,
    /// What goes wrong.
    pub(crate) fault: Fault,
    /// Whether that is meant to happen in contact.
    pub(crate) in_contact: bool,
    /// When, s from the start of the motion.
    pub(crate) at_s: f64,
    /// For how long, s.
    pub(crate) duration_s: f64,
}

/// Draws touches: all kinds of fault in a random order, one after the other in free motion and in
/// contact, then in another order.
#[derive(Debug)]
pub(crate) struct Draw {
    rng: ChaCha8Rng,
    kinds: Vec<Fault>,
    waiting: Vec<(Fault, bool)>,
}

impl Draw {
    /// The same seed draws the same touches of these kinds.
    pub(crate) fn new(seed: u64, kinds: Vec<Fault>) -> Self {
        Self { rng: ChaCha8Rng::seed_from_u64(seed), kinds, waiting: Vec::new() }
    }

    /// The next one.
    pub(crate) fn touch(&mut self) -> Touch {
        if self.waiting.is_empty() {
            self.waiting = self.kinds.iter().flat_map(|fault| [(*fault, false), (*fault, true)]).collect();
            self.waiting.shuffle(&mut self.rng);
        }
        let (fault, in_contact) = self.waiting.pop().unwrap_or((Fault::DaemonStopped, true));
        // Until the fault the contact has had time to become one, and after it the motion presses
        // on for a while.
        let when = if in_contact { CONTACT_S + 0.06..PRESSES_S - 0.15 } else { 0.0..CONTACT_S - 0.08 };
        Touch {
            speed_m_s: self.rng.random_range(0.05..0.3),
            // As many of each order of magnitude.
            stiffness_n_m: 10f64.powf(self.rng.random_range(4.3..5.3)),
            contact_phase: self.rng.random_range(0.0..1.0),
            fault,
            in_contact,
            at_s: self.rng.random_range(when),
            duration_s: self.rng.random_range(0.004..0.06),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_comes_in_free_motion_and_in_contact_before_any_comes_again() {
        let kinds = Fault::all();
        assert!(kinds.len() >= 40, "{}", kinds.len());
        let mut draw = Draw::new(3, Fault::all());
        let touches: Vec<Touch> = (0..2 * kinds.len()).map(|_| draw.touch()).collect();
        for kind in kinds {
            let of_kind: Vec<&Touch> = touches.iter().filter(|touch| touch.fault == kind).collect();
            assert_eq!(of_kind.len(), 2, "{kind:?}");
            assert_ne!(of_kind[0].in_contact, of_kind[1].in_contact, "{kind:?}");
        }
        assert!(touches.iter().all(|touch| touch.in_contact == (touch.at_s > CONTACT_S)));
        let again: Vec<Touch> = {
            let mut draw = Draw::new(3, Fault::all());
            (0..touches.len()).map(|_| draw.touch()).collect()
        };
        assert_eq!(touches, again);
    }
}
