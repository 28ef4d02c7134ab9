//! The arms that the benchmark presses with: their shipped files, and a way to slide.

use admittancectl::demo::{CONTROLLERS, SCENARIO};

/// An arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Arm {
    /// The paper's, two joints in a plane.
    Planar,
    /// deploy/robots/six-joint.toml.
    Six,
    /// deploy/robots/seven-joint.toml, redundant.
    Seven,
    /// deploy/robots/eight-joint.toml, twice redundant.
    Eight,
}

/// Where it goes, by the unit of speed: down to the surface, then to and fro along it. Both ways press with half
/// of the unit or so, and are as long.
pub(crate) struct Motion {
    pub(crate) down: Vec<f64>,
    pub(crate) there: Vec<f64>,
    pub(crate) back: Vec<f64>,
}

impl Arm {
    /// Its configuration, and a scenario.
    pub(crate) fn files(self) -> (&'static str, &'static str) {
        match self {
            Self::Planar => (CONTROLLERS[3].config, SCENARIO),
            Self::Six => (
                include_str!("../../../../../deploy/robots/six-joint.toml"),
                include_str!("../../../../../plant-sim/scenarios/six-joint.toml"),
            ),
            Self::Seven => (
                include_str!("../../../../../deploy/robots/seven-joint.toml"),
                include_str!("../../../../../plant-sim/scenarios/seven-joint.toml"),
            ),
            Self::Eight => (
                include_str!("../../../../../deploy/robots/eight-joint.toml"),
                include_str!("../../../../../plant-sim/scenarios/eight-joint.toml"),
            ),
        }
    }

    /// How many directions may give way.
    pub(crate) fn most_directions(self) -> usize {
        match self {
            Self::Planar => 2,
            Self::Six | Self::Seven | Self::Eight => 6,
        }
    }

    pub(crate) fn motion(self) -> Motion {
        match self {
            // On a plane tilted by 25 degrees.
            Self::Planar => Motion { down: vec![0.0, -1.0], there: vec![1.0, -1.0], back: vec![-1.39, 0.09] },
            Self::Six | Self::Seven | Self::Eight => {
                let twist = |x: f64, z: f64| vec![x, 0.0, z, 0.0, 0.0, 0.0];
                Motion { down: twist(0.0, -1.0), there: twist(1.0, -0.5), back: twist(-1.0, -0.5) }
            }
        }
    }
}
