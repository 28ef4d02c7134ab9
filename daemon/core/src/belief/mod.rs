//! The belief about the surface: which axes touch it, where it is, and which force f̂ should
//! therefore show; and about the motion of joints that no sample shows as it is. The only part of
//! the core that learns.
//!
//! ```
//! use admittance_core::Controller;
//! # use admittance_core::mpc::ActiveSet;
//! # mod planar { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/doc/planar_arm.rs")); }
//! # let parameters = planar::planar_arm();
//! # let capacity = parameters.solver_capacity();
//! # let solver = ActiveSet::new(capacity, 100, vec![0.0; capacity.storage_len()]).unwrap();
//! # let storage = vec![0.0; parameters.storage_len()];
//!
//! // What is told is believed, until contacts say otherwise.
//! let told = parameters.surface.contact.position;
//! let controller = Controller::new(parameters, solver, storage)?;
//! let belief = controller.belief();
//! assert_eq!((belief.contact_point, belief.uncertainty), (told, 0.0));
//! // A replay that begins after earlier contacts begins with what was believed then.
//! let again = controller.believing(&belief);
//! assert_eq!(again.belief(), belief);
//! # Ok::<(), admittance_core::ParameterError>(())
//! ```

mod contact;
mod detection;
mod expectation;
mod impact_motion;
mod inward_way;
mod joint_motion;
mod lag_inverse;
mod learning;
mod settings;
mod spring_history;
mod surface_set;
#[cfg(test)]
mod tests;
mod way;

use nalgebra::{SVector, Vector3};

pub use contact::Thresholds;
pub(crate) use contact::{Contact, Felt, SurfaceSigns};
pub use expectation::Expected;
pub use impact_motion::{ImpactLink, ImpactModel, SurfaceStiffness, Swing};
pub(crate) use impact_motion::{Peak, Swings};
pub(crate) use inward_way::WayObserver;
pub use joint_motion::JointMotion;
pub(crate) use joint_motion::JointObserver;
pub use lag_inverse::{NOISE_DEVIATIONS, NoiseWindow, WithoutLag};
pub(crate) use settings::Settings;
pub use surface_set::Prior;
pub(crate) use surface_set::SurfaceSet;
pub(crate) use way::Way;

use crate::intake::Accepted;
use crate::quantities::{Instant, Span, linear_axes};
use crate::surface::Surface;
use crate::turn::Turn;
use detection::Detection;
use impact_motion::{LinkObserver, Shown};
use lag_inverse::LagInverse;
use spring_history::SpringHistory;

/// Where the contact point comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContactPoint {
    /// [`Surface::contact`].
    Configured,
    /// From the first samples in contact.
    Detected {
        /// Standard deviation of f̂ on one axis, in N; it determines how much the verdict's
        /// margin is reduced.
        wrench_noise: f64,
    },
    /// Learned at touch, with the stiffness: the belief is a set.
    Learned(Prior),
}

/// Where the sign of a contact comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactSign {
    /// From f̂ when the axis joins; only axes in contact have bounds.
    Wrench,
    /// From the surface normal. In contact every axis with a normal component has an upper bound;
    /// one without cannot join.
    Normal,
}

/// The belief as a record keeps it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot {
    /// A point of the surface, base frame, m.
    pub contact_point: Vector3<f64>,
    /// Its outward normal, base frame; zero is the one that was told.
    pub normal: Vector3<f64>,
    /// By how much the force may be wrong because the contact point is uncertain: two standard
    /// deviations, N.
    pub uncertainty: f64,
    /// The force that f̂ should show.
    pub expected: Expected,
    /// Stiffness along the normal, N/m, and what it may be besides: one deviation.
    pub stiffness: f64,
    /// Its band.
    pub stiffness_band: (f64, f64),
}

/// The stage.
#[derive(Debug)]
pub(crate) struct Belief<const D: usize> {
    settings: Settings<D>,
    signs: SurfaceSigns<D>,
    surface: Surface<D>,
    contact: Contact<D>,
    detection: Detection,
    expected: Expected,
    springs: SpringHistory,
    lag_inverse: LagInverse<D>,
    /// What the surface may be, where only a range of it is told.
    set: Option<SurfaceSet>,
    /// The tool in an impact, where masses are told.
    link: LinkObserver,
}

impl<const D: usize> Belief<D> {
    /// The belief is what the settings say.
    pub(crate) fn new(settings: Settings<D>) -> Self {
        Self {
            signs: SurfaceSigns::of(&settings.surface.normal),
            surface: settings.surface,
            contact: Contact::none(),
            detection: Detection::new(),
            expected: Expected::nothing(),
            springs: SpringHistory::empty(),
            lag_inverse: LagInverse::new(
                settings.wrench_time_constant,
                &settings.likely_noise(),
                &settings.force_limit,
                settings.sampling_time,
            ),
            set: settings.set(),
            link: LinkObserver::new(),
            settings,
        }
    }

    /// Goes on from a recorded belief, out of contact: for a replay that begins after earlier
    /// contacts.
    #[must_use]
    pub(crate) fn with_snapshot(mut self, snapshot: &Snapshot) -> Self {
        self.surface.contact.position = snapshot.contact_point;
        self.detection = Detection::with_uncertainty(snapshot.uncertainty);
        self.expected = snapshot.expected;
        if self.set.is_some() {
            if snapshot.normal != Vector3::zeros() {
                linear_axes::<D>().for_each(|axis| self.surface.normal[axis] = snapshot.normal[axis]);
            }
            self.surface.become_spring(snapshot.stiffness, -self.surface.height(&snapshot.contact_point));
            self.surface.contact.position = snapshot.contact_point;
        }
        self.springs.push(snapshot.expected.stamp, snapshot.expected.spring);
        self
    }

    /// Takes over the state of `old`, with these settings: a configured contact point replaces the
    /// old one.
    pub(crate) fn take_over(&mut self, old: &Self) {
        let Self {
            settings: old_settings,
            signs: _,
            surface,
            contact,
            detection,
            expected,
            springs,
            lag_inverse,
            set,
            link,
        } = old;
        self.link = *link;
        if self.settings.contact_point != ContactPoint::Configured {
            self.surface.contact = surface.contact;
        }
        (self.contact, self.detection, self.expected) = (*contact, *detection, *expected);
        self.springs = *springs;
        self.lag_inverse.take_over(lag_inverse);
        if let (Some(set), Some(old)) = (&mut self.set, set)
            && self.settings.surface.normal == old_settings.surface.normal
            && set.take_over(old)
        {
            self.surface = *surface;
        }
    }

    /// Goes over to the frame that a turn leads to, and to its settings. Axes in contact stay so.
    pub(crate) fn turn(&mut self, settings: Settings<D>, turn: &Turn) {
        // As it is told, without the rounding of many turns.
        let is_told = self.surface == self.settings.surface;
        self.surface = if is_told { settings.surface } else { self.surface.turned(turn) };
        self.signs = SurfaceSigns::of(&settings.surface.normal);
        self.lag_inverse.turn(turn);
        self.settings = settings;
    }

    /// Which axes feel a force above β, and above what f̂ may be off by.
    pub(crate) fn felt<const N: usize>(&self, sample: &Accepted<N, D>) -> Felt<D> {
        self.settings.thresholds.beyond(&sample.unsure()).felt(&sample.wrench)
    }

    /// Takes the lag out of the wrench of a sample: of every one, since it looks back.
    pub(crate) fn sense<const N: usize>(&mut self, sample: &Accepted<N, D>) {
        self.lag_inverse.follow(sample);
    }

    /// The wrench without the lag of f̂.
    pub(crate) fn without_lag(&self) -> &WithoutLag<D> {
        self.lag_inverse.force()
    }

    /// The pressing force in N without the lag of f̂, less what may be noise.
    pub(crate) fn pressing_without_lag(&self) -> f64 {
        let force = self.without_lag();
        let felt = self.signs.axes(&self.settings.thresholds.admittance);
        let noise = felt.map(|axis| force.noise(axis, self.settings.wrench_noise[axis])).fold(0.0, f64::max);
        self.surface.pressing_force(&force.wrench) - noise
    }

    /// Learns from a sample; `joint_velocity` is q̇ at it as it is believed to be, in rad/s, `felt`
    /// the part of its wrench above β. If the model is `doubted`,
    /// because it led to the stop under way, the surface in contact is moved to where the measured
    /// force says it is.
    pub(crate) fn follow<const N: usize>(
        &mut self,
        sample: &Accepted<N, D>,
        joint_velocity: &SVector<f64, N>,
        way: Option<&Way>,
        felt: &Felt<D>,
        doubted: bool,
    ) {
        let Settings { thresholds, sign, contact_point, .. } = &self.settings;
        let contact_point = *contact_point;
        let by_surface = (*sign == ContactSign::Normal).then_some(&self.signs);
        let was_in_contact = self.contact.is_any();
        self.contact = self.contact.update(thresholds, felt, by_surface, &sample.wrench);
        let lag = self.lag();
        if let ContactPoint::Detected { wrench_noise } = contact_point {
            let in_contact = self.contact.is_any();
            self.detection.observe(&self.surface, sample, joint_velocity, way);
            self.detection.locate(&mut self.surface, in_contact, lag, wrench_noise);
            if in_contact && !was_in_contact {
                // What was expected of the last sample was of a surface that was not known yet.
                self.expected.spring = self.detection.spring_before(&self.surface).max(0.0);
            }
        }
        self.learn(sample, way);
        self.touch_what_was_noticed(sample, was_in_contact);
        let pressing = self.surface.pressing_force(&sample.wrench);
        let spring = self.surface.spring_force(sample.posture.pose());
        self.springs.push(sample.stamp, spring);
        let shown = self.springs.at(sample.stamp - self.settings.wrench_dead_time);
        if self.contact.is_any() || contact_point == ContactPoint::Configured {
            self.expected.follow(sample.stamp, shown.max(0.0), lag);
        } else {
            self.expected.begin(sample.stamp, shown.max(0.0), pressing);
        }
        if let Some(set) = &self.set {
            self.expected.pressing = set.expected().unwrap_or(pressing);
        }
        if doubted && self.contact.is_any() {
            self.trust_force(pressing, shown);
        }
    }

    /// Moves the surface to where the measured `pressing` force (N) says it is: a stop that a wrong
    /// model led to must not rely on that model, by which the spring presses with `spring` (N,
    /// negative above the surface) at the pose that f̂ shows.
    fn trust_force(&mut self, pressing: f64, spring: f64) {
        // At least what f̂ shows, with its lag and without; plus what it shows beyond the expected
        // force.
        let least = pressing.max(self.pressing_without_lag());
        let missing = if least > spring { least - spring } else { pressing - self.expected.pressing };
        self.surface.raise(missing / self.surface.normal_stiffness());
        self.springs.raise(missing);
        (self.expected.pressing, self.expected.spring) = (pressing, spring + missing);
    }

    /// f̂ in N and N·m as it will be when it shows the force until `now`, from the `wrench` that it
    /// shows now, by the surface as it is believed to be.
    pub(crate) fn wrench_ahead(&self, wrench: &SVector<f64, D>, now: Instant) -> SVector<f64, D> {
        let dead_time = self.settings.wrench_dead_time;
        if dead_time == Span::default() {
            return *wrench;
        }
        let along = &self.surface.normal;
        SVector::from_fn(|axis, _| {
            let lag = self.settings.wrench_time_constant[axis];
            // Of the estimate the part that will have faded is replaced by what the spring did.
            let left = if lag > 0.0 { libm::exp(-dead_time.seconds() / lag) } else { 0.0 };
            left * wrench[axis] - along[axis] * self.springs.ahead(0.0, now, dead_time, lag)
        })
    }

    /// Takes every axis out of contact: for an arm that is not under control. What is told is
    /// believed again, where a stop had moved it.
    pub(crate) fn release(&mut self) {
        self.contact = Contact::none();
        if self.settings.contact_point == ContactPoint::Configured {
            self.surface.contact = self.settings.surface.contact;
        }
        if let Some(set) = &mut self.set {
            set.forget();
            self.surface = self.settings.surface;
        }
    }

    /// T_est of the axes that feel the surface, in s.
    fn lag(&self) -> f64 {
        let felt = self.signs.axes(&self.settings.thresholds.admittance).next().unwrap_or(0);
        self.settings.wrench_time_constant[felt]
    }

    /// Follows the tool in an impact, by what is told of the arm; joint velocities as they are believed to be.
    pub(crate) fn follow_link<const N: usize>(
        &mut self,
        model: Option<&ImpactModel<N>>,
        sample: &Accepted<N, D>,
        joint_velocity: &SVector<f64, N>,
    ) {
        let shown = Shown { lag: self.lag(), dead_time: self.settings.wrench_dead_time.seconds() };
        match model {
            Some(model) if self.contact.is_any() => {
                self.link.follow(model, &self.surface, sample, joint_velocity, shown);
            }
            _ => self.link.forget(),
        }
    }

    /// The tool in an impact: `None` where none is known of.
    pub(crate) fn swings(&self) -> Option<Swings> {
        self.link.swings()
    }

    /// The axes in contact.
    pub(crate) fn contact(&self) -> &Contact<D> {
        &self.contact
    }

    /// The surface as it is believed to be.
    pub(crate) fn surface(&self) -> &Surface<D> {
        &self.surface
    }

    /// The signs of contact that the told normal gives: which axes feel the surface.
    pub(crate) fn surface_signs(&self) -> &SurfaceSigns<D> {
        &self.signs
    }

    /// s of every axis whose force is bounded in contact; 0 of the others.
    pub(crate) fn bounded_signs(&self) -> [f64; D] {
        let (admittance, by_normal) = (&self.settings.thresholds.admittance, self.normal_signs());
        let sign = |axis: usize| match self.settings.sign {
            ContactSign::Wrench => self.contact.sign(axis),
            ContactSign::Normal => by_normal.sign(axis).filter(|_| admittance[axis]),
        };
        core::array::from_fn(|axis| sign(axis).unwrap_or(0.0))
    }

    /// Whether a least force is asked for on an axis that is bounded: not where the normal that was
    /// told has hardly a component.
    pub(crate) fn asks_for_force(&self, axis: usize) -> bool {
        self.settings.sign == ContactSign::Wrench || self.signs.sign(axis).is_some()
    }

    /// The signs of contact of the normal as it is believed to be: whose forces are bounded.
    pub(crate) fn normal_signs(&self) -> SurfaceSigns<D> {
        self.signs.learned(&self.surface.normal)
    }

    /// The pressing force in N that f̂ should show.
    pub(crate) fn expected_pressing(&self) -> f64 {
        self.expected.pressing
    }

    /// The standard deviation in N of the predicted force, along the normal, because the contact point is uncertain.
    pub(crate) fn deviation(&self) -> f64 {
        match self.settings.contact_point {
            ContactPoint::Configured | ContactPoint::Learned(_) => 0.0,
            ContactPoint::Detected { .. } => self.detection.uncertainty() / 2.0,
        }
    }

    /// What a record keeps.
    pub(crate) fn snapshot(&self) -> Snapshot {
        let uncertainty = 2.0 * self.deviation();
        let stiffness = self.surface.normal_stiffness();
        let stiffness_band = self.set.as_ref().map_or((stiffness, stiffness), SurfaceSet::stiffness_band);
        let contact_point = self.surface.contact.position;
        let normal = self.surface.normal_direction();
        Snapshot { contact_point, normal, uncertainty, expected: self.expected, stiffness, stiffness_band }
    }
}
