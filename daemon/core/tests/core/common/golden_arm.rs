//! The arm of a golden file with its masses, as the scripts in golden write it.

use admittance_core::robot::{ArmDynamics, Chain, LinkInertia};
use nalgebra::{Matrix3, SVector};
use serde::Deserialize;

use super::golden_chain::GoldenChain;

#[derive(Deserialize)]
pub(crate) struct GoldenArm {
    #[serde(flatten)]
    chain: GoldenChain,
    links: Vec<LinkData>,
    reflected: Vec<f64>,
    gravity: [f64; 3],
}

#[derive(Deserialize)]
struct LinkData {
    mass: f64,
    center_of_gravity: [f64; 3],
    inertia: [[f64; 3]; 3],
}

impl GoldenArm {
    pub(crate) fn joints(&self) -> usize {
        self.chain.joints.len()
    }

    /// # Panics
    /// When the arm has another number of joints.
    pub(crate) fn chain<const N: usize>(&self) -> Chain<N> {
        self.chain.chain()
    }

    /// # Panics
    /// When the arm has another number of joints.
    pub(crate) fn dynamics<const N: usize>(&self) -> ArmDynamics<N> {
        let links = std::array::from_fn(|index| {
            let link = &self.links[index];
            LinkInertia {
                mass: link.mass,
                center_of_gravity: link.center_of_gravity.into(),
                inertia: Matrix3::from_fn(|row, column| link.inertia[row][column]),
            }
        });
        let reflected = SVector::from_column_slice(&self.reflected);
        ArmDynamics::new(self.chain(), links, reflected, self.gravity.into()).expect("the golden arm has masses")
    }
}
