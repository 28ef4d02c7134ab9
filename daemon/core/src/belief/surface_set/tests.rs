//! The set against brute force: all stiffnesses and contact depths of a grid, each with its own
//! filter.

use super::*;
use crate::belief::way::Piece;

const LAG: f64 = 0.020;
const CYCLE: f64 = 0.001;

/// A tool that moves in at `speed`, is braked from 4 ms after the touch on, and a surface.
pub(super) struct World {
    pub stiffness: f64,
    pub begins: f64,
    pub speed: f64,
    pub noise: f64,
    pub seed: u64,
}

impl World {
    /// Depth at a time in s; it touches at 0.
    fn depth(&self, time: f64) -> f64 {
        let (braking, lag) = (time - 0.004, 0.012);
        let back = if braking > 0.0 { braking - lag * (1.0 - libm::exp(-braking / lag)) } else { 0.0 };
        self.begins + self.speed * (time - 1.3 * back)
    }

    /// A normal error, about: the sum of twelve even ones.
    pub(super) fn error(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (self.seed >> 33) as f64 / f64::from(1_u32 << 31);
        }
        sum * self.noise
    }

    /// The way of a cycle that ends at `time`.
    fn way(&self, time: f64) -> Way {
        let mut way = Way::new();
        for half in 0..2 {
            let start = time - CYCLE + 0.5 * CYCLE * f64::from(half);
            let depth = [0.0, 0.25, 0.5].map(|part| self.depth(start + part * CYCLE));
            way.push(Piece { duration: 0.5 * CYCLE, depth });
        }
        way
    }
}

/// What a fine filter shows of a spring, cycle after cycle.
fn shown(world: &World, begins: f64, from: i32, cycles: i32) -> Vec<f64> {
    let (parts, mut value) = (64, 0.0);
    let left = libm::exp(-CYCLE / f64::from(parts) / LAG);
    (from..from + cycles)
        .map(|cycle| {
            for part in 0..parts {
                let time = CYCLE * (f64::from(cycle) + (f64::from(part) + 0.5) / f64::from(parts));
                value = left * value + (1.0 - left) * (world.depth(time) - begins).max(0.0);
            }
            value
        })
        .collect()
}

extern crate std;
use std::vec::Vec;

/// A force that no tool feigns.
fn pressed(force: f64) -> ShownForce {
    ShownForce { pressing: force, beside: Vector3::zeros(), feigned: 0.0, differing: 0.0 }
}

fn prior() -> Prior {
    Prior { stiffness: (1e4, 5e5), depth_tolerance: None, normal_tolerance: 0.0, risk: 0.99 }
}

fn set(noise: f64) -> SurfaceSet {
    SurfaceSet::new(&prior(), LAG, noise, 5.0, 0.0)
}

#[test]
fn a_force_is_known_to_exceed_a_limit_or_not() {
    let mut world = World { stiffness: 8e4, begins: 0.0123, speed: 0.2, noise: 0.5, seed: 5 };
    let mut set = set(world.noise);
    let (before, cycles) = (30, 40);
    let exact = shown(&world, world.begins, -before, before + cycles);
    for cycle in -before..cycles {
        let time = CYCLE * f64::from(cycle + 1);
        let force = world.stiffness * exact[(cycle + before) as usize] + world.error();
        set.follow(Some(&world.way(time)), world.depth(time), &pressed(force), force > 5.0);
        let depth = |part: i32| world.depth(time - CYCLE * f64::from(part) / 64.0);
        let peak = world.stiffness * ((0..=64).map(depth).fold(f64::NEG_INFINITY, f64::max) - world.begins);
        // f̂ without its lag has five standard deviations of 18 N here.
        if cycle > 12 {
            assert!(set.has_exceeded(0.96 * peak) && !set.has_exceeded(1.04 * peak), "{peak} N in cycle {cycle}");
        }
    }
    set.forget();
    assert!(!set.has_exceeded(0.0), "nothing is known");
}

#[test]
fn the_set_of_a_touch_is_that_of_a_grid() {
    // The grid of contact depths reaches so many seconds of the way to both sides.
    for (stiffness, speed, noise, cycles, reach) in
        [(8e4, 0.2, 0.5, 8, 0.004), (2e5, 0.1, 0.5, 12, 0.003), (2e4, 0.3, 2.0, 14, 0.02), (4e5, 0.1, 0.0, 6, 0.001)]
    {
        // Not on a node.
        let mut world = World { stiffness, begins: 0.0123, speed, noise, seed: 5 };
        let mut set = set(noise);
        let before = 30;
        let exact = shown(&world, world.begins, -before, before + cycles);
        let mut forces = Vec::new();
        for cycle in -before..cycles {
            let time = CYCLE * f64::from(cycle + 1);
            let force = world.stiffness * exact[(cycle + before) as usize] + world.error();
            set.follow(Some(&world.way(time)), world.depth(time), &pressed(force), force > 5.0);
            forces.push(force);
        }
        let spring = set.likeliest().expect("noticed");
        // Cost of every (c, k) against no contact.
        let weight = |force: f64| 1.0 / (noise * noise + FLOOR * FLOOR + FLOOR_PART * FLOOR_PART * force * force);
        let mut costs = Vec::new();
        for step in 0..=300 {
            let begins = world.begins + reach * speed * (f64::from(step) / 150.0 - 1.0);
            let phi = shown(&world, begins, -before, before + cycles);
            let (mut square, mut product) = (0.0, 0.0);
            for (phi, force) in phi.iter().zip(&forces) {
                square += weight(*force) * phi * phi;
                product += weight(*force) * phi * force;
            }
            for part in 0..=1500 {
                let k = 1e4 * libm::pow(50.0, f64::from(part) / 1500.0);
                costs.push((k, begins, k * (k * square - 2.0 * product)));
            }
        }
        let best = costs.iter().map(|(_, _, cost)| *cost).fold(f64::INFINITY, f64::min);
        let Stage::Touch(touch) = &set.stage else { panic!("already held") };
        let found = touch.found().unwrap();
        assert!((found.cost - best).abs() < 0.3 + 1e-3 * best.abs(), "{} {best}", found.cost);
        let scale = touch.scale(found.cost);
        let (force, z) = (200.0, 3.0);
        let inside = || costs.iter().filter(|(_, _, cost)| *cost <= best + z * z * scale);
        let least = inside().map(|(k, c, _)| c + force / k).fold(f64::INFINITY, f64::min);
        let most = inside().map(|(k, c, _)| c + force / k).fold(f64::NEG_INFINITY, f64::max);
        let (low, high) = set.depths_of(force, z, 0.0);
        // Between two nodes the response is a straight line: 2 % of the force at most.
        let near = 0.1 * (most - least) + 0.02 * force / stiffness;
        assert!((low - least).abs() < near, "k {stiffness}: {low} {least}, {near}");
        assert!((high - most).abs() < near, "k {stiffness}: {high} {most}, {near}");
        assert!(low <= world.begins + force / stiffness && world.begins + force / stiffness <= high);
        let deepest = world.begins + 0.8 * force / stiffness;
        let strongest = inside().map(|(k, c, _)| k * (deepest - c)).fold(f64::NEG_INFINITY, f64::max);
        let (found, wide) = (set.strongest(deepest, z, 0.0), 0.1 * force + 0.1 * strongest);
        assert!((found - strongest).abs() < wide, "{found} {strongest}");
        // Shares: weights exp(−cost/2) on a grid even in k and in c.
        let (mut all, mut above) = (0.0, 0.0);
        for (k, c, cost) in &costs {
            let weight = k * libm::exp(-0.5 * (cost - best) / scale);
            all += weight;
            above += if k * (deepest - c) > 0.8 * force { weight } else { 0.0 };
        }
        let share = set.share_above(0.8 * force, deepest, 0.0);
        assert!((share - above / all).abs() < 0.2, "{share} {}", above / all);
        assert!(spring.stiffness >= 1e4 && spring.stiffness <= 5e5);
    }
}

/// A tool at rest 0.8 mm below where a surface of 1e5 N/m begins at first, which then creeps away by `creep`
/// m from 0.15 s to 0.45 s: what is believed of it, and how deep the tool is in it.
fn held(creep: f64) -> (SurfaceSet, f64) {
    let mut world = World { stiffness: 1e5, begins: 0.0123, speed: 0.1, noise: 0.5, seed: 11 };
    let mut set = set(0.5);
    let (before, cycles) = (30, 450);
    // Pressed at rest after 40 ms.
    let rest = |time: f64| 0.0123 + 0.0008 * libm::tanh((time + 0.001).max(-0.03) / 0.008);
    let mut value = 0.0;
    for cycle in -before..cycles {
        let start = CYCLE * f64::from(cycle);
        world.begins = 0.0123 + creep * ((start - 0.15) / 0.3).clamp(0.0, 1.0);
        let mut way = Way::new();
        for half in 0..2 {
            let at = |part: f64| rest(start + CYCLE * (0.5 * f64::from(half) + part));
            way.push(Piece { duration: 0.5 * CYCLE, depth: [at(0.0), at(0.25), at(0.5)] });
        }
        for part in 0..64 {
            let left = libm::exp(-CYCLE / 64.0 / LAG);
            let depth = rest(start + CYCLE * (f64::from(part) + 0.5) / 64.0);
            value = left * value + (1.0 - left) * world.stiffness * (depth - world.begins).max(0.0);
        }
        let force = value + world.error();
        set.follow(Some(&way), rest(start + CYCLE), &pressed(force), force > 5.0);
    }
    assert!(matches!(set.stage, Stage::Hold(_)));
    (set, 0.0123 + 0.0008 - world.begins)
}

#[test]
fn a_held_surface_is_followed() {
    let at = 0.0123 + 0.0008;
    for creep in [0.0, 3e-5, -3e-5] {
        let (set, depth) = held(creep);
        let spring = set.likeliest().unwrap();
        let (force, exact) = (spring.stiffness * (at - spring.depth), 1e5 * depth);
        assert!((force - exact).abs() < 1.0, "creep {creep} m: {force} {exact} {spring:?}");
        assert!((spring.stiffness / 1e5 - 1.0).abs() < 0.2, "{spring:?}");
        let (least, most) = set.depths_of(exact, 3.0, 0.0);
        assert!(least < at && at < most && most - least < 1e-4, "{least} {most}");
    }
}

/// As an arm brakes in 16 ms with a tool of 2 kg, up to 20 N of its inertia is in f̂ that q̇, which is reported late, does not show.
#[test]
fn a_held_surface_does_not_follow_the_inertia_of_the_tool() {
    let at = 0.0123 + 0.0008;
    let off = |share: f64| {
        let (mut set, depth) = held(0.0);
        let mut rest = Way::new();
        rest.push(Piece { duration: CYCLE, depth: [at; 3] });
        let mut most = 0.0_f64;
        for cycle in 0..16 {
            let missed = 20.0 * libm::sin(std::f64::consts::PI * f64::from(cycle) / 16.0);
            let shown = ShownForce { differing: share * missed, ..pressed(1e5 * depth - missed) };
            set.follow(Some(&rest), at, &shown, true);
            let Spring { stiffness, depth: begins } = set.likeliest().expect("held");
            most = most.max((stiffness * (at - begins) - 1e5 * depth).abs());
        }
        most
    };
    let (told, untold) = (off(1.0), off(0.0));
    assert!(told < 0.25 * untold && untold > 10.0, "off by {told} N, and {untold} N where nobody says so");
}

/// What a tool of 3 kg at the end of 0.7 m differs by, N, cycle after cycle, where an encoder has `noise` (rad) and q̇ none.
struct Encoder {
    random: World,
    noise: f64,
    /// The last two errors of the position, rad, the last one of the velocity, rad/s, and of what is felt, m/s².
    before: [f64; 2],
    velocity: f64,
    felt: f64,
}

impl Encoder {
    fn of(noise: f64) -> Self {
        let random = World { stiffness: 0.0, begins: 0.0, speed: 0.0, noise: 1.0, seed: 41 };
        Self { random, noise, before: [0.0; 2], velocity: 0.0, felt: 0.0 }
    }

    /// By the slope of the parabola through three positions, and the filter of f̂: as `ToolMotion` does it.
    fn differs(&mut self) -> f64 {
        let [last, first] = self.before;
        let error = self.noise * self.random.error();
        let velocity = (1.5 * error - 2.0 * last + 0.5 * first) / CYCLE;
        let left = libm::exp(-CYCLE / LAG);
        self.felt = left * self.felt + (1.0 - left) * (velocity - self.velocity) / CYCLE;
        (self.before, self.velocity) = ([error, last], velocity);
        3.0 * 0.7 * self.felt
    }
}

#[test]
fn a_surface_that_is_harder_than_told_is_found_out() {
    // The range ends at 5e5 N/m.
    let stiffnesses = [(2e6, true), (7.5e5, true), (5.5e5, false), (4.5e5, false)];
    let told = [(0.5, 5.0), (0.0, 5.0), (0.5, 20.0), (0.0, 20.0)];
    for ((stiffness, is_outside), (noise, felt)) in stiffnesses.into_iter().flat_map(|of| told.map(|told| (of, told))) {
        let mut world = World { stiffness, begins: 0.0123, speed: 0.1, noise, seed: 3 };
        let mut set = SurfaceSet::new(&prior(), LAG, noise, felt, 0.0);
        let exact = shown(&world, world.begins, -30, 45);
        let mut found = false;
        for cycle in -30..15 {
            let time = CYCLE * f64::from(cycle + 1);
            let force = stiffness * exact[(cycle + 30) as usize] + world.error();
            set.follow(Some(&world.way(time)), world.depth(time), &pressed(force), force > felt);
            found |= set.is_outside();
        }
        assert_eq!(found, is_outside, "{stiffness} N/m, {noise} N of noise, felt above {felt} N");
    }
}

/// A surface of 1e5 N/m that is held and then moved on over one of `behind` N/m, within a depth that goes up and down,
/// by an arm with this encoder: whether it is found to be harder than the range, which ends at 5e5 N/m.
fn becomes(behind: f64, noise: f64, mut encoder: Encoder) -> SurfaceSet {
    let mut world = World { stiffness: 1e5, begins: 0.0123, speed: 0.1, noise, seed: 23 };
    let mut set = set(noise);
    // 20 N and some 8 N up and down, whatever the stiffness.
    let depth = |time: f64, stiffness: f64| {
        0.0123 + (20.0 + 8.0 * libm::sin(60.0 * time)) / stiffness * libm::tanh((time + 0.001).max(-0.03) / 0.008)
    };
    let mut value = 0.0;
    for cycle in -30..600 {
        let start = CYCLE * f64::from(cycle);
        if cycle == 200 {
            world.stiffness = behind;
        }
        let stiffness = world.stiffness;
        let mut way = Way::new();
        for half in 0..2 {
            let at = |part: f64| depth(start + CYCLE * (0.5 * f64::from(half) + part), stiffness);
            way.push(Piece { duration: 0.5 * CYCLE, depth: [at(0.0), at(0.25), at(0.5)] });
        }
        for part in 0..64 {
            let left = libm::exp(-CYCLE / 64.0 / LAG);
            let pressed = (depth(start + CYCLE * (f64::from(part) + 0.5) / 64.0, stiffness) - world.begins).max(0.0);
            value = left * value + (1.0 - left) * stiffness * pressed;
        }
        let force = value + world.error();
        set.follow(
            Some(&way),
            depth(start + CYCLE, stiffness),
            &ShownForce { differing: encoder.differs(), ..pressed(force) },
            force > 5.0,
        );
    }
    set
}

#[test]
fn a_surface_that_becomes_harder_than_told_is_found_out_while_it_is_pressed() {
    // Of a heavy tool and a coarse encoder no less.
    for (noise, encoder) in [(0.0, 0.0), (0.5, 0.0), (0.5, 1e-5), (0.5, 1e-4)] {
        for (behind, is_outside) in [(3e6, true), (1e6, true), (4.9e5, false), (3e5, false), (2e4, false)] {
            let set = becomes(behind, noise, Encoder::of(encoder));
            let found = set.likeliest().unwrap();
            assert_eq!(set.is_outside(), is_outside, "{behind} N/m, {noise} N, {encoder} rad: {found:?}");
            // Some micrometres up and down tell that it is harder, not by how much.
            assert_eq!(found.stiffness > 5e5, is_outside, "{behind} N/m: {found:?}");
        }
    }
}

/// Told to begin within 1 mm, and 4 mm off to both sides.
#[test]
fn a_surface_that_begins_elsewhere_than_told_is_found() {
    for (begins, stiffness, noise) in [(0.0083, 4e5, 0.5), (0.0163, 4e5, 0.5), (0.0083, 3e4, 0.0), (0.0163, 3e4, 0.0)] {
        let mut world = World { stiffness, begins, speed: 0.1, noise, seed: 5 };
        let prior = Prior { stiffness: (1e4, 5e5), depth_tolerance: Some(1e-3), normal_tolerance: 0.0, risk: 0.99 };
        let mut set = SurfaceSet::new(&prior, LAG, noise, 5.0, 0.0123);
        let exact = shown(&world, begins, -60, 80);
        for cycle in -60..20 {
            let time = CYCLE * f64::from(cycle + 1);
            let force = stiffness * exact[(cycle + 60) as usize] + world.error();
            set.follow(Some(&world.way(time)), world.depth(time), &pressed(force), force > 5.0);
        }
        let found = set.likeliest().expect("noticed");
        let off = (found.depth - begins).abs();
        assert!(
            (found.stiffness / stiffness - 1.0).abs() < 0.2 && off < 5e-5,
            "{begins} m, {stiffness} N/m: {found:?}"
        );
    }
}
