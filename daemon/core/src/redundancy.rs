//! What the joints of a redundant arm do beside the task (remark 1): a motion in the null space of J,
//! chosen once a cycle. It is a known input of the model, and its image is part of what the joints are
//! told.
//!
//! ```
//! use admittance_core::robot::{Interval, NullSpace, Resolution, TaskAxes};
//! use nalgebra::{Matrix2x3, Vector3};
//!
//! // Two directions of three joints; joint 0 is turned away from its upper limit, the tool stays.
//! let jacobian = Matrix2x3::new(1.0, 0.5, 0.2, 0.0, 1.0, -0.8);
//! let null_space = NullSpace::of(&jacobian, TaskAxes::ALL, &Resolution::LEAST_NORM).expect("regular");
//! let mut bounds = Interval { lower: Vector3::repeat(-1.0), upper: Vector3::repeat(1.0) };
//! bounds.upper.x = 0.1;
//! let told = Vector3::new(0.15, 0.0, 0.0);
//! let beside = null_space.brought_within(&told, &bounds);
//! assert!((told + beside).x <= 0.1 + 1e-12);
//! assert!((jacobian * beside).norm() < 1e-12);
//! ```

use admittance_vocabulary::Motion;
use nalgebra::SVector;

use crate::intake::{Accepted, Timing};
use crate::output::{Beside, MAX_DELAY_CYCLES, Movement};
use crate::quantities::{Instant, Span};
use crate::robot::{DriveLimits, Interval, MotionLimits, NullSpace, Reference};

/// What the null-space motion is to bring about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aim<const N: usize> {
    /// Nothing: the joints do what the twist asks of them.
    Nothing,
    /// The joints go to a position as far as the task lets them.
    Posture {
        /// rad or m.
        position: SVector<f64, N>,
        /// Part of the way per second.
        gain: f64,
    },
    /// That of the commanded joint velocity.
    Commanded,
}

/// The resolution of redundancy, beside that of J⁻¹ itself, which the chain
/// [has](crate::robot::Chain::with_resolution).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Redundancy<const N: usize> {
    /// What for.
    pub aim: Aim<N>,
    /// How far from its limits a joint is kept, rad or m; `None` leaves the limits to the MPC.
    pub limit_margin: Option<SVector<f64, N>>,
    /// Largest part of each joint's speed limit that the law's own null-space motion takes, but for what keeps
    /// joints from their limits, which may take all of it; what is commanded is not counted.
    pub speed_share: f64,
    /// By how much that motion changes at most, rad/s² or m/s².
    pub acceleration: f64,
}

/// How fast a joint may come nearer to the margin of its limits, per rad or m that is left; within the
/// margin it goes back as fast.
const APPROACH: f64 = 2.0;
/// Part of the drives' acceleration and jerk that this motion takes at most, and as much again has to be left over by the
/// way that the twist is on: the task comes first. What this motion takes is taken from the twist, so the two together
/// keep the limits, whatever each of them does.
const OF_DRIVES: f64 = 0.2;
/// The same where it stays for the ticks of a cycle and changes in the first of them alone: it has nothing to fade, and so little
/// time for what it wants.
const OF_ONE_TICK: f64 = 0.6;
/// Rounding of a joint's velocity, rad/s or m/s.
const ROUNDING: f64 = 1e-12;
/// Instants kept: more than commands can be under way, with a cycle behind the sample.
const KEPT: usize = 2 * MAX_DELAY_CYCLES as usize;

/// Settings of this stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settings<const N: usize> {
    /// The resolution; `None` is that of the motion controller, of least norm.
    pub redundancy: Option<Redundancy<N>>,
    /// Limits of the joints' positions, rad or m.
    pub joint_position: Option<Interval<N>>,
    /// Limits of their speeds, rad/s or m/s.
    pub joint_speed: Option<SVector<f64, N>>,
    /// When commands act.
    pub timing: Timing,
    /// What the drives allow.
    pub drives: Option<DriveLimits<N>>,
    /// Time from one streamed reference to the next.
    pub tick: Span,
}

impl<const N: usize> Settings<N> {
    pub(crate) fn new<const D: usize>(
        redundancy: Option<Redundancy<N>>,
        limits: &MotionLimits<N, D>,
        timing: Timing,
        tick: Span,
    ) -> Self {
        let drives = limits.drives.map(|drives| drives.limits);
        let MotionLimits { joint_position, joint_speed, .. } = *limits;
        Self { redundancy, joint_position, joint_speed, timing, drives, tick }
    }
}

/// What the law wants of the null space in a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wish {
    /// What the resolution aims at.
    Aim,
    /// Standstill, as soon as its acceleration allows.
    Rest,
}

/// The stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NullMotion<const N: usize> {
    settings: Settings<N>,
    /// What the joints are told beside the task, rad/s or m/s.
    told: SVector<f64, N>,
    /// Of that, what the law itself brings about.
    own: SVector<f64, N>,
    /// By how much what is told has just changed, rad/s² or m/s², where the drives limit it.
    acceleration: SVector<f64, N>,
    /// The jerk that this took, or takes to fade, rad/s³ or m/s³.
    jerk: SVector<f64, N>,
    wish: Wish,
    /// What was told, by the instants from which it acts; the last `len` count.
    history: [(Instant, SVector<f64, N>); KEPT],
    len: usize,
}

impl<const N: usize> NullMotion<N> {
    /// At rest.
    pub(crate) fn new(settings: Settings<N>) -> Self {
        let nothing = SVector::zeros();
        let history = [(Instant::default(), nothing); KEPT];
        Self {
            settings,
            told: nothing,
            own: nothing,
            acceleration: nothing,
            jerk: nothing,
            wish: Wish::Rest,
            history,
            len: 0,
        }
    }

    /// Takes over the state of `old`, with these settings.
    pub(crate) fn take_over(&mut self, old: &Self) {
        let Self { settings: _, told, own, acceleration, jerk, wish, history, len } = *old;
        (self.told, self.own, self.acceleration, self.jerk) = (told, own, acceleration, jerk);
        (self.wish, self.history, self.len) = (wish, history, len);
    }

    /// Whether the law resolves twists itself.
    fn is_ours(&self) -> bool {
        self.settings.redundancy.is_some()
    }

    /// What the joints are told beside the task from this cycle on, rad/s or m/s; `None` where nothing
    /// ever is.
    pub(crate) fn told(&self) -> Option<&SVector<f64, N>> {
        self.is_ours().then_some(&self.told)
    }

    /// The same `since` s from now, as it will be.
    pub(crate) fn ahead(&self, since: f64) -> Option<SVector<f64, N>> {
        match self.wish {
            Wish::Rest => self.fading(since),
            Wish::Aim => self.told().copied(),
        }
    }

    /// The same `since` s from now, if it is to come to rest.
    pub(crate) fn fading(&self, since: f64) -> Option<SVector<f64, N>> {
        let redundancy = self.settings.redundancy.as_ref()?;
        let speed = self.told.amax();
        if speed == 0.0 {
            return Some(self.told);
        }
        let gone = since * redundancy.acceleration / speed;
        let gone = self.settings.drives.as_ref().map_or(gone, |drives| {
            let of_joint = |joint: usize| {
                let most = self.most_of_drives() * self.steepest(drives.acceleration[joint], drives.jerk[joint]);
                since * most / self.told[joint].abs().max(f64::MIN_POSITIVE)
            };
            (0..N).map(of_joint).fold(gone, f64::min)
        });
        Some(self.told * (1.0 - gone).max(0.0))
    }

    /// By how much a joint changes at most with this acceleration and jerk, rad/s² or m/s²: where it stays within a cycle, in
    /// one of its ticks alone.
    fn steepest(&self, acceleration: f64, jerk: f64) -> f64 {
        if !self.stays() {
            return acceleration;
        }
        let tick = self.settings.tick.seconds();
        acceleration.min(jerk * tick) * tick / self.settings.timing.sampling_time.seconds()
    }

    /// The part of the drives that it takes at most.
    fn most_of_drives(&self) -> f64 {
        if self.stays() { OF_ONE_TICK } else { OF_DRIVES }
    }

    /// Whether several references are streamed in a cycle, in which what is told stays.
    fn stays(&self) -> bool {
        self.settings.tick < self.settings.timing.sampling_time
    }

    /// What the drives have to know of it.
    pub(crate) fn of_drives(&self) -> Beside<N> {
        let told = self.told().copied().unwrap_or_else(SVector::zeros);
        let Some(drives) = self.settings.drives.as_ref().filter(|_| self.is_ours()) else {
            return Beside { told, ..Beside::NOTHING };
        };
        // (J that turns may ask for more: the twist keeps its part all the same.)
        let most = |limits: &[f64; N]| SVector::from(limits.map(|limit| (OF_DRIVES + self.most_of_drives()) * limit));
        Beside {
            told,
            acceleration: self.acceleration.abs().inf(&most(&drives.acceleration)),
            jerk: self.jerk.inf(&most(&drives.jerk)),
            may_be_held: self.reference(self.told) == Reference::steady([0.0; N]),
        }
    }

    /// What is told, as the drives see it: within a cycle it stays.
    fn reference(&self, told: SVector<f64, N>) -> Reference<N> {
        let acceleration = if self.stays() { SVector::zeros() } else { self.acceleration };
        Reference { velocity: told.into(), acceleration: acceleration.into() }
    }

    /// Chooses it for a sample, of an arm that goes on with a twist (m/s, rad/s) whose way leaves this part of the
    /// drives.
    pub(crate) fn choose<const D: usize>(
        &mut self,
        sample: &Accepted<N, D>,
        (twist, left): (&SVector<f64, D>, Option<f64>),
        wish: Wish,
    ) {
        let Some(redundancy) = &self.settings.redundancy else { return };
        let (Some(null_space), Ok(inverse)) = (sample.posture.null_space(), sample.posture.inverse(0.0)) else {
            return self.stop();
        };
        let commanded = match (redundancy.aim, sample.joint_velocity_reference, wish) {
            (Aim::Commanded, Some(reference), Wish::Aim) => null_space.project(&reference),
            _ => SVector::zeros(),
        };
        // Whatever changes, the joints go on from what they were told.
        let before =
            if wish == self.wish { null_space.project(&self.own) } else { null_space.project(&self.told) - commanded };
        let wanted = match wish {
            Wish::Aim => self.wanted(redundancy, sample, &null_space, &(inverse.joint_velocity(twist) + commanded)),
            Wish::Rest => SVector::zeros(),
        };
        let change = wanted - before;
        let most = redundancy.acceleration * self.settings.timing.sampling_time.seconds();
        self.own = if change.amax() <= most { wanted } else { before + change * (most / change.amax()) };
        let wanted = commanded + self.own;
        self.told = match self.settings.drives {
            None => wanted,
            Some(drives) => {
                let told = self.within_drives(&drives, &null_space, &wanted, left.unwrap_or(1.0));
                self.own = told - commanded;
                told
            }
        };
        self.wish = wish;
    }

    /// As much of what is `wanted` as the drives allow beside a twist that leaves this part of them; where that is too little,
    /// what is told comes to a steady motion.
    fn within_drives(
        &mut self,
        drives: &DriveLimits<N>,
        null_space: &NullSpace<N>,
        wanted: &SVector<f64, N>,
        left: f64,
    ) -> SVector<f64, N> {
        let part = (left - OF_DRIVES).clamp(0.0, self.most_of_drives());
        let of = |limit: f64| if part > 0.0 { limit * part } else { 0.0 };
        let limits = DriveLimits {
            acceleration: drives.acceleration.map(of),
            // What it takes to fade has been left to it.
            jerk: core::array::from_fn(|joint| of(drives.jerk[joint]).max(self.jerk[joint])),
            ..*drives
        };
        let tick = self.settings.tick.seconds();
        // (J turns: what was told is a little beside the null space of now.)
        let before = self.reference(null_space.project(&self.told));
        let next = limits.follow(&before, tick, &(*wanted).into());
        let told = null_space.project(&next.velocity.into());
        let acceleration = (told - self.told) / tick;
        self.jerk = SVector::from_fn(|joint, _| {
            let took = (acceleration[joint] - before.acceleration[joint]).abs() / tick;
            let fades = acceleration[joint].abs() / tick;
            took.max(if self.stays() { fades } else { fades.min(OF_DRIVES * drives.jerk[joint]) })
        });
        self.acceleration = acceleration;
        told
    }

    /// What the law adds to joints that turn with `going`.
    fn wanted<const D: usize>(
        &self,
        redundancy: &Redundancy<N>,
        sample: &Accepted<N, D>,
        null_space: &NullSpace<N>,
        going: &SVector<f64, N>,
    ) -> SVector<f64, N> {
        let position = &sample.joint_position;
        // Of the joints' speed this motion takes at most a part.
        let within = |wanted: SVector<f64, N>, part: f64| {
            let share = |most: &SVector<f64, N>| wanted.zip_map(most, |speed, most| speed.abs() / (most * part)).max();
            wanted / self.settings.joint_speed.as_ref().map_or(1.0, share).max(1.0)
        };
        let aimed = match redundancy.aim {
            Aim::Posture { position: posture, gain } => {
                within(null_space.project(&((posture - position) * gain)), redundancy.speed_share)
            }
            Aim::Nothing | Aim::Commanded => SVector::zeros(),
        };
        let Some(bounds) = self.bounds(redundancy, position) else { return aimed };
        // A joint that the twist drives fast towards its limit needs another that is as fast.
        within(aimed + null_space.brought_within(&(going + aimed), &bounds), 1.0)
    }

    /// The joint velocities that keep the joints from their limits, and none faster than it may be; `None`
    /// where these are left to others.
    fn bounds(&self, redundancy: &Redundancy<N>, position: &SVector<f64, N>) -> Option<Interval<N>> {
        let (margin, limits) = (redundancy.limit_margin.as_ref()?, self.settings.joint_position.as_ref()?);
        let most = self.settings.joint_speed.unwrap_or_else(|| SVector::repeat(f64::INFINITY));
        let bound =
            |limit: SVector<f64, N>| ((limit - position) * APPROACH).zip_map(&most, |v, most| v.clamp(-most, most));
        Some(Interval { lower: bound(limits.lower + margin), upper: bound(limits.upper - margin) })
    }

    /// Nothing beside the task any more, at once: the arm is held.
    pub(crate) fn stop(&mut self) {
        (self.told, self.own, self.wish) = (SVector::zeros(), SVector::zeros(), Wish::Rest);
        (self.acceleration, self.jerk) = (SVector::zeros(), SVector::zeros());
    }

    /// The motion controller moves the arm by itself: what it does beside the task is where the law begins. Returns
    /// whether that is what is told: drives that refuse jumps, of which the twist leaves this part (`None`: nothing is known of
    /// what they were told), are led there first.
    #[must_use]
    pub(crate) fn stand_by<const D: usize>(&mut self, sample: &Accepted<N, D>, left: Option<f64>) -> bool {
        let (Some(reference), Some(null_space)) = (sample.joint_velocity_reference, sample.posture.null_space()) else {
            self.stop();
            return true;
        };
        let commanded = null_space.project(&reference);
        match (self.settings.drives.filter(|_| self.is_ours()), left) {
            (Some(drives), Some(left)) => {
                self.told = self.within_drives(&drives, &null_space, &commanded, left);
                self.wish = Wish::Rest;
            }
            (None, _) | (_, None) => {
                self.stop();
                self.told = commanded;
            }
        }
        self.own = self.told;
        (self.told - commanded).amax() <= ROUNDING
    }

    /// A sample with the twist that the commanded joint velocity makes of the arm, for one that the motion controller moves by
    /// itself on drives that refuse jumps: it resolves ṗ0 where its own reference is, which the arm may have left.
    pub(crate) fn as_commanded<const D: usize>(&self, sample: &Accepted<N, D>) -> Accepted<N, D> {
        let reference = sample.joint_velocity_reference.filter(|_| self.is_ours() && self.settings.drives.is_some());
        let twist = reference.map(|reference| sample.posture.jacobian() * reference);
        Accepted { twist_reference: twist.unwrap_or(sample.twist_reference), ..*sample }
    }

    /// Records the answer to a sample or silence at `stamp`: it acts one delay later.
    pub(crate) fn send(&mut self, stamp: Instant) {
        if !self.is_ours() {
            return;
        }
        let from = stamp + self.settings.timing.command_delay;
        while self.len > 0 && self.history[self.len - 1].0 >= from {
            self.len -= 1;
        }
        if self.len == KEPT {
            self.history.copy_within(1.., 0);
            self.len -= 1;
        }
        self.history[self.len] = (from, self.told);
        self.len += 1;
    }

    /// What the last command told them; `None` where nothing ever is.
    pub(crate) fn latest(&self) -> Option<&SVector<f64, N>> {
        self.history[..self.len].last().map(|(_, told)| told)
    }

    /// What the joints followed beside the task at an instant, where a command reaches each after its
    /// dead time. `moves` says which joints were not held.
    pub(crate) fn followed(
        &self,
        instant: Instant,
        dead_time: [Span; N],
        moves: impl Fn(usize) -> bool,
    ) -> Option<SVector<f64, N>> {
        self.is_ours().then(|| {
            SVector::from_fn(|joint, _| {
                let reached = |(from, _): &&(Instant, SVector<f64, N>)| *from + dead_time[joint] <= instant;
                let told = self.history[..self.len].iter().rfind(reached);
                told.filter(|_| moves(joint)).map_or(0.0, |(_, told)| told[joint])
            })
        })
    }

    /// The movement with its whole image in the joints, for a motion controller that follows that: what
    /// they add to their commanded velocity.
    pub(crate) fn shown<const D: usize>(&self, movement: Movement<N, D>, sample: &Accepted<N, D>) -> Movement<N, D> {
        let (Some(commanded), Ok(inverse)) = (sample.joint_velocity_reference, sample.posture.inverse(0.0)) else {
            return movement;
        };
        if movement.motion == Motion::Hold {
            return movement;
        }
        let twist = sample.twist_reference + movement.velocity_offset;
        let beside = self.told().copied().unwrap_or_else(SVector::zeros);
        Movement {
            joint_velocity_offset: inverse.joint_velocity(&twist) + beside - commanded,
            joint_per_twist: Some(inverse.matrix),
            ..movement
        }
    }
}
