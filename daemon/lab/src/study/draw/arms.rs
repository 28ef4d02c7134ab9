//! Random arms of each kind that the study knows.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;
use std::str::FromStr;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::super::arm::{Arm, Chain, Joint, Kind, PlanarTwo};
use super::uniform;

/// A kind of arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum ArmName {
    /// Two joints in a plane: x and y.
    PlanarTwo,
    /// Three joints in a plane: x, y and rz.
    PlanarThree,
    /// Three joints that turn about z and one that slides along it: x, y, z and rz.
    Scara,
    /// Three joints that slide: x, y and z.
    Gantry,
    /// Five joints that turn: x, y, z, ry and rz.
    Five,
    /// Six joints that turn.
    Six,
    /// Six joints that turn, on a linear axis.
    SixOnRail,
    /// Seven joints that turn.
    Seven,
    /// Seven joints that turn, on a lifting column.
    Eight,
}

impl ArmName {
    /// All, in the order in which they take turns.
    pub(crate) const ALL: [Self; 9] = [
        Self::PlanarTwo,
        Self::PlanarThree,
        Self::Scara,
        Self::Gantry,
        Self::Five,
        Self::Six,
        Self::SixOnRail,
        Self::Seven,
        Self::Eight,
    ];

    /// As the command line and JSON have it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::PlanarTwo => "planar-2r",
            Self::PlanarThree => "planar-3r",
            Self::Scara => "scara",
            Self::Gantry => "gantry",
            Self::Five => "five",
            Self::Six => "six",
            Self::SixOnRail => "six-on-rail",
            Self::Seven => "seven",
            Self::Eight => "eight",
        }
    }

    /// Which of x y z rx ry rz the arm controls at most.
    pub(super) fn controls(self) -> &'static [usize] {
        match self {
            Self::PlanarTwo => &[0, 1],
            Self::PlanarThree => &[0, 1, 5],
            Self::Scara => &[0, 1, 2, 5],
            Self::Gantry => &[0, 1, 2],
            Self::Five => &[0, 1, 2, 4, 5],
            Self::Six | Self::SixOnRail | Self::Seven | Self::Eight => &[0, 1, 2, 3, 4, 5],
        }
    }

    /// Whether it moves in the plane of x and y alone.
    pub(super) fn is_planar(self) -> bool {
        matches!(self, Self::PlanarTwo | Self::PlanarThree)
    }

    /// Whether a frame may be turned about any axis: what the arm controls is the same in all of them.
    pub(super) fn may_tilt(self) -> bool {
        !self.is_planar() && self != Self::Scara
    }

    /// One of them at random.
    pub(super) fn arm(self, generator: &mut ChaCha8Rng) -> Arm {
        let mut within = |low: f64, high: f64| uniform(generator, low, high);
        let z = [0.0, 0.0, 1.0];
        match self {
            Self::PlanarTwo => Arm::PlanarTwo(PlanarTwo { links_m: [within(0.3, 1.2), within(0.3, 1.2)] }),
            Self::PlanarThree => {
                let joints = vec![
                    turns([0.0; 3], z),
                    turns([within(0.3, 1.0), 0.0, 0.0], z),
                    turns([within(0.3, 1.0), 0.0, 0.0], z),
                ];
                Arm::Chain(Chain {
                    joints,
                    tool_m: [within(0.1, 0.5), 0.0, 0.0],
                    tool_rpy_rad: [0.0, 0.0, within(-PI, PI)],
                })
            }
            Self::Scara => {
                let mut joints = vec![
                    turns([0.0, 0.0, within(0.2, 0.6)], z),
                    turns([within(0.2, 0.6), 0.0, 0.0], z),
                    turns([within(0.2, 0.6), 0.0, 0.0], z),
                ];
                // A quill at the end, or a column at the base; downward or upward.
                let quill = slides([0.0; 3], [0.0, 0.0, if within(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 }]);
                joints.insert(if within(0.0, 1.0) < 0.5 { 3 } else { 0 }, quill);
                let tool_m = [within(0.0, 0.2), 0.0, within(-0.3, 0.0)];
                Arm::Chain(Chain { joints, tool_m, tool_rpy_rad: [0.0, 0.0, within(-PI, PI)] })
            }
            Self::Gantry => {
                let skewed = |axis: [f64; 3], by: [f64; 3]| Joint { rpy_rad: by, ..slides([0.0; 3], axis) };
                let mut skew = || [within(-0.2, 0.2), within(-0.2, 0.2), within(-0.2, 0.2)];
                let joints = vec![skewed([1.0, 0.0, 0.0], skew()), skewed([0.0, 1.0, 0.0], skew()), skewed(z, skew())];
                Arm::Chain(Chain { joints, tool_m: [0.0, 0.0, -0.2], tool_rpy_rad: [within(-PI, PI), 0.3, 0.0] })
            }
            Self::Five => on(Vec::new(), 5, generator),
            Self::Six => on(Vec::new(), 6, generator),
            Self::SixOnRail => {
                let along = uniform(generator, -PI, PI);
                on(vec![slides([0.0; 3], [along.cos(), along.sin(), 0.0])], 6, generator)
            }
            Self::Seven => on(Vec::new(), 7, generator),
            Self::Eight => on(vec![slides([0.0; 3], z)], 7, generator),
        }
    }
}

impl fmt::Display for ArmName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Some of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Arms(pub(crate) Vec<ArmName>);

impl FromStr for Arms {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "all" {
            return Ok(Self(ArmName::ALL.to_vec()));
        }
        let named = |name: &str| ArmName::ALL.into_iter().find(|arm| arm.name() == name);
        let accepted = || ArmName::ALL.map(ArmName::name).join(" ");
        let arms = text.split(',').map(|name| {
            named(name).ok_or_else(|| format!("no arm {name:?}; accepted: all, or some of {}, with commas", accepted()))
        });
        let mut arms: Vec<ArmName> = arms.collect::<Result<_, _>>()?;
        arms.sort_unstable();
        arms.dedup();
        Ok(Self(arms))
    }
}

fn turns(origin_m: [f64; 3], axis: [f64; 3]) -> Joint {
    Joint { origin_m, rpy_rad: [0.0; 3], axis, kind: Kind::Turns }
}

fn slides(origin_m: [f64; 3], axis: [f64; 3]) -> Joint {
    Joint { kind: Kind::Slides, ..turns(origin_m, axis) }
}

/// So many joints that turn, on others: like the arms that are sold, or any at all.
fn on(mut joints: Vec<Joint>, count: usize, generator: &mut ChaCha8Rng) -> Arm {
    let is_usual = generator.random::<f64>() < 0.5;
    joints.extend((0..count).map(|joint| if is_usual { usual(joint, count, generator) } else { any(generator) }));
    let mut within = |low: f64, high: f64| uniform(generator, low, high);
    let tool_m = [within(-0.1, 0.1), within(-0.1, 0.1), within(0.05, 0.3)];
    Arm::Chain(Chain { joints, tool_m, tool_rpy_rad: [within(-PI, PI), within(-1.5, 1.5), within(-PI, PI)] })
}

/// Shoulder, elbow and wrist, each link a little off its drawing.
fn usual(joint: usize, count: usize, generator: &mut ChaCha8Rng) -> Joint {
    let mut within = |low: f64, high: f64| uniform(generator, low, high);
    let off = [within(-0.05, 0.05), within(-0.05, 0.05), within(-0.05, 0.05)];
    // Five: z, then y y y in a plane, and a turn of the tool; six: z y y, then a wrist x y x; seven: z and y by turns.
    let (length, axis) = match (count, joint) {
        (5, 0) => (within(0.2, 0.5), [0.0, 0.0, 1.0]),
        (5, 1) => (within(0.0, 0.2), [0.0, 1.0, 0.0]),
        (5, 2) => (within(0.3, 0.7), [0.0, 1.0, 0.0]),
        (5, 3) => (within(0.2, 0.6), [0.0, 1.0, 0.0]),
        (5, _) => (within(0.0, 0.15), [0.0, 0.0, 1.0]),
        (6, 0) => (within(0.2, 0.5), [0.0, 0.0, 1.0]),
        (6, 1) => (within(0.0, 0.2), [0.0, 1.0, 0.0]),
        (6, 2) => (within(0.3, 0.7), [0.0, 1.0, 0.0]),
        (6, 3) => (within(0.0, 0.3), [1.0, 0.0, 0.0]),
        (6, 4) => (within(0.2, 0.6), [0.0, 1.0, 0.0]),
        (6, _) => (within(0.0, 0.15), [1.0, 0.0, 0.0]),
        (_, odd) if odd % 2 == 1 => (within(0.0, 0.2), [0.0, 1.0, 0.0]),
        _ => (within(0.1, 0.45), [0.0, 0.0, 1.0]),
    };
    // From the elbow on links of six joints go forward.
    let origin_m = if count == 6 && joint >= 4 { [length, off[0], off[1]] } else { [off[0], off[1], length] };
    Joint { rpy_rad: off, ..turns(origin_m, axis) }
}

/// A joint that points anywhere, at the end of a link that leads anywhere.
fn any(generator: &mut ChaCha8Rng) -> Joint {
    let length = uniform(generator, 0.02, 0.5);
    let mut within = |low: f64, high: f64| uniform(generator, low, high);
    let rpy_rad = [within(-PI, PI), within(-FRAC_PI_2, FRAC_PI_2), within(-PI, PI)];
    let (origin, axis) = (direction(generator), direction(generator));
    Joint { rpy_rad, ..turns(origin.map(|part| length * part), axis) }
}

/// Anywhere on the unit sphere.
pub(super) fn direction(generator: &mut ChaCha8Rng) -> [f64; 3] {
    let (height, around) = (uniform(generator, -1.0, 1.0), uniform(generator, -PI, PI));
    let radius = (1.0 - height * height).sqrt();
    [radius * around.cos(), radius * around.sin(), height]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arms_are_all_or_named() {
        assert_eq!("all".parse::<Arms>().unwrap().0, ArmName::ALL);
        assert_eq!("seven,scara,seven".parse::<Arms>().unwrap().0, [ArmName::Scara, ArmName::Seven]);
        let error = "six,nine".parse::<Arms>().unwrap_err();
        assert!(error.contains("\"nine\"") && error.contains("planar-2r planar-3r scara"), "{error}");
    }
}
