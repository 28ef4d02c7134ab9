//! How the tool moves in an impact: its links go on against the surface while gears that give let their
//! motors brake.
//!
//! The model (17) moves the tool with the motors. In an impact the links are a mass m on two springs, the
//! surface K and the gears k, and the motors hold the gears' other end: m ẍ = k (y − x) − K x, with x
//! and y the depths of tool and motors since the touch. However fast the motors leave, the force is about
//! √(m K) times the speed where the surface is harder than the gears.

use nalgebra::{SVector, Vector3};

use crate::intake::Accepted;
use crate::quantities::Instant;
use crate::robot::ArmDynamics;
use crate::surface::Surface;
use crate::turn::Turn;

/// Largest turn of the link's swing between two instants looked at, rad.
const FINEST: f64 = 0.25;
/// Most instants looked at within a piece of the motors' way.
const MOST_PIECES: f64 = 64.0;
/// Gears that were told too soft would leave nothing, or less, for the surface to give: this part is left.
const LEAST_LEFT: f64 = 0.2;
/// A surface that hardens, or is damped, presses as one that is so many times harder than what touches of it
/// showed.
const HARDER: f64 = 2.0;
/// Gears may be softer than a maker's sheet says, by this factor; of what then is left for the surface to give, at
/// least this part.
const SOFTER_GEARS: f64 = 1.25;
const LEAST_OF_SOFTER: f64 = 0.05;
/// A softer link may take longer to turn, by this factor.
const LATER: f64 = 1.25;
/// A touch is looked for so far back, s, in pieces of this length.
const LONGEST_TOUCH: f64 = 0.02;
const TOUCH_PIECE: f64 = 0.00025;

/// The arm as an impact meets it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImpactModel<const N: usize> {
    /// Its links, with the rotors of gears that do not give: base frame, or what the controller is
    /// [seen from](crate::Parameters::seen_from).
    pub links: ArmDynamics<N>,
    /// What each gear gives, rad/(N m); 0 of one that does not.
    pub compliance: SVector<f64, N>,
    /// Of the surface.
    pub surface_stiffness: SurfaceStiffness,
}

/// How the stiffness of a surface is told, N/m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceStiffness {
    /// As a slow press shows it to the motors: with the gears' in series.
    pub pressed: f64,
    /// As a link meets it, where that is told.
    pub in_impact: Option<f64>,
    /// As a link may meet it at most, where that is told.
    pub most_in_impact: Option<f64>,
}

impl SurfaceStiffness {
    /// As this link meets it, N/m.
    fn met_by(&self, link: &ImpactLink) -> f64 {
        self.in_impact.unwrap_or_else(|| self.behind(link.gears, LEAST_LEFT))
    }

    /// As this link meets it at most, N/m.
    fn most_met_by(&self, link: &ImpactLink) -> f64 {
        let harder = (HARDER * self.met_by(link)).max(self.most_in_impact.unwrap_or(0.0));
        // A press that is not softer than an impact was told without the gears.
        if self.in_impact.is_some_and(|stiffness| stiffness <= self.pressed) {
            return harder;
        }
        self.behind(link.gears / SOFTER_GEARS, LEAST_OF_SOFTER).max(harder)
    }

    /// What the surface is behind gears of this stiffness in N/m, of whose give at least a part is left to it.
    fn behind(&self, gears: f64, least: f64) -> f64 {
        self.pressed / (1.0 - self.pressed / gears).max(least)
    }
}

/// The tool as a mass that gears hold to the motors, along a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImpactLink {
    /// kg.
    pub mass: f64,
    /// Stiffness of the gears, N/m.
    pub gears: f64,
}

impl ImpactLink {
    /// What a slow press shows the motors of a surface of this stiffness: both in series, N/m.
    pub fn pressed(&self, surface: f64) -> f64 {
        surface / (1.0 + surface / self.gears)
    }
}

impl<const N: usize> ImpactModel<N> {
    /// The same in another frame.
    #[must_use]
    pub(crate) fn seen_from(&self, turn: &Turn) -> Self {
        Self { links: self.links.seen_from(turn), ..*self }
    }

    /// At the joint position q in rad, along a unit vector; `None` where no gear gives along it.
    pub fn link(&self, q: &SVector<f64, N>, direction: &Vector3<f64>) -> Option<ImpactLink> {
        self.link_by(q, &self.links.lever(q, direction))
    }

    fn link_by(&self, q: &SVector<f64, N>, lever: &SVector<f64, N>) -> Option<ImpactLink> {
        let compliance = lever.component_mul(lever).dot(&self.compliance);
        let mass = self.links.effective_mass_by(q, lever)?;
        (compliance > 0.0).then(|| ImpactLink { mass, gears: 1.0 / compliance })
    }
}

/// The lag and the dead time with which f̂ shows a force, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shown {
    pub(crate) lag: f64,
    pub(crate) dead_time: f64,
}

/// The tool since the last touch.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Since {
    Free,
    Touch {
        /// The likely one, and that on the hardest surface. `None`: no gear gives, or the arm did not move in.
        swings: Option<[Swing; 2]>,
        /// Whether the contact's first sample was the last one.
        is_first: bool,
    },
}

/// Follows the tool from a touch on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LinkObserver {
    since: Since,
    /// Stamp of the last sample, and where the motors would have the tool then, m.
    last: (Instant, Vector3<f64>),
}

impl LinkObserver {
    /// Nothing is touched.
    pub(crate) fn new() -> Self {
        Self { since: Since::Free, last: (Instant::default(), Vector3::zeros()) }
    }

    /// Goes on to a sample of an arm in contact. The first one of a contact says when the touch was.
    pub(crate) fn follow<const N: usize, const D: usize>(
        &mut self,
        model: &ImpactModel<N>,
        surface: &Surface<D>,
        sample: &Accepted<N, D>,
        joint_velocity: &SVector<f64, N>,
        shown: Shown,
    ) {
        let position = sample.posture.pose().position;
        let (stamp, before) = core::mem::replace(&mut self.last, (sample.stamp, position));
        // By the way itself: what is learned of the surface moves no motor.
        let by = -surface.normal_direction().dot(&(position - before));
        self.since = match self.since {
            Since::Touch { mut swings, .. } => {
                let seconds = sample.stamp.since(stamp).seconds();
                swings.iter_mut().flatten().for_each(|swing| swing.follow(by, seconds));
                Since::Touch { swings, is_first: false }
            }
            Since::Free => {
                Since::Touch { swings: touch(model, surface, sample, joint_velocity, shown), is_first: true }
            }
        };
    }

    /// The link after the last sample, whose peak counts from here on; `None` where nothing is touched, or no
    /// gear gives along the normal. At the first sample it counts from the touch on: how long ago that was
    /// is known by f̂ alone, and what seems to be over may be to come.
    ///
    /// That on the hardest surface counts from the touch on until the other one has had the time to turn.
    pub(crate) fn swings(&self) -> Option<Swings> {
        match self.since {
            Since::Free => None,
            Since::Touch { swings, is_first } => swings.map(|[likely, hardest]| {
                let is_first_swing = likely.elapsed < LATER * likely.half_a_swing();
                Swings { likely: likely.counted(is_first), hardest: hardest.counted(is_first_swing), is_first_swing }
            }),
        }
    }

    /// The contact has ended.
    pub(crate) fn forget(&mut self) {
        self.since = Since::Free;
    }
}

/// The link at the first sample of a contact.
fn touch<const N: usize, const D: usize>(
    model: &ImpactModel<N>,
    surface: &Surface<D>,
    sample: &Accepted<N, D>,
    joint_velocity: &SVector<f64, N>,
    shown: Shown,
) -> Option<[Swing; 2]> {
    let jacobian = sample.posture.jacobian();
    let speed = -surface.outward_speed(&(jacobian * joint_velocity));
    let link = model.link_by(&sample.joint_position, &jacobian.tr_mul(&surface.normal))?;
    let on =
        |stiffness: f64| Swing::touching(&link, stiffness, speed).shows(surface.pressing_force(&sample.wrench), shown);
    let stiffness = &model.surface_stiffness;
    (speed > 0.0).then(|| [on(stiffness.met_by(&link)), on(stiffness.most_met_by(&link))])
}

/// The link as it swings on a surface as it is told, and on the hardest that this may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Swings {
    pub(crate) likely: Swing,
    pub(crate) hardest: Swing,
    /// Whether the likely one may not have turned yet, since the touch.
    pub(crate) is_first_swing: bool,
}

/// The link as it swings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Swing {
    link: ImpactLink,
    /// Stiffness of the surface, N/m.
    surface: f64,
    /// Depths since the touch, m.
    motors: f64,
    depth: f64,
    /// m/s.
    speed: f64,
    elapsed: f64,
    deepest: f64,
    when: f64,
}

/// A force along the normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Peak {
    /// N.
    pub force: f64,
    /// s.
    pub time: f64,
}

impl Swing {
    /// At the touch, with a speed in m/s, of a surface of this stiffness in N/m.
    pub fn touching(link: &ImpactLink, surface: f64, speed: f64) -> Self {
        Self { link: *link, surface, motors: 0.0, depth: 0.0, speed, elapsed: 0.0, deepest: 0.0, when: 0.0 }
    }

    /// The same when f̂ shows a pressing force in N: so long the motors have gone on.
    fn shows(mut self, pressing: f64, shown: Shown) -> Self {
        let speed = self.speed;
        let left = if shown.lag > 0.0 { libm::exp(-TOUCH_PIECE / shown.lag) } else { 0.0 };
        let mut estimate = 0.0;
        while estimate < pressing && self.elapsed < LONGEST_TOUCH && self.speed > 0.0 {
            self.follow(speed * TOUCH_PIECE, TOUCH_PIECE);
            estimate = self.force() + (estimate - self.force()) * left;
        }
        self.follow(speed * shown.dead_time, shown.dead_time);
        self
    }

    /// The same whose time, and whose peak unless it counts so far, begin here.
    fn counted(self, so_far: bool) -> Self {
        Self { elapsed: 0.0, deepest: if so_far { self.deepest } else { self.depth }, when: 0.0, ..self }
    }

    /// From the touch until it leaves the surface where its motors stand, s.
    fn half_a_swing(&self) -> f64 {
        core::f64::consts::PI * libm::sqrt(self.link.mass / (self.link.gears + self.surface))
    }

    /// Whether it goes deeper, or has been deeper.
    pub(crate) fn has_a_peak(&self) -> bool {
        self.speed > 0.0 || self.deepest > self.depth
    }

    /// The force on the surface, N.
    pub fn force(&self) -> f64 {
        self.surface * self.depth.max(0.0)
    }

    /// Goes on while the motors go `by` m deeper in so many seconds, evenly.
    pub fn follow(&mut self, by: f64, duration: f64) {
        if duration <= 0.0 {
            self.motors += by;
            return;
        }
        let stiffest = libm::sqrt((self.link.gears + self.surface) / self.link.mass);
        let pieces = libm::ceil(duration * stiffest / FINEST).clamp(1.0, MOST_PIECES);
        for _ in 0..pieces as usize {
            self.follow_piece(by / pieces, duration / pieces);
        }
    }

    fn follow_piece(&mut self, by: f64, h: f64) {
        // A tool that has bounced off hangs on its gears alone.
        let surface = if self.depth >= 0.0 { self.surface } else { 0.0 };
        let both = self.link.gears + surface;
        let (share, frequency) = (self.link.gears / both, libm::sqrt(both / self.link.mass));
        // The point about which it swings goes with the motors.
        let drift = share * by / h;
        let (at, from, speed) = (share * self.motors, self.depth - share * self.motors, self.speed - drift);
        // Depth, speed and acceleration after some seconds.
        let after = |time: f64| {
            let (sin, cos) = (libm::sin(frequency * time), libm::cos(frequency * time));
            let off = from * cos + speed / frequency * sin;
            (at + drift * time + off, drift + speed * cos - from * frequency * sin, -frequency * frequency * off)
        };
        let before = self.speed;
        self.motors += by;
        (self.depth, self.speed, _) = after(h);
        let (mut deepest, mut when) = (self.depth, h);
        if before > 0.0 && self.speed < 0.0 {
            // Where it turns: by a straight line, and a step of Newton's method.
            when = h * before / (before - self.speed);
            let (_, rest, braking) = after(when);
            when = (when - rest / braking).clamp(0.0, h);
            deepest = after(when).0;
        }
        if deepest > self.deepest {
            (self.deepest, self.when) = (deepest, self.elapsed + when);
        }
        self.elapsed += h;
    }

    /// The largest force so far.
    pub(crate) fn peak(&self) -> Peak {
        Peak { force: self.surface * self.deepest.max(0.0), time: self.when }
    }

    /// Whether it goes no deeper where the motors go `by` deeper: it leaves, and so do they.
    pub(crate) fn is_over(&self, by: f64) -> bool {
        self.speed <= 0.0 && by <= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINK: ImpactLink = ImpactLink { mass: 8.0, gears: 2e5 };
    const SURFACE: f64 = 1e6;
    /// Until then it has not bounced off, s.
    const FIRST: f64 = 0.007;

    /// The peak in N of an impact at 0.1 m/s whose motors follow this depth, in m, over time in s.
    fn peak(link: &ImpactLink, motors: impl Fn(f64) -> f64, step: f64) -> f64 {
        let mut swing = Swing::touching(link, SURFACE, 0.1);
        for instant in 0..(FIRST / step) as usize {
            let at = |instant: usize| motors(instant as f64 * step);
            swing.follow(at(instant + 1) - at(instant), step);
        }
        swing.peak().force
    }

    #[test]
    fn motors_that_stand_hold_the_link_by_their_gears() {
        // Half the energy of the mass is in neither spring: x = v / ω.
        let by_hand = SURFACE * 0.1 / ((LINK.gears + SURFACE) / LINK.mass).sqrt();
        for step in [1e-4, 1e-3, 3.5e-3] {
            let found = peak(&LINK, |_| 0.0, step);
            assert!((found / by_hand - 1.0).abs() < 2e-4, "{found} N and {by_hand} N");
        }
    }

    #[test]
    fn without_gears_it_is_that_of_a_mass_on_a_spring() {
        let alone = ImpactLink { gears: 1e-3, ..LINK };
        let found = peak(&alone, |time| -time, 1e-3);
        assert!((found / ((8.0f64 * 1e6).sqrt() * 0.1) - 1.0).abs() < 2e-4, "{found} N");
    }

    #[test]
    fn motors_that_go_on_or_leave_are_those_of_a_fine_integration() {
        for (first, then) in [(0.1, 0.1), (0.1, -1.0), (0.0, -2.0)] {
            let motors = |time: f64| first * time.min(0.002) + then * (time - 0.002).max(0.0);
            let (mut depth, mut speed, mut deepest, h) = (0.0f64, 0.1f64, 0.0f64, 1e-7);
            for instant in 0..(FIRST / h) as u32 {
                let time = f64::from(instant) * h;
                speed += h * (LINK.gears * (motors(time) - depth) - SURFACE * depth) / LINK.mass;
                depth += h * speed;
                deepest = deepest.max(depth);
            }
            let found = peak(&LINK, motors, 1e-3);
            assert!((found / (1e6 * deepest) - 1.0).abs() < 1e-3, "{found} N and {} N", 1e6 * deepest);
        }
    }

    #[test]
    fn the_hardest_surface_is_what_gears_that_are_softer_than_told_leave() {
        let gears = 5e4;
        let link = ImpactLink { gears, ..LINK };
        // A press on 5e4 N/m, by gears that are a fifth softer than told.
        let softer = gears / SOFTER_GEARS;
        let pressed = 5e4 * softer / (5e4 + softer);
        let by_press = SurfaceStiffness { pressed, in_impact: None, most_in_impact: None };
        let known = |stiffness: f64, pressed: f64| {
            SurfaceStiffness { pressed, in_impact: Some(stiffness), ..by_press }.most_met_by(&link)
        };
        assert!(by_press.met_by(&link) < 4.5e4, "{}", by_press.met_by(&link));
        assert!(by_press.most_met_by(&link) >= 5e4 * (1.0 - 1e-9), "{}", by_press.most_met_by(&link));
        assert_eq!(known(6e4, 6e4), HARDER * 6e4);
        // Where more is told, that counts; less does not.
        for (told, counts) in [(5e5, 5e5), (6e4, HARDER * 6e4)] {
            let surface = SurfaceStiffness { pressed: 6e4, in_impact: Some(6e4), most_in_impact: Some(told) };
            assert_eq!(surface.most_met_by(&link), counts);
        }
        // Where the press says more than the impact, it counts.
        let hard = 0.99 * softer;
        assert_eq!(known(1.5 * hard, hard), hard / LEAST_OF_SOFTER);
    }

    #[test]
    fn the_peak_on_the_hardest_surface_counts_until_the_likely_one_has_turned() {
        let on = |surface: f64| Swing::touching(&LINK, surface, 0.1);
        let mut observer = LinkObserver::new();
        let mut swings = [on(SURFACE), on(4.0 * SURFACE)];
        let (half, mut peak) = (swings[0].half_a_swing(), swings[1]);
        peak.follow(0.0, half);
        let counted = |observer: &LinkObserver| observer.swings().map_or(0.0, |swings| swings.hardest.peak().force);
        for (part, counts) in [(0.9, true), (0.3, true), (0.2, false)] {
            swings.iter_mut().for_each(|swing| swing.follow(0.0, part * half));
            observer.since = Since::Touch { swings: Some(swings), is_first: false };
            let found = counted(&observer) / peak.peak().force;
            assert_eq!(found > 0.99, counts, "{found} of the peak after another {part} of half a swing");
        }
    }

    #[test]
    fn a_touch_is_as_long_ago_as_the_estimate_says() {
        for (since, lag) in [(0.001, 0.02), (0.0035, 0.02), (0.002, 0.005)] {
            let (mut swing, mut estimate, h) = (Swing::touching(&LINK, SURFACE, 0.1), 0.0, 1e-5);
            for _ in 0..(since / h) as usize {
                swing.follow(0.1 * h, h);
                estimate += (swing.force() - estimate) * h / lag;
            }
            let found = Swing::touching(&LINK, SURFACE, 0.1).shows(estimate, Shown { lag, dead_time: 0.0 });
            assert!((found.elapsed - since).abs() <= 1.01 * TOUCH_PIECE, "{} s and {since} s", found.elapsed);
        }
    }
}
