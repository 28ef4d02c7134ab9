//! Random limits of the drives, for `--drive-limits`.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::super::arm::{Arm, Kind};
use super::{Draw, log_uniform};

/// Streams of the random numbers of drives: those of the contacts are their indices.
const STREAMS: u64 = 1 << 63;
/// rad/s² of a joint that turns, m/s² of one that slides: from half of what Franka's FR3 takes on to drives that are
/// hardly felt.
const TURNS_RAD_S2: (f64, f64) = (5.0, 200.0);
const SLIDES_M_S2: (f64, f64) = (2.0, 50.0);
/// Jerk over acceleration in 1/s: 500 of the FR3.
const JERK_PER_ACCELERATION_1_S: (f64, f64) = (100.0, 2000.0);

/// What the drives of an arm allow of their references.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Drives {
    /// Of each joint, rad/s² or m/s².
    pub(crate) acceleration: Vec<f64>,
    /// rad/s³ or m/s³.
    pub(crate) jerk: Vec<f64>,
}

impl Draw {
    /// The same contact of an arm with drives that refuse jumps.
    pub(crate) fn with_drives(mut self, seed: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(STREAMS | self.index);
        let kinds: Vec<Kind> = match &self.arm {
            Arm::PlanarTwo(_) => vec![Kind::Turns; 2],
            Arm::Chain(chain) => chain.joints.iter().map(|joint| joint.kind).collect(),
        };
        // Joints of one arm are alike, within a factor.
        let share = log_uniform(&mut generator, 0.1, 1.0);
        let acceleration: Vec<f64> = kinds
            .iter()
            .map(|kind| {
                let (least, most) = if *kind == Kind::Turns { TURNS_RAD_S2 } else { SLIDES_M_S2 };
                log_uniform(&mut generator, least, least.max(most * share))
            })
            .collect();
        let (least, most) = JERK_PER_ACCELERATION_1_S;
        let jerk = acceleration.iter().map(|limit| limit * log_uniform(&mut generator, least, most)).collect();
        self.drives = Some(Drives { acceleration, jerk });
        self
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::controller::{Profile, Variant, controller, scenario};
    use super::super::AnyArm;

    #[test]
    fn drives_change_nothing_else_of_a_draw_and_are_told_to_both_sides() {
        for index in 0..24 {
            let AnyArm { draw, .. } = AnyArm::new(5, index).unwrap();
            let driven = draw.clone().with_drives(5);
            let drives = driven.drives.clone().unwrap();
            assert_eq!(drives.acceleration.len(), draw.arm.joints());
            assert!(drives.acceleration.iter().zip(&drives.jerk).all(|(a, j)| *a >= 2.0 && *j >= 100.0 * a * 0.999));
            assert_eq!(super::Draw { drives: None, ..driven.clone() }, draw);
            let config = controller(&driven, Profile::Default, Variant::Nominal).unwrap_or_else(|why| panic!("{why}"));
            admittance_runner::cycle::build(&config).unwrap();
            let scenario = scenario(&driven).unwrap().drives.unwrap();
            assert_eq!(config.limits.joint_acceleration_rad_s2, Some(scenario.joint_acceleration_rad_s2));
            assert_eq!(config.limits.joint_jerk_rad_s3, scenario.joint_jerk_rad_s3);
        }
    }
}
