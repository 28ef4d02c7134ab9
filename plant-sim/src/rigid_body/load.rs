//! What an arm with masses presses on.

use nalgebra::{SMatrix, SVector, Vector6};

/// What the arm presses on, and how that answers.
pub trait Load<const N: usize> {
    /// Where the joints are at a position in rad and move with a velocity in rad/s, so many seconds
    /// after the beginning.
    fn at(&self, position: &SVector<f64, N>, velocity: &SVector<f64, N>, elapsed_s: f64) -> Pressed<N>;
}

/// The answer of a load.
#[derive(Debug, Clone, Copy)]
pub struct Pressed<const N: usize> {
    /// What the robot exerts on the environment at the TCP, in N and N m, base frame.
    pub wrench: Vector6<f64>,
    /// Torque over velocity at the joints, N m s/rad, of what of it is damping and friction.
    pub resistance: Option<SMatrix<f64, N, N>>,
}

impl<const N: usize> Pressed<N> {
    /// Free space.
    pub fn nothing() -> Self {
        Self { wrench: Vector6::zeros(), resistance: None }
    }
}

/// A load from some seconds after its beginning on.
pub(super) struct Later<'a, L> {
    pub(super) load: &'a L,
    pub(super) by_s: f64,
}

impl<const N: usize, L: Load<N>> Load<N> for Later<'_, L> {
    fn at(&self, position: &SVector<f64, N>, velocity: &SVector<f64, N>, elapsed_s: f64) -> Pressed<N> {
        self.load.at(position, velocity, self.by_s + elapsed_s)
    }
}
