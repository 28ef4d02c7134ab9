//! Gaussian noise of the sensors, the same for the same seed.

use nalgebra::SVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// How strong the noise of each signal is: root mean square values.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NoiseLevels {
    /// Of each joint position, in rad.
    pub joint_position: f64,
    /// Of each joint velocity, in rad/s.
    pub joint_velocity: f64,
    /// Of each wrench axis, in N or N m.
    pub wrench: f64,
}

/// The sensors' noise source.
#[derive(Debug, Clone)]
pub struct Noise {
    levels: NoiseLevels,
    generator: ChaCha8Rng,
}

impl Noise {
    /// Noise of these levels; the same seed gives the same noise.
    pub fn new(levels: NoiseLevels, seed: u64) -> Self {
        Self { levels, generator: ChaCha8Rng::seed_from_u64(seed) }
    }

    /// Adds the next draw to one sample's signals: joint position, joint velocity, wrench, in this
    /// order.
    pub fn add<const N: usize, const D: usize>(
        &mut self,
        position: &mut SVector<f64, N>,
        velocity: &mut SVector<f64, N>,
        wrench: &mut SVector<f64, D>,
    ) {
        let NoiseLevels { joint_position, joint_velocity, wrench: wrench_level } = self.levels;
        if joint_position == 0.0 && joint_velocity == 0.0 && wrench_level == 0.0 {
            return;
        }
        // Drawn for noiseless signals too, so that switching one off does not change the others.
        position.iter_mut().for_each(|value| *value += joint_position * self.draw());
        velocity.iter_mut().for_each(|value| *value += joint_velocity * self.draw());
        wrench.iter_mut().for_each(|value| *value += wrench_level * self.draw());
    }

    fn draw(&mut self) -> f64 {
        StandardNormal.sample(&mut self.generator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    fn draws(seed: u64) -> Vec<[Vector2<f64>; 3]> {
        let mut noise = Noise::new(NoiseLevels { joint_position: 1e-5, joint_velocity: 1e-3, wrench: 2.0 }, seed);
        (0..5_000)
            .map(|_| {
                let mut signals = [Vector2::zeros(); 3];
                let [position, velocity, wrench] = &mut signals;
                noise.add(position, velocity, wrench);
                signals
            })
            .collect()
    }

    #[test]
    fn same_seed_same_noise_of_the_asked_strength() {
        let first = draws(7);
        assert_eq!(first, draws(7));
        assert_ne!(first, draws(8));
        for (signal, level) in [1e-5, 1e-3, 2.0].into_iter().enumerate() {
            let square: f64 = first.iter().map(|signals| signals[signal].norm_squared()).sum();
            let rms = (square / 10_000.0).sqrt();
            assert!((rms / level - 1.0).abs() < 0.03, "signal {signal}: rms {rms}");
        }
    }
}
