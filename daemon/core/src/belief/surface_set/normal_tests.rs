//! The normal that is learned while sliding, on its own: f̂ of a known surface, whatever path the tool
//! takes over it at a constant depth.

use super::tests::World;
use super::*;
use crate::belief::way::Piece;

const LAG: f64 = 0.020;
const CYCLE: f64 = 0.001;
const NOISE: f64 = 0.5;
const STIFFNESS: f64 = 1e5;
/// Pressing force that is kept, N.
const FORCE: f64 = 20.0;

/// Where the tool is along the table, m, at a time in s.
type Path<'a> = dyn Fn(f64) -> Vector3<f64> + 'a;

/// A tool on a table with normal +z, for so many seconds, with friction, seen by joints with noise (m). The
/// normal is told as it is, with a tolerance (rad).
struct Slide<'a> {
    at: &'a Path<'a>,
    seconds: f64,
    /// From when on the largest tilt is looked for, s.
    from: f64,
    friction: f64,
    joint_noise: f64,
    tolerance: f64,
}

impl Slide<'_> {
    /// What is believed in the end, and the largest tilt, as a slope.
    fn run(&self) -> (SurfaceSet, f64) {
        let prior =
            Prior { stiffness: (3e4, 3e5), depth_tolerance: None, normal_tolerance: self.tolerance, risk: 0.99 };
        let mut set = SurfaceSet::new(&prior, LAG, NOISE, 5.0, 0.0);
        let mut noise = World { stiffness: STIFFNESS, begins: 0.0, speed: 0.0, noise: 1.0, seed: 17 };
        let (mut normal, mut dragged) = (Vector3::z(), Vector3::zeros());
        let mut felt = Vector3::zeros();
        let (mut last, mut largest) = (None, 0.0_f64);
        // In within 4 ms, and then held there.
        let depth = |time: f64| FORCE / STIFFNESS * libm::tanh(time / 0.004);
        let left = libm::exp(-CYCLE / LAG);
        for cycle in -10..(self.seconds / CYCLE) as i32 {
            let time = CYCLE * f64::from(cycle + 1);
            let [before, at] = [time - CYCLE, time].map(|time| {
                let beside = (self.at)(time.max(0.0));
                beside - Vector3::z() * depth(time)
            });
            let moved = (at - before).xy();
            if moved.norm() > 1e-9 {
                dragged = Vector3::new(moved.x, moved.y, 0.0) / moved.norm();
            }
            let force = STIFFNESS * depth(time - 0.5 * CYCLE).max(0.0);
            felt += (dragged * (self.friction * force) - Vector3::z() * force - felt) * (1.0 - left);
            let wrench = felt + Vector3::from_fn(|_, _| NOISE * noise.error());
            let seen = at + Vector3::from_fn(|_, _| self.joint_noise * noise.error());
            let from = last.replace(seen).unwrap_or(before);
            let along = |position: &Vector3<f64>| -normal.dot(position);
            let mut way = Way::new();
            let depths = [along(&from), 0.5 * (along(&from) + along(&seen)), along(&seen)];
            way.push(Piece { duration: CYCLE, depth: depths });
            let moved = seen - from;
            way.beside = moved - normal * normal.dot(&moved);
            let pressing = -normal.dot(&wrench);
            let beside = wrench + normal * pressing;
            let shown = ShownForce { pressing, beside, feigned: 0.0, differing: 0.0 };
            set.follow(Some(&way), along(&seen), &shown, pressing > 5.0);
            if let Some(tilt) = set.take_tilt() {
                let before = along(&seen);
                normal = (normal + tilt).normalize();
                set.shift(-normal.dot(&seen) - before);
            }
            let Spring { stiffness, .. } = set.likeliest().unwrap_or(set.unexplained());
            assert!((3e4..=3e5).contains(&stiffness), "{time} s: {stiffness} N/m");
            if time > self.from {
                largest = largest.max(normal.xy().norm() / normal.z);
            }
        }
        (set, largest)
    }
}

/// 0.1 m/s along x until `until` (s), then what `then` makes of the time since.
fn slides_until(until: f64, then: impl Fn(f64) -> Vector3<f64>) -> impl Fn(f64) -> Vector3<f64> {
    move |time| Vector3::x() * (0.1 * time.min(until)) + then((time - until).max(0.0))
}

/// Each cycle's noise was a heading of its own, and friction a tilt: up to 21 degrees in seconds.
#[test]
fn a_tool_that_stands_still_turns_no_normal() {
    let at = slides_until(0.3, |_| Vector3::zeros());
    for friction in [0.0, 0.3] {
        for joint_noise in [0.0, 1e-7, 1e-6, 5e-6] {
            let slide = Slide { at: &at, seconds: 3.0, from: 0.3, friction, joint_noise, tolerance: 0.17 };
            let (set, largest) = slide.run();
            assert!(largest < 0.03, "friction {friction}, noise {joint_noise} m: {largest}");
            assert!(set.tilt.path < 0.035, "{} m", set.tilt.path);
        }
    }
}

/// f̂ shows friction a lag after the heading: at a corner it was a tilt of 6 degrees, on a circle one of 3.
#[test]
fn friction_that_lags_behind_the_heading_is_no_tilt() {
    let corner = slides_until(0.5, |time| Vector3::y() * (0.1 * time));
    let circle = |time: f64| 0.02 * Vector3::new(libm::sin(5.0 * time), libm::cos(5.0 * time), 0.0);
    let paths: [(&Path, f64); 2] = [(&corner, 0.54), (&circle, 0.3)];
    for (at, from) in paths {
        let slide = Slide { at, seconds: 1.0, from, friction: 0.5, joint_noise: 0.0, tolerance: 0.17 };
        let (_, largest) = slide.run();
        assert!(largest < 0.03, "from {from} s: {largest}");
    }
}

/// A touch on the slant: the slope that the tolerance does not allow took the stiffness below zero with
/// it. [`Slide::run`] looks at the stiffness in each cycle.
#[test]
fn a_slope_that_can_t_be_leaves_the_stiffness_in_its_range() {
    for (slope, tolerance) in [(-0.35, 0.17), (0.35, 0.17), (0.3, 0.05)] {
        let slanted = |time: f64| Vector3::new(0.5 * time, 0.0, -0.5 * slope * time);
        let slide = Slide { at: &slanted, seconds: 0.2, from: 0.2, friction: 0.3, joint_noise: 0.0, tolerance };
        let _ = slide.run();
    }
}
