//! M(q) by the composite-rigid-body algorithm (Featherstone, table 6.2).

use nalgebra::SMatrix;

use super::at::DynamicsAt;

impl<const N: usize> DynamicsAt<'_, N> {
    /// M(q), N×N in kg m² (kg m, kg where joints are prismatic): symmetric and positive definite, with the rotors on its diagonal.
    pub fn mass_matrix(&self) -> SMatrix<f64, N, N> {
        let mut mass = SMatrix::from_diagonal(&self.arm.reflected);
        // All links from the joint on, as if they were one body.
        let mut composite = self.arm.links;
        for joint in (0..N).rev() {
            if joint > 0 {
                let carried = self.placements[joint].inertia_for_parent(&composite[joint]);
                composite[joint - 1] = composite[joint - 1] + carried;
            }
            let mut force = &composite[joint] * &self.motion(joint, 1.0);
            mass[(joint, joint)] += self.along(joint, &force);
            for before in (0..joint).rev() {
                force = self.placements[before + 1].parent_has(&force);
                let entry = self.along(before, &force);
                mass[(joint, before)] = entry;
                mass[(before, joint)] = entry;
            }
        }
        mass
    }
}
